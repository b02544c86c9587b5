"""The programs in `examples` run with small sizes."""

import dataclasses
import gc
import importlib.util
import json
import re
import runpy
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from billiards_env.bench.frozen import FROZEN
from billiards_env.games import Setup, opening
from billiards_env.players.situation import game_situation
from billiards_env.scene import Physics, Scene

FOLDER = Path(__file__).resolve().parents[2] / "examples"
PAGE = (FOLDER.parent / "docs" / "examples.md").read_text(encoding="utf-8")


def load(name, *packages):
    """Returns the functions of a program, or skips the test without its packages."""
    for package in packages:
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"needs {package}")
    return runpy.run_path(str(FOLDER / f"{name}.py"))


def test_the_extra_train_has_what_a_progress_bar_needs():
    PPO = pytest.importorskip("stable_baselines3").PPO
    with pytest.warns(match="rich is experimental"):
        PPO("MlpPolicy", "CartPole-v1", n_steps=64, device="cpu").learn(64, progress_bar=True)
    train = re.search(r"^train = \[(.*?)\]", (FOLDER.parent / "pyproject.toml").read_text(), re.MULTILINE | re.DOTALL)
    assert train is not None
    assert {"rich", "tqdm"} <= set(re.findall(r'"([\w-]+)', train[1]))


def test_every_program_is_on_the_page():
    programs = {path.name for path in FOLDER.glob("[a-z]*.*")}
    assert set(re.findall(r"^\| `examples/([\w.]+)`", PAGE, re.MULTILINE)) == programs


def test_stable_baselines3_trains_and_writes_curves(tmp_path, capsys):
    pytest.importorskip("tensorboard")
    model = load("sb3_ppo", "stable_baselines3")["run"](10240, str(tmp_path))
    assert model.num_timesteps == 10240
    assert re.search(r"total_timesteps +\| 10240 ", capsys.readouterr().out)
    assert list(tmp_path.rglob("events*"))


def test_a_policy_trains_on_a_fitted_table():
    run, carom = load("calibrated_table", "stable_baselines3")["run"], Scene.named("carom")
    table = dataclasses.replace(carom, physics=Physics(mu_roll=0.0046))
    run.__globals__.update(DEFAULT=carom, TABLE=table)  # the engines of "carom", which other tests compile too
    shares = run(512, shots=3, episodes=20, seeds=[0])
    assert set(shares) == {"fitted", "default"}
    assert all(0.0 <= share["mean"] <= 1.0 for share in shares.values())


def test_tree_search_plays_an_episode():
    assert 0.0 <= load("tree_search")["main"](["--episodes", "1", "--simulations", "10"]) <= 9.0


def test_a_function_from_text_to_text_plays_plans():
    program, asked = load("language_model"), []

    def model(text):
        asked.append(text)
        return "I pot the nine." if text.endswith("speed 2 of 5") else program["respond"](text)

    scores = program["run"]("Pot1-v0", 10, model, ("random",))
    assert list(scores) == ["text model", "random"]
    assert scores["text model"] > scores["random"]
    assert len(asked) == 20  # each first answer is wrong, and each second one is played
    assert asked[1].startswith(asked[0])
    assert "Error: answer = 'I pot the nine.': expected a line such as: ball 3, pocket B" in asked[1]
    assert program["choose"](lambda text: "ball 9, pocket A, speed 1", "", [2, 3]) == program["parse"]("2 1 1", [2, 3])


def test_the_text_of_a_table_has_names_and_diamonds():
    arguments = {**FROZEN["NineBall-v0"].arguments, "action": "plan"}
    program, env = load("language_model"), gym.make("Billiards-v0", **arguments).unwrapped
    positions = np.zeros((10, 2))
    positions[:3] = [[-0.635, 0.0], [0.635, 0.3175], [0.0, 0.3]]
    positions[3:] = [[0.1 * k, -0.3] for k in range(7)]
    env.reset(options={"positions": positions.tolist()})
    lines = program["describe"](env, "Run out.", 30).splitlines()
    assert {"pocket D: 8.00, 4.00", "cue ball: 2.00, 2.00", "ball 1: 6.00, 3.00, legal"} <= set(lines)
    assert len([line for line in lines if line.endswith(", not legal")]) == 8


@pytest.mark.parametrize(
    "answer", ["ball 2, pocket B, speed 3 of 5", "Ball 2 - Pocket b - Speed 3", "2, 2, 3", "2 2 3"]
)
def test_an_answer_is_an_action_of_the_environment(answer):
    assert load("language_model")["parse"](answer, [2]) == np.ravel_multi_index((1, 1, 2), (9, 6, 5))


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ("the eight", "answer = 'the eight': expected a line such as: ball 3, pocket B, speed 2 of 5"),
        ("ball 1, pocket B, speed 2", "ball = 1: expected one of the legal balls 2, 3"),
        ("ball 2, pocket G, speed 2", "pocket = G: expected one of A, B, C, D, E, F"),
        ("2 7 2", "pocket = 7: expected one of A, B, C, D, E, F"),
        ("ball 2, pocket B, speed 6", "speed = 6: expected a number from 1 to 5"),
    ],
)
def test_a_wrong_answer_has_one_clear_message(answer, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        load("language_model")["parse"](answer, [2, 3])


PROGRAMS = [
    pytest.param("optuna_sweep", "optuna", 2048, {"episodes": 50}, 0.0, 1.0, marks=pytest.mark.tools),
    pytest.param("torchrl_collector", "torchrl", 2048, {}, -0.2, 0.2, marks=pytest.mark.tools),
    ("rllib_ppo", "ray", 2048, {"num_envs": 32}, -0.3, 0.3),
    ("goals", "stable_baselines3", 1100, {"episodes": 100}, 0.0, 1.0),
]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("name", "package", "steps", "arguments", "least", "most"), PROGRAMS)
def test_a_program_returns_a_number_in_its_range(name, package, steps, arguments, least, most, capsys):
    value = load(name, package)["run"](steps, **arguments)
    chance, value = value if isinstance(value, tuple) else (0.5, getattr(value, "best_value", value))
    assert 0.1 < chance < 0.9
    assert least <= value <= most
    assert name != "goals" or "total_timesteps" in capsys.readouterr().out


@pytest.mark.parametrize("learners", [["DQN"], ["DQN", "MaskablePPO"]], ids=" and ".join)
def test_learners_choose_among_plans(learners, monkeypatch, capsys):
    if len(learners) == 1:
        monkeypatch.setitem(sys.modules, "sb3_contrib", None)
        program = load("plans", "stable_baselines3")
    else:
        program = load("plans", "stable_baselines3", "sb3_contrib")
    shares = program["run"](1100, episodes=100)
    assert list(shares) == ["random plans with the masks", *learners]
    assert 0.1 < shares.pop("random plans with the masks") < 0.9
    assert all(0.0 <= share <= 1.0 for share in shares.values())
    said = capsys.readouterr().out
    assert ("pip install 'billiards-env[masks]'" in said) is (len(learners) == 1)
    assert said.count("Using cpu device") == len(learners)  # each prints its progress


def test_ppo_trains_from_pixels():
    assert load("pixels", "stable_baselines3")["run"](256, num_envs=16).observation_space.shape == (3, 84, 84)


def test_self_play_learns_from_games_and_its_model_plays_in_the_window(tmp_path):
    program, file = load("self_play", "stable_baselines3", "sb3_contrib"), str(tmp_path / "model.zip")
    shares = program["run"](128 * 32, 128 * 32, n_games=4, rivals=("random", "geometric"), save=file)
    assert list(shares) == ["random", "geometric"]
    assert all(0.0 <= share <= 1.0 for pair in shares.values() for share in pair)
    assert shares["random"][0] > 0.5
    game, rng, player = Setup("nine_ball", Scene.named("pool", 9)), np.random.default_rng(0), program["player"](file)
    state = opening(game, rng, "random")
    stroke = player(game_situation(game, state, 8.0), rng)
    assert 0.0 < np.hypot(*stroke.velocity) <= 8.0 * (1 + 1e-6)


@pytest.mark.tools
@pytest.mark.filterwarnings("ignore")  # of Minari: unknown author; temporary folder
def test_a_clone_pots_balls():
    clone, teacher = load("dataset_cloning")["run"](64, episodes=100)
    assert 0 <= clone < 0.8 < teacher
    gc.collect()


def test_the_notebook_runs_top_to_bottom(monkeypatch, capsys):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pytest.importorskip("stable_baselines3")
    notebook = json.loads((FOLDER / "first_steps.ipynb").read_text(encoding="utf-8"))
    assert all(cell.get("outputs", []) == [] for cell in notebook["cells"])
    names = {"__name__": "notebook"}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), "notebook", "exec"), names)
    pyplot.close("all")
    output = capsys.readouterr().out
    failures = re.findall(r"exact (.*), timestep (.*)", output)
    assert len(failures) == 4
    assert all(exact != stepped for exact, stepped in failures)
    match = re.search(r"the policy pots (\d+\.\d)% of 1,000 new layouts", output)
    assert match is not None
    assert float(match[1]) > 10.0
