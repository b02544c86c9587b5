"""Plays shots in pymunk or MuJoCo. `studies.other_simulators` starts this file in an environment with both packages.

Each line of the input is JSON. The first line has the arguments of `World`, and the answer is the output of
`World.delays`. Each further line has the arguments of `World.play`, and the answer is its output.

A shot ends when the object ball is in a pocket or touches a cushion. Before the hit it also ends when the cue ball is
in a pocket or touches a cushion. It ends at the latest when no ball can reach another ball or a pocket, or at `time`. A
ball is in a pocket if its centre is in the circle at the end of a timestep.
"""

from __future__ import annotations

import json
import math
import sys
from typing import Any

import numpy as np

PIXELS = 500.0
"""The number of pixels per metre for pymunk, whose default slop of 0.1 is in pixels."""


class World:
    """Tables with two balls each in one simulation. Balls of different tables do not touch.

    Args:
        dt: The timestep, s.
        half_extents: Half the length and half the width of the table, m.
        radius: Radius of a ball, m.
        corner: Radius of the pockets in the corners, m.
        side: Radius of the pockets in the middle of the long sides, m.
        decay: The deceleration of a ball is its speed times this number, 1/s.
        e_ball: Restitution of two balls. MuJoCo does not use it.
        e_cushion: Restitution of a ball and a cushion. MuJoCo does not use it.
        time: The longest shot, s.
        slots: The number of tables.
    """

    late: int
    """1 if the forces in a timestep depend on the positions at its end, 0 if on the positions at its start."""

    def __init__(self, **settings: Any) -> None:
        self.__dict__.update(settings)
        self.half_extents = np.array(self.half_extents)
        self.x, self.v = np.zeros((2, self.slots, 2, 2))  # m and m/s: axes of tables, balls, and coordinates
        self.build()

    dt: float
    half_extents: Any
    radius: float
    corner: float
    side: float
    decay: float
    e_ball: float
    e_cushion: float
    time: float
    slots: int

    def build(self) -> None:
        """Makes the tables and their balls."""
        raise NotImplementedError

    def place(self, tables: Any) -> None:
        """Sets the state of the balls of some tables to `x` and `v`."""
        raise NotImplementedError

    def step(self) -> None:
        """Advances all tables by a timestep, and updates `x` and `v`."""
        raise NotImplementedError

    def delays(self) -> list[float]:
        """Returns the mean delay of the momentum after the touch, s, in a head-on hit at 1 m/s on each table.

        The tables have their touches at evenly spaced instants of a timestep.
        """
        phase = (np.arange(self.slots) + 0.5) / self.slots * self.dt
        self.x[:], self.v[:] = 0.0, 0.0
        self.x[:, 0, 0], self.v[:, 0, 0] = -2.0 * self.radius - phase, 1.0
        self.place(range(self.slots))
        total, moment = np.zeros((2, self.slots))
        for k in range(math.ceil(0.1 / self.dt)):
            before = self.v[:, 1, 0].copy()
            self.step()
            passed = np.maximum(self.v[:, 1, 0] - before, 0.0)
            total += passed
            moment += passed * ((k + self.late) * self.dt - phase)
        return (moment / total).tolist()

    def play(self, positions: Any, velocities: Any) -> list[int]:
        """Plays shots from positions (m, 2, 2), m, and velocities of the cue ball (m, 2), m/s.

        Returns:
            For each shot the pocket into which the object ball drops, or -1. The pocket at (x, y) has the number
            2 (x > 0) + (y > 0) in a corner and 4 + (y > 0) in the middle of a side.
        """
        found, played, now = [-1] * len(positions), 0, 0
        shot, age = np.full(self.slots, -1), np.zeros(self.slots, int)
        nose, every = self.half_extents - self.radius, max(1, round(0.03 / self.dt))
        while True:
            if now % every == 0:
                shot[(shot >= 0) & (self.still() | (age * self.dt >= self.time))] = -1
                free = np.flatnonzero(shot < 0)[: len(positions) - played]
                shot[free] = played + np.arange(len(free))
                played += len(free)
                self.x[free], self.v[free], age[free] = positions[shot[free]], 0.0, 0
                self.v[free, 0] = velocities[shot[free]]
                self.place(free)
                if (shot < 0).all():
                    return found
            self.step()
            now, age = now + 1, age + 1
            reach = np.abs(self.x)
            ends = self.in_pocket(reach)
            potted = ends[:, 1].copy()
            ends |= (reach[..., 0] > nose[0]) | (reach[..., 1] > nose[1])
            hit = (self.v[:, 1, 0] != 0.0) | (self.v[:, 1, 1] != 0.0)
            over = (ends[:, 1] | ends[:, 0] & ~hit) & (shot >= 0)
            if over.any():
                for k in np.flatnonzero(over & potted).tolist():
                    x, y = self.x[k, 1].tolist()
                    middle = abs(x) < 0.5 * self.half_extents[0]
                    found[shot[k]] = 4 + (y > 0) if middle else 2 * (x > 0) + (y > 0)
                shot[over] = -1

    def in_pocket(self, reach: Any) -> Any:
        """Returns which balls are in a pocket; `reach` has the absolute values of their coordinates, (..., 2)."""
        ahead, across = reach[..., 0], reach[..., 1] - self.half_extents[1]
        corner, across = (ahead - self.half_extents[0]) ** 2, across * across
        return (corner + across < self.corner**2) | (ahead * ahead + across < self.side**2)

    def still(self) -> Any:
        """Returns the tables on which no ball can reach another ball, and the object ball can reach no pocket."""
        paths = np.linalg.norm(self.v, axis=2) / self.decay
        gap = np.linalg.norm(self.x[:, 1] - self.x[:, 0], axis=1) - 2.0 * self.radius
        x, y = np.abs(self.x[:, 1]).T
        length, width = self.half_extents
        pocket = np.minimum(np.hypot(x - length, y - width) - self.corner, np.hypot(x, y - width) - self.side)
        return (paths.sum(1) < gap) & (paths[:, 1] < pocket)


class Pymunk(World):
    """Disks with pymunk's defaults: 10 iterations, a slop of 0.1 pixels, and one step for each timestep."""

    late = 1

    def build(self) -> None:  # noqa: D102
        import pymunk  # pyright: ignore[reportMissingImports]
        from pymunk import batch  # pyright: ignore[reportMissingImports]

        self.space = pymunk.Space()
        self.space.damping = math.exp(-self.decay)
        ball, wall = math.sqrt(self.e_ball), 0.1 * PIXELS  # wall: the half thickness of a cushion
        side, (x, y) = math.ceil(math.sqrt(self.slots)), self.half_extents * PIXELS + wall
        self.origins = 4.0 * np.stack(np.divmod(np.arange(self.slots), side), 1)[:, None]
        self.bodies = []
        for centre in PIXELS * self.origins[:, 0]:
            ends = [tuple(centre + end) for end in ((-x, -y), (x, -y), (x, y), (-x, y))]
            for k in range(4):
                cushion = pymunk.Segment(self.space.static_body, ends[k], ends[(k + 1) % 4], wall)
                cushion.elasticity = self.e_cushion / ball
                self.space.add(cushion)
            for _ in range(2):
                body = pymunk.Body(1.0, math.inf)
                shape = pymunk.Circle(body, self.radius * PIXELS)
                shape.elasticity = ball
                self.space.add(body, shape)
                self.bodies.append(body)
        fields, buffer = batch.BodyFields.POSITION | batch.BodyFields.VELOCITY, batch.Buffer()

        def read() -> Any:
            buffer.clear()
            batch.get_space_bodies(self.space, fields, buffer)
            return np.frombuffer(buffer.float_buf())[: 8 * self.slots].reshape(-1, 2, 4) / PIXELS

        self.read = read

    def place(self, tables: Any) -> None:  # noqa: D102
        for k in tables:
            for ball in range(2):
                body = self.bodies[2 * k + ball]
                body.position = tuple(PIXELS * (self.x[k, ball] + self.origins[k, 0]))
                body.velocity = tuple(PIXELS * self.v[k, ball])

    def step(self) -> None:  # noqa: D102
        self.space.step(self.dt)
        states = self.read()
        self.x, self.v = states[..., :2] - self.origins, states[..., 2:]


class Mujoco(World):
    """Spheres on slide joints in x and y. Contacts have no friction. Their other numbers are MuJoCo's defaults.

    `solref` is 0.02 s with a damping ratio of 1, so contacts are soft, and the restitution is about exp(-2).
    """

    late = 0

    def build(self) -> None:  # noqa: D102
        import mujoco  # pyright: ignore[reportMissingImports]

        x, y = self.half_extents
        mass = 0.17
        cushions = (f"{-x} 0 0", "0 90 0"), (f"{x} 0 0", "0 -90 0"), (f"0 {-y} 0", "-90 0 0"), (f"0 {y} 0", "90 0 0")
        walls = "".join(
            f'<geom name="c{c}" type="plane" size="1 1 1" pos="{at}" euler="{turned}"/>'
            for c, (at, turned) in enumerate(cushions)
        )
        balls, pairs = "", ""
        for k in range(self.slots):  # all tables are in the same place; only the listed pairs touch
            for name in (f"cue{k}", f"ball{k}"):
                geom = f'<geom name="{name}" size="{self.radius}" mass="{mass}"/>'
                balls += f'<body><joint axis="1 0 0"/><joint axis="0 1 0"/>{geom}</body>'
                pairs += "".join(f'<pair geom1="c{c}" geom2="{name}" condim="1"/>' for c in range(4))
            pairs += f'<pair geom1="cue{k}" geom2="ball{k}" condim="1"/>'
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{self.dt}" gravity="0 0 0"/><size memory="200M"/><default>'
            f'<geom contype="0" conaffinity="0"/><joint type="slide" damping="{self.decay * mass}"/></default>'
            f"<worldbody>{walls}{balls}</worldbody><contact>{pairs}</contact></mujoco>"
        )
        self.data = mujoco.MjData(self.model)
        self.advance = mujoco.mj_step
        self.x, self.v = self.data.qpos.reshape(-1, 2, 2), self.data.qvel.reshape(-1, 2, 2)  # views of its state

    def place(self, tables: Any) -> None:  # noqa: D102
        pass

    def step(self) -> None:  # noqa: D102
        self.advance(self.model, self.data)


def main() -> None:
    """Answers the lines of the input."""
    settings = json.loads(sys.stdin.readline())
    world = {"pymunk": Pymunk, "mujoco": Mujoco}[settings.pop("simulator")](**settings)
    print(json.dumps(world.delays()), flush=True)
    for line in sys.stdin:
        print(json.dumps(world.play(**{name: np.array(rows) for name, rows in json.loads(line).items()})), flush=True)


if __name__ == "__main__":
    main()
