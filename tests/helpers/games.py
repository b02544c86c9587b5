"""States and facts of games, made by hand."""

import dataclasses

import numpy as np

from billiards_env import Scene
from billiards_env.games import NO_CALL, RULES, RuleState, Setup
from billiards_env.games.judging import balls_of, call_array, fact_array, facts_of, state_array, verdict_of
from billiards_env.rules import judge_shots, legal_balls
from billiards_env.shots.result import EVENT_DTYPE


def setup(rules, balls=None, **kwargs):
    """Returns the settings of a game on its usual table, with the most or a given number of object balls."""
    game = RULES[rules]
    scene = Scene.named(game.scene, balls or game.n_object_balls[1])
    if rules == "snooker":  # it runs the code that is compiled for the pool games
        scene = dataclasses.replace(scene, physics=Scene.named("real_pool").physics)
    return Setup(rules, **{"scene": scene, **kwargs})


def events(*rows, times=None):
    """Returns events one second apart from rows: ("hit", a, b), ("cushion", ball) or ("pocket", ball, pocket)."""
    log = np.zeros(len(rows), EVENT_DTYPE)
    for k, (kind, ball, *other) in enumerate(rows):
        log[k]["time"] = k if times is None else times[k]
        log[k]["kind"] = "ball_ball" if kind == "hit" else kind
        log[k]["ball"], log[k]["other"] = ball, other[0] if other else 0
    return log


def facts(text="", cue=0, times=None):
    """Returns the facts of a shot with events such as "hit 0 1, cushion 1, pocket 1 5", see `events`."""
    rows = [event.split() for event in text.split(",") if event]
    return facts_of(events(*((kind, *map(int, balls)) for kind, *balls in rows), times=times), cue)


def state(rules, *, on_table=None, players=2, **fields):
    """Returns a state in the middle of a game, with all balls or the cue ball and the object balls of `on_table`."""
    n = 1 + RULES[rules].n_object_balls[1]
    start = RuleState(0, (0,) * players, frozenset(range(n)), False, "no", RULES[rules].cue_balls)
    start = start._replace(reds=15 if rules == "snooker" else 0)
    return start._replace(**fields, on_table=start.on_table if on_table is None else frozenset({0, *on_table}))


def check_together(rules, cases):
    """Checks that arrays of shots have the verdicts and the legal balls of cases: (fields, log, verdict[, call])."""
    shots = [(state(rules, **case[0]), facts(case[1]), case[2], *(case[3:] or [NO_CALL])) for case in cases]
    states, made, verdicts, calls = zip(*shots, strict=True)
    judged = judge_shots(rules, state_array(states), fact_array(made), call_array(calls, made))
    assert [verdict_of(row, highest_first=rules == "snooker") for row in judged] == list(verdicts)
    legal = legal_balls(rules, state_array(states), np.ones(len(states), int))
    assert [set(balls_of(int(balls))) for balls in legal] == [RULES[rules].legal(one, 1) for one in states]


def in_a_row(n, places=None):
    """Returns the positions of n balls, (n, 2) m: those of `places`, by ball, and the others in a row."""
    positions = np.column_stack((0.11 * np.arange(n) - 0.9, np.full(n, -0.3)))
    for ball, place in (places or {}).items():
        positions[ball] = place
    return positions
