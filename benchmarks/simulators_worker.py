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

SLOP = 1e-4
"""m, the overlap that pymunk tolerates in `in_metres`; the default of 0.1 is meant for pixels, and exceeds a ball."""

WALL = 1.0
"""m, thickness of the walls in `in_metres`, so that no disk passes through one."""


def in_pooltool() -> tuple[str, Callable[[dict[str, Any]], Any]]:
    """Returns the version of pooltool, and a function that runs a shot and times `pooltool.simulate`.

    The argument of the function has `jaws`, whether the table is pooltool's own with jaws, pockets and its own laws, or
    one without pockets, with balls without friction between them and the cushions of Han (2005); `table`, the arguments
    of `PocketTableSpecs` or `BilliardTableSpecs`; `ball`, the arguments of `BallParams`; `positions`, (n, 2) m;
    `velocity` of the cue ball, (2,) m/s; `time` of the returned positions, s, or None for the end; `gap`, the distance
    to which pooltool moves balls at a contact, m; and `max_events`, after which the shot stops. The frame is
    pooltool's: the origin is a corner, and y is along the length.

    The result has `seconds`, the run time; `finished`, whether all balls are at rest; and `positions`, or None if the
    shot stopped before `time`.
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

    def run(shot: dict[str, Any]) -> dict[str, Any]:
        params = pt.BallParams(**shot["ball"])
        balls = {}
        for i, (x, y) in enumerate(shot["positions"]):
            ball = pt.Ball(str(i), params=params)
            ball.state.rvw = np.array([[x, y, params.R], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
            balls[ball.id] = ball
        balls["0"].state.rvw[1, :2] = shot["velocity"]
        balls["0"].state.s = pt.constants.sliding
        specs, engine = engines[shot["jaws"]]
        table = pt.Table.from_table_specs(specs(**shot["table"]))
        system = pt.System(cue=pt.Cue(cue_ball_id="0"), table=table, balls=balls)
        pt.constants.MIN_DIST = shot["gap"]
        begin = perf_counter()
        pt.simulate(system, engine=engine, inplace=True, max_events=shot["max_events"])
        seconds = perf_counter() - begin
        finished, time = len(system.events) <= shot["max_events"], shot["time"]
        if not finished and (time is None or time > system.t):
            return {"seconds": seconds, "finished": False, "positions": None}
        time = system.t if time is None else min(time, system.t)
        states = [interpolate_ball_states(ball, [time])[0] for ball in balls.values()]
        return {"seconds": seconds, "finished": finished, "positions": [state.rvw[0, :2].tolist() for state in states]}

    return pt.__version__, run


def in_metres(steps: int) -> tuple[str, Callable[[dict[str, Any]], Any]]:
    """Returns the version of pymunk, and a function that runs a shot with a number of timesteps per second.

    Elasticity 1, friction 0, no damping. The argument of the function has `scene` (`Scene.to_dict`), `positions`,
    (n, 2) m, `velocity` of the cue ball, (2,) m/s, and the `time` of the shot, s. The result is as in `in_pooltool`.
    """
    import pymunk  # pyright: ignore[reportMissingImports]

    def run(shot: dict[str, Any]) -> dict[str, Any]:
        table, balls = shot["scene"]["table"], shot["scene"]["balls"]
        space, bodies = pymunk.Space(), []
        space.collision_slop = SLOP
        x, y = table["length"] / 2 + WALL, table["width"] / 2 + WALL
        for ends in pairwise([(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)]):
            wall = pymunk.Segment(space.static_body, *ends, WALL)
            wall.elasticity, wall.friction = 1.0, 0.0
            space.add(wall)
        for place, radius, mass in zip(shot["positions"], balls["radius"], balls["mass"], strict=True):
            body = pymunk.Body(mass, pymunk.moment_for_circle(mass, 0.0, radius))
            body.position = tuple(place)
            disk = pymunk.Circle(body, radius)
            disk.elasticity, disk.friction = 1.0, 0.0
            space.add(body, disk)
            bodies.append(body)
        bodies[0].velocity = tuple(shot["velocity"])
        begin = perf_counter()
        for _ in range(round(shot["time"] * steps)):
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
    elasticity, wall = math.sqrt(scene["physics"]["e_ball"]), 0.1 * PIXELS  # wall: the half thickness of a cushion
    x, y = 0.5 * PIXELS * scene["table"]["length"] + wall, 0.5 * PIXELS * scene["table"]["width"] + wall
    origins, bodies = 4.0 * np.arange(SLOTS), []
    for left in PIXELS * origins:
        for ends in pairwise([(left - x, -y), (left + x, -y), (left + x, y), (left - x, y), (left - x, -y)]):
            cushion = pymunk.Segment(space.static_body, *ends, wall)
            cushion.elasticity = scene["physics"]["e_cushion"] / elasticity
            space.add(cushion)
        for radius in scene["balls"]["radius"]:
            body = pymunk.Body(1.0, math.inf)
            shape = pymunk.Circle(body, PIXELS * radius)
            shape.elasticity = elasticity
            space.add(body, shape)
            bodies.append(body)

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
