"""The impact of a ball on one cushion or on two, by the law of the scene's cushions."""

from __future__ import annotations

import math

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import IMPULSE_ROUNDING
from billiards_env.physics.laws.cushion import CushionMotion, cushion_restitution
from billiards_env.physics.state import SLIDING_AND_ROLLING, UX, UY, VX, VY, WZ

_TURNS = 4
"""Largest number of impacts on each of two cushions in `reflect_both`. The engine resolves an approach that remains."""


@inlined
def reflect(state, i, nx, ny, rebound, scene):  # out: state
    """Changes ball i's velocity, slip and spin at a cushion.

    Args:
        state: The `State`.
        i: The ball.
        nx: The unit normal into the cushion along x.
        ny: The same along y.
        rebound: Least speed away from the cushion after the impact, m/s, >= 0.
        scene: The `SceneArrays`.

    Returns:
        Whether `rebound` has raised the speed away from the cushion.
    """
    s, numbers = state.rows[i], scene.numbers
    vn, vt = nx * s[VX] + ny * s[VY], nx * s[VY] - ny * s[VX]
    speed = max(0.0, vn)
    if numbers.cushion_rubs:
        radius = scene.radius[i]
        un, ut = nx * s[UX] + ny * s[UY], nx * s[UY] - ny * s[UX]
        before = CushionMotion(speed, vt, un, ut, radius * s[WZ])
        (vn, vt, un, ut, rwz), raised = scene.laws.cushion(before, radius, rebound, scene.numbers, None)
        s[VX], s[VY] = nx * vn - ny * vt, ny * vn + nx * vt
        s[UX], s[UY] = nx * un - ny * ut, ny * un + nx * ut
        s[WZ] = rwz / radius
        return raised and rebound > 0.0
    e = cushion_restitution(speed, numbers)
    raised = e * speed < rebound
    after = -rebound if raised else -e * vn
    if numbers.motion == SLIDING_AND_ROLLING:
        s[UX] += (after - vn) * nx
        s[UY] += (after - vn) * ny
    s[VX], s[VY] = nx * after - ny * vt, ny * after + nx * vt
    return raised


@inlined
def hit_by(motion, n, share, rebound, radius, laws, numbers, solution):
    """Returns the motion of a ball after an impact on a cushion; `hit` describes the result.

    Args:
        motion: Velocity (vx, vy), slip (ux, uy) and spin about the vertical axis times the radius, m/s.
        n: (nx, ny), the unit normal into the cushion.
        share: The part of the normal speed that acts on this cushion, m/s, >= 0.
        rebound: Least speed away from the cushion after the impact, m/s, >= 0.
        radius: m.
        laws: `SceneArrays.laws`.
        numbers: The `Numbers`.
        solution: See `cushion_han2005.han2005`.
    """
    (vx, vy, ux, uy, rwz), (nx, ny) = motion, n
    vn, vt = nx * vx + ny * vy, nx * vy - ny * vx
    un, ut = nx * ux + ny * uy, nx * uy - ny * ux
    rest = vn - share
    if numbers.cushion_rubs:
        before = CushionMotion(share, vt, un - rest, ut, rwz)
        (after, vt, un, ut, rwz), raised = laws.cushion(before, radius, rebound, numbers, solution)
        after, un = after + rest, un + rest
    else:
        speed = cushion_restitution(share, numbers) * share
        after, raised = rest - max(speed, rebound), speed < rebound
        un += after - vn
    motion = (nx * after - ny * vt, ny * after + nx * vt, nx * un - ny * ut, ny * un + nx * ut, rwz)
    return motion, raised and rebound > 0.0


@kernel
def hit(motion, n, share, rebound, radius, scene):
    """Returns the motion of a ball after the impact of a part of its velocity on a cushion.

    Args:
        motion: Velocity (vx, vy), slip (ux, uy) and spin about the vertical axis times the radius, m/s.
        n: (nx, ny), the unit normal into the cushion.
        share: The part of the normal speed that acts on this cushion, m/s, >= 0. Another cushion stops the rest.
        rebound: Least speed away from the cushion after the impact, m/s, >= 0.
        radius: m.
        scene: The `SceneArrays`.

    Returns:
        The motion, and whether `rebound` has raised the speed away from the cushion.
    """
    return hit_by(motion, n, share, rebound, radius, scene.laws, scene.numbers, None)


@kernel
def _hit_in_turn(motion, one, two, rebounds, radius, scene):
    """Returns the motion after impacts on the cushions with the normals `one` and `two` in turn; the rest as `hit`."""
    sine, raised = one[0] * two[1] - one[1] * two[0], False
    noise = IMPULSE_ROUNDING * norm(motion[0], motion[1])
    for turn in range(_TURNS):
        share = (motion[0] * two[1] - motion[1] * two[0]) / sine
        if share > (-rebounds[0] if turn == 0 and rebounds[0] > 0.0 else noise):
            motion, acts = hit(motion, one, max(0.0, share), rebounds[0], radius, scene)
            raised = raised or acts
        share = (one[0] * motion[1] - one[1] * motion[0]) / sine
        if share > (-rebounds[1] if turn == 0 and rebounds[1] > 0.0 else noise):
            motion, acts = hit(motion, two, max(0.0, share), rebounds[1], radius, scene)
            raised = raised or acts
    return motion, raised


@inlined
def _product(a, b, rubs):
    """Returns the scalar product of two motions of a ball that gives 2 E / m for equal ones, m^2/s^2."""
    product = a[0] * b[0] + a[1] * b[1]
    if rubs:
        spins = (a[0] - a[2]) * (b[0] - b[2]) + (a[1] - a[3]) * (b[1] - b[3]) + a[4] * b[4]
        product += 0.4 * spins
    return product


@inlined
def _sum(weight, a, other, b):
    """Returns the sum of two weighted motions."""
    return (
        weight * a[0] + other * b[0],
        weight * a[1] + other * b[1],
        weight * a[2] + other * b[2],
        weight * a[3] + other * b[3],
        weight * a[4] + other * b[4],
    )


@kernel
def reflect_both(state, i, one, two, rebounds, scene):  # out: state
    """Changes ball i's velocity, slip and spin at two cushions that it touches at one instant.

    With the normals n_1 and n_2 and the shares p_1 and p_2, the velocity is p_1 n_1 + p_2 n_2. The law of one cushion
    acts at each with the normal speed p, in turn, until no share is positive. The result is the mean of both orders.
    Without friction both orders give -e v, the generalised reflection of `physics.clusters.impulses`. If the normals
    are not perpendicular, friction may raise the energy. The mean then moves towards the plastic impact without
    friction, which stops the ball, until the energy does not rise.

    Args:
        state: The `State`.
        i: The ball.
        one: (nx, ny), the unit normal into a cushion.
        two: The same for the other cushion; v is between the two normals.
        rebounds: Least speeds away from the cushions after the impact, m/s, >= 0.
        scene: The `SceneArrays`.

    Returns:
        Whether the rebounds have raised a speed away from a cushion.
    """
    s, radius, rubs = state.rows[i], scene.radius[i], scene.numbers.cushion_rubs
    before = (s[VX], s[VY], s[UX], s[UY], radius * s[WZ])
    sine, cosine = one[0] * two[1] - one[1] * two[0], one[0] * two[0] + one[1] * two[1]
    first = max(0.0, rebounds[0] - cosine * rebounds[1]) / (sine * sine)
    second = max(0.0, rebounds[1] - cosine * rebounds[0]) / (sine * sine)
    a, raised = _hit_in_turn(before, one, two, (first, second), radius, scene)
    b, raised_too = _hit_in_turn(before, two, one, (second, first), radius, scene)
    after = _sum(0.5, a, 0.5, b)
    vx, vy = -(first * one[0] + second * two[0]), -(first * one[1] + second * two[1])
    plastic = (vx, vy, before[2] + (vx - before[0]), before[3] + (vy - before[1]), before[4])
    least = _product(plastic, plastic, rubs)
    spare = max(_product(before, before, rubs) - least, 0.0)
    if _product(after, after, rubs) - least > spare:
        way = _sum(1.0, after, -1.0, plastic)
        slope, square = _product(plastic, way, rubs), _product(way, way, rubs)
        after = _sum(1.0, plastic, (math.sqrt(slope * slope + square * spare) - slope) / square, way)
    s[VX], s[VY] = after[0], after[1]
    if rubs or scene.numbers.motion == SLIDING_AND_ROLLING:
        s[UX], s[UY] = after[2], after[3]
    if rubs:
        s[WZ] = after[4] / radius
    return raised or raised_too
