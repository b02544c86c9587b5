"""Measures: values that a shot records only for a task, an observation, a game or a call of `simulate` that names them.

`MEASURES` has one entry for each measure. The numbers of a measure are a field of the rows `Shots.measures`. The kernel
of the measure writes this field at some moments of a shot. The arguments of the kernel are

    moment: START or END of the shot, BEGIN_PHASE of a ball, BEFORE_IMPACT or AFTER_IMPACT of two balls.
    i: The ball, or the first ball of the impact; -1 at the start and the end of the shot.
    j: The second ball of the impact, i < j; otherwise -1.
    k: The shot.
    scene: The `SceneArrays`.
    state: The `State` of the balls at this moment.
    shots: The `Shots`. They do not contain this impact yet.

An engine is compiled with the kernels of the measures that it records. For shots without measures it is compiled with
`record_nothing`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from billiards_env.jit import inlined
from billiards_env.physics.geometry.contact import circle_time
from billiards_env.physics.motion import Path
from billiards_env.physics.state import AIRBORNE, LASTS, POTTED, T0, VX, VY, X, Y
from billiards_env.scene import Scene
from billiards_env.support.checks import key_of, sequence

START, BEFORE_IMPACT, AFTER_IMPACT, BEGIN_PHASE, END = range(5)


class Measure(NamedTuple):
    """A measure.

    Attributes:
        summary: What the numbers are, for the documentation.
        shape: The shape of the numbers of a shot, which are float64; "balls" is the number of balls.
        record: The kernel, see the module.
        largest: Function of the scene and of the largest speed of an action, m/s. Returns the number that is 1 in the
            feature of the observation.
    """

    summary: str
    shape: tuple[int | str, ...]
    record: Callable[..., None]
    largest: Callable[[Scene, float], float]


@inlined
def record_first_hit_velocities(moment, i, j, k, scene, state, shots):  # out: shots
    """Records the measure "first_hit_velocities"."""
    velocities, cue = shots.measures[k].first_hit_velocities, shots.cue[k]
    if moment == START:
        velocities[:] = math.inf
    elif moment > AFTER_IMPACT or shots.first_hit[k] >= 0 or cue not in (i, j):
        return
    elif moment == AFTER_IMPACT or velocities[0, 0, X] == math.inf:
        for ball, row in ((cue, 0), (i + j - cue, 1)):
            velocities[moment - BEFORE_IMPACT, row, X] = state.rows[ball, VX]
            velocities[moment - BEFORE_IMPACT, row, Y] = state.rows[ball, VY]


@inlined
def record_times_over(moment, i, j, k, scene, state, shots):  # out: shots
    """Records the measure "times_over".

    At the start of a flight, the kernel computes the times at which the cue ball would come over other balls. They are
    negative until the flight ends. Then the kernel removes the times after this end, and those of the balls that the
    cue ball has hit.
    """
    times, cue = shots.measures[k].times_over, shots.cue[k]
    if moment == START:
        times[:] = math.inf
    elif moment == END or (moment == BEGIN_PHASE and i == cue):
        now = shots.time[k] if moment == END else state.rows[cue, T0]
        flies = moment == BEGIN_PHASE and state.phase[cue] == AIRBORNE and shots.first_hit[k] < 0
        for ball in range(len(times)):
            if times[ball] <= 0.0:
                is_over = -times[ball] <= now and not shots.touched_first[k, ball]
                times[ball] = -times[ball] if is_over else math.inf
            if flies and ball != cue and times[ball] == math.inf:
                times[ball] = -(now + _time_to_ball(ball, cue, scene, state))


@inlined
def _time_to_ball(ball, cue, scene, state):
    """Returns the time until the cue ball, in the air, comes over a ball at rest, s; infinite if it does not."""
    a, b = state.rows[cue], state.rows[ball]
    if state.phase[ball] == POTTED or b[VX] != 0.0 or b[VY] != 0.0:
        return math.inf
    path = Path(a[X] - b[X], a[Y] - b[Y], a[VX], a[VY], 0.0, 0.0)
    return circle_time(path, scene.radius[cue] + scene.radius[ball], a[LASTS], 0.0)


MEASURES = {
    "first_hit_velocities": Measure(
        "velocities at the first impact of the cue ball: before and after it, of the cue ball and of the other ball",
        (2, 2, 2),
        record_first_hit_velocities,
        lambda scene, max_speed: max_speed,
    ),
    "times_over": Measure(
        "the time, s, at which the cue ball flies over each ball at rest, before its first impact with a ball and "
        "without hitting this ball",
        ("balls",),
        record_times_over,
        lambda scene, max_speed: 2.0 * max_speed / scene.physics.g,
    ),
}
"""The measures by name. The numbers are infinite if what they describe does not happen."""


@inlined
def record_nothing(moment, i, j, k, scene, state, shots):
    """Records no measure."""


def recorder(measures: tuple[Measure, ...]) -> Callable[..., None]:
    """Returns the kernel that records measures."""
    return functools.reduce(_with_one_more, (measure.record for measure in measures), record_nothing)


@functools.cache
def _with_one_more(others: Callable[..., None], own: Callable[..., None]) -> Callable[..., None]:
    @inlined
    def record(moment, i, j, k, scene, state, shots):
        others(moment, i, j, k, scene, state, shots)
        own(moment, i, j, k, scene, state, shots)

    return record


def measures_type(names: tuple[str, ...], n: int) -> np.dtype[np.void] | None:
    """Returns the type of a row of `Shots.measures` of n balls; None without measures."""
    shapes = {name: tuple(n if size == "balls" else size for size in MEASURES[name].shape) for name in names}
    return np.dtype([(name, np.float64, shape) for name, shape in shapes.items()]) if names else None


def checked_measures(names: Sequence[str]) -> tuple[str, ...]:
    """Returns the names of measures in the order of `MEASURES`.

    Raises:
        TypeError: If they are not a list.
        ValueError: If there is no such measure.
    """
    given = [key_of("name in measures", name, MEASURES) for name in sequence("measures", names)]
    return tuple(name for name in MEASURES if name in given)
