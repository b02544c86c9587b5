"""Impacts of several pairs of balls at one instant, resolved as one problem.

In a plastic impact, the changes of velocity are the smallest, in the norm of the kinetic energy, after which no pair
approaches. They solve the linear complementarity problem 0 <= p, 0 <= N^T (v + M^-1 N p), p . N^T (v + M^-1 N p) = 0
for the impulses p along the contact normals N. These changes, multiplied by 1 + e, are the generalised reflection of
Smith, Kaufman, Vouga, Tamstorf and Grinspun (2012), Reflections on Simultaneous Impact, which keeps momentum and (for
e = 1) energy, and treats all contacts alike. The result does not depend on the numbering of balls and contacts, and a
mirrored problem has the mirrored result bit for bit. Problems of up to `MOST` contacts are solved directly in
double-double arithmetic, larger ones by iteration in double precision.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.jit import allocating, inlined, kernel
from billiards_env.physics.clusters.complementarity import (
    MOST,
    ComplementarityProblem,
    empty_problem,
    solve_complementarity,
)
from billiards_env.physics.double_double import HI, LO, add, multiply, two_product, two_sum
from billiards_env.physics.state import SLIDING_AND_ROLLING, SLIP, VELOCITY, X

_SWEEPS = 2000  # largest number of iterations of `_descend`
RESIDUE = 2.0**-80
"""Relative to the largest speed of approach or to an impulse: more than the errors of double-double arithmetic."""


class Contacts(NamedTuple):
    """Pairs of balls that touch at one instant, in arrays with room for `most` of them.

    Attributes:
        first: (most,) int64, a ball of each pair.
        second: (most,) int64, the other ball.
        normal: (most, 2 or, in space, 3) float64, the unit normal from first to second.
        closing: (most,) float64, speed of approach, m/s, >= 0.
        rebound: (most,) float64, least speed of separation after the impact, m/s, >= 0.
    """

    first: Any
    second: Any
    normal: Any
    closing: Any
    rebound: Any


@allocating
def empty_contacts(most, axes):
    """Returns `Contacts` with room for `most` of them. `rebound` is zero, the rest is undefined.

    `axes` is the result of `Space.axes`.
    """
    balls, speeds = np.empty((2, most), np.int64), np.empty((2, most))
    contacts = Contacts(balls[0], balls[1], np.empty((most, axes)), speeds[0], speeds[1])
    for c in range(most):  # `np.zeros` would be another function to compile
        contacts.rebound[c] = 0.0
    return contacts


@inlined
def set_normal(contacts, c, n):  # out: contacts
    """Sets the normal of contact c to as many components of n as it has."""
    for axis in range(contacts.normal.shape[1]):
        contacts.normal[c, axis] = n[axis]


class Rubbing(NamedTuple):
    """Scratch arrays for the friction of up to `most` impacts of n balls at one instant.

    Attributes:
        normal: (most,) float64, normal impulses, kg m/s.
        target: (min(most, MOST), 4) float64, scratch of `solve_smallest`.
        limit: (most,) float64, the largest friction, kg m/s.
        weight: (most,) float64, upper bounds of the change of slip per impulse, 1/kg.
        slip: (most, 2) float64, slip across and up (see `physics.clusters.friction`) before the friction, m/s.
        point: (most, 2) float64, impulses of friction in these directions, kg m/s.
        last: (most, 2) float64, the same after a step.
        sums: (n, 6) float64, sums of impulses on each ball.
        degree: (n,) int64, number of contacts of each ball.
    """

    normal: Any
    target: Any
    limit: Any
    weight: Any
    slip: Any
    point: Any
    last: Any
    sums: Any
    degree: Any


class Scratch(NamedTuple):
    """Scratch arrays for the resolution of up to `most` impacts of n balls.

    Attributes:
        increase: (most, 2) float64, double-double: required increase of each contact's speed of separation, m/s.
        impulse: (most, 2) float64, double-double, kg m/s.
        change: (n, 2 or 3, 2) float64, changes of velocity, double-double, m/s.
        problem: The `ComplementarityProblem` of up to `MOST` contacts.
        descent: (4, most) float64, scratch of `_descend`.
        dv: (n, 2 or 3) float64, changes of velocity, m/s; `apply_changes` uses it as scratch.
        done: (n,) bool, False between calls.
        rubbing: The `Rubbing`; None for balls without friction.
    """

    increase: Any
    impulse: Any
    change: Any
    problem: ComplementarityProblem
    descent: Any
    dv: Any
    done: Any
    rubbing: Any


@allocating
def _empty_rubbing(friction, n, most):
    if friction is None:
        return None
    return Rubbing(
        normal=np.empty(most),
        target=np.empty((min(most, MOST), 4)),
        limit=np.empty(most),
        weight=np.empty(most),
        slip=np.empty((most, 2)),
        point=np.empty((most, 2)),
        last=np.empty((most, 2)),
        sums=np.empty((n, 6)),
        degree=np.empty(n, np.int64),
    )


@allocating
def empty_scratch(n, most, friction, axes):
    """Returns the `Scratch` for n balls and `most` contacts.

    `friction` is `SceneArrays.laws.friction`, and `axes` is the result of `Space.axes`.
    """
    return Scratch(
        increase=np.empty((most, 2)),
        impulse=np.empty((most, 2)),
        change=np.empty((n, axes, 2)),
        problem=empty_problem(min(most, MOST)),
        descent=np.empty((4, most)),
        dv=np.empty((n, axes)),
        done=np.zeros(n, np.bool_),
        rubbing=_empty_rubbing(friction, n, most),
    )


@inlined
def separation_speed(contacts, c, state):
    """Returns the speed at which the balls of contact c separate, m/s, as a double-double number."""
    i, j = contacts.first[c], contacts.second[c]
    rows = state.rows
    speed, speed_lo = 0.0, 0.0
    for axis in range(contacts.normal.shape[1]):
        w, w_lo = two_sum(rows[j, VELOCITY[axis]], -rows[i, VELOCITY[axis]])
        part, part_lo = multiply(w, w_lo, contacts.normal[c, axis], 0.0)
        speed, speed_lo = add(speed, speed_lo, part, part_lo)
    return speed, speed_lo


@inlined
def _coupling(contacts, c, k, inv_mass):
    """Returns the change of contact c's speed of separation by a unit impulse at contact k, 1/kg, double-double."""
    first, second = contacts.first, contacts.second
    if first[c] == first[k] and second[c] == second[k]:
        shared, shared_lo = two_sum(inv_mass[first[c]], inv_mass[second[c]])
    elif first[c] == first[k]:
        shared, shared_lo = inv_mass[first[c]], 0.0
    elif second[c] == second[k]:
        shared, shared_lo = inv_mass[second[c]], 0.0
    elif first[c] == second[k]:
        shared, shared_lo = -inv_mass[first[c]], 0.0
    elif second[c] == first[k]:
        shared, shared_lo = -inv_mass[second[c]], 0.0
    else:
        return 0.0, 0.0
    cosine, cosine_lo = 0.0, 0.0
    for axis in range(contacts.normal.shape[1]):
        x, x_lo = two_product(contacts.normal[c, axis], contacts.normal[k, axis])
        cosine, cosine_lo = add(cosine, cosine_lo, x, x_lo)
    return multiply(cosine, cosine_lo, shared, shared_lo)


@kernel
def _solve_directly(count, contacts, inv_mass, scratch):  # out: scratch
    """Computes the plastic impulses by `solve_complementarity`. Returns whether that succeeds."""
    problem, impulse, increase = scratch.problem, scratch.impulse, scratch.increase
    for c in range(count):
        problem.b[c, HI], problem.b[c, LO] = increase[c, HI], increase[c, LO]
        for k in range(c + 1):
            value, value_lo = _coupling(contacts, c, k, inv_mass)
            problem.a[c, k, HI], problem.a[c, k, LO] = value, value_lo
            problem.a[k, c, HI], problem.a[k, c, LO] = value, value_lo
    is_solved = solve_complementarity(count, problem)
    for c in range(count):
        impulse[c, HI], impulse[c, LO] = problem.x[c, HI], problem.x[c, LO]
    return is_solved


@kernel
def _descend(count, contacts, inv_mass, scratch):  # out: scratch
    """Computes the plastic impulses of many contacts by an accelerated projected gradient.

    Nesterov (1983), with the restart of O'Donoghue and Candes (2015), scaled to a unit diagonal. Every sum over a
    ball's contacts is exact (see `sum_impulses`), so it does not depend on their order.
    """
    first, second, normal = contacts.first, contacts.second, contacts.normal
    increase, dv, done = scratch.increase, scratch.dv, scratch.done
    scale, point, last, step = scratch.descent[0], scratch.descent[1], scratch.descent[2], scratch.descent[3]
    for c in range(count):
        scale[c] = 1.0 / math.sqrt(inv_mass[first[c]] + inv_mass[second[c]])
        point[c] = last[c] = 0.0
    bound = 1.0  # the largest absolute row sum, an upper bound of the eigenvalues
    largest = 0.0
    for c in range(count):
        row = 1.0
        for k in range(count):
            if k != c:
                term = abs(_coupling(contacts, c, k, inv_mass)[0]) * (scale[c] * scale[k])
                row += math.ldexp(math.ceil(math.ldexp(term, 20)), -20)  # sums of multiples of 2^-20 are exact
        bound = max(bound, row)
        largest = max(largest, increase[c, HI] * scale[c])
    theta = 1.0
    for _ in range(_SWEEPS):
        sum_impulses(count, contacts, point, scale, inv_mass, dv, done)
        change = 0.0
        for c in range(count):
            i, j = first[c], second[c]
            done[i] = done[j] = False
            opening = 0.0
            for axis in range(normal.shape[1]):
                opening += normal[c, axis] * (dv[j, axis] - dv[i, axis])
            new = max(0.0, point[c] - (opening - increase[c, HI]) * scale[c] / bound)
            step[c] = new - last[c]
            last[c] = new
            change = max(change, abs(step[c]))
        if change <= 2e-16 * largest:
            break
        uphill = False
        for c in range(count):
            back = (point[c] - last[c]) * step[c] > 0.0
            uphill = uphill or (back and abs(step[c]) > 0.5 * change)
        theta_next = 1.0 if uphill else 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * theta * theta))
        momentum = 0.0 if uphill else (theta - 1.0) / theta_next
        theta = theta_next
        for c in range(count):
            point[c] = last[c] + momentum * step[c]
    for c in range(count):
        scratch.impulse[c, HI], scratch.impulse[c, LO] = last[c] * scale[c], 0.0


@kernel
def quantum(largest, n_terms):
    """Returns a q such that n_terms values (x + q) - q, which are x rounded, sum exactly for abs(x) <= `largest`."""
    _, exponent = math.frexp(largest)
    _, spare = math.frexp(float(n_terms))
    return math.ldexp(1.5, exponent + max(2, spare - 1))


@kernel
def sum_impulses(count, contacts, impulse, scale, inv_mass, dv, done):  # out: dv, done
    """Computes the changes of velocity by the impulses `impulse * scale`, independently of the order of the contacts.

    More than two terms are rounded to a common multiple before they are added (Demmel and Nguyen 2013, Fast
    Reproducible Floating-Point Summation), which makes the sum exact.

    Args:
        count: Number of contacts.
        contacts: The `Contacts`.
        impulse: (>= count,) float64.
        scale: (>= count,) float64.
        inv_mass: (n,) float64, 1/kg.
        dv: (n, 2 or 3) float64 out, for the balls in contact.
        done: (n,) bool out: True for the balls in contact; the caller resets it.
    """
    first, second = contacts.first, contacts.second
    largest = 0.0
    for c in range(count):
        for k in (first[c], second[c]):
            for axis in range(dv.shape[1]):
                dv[k, axis] = 0.0
            done[k] = False
        largest = max(largest, abs(impulse[c] * scale[c]))
    q = quantum(largest, count) if count > 2 and largest > 0.0 else 0.0
    for c in range(count):
        p = impulse[c] * scale[c]
        for axis in range(dv.shape[1]):
            part = (p * contacts.normal[c, axis] + q) - q
            dv[first[c], axis] -= part
            dv[second[c], axis] += part
    for c in range(count):
        for k in (first[c], second[c]):
            if not done[k]:
                for axis in range(dv.shape[1]):
                    dv[k, axis] *= inv_mass[k]
                done[k] = True


@kernel
def solve_plastic(count, contacts, inv_mass, scratch):  # out: scratch
    """Computes the smallest changes of velocity that raise the contacts' speeds of separation as required.

    Args:
        count: Number of contacts, > 1.
        contacts: The `Contacts`.
        inv_mass: (n,) float64, 1/kg.
        scratch: The `Scratch`; `increase` is read, `change` holds the result for the balls in contact.

    Returns:
        Whether the problem was solved directly.
    """
    change, impulse = scratch.change, scratch.impulse
    direct = count <= MOST and _solve_directly(count, contacts, inv_mass, scratch)
    if not direct:
        _descend(count, contacts, inv_mass, scratch)
    for c in range(count):
        change[contacts.first[c]] = 0.0
        change[contacts.second[c]] = 0.0
    for c in range(count):
        for k in (contacts.first[c], contacts.second[c]):
            sign = -1.0 if k == contacts.first[c] else 1.0
            p, p_lo = multiply(impulse[c, HI], impulse[c, LO], sign * inv_mass[k], 0.0)
            for axis in range(change.shape[1]):
                x, x_lo = multiply(p, p_lo, contacts.normal[c, axis], 0.0)
                change[k, axis, HI], change[k, axis, LO] = add(change[k, axis, HI], change[k, axis, LO], x, x_lo)
    return direct


@inlined
def _multiple(x, residue):
    """Returns x rounded to a multiple of the residue, or x itself if it is much larger."""
    if abs(x) < 2.0**50 * residue:
        shift = 1.5 * 2.0**52 * residue
        x = (x + shift) - shift
    return x


@inlined
def to_double(x, x_lo, residue):
    """Returns a double-double number, rounded to a multiple of the residue and then to a double.

    Errors of the double-double arithmetic depend on the order of the contacts. The first rounding removes them, so that
    they do not decide the second one if the number is zero or halfway between two doubles, as in some racks.
    """
    return _multiple(x, residue) + _multiple(x_lo, residue)


@kernel
def apply_changes(count, factor, contacts, state, scene, scratch):  # out: state, scratch
    """Adds 1 + factor times the changes of `solve_plastic` to the balls' velocities. The spins do not change.

    Args:
        count: Number of contacts.
        factor: >= 0.
        contacts: The `Contacts`.
        state: The `State`.
        scene: The `SceneArrays`.
        scratch: The `Scratch`.
    """
    numbers, inv_mass = scene.numbers, scene.inv_mass
    change, scale, done = scratch.change, scratch.dv, scratch.done
    largest = 0.0
    for c in range(count):
        largest = max(largest, scratch.increase[c, HI])
        scale[contacts.first[c], X] = scale[contacts.second[c], X] = 0.0
    for c in range(count):
        i, j = contacts.first[c], contacts.second[c]
        both = inv_mass[i] + inv_mass[j]
        scale[i, X] = max(scale[i, X], inv_mass[i] / both)
        scale[j, X] = max(scale[j, X], inv_mass[j] / both)
    times, times_lo = two_sum(1.0, factor)
    for c in range(count):
        for k in (contacts.first[c], contacts.second[c]):
            if done[k]:
                continue
            done[k] = True
            s = state.rows[k]
            residue = RESIDUE * (largest * scale[k, X])
            for axis in range(change.shape[1]):
                x, x_lo = multiply(change[k, axis, HI], change[k, axis, LO], times, times_lo)
                v = VELOCITY[axis]
                s[v] = to_double(*add(s[v], 0.0, x, x_lo), residue)
                if axis < len(SLIP) and numbers.motion == SLIDING_AND_ROLLING:
                    u = SLIP[axis]
                    s[u] = to_double(*add(s[u], 0.0, x, x_lo), residue)
    for c in range(count):
        done[contacts.first[c]] = done[contacts.second[c]] = False
