"""What the laws of cushions share: the motion of a ball at a cushion, its contact with the nose, and restitution."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.jit import inlined

ROUNDING = 2.0**-40
"""The difference of two numbers that counts as rounding where the derivative of a law jumps."""


class Cushion(NamedTuple):
    """A cushion of scenes.

    Attributes:
        law: The law of its impacts, see `cushion_han2005.han2005`.
        work: `Numbers.cushion_work`; with extreme numbers an impact may take twenty times as long.
        solution: The kernel of (before, radius, numbers) that solves the equation of the law; None if it has none.
    """

    law: Callable[..., Any]
    work: int = 1
    solution: Callable[..., Any] | None = None


class CushionMotion(NamedTuple):
    """The motion of a ball at a cushion with the normal n into the cushion and the tangent t = z x n.

    Attributes:
        vn: Velocity along n, m/s.
        vt: Velocity along t, m/s.
        un: Slip on the cloth along n, m/s.
        ut: Slip on the cloth along t, m/s.
        rwz: Spin about the vertical axis times the radius, m/s.
    """

    vn: Any
    vt: Any
    un: Any
    ut: Any
    rwz: Any


class Nose(NamedTuple):
    """The place where the nose of a cushion touches a ball, at the angle theta above the ball's centre.

    Attributes:
        sin: sin(theta) = h / R - 1, for a nose at the height h.
        cos: cos(theta).
    """

    sin: Any
    cos: Any


@inlined
def cushion_restitution(speed, numbers):
    """Returns the restitution at a normal speed, m/s."""
    e = numbers.e_cushion
    # Without a loss, a restitution at its floor depends only on `e_cushion`: leave out `max`.
    falls = numbers.e_cushion_loss > 0.0 or e > numbers.e_cushion_floor
    if speed > numbers.e_cushion_onset and falls:
        e = max(numbers.e_cushion_floor, e - numbers.e_cushion_loss * (speed - numbers.e_cushion_onset))
    return e


@inlined
def restitution_is_smooth(speed, numbers):
    """Returns whether `cushion_restitution` has the same derivative on both sides of a normal speed, m/s."""
    onset, loss = numbers.e_cushion_onset, numbers.e_cushion_loss
    at_floor = abs(numbers.e_cushion - loss * (speed - onset) - numbers.e_cushion_floor) <= ROUNDING
    return loss == 0.0 or not (abs(speed - onset) <= ROUNDING * onset or at_floor)


@inlined
def nose_of(radius, numbers):
    """Returns the `Nose` of a cushion for a ball with a radius, m."""
    sin = numbers.cushion_height / radius - 1.0
    return Nose(sin, math.sqrt(1.0 - sin * sin))


@inlined
def spins_of(motion):
    """Returns the spins of a `CushionMotion` about n and about t, times the radius, m/s."""
    return motion.ut - motion.vt, motion.vn - motion.un


@inlined
def slip_at(motion, nose):
    """Returns the slip (sx, sy) of a `CushionMotion` at a `Nose`: along the tangent that points up, and along t, m/s.

    It is the velocity of the cushion relative to the ball, and friction on the ball acts along it.
    """
    rwn, rwt = spins_of(motion)
    return motion.vn * nose.sin + rwt, -motion.vt - motion.rwz * nose.cos + rwn * nose.sin


@inlined
def leave(before, nose, vn, px, pxe, pye, pze):
    """Returns the `CushionMotion` with the normal velocity vn after impulses, all in m/s.

    The impulses per mass are px (horizontal, into the cushion), the friction pxe (up) and pye (along t), pze (normal).
    """
    (sin, cos), (rwn, rwt) = nose, spins_of(before)
    pz = pxe * cos - pze * sin
    vt = before.vt + pye
    rwn -= 2.5 * pye * sin
    rwt += 2.5 * (px * sin - pz * cos)
    return CushionMotion(vn, vt, vn - rwt, vt + rwn, before.rwz + 2.5 * pye * cos)
