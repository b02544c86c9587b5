"""A shot has the same verdict and the same next state in `play`, in `play_batch` and in the tasks that are games."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from billiards_env.envs.arguments import make_model
from billiards_env.envs.episodes import Episodes
from billiards_env.envs.tasks import TASKS
from billiards_env.games import CALL, FOULS, GAMES, Call, Stroke, custom_opening, opening, play, referee
from billiards_env.games.facts import facts_of_shots
from billiards_env.games.game_state import changed, in_play, members, set_of
from billiards_env.players.batch import best_call, play_batch
from tests.helpers.games import record_of, setup, state

CALLED = [name for name in GAMES if GAMES[name].callable]
CASES = (
    [("break", rules) for rules in GAMES] + [("mid game", rules) for rules in GAMES] + [("called", r) for r in CALLED]
)
MAX_SPEED = 8.0  # m/s; a power of two, so actions are exact


def mid_game(settings, rng):
    """Returns a random state in the middle of a game, with the cue ball in place."""
    game, rules = opening(settings, rng, "random"), settings.game_rules
    balls = np.array(members(game.state.object_balls))
    if not rules.pockets:
        fields = {"cue_balls": (2, 0), "object_balls": set_of((0, 1)), "player": 1} if rng.random() < 0.5 else {}
        return game._replace(state=changed(game.state, **fields))
    kept = balls[rng.random(len(balls)) < rng.uniform(0.2, 1.0)].tolist()
    always = range(len(balls) - 5, len(balls) + 1) if rules.has_spots else (rules.deciding_ball or 1,)
    fields = {"object_balls": set_of((*kept, *(ball % (len(balls) + 1) for ball in always)))}
    own = {"solids": rng.integers(-1, 2), "colour": rng.random() < 0.5, "free_ball": rng.random() < 0.3}
    fields |= {name: value for name, value in own.items() if name in rules.state_type.names}
    return game._replace(state=changed(game.state, **fields))


def played_as_task(settings, game, velocities):
    """Returns the states after shots of a task that is a game, (m,), and whether the episodes are over."""
    n = settings.scene.n_balls - 1
    model = make_model(scene="pool", task=settings.rules, n_object_balls=n, max_speed=MAX_SPEED, layout="random")
    episodes = Episodes(len(velocities), model)
    episodes.state.positions[:], episodes.state.game[:] = game.positions, np.array([game.state])
    episodes.state.in_play[:] = [i == 0 or game.state.object_balls >> i & 1 for i in range(n + 1)]
    episodes.state.over[:] = False
    rewards = np.empty(len(velocities))
    episodes.shoot(0, len(velocities), velocities / MAX_SPEED, rewards, episodes.observer.new(len(velocities)))
    return episodes.state.game, episodes.state.over


def shots(m, seed, game):
    """Returns velocities (m, 2) and spins (m, 3): half of the shots towards an object ball, the others anywhere."""
    rng = np.random.default_rng(seed)
    headings, cue = rng.uniform(-np.pi, np.pi, m), game.positions[game.state.cue_balls[0]]
    to = game.positions[rng.choice(members(game.state.object_balls), m // 2)] - cue
    headings[: m // 2] = np.arctan2(to[:, 1], to[:, 0]) + rng.normal(0.0, 0.02, m // 2)
    velocities = rng.uniform(0.5, 7.0, m)[:, None] * np.column_stack((np.cos(headings), np.sin(headings)))
    return velocities, rng.uniform(-50.0, 50.0, (m, 3))


def one_by_one(settings, game, velocities, spins, places):
    played = []
    for velocity, spin, place in zip(velocities.tolist(), spins.tolist(), places, strict=True):
        positions = game.positions.copy()
        positions[game.state.cue_balls[0]] = place
        start, stroke = game._replace(positions=positions), Stroke(tuple(velocity), spin=tuple(spin))
        if settings.call_shot:
            lowest = SimpleNamespace(facts=(shot := play(settings, start, stroke)).facts, pots=sorted(shot.pots))
            stroke = stroke._replace(call=best_call(settings, game.state, cast(Any, lowest)))
        played.append(play(settings, start, stroke))
    return played


@pytest.mark.parametrize(("kind", "rules"), CASES)
def test_a_batch_and_a_task_have_the_results_of_single_shots(kind, rules):
    settings, rng, continues = setup(rules, call_shot=kind == "called"), np.random.default_rng(0), 0
    for seed in range(1 if kind == "break" else 8):
        game = mid_game(settings, rng) if kind != "break" else opening(settings, rng)
        game = game._replace(state=changed(game.state, in_hand=0))  # a break with the cue ball in place
        velocities, spins = shots(30, seed, game)
        places = np.repeat(game.positions[None, game.state.cue_balls[0]], len(spins), axis=0)
        if kind != "break":
            places[:, 1] += np.linspace(-1e-3, 1e-3, len(spins))
        batch = play_batch(settings, game, velocities, spins, places if kind != "break" else None)
        single = one_by_one(settings, game, velocities, spins, places)
        assert batch.verdicts.tolist() == [played.verdict.tolist() for played in single]
        assert batch.pockets.tolist() == [played.shot.pockets.tolist() for played in single]
        continues += batch.verdicts["continues"].sum()
        for after, positions, played in zip(batch.states, batch.positions, single, strict=True):
            found = {"free_ball", "touching", "in_sight"} & {*after.dtype.names}
            state = changed(played.game.state, **dict.fromkeys(found, 0))
            assert after == state or played.verdict.rack  # a new rack may put the cue ball in hand
            if not played.verdict.spotted and not played.verdict.rack:  # a batch does not look for a free place
                lying = list(members(in_play(after)))
                np.testing.assert_array_equal(positions[lying], played.game.positions[lying])
        if kind != "called" and rules in TASKS and TASKS[rules].is_game:
            plain = play_batch(settings, game, velocities)
            after, over = played_as_task(settings, game, velocities)
            assert after.tobytes() == plain.states.tobytes()
            eight = rules == "eight_ball" and plain.pockets[:, 8] >= 0
            lost = (plain.verdicts["foul"] > 0) | ~plain.verdicts["continues"]
            assert over.tolist() == (lost | after["over"] | eight).tolist()
    assert continues > 1 or rules == "three_cushion" or kind == "break"  # random shots rarely score there


@pytest.mark.parametrize("rules", ["snooker", "three_cushion"])
def test_a_batch_judges_shots_of_a_cue_ball_that_touches_a_ball(rules):
    settings = setup(rules)
    positions = opening(settings, np.random.default_rng(0), "random").positions
    positions[1] = positions[0] + (0.0, 2 * settings.scene.balls.radius[0])
    game = custom_opening(settings, positions)
    batch = play_batch(settings, game, [[0.0, 1.0], [0.0, -1.0]])
    single = [play(settings, game, Stroke(velocity)).verdict for velocity in ((0.0, 1.0), (0.0, -1.0))]
    assert batch.verdicts.tolist() == [verdict.tolist() for verdict in single]
    assert [FOULS[foul] for foul in batch.verdicts["foul"]] == ["push", ""]


def test_a_call_counts_if_its_ball_drops_in_its_pocket():
    settings = setup("straight", 2, call_shot=True)
    game = opening(settings, np.random.default_rng(1), "random")
    velocities, _ = shots(3000, 0, game)
    exact = play_batch(settings, game, velocities)
    called = np.flatnonzero(exact.verdicts["points"] > 0)[:4]
    assert len(called) == 4
    for k in called.tolist():
        (ball, pocket), *_ = play(settings, game, Stroke(tuple(velocities[k].tolist()))).pots
        calls = [[ball, pocket], [ball, (pocket + 1) % 6], [-1, -1]]
        three = play_batch(settings, game, np.repeat(velocities[k, None], 3, 0), calls=np.array(calls))
        assert three.verdicts["continues"].tolist() == [True, False, False]
        call = Call(ball, pocket)
        assert play(settings, game, Stroke(tuple(velocities[k].tolist()), call=call)).verdict.continues


# Arrays of states and of facts


def test_the_ball_that_was_potted_first_chooses_the_group():
    states, calls = np.array([state("eight_ball")] * 2), np.zeros(2, CALL)
    facts: Any = np.zeros(2, GAMES["eight_ball"].facts_type)
    facts["potted"], facts["cushion_after"], facts["first"] = 1 << 2 | 1 << 11, True, [1 << 3, 1 << 12]
    facts["first_potted"] = [1 << 11, 1 << 2]
    assert referee.judge_shots("eight_ball", states, facts, calls)[0]["solids"].tolist() == [1, 0]


def test_wrong_arrays_are_refused():
    game = GAMES["nine_ball"]
    states: Any = np.zeros(2, game.state_type)
    facts, calls = np.zeros(2, game.facts_type), np.zeros(3, CALL)
    with pytest.raises(ValueError, match=r"lengths \(2, 2, 3\): expected one length"):
        referee.judge_shots("carom", states, facts, calls)
    with pytest.raises(ValueError, match="game = 'croquet': expected one of"):
        referee.judge_shots("croquet", states, facts, calls[:2])
    states["n_players"] = 2
    assert [FOULS[k] for k in referee.judge_shots("nine_ball", states, facts, calls[:2])[1]["foul"]] == ["no_hit"] * 2
    assert not states["player"].any()  # the states before the shots do not change
    states["player"] = [1, 2]
    with pytest.raises(ValueError, match=r"player = .*2.* of .* players: expected 0 to the number less 1"):
        referee.judge_shots("nine_ball", states, facts, calls[:2])


def test_the_call_that_a_player_does_not_choose_is_that_of_the_bank():
    record = record_of("hit 0 5, pocket 1 0, cushion 5, pocket 5 2")
    played: Any = SimpleNamespace(facts=facts_of_shots(GAMES["bank_pool"].facts, record)[0], pots=((1, 0), (5, 2)))
    assert best_call(setup("bank_pool"), state("bank_pool", call_shot=True), played) == Call(5, 2)
    assert best_call(setup("straight"), state("straight", call_shot=True), played) == Call(1, 0)
