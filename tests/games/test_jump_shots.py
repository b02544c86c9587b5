"""Jump shots: the rules on facts alone, and games in scenes with flight."""

from typing import Any

import numpy as np
import pytest

from billiards_env import billiards_v0
from billiards_env.envs import make_env, make_vector_env
from billiards_env.games import FOULS, GAMES, Setup, Stroke, custom_opening, play, referee
from billiards_env.games.facts import jumped
from billiards_env.players.batch import play_batch
from tests.helpers.games import flying, one_shot, setup, state, words

BLUE, PINK, BLACK = 19, 20, 21

RULINGS = [
    # the game, its state, the facts, then: the foul and the penalty
    ("snooker", {}, {"first": 2}, "", 0),
    ("snooker", {}, {"first": 2, "jumped": 4}, "jump_shot", 4),  # WPBSA 3.10 a
    ("snooker", {"on_table": (0, BLUE, PINK, BLACK)}, {"first": 1 << BLUE, "jumped": 1 << BLACK}, "jump_shot", 5),
    ("snooker", {}, {"first": 1 << BLUE, "jumped": 2}, "wrong_ball", 5),  # the larger penalty
    ("snooker", {}, {"jumped": 2}, "no_hit", 4),
    *((rules, {}, {"first": 2, "cushion_after": True, "jumped": 4}, "", 0) for rules in ("nine_ball", "blackball")),
]


@pytest.mark.parametrize(("rules", "fields", "facts", "foul", "penalty"), RULINGS)
def test_the_penalty_for_a_jump_shot(rules, fields, facts, foul, penalty):
    _, (verdict,) = referee.judge_shots(rules, *one_shot(rules, state(rules, **fields), **facts))
    assert (words(verdict).foul, words(verdict).penalty, words(verdict).continues) == (foul, penalty, False)


SNOOKER = flying("snooker")
POSITIONS = np.column_stack((np.linspace(-1.1, 1.1, 16), np.full(16, 0.5)))
POSITIONS[:3] = [-0.6, 0.0], [-0.3, 0.0], [0.2, 0.0]  # the cue ball and two reds
SHOTS = [
    ((2.0, 0.0, 1.5), {1}, "jump_shot"),
    ((2.0, 0.0, 0.0), set(), ""),
    ((1.0, 0.0, 1.2), set(), ""),  # section 2, 20 b: it jumps onto the first red
]


@pytest.mark.parametrize(("velocity", "over", "foul"), SHOTS)
def test_a_jump_shot_is_a_foul_of_snooker_but_not_of_pool(velocity, over, foul):
    played = shot_of("snooker", velocity)
    assert (set(words(played.facts).jumped), words(played.verdict).foul) == (over, foul)
    assert words(played.verdict).penalty == 4 * bool(foul)
    assert words(shot_of("straight", velocity).verdict).foul in ("", "no_cushion")


def test_a_cue_ball_that_has_struck_a_ball_may_jump_over_another_one():  # section 2, 20 a
    positions = POSITIONS.copy()
    positions[:3] = [-0.4, 0.0], [-0.3, 0.05], [-0.15, -0.01]
    played = shot_of("snooker", (3.0, 0.0, 1.0), positions)
    assert (played.shot.first_hit, words(played.verdict).foul) == (1, "")
    times = np.linspace(0.0, 0.3, 3000)
    path, heights = played.shot.at(times), played.shot.heights_at(times)
    away = np.hypot(*(path[:, 0] - path[:, 2]).T)
    assert ((away < 0.05) & (heights[:, 0] > 0.02)).any()


def test_a_batch_of_candidates_has_the_same_jump_shots():
    settings = Setup("snooker", SNOOKER["scene"])
    batch = play_batch(settings, custom_opening(settings, POSITIONS), np.array([velocity for velocity, *_ in SHOTS]))
    assert [FOULS[foul] for foul in batch.verdicts["foul"]] == [foul for *_, foul in SHOTS]


def test_only_scenes_with_flight_record_jump_shots():
    game = setup("snooker").game_rules
    assert game is GAMES["snooker"]
    assert (jumped in game.facts, game.measures) == (True, ())
    settings = {rules: Setup(rules, SNOOKER["scene"]).game_rules.measures for rules in ("snooker", "straight")}
    assert settings == {"snooker": ("times_over",), "straight": ()}


def test_all_environments_call_the_same_jump_shots():
    env, envs, game = make_env(**SNOOKER), make_vector_env(2, **SNOOKER), billiards_v0.raw_env(**SNOOKER)
    for one in (env, envs, game):
        one.reset(seed=3, options={"positions": POSITIONS})
    action = np.zeros(env.action_space.shape, np.float32)
    action[[0, 4]] = 0.4, 0.5  # along x with a raised cue
    *_, infos = envs.step([action] * 2)
    game.step(action)
    *_, info = env.step(action)
    assert game.env.get_state().tobytes() == env.get_state().tobytes()
    assert infos["times_over"].tolist() == [info["times_over"].tolist()] * 2
    assert np.flatnonzero(np.isfinite(info["times_over"])).tolist() == [1]
    assert [FOULS[foul] for foul in (info["foul"], *infos["foul"])] == ["jump_shot"] * 3
    assert env.game.state.scores[:2].tolist() == [0, 4]


def test_a_random_shot_is_a_jump_shot_only_if_the_cue_ball_flies_over_a_ball():
    env = make_env(**SNOOKER | {"max_shots": 150, "layout": "random"})
    env.reset(seed=0)
    settings: Any = env.model.setup
    rng, jumps = np.random.default_rng(0), 0
    for _ in range(150):
        before = env.game
        action = rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        away = before.positions[rng.choice(settings.legal(before.state))] - before.positions[0]
        action[:5] = *(away / np.hypot(*away) * rng.uniform(0.2, 0.8)), 0.0, 0.0, rng.uniform(0.2, 0.8)
        info = env.step(action)[4]
        foul, over = FOULS[info["foul"]], np.isfinite(info["times_over"]).any()
        assert foul != "jump_shot" or over
        assert foul or not over
        jumps += foul == "jump_shot"
    assert jumps > 0


def shot_of(rules, velocity, positions=POSITIONS):
    """Plays a shot of a game in a scene with flight."""
    settings = Setup(rules, SNOOKER["scene"])
    return play(settings, custom_opening(settings, positions), Stroke(velocity))
