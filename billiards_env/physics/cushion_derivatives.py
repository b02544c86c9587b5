"""The derivatives of the laws of `physics.cushion`, made from their sources by `physics.tangent`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.compliance import end_stick, stick_force
from billiards_env.physics.cushion import (
    LAWS,
    CushionMotion,
    by_law,
    cushion_restitution,
    mathavan2010,
    mathavan_arguments,
)
from billiards_env.physics.elementary import arccosine, sine_cosine
from billiards_env.physics.lanes import (
    D_CUSHION_FREQUENCY_RATIO,
    D_E_CUSHION,
    D_E_CUSHION_FLOOR,
    D_E_CUSHION_LOSS,
    D_E_CUSHION_ONSET,
    D_MU_CLOTH,
    D_MU_CUSHION,
)
from billiards_env.physics.mathavan import CushionNose
from billiards_env.physics.mathavan_derivatives import impact_change
from billiards_env.physics.tangent import rule, tangent_of


class CushionNumbers(NamedTuple):
    """A change of the `Numbers` of cushions."""

    e_cushion: Any
    e_cushion_loss: Any
    e_cushion_onset: Any
    e_cushion_floor: Any
    mu_cushion: Any
    cushion_frequency_ratio: Any
    mu_cloth: Any
    cushion_height: Any


@rule(sine_cosine)
@inlined
def _d_sine_cosine(x, d_x):
    sin, cos = sine_cosine(x)
    return (sin, cos), (cos * d_x, -sin * d_x)


@rule(arccosine)
@inlined
def _d_arccosine(x, d_x):
    square = 1.0 - x * x
    return arccosine(x), -d_x / math.sqrt(square) if square > 0.0 else 0.0


@rule(end_stick)
@inlined
def _d_end_stick(start, stretch, velocity, e, omega, d_start, d_stretch, d_velocity, d_e, d_omega):
    """The velocity after the impact does not depend on the end of the stick in first order, so that time is constant.

    One more Newton step: the derivative needs more digits of the time than the velocity.
    """
    t = end_stick(start, stretch, velocity, e, omega)
    excess, slope = stick_force(t, start, stretch, velocity, e, omega)
    return t - excess / slope, 0.0


_d_restitution = tangent_of(cushion_restitution)
_d_law = by_law(*(tangent_of(law, constant=("rebound",)) for law in LAWS))


@inlined
def cushion_change(before, d_before, radius, d_radius, lane, scene):
    """Returns the change of the `CushionMotion` after an impact on a cushion.

    Args:
        before: The `CushionMotion` before it.
        d_before: Its change.
        radius: m.
        d_radius: Its change.
        lane: The lane with the changes of the numbers of the scene.
        scene: The `SceneArrays`.
    """
    d_numbers = CushionNumbers(
        e_cushion=lane[D_E_CUSHION],
        e_cushion_loss=lane[D_E_CUSHION_LOSS],
        e_cushion_onset=lane[D_E_CUSHION_ONSET],
        e_cushion_floor=lane[D_E_CUSHION_FLOOR],
        mu_cushion=lane[D_MU_CUSHION],
        cushion_frequency_ratio=lane[D_CUSHION_FREQUENCY_RATIO],
        mu_cloth=lane[D_MU_CLOTH],
        cushion_height=0.0,
    )
    if scene.numbers.cushion_rubs:
        arguments = (before, radius, 0.0, scene.numbers, d_before, d_radius, d_numbers)
        return _d_law(scene.cushion, arguments)[1][0]
    e, d_e = _d_restitution(before.vn, scene.numbers, d_before.vn, d_numbers)
    vn = -e * d_before.vn - before.vn * d_e
    return CushionMotion(vn, d_before.vt, d_before.un + (vn - d_before.vn), d_before.ut, d_before.rwz)


@kernel
def _is_smooth_mathavan(before, radius, numbers):
    motion, nose, e = mathavan_arguments(before, radius, numbers)
    unmoved = (0.0, 0.0, 0.0, 0.0, 0.0)
    return impact_change(motion, unmoved, nose, CushionNose(0.0, 0.0, 0.0, 0.0), e, 0.0)[2]


@inlined
def _always_smooth(before, radius, numbers):
    return True


_is_smooth = by_law(*(_is_smooth_mathavan if law is mathavan2010 else _always_smooth for law in LAWS))


@inlined
def cushion_is_smooth(before, radius, scene):
    """Returns whether the law of the cushions has a derivative at a `CushionMotion`."""
    return _is_smooth(scene.cushion, (before, radius, scene.numbers))
