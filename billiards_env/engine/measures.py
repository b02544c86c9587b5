"""Measures: values that a shot records only for a task, an observation, a game or a call of `simulate` that names them.

`MEASURES` has one entry for each measure. The numbers of a measure are a field of the rows `Shots.measures`. The kernel
of the measure writes this field at some moments of a shot. The arguments of the kernel are

    moment: START, BEFORE_IMPACT or AFTER_IMPACT.
    i: The first ball of the impact, -1 at the start.
    j: The second one, i < j.
    k: The shot.
    state: The `State` of the balls at this moment.
    shots: The `Shots`. They do not contain this impact yet.

An engine is compiled with the kernels of the measures that it records. For shots without measures it is compiled with
`record_nothing`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from billiards_env.jit import inlined
from billiards_env.physics.state import VX, VY, X, Y
from billiards_env.scene import Scene
from billiards_env.support.checks import one_of, sequence

START, BEFORE_IMPACT, AFTER_IMPACT = range(3)


class Measure(NamedTuple):
    """A measure.

    Attributes:
        summary: What the numbers are, for the documentation.
        shape: The shape of the numbers of a shot, which are float64.
        record: The kernel, see the module.
        largest: Function of the scene and of the largest speed of an action, m/s. Returns the number that is 1 in the
            feature of the observation.
    """

    summary: str
    shape: tuple[int, ...]
    record: Callable[..., None]
    largest: Callable[[Scene, float], float]


@inlined
def record_first_hit_velocities(moment, i, j, k, state, shots):  # out: shots
    """Records the measure "first_hit_velocities"."""
    velocities, cue = shots.measures[k].first_hit_velocities, shots.cue[k]
    if moment == START:
        velocities[:] = math.inf
    elif shots.first_hit[k] < 0 and cue in (i, j) and (moment == AFTER_IMPACT or velocities[0, 0, X] == math.inf):
        for ball, row in ((cue, 0), (i + j - cue, 1)):
            velocities[moment - BEFORE_IMPACT, row, X] = state.rows[ball, VX]
            velocities[moment - BEFORE_IMPACT, row, Y] = state.rows[ball, VY]


MEASURES = {
    "first_hit_velocities": Measure(
        "velocities at the first impact of the cue ball: before and after it, of the cue ball and of the other ball",
        (2, 2, 2),
        record_first_hit_velocities,
        lambda scene, max_speed: max_speed,
    )
}
"""The measures by name. The numbers are infinite if what they describe does not happen."""


@inlined
def record_nothing(moment, i, j, k, state, shots):
    """Records no measure."""


@functools.cache
def recorder(names: tuple[str, ...]) -> Callable[..., None]:
    """Returns the kernel that records measures."""
    record = record_nothing
    for name in names:
        record = _with_one_more(record, MEASURES[name].record)
    return record


def _with_one_more(others: Callable[..., None], own: Callable[..., None]) -> Callable[..., None]:
    @inlined
    def record(moment, i, j, k, state, shots):
        others(moment, i, j, k, state, shots)
        own(moment, i, j, k, state, shots)

    return record


def with_measures(kernels: Any, names: tuple[str, ...]) -> Any:
    """Returns the kernels of an engine with those of measures."""
    return kernels._replace(record=recorder(names)) if names else kernels


def measures_type(names: tuple[str, ...]) -> np.dtype[np.void]:
    """Returns the type of a row of `Shots.measures`."""
    return np.dtype([(name, np.float64, MEASURES[name].shape) for name in names])


def checked_measures(names: Sequence[str]) -> tuple[str, ...]:
    """Returns the names of measures in the order of `MEASURES`.

    Raises:
        TypeError: If they are not a list.
        ValueError: If there is no such measure.
    """
    for name in (given := sequence("measures", names)):
        one_of("name in measures", name, tuple(MEASURES))
    return tuple(name for name in MEASURES if name in given)
