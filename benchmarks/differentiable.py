"""Published tasks for differentiable simulators, with the exact derivatives: `python -m benchmarks.differentiable`.

The tasks come from DiffTaichi (Hu et al. 2020), DiffMJX (2026) and a report about Nimble.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import machine, run_command, table
from billiards_env.scene import Balls, Physics, Scene, Table
from billiards_env.shots.simulation import BatchResult, simulate, simulate_batch

Floats = NDArray[np.float64]

SOLVED = 1e-6  # m, distance from the goal
MOST = 10  # iterations


class Break(NamedTuple):
    """The break of DiffTaichi's `billiards.py`: its disks, its time, and the breaks that are drawn here.

    A break is (x, y, vx, vy) of the cue ball. The task has no walls, so the table is larger than any path.
    """

    radius: float = 0.03
    time: float = 1023 * 0.003
    home: tuple[float, ...] = (0.1, 0.5, 0.3, 0.0)
    goal: tuple[float, float] = (0.9, 0.75)
    lowest: tuple[float, ...] = (0.1, 0.3, 0.2, -0.3)
    highest: tuple[float, ...] = (0.4, 0.8, 0.8, 0.3)

    def scene(self) -> Scene:
        physics = Physics("ideal", "restitution", e_ball=0.8, max_time=self.time)
        return Scene(Balls.uniform(11, self.radius), Table(20.0, 20.0), physics)

    def rack(self) -> Floats:
        """Returns the positions of the ten resting disks, (10, 2)."""
        r = self.radius
        return np.array(
            [(0.5 + 2 * r * i, 0.5 + 2 * r * j - 0.7 * r * i) for i in range(4) for j in range(i + 1)], np.float64
        )

    def run(self, breaks: Floats) -> BatchResult:
        """Runs breaks (m, 4)."""
        positions = np.empty((len(breaks), 11, 2))
        positions[:, 0], positions[:, 1:] = breaks[:, :2], self.rack()
        return simulate_batch(self.scene(), positions, breaks[:, 2:], record=True)

    def draw(self, m: int, rng: np.random.Generator) -> Floats:
        """Returns random breaks (m, 4)."""
        return rng.uniform(self.lowest, self.highest, (m, 4))

    def solve(self, start: Floats, goal: Floats, rng: np.random.Generator) -> dict[str, Any]:
        """Moves a break so that the last disk ends at a goal.

        An iteration runs one batch. It has random breaks, and Gauss-Newton steps, whole and halved, from the breaks
        of the batch before with the shortest such steps.
        """
        size, least, most = np.subtract(self.highest, self.lowest), (-2, -2, -3, -3), (0.43, 3, 3, 3)
        fresh, tried, best, begin = self.draw(FRESH - 1, rng), 0, np.inf, perf_counter()
        breaks = np.concatenate((start[None], fresh))
        for iteration in range(1, MOST + 1):
            batch = self.run(breaks)
            tried += len(breaks)
            error = batch.positions[:, -1] - goal
            best = min(best, float(np.linalg.norm(error, axis=1).min()))
            if best < SOLVED:
                return {"iterations": iteration, "shots": tried, "distance": best, "seconds": perf_counter() - begin}
            by = (batch.jacobian("positions", name)[:, -1, :, 0] for name in ("positions", "velocities"))
            slope = np.concatenate((*by,), axis=-1) * size
            step = -np.einsum("mij,mj->mi", np.linalg.pinv(slope, rcond=1e-6), error)
            left = np.linalg.norm(error + np.einsum("mij,mj->mi", slope, step), axis=1)
            chosen = np.argsort(np.linalg.norm(step, axis=1) + 100 * left)[:KEPT]
            step = step[chosen] / np.maximum(1.0, 2.0 * np.linalg.norm(step[chosen], axis=1, keepdims=True))
            moved = breaks[chosen, None] + 0.5 ** np.arange(4.0)[:, None] * step[:, None] * size
            nearest = breaks[rng.choice(np.linalg.norm(error, axis=1).argsort()[:KEPT], FRESH)]
            near = nearest + 10.0 ** rng.uniform(-4, 0, (FRESH, 1)) * rng.normal(size=(FRESH, 4)) * size
            breaks = np.clip(np.concatenate((moved.reshape(-1, 4), near, self.draw(FRESH, rng))), least, most)
        return {"iterations": None, "shots": tried, "distance": best, "seconds": perf_counter() - begin}


FRESH, KEPT = 1024, 64


def difftaichi(tasks: int) -> dict[str, Any]:
    """Solves DiffTaichi's own task, and some with a random start and the end of another random break as the goal."""
    rng, task = np.random.default_rng(0), Break()
    goals, rack = np.empty((0, 2)), task.rack()[-1]
    while len(goals) < tasks:
        ends = task.run(task.draw(tasks, rng)).positions[:, -1]
        goals = np.concatenate((goals, ends[np.abs(ends - rack).max(axis=1) > task.radius]))
    own = task.solve(np.array(task.home), np.array(task.goal), rng)
    starts = task.draw(tasks, rng)
    return {"own": own, "random": [task.solve(start, goal, rng) for start, goal in zip(starts, goals, strict=False)]}


class Push(NamedTuple):
    """The task `03_billiard` of DiffMJX: a force (4, u) N pushes the cue ball for 0.01 s; u is in [-5, 5].

    The other ball must stop at the origin. Here the rolling friction is such that it does so after a full hit.
    """

    radius: float = 0.042
    mass: float = 0.17
    positions: tuple[tuple[float, float], ...] = ((-0.375, 0.0), (-0.2, 0.0))
    impulse: float = 0.01 / 0.17  # m/s for each N
    force: float = 4.0

    def scene(self) -> Scene:
        way = self.positions[1][0] - self.positions[0][0] - 2 * self.radius - self.positions[1][0]
        mu_roll = (self.force * self.impulse) ** 2 / (2 * 9.81 * way)
        balls = Balls.uniform(2, self.radius, self.mass)
        return Scene(balls, Table(), Physics("rolling", "restitution", e_ball=1.0, g=9.81, mu_roll=mu_roll))

    def solve(self, control: float) -> dict[str, Any]:
        """Turns the push by Gauss-Newton steps: to a half-full hit if the hit is thin, else to the goal."""
        distance = np.inf
        for iteration in range(MOST + 1):
            velocity = self.impulse * np.array([self.force, control])
            shot = simulate(self.scene(), self.positions, velocity, record=True)
            distance = float(np.hypot(*shot.positions[1]))
            if distance < SOLVED:
                return {"iterations": iteration, "control": control, "distance": distance}
            depth = shot.margins().balls[0, 1]
            if depth < 0.5 * self.radius:
                slope, error = shot.jacobian("ball_margins", "velocities")[0, 1, 0, 1], depth - self.radius
            else:
                slope, error = shot.jacobian("positions", "velocities")[1, :, 0, 1], shot.positions[1]
            heading = np.arctan2(control, self.force)
            slope = slope * self.impulse * self.force / np.cos(heading) ** 2  # by the heading of the push
            control = self.force * float(np.tan(heading - np.sum(slope * error) / np.sum(slope**2)))
        return {"iterations": None, "control": control, "distance": distance}


def diffmjx(tasks: int) -> dict[str, Any]:
    """Solves `03_billiard` from evenly spaced controls."""
    controls = np.linspace(-5.0, 5.0, tasks).tolist()
    return {"starts": controls, "results": [Push().solve(u) for u in controls]}


def nimble() -> list[float]:
    """Returns the gradient of Nimble's test: the last place of the second of two equal elastic balls on a line.

    The inputs are the places x1, x2 and the velocities v1, v2 of the balls at the start. The time is 1 s.
    """
    scene = Scene(
        Balls.uniform(2, 0.1, 1.0), Table(20.0, 20.0), Physics("ideal", "restitution", e_ball=1.0, max_time=1.0)
    )
    shot = simulate(scene, [[0.0, 0.0], [0.7, 0.0]], [1.0, 0.0], record=True)
    by = shot.vjp({"positions": [[0.0, 0.0], [1.0, 0.0]]}, ("positions", "velocities"))
    return [*by["positions"][:, 0].tolist(), *by["velocities"][:, 0].tolist()]


def measure(tasks: int) -> dict[str, Any]:
    """Runs all tasks: `tasks` random tasks of DiffTaichi, and as many starts of DiffMJX."""
    on = machine()
    return {"machine": on, "difftaichi": difftaichi(tasks), "diffmjx": diffmjx(tasks), "nimble": nimble()}


def blocks(found: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""

    def solved(results: list[dict[str, Any]], budget: int) -> str:
        least = [r["iterations"] for r in results if r["iterations"] is not None and r["iterations"] <= budget]
        text = f"{len(least)} of {len(results)} solved in at most {budget} iterations"
        return text + (f", median {np.median(least):.0f}" if least else "")

    own, pushed = found["difftaichi"]["own"], found["diffmjx"]
    first = f"{own['iterations']} iterations, {own['distance']:.0e} m from the goal"
    gradient = ", ".join(f"{value + 0.0:.2g}" for value in found["nimble"])
    rows = [
        ("DiffTaichi, billiards", "200 iterations", first),
        ("the same from other starts to other goals", "the loss rises", solved(found["difftaichi"]["random"], 10)),
        ("DiffMJX, `03_billiard`", "at most 30 iterations", solved(pushed["results"], 5)),
        ("Nimble, two balls on a line; exact: 1, 0, 1, 0", "0.75, 0.25, 0.91, 0.08", gradient),
    ]
    shots = [result["shots"] for result in found["difftaichi"]["random"]]
    seconds = [result["seconds"] for result in found["difftaichi"]["random"]]
    return {
        "cost": f"A random task takes {np.median(shots):,.0f} shots and {np.median(seconds):.1f} s (medians).",
        "tasks": table(("task", "published", "here"), rows, left=3),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.differentiable --help`."""
    about, tasks = "Run published tasks with derivatives.", (100, "random tasks")
    run_command("benchmarks.differentiable", about, arguments, measure, blocks, {"tasks": tasks})


if __name__ == "__main__":
    main()
