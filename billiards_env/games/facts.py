"""The facts of a shot that the rules use: from the counts of the engine for m shots, or from recorded events.

The events of a shot also give the order of the pots, and the balls that are touched at the same instant. The counts of
the engine do not: one ball counts as touched first, and `Facts.first_potted` is 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.state import FACTS, Facts, row, set_of
from billiards_env.jit import entry_point, inlined
from billiards_env.physics.state import CUE_BALL


class Counts(NamedTuple):
    """The counts of the engine for m shots of n balls, the first of which is struck; see `engine.Shots`.

    Attributes:
        off_table_before: (m, n) bool, the balls that are potted or not in play before the shot.
        off_table: (m, n) bool, those after it.
        cushions: (m, n) int32, number of cushion contacts of each ball.
        cushions_before_hit: (m, n) int32, number of cushion contacts that the cue ball had when it first touched each
            ball, -1 if it did not touch it.
        first_hit: (m,) int64, index of the first ball that the cue ball touched, -1 if none.
        bits: (n,) int64, each ball as a set of balls.
    """

    off_table_before: Any
    off_table: Any
    cushions: Any
    cushions_before_hit: Any
    first_hit: Any
    bits: Any


@inlined
def facts_of_shot(k, counts):
    """Returns the `Facts` of shot k; `counts` has the fields of `Counts`."""
    first, scratch = counts.first_hit[k], counts.off_table[k, CUE_BALL]
    touched, before_last, potted, driven = 0, 0, 0, 0
    for i in range(1, len(counts.bits)):
        if counts.cushions_before_hit[k, i] >= 0:
            touched += 1
            before_last = max(before_last, counts.cushions_before_hit[k, i])
        if counts.off_table[k, i] and not counts.off_table_before[k, i]:
            potted |= counts.bits[i]
            driven |= counts.bits[i]
        elif counts.cushions[k, i] > 0:
            driven |= counts.bits[i]
    hits = counts.cushions[k, CUE_BALL]
    met = first >= 0 and (scratch or driven != 0 or hits > counts.cushions_before_hit[k, first])
    first_balls = counts.bits[first] if first >= 0 else 0
    return Facts(first_balls, touched, before_last, potted, 0, scratch, met, driven, hits > 0 or scratch)


@entry_point
def write_facts(counts, facts):
    """Writes the facts of m shots to `facts`, (m,) `FACTS`."""
    for k in range(len(facts)):
        shot, row = facts_of_shot(k, counts), facts[k]
        row.first, row.touched, row.cushions_before_last = shot.first, shot.touched, shot.cushions_before_last
        row.potted, row.first_potted, row.scratch = shot.potted, shot.first_potted, shot.scratch
        row.cushion_after, row.driven, row.cue_driven = shot.cushion_after, shot.driven, shot.cue_driven


def facts_of_shots(counts: Counts) -> NDArray[Any]:
    """Returns the facts of m shots, (m,) `FACTS`."""
    facts = np.zeros(len(counts.first_hit), FACTS)
    write_facts(counts, facts)
    return facts


def facts_of(events: NDArray[Any], cue: int = CUE_BALL) -> Any:
    """Returns the facts of a recorded shot of the ball `cue`, a row of `FACTS`, from its `ShotResult.events`."""
    first_time = None
    first: set[int] = set()
    driven: set[int] = set()
    touched: dict[int, int] = {}
    cushions, cushion_after = 0, False
    columns = (events[name].tolist() for name in ("time", "kind", "ball", "other"))
    for time, kind, ball, other in zip(*columns, strict=True):
        if kind == "ball_ball" and cue in (ball, other):
            hit = other if ball == cue else ball
            touched.setdefault(hit, cushions)
            first_time = time if first_time is None else first_time
            if time == first_time:
                first.add(hit)
        elif kind in ("cushion", "pocket"):
            cushion_after = cushion_after or first_time is not None
            if ball != cue:
                driven.add(ball)
            elif kind == "cushion":
                cushions += 1
    potted = [ball for ball, _ in pots_of(events)]
    balls = [ball for ball in potted if ball != cue]
    return row(
        Facts(
            first=set_of(first),
            touched=len(touched),
            cushions_before_last=list(touched.values())[-1] if touched else 0,
            potted=set_of(balls),
            first_potted=set_of(balls[:1]),
            scratch=cue in potted,
            cushion_after=cushion_after,
            driven=set_of(driven),
            cue_driven=cushions > 0 or cue in potted,
        )
    )


def pots_of(events: NDArray[Any]) -> tuple[tuple[int, int], ...]:
    """Returns the potted balls of a recorded shot with their pockets, in order."""
    return tuple(events[events["kind"] == "pocket"][["ball", "other"]].tolist())
