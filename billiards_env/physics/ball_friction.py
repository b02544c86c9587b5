"""The friction of two balls in an impact, which throws the balls and transfers spin.

Friction acts against the slip of the two surfaces. The slip has a part "across", along t = z x h with the horizontal
unit vector h from ball 1 to ball 2, and a part "up", along b = n x t. For disks and balls of equal radius the normal n
is h, and b is z. Normal and tangential impulses are independent, so the slip keeps its direction, and Coulomb's law has
a closed form (Alciatore 2019, TP A.14): the impulse is mu times the normal impulse or, if that is less, the impulse
that stops the slip. The vertical velocity is set to zero afterwards.

Several impacts at one instant first get the normal impulses of `clusters`. Then the impulses of friction are those that
minimise the kinetic energy after the impact, each at most mu times the normal impulse of its contact. This is the
principle of maximum dissipation (Moreau 1973) with fixed normal impulses, as in the staggered projections of Kaufman,
Sueda, James and Pai (2008). Zero friction is one of the choices, so the energy never rises. The problem is convex, and
its velocities are unique. For one contact the result is the closed form. Balls that approach after it meet again at the
same instant.

Spheres of radii R1 and R2 on a table have the normal n = c h + s z with c = 2 sqrt(R1 R2) / (R1 + R2) and
s = (R2 - R1) / (R1 + R2). The table holds both balls, so the impact changes their velocities along h as for disks. The
impulse p along h is that of a normal impulse p / c, which limits the friction. With W = R1 w1 + R2 w2, the slip is
t.(v1 - v2) + c W.z - s W.h across and -W.t - s h.(v1 - v2) up. The velocity along h changes in the impact; the friction
belongs to the slip after the normal impulse, so it never raises the energy.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.clusters import quantum
from billiards_env.physics.complementarity import solve_smallest
from billiards_env.physics.double_double import HI
from billiards_env.physics.elementary import exponential
from billiards_env.physics.motion import norm
from billiards_env.physics.state import UX, UY, VX, VY, WZ

# Columns of `Rubbing.sums`: the impulse, and the impulses that turn a ball about z and about horizontal axes.
_PX, _PY, _PZ, _TURN, _ROLL_X, _ROLL_Y = 0, 1, 2, 3, 4, 5
_ACROSS, _UP = 0, 1  # columns of slips and of impulses of friction

_SWEEPS = 2000  # largest number of steps of `rub_all`


@inlined
def friction_coefficient(numbers, speed):
    """Returns the coefficient of friction of two balls whose surfaces slide at `speed`, m/s."""
    mu = numbers.mu_limit
    if numbers.mu_drop > 0.0:
        mu += numbers.mu_drop * exponential(-numbers.mu_rate * speed)
    return mu


@inlined
def tilt_of(spheres, i, j):
    """Returns the cosine and the sine of the inclination of the normal from ball i to ball j; None for disks.

    `spheres` is `SceneArrays.spheres`.
    """
    if spheres is None:
        return None
    total = spheres[i] + spheres[j]
    return 2.0 * math.sqrt(spheres[i] * spheres[j]) / total, (spheres[j] - spheres[i]) / total


@inlined
def _along_normal(tilt, p):
    """Returns the impulse along the normal of a contact whose horizontal part is p."""
    if tilt is None:
        return p
    cosine, _ = tilt
    return p / cosine


@inlined
def _up_after(tilt, up, change):
    """Returns the upward slip after the speed of separation has risen by `change`, m/s."""
    if tilt is None:
        return up
    _, sine = tilt
    return up + sine * change


@inlined
def contact_slip(tilt, i, j, nx, ny, state, radius):
    """Returns the slip of ball i's surface on ball j's across and up, m/s.

    Args:
        tilt: The result of `tilt_of`.
        i: The first ball.
        j: The second ball.
        nx: Horizontal unit vector h from i to j along x.
        ny: The same along y.
        state: The `State`.
        radius: `SceneArrays.radius`.
    """
    a, b = state.rows[i], state.rows[j]
    side = nx * (a[VY] - b[VY]) - ny * (a[VX] - b[VX])
    turn = radius[i] * a[WZ] + radius[j] * b[WZ]
    up_i = nx * (a[UX] - a[VX]) + ny * (a[UY] - a[VY])
    up_j = nx * (b[UX] - b[VX]) + ny * (b[UY] - b[VY])
    if tilt is None:
        return side + turn, up_i + up_j
    cosine, sine = tilt
    along = nx * (a[VX] - b[VX]) + ny * (a[VY] - b[VY])
    lean_i = nx * (a[UY] - a[VY]) - ny * (a[UX] - a[VX])
    lean_j = nx * (b[UY] - b[VY]) - ny * (b[UX] - b[VX])
    return side + (cosine * turn - sine * (lean_i + lean_j)), (up_i + up_j) - sine * along


class FrictionImpulse(NamedTuple):
    """The impulse of friction on the first ball of a contact.

    Attributes:
        nx: x component of the horizontal unit vector h from the first to the second ball.
        ny: Its y component.
        across: Impulse across, kg m/s.
        up: Impulse up, kg m/s.
    """

    nx: Any
    ny: Any
    across: Any
    up: Any


@kernel
def rub_ball(i, sign, push, tilt, state, scene):
    """Changes velocity, slip and spin of a ball by the friction of an impact.

    Args:
        i: The ball.
        sign: 1.0 if i is the first ball of the contact, -1.0 if it is the second.
        push: The `FrictionImpulse` on the first ball.
        tilt: The result of `tilt_of`.
        state: The `State`.
        scene: The `SceneArrays`.
    """
    s, inverse = state.rows[i], scene.inv_mass[i]
    nx, ny, across, up = push
    if tilt is not None:
        cosine, sine = tilt
        dv_across, dv_along = sign * across * inverse, -(sign * up * inverse) * sine
        du_across, du_along = -2.5 * across * inverse * sine, 2.5 * up * inverse
        dvx, dvy = dv_along * nx - dv_across * ny, dv_along * ny + dv_across * nx
        s[VX] += dvx
        s[VY] += dvy
        s[UX] += dvx + (du_along * nx - du_across * ny)
        s[UY] += dvy + (du_along * ny + du_across * nx)
        s[WZ] += 2.5 * across * inverse * cosine / scene.radius[i]
        return
    dv, du = sign * across * inverse, 2.5 * up * inverse  # the impulse turns both balls in the same direction
    s[VX] -= dv * ny
    s[VY] += dv * nx
    s[UX] += du * nx - dv * ny
    s[UY] += du * ny + dv * nx
    s[WZ] += 2.5 * across * inverse / scene.radius[i]


@inlined
def rub_pair(ball_friction, i, j, nx, ny, p, state, scene):
    """Changes velocities, slip and spin of two balls by the friction of an impact.

    Args:
        ball_friction: `SceneArrays.ball_friction`.
        i: The first ball.
        j: The second ball.
        nx: Horizontal unit vector from i to j along x.
        ny: The same along y.
        p: Horizontal impulse along it, kg m/s, which the velocities do not include yet.
        state: The `State`.
        scene: The `SceneArrays`.
    """
    if ball_friction is None:
        return
    inverse = scene.inv_mass[i] + scene.inv_mass[j]
    tilt = tilt_of(scene.spheres, i, j)
    across, up = contact_slip(tilt, i, j, nx, ny, state, scene.radius)
    up = _up_after(tilt, up, p * inverse)
    slip = norm(across, up)
    if slip > 0.0:
        stop = 1.0 / (3.5 * inverse)  # impulse per slip that stops it
        limit = friction_coefficient(scene.numbers, slip) * _along_normal(tilt, p)
        ratio = -(limit / slip if limit < stop * slip else stop)
        push = FrictionImpulse(nx, ny, ratio * across, ratio * up)
        rub_ball(i, 1.0, push, tilt, state, scene)
        rub_ball(j, -1.0, push, tilt, state, scene)


@inlined
def forget_normal_impulses(ball_friction, count, scratch):
    """Sets the normal impulses of the contacts to zero."""
    if ball_friction is None:
        return
    for c in range(count):
        scratch.rubbing.normal[c] = 0.0


@inlined
def add_normal_impulses(ball_friction, count, factor, direct, scratch):
    """Adds `factor` times the impulses of `solve_plastic` to the normal impulses; `direct` is its result."""
    if ball_friction is None:
        return
    normal, impulse, x = scratch.rubbing.normal, scratch.impulse, scratch.problem.x
    if direct:
        solve_smallest(count, scratch.problem, scratch.rubbing.target)
    for c in range(count):
        normal[c] += factor * (x[c, HI] if direct else impulse[c, HI])


@inlined
def _largest_part(spheres, largest):
    """Returns an upper bound of the terms of `_sum_friction` for impulses across and up of at most `largest`."""
    if spheres is None:
        return largest
    return 2.0 * largest


@inlined
def _parts(tilt, nx, ny, across, up, q):
    """Returns the terms of `_sum_friction` of one contact, in the order of the columns, rounded with the quantum q."""
    if tilt is None:
        return (
            (-across * ny + q) - q,
            (across * nx + q) - q,
            (up + q) - q,
            (across + q) - q,
            (up * nx + q) - q,
            (up * ny + q) - q,
        )
    cosine, sine = tilt
    return (
        ((-across * ny - sine * up * nx) + q) - q,
        ((across * nx - sine * up * ny) + q) - q,
        (cosine * up + q) - q,
        (cosine * across + q) - q,
        ((up * nx + sine * across * ny) + q) - q,
        ((up * ny - sine * across * nx) + q) - q,
    )


@kernel
def _sum_friction(count, contacts, push, spheres, rubbing):
    """Computes `Rubbing.sums`, independently of the order of the contacts, as `clusters.sum_impulses` does."""
    sums, first, second = rubbing.sums, contacts.first, contacts.second
    largest = 0.0
    for c in range(count):
        for k in range(6):
            sums[first[c], k] = sums[second[c], k] = 0.0
        largest = max(largest, abs(push[c, _ACROSS]), abs(push[c, _UP]))
    q = quantum(_largest_part(spheres, largest), count) if count > 2 and largest > 0.0 else 0.0
    for c in range(count):
        i, j, nx, ny = first[c], second[c], contacts.nx[c], contacts.ny[c]
        tilt = tilt_of(spheres, i, j)
        px, py, pz, turn, roll_x, roll_y = _parts(tilt, nx, ny, push[c, _ACROSS], push[c, _UP], q)
        for k in (i, j):
            sign = 1.0 if k == i else -1.0
            sums[k, _PX] += sign * px
            sums[k, _PY] += sign * py
            sums[k, _PZ] += sign * pz
            sums[k, _TURN] += turn
            sums[k, _ROLL_X] += roll_x
            sums[k, _ROLL_Y] += roll_y


@inlined
def _slip_of(tilt, across, along, up, turn, lean, roll):
    """Returns the slip across and up, m/s, by the relative velocity (across, along, up) along t, h and z.

    The last arguments are sums of the impulses per mass that turn the balls about z and roll them along t and along h.
    """
    if tilt is None:
        return across + 2.5 * turn, up + 2.5 * roll
    cosine, sine = tilt
    return across + 2.5 * (cosine * turn - sine * lean), (cosine * up - sine * along) + 2.5 * roll


@kernel
def _change_of_slip(c, contacts, sums, inv_mass, spheres):
    """Returns the change of contact c's slip across and up by the sums of impulses, m/s."""
    i, j, nx, ny = contacts.first[c], contacts.second[c], contacts.nx[c], contacts.ny[c]
    mi, mj = inv_mass[i], inv_mass[j]
    across = nx * (mi * sums[i, _PY] - mj * sums[j, _PY]) - ny * (mi * sums[i, _PX] - mj * sums[j, _PX])
    up = mi * sums[i, _PZ] - mj * sums[j, _PZ]
    turn = mi * sums[i, _TURN] + mj * sums[j, _TURN]
    roll_x = mi * sums[i, _ROLL_X] + mj * sums[j, _ROLL_X]
    roll_y = mi * sums[i, _ROLL_Y] + mj * sums[j, _ROLL_Y]
    along = nx * (mi * sums[i, _PX] - mj * sums[j, _PX]) + ny * (mi * sums[i, _PY] - mj * sums[j, _PY])
    return _slip_of(
        tilt_of(spheres, i, j), across, along, up, turn, nx * roll_y - ny * roll_x, nx * roll_x + ny * roll_y
    )


@kernel
def _minimise_energy(count, contacts, inv_mass, spheres, rubbing):
    """Computes the impulses of friction, `Rubbing.last`, by an accelerated projected gradient.

    The weights are a diagonal upper bound of the quadratic form: a ball's change of velocity by `degree` impulses has
    at most `degree` times the sum of their energies.
    """
    first, second = contacts.first, contacts.second
    slip, limit, weight, degree = rubbing.slip, rubbing.limit, rubbing.weight, rubbing.degree
    point, last, sums = rubbing.point, rubbing.last, rubbing.sums
    for c in range(count):
        degree[first[c]] = degree[second[c]] = 0
    for c in range(count):
        degree[first[c]] += 1
        degree[second[c]] += 1
    largest = 0.0
    for c in range(count):
        i, j = first[c], second[c]
        weight[c] = 3.5 * (inv_mass[i] * degree[i] + inv_mass[j] * degree[j])
        largest = max(largest, norm(slip[c, _ACROSS], slip[c, _UP]))
        for k in range(2):
            point[c, k] = last[c, k] = 0.0
    theta = 1.0
    for _ in range(_SWEEPS):
        _sum_friction(count, contacts, point, spheres, rubbing)
        change, uphill = 0.0, False
        theta_next = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * theta * theta))
        for c in range(count):
            across, up = _change_of_slip(c, contacts, sums, inv_mass, spheres)
            across = point[c, _ACROSS] - (slip[c, _ACROSS] + across) / weight[c]
            up = point[c, _UP] - (slip[c, _UP] + up) / weight[c]
            size = norm(across, up)
            if size > limit[c]:
                across, up = limit[c] * (across / size), limit[c] * (up / size)
            step_across, step_up = across - last[c, _ACROSS], up - last[c, _UP]
            step = weight[c] * norm(step_across, step_up)
            change = max(change, step)
            back = (point[c, _ACROSS] - across) * step_across + (point[c, _UP] - up) * step_up
            uphill = uphill or back > 0.0
            slope = (theta - 1.0) / theta_next
            point[c, _ACROSS], point[c, _UP] = across + slope * step_across, up + slope * step_up
            last[c, _ACROSS], last[c, _UP] = across, up
        theta = theta_next
        if change <= 2e-16 * largest:
            break
        if uphill:
            theta = 1.0
            for c in range(count):
                point[c, _ACROSS], point[c, _UP] = last[c, _ACROSS], last[c, _UP]


@kernel
def _rub_together(count, contacts, state, scene, rubbing):
    """Implements `rub_all`."""
    inv_mass, radius, slip = scene.inv_mass, scene.radius, rubbing.slip
    for c in range(count):
        i, j, nx, ny = contacts.first[c], contacts.second[c], contacts.nx[c], contacts.ny[c]
        tilt = tilt_of(scene.spheres, i, j)
        slip[c, _ACROSS], slip[c, _UP] = contact_slip(tilt, i, j, nx, ny, state, radius)
        speed = norm(slip[c, _ACROSS], slip[c, _UP])
        rubbing.limit[c] = friction_coefficient(scene.numbers, speed) * _along_normal(tilt, rubbing.normal[c])
    _minimise_energy(count, contacts, inv_mass, scene.spheres, rubbing)
    _sum_friction(count, contacts, rubbing.last, scene.spheres, rubbing)
    for c in range(count):
        for k in (contacts.first[c], contacts.second[c]):
            if rubbing.degree[k] == 0:
                continue
            rubbing.degree[k] = 0
            s, sums, inverse = state.rows[k], rubbing.sums[k], inv_mass[k]
            s[VX] += inverse * sums[_PX]
            s[VY] += inverse * sums[_PY]
            s[UX] += inverse * (sums[_PX] + 2.5 * sums[_ROLL_X])
            s[UY] += inverse * (sums[_PY] + 2.5 * sums[_ROLL_Y])
            s[WZ] += 2.5 * inverse * sums[_TURN] / radius[k]


@inlined
def rub_all(ball_friction, count, contacts, state, scene, scratch):
    """Changes velocities, slips and spins by the friction of the impacts at one instant.

    Args:
        ball_friction: `SceneArrays.ball_friction`.
        count: Number of contacts.
        contacts: The `Contacts`.
        state: The `State` after the normal impulses.
        scene: The `SceneArrays`.
        scratch: The `Scratch`; `rubbing.normal` holds the normal impulses.
    """
    if ball_friction is None:
        return
    _rub_together(count, contacts, state, scene, scratch.rubbing)
