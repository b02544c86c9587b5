"""The kernels that depend on where balls move: on the cloth, or in space if they fly.

`Space` describes the kernels. `on_cloth` and `pit_on_cloth` contain those of balls on the cloth. `in_space` and
`pit_in_space` contain those that differ if balls fly, with the same names. The engines and the impacts call the kernels
through `scene.space`, so their own code is the same for all scenes. A scene has one `Space`, and numba compiles only
the kernels of this `Space`.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any, NamedTuple

from billiards_env.engine import in_space, on_cloth, pit_in_space, pit_on_cloth, unequal_spheres
from billiards_env.scene import Scene


class Space(NamedTuple):
    """The kernels of the balls of a scene.

    A normal is a unit vector from ball i to ball j, with as many components as there are axes. The argument p
    of `slip` and `push` is an impulse along the normal. If there are two axes, p is its horizontal part, because
    the table takes up the vertical part. Names: `scene` is the `SceneArrays`, `state` the `State`, `row` a row
    of it, `now` a `Time`, k a shot, c a contact of `contacts`, `work` the workspace of the engine,
    `fix` the `overlaps.FixKernels` of PIT.

    Attributes:
        axes: (). Returns the number of components of a velocity, 2 or 3.
        load: (k, i, shots, row). Copies the velocity of ball i, and with three axes its height, from the start of a
            shot to its row.
        store: (k, i, row, shots). Copies them from the row to the end of the shot.
        begin_phase: (state, i, numbers). Begins the next phase of ball i, see `motion.begin_phase`.
        advance: (state, i, time, numbers). Advances the row of ball i to a `Time` within its phase.

        event_alone: (i, state, scene). Returns the next event of ball i alone: the time, s after the ball's own, the
            kind, and the cushion, the pocket or -1.
        resolve_single: (i, now, k, scene, work, shots, log). Resolves and records the event of `event_alone`. Returns
            the number of events; a corner counts as two.

        contact_distance: (i, j, scene). Returns the horizontal distance at which two balls on the cloth touch, m.
        meeting_time: (i, j, now, path, end, noise, state, scene). Returns when two balls touch after `now`, see
            `contact.circle_time`.
        approach: (i, j, now, state, scene). Returns the gap between two balls, m, the normal and the speed of approach,
            m/s.
        frozen_normal: (k, i, j, scene, starts). Returns the normal (x, y) of two balls on the cloth that touch at the
            start of a shot; zeros if they do not touch.

        tilt: (i, j, scene). Returns the cosine and the sine of the inclination of the normal of two balls on the cloth;
            None in scenes without flight in which all normals are horizontal.
        frame: (c, contacts, scene). Returns the `friction.Frame` of a contact.
        slip: (c, p, contacts, state, scene). Returns the slip across and up at a contact, m/s, and the impulse along
            the normal, kg m/s, for an impulse p.
        push: (contacts, p, state, scene). Changes the motion of the balls of the first contact by an impulse p and its
            friction.
        exchange: (e, count, contacts, state, scene, scratch). Resolves impacts, see `ball_ball.exchange`.

        limits: (c, contacts, state, numbers). Returns the `contact_rule.Limits` of a contact.
        pressing: (c, contacts, state, scene). Returns the speed of approach at a contact, m/s, and the acceleration of
            the balls towards each other, m/s^2.
        stop: (over, count, contacts, state, scene, memory). Ends a sequence of impacts: brings the balls to rest if the
            sequence is `over`, or resolves a jam. Returns whether it has ended one.

        follow: (i, t, numbers, work). PIT: computes the motion of ball i in `here`, t seconds after its own time.
        predict_phase_end: (i, work). PIT: computes the time at which the phase of ball i ends between timesteps.
        test_pockets: (i, now, k, fix, scene, work, shots, log). PIT: resolves an event of ball i alone since the
            last timestep, except at cushions. Returns whether there was one.
        overlap: (i, j, here, scene). PIT: returns the normal of two balls and the speed of approach, m/s, which is
            negative if they separate or do not overlap.
        depth: (i, j, here, scene). PIT: returns the depth of the overlap of two balls, m.
        shift: (i, way, work). PIT: moves ball i by a vector, m.
        resolve_overlaps: (count, now, k, fix, scene, work, shots, log). PIT: resolves and records the impacts of the
            first `count` contacts. Returns the number of impacts.
        hit_cushions: (i, now, k, fix, scene, work, shots, log). PIT: reflects ball i at the cushions that it overlaps.
            Returns whether it overlaps one.
    """

    axes: Any
    load: Any
    store: Any
    begin_phase: Any
    advance: Any
    event_alone: Any
    resolve_single: Any
    contact_distance: Any
    meeting_time: Any
    approach: Any
    frozen_normal: Any
    tilt: Any
    frame: Any
    slip: Any
    push: Any
    exchange: Any
    limits: Any
    pressing: Any
    stop: Any
    follow: Any
    predict_phase_end: Any
    test_pockets: Any
    overlap: Any
    depth: Any
    shift: Any
    resolve_overlaps: Any
    hit_cushions: Any


def _space_of(*modules: ModuleType) -> Space:
    """Returns a `Space`, each kernel of which is from the first of some modules that has it."""
    kernels = {name: kernel for module in reversed(modules) for name, kernel in vars(module).items()}
    return Space(*(kernels[name] for name in Space._fields))


ON_CLOTH = _space_of(on_cloth, pit_on_cloth)
UNEQUAL_SPHERES = _space_of(unequal_spheres, on_cloth, pit_on_cloth)
IN_SPACE = _space_of(in_space, pit_in_space, unequal_spheres, on_cloth, pit_on_cloth)


def space_of(scene: Scene) -> Space:
    """Returns the `Space` of a scene."""
    if scene.physics.flight:
        return IN_SPACE
    balls = scene.balls
    return UNEQUAL_SPHERES if balls.shape == "sphere" and len(set(balls.radius)) > 1 else ON_CLOTH
