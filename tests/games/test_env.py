"""Games of several players in `Billiards-v0`, and their view in PettingZoo."""

import copy
import dataclasses
import re
import warnings
from collections import Counter
from typing import Any

import gymnasium as gym
import numpy as np
import pettingzoo
import pytest

from billiards_env import Scene, billiards_v0
from billiards_env.envs import BilliardsEnv, make_env, make_vector_env
from billiards_env.games import CALLS, GAMES, Call, Stroke, play, replay, to_dict
from billiards_env.games.game_state import ANYWHERE, PUSH_OUT
from billiards_env.games.placement import cue_ball_point
from billiards_env.scene.layouts import PLACING_GAP
from tests.helpers.environments import GAME_VARIANTS, name_of

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
    """Plays a random game in PettingZoo.

    Returns all outputs of the environment, arrays as bytes, and the total reward of each player.
    """
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
        assert list(env.rewards.values()) == env.infos[agent]["rewards"].tolist()
        assert sum(env.rewards.values()) == pytest.approx(0.0)
        total.update(env.rewards)
        assert env.possible_agents[env.infos[agent]["player"]] == agent
    return log, list(total.values())


def test_pettingzoo_has_the_masks_of_plans_from_the_reset_on():
    env: Any = billiards_v0.env(task="nine_ball", action="plan", layout="random", max_shots=3)
    env.reset(seed=0)
    for agent in env.agent_iter():
        _, _, termination, truncation, info = env.last()
        over = termination or truncation
        assert info["action_mask"].tolist() == (
            [0] * env.action_space(agent).n if over else env.action_masks().tolist()
        )
        env.step(None if over else env.action_space(agent).sample(info["action_mask"]))
    assert env.unwrapped.history().strokes
    assert not hasattr(billiards_v0.env(), "action_masks")


def test_every_game_is_in_a_variant():
    assert {variant["task"] for variant in GAME_VARIANTS} == GAMES.keys()


def observed(env, game, player):
    """Yields the features of a player and their expected values, from plain formulas."""
    state, setup, players = to_dict(game.state), env.model.setup, env.model.n_players
    cue, n, in_hand = int(game.state.cue_balls[0]), env.scene.n_balls, state["in_hand"]
    order, turns = [cue, *(0 if i == cue else i for i in range(1, n))], [(player + k) % players for k in range(players)]
    seen = env.decode(env.observe_as(player))
    yield seen["positions"], np.clip(game.positions[order] / env.scene.half_extents, -1, 1)
    yield seen["potted"], ~np.isin(order, state["on_table"])
    yield seen["legal_balls"], np.isin(order, setup.legal(game.state, player))[1:]
    yield seen["turn"], [player == state["player"]]
    yield seen["break"], [state["break_shot"]]
    yield seen.get("in_hand", ()), [in_hand == "behind", in_hand == "anywhere"] * ("in_hand" in seen)
    yield seen.get("own_pocket", ()), [player == 1] * (setup.rules == "one_pocket")
    choices = CALLS[PUSH_OUT:] if env.model.can_call else ()
    yield seen.get("choices", ()), [name in state["choices"] for name in choices]
    yield seen.get("fouls", ()), [min(state["fouls"][k] / 3, 1.0) for k in turns] if "fouls" in seen else []
    if setup.target is not None:
        scale = setup.target or setup.game_rules.most_points(n - 1)
        yield seen["scores"], np.clip([state["scores"][k] / scale for k in turns], -1, 1)


OF_GAMES = ["turn", "break", "in_hand", "own_pocket", "choices", "fouls", "scores"]


@variants
def test_a_game_has_the_bits_and_rewards_of_the_functions_of_the_rules(kwargs):
    usual = make_env(**{**kwargs, "observe": None})
    names = ["positions", "potted", "legal_balls", "turn", *(name for name in OF_GAMES[1:] if name in usual.features)]
    env = begun(**{**kwargs, "observe": names, "scratch_penalty": 0.5}, seed=2)
    env.action_space.seed(2)
    for _ in range(20):
        before = env.game
        _, reward, over, _, info = env.step(env.action_space.sample())
        scene, players = env.episode_scene, env.model.n_players
        setup = dataclasses.replace(env.model.setup, scene=scene)
        played, after = play(setup, before, env.stroke), env.game
        cue, (won, verdict) = after.state.cue_balls[0], (after.state.winner, played.verdict)
        if after.state.in_hand:  # the cue ball waits near the head spot for the next shot
            waiting = cue_ball_point(scene, played.game.positions, after.state, (scene.table.head_x, 0.0))
            assert after.positions[cue].tolist() == list(waiting)
            after.positions[cue] = played.game.positions[cue]
        assert after.positions.tobytes() == played.game.positions.tobytes()
        assert after.state == played.game.state
        assert (info["foul"], info["winner"], info["player"]) == (verdict.foul, won, before.state.player)
        assert info["next_player"] == after.state.player
        assert info["scores"].tolist() == after.state.scores[:players].tolist()
        assert set(np.flatnonzero(info["spotted"])) == set(to_dict(verdict)["spotted"])
        worth = verdict.points - verdict.penalty
        if setup.target is None:
            worth = 0 if won < 0 else 1 if won == before.state.player else -1
        assert reward == worth - 0.5 * played.shot.potted[before.state.cue_balls[0]]
        others = -reward / (players - 1)
        assert info["rewards"].tolist() == [reward if k == info["player"] else others for k in range(players)]
        for player in range(players):
            for seen, expected in observed(env, env.game, player):
                np.testing.assert_allclose(seen, expected, atol=1e-6)
        if over:
            env.reset()
            assert env.unwrapped.stroke is None


@variants
def test_random_games_in_pettingzoo_end_and_depend_on_the_seed_alone(kwargs):
    env: Any = billiards_v0.env(**kwargs)
    (log, total), game = play_game(env, 4), env.unwrapped
    *_, (_, _, _, terminated, truncated, _) = log
    shots, state = len(game.history().strokes), to_dict(game.game.state)
    assert len(log) == shots + len(env.possible_agents)  # a last turn for each player
    assert {row[3:5] for row in log[shots:]} == {(terminated, truncated)}
    assert terminated != truncated
    assert terminated or (shots, state["winner"]) == (game.env.model.max_shots, -1)
    if game.setup.target is not None:  # the points, minus the mean of those of the others
        scores, others = np.array(state["scores"]), len(total) - 1
        np.testing.assert_allclose(total, scores - (scores.sum() - scores) / others, atol=1e-9)
    elif terminated:
        assert total == [1.0 if k == state["winner"] else -1 / (len(total) - 1) for k in range(len(total))]
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
        make, {"rgb_array_list": lambda frames: all(frame.dtype == np.uint8 and frame.ndim == 3 for frame in frames)}
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


def test_the_last_numbers_of_an_action_are_the_call():
    env = begun("eight_ball", can_call=True)
    for numbers, call in [
        ((-1, -1, 0), Call(1, 0)),
        ((1, 1, -1), Call(15, 5)),
        ((0, 0, 1), Call(8, 3, "safety")),
        ((-0.99 + 2 / 15, -0.99 + 2 / 6, 0.01), Call(2, 1, "safety")),
    ]:
        env.reset(seed=0)
        step(env, 0, 0, 0, 0, *numbers)
        assert env.stroke.call == call


TOUCHING = {"positions": [[0.3, 0.2], [0.3, 0.2 + 2 * Scene.named("carom").balls.radius[0]], [-0.5, 0.1]]}
CHOICES = [
    # the game, the options of its start, the number of the choice, the choice, and the next player
    ("carom", TOUCHING, (1,), "rerack", 0),
    ("eight_ball", None, (0, 0, 0.5), "rerack", 1),  # WPA 3.3 d; the first third of the numbers is a safety
    ("eight_ball", None, (0, 0, 1.0), "break_again", 0),
]


@pytest.mark.parametrize(("task", "options", "numbers", "kind", "player"), CHOICES)
def test_the_last_number_of_an_action_may_be_a_choice_of_the_rules(task, options, numbers, kind, player):
    env = begun(task, can_call=True, options=options)
    if task == "eight_ball":
        step(env, 0, 0, 0, 0, 0, 0, -1)  # touches no ball
    before = env.game
    info = step(env, 0, 0, 0, 0, *numbers)
    assert (env.stroke, info["next_player"]) == (Stroke((0.0, 0.0), call=Call(kind=kind)), player)
    after = play(env.model.setup, before, env.stroke).game
    assert after.state == env.game.state
    assert after.positions[1:].tobytes() == env.game.positions[1:].tobytes()


def test_a_strike_may_be_a_miscue():
    env = begun("carom", action="strike")
    assert not step(env, 0.3, 0.1, 0.5, -0.6, 0.1)["miscue"]
    assert step(env, 0.3, 0.1, 1.0, 1.0, 0.0)["miscue"]
    assert "miscue" not in step(begun("carom"), 0.0, 0.0)


def test_actions_cover_the_whole_placement_area():
    env = begun("nine_ball")
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


def test_pettingzoo_makes_the_environment_by_name_and_clips_actions():
    env: Any = pettingzoo.make("aec", "billiards_env/billiards-v0", task="carom", n_players=3)
    assert env.possible_agents == ["player_0", "player_1", "player_2"]
    assert str(env) == "billiards_v0"
    env.reset(seed=0)
    env.step(np.array([0.0, 3.0], np.float32))
    assert env.unwrapped.history().strokes[0].velocity == (0.0, 8.0)


def test_states_of_another_number_of_players_are_refused():
    alone = make_env(task="nine_ball")
    alone.reset(seed=0)
    for n_players in (2, 3):
        with pytest.raises(ValueError, match="scene"):
            begun("nine_ball", n_players=n_players).set_state(alone.get_state())


def test_a_game_has_no_stroke_before_its_first_shot():
    env, envs = make_env(task="carom", n_players=2), make_vector_env(2, task="carom", n_players=2, max_shots=1)
    twin = copy.deepcopy(env)
    for _ in range(2):
        for one in (env, twin):
            one.reset(seed=0)
            assert one.stroke is None
        env.step([0.5, 0.1])
        assert env.stroke == Stroke((4.0, 0.8))
        twin.step([0.1, 0.1])
        twin.set_state(env.get_state())
        assert twin.stroke is copy.deepcopy(env).stroke is None
    envs.reset(seed=0)
    envs.step(np.zeros((2, 2)))
    assert envs.get_attr("stroke") == (None, None)


def test_the_attributes_of_games_in_a_vector_environment_are_those_of_each_game():
    envs = make_vector_env(3, task="nine_ball", n_players=2)
    observations, _ = envs.reset(seed=0)
    envs.step(np.zeros((3, 4)))
    assert [game.state.player for game in envs.get_attr("game")] == [1, 1, 1]
    assert [stroke.velocity for stroke in envs.get_attr("stroke")] == [(0.0, 0.0)] * 3
    waiting = envs.call("observe_as", 0)
    assert [observation.shape for observation in waiting] == [observations[0].shape] * 3
    with pytest.raises(AttributeError, match="expected several players"):
        make_vector_env(1).get_attr("stroke")
