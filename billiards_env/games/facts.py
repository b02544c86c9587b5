"""The facts of a shot that the rules use, from the records of the engine."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.game_state import FACTS, FOOT_LEFT, FOOT_RIGHT, Facts
from billiards_env.jit import entry_point, inlined
from billiards_env.shots.result import ShotResult


class Records(NamedTuple):
    """The records of m shots of n balls that the facts follow from; `engine.Shots` describes them.

    Attributes:
        cue: (m,) int64.
        cushions: (m, n) int32.
        cushions_before_hit: (m, n) int32.
        first_hit: (m,) int64.
        pockets: (m, n) int32.
        pot_order: (m, n) int32.
        touched_first: (m, n) bool.
    """

    cue: Any
    cushions: Any
    cushions_before_hit: Any
    first_hit: Any
    pockets: Any
    pot_order: Any
    touched_first: Any


@inlined
def facts_of_shot(k, shots, bits):
    """Returns the `Facts` of shot k.

    Args:
        k: The shot.
        shots: A NamedTuple with the fields of `Records`, such as `engine.Shots`.
        bits: (n,) int64, each ball as a set of balls.
    """
    cue, hit = shots.cue[k], shots.first_hit[k]
    scratch, hits = shots.pockets[k, cue] >= 0, shots.cushions[k, cue]
    first, touched, before_last, potted, first_potted, driven = 0, 0, 0, 0, 0, 0
    banked, foot_right, foot_left, earliest, driven_off = 0, 0, 0, len(bits), 0
    for i in range(len(bits)):
        if i == cue:
            continue
        if shots.cushions_before_hit[k, i] >= 0:
            touched += 1
            before_last = max(before_last, shots.cushions_before_hit[k, i])
            if shots.touched_first[k, i]:
                first |= bits[i]
        pocket = shots.pockets[k, i]
        if pocket >= 0:
            potted |= bits[i]
            banked |= bits[i] if shots.cushions[k, i] > 0 else 0
            foot_right |= bits[i] if pocket == FOOT_RIGHT else 0
            foot_left |= bits[i] if pocket == FOOT_LEFT else 0
            if shots.pot_order[k, i] < earliest:
                first_potted, earliest = bits[i], shots.pot_order[k, i]
        elif shots.pot_order[k, i] >= 0:
            driven_off |= bits[i]
        if pocket >= 0 or shots.cushions[k, i] > 0:
            driven |= bits[i]
    # No object ball moves before the first contact, or before the strike that drives it together with the cue ball.
    before_first = shots.cushions_before_hit[k, hit] if hit >= 0 else 0
    met = hit >= 0 and (scratch or driven != 0 or hits > before_first)
    return Facts(
        first,  # numba accepts at most 30 values and names
        before_first,
        touched,
        before_last,
        potted,
        first_potted=first_potted,
        banked=banked & first if before_first == 0 else 0,
        foot_right=foot_right,
        foot_left=foot_left,
        scratch=scratch,
        cushion_after=met,
        driven=driven,
        cue_driven=hits > 0 or scratch,
        driven_off=driven_off,
        cue_off=shots.pot_order[k, cue] >= 0 and not scratch,
        hidden=False,
    )


@entry_point
def write_facts(records, bits, facts):
    """Writes the facts of m shots to `facts`, (m,) `FACTS`; `records` are the fields of `Records`."""
    shots = Records(*records)
    for k in range(len(facts)):
        shot, row = facts_of_shot(k, shots, bits), facts[k]
        row.first, row.touched, row.cushions_before_last = shot.first, shot.touched, shot.cushions_before_last
        row.cushions_before_first = shot.cushions_before_first
        row.potted, row.first_potted, row.scratch = shot.potted, shot.first_potted, shot.scratch
        row.banked, row.foot_right, row.foot_left = shot.banked, shot.foot_right, shot.foot_left
        row.cushion_after, row.driven, row.cue_driven = shot.cushion_after, shot.driven, shot.cue_driven
        row.driven_off, row.cue_off = shot.driven_off, shot.cue_off


def facts_of_shots(shots: Any, balls: NDArray[np.int64] | None = None) -> NDArray[Any]:
    """Returns the facts of m shots, (m,) `FACTS`.

    Args:
        shots: An object with the fields of `Records`, such as a `BatchResult`.
        balls: (n,) the numbers of the balls in the sets of balls; None for 0 to n - 1.
    """
    return _facts([getattr(shots, name) for name in Records._fields], balls)


def facts_of(shot: ShotResult) -> Any:
    """Returns the facts of a shot, a row of `FACTS`."""
    return _facts([np.asarray(getattr(shot, name))[None] for name in Records._fields], None)[0]


def _facts(records: list[NDArray[Any]], balls: NDArray[np.int64] | None) -> NDArray[Any]:
    m, n = records[Records._fields.index("cushions")].shape
    facts = np.zeros(m, FACTS)
    write_facts(tuple(records), np.left_shift(1, np.arange(n) if balls is None else balls), facts)
    return facts
