"""The elastic, frictionless disks of an "ideal" scene in other simulators.

Each function sets up one shot and returns a function of a time, s. That function advances the shot to this time and
returns the positions of the disks, (n, 2) m. Only these calls are timed. The settings follow the manuals of the
libraries; all other settings have their default values.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import warnings
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from billiards_env.scene import Scene

Floats = NDArray[np.float64]
GoTo: TypeAlias = Callable[[float], Floats]

MODULES = {"pymunk": "pymunk", "Box2D": "Box2D", "python-billiards": "billiards"}
"""The module of each simulator."""

PYMUNK_SLOP = 1e-4
"""m, the overlap that pymunk tolerates; the default of 0.1 is meant for pixels and is larger than a ball."""

BOX2D_TIME = 1e3
"""s, the unit of time in Box2D. Box2D treats impacts slower than one unit of length per unit of time as inelastic; with
this unit these are impacts below 0.1 mm/s."""

BOX2D_ITERATIONS = 8, 3
"""Iterations for velocities and for positions, as in the manual."""

_WALL = 1.0  # m, thickness of pymunk's walls, so that no disk passes through one


def available() -> list[str]:
    """Returns the names of the installed simulators (`pip install '.[bench]'`)."""
    return [name for name, module in MODULES.items() if importlib.util.find_spec(module)]


def pymunk(scene: Scene, positions: Floats, velocities: Floats, dt: float) -> GoTo:
    """Sets up pymunk (Chipmunk): fixed timestep, double precision, elasticity 1, friction 0, no damping."""
    import pymunk as library  # pyright: ignore[reportMissingImports]

    space = library.Space()
    space.collision_slop = PYMUNK_SLOP
    half_x, half_y = scene.table.length / 2 + _WALL, scene.table.width / 2 + _WALL
    corners = [(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)]
    for k in range(4):
        a, b = corners[k], corners[(k + 1) % 4]
        wall = library.Segment(space.static_body, a, b, _WALL)
        wall.elasticity, wall.friction = 1.0, 0.0
        space.add(wall)
    bodies = []
    for i, (place, velocity) in enumerate(zip(positions, velocities, strict=True)):
        radius, mass = scene.balls.radius[i], scene.balls.mass[i]
        body = library.Body(mass, library.moment_for_circle(mass, 0.0, radius))
        body.position, body.velocity = tuple(place), tuple(velocity)
        shape = library.Circle(body, radius)
        shape.elasticity, shape.friction = 1.0, 0.0
        space.add(body, shape)
        bodies.append(body)
    steps = 0

    def go_to(t: float) -> Floats:
        nonlocal steps
        for _ in range(round(t / dt) - steps):
            space.step(dt)
        steps = round(t / dt)
        return np.array([tuple(body.position) for body in bodies])

    return go_to


def box2d(scene: Scene, positions: Floats, velocities: Floats, dt: float) -> GoTo:
    """Sets up Box2D: fixed timestep, continuous collision detection (bullets), single precision, restitution 1.

    Box2D limits the motion of a body in a timestep to 2 units of length and tolerates an overlap of 0.005 units. The
    unit is therefore the smallest one, at most 0.1 m, that does not slow down a disk with twice the largest initial
    speed.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # from SWIG's types at the first import
        import Box2D as library  # pyright: ignore[reportMissingImports]

    world = library.b2World(gravity=(0, 0), doSleep=False, continuousPhysics=True)
    unit = min(0.1, dt * float(np.hypot(*velocities.T).max()))  # m
    half_x, half_y = scene.table.length / 2 / unit, scene.table.width / 2 / unit
    corners = [(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)]
    for k in range(4):
        edge = library.b2EdgeShape(vertices=[corners[k], corners[(k + 1) % 4]])
        world.CreateStaticBody(fixtures=library.b2FixtureDef(shape=edge, restitution=1.0, friction=0.0))
    bodies = []
    for i, (place, velocity) in enumerate(zip(positions.tolist(), velocities.tolist(), strict=True)):
        body = world.CreateDynamicBody(
            position=[x / unit for x in place],
            linearVelocity=[v / unit * BOX2D_TIME for v in velocity],
            bullet=True,
            fixedRotation=True,
            fixtures=library.b2FixtureDef(
                shape=library.b2CircleShape(radius=scene.balls.radius[i] / unit),
                density=1.0,  # all disks of an ideal scene are equal
                restitution=1.0,
                friction=0.0,
            ),
        )
        bodies.append(body)
    steps = 0

    def go_to(t: float) -> Floats:
        nonlocal steps
        for _ in range(round(t / dt) - steps):
            world.Step(dt / BOX2D_TIME, *BOX2D_ITERATIONS)
        steps = round(t / dt)
        return np.array([tuple(body.position) for body in bodies]) * unit

    return go_to


def billiards(scene: Scene, positions: Floats, velocities: Floats) -> GoTo:
    """Sets up python-billiards: event-driven, in Python and numpy."""
    import billiards as library  # pyright: ignore[reportMissingImports]

    x, y = scene.table.length / 2, scene.table.width / 2
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    table = library.Billiard([library.InfiniteWall(corners[k], corners[(k + 1) % 4]) for k in range(4)])
    for i, (place, velocity) in enumerate(zip(positions, velocities, strict=True)):
        table.add_ball(place, velocity, scene.balls.radius[i], scene.balls.mass[i])

    def go_to(t: float) -> Floats:
        table.evolve(t)
        return table.balls_position.copy()

    return go_to


def has_timestep(name: str) -> bool:
    """Returns whether a simulator has a timestep."""
    return name != "python-billiards"


def prepare(name: str, scene: Scene, positions: Floats, velocities: Floats, dt: float | None) -> GoTo:
    """Sets up a shot in a simulator; dt is in s, None for a simulator without a timestep."""
    if dt is None:
        return billiards(scene, positions, velocities)
    return (pymunk if name == "pymunk" else box2d)(scene, positions, velocities, dt)


def versions() -> dict[str, str]:
    """Returns the versions of the installed simulators."""
    packages = {"pymunk": "pymunk", "Box2D": "Box2D", "python-billiards": "billiards"}
    return {name: importlib.metadata.version(packages[name]) for name in available()}
