"""Games in scenes with flight: balls driven off the table, and jump shots."""

from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, billiards_v0
from billiards_env.envs import make_env, make_vector_env
from billiards_env.games import FOULS, GAMES, Setup, Stroke, custom_opening, opening, play
from billiards_env.games.facts import jumped
from billiards_env.games.game_state import is_in, on_table
from billiards_env.players.batch import play_batch
from billiards_env.scene import check_positions
from tests.helpers.games import flying, in_a_row, setup, words

SNOOKER = flying("snooker")
POSITIONS = in_a_row(16, {0: (-0.6, 0.0), 1: (-0.3, 0.0), 2: (0.2, 0.0)})  # the cue ball and two reds in a line


def shot_of(rules, velocity, positions=POSITIONS):
    """Plays a shot of a game in a scene with flight."""
    settings = Setup(rules, SNOOKER["scene"])
    return play(settings, custom_opening(settings, positions), Stroke(velocity))


def test_a_cue_ball_that_flies_off_the_table_gives_ball_in_hand():
    settings = Setup("nine_ball", Scene.named("jump_pool", 9))
    played = play(settings, opening(settings, np.random.default_rng(0)), Stroke((3.0, 3.0, 3.0), (-0.7, 0.0)))
    assert played.shot.potted[0]
    assert played.shot.pockets[0] < 0
    assert (words(played.verdict).foul, words(played.game.state).in_hand) == ("scratch", "anywhere")


SHOTS = [
    ((2.0, 0.0, 1.5), (1,), "jump_shot"),
    ((2.0, 0.0, 0.0), (), ""),
    ((1.0, 0.0, 1.2), (), ""),  # section 2, 20 b: it jumps onto the first red
]


@pytest.mark.parametrize(("velocity", "over", "foul"), SHOTS)
def test_a_jump_shot_is_a_foul_of_snooker_but_not_of_pool(velocity, over, foul):
    played = shot_of("snooker", velocity)
    assert (words(played.facts).jumped, words(played.verdict).foul) == (over, foul)
    assert words(played.verdict).penalty == 4 * bool(foul)
    assert words(shot_of("straight", velocity).verdict).foul in ("", "no_cushion")


def test_a_cue_ball_that_has_struck_a_ball_may_jump_over_another_one():  # section 2, 20 a
    positions = in_a_row(16, {0: (-0.4, 0.0), 1: (-0.3, 0.05), 2: (-0.15, -0.01)})
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


@pytest.mark.parametrize(("rules", "edition"), [(name, one) for name in GAMES for one in GAMES[name].editions])
def test_all_environments_play_the_same_games_with_flight_whose_states_can_be_set(rules, edition):
    arguments: dict[str, Any] = {**flying(rules), "edition": edition}
    env, envs, game = make_env(**arguments), make_vector_env(2, **arguments), billiards_v0.raw_env(**arguments)
    for one in (env, envs, game):
        one.reset(seed=1)
    rng, fouls, settings = np.random.default_rng(1), [], game.setup
    for _ in range(40):
        before = env.game
        target = before.positions[rng.choice(settings.legal(before.state))]
        away = target - before.positions[before.state.cue_balls[0]]
        action = rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        action[:2], action[4] = away / np.hypot(*away) * rng.uniform(0.2, 1.0), abs(action[4])  # with a raised cue
        game.step(action)
        *_, infos = envs.step(np.tile(action, (2, 1)))
        *_, over, _, info = env.step(action)
        fouls.append(FOULS[info["foul"]])
        assert game.env.get_state().tobytes() == env.get_state().tobytes()
        if rules == "snooker":
            assert fouls[-1] if np.isfinite(info["times_over"]).any() else fouls[-1] != "jump_shot"
        if over:  # then the infos of `envs` are those of the next game
            break
        assert all(np.array_equal(infos[name][0], info[name]) for name in info)
        for one in (env, envs, game.env):
            one.set_state(one.get_state())
        state = env.game.state
        check_positions(env.scene, env.game.positions, in_play=is_in(on_table(state), env.scene.n_balls))
    assert settings.game_rules.pockets or "driven_off" in fouls
    assert rules != "snooker" or "jump_shot" in fouls
