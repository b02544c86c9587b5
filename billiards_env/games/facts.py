"""The facts of a shot that rules use, from the records of the engine.

A fact is a kernel `(shots, k, bits)` that returns a number of shot k: its name, its type, its docstring and where it is
recorded. A game lists the facts that it uses in `Game.facts`, and only those are recorded. The arguments are

    shots: A NamedTuple with the fields of `Records`, such as `engine.Shots`.
    k: The shot.
    bits: (n,) int64, each ball as a set of balls.

A set of balls never holds the ball that is struck.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.game_state import CALL, FOOT_LEFT, FOOT_RIGHT, Balls, row_type, size
from billiards_env.jit import entry_point, inlined
from billiards_env.shots.result import ShotResult

Kernel = Callable[..., Any]


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
        measures: (m,) the measures of `Game.measures`, or None.
    """

    cue: Any
    cushions: Any
    cushions_before_hit: Any
    first_hit: Any
    pockets: Any
    pot_order: Any
    touched_first: Any
    measures: Any


@inlined
def balls_that(has, shots, k, bits):
    """Returns the set of the object balls i with `has(shots, k, i)`, a kernel."""
    balls = 0
    for i in range(len(bits)):
        if i != shots.cue[k] and has(shots, k, i):
            balls |= bits[i]
    return balls


@inlined
def _touches_first(shots, k, i):
    return shots.touched_first[k, i] and shots.cushions_before_hit[k, i] >= 0


@inlined
def first(shots, k, bits) -> Balls:
    """The balls that the cue ball touched first; several if it touched them at the same instant."""
    return balls_that(_touches_first, shots, k, bits)


@inlined
def cushions_before_first(shots, k, bits) -> int:
    """Number of cushion contacts of the cue ball before it touched the first balls."""
    hit = shots.first_hit[k]
    return shots.cushions_before_hit[k, hit] if hit >= 0 else 0


@inlined
def _is_touched(shots, k, i):
    return shots.cushions_before_hit[k, i] >= 0


@inlined
def touched(shots, k, bits) -> int:
    """Number of balls that the cue ball touched."""
    return size(balls_that(_is_touched, shots, k, bits))


@inlined
def cushions_before_last(shots, k, bits) -> int:
    """Number of cushion contacts of the cue ball before it touched the last of the balls that it touched."""
    most = 0
    for i in range(len(bits)):
        if i != shots.cue[k]:
            most = max(most, shots.cushions_before_hit[k, i])
    return most


@inlined
def _is_potted(shots, k, i):
    return shots.pockets[k, i] >= 0


@inlined
def potted(shots, k, bits) -> Balls:
    """The potted object balls."""
    return balls_that(_is_potted, shots, k, bits)


@inlined
def first_potted(shots, k, bits) -> Balls:
    """The object ball that was potted first, as a set; 0 if there is none."""
    ball, earliest = 0, len(bits)
    for i in range(len(bits)):
        if i != shots.cue[k] and shots.pockets[k, i] >= 0 and shots.pot_order[k, i] < earliest:
            ball, earliest = bits[i], shots.pot_order[k, i]
    return ball


@inlined
def _hits_and_drops(shots, k, i):
    return shots.pockets[k, i] >= 0 and shots.cushions[k, i] > 0 and _touches_first(shots, k, i)


@inlined
def banked(shots, k, bits) -> Balls:
    """The potted object balls that the cue ball touched first, before it hit a cushion itself, and that hit a cushion.

    A jaw of a pocket counts.
    """
    return balls_that(_hits_and_drops, shots, k, bits) if cushions_before_first(shots, k, bits) == 0 else 0


@inlined
def _drops_right(shots, k, i):
    return shots.pockets[k, i] == FOOT_RIGHT


@inlined
def foot_right(shots, k, bits) -> Balls:
    """The object balls potted in pocket 2, the foot corner with y < 0 of `scene.six_pockets`."""
    return balls_that(_drops_right, shots, k, bits)


@inlined
def _drops_left(shots, k, i):
    return shots.pockets[k, i] == FOOT_LEFT


@inlined
def foot_left(shots, k, bits) -> Balls:
    """The object balls potted in pocket 3, the foot corner with y > 0."""
    return balls_that(_drops_left, shots, k, bits)


@inlined
def scratch(shots, k, bits) -> bool:
    """Whether the cue ball was potted."""
    return shots.pockets[k, shots.cue[k]] >= 0


@inlined
def _is_driven(shots, k, i):
    return shots.pot_order[k, i] >= 0 or shots.cushions[k, i] > 0


@inlined
def driven(shots, k, bits) -> Balls:
    """The object balls that hit a cushion, were potted or were driven off the table (WPA 8.4)."""
    return balls_that(_is_driven, shots, k, bits)


@inlined
def cue_driven(shots, k, bits) -> bool:
    """Whether the cue ball hit a cushion, or left the table, after its first contact with a ball (WPA 4.3, 8.4)."""
    cue = shots.cue[k]
    after = shots.cushions[k, cue] > cushions_before_first(shots, k, bits)
    return shots.first_hit[k] >= 0 and (after or shots.pot_order[k, cue] >= 0)


@inlined
def cushion_after(shots, k, bits) -> bool:
    """Whether any ball hit a cushion, or left the table, after the cue ball's first contact with a ball."""
    # No object ball moves before the first contact, or before the strike that drives it together with the cue ball.
    return cue_driven(shots, k, bits) or (shots.first_hit[k] >= 0 and driven(shots, k, bits) != 0)


@inlined
def _flies_off(shots, k, i):
    return shots.pot_order[k, i] >= 0 and shots.pockets[k, i] < 0


@inlined
def driven_off(shots, k, bits) -> Balls:
    """The object balls that were driven off the table, in scenes with flight."""
    return balls_that(_flies_off, shots, k, bits)


@inlined
def cue_off(shots, k, bits) -> bool:
    """Whether the cue ball was driven off the table."""
    return _flies_off(shots, k, shots.cue[k])


def _jumped(is_over: Kernel) -> Kernel:
    @inlined
    def jumped(shots, k, bits) -> Balls:
        """The object balls that the cue ball jumped over before its first contact, in scenes with flight.

        The cue ball jumps over a ball if it flies above a part of the ball and does not hit it in the same flight.
        """
        return balls_that(is_over, shots, k, bits)

    return jumped


@inlined
def _never(shots, k, i):
    return False


@inlined
def _is_jumped(shots, k, i):
    return shots.measures[k].times_over[i] < math.inf


jumped, jumped_in_flight = _jumped(_never), _jumped(_is_jumped)
"""The fact `jumped`: without flight it is empty, with flight it is recorded, see `Game.in_scene`."""

USUAL = first, potted, scratch, cushion_after, driven_off, cue_off
"""The facts of `pool.standard_foul`. The referee uses `potted` and `driven_off` in each game."""


def name_of(fact: Kernel) -> str:
    """Returns the name of a fact."""
    return getattr(fact, "py_func", fact).__name__


def return_type(fact: Kernel) -> Any:
    """Returns the annotated type of a fact, or None."""
    return get_type_hints(getattr(fact, "py_func", fact), include_extras=True).get("return")


@functools.cache
def facts_type(facts: tuple[Kernel, ...]) -> np.dtype[Any]:
    """Returns the type of the rows of facts."""
    return row_type({name_of(fact): return_type(fact) for fact in facts})


@inlined
def _record_none(shots, k, bits, row):
    """Writes no fact."""


@functools.cache
def recorder(facts: tuple[Kernel, ...]) -> Kernel:
    """Returns the kernel `(shots, k, bits, row)` that writes the facts of shot k to a row of `facts_type`."""
    record = _record_none
    for fact in facts:
        record = _with_one_more(record, name_of(fact), fact)
    return record


def _with_one_more(others: Kernel, name: str, fact: Kernel) -> Kernel:
    @inlined
    def record(shots, k, bits, row):  # out: row
        others(shots, k, bits, row)
        row[name] = fact(shots, k, bits)

    return record


@inlined
def record_shot(record, shots, k, bits, facts, call):  # out: facts, call
    """Writes the facts of shot k, and whether it pots the called ball in the called pocket (WPA 1.6).

    Args:
        record: The kernel `Game.record`.
        shots: A NamedTuple with the fields of `Records`, such as `engine.Shots`.
        k: The shot.
        bits: (n,) int64, each ball as a set of balls.
        facts: A row of `facts_type`.
        call: A row of `CALL`.
    """
    record(shots, k, bits, facts)
    call.made = False
    for i in range(len(bits)):
        if call.ball >= 0 and call.pocket >= 0 and bits[i] == 1 << call.ball:
            call.made = shots.pockets[k, i] == call.pocket


@entry_point
def _record_shots(record, records, bits, rows, calls):  # out: rows, calls
    for k in range(len(rows)):
        record_shot(record, Records(*records), k, bits, rows[k], calls[k])


def facts_of_shots(
    facts: tuple[Kernel, ...], shots: Any, balls: NDArray[np.int64] | None = None, calls: NDArray[Any] | None = None
) -> NDArray[Any]:
    """Returns the facts of m shots, (m,) `facts_type`.

    Args:
        facts: The facts, such as `Game.facts`.
        shots: An object with the fields of `Records`, such as a `BatchResult`.
        balls: (n,) the numbers of the balls in the sets of balls; None for 0 to n - 1.
        calls: (m,) `CALL`, whose field `made` is set; None for none.
    """
    records = [getattr(shots, name) for name in Records._fields]
    rows, n = np.zeros(len(records[0]), facts_type(facts)), records[1].shape[1]
    bits = np.left_shift(1, np.arange(n) if balls is None else balls)
    _record_shots(recorder(facts), tuple(records), bits, rows, np.zeros(len(rows), CALL) if calls is None else calls)
    return rows


def facts_of(facts: tuple[Kernel, ...], shot: ShotResult, calls: NDArray[Any] | None = None) -> NDArray[Any]:
    """Returns the facts of one shot, (1,) `facts_type`; the arguments are as in `facts_of_shots`."""
    values = (getattr(shot, name) for name in Records._fields)
    records = Records(*(None if value is None else np.asarray(value)[None] for value in values))
    return facts_of_shots(facts, records, None, calls)
