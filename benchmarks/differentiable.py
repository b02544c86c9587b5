"""Published tasks for differentiable simulators, with the exact derivatives: `python -m benchmarks.differentiable`.

The tasks come from DiffTaichi (Hu et al. 2020), DiffMJX (2026) and a report about Nimble.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import machine, run_command, table
from billiards_env.scene import Balls, Physics, Scene, Table
from billiards_env.shots.simulation import BatchResult, simulate, simulate_batch

Floats = NDArray[np.float64]

SOLVED = 1e-6  # m, distance from the goal
MOST = 10  # iterations
FRESH, KEPT = 1024, 64  # random breaks of an iteration, and breaks of it that are followed

RADIUS = 0.03
BREAK = Scene(
    Balls.uniform(11, RADIUS),
    Table(20.0, 20.0),
    Physics("ideal", "restitution", e_ball=0.8, max_time=1023 * 0.003),
)
"""The break of DiffTaichi's `billiards.py`. The task has no walls, so the table is larger than any path."""

RACK = np.array(
    [(0.5 + 2 * RADIUS * i, 0.5 + 2 * RADIUS * j - 0.7 * RADIUS * i) for i in range(4) for j in range(i + 1)]
)
"""The positions of the ten resting disks of the break, (10, 2)."""

LOWEST, HIGHEST = np.array([(0.1, 0.3, 0.2, -0.3), (0.4, 0.8, 0.8, 0.3)])
"""The least and the largest (x, y, vx, vy) of the cue ball in a random break."""


def run(breaks: Floats) -> BatchResult:
    """Runs breaks (m, 4) of DiffTaichi."""
    positions = np.empty((len(breaks), 11, 2))
    positions[:, 0], positions[:, 1:] = breaks[:, :2], RACK
    return simulate_batch(BREAK, positions, breaks[:, 2:], record=True)


def draw_breaks(m: int, rng: np.random.Generator) -> Floats:
    """Returns random breaks (m, 4)."""
    return rng.uniform(LOWEST, HIGHEST, (m, 4))


def solve_break(start: Floats, goal: Floats, rng: np.random.Generator) -> dict[str, Any]:
    """Moves a break so that the last disk ends at a goal.

    An iteration runs one batch. It has random breaks, and Gauss-Newton steps, whole and halved, from the breaks of the
    batch before with the shortest such steps.
    """
    size, least, most = HIGHEST - LOWEST, (-2, -2, -3, -3), (0.43, 3, 3, 3)
    breaks = np.concatenate((start[None], draw_breaks(FRESH - 1, rng)))
    tried, best, iterations, begin = 0, np.inf, None, perf_counter()
    for iteration in range(1, MOST + 1):
        batch = run(breaks)
        tried += len(breaks)
        error = batch.positions[:, -1] - goal
        best = min(best, float(np.linalg.norm(error, axis=1).min()))
        if best < SOLVED:
            iterations = iteration
            break
        by = (batch.jacobian("positions", name)[:, -1, :, 0] for name in ("positions", "velocities"))
        slope = np.concatenate((*by,), axis=-1) * size
        step = -np.einsum("mij,mj->mi", np.linalg.pinv(slope, rcond=1e-6), error)
        left = np.linalg.norm(error + np.einsum("mij,mj->mi", slope, step), axis=1)
        chosen = np.argsort(np.linalg.norm(step, axis=1) + 100 * left)[:KEPT]
        step = step[chosen] / np.maximum(1.0, 2.0 * np.linalg.norm(step[chosen], axis=1, keepdims=True))
        moved = breaks[chosen, None] + 0.5 ** np.arange(4.0)[:, None] * step[:, None] * size
        nearest = breaks[rng.choice(np.linalg.norm(error, axis=1).argsort()[:KEPT], FRESH)]
        near = nearest + 10.0 ** rng.uniform(-4, 0, (FRESH, 1)) * rng.normal(size=(FRESH, 4)) * size
        breaks = np.clip(np.concatenate((moved.reshape(-1, 4), near, draw_breaks(FRESH, rng))), least, most)
    return {"iterations": iterations, "shots": tried, "distance": best, "seconds": perf_counter() - begin}


def difftaichi(tasks: int) -> dict[str, Any]:
    """Solves DiffTaichi's own task, and some with a random start and the end of another random break as the goal."""
    rng, goals = np.random.default_rng(0), np.empty((0, 2))
    while len(goals) < tasks:
        ends = run(draw_breaks(tasks, rng)).positions[:, -1]
        goals = np.concatenate((goals, ends[np.abs(ends - RACK[-1]).max(axis=1) > RADIUS]))
    own = solve_break(np.array([0.1, 0.5, 0.3, 0.0]), np.array([0.9, 0.75]), rng)
    starts = draw_breaks(tasks, rng)
    return {"own": own, "random": [solve_break(start, goal, rng) for start, goal in zip(starts, goals, strict=False)]}


def solve_push(control: float) -> dict[str, Any]:
    """Solves the task `03_billiard` of DiffMJX: a force (4, u) N pushes the cue ball for 0.01 s; u is in [-5, 5].

    The other ball must stop at the origin. Here the rolling friction is such that it does so after a full hit. The push
    is turned by Gauss-Newton steps: to a half-full hit if the hit is thin, else to the goal.
    """
    radius, mass, force = 0.042, 0.17, 4.0
    positions = ((-0.375, 0.0), (-0.2, 0.0))
    impulse = 0.01 / mass  # m/s for each N
    mu_roll = (force * impulse) ** 2 / (2 * 9.81 * (0.375 - 2 * radius))
    physics = Physics("rolling", "restitution", e_ball=1.0, g=9.81, mu_roll=mu_roll)
    scene, iterations, distance = Scene(Balls.uniform(2, radius, mass), Table(), physics), None, np.inf
    for iteration in range(MOST + 1):
        shot = simulate(scene, positions, (impulse * force, impulse * control), record=True)
        distance = float(np.hypot(*shot.positions[1]))
        if distance < SOLVED:
            iterations = iteration
            break
        depth = shot.margins().balls[0, 1]
        if depth < 0.5 * radius:
            slope, error = shot.jacobian("ball_margins", "velocities")[0, 1, 0, 1], depth - radius
        else:
            slope, error = shot.jacobian("positions", "velocities")[1, :, 0, 1], shot.positions[1]
        heading = np.arctan2(control, force)
        slope = slope * impulse * force / np.cos(heading) ** 2  # by the heading of the push
        control = force * float(np.tan(heading - np.sum(slope * error) / np.sum(slope**2)))
    return {"iterations": iterations, "distance": distance}


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
    pushes = [solve_push(control) for control in np.linspace(-5.0, 5.0, tasks).tolist()]
    return {"machine": on, "difftaichi": difftaichi(tasks), "diffmjx": pushes, "nimble": nimble()}


def blocks(measured: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""

    def solved(results: list[dict[str, Any]], budget: int) -> str:
        least = [r["iterations"] for r in results if r["iterations"] is not None and r["iterations"] <= budget]
        text = f"{len(least)} of {len(results)} solved in at most {budget} iterations"
        return text + (f", median {np.median(least):.0f}" if least else "")

    own, others = measured["difftaichi"]["own"], measured["difftaichi"]["random"]
    first = f"{own['iterations']} iterations, {own['distance']:.0e} m from the goal"
    gradient = ", ".join(f"{value + 0.0:.2g}" for value in measured["nimble"])
    rows = [
        ("DiffTaichi, billiards", "200 iterations", first),
        ("the same from other starts to other goals", "the loss rises", solved(others, 10)),
        ("DiffMJX, `03_billiard`", "at most 30 iterations", solved(measured["diffmjx"], 5)),
        ("Nimble, two balls on a line; exact: 1, 0, 1, 0", "0.75, 0.25, 0.91, 0.08", gradient),
    ]
    shots, seconds = (np.median([result[key] for result in others]) for key in ("shots", "seconds"))
    return {
        "cost": f"A random task takes {shots:,.0f} shots and {seconds:.1f} s (medians).",
        "tasks": table(("task", "published", "here"), rows, left=3),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.differentiable --help`."""
    about, tasks = "Run published tasks with derivatives.", (100, "random tasks")
    run_command("benchmarks.differentiable", about, arguments, measure, blocks, {"tasks": tasks})


if __name__ == "__main__":
    main()
