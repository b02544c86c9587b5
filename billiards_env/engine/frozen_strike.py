"""Strikes of a ball that is frozen to others: it touches them, and the cue drives them together.

The tip pushes for about a millisecond, longer than an impact of two balls lasts, 0.3 ms (Mathavan, Jackson and Parkin
2014). So the balls accelerate together while it pushes, as high-speed video shows (Shepard 2003, note on frozen balls):

* The impact is plastic, with the friction of the scene. Chains and racks of touching balls are one problem, see
  `physics.clusters.impulses`. Measured directions: Alciatore, TP A.15.
* The tip pushes a larger mass. An impulse of the tip that gives the free ball the energy m V^2 (1 + k) / 2 gives these
  balls the energy m V^2 (push + k) / 2. `strike.impulse_gain` computes the impulse from this energy. Friction and
  the direction of the balls are computed at the speed of the free ball. The cue is taken as level. In scenes with
  flight the normals of balls of different size are taken as horizontal.
* A share `LEFT` of the speed of approach remains at the start of the shot, so its first event is an ordinary impact of
  the balls. With the restitution `e_ball` the ratio of their speeds after a full hit is (1 - LEFT e_ball) /
  (1 + LEFT e_ball).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from billiards_env.engine.compile import cached_by_scene, scene_kernels, with_scatter
from billiards_env.engine.shots import Starts, load_balls, store
from billiards_env.jit import Typed, allocating, entry_point, inlined
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.ball_ball import exchange
from billiards_env.physics.clusters.impulses import empty_contacts, empty_scratch, set_normal
from billiards_env.physics.elementary import norm
from billiards_env.physics.state import UX, UY, VELOCITY, VX, VY, WZ, X, Y, axes_of, empty_state, scene_of
from billiards_env.physics.strike import CueNumbers, cue_numbers, impulse_gain
from billiards_env.scene import Scene

LEFT = 0.0069
"""Share of the speed of approach that remains for the impact after the strike. With `e_ball` 0.95 the cue ball then has
0.987 times the speed of the object ball after a full hit. No publication of a measurement of this ratio is known."""


def strike_frozen(scene: Scene, fields: tuple[Any, ...], starts: tuple[Any, ...], begin: int = 0, end: int = 1) -> bool:
    """Replaces the starts of shots whose cue ball touches balls ahead of it.

    Args:
        scene: The scene.
        fields: Its `scene_fields`, or `varied_fields` of the shots.
        starts: The `Starts`, as a plain tuple. The cue ball has the velocity and the spin of a free ball, and the
            others rest. They get the velocities and spins that they have when the cue has lost contact.
        begin: First shot.
        end: One past the last.

    Returns:
        Whether there is such a shot. Only these compile `_drive`.
    """
    plain = with_scatter(fields, None)
    if scene.physics.motion != "sliding" or not _look_ahead(scene).call(begin, end, plain, starts):
        return False
    for ball in np.unique(Starts(*starts).cue[begin:end]).tolist():
        _drive(scene_kernels(scene), begin, end, ball, tuple(cue_numbers(scene, ball)), plain, starts)
    return True


@cached_by_scene
def _look_ahead(scene: Scene) -> Typed:
    """Returns `_is_ahead` without its argument `kernels`."""
    return Typed(_is_ahead, scene_kernels(scene))


@inlined
def _drives(k, ball, scene, starts):
    """Returns whether the ball moves towards a ball that it touches."""
    vx, vy = starts.velocities[k, ball, X], starts.velocities[k, ball, Y]
    for j in range(len(scene.radius)):
        if j != ball:
            nx, ny = scene.space.frozen_normal(k, ball, j, scene, starts)
            if nx * vx + ny * vy > 0.0:
                return True
    return False


@entry_point
def _is_ahead(kernels, begin, end, scene, starts):
    """Returns whether the cue ball moves towards a ball that it touches in any of the shots."""
    arrays, starts = scene_of(kernels, scene, 0), Starts(*starts)
    is_ahead = False
    for k in range(begin, end):
        is_ahead = is_ahead or _drives(k, starts.cue[k], arrays, starts)
    return is_ahead


@inlined
def _spin_energy(i, unit, state, scene):
    """Returns twice the energy of ball i's spin over its mass and unit^2, for a speed `unit`, m/s."""
    s = state.rows[i]
    level = norm(s[UX] - s[VX], s[UY] - s[VY])
    size = norm(level, scene.radius[i] * s[WZ]) / unit
    return 0.4 * size * size


@inlined
def _gather(k, scene, starts, state, contacts):  # out: contacts
    """Lists all pairs of balls that touch. Returns their number."""
    count, n = 0, len(scene.radius)
    for i in range(n):
        for j in range(i + 1, n):
            nx, ny = scene.space.frozen_normal(k, i, j, scene, starts)
            if nx == 0.0 and ny == 0.0:
                continue
            a, b = state.rows[i], state.rows[j]
            closing = max(0.0, nx * (a[VX] - b[VX]) + ny * (a[VY] - b[VY]))
            contacts.first[count], contacts.second[count] = i, j
            set_normal(contacts, count, (nx, ny, 0.0))
            contacts.closing[count], contacts.rebound[count] = closing, -closing
            count += 1
    return count


@entry_point
def _drive(kernels, begin, end, ball, cue, scene, starts):  # out: starts
    """Replaces the starts of the shots in which the cue drives frozen balls, whose restitution is -`LEFT`."""
    end_call(_drive_balls(kernels, begin, end, ball, cue, scene, starts))


@allocating
def _drive_balls(kernels, begin, end, ball, cue, scene, starts):  # out: starts
    """Replaces the starts, see `_drive`. Returns whether it was interrupted."""
    cue, starts, arrays = CueNumbers(*cue), Starts(*starts), scene_of(kernels, scene, 0)
    n = len(arrays.radius)
    most = n * (n - 1) // 2
    axes = arrays.space.axes()
    state, contacts = empty_state(n, axes), empty_contacts(most, axes)
    scratch = empty_scratch(n, most, arrays.laws.friction, axes)
    for k in range(begin, end):
        if interrupted():
            return True
        arrays = scene_of(kernels, scene, k)
        if starts.cue[k] != ball or not _drives(k, ball, arrays, starts):
            continue
        load_balls(k, starts, arrays, state)
        speed, mass = norm(state.rows[ball, VX], state.rows[ball, VY]), arrays.inv_mass[ball]
        spin = _spin_energy(ball, speed, state, arrays)
        if spin > 1e100:  # hardly moving, so the impulse does not change; larger numbers could overflow
            continue
        exchange(-LEFT, _gather(k, arrays, starts, state, contacts), contacts, state, arrays, scratch)
        share = 0.0  # of the energy of the free ball
        for i in range(n):
            if arrays.inv_mass[i] > 0.0:
                moved = norm(state.rows[i, VX], state.rows[i, VY]) / speed
                energy = (moved * moved + _spin_energy(i, speed, state, arrays)) * (mass / arrays.inv_mass[i])
                share += (energy / (1.0 + spin) + 6.0) - 6.0  # multiples of 2^-50 have the same sum in any order
        push = max(share * (1.0 + spin) - spin, 0.0)
        factor = impulse_gain(cue, spin, push) / impulse_gain(cue, spin, 1.0)
        for i in range(n):
            for axis in range(axes_of(state)):
                state.rows[i, VELOCITY[axis]] *= factor
            for c in (UX, UY, WZ):
                state.rows[i, c] *= factor
        store(k, starts, arrays, state)
    return False
