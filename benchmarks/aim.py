"""How often `aim` reaches a goal, and how fast: `python -m benchmarks.aim`.

For each random layout with one object ball the goal is to pot this ball into a pocket and to leave the cue ball within
1 cm of a point. Both come from a random shot that pots the ball, so every goal can be reached. Many of these shots
use cushions before the pot. A search with random shots has the same goal. Times are processor times of one core.

A second table compares the players in tasks of the environment.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks import machine, rows_table, run_command, table
from billiards_env.evaluation import measure as evaluate
from billiards_env.players.aim import Leave, Pot, aim
from billiards_env.scene import Scene, layouts
from billiards_env.shots.simulation import BatchResult, simulate_batch

MAX_SPEED = 4.0  # m/s
TASKS = ("place", "position", "carom", "three_cushion")
PLAYERS = ("geometric", "search:200", "search:1000", "aim")
_DRAWN = 2_000  # random shots among which the shot of a goal is drawn; a layout without a pot among them does not count
_AT_ONCE = 20_000  # shots of the search in one batch


def random_shots(
    scene: Scene, positions: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[BatchResult, np.ndarray]:
    """Returns shots with random headings and speeds, and their velocities (count, 2)."""
    angles, speeds = rng.uniform(-np.pi, np.pi, count), MAX_SPEED * rng.uniform(0.05, 1.0, count)
    velocities = speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    return simulate_batch(scene, np.broadcast_to(positions, (count, 2, 2)), velocities, threads=1), velocities


def draw_goal(scene: Scene, rng: np.random.Generator) -> tuple[np.ndarray, Pot, Leave, bool]:
    """Returns a layout (2, 2), its two goals and whether the shot that reaches them is a direct pot."""
    pockets = np.array([(p.x, p.y) for p in scene.table.pockets])
    while True:
        positions = layouts.draw("random", scene, rng)
        shots, _ = random_shots(scene, positions, _DRAWN, rng)
        potted = np.flatnonzero(shots.potted[:, 1] & ~shots.potted[:, 0])
        if len(potted):
            k = rng.choice(potted)
            pocket = int(np.flatnonzero((pockets == shots.positions[k, 1]).all(axis=1))[0])
            direct = shots.cushions_before_hit[k, 1] == 0 and shots.cushions[k, 1] == 0
            x, y = shots.positions[k, 0].tolist()
            return positions, Pot(1, pocket), Leave((x, y)), bool(direct)


def search_solves(
    scene: Scene, positions: np.ndarray, pot: Pot, leave: Leave, count: int, rng: np.random.Generator
) -> bool:
    """Returns whether one of `count` random shots reaches the goals."""
    pocket = scene.table.pockets[pot.pocket or 0]
    for begin in range(0, count, _AT_ONCE):
        shots, _ = random_shots(scene, positions, min(_AT_ONCE, count - begin), rng)
        off = np.hypot(*(shots.positions[:, 0] - leave.position).T)
        in_pocket = shots.potted[:, 1] & (shots.positions[:, 1] == (pocket.x, pocket.y)).all(axis=1)
        if (in_pocket & ~shots.potted[:, 0] & (off <= leave.radius)).any():
            return True
    return False


def measure(layouts: int, shots: int, episodes: int) -> dict[str, Any]:
    """Aims at the goals of layouts, and searches for them with `shots` random shots each. Then measures players."""
    on, scene, rng = machine(), Scene.named("pool", 1), np.random.default_rng(0)
    rows = []
    for k in range(layouts + 1):
        positions, pot, leave, direct = draw_goal(scene, rng)
        begin = time.process_time()
        found = aim(scene, positions, (pot, leave), max_speed=MAX_SPEED, seed=k)
        seconds = time.process_time() - begin
        if k > 0:  # the first one compiles
            searched = search_solves(scene, positions, pot, leave, shots, rng)
            rows.append([direct, found.solved, searched, 1e3 * seconds, found.residual])
    columns, players = ["direct", "aim", "search", "ms", "residual"], measure_players(episodes)
    return {"machine": on, "shots": shots, "columns": columns, "rows": rows, "players": players}


def measure_players(episodes: int) -> list[list[Any]]:
    """Returns the task, the player, the share of the episodes that it solves and its ms per shot."""
    rows = []
    for task in TASKS:
        for player in PLAYERS:
            found = evaluate(player, {"task": task}, (0.0, 0.0), episodes, 0)
            rows.append([task, player, found["success_rate"], found["ms_per_decision"]])
    return rows


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    direct, solved, searched, ms, residual = (np.array(column) for column in zip(*result["rows"], strict=True))
    rows = []
    for name, chosen in (("all", direct | True), ("direct pots", direct), ("with cushions before the pot", ~direct)):
        if (chosen & solved & searched).any():
            both, residuals = solved[chosen & searched].mean(), residual[chosen & solved]
            shares = {"search": searched[chosen].mean(), "aim": solved[chosen].mean(), "both": both}
            times = {"ms": np.median(ms[chosen]), "most": np.quantile(ms[chosen], 0.9)}
            rows.append({"name": name, "count": chosen.sum(), **shares, **times, "residual": np.median(residuals)})
    columns = {
        "goals": "{name}",
        "layouts": "{count}",
        "search": "{search:.1%}",
        "aim": "{aim:.1%}",
        "aim, of those of search": "{both:.1%}",
        "median ms": "{ms:.1f}",
        "90% ms": "{most:.1f}",
        "median residual": "{residual:.0e} m",
    }
    played = {(task, player): f"{100 * share:.1f}% ({ms:.1f} ms)" for task, player, share, ms in result["players"]}
    tasks = [(task, *(played[task, player] for player in PLAYERS)) for task in TASKS]
    return {
        "how": f"Search: {result['shots']:,} random shots per layout. One core; processor times of `aim`.",
        "solved": rows_table(columns, rows),
        "players": table(("task", *PLAYERS), tasks),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.aim --help`."""
    options = {
        "layouts": (1_000, "number of layouts"),
        "shots": (100_000, "random shots of the search per layout"),
        "episodes": (300, "episodes of each player in each task"),
    }
    run_command("benchmarks.aim", "Measure how often aim reaches a goal.", arguments, measure, blocks, options)


if __name__ == "__main__":
    main()
