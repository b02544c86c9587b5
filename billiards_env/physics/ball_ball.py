"""The impact of two balls by the law of the scene, alone or at the same instant as others."""

from __future__ import annotations

from billiards_env.jit import inlined, kernel
from billiards_env.physics.clusters.friction import add_normal_impulses, rub_all
from billiards_env.physics.clusters.impulses import apply_changes, separation_speed, solve_plastic
from billiards_env.physics.double_double import HI, LO, add
from billiards_env.physics.elementary import norm
from billiards_env.physics.laws.balls import (
    Pair,
    along_normal,
    contact_slip,
    friction_impulse,
    normal_impulse,
    push_ball,
    rub,
    up_after,
)
from billiards_env.physics.state import ball_of, set_motion


@inlined
def _rub_both(friction, laws, tilt, a, b, pair, p, numbers):
    """Returns the states of two balls after the friction of an impact.

    `friction` is `laws.friction`; the other arguments are those of `push_apart`.
    """
    if friction is None:
        return a, b
    inverse = pair.inv_mass_i + pair.inv_mass_j
    across, up = contact_slip(tilt, a, b, pair)
    up = up_after(tilt, up, p * inverse)
    slip = norm(across, up)
    limit = laws.friction(numbers, slip) * along_normal(tilt, p)
    push = friction_impulse(across, up, slip, limit, 1.0 / (3.5 * inverse))
    return rub(a, 1.0, push, tilt, pair), rub(b, -1.0, push, tilt, pair)


@inlined
def push_apart(laws, tilt, a, b, pair, p, numbers):
    """Returns the states of two balls after an impulse along their line of centres and its friction.

    Args:
        laws: `SceneArrays.laws`.
        tilt: See `contact_slip`.
        a: The `BallState` of the first ball.
        b: That of the second ball.
        pair: The `Pair`.
        p: The horizontal part of the impulse, kg m/s.
        numbers: The `Numbers`.
    """
    a, b = _rub_both(laws.friction, laws, tilt, a, b, pair, p, numbers)
    nx, ny, mi, mj = pair.nx, pair.ny, pair.inv_mass_i, pair.inv_mass_j
    return (
        push_ball(a, -p * mi * nx, -p * mi * ny, numbers.motion),
        push_ball(b, p * mj * nx, p * mj * ny, numbers.motion),
    )


@kernel
def change_velocity(state, i, dvx, dvy, numbers):  # out: state
    """Changes ball i's velocity and slip by (dvx, dvy), m/s, so that its spin does not change."""
    set_motion(state.rows[i], push_ball(ball_of(state.rows[i]), dvx, dvy, numbers.motion))


@kernel
def _exchange_many(e, count, contacts, state, scene, scratch):  # out: state, scratch
    """Changes the velocities of balls in several contacts at one instant. With `scratch=None` numba drops the code."""
    if scratch is None:
        return 0
    increase, friction = scratch.increase, scene.laws.friction
    for c in range(count):
        increase[c, HI] = increase[c, LO] = 0.0
        if contacts.closing[c] > 0.0:
            speed, speed_lo = separation_speed(contacts, c, state)
            increase[c, HI], increase[c, LO] = -speed, -speed_lo
    direct = solve_plastic(count, contacts, scene.inv_mass, scratch)
    apply_changes(count, e, contacts, state, scene, scratch)
    add_normal_impulses(friction, count, 1.0 + e, True, direct, scratch)
    acts = 0
    for c in range(count):
        speed, speed_lo = separation_speed(contacts, c, state)
        if contacts.rebound[c] > 0.0 and speed < contacts.rebound[c]:
            acts += 1
        elif speed < 0.0:
            speed = speed_lo = 0.0  # the rounding of a plastic impact
        increase[c, HI], increase[c, LO] = add(contacts.rebound[c], 0.0, -speed, -speed_lo)
    if acts > 0:
        direct = solve_plastic(count, contacts, scene.inv_mass, scratch)
        apply_changes(count, 0.0, contacts, state, scene, scratch)
        add_normal_impulses(friction, count, 1.0, False, direct, scratch)
    rub_all(friction, count, contacts, state, scene, scratch)
    return acts


@inlined
def push_pair(i, j, n, p, state, scene):  # out: state
    """Changes the motion of balls i and j on the cloth by an impulse and its friction.

    The horizontal part p of the impulse is along the unit vector n from i to j.
    """
    pair = Pair(n[0], n[1], scene.radius[i], scene.radius[j], scene.inv_mass[i], scene.inv_mass[j])
    one, two, tilt = state.rows[i], state.rows[j], scene.space.tilt(i, j, scene)
    a, b = push_apart(scene.laws, tilt, ball_of(one), ball_of(two), pair, p, scene.numbers)
    set_motion(one, a)
    set_motion(two, b)


@inlined
def exchange_pair(e, contacts, state, scene):  # out: state
    """Changes the velocities of two balls in contact. Returns whether `rebound` has raised the speed of separation."""
    inv_mass = scene.inv_mass
    i, j, closing, rebound = contacts.first[0], contacts.second[0], contacts.closing[0], contacts.rebound[0]
    raised = e * closing < rebound
    if raised:
        p = (closing + rebound) / (inv_mass[i] + inv_mass[j])
    else:
        p = normal_impulse(closing, inv_mass[i], inv_mass[j], e)
    scene.space.push(contacts, p, state, scene)
    return raised


@inlined
def restitution_at(count, contacts, scene):
    """Returns the restitution of `count` impacts at one instant, which is that at their largest speed of approach.

    With one restitution for all of them, the energy does not rise.
    """
    closing = 0.0
    for c in range(count):
        closing = max(closing, contacts.closing[c])
    return scene.laws.restitution(scene.numbers, closing)


@kernel
def exchange(e, count, contacts, state, scene, scratch):  # out: state, scratch
    """Changes the velocities of the balls in `count` impacts at one instant.

    Args:
        e: The restitution: the result of `restitution_at`.
        count: Number of contacts, > 0.
        contacts: The `Contacts`.
        state: The `State`.
        scene: The `SceneArrays`.
        scratch: The `clusters.Scratch`; None for at most two balls, which have one contact.

    Returns:
        The number of contacts whose speed of separation `rebound` has raised.
    """
    if count > 1:
        return _exchange_many(e, count, contacts, state, scene, scratch)
    return 1 if exchange_pair(e, contacts, state, scene) else 0
