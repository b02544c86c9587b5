"""Plays shots in pymunk or MuJoCo. `studies.other_simulators` starts this file in an environment with both packages.

Each line of the input is JSON. The first one has the name of the simulator, dt, s, and the scene (`Scene.to_dict`), and
the answer is the output of `delays`. Each further line has positions (m, 2, 2) m and velocities of the cue ball (m, 2)
m/s, and the answer is the output of `play_shots`.

`SLOTS` tables with two balls each are in one simulation. Positions and velocities are complex numbers. The function of
a simulator returns `place(k, positions, velocity)`, which places the balls of table k with a velocity of the cue ball;
`step()`, which advances all tables by a timestep and returns the positions and velocities of their balls, (tables, 2);
and whether the forces of a timestep follow from the positions at its end, or from those at its start.
"""

from __future__ import annotations

import json
import math
import sys
from itertools import pairwise
from typing import Any

import numpy as np

DECAY, TIME = math.log(2.0), 6.0  # 1/s: half of the speed is lost in a second, `space.damping = 0.5`; s
SLOTS = 128
PIXELS = 500.0
"""The number of pixels per metre for pymunk, whose default slop of 0.1 is in pixels."""


def in_pymunk(dt: float, scene: Any) -> tuple[Any, Any, bool]:
    """Tables in a row. All settings are defaults: 10 iterations, a slop of 0.1 pixels, a step for each timestep."""
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
    """Spheres on slides in x and y, contacts without friction. All tables are in one place; the listed pairs touch.

    All numbers of the contacts are defaults. `solref` is 0.02 s and a damping ratio of 1: contacts are soft, and the
    restitution is about exp(-2).
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


def main() -> None:
    """Answers the lines of the input."""
    simulator, dt, scene = json.loads(sys.stdin.readline())
    place, step, at_end = {"pymunk": in_pymunk, "mujoco": in_mujoco}[simulator](dt, scene)
    print(json.dumps(delays(dt, scene, place, step, at_end).tolist()), flush=True)
    for line in sys.stdin:
        positions, velocities = (np.array(numbers) @ (1, 1j) for numbers in json.loads(line))
        print(json.dumps(play_shots(dt, scene, place, step, positions, velocities).tolist()), flush=True)


if __name__ == "__main__":
    main()
