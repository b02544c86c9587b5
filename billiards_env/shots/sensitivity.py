"""The condition of a shot: how much its positions change with its start, computed by `shots.gradients`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.log import TIME
from billiards_env.shots.gradients import Record, ball_jacobians, nonsmooth, start_states

Floats = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-53

_TIMES = 64  # number of times in one pass, which bounds the memory


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """The derivative of a shot's positions with respect to its start.

    Attributes:
        jacobian: (n, 2, n, 7) float64: of ball i's position with respect to ball j's initial (x, y, vx, vy, wx, wy,
            wz), in m, m/s and rad/s.
        time: The time of the positions, s.
        smooth: Whether the positions depend smoothly on the start up to that time. They do not if an event up to that
            time has no derivative, see `gradients.Nonsmooth`. The jacobian then treats impacts at one instant as
            successive, and neglects the contact-time rule.
        condition: Largest error of a position, m, per unit of relative error of the inputs: the largest 2-norm, over
            the balls, of the jacobian with each column times the size of its input. Times `UNIT_ROUNDOFF` it is the
            error that no double-precision engine can avoid.
    """

    jacobian: Floats
    time: float
    smooth: bool
    condition: float


def sensitivity_along(record: Record, times: Floats) -> Iterator[Sensitivity]:
    """Computes the sensitivity of a recorded shot at several times.

    Args:
        record: The record of one shot.
        times: Ascending, s; not later than the end of the shot.

    Yields:
        One sensitivity for each time. An event exactly at that time counts as past.
    """
    (part,), n = record.parts, record.scene.n_balls
    scale, (events, reasons) = np.abs(start_states(record)[0]), nonsmooth(record, None, 1)
    event = int(events[0])
    last = np.inf if not reasons[0] else part.events[event, TIME] if event >= 0 else -1.0
    for block in np.split(times, range(_TIMES, len(times), _TIMES)):
        for time, jacobian in zip(block.tolist(), ball_jacobians(record, block), strict=True):
            scaled = (jacobian * scale).reshape(n, 2, -1)
            condition = float(np.linalg.norm(scaled, 2, axis=(1, 2)).max())
            yield Sensitivity(jacobian, time, bool(time < last), condition)
