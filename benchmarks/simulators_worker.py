"""Runs shots with pooltool or pymunk. `benchmarks.simulators` starts this file in their environment.

The first line of the input is JSON: the name of an entry of `SIMULATORS` and its argument. The answer is the version of
the simulator. Each further line is a shot as JSON, and the answer is its result.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

MAX_EVENTS = 2000
"""Events after which pooltool stops a shot. In some breaks the same pair of balls collides again and again."""

SLOP = 1e-4
"""m, the overlap that pymunk tolerates; the default of 0.1 is meant for pixels, and exceeds a ball."""

WALL = 1.0
"""m, half the thickness of the walls in pymunk, so that no disk passes through one."""


def in_pooltool(gap: float) -> tuple[str, Callable[[dict[str, Any]], Any]]:
    """Returns the version of pooltool, and a function that runs a shot, see `benchmarks.simulators.runner`.

    pooltool moves balls to the distance `gap`, m, at a contact. A scene with an outline is pooltool's own table with
    jaws, pockets and its own laws. Another scene is a table without pockets, with balls without friction between them
    and the cushions of Han (2005).
    """
    import attrs  # pyright: ignore[reportMissingImports]
    import pooltool as pt  # pyright: ignore[reportMissingImports]
    from pooltool.evolution.continuous import interpolate_ball_states  # pyright: ignore[reportMissingImports]
    from pooltool.objects import BilliardTableSpecs, PocketTableSpecs  # pyright: ignore[reportMissingImports]
    from pooltool.physics.engine import PhysicsEngine  # pyright: ignore[reportMissingImports]
    from pooltool.physics.resolve.ball_ball.frictionless_elastic import FrictionlessElastic  # pyright: ignore[reportMissingImports]
    from pooltool.physics.resolve.ball_cushion.han_2005 import Han2005Linear  # pyright: ignore[reportMissingImports]
    from pooltool.physics.resolve.resolver import default_resolver  # pyright: ignore[reportMissingImports]

    smooth = attrs.evolve(default_resolver(), ball_ball=FrictionlessElastic(), ball_linear_cushion=Han2005Linear())
    engines = {True: (PocketTableSpecs, PhysicsEngine()), False: (BilliardTableSpecs, PhysicsEngine(smooth))}
    pt.constants.MIN_DIST = gap

    def run(shot: dict[str, Any]) -> dict[str, Any]:
        sides, physics, radius = shot["scene"]["table"], shot["scene"]["physics"], shot["scene"]["balls"]["radius"][0]
        specs, engine = engines[bool(sides["outline"])]
        height = nose_height(sides["cushion_height"], radius) if sides["outline"] else sides["cushion_height"]
        table = pt.Table.from_table_specs(specs(l=sides["length"], w=sides["width"], cushion_height=height))
        params = pt.BallParams(
            m=shot["scene"]["balls"]["mass"][0],
            R=radius,
            u_s=physics["mu_slide"],
            u_r=physics["mu_roll"],
            u_sp_proportionality=2 * physics["spin_decay"] / (5 * physics["g"]),
            e_b=physics["e_ball"],
            e_c=physics["e_cushion"],
            f_c=physics["mu_cushion"],
            g=physics["g"],
        )
        half_x, half_y = sides["length"] / 2, sides["width"] / 2  # the origin of pooltool is a corner; y is our x
        balls = {}
        for i, (x, y) in enumerate(shot["positions"]):
            ball = pt.Ball(str(i), params=params)
            ball.state.rvw = np.array([[half_y - y, half_x + x, radius], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
            balls[ball.id] = ball
        balls["0"].state.rvw[1, :2] = -shot["velocity"][1], shot["velocity"][0]
        balls["0"].state.s = pt.constants.sliding
        system = pt.System(cue=pt.Cue(cue_ball_id="0"), table=table, balls=balls)
        begin = perf_counter()
        pt.simulate(system, engine=engine, inplace=True, max_events=MAX_EVENTS)
        seconds = perf_counter() - begin
        finished, time = len(system.events) <= MAX_EVENTS, shot["time"]
        if not finished and (time is None or time > system.t):
            return {"seconds": seconds, "finished": False, "positions": None}
        time = system.t if time is None else min(time, system.t)
        places = [interpolate_ball_states(ball, [time])[0].rvw[0].tolist() for ball in balls.values()]
        return {"seconds": seconds, "finished": finished, "positions": [[y - half_x, half_y - x] for x, y, _ in places]}

    return pt.__version__, run


def nose_height(height: float, radius: float) -> float:
    """Returns the height of pooltool's nose, m, at which its contacts with straight cushions have the same normal.

    In pooltool the nose is at the horizontal distance R from the centre of a ball, at the height h, so the tangent of
    the angle of the normal is h/R - 1. In billiards-env h/R - 1 is its sine.
    """
    sine = height / radius - 1.0
    return radius * (1.0 + sine / (1.0 - sine * sine) ** 0.5)


def in_pymunk(steps: int) -> tuple[str, Callable[[dict[str, Any]], Any]]:
    """Returns the version of pymunk, and a function that runs a shot, see `benchmarks.simulators.runner`.

    It makes a number of timesteps per second. Elasticity 1, no friction, no damping.
    """
    import pymunk  # pyright: ignore[reportMissingImports]

    def run(shot: dict[str, Any]) -> dict[str, Any]:
        table, balls, physics = (shot["scene"][part] for part in ("table", "balls", "physics"))
        space, bodies = pymunk.Space(), []
        space.collision_slop = SLOP
        x, y = table["length"] / 2 + WALL, table["width"] / 2 + WALL
        shapes: list[Any] = [
            pymunk.Segment(space.static_body, *ends, WALL)
            for ends in pairwise([(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)])
        ]
        for place, radius, mass in zip(shot["positions"], balls["radius"], balls["mass"], strict=True):
            bodies.append(pymunk.Body(mass, pymunk.moment_for_circle(mass, 0.0, radius)))
            bodies[-1].position = tuple(place)
            shapes.append(pymunk.Circle(bodies[-1], radius))
        for shape in shapes:
            shape.elasticity = 1.0
        space.add(*bodies, *shapes)
        bodies[0].velocity = tuple(shot["velocity"])
        begin = perf_counter()
        for _ in range(round((physics["max_time"] if shot["time"] is None else shot["time"]) * steps)):
            space.step(1 / steps)
        seconds = perf_counter() - begin
        return {"seconds": seconds, "finished": True, "positions": [list(body.position) for body in bodies]}

    return pymunk.version, run


SIMULATORS: dict[str, Callable[[Any], tuple[str, Callable[[dict[str, Any]], Any]]]] = {
    "pooltool": in_pooltool,
    "pymunk": in_pymunk,
}
"""Functions of a number that return the version of a simulator and the function that runs a shot in it."""


def main() -> None:
    """Answers the lines of the input."""
    replies, sys.stdout = sys.stdout, sys.stderr  # so that messages of the simulators are not replies
    name, argument = json.loads(sys.stdin.readline())
    version, answer = SIMULATORS[name](argument)
    print(json.dumps(version), file=replies, flush=True)
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), file=replies, flush=True)


if __name__ == "__main__":
    main()
