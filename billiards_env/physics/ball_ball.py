"""The impact of two balls, alone or at the same instant as others."""

from __future__ import annotations

from billiards_env.jit import inlined, kernel
from billiards_env.physics.clusters.friction import add_normal_impulses, rub_all, tilt_of
from billiards_env.physics.clusters.impulses import apply_changes, separation_speed, solve_plastic
from billiards_env.physics.double_double import HI, LO, add
from billiards_env.physics.laws.balls import Pair, normal_impulse, push_apart, push_ball
from billiards_env.physics.state import ball_of, set_motion


@kernel
def change_velocity(state, i, dvx, dvy, numbers):  # out: state
    """Changes ball i's velocity and slip by (dvx, dvy), m/s, so that its spin does not change."""
    set_motion(state.rows[i], push_ball(ball_of(state.rows[i]), dvx, dvy, numbers.motion))


@kernel
def _exchange_many(count, contacts, state, scene, scratch):  # out: state, scratch
    """Implements `exchange` for more than one contact. With `scratch=None` numba drops the rest."""
    if scratch is None:
        return 0
    e, increase, friction = scene.numbers.e_ball, scratch.increase, scene.ball_friction
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
    """Changes the motion of balls i and j by the impulse p along the unit vector n from i to j, and by its friction."""
    pair = Pair(n[0], n[1], scene.radius[i], scene.radius[j], scene.inv_mass[i], scene.inv_mass[j])
    one, two, tilt = state.rows[i], state.rows[j], tilt_of(scene.spheres, i, j)
    a, b = push_apart(scene.ball_friction, tilt, ball_of(one), ball_of(two), pair, p, scene.numbers)
    set_motion(one, a)
    set_motion(two, b)


@inlined
def exchange_pair(contacts, state, scene):  # out: state
    """Implements `exchange` for one contact. Returns whether `rebound` has raised the speed of separation."""
    e, inv_mass = scene.numbers.e_ball, scene.inv_mass
    i, j, closing, rebound = contacts.first[0], contacts.second[0], contacts.closing[0], contacts.rebound[0]
    raised = e * closing < rebound
    if raised:
        p = (closing + rebound) / (inv_mass[i] + inv_mass[j])
    else:
        p = normal_impulse(closing, inv_mass[i], inv_mass[j], e)
    push_pair(i, j, (contacts.nx[0], contacts.ny[0]), p, state, scene)
    return raised


@kernel
def exchange(count, contacts, state, scene, scratch):  # out: state, scratch
    """Changes the velocities of the balls in `count` impacts at one instant.

    Args:
        count: Number of contacts, > 0.
        contacts: The `Contacts`.
        state: The `State`.
        scene: The `SceneArrays`.
        scratch: The `clusters.Scratch`; None for at most two balls, which have one contact.

    Returns:
        The number of contacts whose speed of separation `rebound` has raised.
    """
    if count > 1:
        return _exchange_many(count, contacts, state, scene, scratch)
    return 1 if exchange_pair(contacts, state, scene) else 0
