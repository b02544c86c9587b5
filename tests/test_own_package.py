"""The package of `docs/own_package.md`: each of its entries, wherever the environments take a name."""

import functools
import importlib
import json
import pickle
import re
import shutil
import sys
import time
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from billiards_env import Scene, register_game, register_layout, register_measure, register_task, simulate
from billiards_env.__main__ import main
from billiards_env.bench import benchmark as bench
from billiards_env.engine.measures import AFTER_IMPACT, MEASURES
from billiards_env.envs import load_state, make_env, make_vector_env, save_state
from billiards_env.envs.actions import ACTIONS
from billiards_env.envs.observations import FEATURES
from billiards_env.envs.tasks import TASKS
from billiards_env.games import GAMES, Call, History, Setup, Stroke, custom_opening, opening, play, records
from billiards_env.jit import inlined
from billiards_env.play.__main__ import make_history, make_parser
from billiards_env.play.model import begin
from billiards_env.players.env_player import acting
from billiards_env.players.named import PLAYERS, find_player
from billiards_env.players.situation import game_situation
from billiards_env.scene import layouts, scene
from tests.helpers.environments import same
from tests.helpers.processes import run

ROOT = Path(__file__).resolve().parents[1]
DATA, PAGE = ROOT / "tests" / "data", (ROOT / "docs" / "own_package.md").read_text(encoding="utf-8")
TABLES: list[Any] = [TASKS, FEATURES, MEASURES, ACTIONS, layouts.LAYOUTS, scene.NAMED, GAMES, PLAYERS]
ID = "billiards_env:Billiards-v0"
OWN: dict[str, Any] = {
    "task": "my_billiards:cushion_first",
    "action": "my_billiards:polar",
    "observe": ["positions", "my_billiards:from_centre"],
    "layout": "my_billiards:from_the_corner",
    "scene": "my_billiards:slow_pool",
    "max_shots": 3,
}
GAME, PLAYER = "my_billiards:first_pot", "my_billiards:at_nearest"
RNG = np.random.default_rng


@pytest.fixture(scope="module", autouse=True)
def path():
    """Lets Python find the package. Its entries are removed after the tests."""
    before = [{*table} for table in TABLES]
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DATA)
        yield
    for name in ("my_billiards", "cowboy_pool"):
        sys.modules.pop(name, None)
    for table, names in zip(TABLES, before, strict=True):
        for name in {*table} - names:
            del table[name]


def any_env(**arguments: Any) -> Any:
    """Returns the environment of `gym.make`, of any type for the checker of types."""
    return gym.make(ID, **arguments)


def test_the_page_shows_the_package_and_its_code_runs():
    title, code = re.findall(r'^```python title="([^"]*)"\n(.*?)^```$', PAGE, re.MULTILINE | re.DOTALL)[1]
    assert f'--8<-- "{(DATA / "my_billiards.py").relative_to(ROOT)}"' in PAGE
    made: dict[str, Any] = {}
    exec(compile(code, title, "exec"), made)
    for name in ("env", "envs", "games"):
        made[name].reset(seed=0)
        made[name].step(made[name].action_space.sample())


def test_single_and_vector_environments_specs_and_states_agree_bit_for_bit(tmp_path):
    env, envs = any_env(**OWN), gym.make_vec(ID, num_envs=3, **OWN)
    twin: Any = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert twin.spec.kwargs == OWN
    actions = RNG(0).uniform(-1, [1, -0.7], (2, 3, 2)).astype(np.float32)  # too slow for a scratch
    many = [envs.reset(seed=5)[0], *(envs.step(action)[:2] for action in actions)]
    for k in range(3):
        for one in (env, twin):
            same(one.reset(seed=5 + k)[0], many[0][k])
            save_state(tmp_path / "state.npz", one.unwrapped.get_state())
            for action, (observations, rewards) in zip(actions[:, k], many[1:], strict=True):
                observation, reward, *_ = one.step(action)
                same((observation, float(reward)), (observations[k], float(rewards[k])))
            first = make_env(**{**OWN, "task": "cushion_first"})  # the same task by its short name
            first.set_state(load_state(tmp_path / "state.npz")[()])
            same(first.step(actions[0, k])[0], many[1][0][k])
    seen = env.unwrapped.decode(many[0])
    assert seen["from_centre"] == pytest.approx(np.hypot(0.45 * 2.54, 0.4 * 1.27) / np.hypot(1.27, 0.635))
    assert np.allclose(seen["positions"][:, 0], [-0.9, -0.8])
    envs.close()


IN_LINE = [[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0]]


def test_a_measure_is_recorded_in_shots_environments_and_infos():
    name = "my_billiards:impacts"
    shot: Any = simulate("pool", IN_LINE, [3.0, 0.0], measures=[name], record=True)
    assert shot.measures["impacts"] == sum(event["kind"] == "ball_ball" for event in shot.events) > 1
    env = any_env(observe=[name], n_object_balls=2, max_speed=3.0).unwrapped
    env.reset(seed=0, options={"positions": IN_LINE})
    observation, *_, info = env.step(np.array([1.0, 0.0]))
    assert info["impacts"] == shot.measures["impacts"] == pytest.approx(100 * observation[0])
    entry = MEASURES["impacts"]
    for wrong, error in (
        ("positions", "that no other feature has"),
        ("first_hit_velocities", "that no other measure has"),
    ):
        with pytest.raises(ValueError, match=f"name = {wrong!r}: expected a name {error}"):
            register_measure(wrong, entry)
    with pytest.raises(TypeError, match=r"record of measure 'impacts' = .*: expected a kernel"):
        register_measure("impacts", entry._replace(record=lambda *_: None))


def test_a_changed_measure_replaces_the_old_one():
    """As in a changed cell of a notebook."""
    module, entry = importlib.import_module("my_billiards"), MEASURES["impacts"]

    @inlined
    def record_second(moment, i, j, k, scene, state, shots):
        if moment == AFTER_IMPACT and shots.first_hit[k] < 0:
            shots.measures[k].impacts[:] = j

    record_second.__module__ = module.__name__

    def measured() -> Any:
        shot: Any = simulate("pool", IN_LINE, [3.0, 0.0], measures=["impacts"])
        return shot.measures["impacts"].tolist()

    assert measured() >= 1
    for size in (2, 3):  # also if only the shape changes
        register_measure("impacts", entry._replace(shape=(size,), record=record_second))
        assert measured() == [1.0] * size
    register_measure("impacts", entry)
    assert measured() >= 1


def test_workers_import_the_package():
    """A started process has neither the entries nor the module, for `gym.make` as for a pickled environment."""
    env = make_env(**OWN)
    makers = [functools.partial(gym.make, ID, **OWN), functools.partial(pickle.loads, pickle.dumps(env))]
    workers = gym.vector.AsyncVectorEnv(makers, context="spawn", shared_memory=False)
    try:
        observations, _ = workers.reset(seed=[3, 3])
        same(observations, np.repeat(env.reset(seed=3)[0][None], 2, axis=0))
        action = env.action_space.sample()
        same(workers.step(np.stack([action, action]))[0], np.repeat(env.step(action)[0][None], 2, axis=0))
    finally:
        workers.close()


def test_commands_take_the_names(capsys, tmp_path, monkeypatch):
    layout = ("--scene", OWN["scene"], "--layout", OWN["layout"])
    main(["evaluate", PLAYER, "at_nearest:0.9", "--beside", "--task", OWN["task"], *layout[2:], "--episodes", "5"])
    table = capsys.readouterr().out.splitlines()
    assert [row.split()[:2] for row in table[1:]] == [[PLAYER, "5"], ["at_nearest:0.9", "5"]]
    monkeypatch.setattr(bench, "EPISODES", 3)
    main(["bench", PLAYER, "--tasks", "Pot1-v0"])
    assert "Pot1-v0" in capsys.readouterr().out
    main(["simulate", *layout, "--velocity", "1", "1", "--out", str(tmp_path / "shot.json")])
    start = json.loads((tmp_path / "shot.json").read_text())["positions"][0]
    assert start == [-0.45 * 2.54, -0.4 * 1.27]


def test_a_game_is_played_saved_and_shown_as_in_the_environment():
    args = make_parser().parse_args(["--rules", GAME, "--scene", OWN["scene"], "--balls", "2", "--seed", "1"])
    history = make_history(args, RNG(1))
    assert begin(history, ("human", PLAYER), 8.0, 1 / 60, 1.0, False).setup.rules == GAME
    env = any_env(task=GAME, n_players=2, n_object_balls=2).unwrapped
    setup, player = Setup(GAME, Scene.named(OWN["scene"], 2)), find_player(PLAYER, env)
    act, (observation, _) = acting(player, env, seed=0), env.reset(seed=0)
    first = game = env.game
    strokes, terminated, info = [], False, {}
    while not terminated:
        observation, _, terminated, _, info = env.step(act(observation))
        strokes.append(env.stroke)
        game = play(setup, game, strokes[-1]).game
        same((env.positions, env.game.state), (game.positions, game.state))
    assert info["winner"] == info["player"]
    record = records.from_json(records.to_json(records.record_game(History(setup, first, tuple(strokes)))))
    same(records.replay(record).positions, game.positions)
    layout = opening(setup, RNG(0), OWN["layout"])
    assert find_player("my_billiards:at_nearest:0.25", setup)(game_situation(setup, layout, 8.0), RNG(0)).place


COWBOY, LAYOUT = "cowboy_pool:cowboy", [[0.6, 0.1], [1.07, 0.435], [-0.5, 0.0], [-0.5, 0.3]]
POT, MISS = (1.5, 1.035), (-1.0, 0.0)


@pytest.mark.parametrize(
    ("fields", "velocity", "call", "points", "inning_points", "winner"),
    [
        ({}, POT, Call(), 1, 1, -1),
        ({"inning_points": 4, "scores": [7, 0]}, POT, Call(), 1, 5, -1),
        ({"inning_points": 4, "scores": [7, 0]}, MISS, Call(), -4, 0, -1),
        ({"scores": [100, 0]}, POT, Call(1, 3), 1, 1, 0),
        ({"scores": [100, 0]}, POT, Call(1, 2), 0, 0, -1),  # another pocket
    ],
)
def test_cowboy_pool(fields, velocity, call, points, inning_points, winner):
    setup = Setup(COWBOY, Scene.named("pool", 3), call_shot=True)
    played = play(setup, custom_opening(setup, LAYOUT, fields), Stroke(velocity, call=call))
    assert (played.verdict.points, played.game.state.inning_points) == (points, inning_points)
    assert (played.game.state.winner, played.facts.caroms) == (winner, 0)


def test_a_game_with_its_own_state_plays_everywhere(tmp_path):
    kind: dict[str, Any] = {"task": COWBOY, "n_players": 2}
    env, envs = any_env(**kind).unwrapped, cast(Any, gym.make_vec(ID, num_envs=2, **kind))
    two_players = pytest.importorskip("billiards_env.billiards_v0", exc_type=ImportError).env(task=COWBOY)
    start = {"positions": LAYOUT, "state": {"inning_points": 4, "scores": [7, 0]}}
    env.reset(seed=0, options=start)
    two_players.reset(seed=0, options=start)
    envs.reset(seed=0, options=start)
    action = np.array([*POT, 0, 0][: env.action_space.shape[0]], np.float32) / 8
    envs.step(np.stack([action, action]))
    env.step(action)
    two_players.step(action)
    assert (env.game.state.inning_points, env.get_state()["game"]["inning_points"]) == (5, 5)
    assert two_players.unwrapped.game.state == env.game.state
    assert envs.unwrapped.get_state()["game"]["inning_points"].tolist() == [5, 5]
    save_state(tmp_path / "state.npz", env.get_state())
    env.set_state(load_state(tmp_path / "state.npz")[()])
    record = records.record_game(two_players.unwrapped.history())
    assert json.loads(records.to_json(record))["state"]["inning_points"] == 4
    again: Any = records.replay(records.from_json(records.to_json(record)))
    assert again.state == env.game.state
    args = make_parser().parse_args(["--rules", COWBOY, "--balls", "3", "--seed", "1"])
    assert begin(make_history(args, RNG(1)), ("human", "human"), 8.0, 1 / 60, 1.0, False).setup.rules == COWBOY


def test_a_training_takes_the_names():
    agents = pytest.importorskip("agents.ppo", exc_type=ImportError)
    from agents.config import Config

    config = Config(timesteps=0, env=OWN, policy={"head": "gaussian"})
    assert config.env["max_shots"] == 3
    assert Config(timesteps=0, env={"task": OWN["task"]}).env["layout"] == "from_the_corner"
    same(agents.make_vector(config, 2).reset(seed=0)[0], make_vector_env(2, **OWN).reset(seed=0)[0])


WRONG = [
    ({"task": "eight_bal"}, r"task = 'eight_bal': expected one of 'pot', .* \(did you mean 'eight_ball'\?\)"),
    ({"task": "none:pot"}, r"task = 'none:pot': expected a module that can be imported \(ModuleNotFoundError: No"),
    ({"task": "broken:pot"}, r"task = 'broken:pot': expected a module that can .* \(ZeroDivisionError: division"),
    ({"task": "ending:pot"}, r"task = 'ending:pot': expected a module that can be imported \(SystemExit: 3\)"),
    ({"task": ":pot"}, r"task = ':pot': expected a module that can be imported"),
    ({"task": "my_billiards:cushion_firs"}, r"'my_billiards' registers \(did you mean 'cushion_first'\?\)"),
    ({"task": "my_billiards:first_pots", "n_players": 2}, r"task = .*registers \(did you mean 'first_pot'\?\)"),
    ({"observe": ["my_billiards:centre"]}, "observe = 'my_billiards:centre': expected a name that 'my_billiards' reg"),
    ({"observe": ["from_centre", "my_billiards:from_centre"]}, "observe = .*: expected .* each of them once"),
    ({"action": "none:polar"}, "action = 'none:polar': expected a module"),
    ({"layout": "none:corner"}, "layout = 'none:corner': expected a module"),
    ({"scene": "none:pool"}, "scene = 'none:pool': expected a module"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG)
def test_names_without_an_entry_are_refused(arguments, message, tmp_path, monkeypatch):
    (tmp_path / "broken.py").write_text("1 / 0\n")
    (tmp_path / "ending.py").write_text("raise SystemExit(3)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match=message):
        gym.make(ID, **arguments)


MAKERS = [
    (lambda: gym.make(ID, n_balls=3), "n_balls = 3: expected one of .*'n_object_balls'", "render_mode"),
    (lambda: gym.make_vec(ID, num_envs=2, thread=3), "thread = 3: expected one of .*'threads'", "threads"),
]


@pytest.mark.parametrize(("make", "message", "own"), MAKERS)
def test_an_unknown_argument_is_refused_with_the_closest_one(make, message, own):
    with pytest.raises(TypeError, match=message) as caught:
        make()
    assert f"(did you mean {message.rpartition(' ')[2].removeprefix('.*')}?)" in str(caught.value)
    assert own in str(caught.value)


def test_the_environment_of_pettingzoo_refuses_an_unknown_argument():
    billiards_v0 = pytest.importorskip("billiards_env.billiards_v0", exc_type=ImportError)
    with pytest.raises(TypeError, match=r"targets = 3: expected one of .*\(did you mean 'target'\?\)"):
        billiards_v0.env(targets=3)


def test_an_entry_has_its_type_and_a_name_of_its_own():
    task, old = TASKS["pot"], dict(TASKS)
    register_task("pot", task)  # the same entry
    wrong: list[Any] = ["a:b", "a b", "", "größe", 3]
    for name in wrong:
        with pytest.raises(ValueError, match=r"name = .*: expected ASCII letters"):
            register_task(name, task)
    with pytest.raises(ValueError, match="name = 'pot': expected a name that no other task has"):
        register_task("pot", task._replace(max_shots=2))
    with pytest.raises(ValueError, match="name = 'clear': expected a name that no other task has"):
        register_task("clear", task)
    with pytest.raises(ValueError, match="name = 'nine_ball': expected a name that no other game has"):
        register_game("nine_ball", GAMES["ten_ball"])
    with pytest.raises(TypeError, match=r"game = Task.*: expected the type Game, not Task"):
        register_game("mine", task)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match="layout = 3: expected the type function, not int"):
        register_layout("mine", 3)  # pyright: ignore[reportArgumentType]
    assert old == TASKS


def test_a_module_may_be_loaded_again_and_long_names_are_kept():
    module = importlib.import_module("my_billiards")
    before = TASKS["cushion_first"].judge
    importlib.reload(module)
    assert TASKS["cushion_first"].judge is module.judge_cushion_first is not before
    register_task("cushion_first", TASKS["cushion_first"]._replace(max_shots=2))  # a changed cell of a notebook
    assert TASKS["cushion_first"].max_shots == 2
    importlib.reload(module)
    name = "cushion_first_with_a_name_of_many_letters"
    register_task(name, TASKS["cushion_first"])
    env, envs = make_env(task=name), make_vector_env(2, task=f"my_billiards:{name}")
    env.reset(seed=0)
    envs.reset(seed=0)
    assert env.get_state()["task"] == name.encode()
    envs.set_state(env.get_state())
    with pytest.raises(ValueError, match=r"state\['task'\] = .*: expected"):
        make_env(task="cushion_first").set_state(env.get_state())


POINTS = """
from billiards_env.envs import make_env, step
env = make_env(task="my_billiards:cushion_first")
env.reset(seed=0, options={"positions": [[0.4, 0.3], [0.4, -0.3], [0.8, 0.2]]})
points = env.step([0.0, 0.8])[1]
print(int(points), sum(step.score_shots.stats.cache_hits.values()))
"""


def test_a_changed_kernel_or_constant_of_another_package_is_compiled_again(tmp_path):
    """The machine code of the scoring is in the cache of this package, under the name of a function of this package."""
    text, worth = (DATA / "my_billiards.py").read_text(), tmp_path / "worth.py"
    own = tmp_path / "my_billiards.py"
    own.write_text(text.replace("WORTH = 1  # points", "from worth import WORTH"))
    worth.write_text("WORTH = 1\n")

    def points() -> str:
        shutil.rmtree(tmp_path / "__pycache__", ignore_errors=True)  # Python compares only seconds and sizes
        return run("-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})" + POINTS)[0]

    assert points().startswith("1 ")
    worth.write_text(f"WORTH = 2 + {time.time_ns() % 10**9}e-12\n")  # no earlier run has compiled it
    assert points() == "2 0\n"
    own.write_text(own.read_text().replace(">= LEAST", "> LEAST"))
    assert points() == "0 0\n"
    assert points() == "0 1\n"
