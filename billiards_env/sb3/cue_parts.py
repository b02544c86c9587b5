"""The numbers of an action that describe the cue: side, top and elevation of a strike."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from billiards_env.envs import BilliardsEnv
from billiards_env.physics import strike
from billiards_env.physics.strike import CueNumbers, cue_numbers, gain_terms

NUMBERS = 3
"""The number of these numbers."""

MOST = 0.7
"""Largest mean of side and of top, divided by the miscue offset. It keeps the mean offset below the miscue."""

_LEVEL = -0.5  # the mean elevation before the training: below 0 the cue is level


class CueParts(NamedTuple):
    """The motion of the cue in each component. All fields are (m, k).

    Attributes:
        side, top, elevation: The means of the numbers of the action.
        turn: Tangent of the angle to the left by which the cue must turn, so that the squirt does not change the
            direction of the ball.
        gain: Speed of the ball divided by its speed after a central strike.
    """

    side: Tensor
    top: Tensor
    elevation: Tensor
    turn: Tensor
    gain: Tensor


def cue_of(env: BilliardsEnv) -> CueNumbers | None:
    """Returns the cue of an environment, or None if its actions are velocities."""
    return cue_numbers(env.scene) if env.action == "strike" else None


def speed_gain(cue: CueNumbers, side: Tensor, top: Tensor) -> Tensor:
    """Returns the speed of the ball divided by that of a central strike, for offsets divided by the miscue offset."""
    rest, total = gain_terms(cue, 2.5 * cue.miscue**2 * (side * side + top * top))
    return (1.0 + torch.sqrt(rest)) / total / strike.speed_gain(cue, 0.0)


def cue_parts(cue: CueNumbers, side: Tensor, top: Tensor, elevation: Tensor) -> CueParts:
    """Returns the cue of the components from outputs of a network, (m, k) each. Zeros are a level, central strike.

    The turn and the gain are those of a level strike without a miscue, see `billiards_env.physics.strike`.
    """
    side, top = MOST * side.tanh(), MOST * top.tanh()
    x = cue.miscue * side
    cc = 1.0 - x * x
    turn = 2.5 * x * cc.sqrt() / (1.0 + cue.end_ratio + 2.5 * cc)
    return CueParts(side, top, _LEVEL + elevation, turn, speed_gain(cue, side, top))


def turned(dx: Tensor, dy: Tensor, tangent: Tensor) -> tuple[Tensor, Tensor]:
    """Returns unit vectors after a turn to the left by angles with the given tangents."""
    shorter = torch.rsqrt(1 + tangent * tangent)
    return (dx - tangent * dy) * shorter, (dy + tangent * dx) * shorter
