"""The contact-time rule, which ends infinite sequences of impacts.

**Pressed bodies.** Bodies that friction presses together would bounce in ever smaller hops, an infinite number of them
in a finite time. In the TC model of Luding and McNamara (1998), How to handle the inelastic collapse of a dissipative
hard-sphere gas, impacts closer together than the duration tau of a contact are one lasting contact. Here the rule acts
on weak impacts: those whose speed of approach is at most A tau, where A is the largest acceleration by friction. After
a weak impact, bodies that accelerate towards each other at `a` separate at a tau / 2 or more. The rule applies the
impulse that is necessary for this, with its friction. The bodies meet again after about tau. As tau goes to zero, the
hops become the motion of bodies in lasting contact.

Rolling resistance presses balls together so weakly that there would be thousands of hops. After more than `PRESSED`
weak impacts in a row, bodies that accelerate towards each other separate at A tau / 2 or more. Bodies that do not
accelerate towards each other are about to stop next to each other. They separate at the speed s, at least, at which a
ball rolls as far as `RESOLUTION`. After more than `JAMMED` weak impacts, s is replaced by the speed of approach,
limited to the interval from s / 100 to s.

The rule does not change an impact after which the bodies separate faster without it. An act of the rule adds at most
m/2 (3/2 A tau)^2 to the energy, where m is the mass of the heavier ball.

**Other sequences.** If the intervals between impacts shrink because of masses or restitution, the speeds fall
geometrically, and the impacts are computed one by one. The rule only ends a long run of impacts at one place and
instant, as follows. After more than `JAMMED` weak impacts, a light ball between a heavy one and a fixed body is jammed
(see `resolve_jam`), and a weak impact with a cushion is plastic. All balls of an impact come to rest if one of them has
had more than `WEDGED` weak impacts or more than `longest_run` impacts of any speed, or if they are slower than `STILL`.
A ball that a spinning ball wedges into a corner has such runs again and again until the spin ends, which may take
minutes. So after `ENDLESS` weak impacts in a row, balls that are slower than a weak impact come to rest sooner.
A finite sequence of two balls and a fixed body has fewer impacts than `longest_run`. An elastic ball that fits exactly
between two fixed bodies has more, so the rule stops it. An elastic ball in a wedge between two cushions has up to
pi / angle impacts, so the rule may stop it if the angle is less than pi / `longest_run`, which is 0.18 degrees.

`engine.in_space` describes the rule for balls above the cloth.

The kernels change velocities, slip and spin; the caller then sets the phase with `motion.begin_phase`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.jit import allocating, inlined, kernel
from billiards_env.physics.ball_ball import change_velocity, exchange_pair, restitution_at
from billiards_env.physics.ball_cushion import reflect, reflect_both
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.walls import wall_pressing
from billiards_env.physics.laws.cloth import largest_friction, launch
from billiards_env.physics.state import IDEAL, UX, UY, VELOCITY, VX, VY, X, Y, axes_of

CONTACT_TIME = 2e-4
"""s. tau; it is 200 to 300 microseconds for billiard balls (Marlow 1995)."""

PRESSED = 3
"""After more than this number of weak impacts in a row, bodies separate faster."""

JAMMED = 20
"""After more than this number of impacts of both at one place and instant, one of two balls may be jammed."""

WEDGED = 100
"""After more than this number of weak impacts at one place and instant a ball comes to rest."""

ENDLESS = 10_000
"""After more than this number of weak impacts in a row, slow balls come to rest after `PRESSED` impacts at a place."""

RESOLUTION = 1e-8
"""m. Balls that are about to stop next to each other separate by about this distance."""

STILL = 1e-200
"""m/s. Balls that are slower than this in a run of impacts at one place and instant come to rest."""


def longest_run(mass: tuple[float, ...]) -> float:
    """Returns the number of impacts at one place and instant after which a ball comes to rest.

    A ball between a wall and another ball of r times its mass has at most about pi sqrt(r) impacts before they part,
    if the impacts are elastic and nothing presses the balls.

    Args:
        mass: Masses of the balls, kg; not all infinite.
    """
    finite = [m for m in mass if math.isfinite(m)]
    return 1_000.0 + 10.0 * math.sqrt(max(finite) / min(finite))


def weak_speed(motion: int, slide: float, roll: float) -> float:
    """Returns the largest speed of approach of a weak impact, m/s; the arguments are fields of `Numbers`."""
    return CONTACT_TIME * 2.0 * largest_friction(motion, slide, roll)  # of two balls


class Memory(NamedTuple):
    """The recent impacts of n balls, as counted by the contact-time rule.

    Attributes:
        last_impact: (n,) float64, time of each ball's last impact, s.
        run: (n,) int64, number of impacts of each ball at its present place and instant.
        weak: (n,) int64, number of impacts since the last one that was not weak, including that one.
    """

    last_impact: Any
    run: Any
    weak: Any


@allocating
def empty_memory(n):
    """Returns the `Memory` of n balls, with undefined content."""
    counts = np.empty((2, n), np.int64)
    return Memory(np.empty(n), counts[0], counts[1])


@inlined
def reset_memory(memory):  # out: memory
    """Resets the memory at the beginning of a shot."""
    memory.last_impact[:] = -math.inf
    memory.run[:] = 0
    memory.weak[:] = 0


class Limits(NamedTuple):
    """The limits of weak impacts at a contact.

    Attributes:
        speed: The largest speed of approach of a weak impact, A tau, m/s.
        tau: The contact time, s.
    """

    speed: Any
    tau: Any


@inlined
def least_rebound(speed, towards, weak, limits, numbers):
    """Returns the least speed at which two bodies separate by the rule, m/s.

    Args:
        speed: Speed of approach, m/s.
        towards: Acceleration towards each other, m/s^2.
        weak: Entry `Memory.weak` of the body, or the smaller one of two balls.
        limits: The `Limits`.
        numbers: The `Numbers`.
    """
    if speed > limits.speed or numbers.motion == IDEAL:
        return 0.0
    least = 0.5 * limits.tau * max(0.0, towards)
    if weak <= PRESSED:
        return least
    if towards > 0.0:
        return max(least, 0.5 * limits.speed)
    least = launch(numbers, RESOLUTION, 0.0, 0.0)  # a ball with this speed rolls RESOLUTION
    if weak <= JAMMED:
        return least
    return min(max(speed, 0.01 * least), least)  # repeated separations must not keep balls moving


@inlined
def end_runs(i, time, speed, weak_speed, numbers, memory):  # out: memory
    """Resets the counts of ball i that an impact at a time (s), with a speed of approach (m/s), does not continue.

    `weak_speed` is `Limits.speed`.
    """
    interval = time - memory.last_impact[i]
    if interval * speed > RESOLUTION or interval > 0.01 * numbers.tau:
        memory.run[i] = 0
    if speed > weak_speed:
        memory.weak[i] = 0


@inlined
def is_over(i, j, state, numbers, memory):
    """Returns whether balls i and j, which may be the same, come to rest in this impact."""
    rows, run, weak = state.rows, memory.run, memory.weak
    if max(run[i], run[j]) > numbers.longest_run or max(min(run[i], weak[i]), min(run[j], weak[j])) > WEDGED:
        return True
    if min(run[i], run[j]) < 2:
        return False
    speed = 0.0
    for axis in range(axes_of(state)):
        speed = max(speed, abs(rows[i, VELOCITY[axis]]), abs(rows[j, VELOCITY[axis]]))
    endless = max(weak[i], weak[j]) > ENDLESS and min(run[i], run[j]) > PRESSED
    return speed < STILL or (endless and speed <= numbers.weak_speed)


@inlined
def count_impact(i, time, memory):  # out: memory
    """Counts an impact of ball i at a time (s)."""
    memory.run[i] += 1
    memory.weak[i] += 1
    memory.last_impact[i] = time


@inlined
def is_ordinary(i, time, speed, weak_speed, numbers, memory):
    """Returns whether an impact of ball i is neither weak nor soon after its last one. The rule does not act on it."""
    return speed > weak_speed and time - memory.last_impact[i] > 0.01 * numbers.tau


@inlined
def count_ordinary(i, time, memory):  # out: memory
    """Counts an ordinary impact of ball i at a time (s), which starts new runs."""
    memory.run[i] = memory.weak[i] = 1
    memory.last_impact[i] = time


@kernel
def halt(state, i):  # out: state
    """Brings ball i to rest without a change of its spin about the vertical axis."""
    for axis in range(axes_of(state)):
        state.rows[i, VELOCITY[axis]] = 0.0
    state.rows[i, UX] = state.rows[i, UY] = 0.0


@kernel
def resolve_jam(contacts, state, scene, memory):  # out: state
    """Resolves the first contact if its balls are jammed. Returns whether it does.

    If friction presses a heavy ball against a light one at a fixed body, the number of impacts that lift the heavy ball
    is about the ratio of the masses. After more than `JAMMED` impacts of both balls at one place and instant, the ball
    with fewer of them is moved away, and the other, jammed ball keeps its velocity. This happens in two cases. Either
    the impacts are weak and the jammed ball moves along the normal at `Numbers.weak_speed` at most. Or the impact
    changes the velocity of the moved ball by no more than its rounding, and the speed of approach and the jammed ball's
    speed along the normal are at most 2^-24 of the moved ball's speed. Other weak impacts are plastic.
    """
    i, j, closing, rebound = contacts.first[0], contacts.second[0], contacts.closing[0], contacts.rebound[0]
    rows, numbers, inv_mass = state.rows, scene.numbers, scene.inv_mass
    run, weak = memory.run, memory.weak
    if min(run[i], run[j]) <= JAMMED:
        return False
    moved, sign = (i, -1.0) if run[i] < run[j] else (j, 1.0)
    nx, ny = contacts.normal[0, X], contacts.normal[0, Y]
    jammed = i + j - moved
    along = abs(nx * rows[jammed, VX] + ny * rows[jammed, VY])  # a jammed ball hardly moves along the normal
    lifts = run[i] != run[j] and inv_mass[moved] > 0.0
    if min(weak[i], weak[j]) > JAMMED:
        lifts = lifts and rebound > 0.0 and along <= numbers.weak_speed
    else:
        speed = norm(rows[moved, VX], rows[moved, VY])
        change = 2.0 * closing * inv_mass[moved] / (inv_mass[i] + inv_mass[j])
        if not lifts or change > 2.0**-52 * speed or max(closing, along) > 2.0**-24 * speed:
            return False
    if lifts:
        change_velocity(state, moved, sign * (closing + rebound) * nx, sign * (closing + rebound) * ny, numbers)
    else:
        p = closing / (inv_mass[i] + inv_mass[j])
        change_velocity(state, i, -p * inv_mass[i] * nx, -p * inv_mass[i] * ny, numbers)
        change_velocity(state, j, p * inv_mass[j] * nx, p * inv_mass[j] * ny, numbers)
    return True


class CushionContact(NamedTuple):
    """A contact of a ball with a cushion.

    Attributes:
        ball: The ball.
        wall: The number of the cushion.
        nx: The unit normal into the cushion along x.
        ny: The same along y.
        speed: Speed of approach, m/s.
    """

    ball: Any
    wall: Any
    nx: Any
    ny: Any
    speed: Any


@kernel
def _hit_cushion_again(contact, time, state, scene, memory):  # out: state, memory
    """Implements `hit_cushion` for an impact that is not ordinary."""
    i, wall, nx, ny, speed = contact
    numbers = scene.numbers
    end_runs(i, time, speed, numbers.weak_speed, numbers, memory)
    count_impact(i, time, memory)
    if is_over(i, i, state, numbers, memory):
        halt(state, i)
        return 1
    if min(memory.run[i], memory.weak[i]) > JAMMED:
        change_velocity(state, i, -speed * nx, -speed * ny, numbers)
        return 1
    towards = wall_pressing(state, i, nx, ny, wall, scene)
    limits = Limits(numbers.weak_speed, numbers.tau)
    rebound = least_rebound(speed, towards, memory.weak[i], limits, numbers)
    return 1 if reflect(state, i, nx, ny, rebound, scene) else 0


@inlined
def hit_cushion(contact, time, state, scene, memory):  # out: state, memory
    """Changes the motion of a ball at a cushion.

    Args:
        contact: The `CushionContact`.
        time: s.
        state: The `State`.
        scene: The `SceneArrays`.
        memory: The `Memory`.

    Returns:
        The number of acts of the rule.
    """
    i = contact.ball
    if is_ordinary(i, time, contact.speed, scene.numbers.weak_speed, scene.numbers, memory):
        count_ordinary(i, time, memory)
        reflect(state, i, contact.nx, contact.ny, 0.0, scene)
        return 0
    return _hit_cushion_again(contact, time, state, scene, memory)


@kernel
def hit_corner(one, two, time, state, scene, memory):  # out: state, memory
    """Changes the motion of a ball at two cushions, as `hit_cushion` does; both are `CushionContact`s of the ball.

    The two count as one impact, at the larger speed of approach.
    """
    i, numbers = one.ball, scene.numbers
    end_runs(i, time, max(one.speed, two.speed), numbers.weak_speed, numbers, memory)
    count_impact(i, time, memory)
    if is_over(i, i, state, numbers, memory):
        halt(state, i)
        return 1
    if min(memory.run[i], memory.weak[i]) > JAMMED:
        change_velocity(state, i, -state.rows[i, VX], -state.rows[i, VY], numbers)
        return 1
    pressing_one = wall_pressing(state, i, one.nx, one.ny, one.wall, scene)
    pressing_two = wall_pressing(state, i, two.nx, two.ny, two.wall, scene)
    limits = Limits(numbers.weak_speed, numbers.tau)
    rebounds = (
        least_rebound(one.speed, pressing_one, memory.weak[i], limits, numbers),
        least_rebound(two.speed, pressing_two, memory.weak[i], limits, numbers),
    )
    return 1 if reflect_both(state, i, (one.nx, one.ny), (two.nx, two.ny), rebounds, scene) else 0


@kernel
def _collide_again(count, time, contacts, state, scene, scratch, memory):  # out: contacts, state, scratch, memory
    """Implements `collide` for impacts that are not one ordinary impact."""
    first, second, closing, numbers = contacts.first, contacts.second, contacts.closing, scene.numbers
    for c in range(count):  # before any impact is counted, so that the order of the contacts does not matter
        limits = scene.space.limits(c, contacts, state, numbers)
        end_runs(first[c], time, closing[c], limits.speed, numbers, memory)
        end_runs(second[c], time, closing[c], limits.speed, numbers, memory)
    for c in range(count):
        count_impact(first[c], time, memory)
        count_impact(second[c], time, memory)
    over = False
    for c in range(count):
        i, j = first[c], second[c]
        over = over or is_over(i, j, state, numbers, memory)
        limits = scene.space.limits(c, contacts, state, numbers)
        closing[c], towards = scene.space.pressing(c, contacts, state, scene)
        contacts.rebound[c] = least_rebound(closing[c], towards, min(memory.weak[i], memory.weak[j]), limits, numbers)
    if scene.space.stop(over, count, contacts, state, scene, memory):
        return 1
    e = 0.0 if over else restitution_at(count, contacts, scene)
    return scene.space.exchange(e, count, contacts, state, scene, scratch)


@inlined
def collide(count, time, contacts, state, scene, scratch, memory):  # out: contacts, state, scratch, memory
    """Changes the velocities of the balls in `count` simultaneous impacts.

    Args:
        count: Number of contacts.
        time: s.
        contacts: The `Contacts`. This function sets `rebound`.
        state: The `State`.
        scene: The `SceneArrays`.
        scratch: The `clusters.Scratch`; None for at most two balls.
        memory: The `Memory`.

    Returns:
        The number of acts of the rule.
    """
    i, j, speed = contacts.first[0], contacts.second[0], contacts.closing[0]
    numbers, acts, weak = scene.numbers, 0, scene.space.limits(0, contacts, state, scene.numbers).speed
    ordinary = is_ordinary(i, time, speed, weak, numbers, memory) and is_ordinary(j, time, speed, weak, numbers, memory)
    if count == 1 and ordinary:
        count_ordinary(i, time, memory)
        count_ordinary(j, time, memory)
        contacts.rebound[0] = 0.0
        exchange_pair(restitution_at(1, contacts, scene), contacts, state, scene)
    else:
        acts = _collide_again(count, time, contacts, state, scene, scratch, memory)
    return acts
