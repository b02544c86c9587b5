"""The strike: the cue ball's velocity and spin from the motion of the cue.

The tip is a point and moves along the axis of the cue, and the impulse lies on this axis. The ball gets a velocity
along the cue. It also gets a spin whose axis is perpendicular to the cue and to the offset of the tip.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from billiards_env.jit import entry_point, inlined, kernel
from billiards_env.physics.elementary import norm, sine_cosine
from billiards_env.physics.state import CUE_BALL, SPIN_X, SPIN_Y, SPIN_Z, X, Y
from billiards_env.scene import Scene

# Columns of the parameters of a strike.
SPEED, HEADING, SIDE, TOP, ELEVATION = range(5)


class CueNumbers(NamedTuple):
    """The cue in the form that the kernels use.

    Attributes:
        mass_ratio: Mass of the ball over the mass of the cue.
        end_ratio: Mass of the ball over the mass of the end of the shaft.
        restitution: As `Cue.tip_restitution`.
        miscue: As `Cue.miscue_offset`.
        radius: Radius of the ball, m.
    """

    mass_ratio: float
    end_ratio: float
    restitution: float
    miscue: float
    radius: float


def cue_numbers(scene: Scene, ball: int = CUE_BALL) -> CueNumbers:
    """Returns the cue of a scene, for strikes of a ball, in the form that the kernels use."""
    mass, cue = scene.balls.mass[ball], scene.cue
    return CueNumbers(
        mass / cue.mass, mass / cue.end_mass, cue.tip_restitution, cue.miscue_offset, scene.balls.radius[ball]
    )


@kernel
def impulse_gain(cue, k, push):
    """Returns the impulse of the tip over the mass of the ball and the speed of the cue.

    An impulse m V gives the ball, and those that it pushes, the energy m V^2 (push + k) / 2. The term k is the spin of
    the ball. The impact loses the same fraction of the cue's energy at every offset (Alciatore 2008, TP A.30). This is
    the fraction of a central impact, k = 0, with the tip's restitution.
    """
    total, e = push + cue.mass_ratio + k, cue.restitution
    rest = (e * e * total - k) / (push + cue.mass_ratio)
    return (1.0 + math.sqrt(max(rest, 0.0))) / total


@kernel
def speed_gain(cue, offset):
    """Returns the speed of a free ball over the speed of the cue, for a tip at `offset` ball radii from the centre."""
    return impulse_gain(cue, 2.5 * offset * offset, 1.0)


@kernel
def squirt(cue, side):
    """Returns the sine and cosine of the angle by which the ball leaves the direction of the cue, away from the tip.

    Alciatore (2007), TP A.31. `side` is the offset of the tip to the left in ball radii, and a positive angle is to the
    right.
    """
    cc = 1.0 - side * side
    tangent = 2.5 * side * math.sqrt(cc) / (1.0 + cue.end_ratio + 2.5 * cc)
    cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
    return tangent * cosine, cosine


@kernel
def struck(cue, ux, uy, side, top, sin_elevation, cos_elevation):
    """Returns the velocity and the spin of the ball after a strike.

    If the tip is farther from the centre than `cue.miscue`, it slips (a miscue): the impulse then lies on the edge of
    the cone of friction, so the ball deviates from the axis of the cue. The spin is that of a tip at the edge, times
    the cosine of this deviation. In scenes without flight the vertical component of the velocity is dropped.

    Args:
        cue: The cue.
        ux: x component, m/s, of the velocity after a level, central strike with the same speed and heading.
        uy: y component of this velocity.
        side: Offset of the tip to the left of the centre, as seen along the cue, in ball radii.
        top: Offset of the tip above the centre, as seen along the cue, in ball radii.
        sin_elevation: Sine of the angle of the cue above the horizontal.
        cos_elevation: Its cosine.

    Returns:
        (vx, vy, wx, wy, wz, miscue, vz): m/s, rad/s, and whether the tip slipped. A raised cue drives the ball down.
    """
    offset = norm(side, top)
    miscue = offset > cue.miscue
    along, right, down, slowed = cos_elevation, 0.0, sin_elevation, 1.0
    if miscue:
        x = min(offset, 1.0)
        # The cosine of the angle between the cue and the radius at the tip, and the same at the edge of the cone
        at_tip, at_edge = math.sqrt(1.0 - x * x), math.sqrt(1.0 - cue.miscue * cue.miscue)
        slowed, turn = at_tip * at_edge + x * cue.miscue, x * at_edge - cue.miscue * at_tip
        along = slowed * cos_elevation - turn * (top / offset) * sin_elevation
        down = slowed * sin_elevation + turn * (top / offset) * cos_elevation
        right = turn * (side / offset)
        side, top, offset = cue.miscue * (side / offset), cue.miscue * (top / offset), cue.miscue
    gain = slowed * speed_gain(cue, offset) / speed_gain(cue, 0.0)
    sine, cosine = squirt(cue, side)
    # The direction ahead and to the right of the cue, turned to the right by the squirt
    ahead, right = along * cosine - right * sine, right * cosine + along * sine
    spin = 2.5 * gain / cue.radius
    wx = spin * (-side * sin_elevation * ux - top * uy)
    wy = spin * (-side * sin_elevation * uy + top * ux)
    level = norm(ux, uy)
    wz, vz = -spin * side * cos_elevation * level, -gain * down * level
    return gain * (ahead * ux + right * uy), gain * (ahead * uy - right * ux), wx, wy, wz, miscue, vz


@inlined
def strike_by(cue, speed, heading, side, top, elevation):
    """Returns the velocity and the spin of the ball after a strike; see `struck` and `many_strikes`."""
    full = speed_gain(cue, 0.0)
    s, c = sine_cosine(heading)
    sin_elevation, cos_elevation = sine_cosine(elevation)
    return struck(cue, full * speed * c, full * speed * s, side, top, sin_elevation, cos_elevation)


@entry_point
def many_strikes(cue, parameters, velocities, spins, miscues):  # out: velocities, spins, miscues
    """Computes the velocities and spins of many strikes.

    Args:
        cue: `CueNumbers`, as a plain tuple.
        parameters: (m, 5) float64: speed of the cue, m/s; heading, rad; offsets to the left and above, in ball radii;
            elevation, rad.
        velocities: (m, 2) float64 out, m/s; (m, 3) with the vertical component.
        spins: (m, 3) float64 out, rad/s.
        miscues: (m,) bool out.
    """
    cue = CueNumbers(*cue)
    for k in range(len(parameters)):
        p = parameters[k]
        vx, vy, wx, wy, wz, miscue, vz = strike_by(cue, p[SPEED], p[HEADING], p[SIDE], p[TOP], p[ELEVATION])
        velocities[k, X], velocities[k, Y] = vx, vy
        if velocities.shape[1] == 3:
            velocities[k, 2] = vz
        spins[k, SPIN_X], spins[k, SPIN_Y], spins[k, SPIN_Z] = wx, wy, wz
        miscues[k] = miscue
