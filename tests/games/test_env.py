"""Games of several players in `Billiards-v0`, and their view in PettingZoo."""

import copy
import re
import warnings
from collections import Counter
from typing import Any

import gymnasium as gym
import numpy as np
import pettingzoo
import pytest

from billiards_env import billiards_v0, simulate
from billiards_env.envs import BilliardsEnv, make_env, make_vector_env
from billiards_env.envs.actions import cue_strike
from billiards_env.games import FOULS, GAMES, Call, Stroke, play, replay, to_dict
from billiards_env.games.game_state import ANYWHERE
from billiards_env.scene.layouts import PLACING_GAP
from tests.helpers.environments import GAME_VARIANTS, name_of
from tests.helpers.games import in_a_row

with warnings.catch_warnings():
    # It imports an example by its old name if the dependencies of the example are installed.
    warnings.simplefilter("ignore")
    from pettingzoo.test import api_test, render_test

variants = pytest.mark.parametrize("kwargs", GAME_VARIANTS, ids=name_of)


def begun(task, seed=0, options=None, n_players=2, **kwargs) -> Any:
    """Returns an environment with a game that has begun."""
    env = make_env(task=task, n_players=n_players, **kwargs)
    env.reset(seed=seed, options=options)
    return env


def step(env, *numbers) -> dict[str, Any]:
    return env.step(np.array(numbers, np.float32))[4]


def play_game(env, seed):
    """Plays a random game in PettingZoo and returns all outputs of the environment, arrays as bytes."""
    env.reset(seed=seed)
    rng, log, total = np.random.default_rng(seed), [], Counter()
    for agent in env.agent_iter():
        observation, reward, termination, truncation, info = env.last()
        log.append((agent, observation.tobytes(), reward, termination, truncation, repr(info)))
        if termination or truncation:
            env.step(None)
            continue
        space = env.action_space(agent)
        choice = isinstance(space, gym.spaces.Discrete)
        env.step(rng.integers(space.n) if choice else (2 * rng.random(space.shape) - 1).astype(np.float32))
        assert sum(env.rewards.values()) == pytest.approx(0.0)
        total.update(env.rewards)
        assert env.possible_agents[env.infos[agent]["player"]] == agent
    return log, total


def test_every_game_is_in_a_variant():
    assert {variant["task"] for variant in GAME_VARIANTS} == GAMES.keys()


@variants
def test_a_game_has_the_bits_of_the_functions_of_the_rules(kwargs):
    env = make_env(**kwargs)
    env.reset(seed=2)
    env.action_space.seed(2)
    for _ in range(20):
        before = env.game
        *_, over, _, info = env.step(env.action_space.sample())
        assert env.model.setup is not None
        scene = env.episode_scene
        setup = env.model.setup if scene == env.scene else type(env.model.setup)(kwargs["task"], scene, 3)
        played, after = play(setup, before, env.stroke), env.game
        cue = after.state.cue_balls[0]
        if after.state.in_hand:  # the cue ball lies where it waits for the next shot
            after.positions[cue] = played.game.positions[cue]
        assert after.positions.tobytes() == played.game.positions.tobytes()
        assert after.state == played.game.state
        assert (info["foul"], info["winner"]) == (played.verdict.foul, after.state.winner)
        assert info["scores"].tolist() == after.state.scores[: env.model.n_players].tolist()
        assert set(np.flatnonzero(info["spotted"])) == set(to_dict(played.verdict)["spotted"])
        if over:
            env.reset()


@variants
def test_random_games_in_pettingzoo_end_for_all_players_and_depend_on_the_seed_alone(kwargs):
    env: Any = billiards_v0.env(**kwargs)
    log, total = play_game(env, 4)
    *_, (_, _, _, terminated, truncated, _) = log
    shots, game = len(env.unwrapped.history().strokes), env.unwrapped
    winner, scores = game.game.state.winner, to_dict(game.game.state)["scores"]
    assert len(log) == shots + len(total)  # a last turn for each player
    assert {row[3:5] for row in log[shots:]} == {(terminated, truncated)}
    assert terminated != truncated
    if truncated:
        assert (shots, winner) == (game.env.model.max_shots, -1)
    elif GAMES[kwargs["task"]].target is None:
        lost = -1 / (len(total) - 1)
        assert list(total.values()) == [1.0 if k == winner else lost for k in range(len(total))]
    else:
        points = np.array(scores, float)
        others = (points.sum() - points) / (len(points) - 1)
        np.testing.assert_allclose(list(total.values()), points - others, atol=1e-9)
    assert log == play_game(env, 4)[0]
    assert log != play_game(env, 3)[0]
    *_, last = replay(game.history())
    assert last.game.state == game.game.state


@variants
def test_pettingzoos_api_test(kwargs, capsys):
    api_test(billiards_v0.env(**kwargs), num_cycles=100)  # pyright: ignore[reportArgumentType]
    assert "Passed" in capsys.readouterr().out


def test_pettingzoos_render_test():
    pytest.importorskip("pygame")

    # Slow shots are short, and a window shows films in real time.
    def make(render_mode: str = "human") -> Any:
        return billiards_v0.env(render_mode=render_mode, max_speed=0.02)

    render_test(
        make,
        {"rgb_array_list": lambda frames: all(frame.dtype == np.uint8 and frame.ndim == 3 for frame in frames)},
    )


@variants
def test_the_info_has_the_documented_keys(kwargs):
    env = make_env(**kwargs)
    tables = str(BilliardsEnv.__doc__).partition("## Games")[2].partition("## Arguments")[0]
    documented = dict(re.findall(r"^ +\| `(\w+)` +\| .*\| (\S+) +\|$", tables, re.MULTILINE))
    documented |= dict.fromkeys(env.model.randomize, "drawn")
    if env.action != "strike":
        del documented["miscue"]
    if env.action == "plan":
        documented["action_mask"] = "drawn"
    starts = {"drawn": None, "0": 0, "-1": -1, "False": False, "`max_shots`": env.model.max_shots}
    _, first = env.reset(seed=0)
    assert first.keys() == documented.keys()
    for key, value in first.items():
        start = starts[documented[key]]
        assert start is None or (value == start).all(), key
    info = env.step(env.action_space.sample())[4]
    assert {key: (np.shape(value), value.dtype) for key, value in info.items()} == {
        key: (np.shape(value), value.dtype) for key, value in first.items()
    }


def test_a_player_who_loses_by_a_foul_has_reward_minus_one():
    places = in_a_row(16, {0: (0.9, 0.265), 8: (1.1, 0.465)})
    env: Any = billiards_v0.raw_env("eight_ball", max_shots=1)
    env.reset(options={"positions": places})
    env.step(np.array([0.2, 0.2, 0.0, 0.0], np.float32))
    assert env.rewards == {"player_0": -1.0, "player_1": 1.0}
    assert (all(env.terminations.values()), any(env.truncations.values())) == (True, False)
    assert (FOULS[env.infos["player_1"]["foul"]], env.infos["player_1"]["winner"]) == ("wrong_ball", 1)


def test_a_player_who_pots_continues():
    env = begun("straight", n_object_balls=2, options={"positions": [[-0.635, 0.0], [0.635, 0.3], [0.0, -0.5]]})
    info = step(env, 0.25, 0.05625, 0.0, 0.0)
    assert np.flatnonzero(info["potted"]).tolist() == [1]
    assert info["rewards"].tolist() == [1.0, -1.0]
    assert (info["player"], info["next_player"]) == (0, 0)
    info = step(env, 0.0, 0.0, 0.0, 0.0)
    assert (info["player"], info["next_player"]) == (0, 1)


def test_observations():
    state = {"on_table": [0, 1, 8, 9, 10], "solids": 1, "player": 1, "in_hand": "anywhere"}
    observe = ["positions", "potted", "legal_balls", "turn", "break", "in_hand"]
    env = begun("eight_ball", options={"positions": in_a_row(16), "state": state}, observe=observe)
    for player, own in ((0, {9, 10}), (1, {1})):
        observation = env.observe_as(player)
        assert env.observation_space.contains(observation)
        seen = env.decode(observation)
        assert seen["positions"][1:] == pytest.approx(in_a_row(16)[1:] / [1.27, 0.635])
        assert np.flatnonzero(~seen["potted"].astype(bool)).tolist() == [0, 1, 8, 9, 10]
        assert set(1 + np.flatnonzero(seen["legal_balls"])) == own
        assert [seen[name].tolist() for name in ("turn", "break", "in_hand")] == [[player == 1], [0], [0, 1]]


def test_observed_scores_begin_with_the_observer():
    options = {"positions": in_a_row(5), "state": {"scores": [1, -9, 2]}}
    env = begun("straight", n_players=3, n_object_balls=4, options=options)
    for player, scores in enumerate(([0.25, -1, 0.5], [-1, 0.5, 0.25], [0.5, 0.25, -1])):
        assert env.decode(env.observe_as(player))["scores"].tolist() == scores


def test_the_cue_ball_is_observed_first():
    env = begun("carom")
    red, own = [0.5, 0.0], [-0.5, 0.0]
    assert env.decode(env.observe_as(0))["positions"][1:].tolist() == [red, own]
    env.step([0.0, 0.0])
    seen = env.decode(env.observe_as(1))["positions"].tolist()
    assert seen[:2] == [own, red]


def test_the_last_numbers_of_an_action_are_the_call():
    env = make_env(task="eight_ball", n_players=2, can_call=True)
    for numbers, call in [
        ((-1, -1, 0), Call(1, 0)),
        ((1, 1, -1), Call(15, 5)),
        ((0, 0, 1), Call(8, 3, "safety")),
        ((-0.99 + 2 / 15, -0.99 + 2 / 6, 0.01), Call(2, 1, "safety")),
    ]:
        env.reset(seed=0)
        step(env, 0, 0, 0, 0, *numbers)
        assert env.stroke.call == call


def test_a_strike_gives_spin():
    env, action = begun("carom", action="strike"), np.array([0.3, 0.1, 0.5, -0.6, 0.1], np.float32)
    before = env.game
    info = env.step(action)[4]
    velocity, spin, miscue = cue_strike(action, env.scene, env.max_speed)
    assert env.stroke == Stroke(tuple(velocity), spin=tuple(spin))
    assert bool(info["miscue"]) is bool(miscue) is False
    shot = simulate(env.scene, before.positions, velocity, spins=spin)
    assert shot.positions.tobytes() == env.game.positions.tobytes()
    assert step(env, 0.3, 0.1, 1.0, 1.0, 0.0)["miscue"]
    assert "miscue" not in step(begun("carom"), 0.0, 0.0)


def test_a_push_out_and_a_shot_that_is_handed_back():
    env = begun("nine_ball", can_call=True, options={"positions": in_a_row(10), "state": {"choices": ["push_out"]}})
    assert env.decode(env.observe_as(0))["choices"].tolist() == [1, 0, 0]
    observation, *_, info = env.step([0, -0.1, 0, 0, 0, 0, 1])
    assert (info["foul"], env.decode(observation)["choices"].tolist()) == (0, [0, 1, 0])
    info = step(env, 0.5, 0, 0, 0, 0, 0, 1)
    assert (info["player"], info["next_player"], info["shot_time"]) == (1, 0, 0.0)
    assert env.stroke == Stroke((0.0, 0.0), call=Call(kind="hand_back"))


def test_the_own_pocket_is_observed():
    env = begun("one_pocket")
    assert [env.decode(env.observe_as(player))["own_pocket"].tolist() for player in (0, 1)] == [[0], [1]]


def test_consecutive_fouls_are_observed():
    env = begun("nine_ball", options={"positions": in_a_row(10), "state": {"fouls": [1, 2]}})
    assert env.decode(env.observe_as(0))["fouls"].tolist() == pytest.approx([1 / 3, 2 / 3])
    assert env.decode(env.observe_as(1))["fouls"].tolist() == pytest.approx([2 / 3, 1 / 3])


def test_a_penalty_in_snooker_is_a_reward_for_the_other_player():
    env = begun("snooker")
    observation, reward, *_, info = env.step(np.zeros(4))
    assert (reward, info["rewards"].tolist()) == (-4.0, [-4.0, 4.0])
    assert env.decode(observation)["scores"].tolist() == pytest.approx([4 / 147, 0.0])


def test_a_scratch_penalty_goes_to_the_other_players():
    places = in_a_row(10, {0: (-1.1, 0.465)})
    env = begun("nine_ball", n_players=3, scratch_penalty=0.5, options={"positions": places})
    _, reward, *_, info = env.step([-0.5, 0.5, 0.0, 0.0])
    assert info["scratch"]
    assert (reward, info["rewards"].tolist()) == (-0.5, [-0.5, 0.25, 0.25])


def test_actions_cover_the_whole_placement_area():
    env = make_env(task="nine_ball", n_players=2)
    r = env.scene.balls.radius[0]
    x_end, y_end = 1.27 - r - PLACING_GAP, 0.635 - r - PLACING_GAP
    for action, place in [
        ((-1, 0), (-x_end, 0)),
        ((1, 0.5), (-0.635, 0.5 * y_end)),
        ((0, -0.5), (-(x_end + 0.635) / 2, -0.5 * y_end)),
        ((9, 0), (-0.635, 0)),
    ]:
        env.reset(seed=0)
        step(env, 0, 0, *action)
        assert env.stroke.place == pytest.approx(place)
    assert env.game.state.in_hand == ANYWHERE
    step(env, 0, 0, 0.25, 0.5)
    assert env.stroke.place == pytest.approx((0.25 * x_end, 0.5 * y_end))


def test_a_cue_ball_in_hand_waits_at_a_free_place_near_the_head_spot():
    env = begun("nine_ball", options={"positions": in_a_row(10, {0: (-1.1, 0.465)})})
    observation = env.step([-0.5, 0.5, 0.0, 0.0])[0]
    assert env.decode(observation)["in_hand"].tolist() == [0, 1]
    assert env.positions[0] == pytest.approx([-0.635, 0.0])
    assert not env.potted[0]


def test_frames():
    pytest.importorskip("pygame")
    env, films, blind = (begun("nine_ball", render_mode=mode) for mode in ("rgb_array", "rgb_array_list", None))
    first = env.render()
    assert np.array_equal(films.render(), [first])
    for each in (env, films, blind):
        info = step(each, 0.1, 0, 0, 0)
        assert each.game.positions.tobytes() == env.game.positions.tobytes()
    second, frames = env.render(), films.render()
    assert (first.shape, first.dtype) == (second.shape, np.uint8)
    assert (first != second).any()
    assert all((other == second).all() for other in (env.render(), frames[-1]))
    assert abs(len(frames) - info["shot_time"] * films.metadata["render_fps"]) <= 2
    env.close()


def test_pettingzoo_makes_the_environment_by_name_and_clips_actions():
    env: Any = pettingzoo.make("aec", "billiards_env/billiards-v0", task="carom", n_players=3)
    assert env.possible_agents == ["player_0", "player_1", "player_2"]
    assert str(env) == "billiards_v0"
    env.reset(seed=0)
    env.step(np.array([0.0, 3.0], np.float32))
    assert env.unwrapped.history().strokes[0].velocity == (0.0, 8.0)


def test_the_states_of_a_game_are_shared_by_all_environments():
    kwargs: dict[str, Any] = {"task": "snooker", "n_players": 2, "n_object_balls": 8, "can_call": True, "miss": True}
    env, envs = make_env(**kwargs), make_vector_env(3, **kwargs)
    env.reset(seed=0)
    envs.reset(seed=5)
    env.action_space.seed(0)
    for _ in range(6):
        action = env.action_space.sample()
        envs.set_state(env.get_state())
        results, all_results = env.step(action), envs.step(np.stack([action] * 3))
        assert all(row.tobytes() == results[0].tobytes() for row in all_results[0])
        assert (envs.get_state() == env.get_state()).all()


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("player", 2, "player = "),
        ("cue_balls", 11, "cue_balls = "),
        ("choices", 1 << 4, "has the choice 'replace'"),
        ("object_balls", -1, "object_balls = "),
        ("object_balls", 1 << 10, "object_balls = "),
        ("reds", 40, "reds = "),
        ("n_players", 4, "n_players = "),
        ("target", 5, "target = "),
        ("miss", True, "miss = "),
        ("call_shot", True, "call_shot = "),
    ],
)
def test_states_with_wrong_numbers_are_refused(name, value, message):
    env = begun("nine_ball")
    state = env.get_state()
    state["game"][name] = value
    with pytest.raises(ValueError, match=message):
        env.set_state(state)


def test_states_of_another_number_of_players_are_refused():
    alone = make_env(task="nine_ball")
    alone.reset(seed=0)
    for n_players in (2, 3):
        with pytest.raises(ValueError, match="scene"):
            begun("nine_ball", n_players=n_players).set_state(alone.get_state())


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: env], ids=["a copy", "a state"])
def test_a_game_with_two_cue_balls_continues_with_the_same_bits(copied):
    env = begun("carom", action="cut")
    env.step([0.0, 0.0])
    twin = copied(env) if copied is copy.deepcopy else make_env(task="carom", n_players=2, action="cut")
    if twin is not env and copied is not copy.deepcopy:
        twin.set_state(env.get_state())
    assert env.step([0.1, 0.5])[0].tobytes() == twin.step([0.1, 0.5])[0].tobytes()


def test_the_attributes_of_games_in_a_vector_environment_are_those_of_each_game():
    envs = make_vector_env(3, task="nine_ball", n_players=2)
    observations, _ = envs.reset(seed=0)
    envs.step(np.zeros((3, 4)))
    assert [game.state.player for game in envs.get_attr("game")] == [1, 1, 1]
    assert [stroke.velocity for stroke in envs.get_attr("stroke")] == [(0.0, 0.0)] * 3
    waiting = envs.call("observe_as", 0)
    assert len(waiting) == 3
    assert all(np.shape(observation) == observations[0].shape for observation in waiting)
    with pytest.raises(AttributeError, match="expected several players"):
        make_vector_env(1).get_attr("stroke")
