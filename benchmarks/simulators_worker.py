"""Runs shots with pooltool, pymunk or MuJoCo. `benchmarks.simulators` starts this file in their environment.

The first line of the input is JSON: the name of an entry of `SIMULATORS` and its arguments. The answer is a line about
the simulator. Each further line has shots as JSON, and the answer is a line with their results.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

DECAY, TIME = math.log(2.0), 6.0  # 1/s: half of the speed is lost in a second, `space.damping = 0.5`; s
SLOTS = 128
PIXELS = 500.0
"""The number of pixels per metre for pymunk, whose default slop of 0.1 is in pixels."""

MAX_EVENTS = 2000
"""Events after which pooltool stops a shot. In some breaks the same pair of balls collides again and again."""

SLOP = 1e-4
"""m, the overlap that pymunk tolerates in `in_metres`; the default of 0.1 is meant for pixels, and exceeds a ball."""

WALL = 1.0
"""m, thickness of the walls in `in_metres`, so that no disk passes through one."""


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
    from pooltool.physics.resolve.ball_ball.frictionless_elastic import (  # pyright: ignore[reportMissingImports]
        FrictionlessElastic,
    )
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
        return {
            "seconds": seconds,
            "finished": finished,
            "positions": [[y - half_x, half_y - x] for x, y, _ in places],
        }

    return pt.__version__, run


def nose_height(height: float, radius: float) -> float:
    """Returns the height of pooltool's nose, m, at which its contacts with straight cushions have the same normal.

    In pooltool the nose is at the horizontal distance R from the centre of a ball, at the height h, so the tangent of
    the angle of the normal is h/R - 1. In billiards-env h/R - 1 is its sine.
    """
    sine = height / radius - 1.0
    return radius * (1.0 + sine / (1.0 - sine * sine) ** 0.5)


def add_table(space: Any, left: float, half: tuple[float, float], wall: float, elasticity: tuple[float, float]) -> Any:
    """Adds the cushions of a table to a space of pymunk, and returns a function that adds a ball.

    Args:
        space: The space.
        left: x of the middle of the table.
        half: Half its length and half its width.
        wall: Half the thickness of a cushion.
        elasticity: The elasticity of the cushions and of the balls.
    """
    import pymunk  # pyright: ignore[reportMissingImports]

    x, y = half[0] + wall, half[1] + wall
    for ends in pairwise([(left - x, -y), (left + x, -y), (left + x, y), (left - x, y), (left - x, -y)]):
        cushion = pymunk.Segment(space.static_body, *ends, wall)
        cushion.elasticity = elasticity[0]
        space.add(cushion)

    def add_ball(radius: float, mass: float, moment: float = math.inf, place: Any = (0.0, 0.0)) -> Any:
        """Adds a ball without friction and returns its body."""
        body = pymunk.Body(mass, moment)
        body.position = tuple(place)
        shape = pymunk.Circle(body, radius)
        shape.elasticity = elasticity[1]
        space.add(body, shape)
        return body

    return add_ball


def in_metres(steps: int) -> tuple[str, Callable[[dict[str, Any]], Any]]:
    """Returns the version of pymunk, and a function that runs a shot, see `benchmarks.simulators.runner`.

    It makes a number of timesteps per second. Elasticity 1, no friction, no damping.
    """
    import pymunk  # pyright: ignore[reportMissingImports]

    def run(shot: dict[str, Any]) -> dict[str, Any]:
        table, balls, physics = (shot["scene"][part] for part in ("table", "balls", "physics"))
        space = pymunk.Space()
        space.collision_slop = SLOP
        add_ball = add_table(space, 0.0, (table["length"] / 2, table["width"] / 2), WALL, (1.0, 1.0))
        bodies = []
        for place, radius, mass in zip(shot["positions"], balls["radius"], balls["mass"], strict=True):
            bodies.append(add_ball(radius, mass, pymunk.moment_for_circle(mass, 0.0, radius), place))
        bodies[0].velocity = tuple(shot["velocity"])
        begin = perf_counter()
        for _ in range(round((physics["max_time"] if shot["time"] is None else shot["time"]) * steps)):
            space.step(1 / steps)
        seconds = perf_counter() - begin
        return {"seconds": seconds, "finished": True, "positions": [list(body.position) for body in bodies]}

    return pymunk.version, run


def in_pymunk(dt: float, scene: Any) -> tuple[Any, Any, bool]:
    """Returns the functions of `pots` for tables in a row.

    All settings are defaults: 10 iterations, a slop of 0.1 pixels, a step for each timestep.
    """
    import pymunk  # pyright: ignore[reportMissingImports]
    from pymunk import batch  # pyright: ignore[reportMissingImports]

    space, buffer = pymunk.Space(), batch.Buffer()
    space.damping = math.exp(-DECAY)
    elasticity = math.sqrt(scene["physics"]["e_ball"])
    bounces = scene["physics"]["e_cushion"] / elasticity, elasticity
    half = 0.5 * PIXELS * scene["table"]["length"], 0.5 * PIXELS * scene["table"]["width"]
    origins, bodies = 4.0 * np.arange(SLOTS), []
    for left in PIXELS * origins:
        add_ball = add_table(space, left, half, 0.1 * PIXELS, bounces)
        bodies += [add_ball(PIXELS * radius, 1.0) for radius in scene["balls"]["radius"]]

    def place(k: int, positions: Any, velocity: complex) -> None:
        for body, at, speed in zip(bodies[2 * k : 2 * k + 2], positions + origins[k], (velocity, 0j), strict=True):
            body.position = PIXELS * at.real, PIXELS * at.imag
            body.velocity = PIXELS * speed.real, PIXELS * speed.imag
            pymunk.Body.update_position(body, 0.0)  # removes the push out of the last overlap

    def step() -> tuple[Any, Any]:
        space.step(dt)
        buffer.clear()
        batch.get_space_bodies(space, batch.BodyFields.POSITION | batch.BodyFields.VELOCITY, buffer)
        states = np.frombuffer(buffer.float_buf())[: 8 * SLOTS].view(complex).reshape(SLOTS, 2, 2) / PIXELS
        return states[..., 0] - origins[:, None], states[..., 1]

    return place, step, True


def in_mujoco(dt: float, scene: Any) -> tuple[Any, Any, bool]:
    """Returns the functions of `pots` for spheres on slides in x and y, without friction.

    All tables are in one place; the listed pairs touch. All numbers of the contacts are defaults: `solref` is 0.02 s
    and a damping ratio of 1, so contacts are soft, and the restitution is about exp(-2).
    """
    import mujoco  # pyright: ignore[reportMissingImports]

    x, y, mass = 0.5 * scene["table"]["length"], 0.5 * scene["table"]["width"], 0.17
    cushions = {"left": (-x, 0, "1 0 0"), "right": (x, 0, "-1 0 0"), "low": (0, -y, "0 1 0"), "high": (0, y, "0 -1 0")}
    geoms, pairs = "", ""
    for name, (at_x, at_y, normal) in cushions.items():
        geoms += f'<geom name="{name}" type="plane" size="1 1 1" pos="{at_x} {at_y} 0" zaxis="{normal}"/>'
    for k in range(2 * SLOTS):
        geom = f'<geom name="{k}" size="{scene["balls"]["radius"][0]}" mass="{mass}"/>'
        geoms += f'<body><joint axis="1 0 0"/><joint axis="0 1 0"/>{geom}</body>'
        for other in (*cushions, *[k - 1] * (k % 2)):
            pairs += f'<pair geom1="{other}" geom2="{k}" condim="1"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{dt}" gravity="0 0 0"/><size memory="200M"/><default>'
        f'<geom contype="0" conaffinity="0"/><joint type="slide" damping="{DECAY * mass}"/></default>'
        f"<worldbody>{geoms}</worldbody><contact>{pairs}</contact></mujoco>"
    )
    data = mujoco.MjData(model)
    positions, velocities = (numbers.view(complex).reshape(SLOTS, 2) for numbers in (data.qpos, data.qvel))

    def place(k: int, start: Any, velocity: complex) -> None:
        positions[k], velocities[k] = start, (velocity, 0.0)

    def step() -> tuple[Any, Any]:
        mujoco.mj_step(model, data)
        return positions.copy(), velocities.copy()

    return place, step, False


def delays(dt: float, scene: Any, place: Any, step: Any, at_end: bool) -> Any:
    """Returns the mean times, s, by which the momentum passes later than at the touch, in head-on hits at 1 m/s.

    The touches of the tables are at evenly distributed parts of a timestep.
    """
    phase = (np.arange(SLOTS) + 0.5) / SLOTS * dt
    for k in range(SLOTS):
        place(k, np.array([-2.0 * scene["balls"]["radius"][0] - phase[k], 0j]), 1.0)
    speeds = [step()[1][:, 1].real for _ in range(math.ceil(0.1 / dt))]
    passed = np.maximum(np.diff(speeds, axis=0, prepend=0.0), 0.0)
    times = dt * (np.arange(len(passed)) + at_end)[:, None] - phase
    return (passed * times).sum(0) / passed.sum(0)


def play_shots(dt: float, scene: Any, place: Any, step: Any, positions: Any, velocities: Any) -> Any:
    """Plays shots (m, 2) m and (m,) m/s, and returns the pocket into which each object ball drops, or -1.

    A shot runs until the object ball, or before the hit the cue ball, is in a pocket or touches a cushion, until no
    ball can reach another one or a pocket, or until `TIME`. A ball is in a pocket if its centre is in the circle at the
    end of a timestep.
    """
    table, diameter = scene["table"], 2.0 * scene["balls"]["radius"][0]
    pockets = np.array([complex(pocket["x"], pocket["y"]) for pocket in table["pockets"]])
    radii = np.array([pocket["radius"] for pocket in table["pockets"]])
    dropped, begun = np.full(len(positions), -1), 0
    shot, age = np.full(SLOTS, -1), np.zeros(SLOTS)  # by table: the number of its shot, or -1; s
    while True:
        for k in np.flatnonzero(shot < 0)[: len(positions) - begun]:
            place(k, positions[begun], velocities[begun])
            shot[k], age[k] = begun, 0.0
            begun += 1
        if (shot < 0).all():
            return dropped
        x, v = step()
        age += dt
        gaps = abs(x[..., None] - pockets) - radii
        gap, paths = gaps.min(2), abs(v) / DECAY
        ends = (2.0 * abs(x.real) > table["length"] - diameter) | (2.0 * abs(x.imag) > table["width"] - diameter)
        ends |= gap < 0.0
        still = (paths.sum(1) < abs(x[:, 1] - x[:, 0]) - diameter) & (paths[:, 1] < gap[:, 1])
        potted = (shot >= 0) & (gap[:, 1] < 0.0)
        dropped[shot[potted]] = gaps[potted, 1].argmin(1)
        shot[ends[:, 1] | (ends[:, 0] & (v[:, 1] == 0.0)) | still | (age >= TIME)] = -1


def pots(simulator: str, dt: float, scene: Any) -> tuple[list[float], Callable[[Any], Any]]:
    """Returns the output of `delays`, and a function that plays shots, see `play_shots`.

    `SLOTS` tables with two balls each are in one simulation. Positions and velocities are complex numbers. The function
    of a simulator returns `place(k, positions, velocity)`, which places the balls of table k with a velocity of the cue
    ball; `step()`, which advances all tables by a timestep and returns the positions and velocities of their balls,
    (tables, 2); and whether the forces of a timestep follow from the positions at its end, or from those at its start.

    Args:
        simulator: "pymunk" or "mujoco".
        dt: The timestep, s.
        scene: `Scene.to_dict`.
    """
    place, step, at_end = {"pymunk": in_pymunk, "mujoco": in_mujoco}[simulator](dt, scene)

    def play(shots: Any) -> list[int]:
        """Plays positions (m, 2, 2) m and velocities (m, 2) m/s."""
        positions, velocities = (np.array(numbers) @ (1, 1j) for numbers in shots)
        return play_shots(dt, scene, place, step, positions, velocities).tolist()

    return delays(dt, scene, place, step, at_end).tolist(), play


SIMULATORS: dict[str, Callable[..., tuple[Any, Callable[[Any], Any]]]] = {
    "pooltool": in_pooltool,
    "pymunk": in_metres,
    "pots": pots,
}
"""Functions that return the first answer and the function that answers the other lines."""


def main() -> None:
    """Answers the lines of the input."""
    replies, sys.stdout = sys.stdout, sys.stderr  # so that messages of the simulators are not replies
    name, *arguments = json.loads(sys.stdin.readline())
    first, answer = SIMULATORS[name](*arguments)
    print(json.dumps(first), file=replies, flush=True)
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), file=replies, flush=True)


if __name__ == "__main__":
    main()
