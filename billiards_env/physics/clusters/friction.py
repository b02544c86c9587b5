"""The friction of several impacts of balls at one instant.

The impacts first get the normal impulses of `clusters`. Then the impulses of friction are those that minimise the
kinetic energy after the impact, each at most mu times the normal impulse of its contact. This is the principle of
maximum dissipation (Moreau 1973) with fixed normal impulses, as in the staggered projections of Kaufman, Sueda, James
and Pai (2008). Zero friction is one of the choices, so the energy never rises. The problem is convex, and its
velocities are unique. For one contact the result is that of `physics.laws.balls`, whose docstring defines the slip.
Balls that approach after it meet again at the same instant.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.clusters.complementarity import solve_smallest
from billiards_env.physics.clusters.impulses import RESIDUE, quantum, to_double
from billiards_env.physics.double_double import HI, LO
from billiards_env.physics.elementary import norm
from billiards_env.physics.state import UX, UY, VELOCITY, WZ

# Columns of `Rubbing.sums`: the impulse, and the impulses that turn a ball about z and about horizontal axes.
_PX, _PY, _PZ, _TURN, _ROLL_X, _ROLL_Y = 0, 1, 2, 3, 4, 5
_ACROSS, _UP = 0, 1  # columns of slips and of impulses of friction

_SWEEPS = 2000  # largest number of steps of `rub_all`


class Frame(NamedTuple):
    """The directions of a contact with the normal n = cos h + sin z: h, across t = z x h and up n x t.

    Attributes:
        x: The horizontal unit vector h along x.
        y: The same along y.
        tilt: (cos, sin); None for a horizontal normal.
    """

    x: Any
    y: Any
    tilt: Any


@inlined
def add_normal_impulses(friction, count, factor, first, direct, scratch):  # out: scratch
    """Adds `factor` times the impulses of `solve_plastic` to the normal impulses. With `first` they begin at zero.

    `direct` is the result of `solve_plastic`.
    """
    if friction is None:
        return
    normal, p = scratch.rubbing.normal, scratch.impulse
    if direct:
        solve_smallest(count, scratch.problem, scratch.rubbing.target)
        p = scratch.problem.x
    for c in range(count):
        before = 0.0 if first else normal[c]
        normal[c] = before + factor * to_double(p[c, HI], p[c, LO], RESIDUE * p[c, HI])


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


@inlined
def _bound(tilt, largest):
    """Returns a bound of the terms of `_parts` for impulses of friction of at most `largest` across and up."""
    if tilt is None:
        return largest
    return 2.0 * largest


@kernel
def _sum_friction(count, contacts, push, scene, rubbing):  # out: rubbing
    """Computes `Rubbing.sums`, independently of the order of the contacts, as `clusters.sum_impulses` does."""
    sums, first, second = rubbing.sums, contacts.first, contacts.second
    largest = 0.0
    for c in range(count):
        for k in range(6):
            sums[first[c], k] = sums[second[c], k] = 0.0
        largest = max(largest, abs(push[c, _ACROSS]), abs(push[c, _UP]))
    bound = _bound(scene.space.frame(0, contacts, scene).tilt, largest)
    q = quantum(bound, count) if count > 2 and largest > 0.0 else 0.0
    for c in range(count):
        i, j = first[c], second[c]
        nx, ny, tilt = scene.space.frame(c, contacts, scene)
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


@inlined
def _change_of_slip(c, contacts, sums, scene):
    """Returns the change of contact c's slip across and up by the sums of impulses, m/s."""
    i, j, (nx, ny, tilt) = contacts.first[c], contacts.second[c], scene.space.frame(c, contacts, scene)
    mi, mj = scene.inv_mass[i], scene.inv_mass[j]
    across = nx * (mi * sums[i, _PY] - mj * sums[j, _PY]) - ny * (mi * sums[i, _PX] - mj * sums[j, _PX])
    up = mi * sums[i, _PZ] - mj * sums[j, _PZ]
    turn = mi * sums[i, _TURN] + mj * sums[j, _TURN]
    roll_x = mi * sums[i, _ROLL_X] + mj * sums[j, _ROLL_X]
    roll_y = mi * sums[i, _ROLL_Y] + mj * sums[j, _ROLL_Y]
    along = nx * (mi * sums[i, _PX] - mj * sums[j, _PX]) + ny * (mi * sums[i, _PY] - mj * sums[j, _PY])
    return _slip_of(tilt, across, along, up, turn, nx * roll_y - ny * roll_x, nx * roll_x + ny * roll_y)


@kernel
def _minimise_energy(count, contacts, scene, rubbing):  # out: rubbing
    """Computes the impulses of friction, `Rubbing.last`, by an accelerated projected gradient.

    The weights are a diagonal upper bound of the quadratic form: a ball's change of velocity by `degree` impulses has
    at most `degree` times the sum of their energies.
    """
    first, second, inv_mass = contacts.first, contacts.second, scene.inv_mass
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
        _sum_friction(count, contacts, point, scene, rubbing)
        change, uphill = 0.0, False
        theta_next = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * theta * theta))
        for c in range(count):
            across, up = _change_of_slip(c, contacts, sums, scene)
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
def _rub_together(count, contacts, state, scene, rubbing):  # out: state, rubbing
    """Changes the spins and velocities of balls by the friction of all contacts of an instant together."""
    inv_mass, radius, slip = scene.inv_mass, scene.radius, rubbing.slip
    for c in range(count):
        across, up, normal = scene.space.slip(c, rubbing.normal[c], contacts, state, scene)
        slip[c, _ACROSS], slip[c, _UP] = across, up
        rubbing.limit[c] = scene.laws.friction(scene.numbers, norm(across, up)) * normal
    _minimise_energy(count, contacts, scene, rubbing)
    _sum_friction(count, contacts, rubbing.last, scene, rubbing)
    for c in range(count):
        for k in (contacts.first[c], contacts.second[c]):
            if rubbing.degree[k] == 0:
                continue
            rubbing.degree[k] = 0
            s, sums, inverse = state.rows[k], rubbing.sums[k], inv_mass[k]
            for axis in range(contacts.normal.shape[1]):
                s[VELOCITY[axis]] += inverse * sums[_PX + axis]
            s[UX] += inverse * (sums[_PX] + 2.5 * sums[_ROLL_X])
            s[UY] += inverse * (sums[_PY] + 2.5 * sums[_ROLL_Y])
            s[WZ] += 2.5 * inverse * sums[_TURN] / radius[k]


@inlined
def rub_all(friction, count, contacts, state, scene, scratch):  # out: state, scratch
    """Changes velocities, slips and spins by the friction of the impacts at one instant.

    Args:
        friction: `SceneArrays.laws.friction`.
        count: Number of contacts.
        contacts: The `Contacts`.
        state: The `State` after the normal impulses.
        scene: The `SceneArrays`.
        scratch: The `Scratch`; `rubbing.normal` holds the normal impulses.
    """
    if friction is None:
        return
    _rub_together(count, contacts, state, scene, scratch.rubbing)
