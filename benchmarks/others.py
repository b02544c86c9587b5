"""The elastic, frictionless disks of an "ideal" scene in the simulators that people use today.

Each function sets up one shot and gives back a function of a time in s that goes on to that time and gives the disks'
positions, (n, 2) m. What it does until then is all that is timed. Settings are what the libraries' manuals advise for
such a scene; what is not named here is left at its default.
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
"""What is imported for each simulator."""

PYMUNK_SLOP = 1e-4
"""m, the overlap that pymunk tolerates; its default of 0.1 is meant for pixels and wider than a ball."""

BOX2D_TIME = 1e3
"""s, the unit of time in Box2D, which takes impacts slower than a unit of length per unit of time as inelastic: with
this one, those below 0.1 mm/s."""

BOX2D_ITERATIONS = 8, 3
"""For velocities and positions, as its manual advises."""

_WALL = 1.0  # m, thickness of pymunk's walls, so that no disk passes through one


def available() -> list[str]:
    """The simulators that are installed (by `pip install '.[bench]'`)."""
    return [name for name, module in MODULES.items() if importlib.util.find_spec(module)]


def pymunk(scene: Scene, positions: Floats, velocities: Floats, dt: float) -> GoTo:
    """pymunk (Chipmunk): fixed timestep, double precision, elasticity 1, friction 0, no damping."""
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
    """Box2D: fixed timestep with continuous collision detection (bullets), single precision, restitution 1.

    It lets no body go farther than 2 units of length in a step and tolerates 0.005 units of overlap. So the unit is the
    smallest, 0.1 m at most, in which a disk twice as fast as the fastest at the start is not held back.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of SWIG's types, at the first import
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
                density=1.0,  # all disks of an ideal scene are alike
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
    """python-billiards: event-driven, in Python and numpy."""
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
    """Whether a simulator advances by a timestep."""
    return name != "python-billiards"


def prepare(name: str, scene: Scene, positions: Floats, velocities: Floats, dt: float | None) -> GoTo:
    """Sets up a shot in the simulator of that name; dt in s, None for one that has no timestep."""
    if dt is None:
        return billiards(scene, positions, velocities)
    return (pymunk if name == "pymunk" else box2d)(scene, positions, velocities, dt)


def versions() -> dict[str, str]:
    """Of the simulators that are installed."""
    packages = {"pymunk": "pymunk", "Box2D": "Box2D", "python-billiards": "billiards"}
    return {name: importlib.metadata.version(packages[name]) for name in available()}
