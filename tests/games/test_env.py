import warnings
from collections import Counter
from typing import Any

import numpy as np
import pettingzoo
import pytest

from billiards_env import simulate
from billiards_env.envs.actions import cue_strike
from billiards_env.games import GAMES, Call, Stroke, billiards_v0, replay, to_dict
from billiards_env.games.state import ANYWHERE
from billiards_env.scene.layouts import MARGIN
from tests.helpers.games import in_a_row

with warnings.catch_warnings():
    # It imports an example by its old name if the dependencies of the example are installed.
    warnings.simplefilter("ignore")
    from pettingzoo.test import api_test, render_test

VARIANTS = [
    *({"rules": rules} for rules in GAMES),
    {"rules": "nine_ball", "n_players": 3},
    {"rules": "straight", "n_players": 4, "n_object_balls": 5, "target": 4},
    {"rules": "carom", "n_players": 3, "target": 2, "layout": "random"},
    {"rules": "eight_ball", "layout": "tight_rack", "mode": "pit", "dt": 1 / 120, "fix": "move_back"},
    {"rules": "straight", "layout": "random", "n_object_balls": 3, "max_shots": 7},
    {"rules": "straight", "target": 5, "can_call": True},
    {"rules": "carom", "target": 2, "action": "strike"},
    {"rules": "eight_ball", "can_call": True},
    {"rules": "nine_ball", "can_call": True},
    {"rules": "snooker", "n_object_balls": 7, "can_call": True, "miss": True, "action": "strike"},
]
variants = pytest.mark.parametrize("kwargs", VARIANTS, ids=lambda k: ",".join(map(str, k.values())))


def make(**kwargs) -> Any:
    return billiards_v0.env(**kwargs)


def begun(rules, seed=0, options=None, **kwargs) -> Any:
    """Returns an environment without PettingZoo's wrappers, with a game that has begun."""
    env = billiards_v0.raw_env(rules, **kwargs)
    env.reset(seed, options)
    return env


def play_game(env, seed):
    """Plays a random game and returns all outputs of the environment, arrays as bytes."""
    env.reset(seed=seed)
    rng, log, total = np.random.default_rng(seed), [], Counter()
    for agent in env.agent_iter():
        observation, reward, termination, truncation, info = env.last()
        log.append((agent, observation.tobytes(), reward, termination, truncation, repr(info)))
        if termination or truncation:
            env.step(None)
            continue
        env.step((2 * rng.random(env.action_space(agent).shape) - 1).astype(np.float32))
        assert sum(env.rewards.values()) == pytest.approx(0.0)
        total.update(env.rewards)
        assert env.infos[agent]["shooter"] == agent
    return log, total


@variants
def test_random_games_end_for_all_players_and_depend_on_the_seed_alone(kwargs):
    env = make(**kwargs)
    for seed in (3, 4):
        log, total = play_game(env, seed)
        *_, (_, _, _, terminated, truncated, _) = log
        shots, game = len(env.unwrapped.history().strokes), env.unwrapped
        winner, scores = game.game.state.winner, to_dict(game.game.state)["scores"]
        assert len(log) == shots + len(total)  # a last turn for each player
        assert {row[3:5] for row in log[shots:]} == {(terminated, truncated)}
        assert terminated != truncated
        if truncated:
            assert (shots, winner) == (game.max_shots, -1)
        elif GAMES[kwargs["rules"]].target is None:
            lost = -1 / (len(total) - 1)
            assert list(total.values()) == [1.0 if k == winner else lost for k in range(len(total))]
        else:
            points = np.array(scores, float)
            others = (points.sum() - points) / (len(points) - 1)
            np.testing.assert_allclose(list(total.values()), points - others, atol=1e-9)
    assert log == play_game(env, 4)[0] == play_game(make(**kwargs), 4)[0]
    assert log != play_game(env, 3)[0]


@variants
def test_pettingzoos_api_test(kwargs, capsys):
    api_test(make(**kwargs), num_cycles=200)
    assert "Passed" in capsys.readouterr().out


def test_pettingzoos_render_test():
    pytest.importorskip("pygame")
    # Slow shots are short, and a window shows films in real time.
    render_test(
        lambda render_mode="human": make(render_mode=render_mode, max_speed=0.02),
        {"rgb_array_list": lambda frames: all(frame.dtype == np.uint8 and frame.ndim == 3 for frame in frames)},
    )


def test_a_player_who_loses_by_a_foul_has_reward_minus_one():
    places = in_a_row(16, {0: (0.9, 0.265), 8: (1.1, 0.465)})
    env = begun("eight_ball", max_shots=1, options={"positions": places})
    env.step(np.array([0.2, 0.2, 0.0, 0.0], np.float32))
    assert env.rewards == {"player_0": -1.0, "player_1": 1.0}
    assert (all(env.terminations.values()), any(env.truncations.values())) == (True, False)
    assert (env.infos["player_1"]["foul"], env.infos["player_1"]["winner"]) == ("wrong_ball", "player_1")


def test_a_player_who_pots_continues():
    env = begun("straight", n_object_balls=2, options={"positions": [[-0.635, 0.0], [0.635, 0.3], [0.0, -0.5]]})
    env.step(np.array([0.25, 0.05625, 0.0, 0.0], np.float32))
    assert env.infos["player_0"]["potted"] == [1]
    assert env.rewards == {"player_0": 1.0, "player_1": -1.0}
    assert env.agent_selection == "player_0"
    env.step(np.zeros(4, np.float32))
    assert env.agent_selection == "player_1"


def test_observations():
    positions = in_a_row(16)
    state = {"on_table": [0, 1, 8, 9, 10], "solids": 1, "player": 1, "in_hand": "anywhere"}
    env = begun("eight_ball", options={"positions": positions, "state": state})
    assert env.agent_selection == "player_1"
    for agent, own in (("player_0", {9, 10}), ("player_1", {1})):
        seen = env.observe(agent)
        assert env.observation_space(agent).contains(seen)
        balls = seen[:64].reshape(16, 4)
        assert balls[:, :2] == pytest.approx(positions / [1.27, 0.635])
        assert np.flatnonzero(balls[:, 2]).tolist() == [1, 8, 9, 10]
        assert set(np.flatnonzero(balls[:, 3])) == own
        assert seen[64:].tolist() == [agent == "player_1", 0, 0, 1]


def test_observed_scores_begin_with_the_observer():
    options = {"positions": in_a_row(5), "state": {"scores": [1, -9, 2]}}
    env = begun("straight", n_players=3, n_object_balls=4, options=options)
    for agent, scores in (("player_0", [0.25, -1, 0.5]), ("player_1", [-1, 0.5, 0.25]), ("player_2", [0.5, 0.25, -1])):
        assert env.observe(agent)[-3:].tolist() == scores


def test_the_cue_ball_is_observed_first():
    env = begun("carom")
    red, own = [0.5, 0.0], [-0.5, 0.0]
    assert env.observe("player_0")[[4, 5, 8, 9]].tolist() == [*red, *own]
    env.step(np.array([0.0, 0.0], np.float32))
    seen = env.observe("player_1")
    assert seen[[0, 1]].tolist() == own
    assert seen[[8, 9]].tolist() == red


def test_the_last_numbers_of_an_action_are_the_call():
    env = billiards_v0.raw_env("eight_ball", can_call=True)
    for numbers, call in [
        ((-1, -1, 0), Call(1, 0)),
        ((1, 1, -1), Call(15, 5)),
        ((0, 0, 1), Call(8, 3, "safety")),
        ((-0.99 + 2 / 15, -0.99 + 2 / 6, 0.01), Call(2, 1, "safety")),
    ]:
        env.reset(seed=0)
        env.step(np.array([0, 0, 0, 0, *numbers], np.float32))
        assert env.history().strokes[0].call == call


def test_a_strike_gives_spin():
    env, action = begun("carom", action="strike"), np.array([0.3, 0.1, 0.5, -0.6, 0.1], np.float32)
    env.step(action)
    scene = env.setup.scene
    velocity, spin, miscue = cue_strike(action, scene, env.max_speed)
    assert env.history().strokes[0] == Stroke(tuple(velocity), spin=tuple(spin))
    assert env.infos["player_0"]["miscue"] is bool(miscue) is False
    shot = simulate(scene, env.history().opening.positions, velocity, spins=spin)
    assert shot.positions.tobytes() == env.game.positions.tobytes()
    env.step(np.array([0.3, 0.1, 1.0, 1.0, 0.0], np.float32))
    assert env.infos["player_0"]["miscue"] is True
    env = begun("carom")
    env.step(np.zeros(2, np.float32))
    assert "miscue" not in env.infos["player_0"]


def test_a_push_out_and_a_shot_that_is_handed_back():
    env = begun("nine_ball", can_call=True, options={"positions": in_a_row(10), "state": {"choices": ["push_out"]}})
    assert env.observe("player_0")[44:47].tolist() == [1, 0, 0]
    env.step(np.array([0, -0.1, 0, 0, 0, 0, 1], np.float32))
    assert (env.infos["player_0"]["foul"], env.infos["player_0"]["choices"]) == ("", ["hand_back"])
    assert env.observe("player_1")[44:47].tolist() == [0, 1, 0]
    env.step(np.array([0.5, 0, 0, 0, 0, 0, 1], np.float32))
    assert env.agent_selection == "player_0"
    assert env.history().strokes[1] == Stroke((0.0, 0.0), call=Call(kind="hand_back"))
    assert env.infos["player_0"]["shot_time"] == 0.0


def test_consecutive_fouls_are_observed():
    env = begun("nine_ball", options={"positions": in_a_row(10), "state": {"fouls": [1, 2]}})
    assert env.observe("player_0")[-2:].tolist() == pytest.approx([1 / 3, 2 / 3])
    assert env.observe("player_1")[-2:].tolist() == pytest.approx([2 / 3, 1 / 3])


def test_a_penalty_in_snooker_is_a_reward_for_the_other_player():
    env = begun("snooker")
    env.step(np.zeros(4, np.float32))
    assert env.rewards == {"player_0": -4.0, "player_1": 4.0}
    assert env.observe("player_1")[-2:].tolist() == pytest.approx([4 / 147, 0.0])


def test_actions_cover_the_whole_placement_area():
    env = billiards_v0.raw_env("nine_ball")
    r = env.setup.scene.balls.radius[0]
    x_end, y_end = 1.27 - r - MARGIN, 0.635 - r - MARGIN
    for action, place in [
        ((-1, 0), (-x_end, 0)),
        ((1, 0.5), (-0.635, 0.5 * y_end)),
        ((0, -0.5), (-(x_end + 0.635) / 2, -0.5 * y_end)),
        ((9, 0), (-0.635, 0)),
    ]:
        env.reset(seed=0)
        env.step(np.array([0, 0, *action], np.float32))
        assert env.history().strokes[0].place == pytest.approx(place)
    assert env.game.state.in_hand == ANYWHERE
    env.step(np.array([0, 0, 0.25, 0.5], np.float32))
    assert env.history().strokes[1].place == pytest.approx((0.25 * x_end, 0.5 * y_end))


def test_a_history_can_be_replayed():
    env = make(rules="eight_ball")
    play_game(env, 1)
    *_, last = replay(env.unwrapped.history())
    assert last.game.positions.tobytes() == env.unwrapped.game.positions.tobytes()
    assert to_dict(last.game.state) == to_dict(env.unwrapped.game.state)


def test_frames():
    pytest.importorskip("pygame")
    env, films, blind = (begun("nine_ball", render_mode=mode) for mode in ("rgb_array", "rgb_array_list", None))
    first = env.render()
    assert np.array_equal(films.render(), [first])
    for each in (env, films, blind):
        each.step(np.array([0.1, 0, 0, 0], np.float32))
        assert each.game.positions.tobytes() == env.game.positions.tobytes()
    second, frames = env.render(), films.render()
    assert (first.shape, first.dtype) == (second.shape, np.uint8)
    assert (first != second).any()
    assert all((other == second).all() for other in (env.render(), frames[-1]))
    assert abs(len(frames) - env.infos["player_0"]["shot_time"] * films.metadata["render_fps"]) <= 2
    assert films.render() == []
    env.close()


def test_pettingzoo_makes_the_environment_by_name_and_clips_actions():
    env: Any = pettingzoo.make("aec", "billiards_env/billiards-v0", rules="carom", n_players=3)
    assert env.possible_agents == ["player_0", "player_1", "player_2"]
    assert str(env) == "billiards_v0"
    env.reset(seed=0)
    env.step(np.array([0.0, 3.0], np.float32))
    assert env.unwrapped.history().strokes[0].velocity == (0.0, 8.0)
