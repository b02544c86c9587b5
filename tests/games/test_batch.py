"""Many shots are judged as one shot is."""

import numpy as np
import pytest

from billiards_env.games import CALL, FACTS, FOULS, GAMES, STATE, Call, Stroke, opening, play, referee
from billiards_env.games.batch import best_call, play_batch
from billiards_env.games.game_state import changed, in_play, members, set_of
from tests.helpers.games import setup, state

CASES = {f"{rules} {layout}": (rules, layout, {}) for rules in GAMES for layout in (GAMES[rules].layouts[0], "random")}
CASES |= {
    "called eight ball": ("eight_ball", "random", {"call_shot": True}),
    "called straight pool": ("straight", "random", {"call_shot": True}),
    "the second cue ball of carom": ("carom", "random", {"cue_balls": (2, 0), "object_balls": 0b11, "player": 1}),
    "two object balls": ("eight_ball", "random", {"object_balls": set_of((3, 8)), "solids": 0}),
}


def shots(m, seed=0):
    rng = np.random.default_rng(seed)
    angles, speeds = rng.uniform(-np.pi, np.pi, m), rng.uniform(0.5, 5.0, m)
    spins = rng.uniform(-50.0, 50.0, (m, 3))
    return speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles))), spins


def one_by_one(settings, game, velocities, spins, places):
    played = []
    for velocity, spin, place in zip(velocities.tolist(), spins.tolist(), places, strict=True):
        positions = game.positions.copy()
        positions[game.state.cue_balls[0]] = place
        start, stroke = game._replace(positions=positions), Stroke(tuple(velocity), spin=tuple(spin))
        if settings.call_shot:
            pots = play(settings, start, stroke).pots
            stroke = stroke._replace(call=best_call(settings, game.state, tuple(sorted(pots))))
        played.append(play(settings, start, stroke))
    return played


@pytest.mark.parametrize(("rules", "layout", "state"), CASES.values(), ids=CASES)
def test_a_batch_has_the_verdicts_states_and_positions_of_single_shots(rules, layout, state):
    settings = setup(rules, call_shot=state.get("call_shot", False))
    game = opening(settings, np.random.default_rng(1), layout)
    game = game._replace(state=changed(game.state, **{"in_hand": 0, **state}))  # a break with the cue ball in place
    velocities, spins = shots(400 if state else 60)
    places = np.repeat(game.positions[None, game.state.cue_balls[0]], len(spins), axis=0)
    if layout == "random":
        places[:, 1] += np.linspace(-1e-3, 1e-3, len(spins))
    batch = play_batch(settings, game, velocities, spins, places if layout == "random" else None)
    single = one_by_one(settings, game, velocities, spins, places)
    assert batch.verdicts.tolist() == [played.verdict.tolist() for played in single]
    assert not state or batch.verdicts["continues"].any()
    for after, positions, played in zip(batch.states, batch.positions, single, strict=True):
        np.testing.assert_equal(after.tolist(), changed(played.game.state, free_ball=False).tolist())
        if not played.verdict.spotted and not played.verdict.rack:  # a batch does not look for a free place
            lying = list(members(in_play(after)))
            np.testing.assert_array_equal(positions[lying], played.game.positions[lying])


def test_a_call_counts_if_its_ball_drops_in_its_pocket():
    settings = setup("straight", 2, call_shot=True)
    game = opening(settings, np.random.default_rng(1), "random")
    velocities, _ = shots(3000)
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
    states, calls = np.array([state("eight_ball")] * 2, STATE), np.zeros(2, CALL)
    facts = np.zeros(2, FACTS)
    facts["potted"], facts["cushion_after"], facts["first"] = 1 << 2 | 1 << 11, True, [1 << 3, 1 << 12]
    facts["first_potted"] = [1 << 11, 1 << 2]
    assert referee.judge_shots("eight_ball", states, facts, calls)[0]["solids"].tolist() == [1, 0]


def test_wrong_arrays_are_refused():
    states, facts, calls = np.zeros(2, STATE), np.zeros(2, FACTS), np.zeros(3, CALL)
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
