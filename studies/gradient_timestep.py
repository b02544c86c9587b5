"""Measures derivatives through a timestep: `python -m studies.gradient_timestep`.

Automatic differentiation of a simulation with a timestep returns the derivative with each contact fixed at its
timestep. A central difference so small that no contact moves to another timestep equals it: here one over 2e-9 m/s. The
command compares this difference, and one over 2e-3 m/s, with the exact derivative, for each fix and each timestep. Each
shot has the same contacts with all of them.

The results are in `studies/results/gradient_timestep.json`, the pictures in `docs/images`. The command skips cells that
have results there with the same settings, so it continues after an interruption.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import IMAGES, machine_line, save, table, use_own_font
from benchmarks.accuracy_report import PIT_STYLES
from benchmarks.speed import seconds
from billiards_env.engine.overlaps import FIXES
from billiards_env.files import write_json
from billiards_env.scene import Balls, Physics, Scene, layouts
from billiards_env.scene.table import Table
from billiards_env.shots.simulation import BatchResult, simulate_batch
from studies import RESULTS, parser_of, report, resumed

OUTPUT = RESULTS / "gradient_timestep.json"

STEPS = (60, 240, 960, 3840, 15360)
"""Numbers of timesteps per second."""

KINDS = {"one ball": (1, 0.3, 1.5, 1500), "one cushion": (0, 0.3, 2.5, 1500), "whole shots": (1, 0.5, 4.0, 2300)}
"""The shots: the number of object balls, the least and the largest speed, m/s, and the number of drawn shots."""

SMALL, LARGE = 1e-9, 1e-3
"""Changes of the velocity for the central differences, m/s."""

MOST = 30.0
"""s. Shots whose derivative is larger are left out: 1 mm/s moves a ball by more than 3 cm."""

PASSES, SEED = 41, 0

STYLES: dict[str, dict[str, Any]] = {
    **PIT_STYLES,
    "time_of_impact": {"marker": "D", "color": "#cc79a7", "markersize": 4, "linewidth": 1.6},
}

Floats = NDArray[np.float64]


class Shots(NamedTuple):
    """Shots of n balls in one scene: positions (m, n, 2), m, and velocities of the cue ball (m, 2), m/s."""

    scene: Scene
    positions: Floats
    velocities: Floats

    def run(self, change: float | Floats = 0.0, record: bool = False, **engine: Any) -> BatchResult:
        """Runs the shots on one core, with the velocities changed by `change` m/s."""
        return simulate_batch(self.scene, self.positions, self.velocities + change, record=record, threads=1, **engine)

    def part(self, chosen: Any) -> Shots:
        """Returns some of the shots."""
        return Shots(self.scene, self.positions[chosen], self.velocities[chosen])


def pit(steps: int, fix: str) -> dict[str, Any]:
    """Returns the arguments of `simulate_batch` for a number of timesteps per second and a fix."""
    return {"mode": "pit", "dt": 1.0 / steps, "fix": fix}


CELLS = {f"{fix} 1/{steps} s": pit(steps, fix) for steps in STEPS for fix in FIXES}
"""The engines with a timestep, as arguments of `simulate_batch`."""


def draw_shots(kind: str) -> Shots:
    """Returns random shots of a kind of `KINDS`. With an object ball the cue ball is aimed at it, at any cut."""
    n, slow, fast, count = KINDS[kind]
    scene, rng = Scene.named("pool", n), np.random.default_rng(SEED)
    positions = np.array([layouts.draw("random", scene, rng) for _ in range(count)])
    headings = rng.uniform(-np.pi, np.pi, count)
    if n > 0:
        x, y = (positions[:, 1] - positions[:, 0]).T
        offset = rng.uniform(-0.95, 0.95, count) * sum(scene.balls.radius[:2])
        headings = np.arctan2(y, x) + np.arcsin(offset / np.hypot(x, y))
    speeds = rng.uniform(slow, fast, count)[:, None]
    return Shots(scene, positions, speeds * np.c_[np.cos(headings), np.sin(headings)])


def outcomes(batch: BatchResult) -> NDArray[np.int64]:
    """Returns the ball that is hit first, the cushions of each ball and the potted balls of each shot, (m, ...)."""
    return np.c_[batch.first_hit, batch.cushions, batch.potted]


def exact_derivatives(batch: BatchResult) -> Floats:
    """Returns the derivatives of the final positions by the cue ball's velocity, (m, n, 2, 2)."""
    return batch.jacobian("positions", "velocities", threads=1)[:, :, :, 0]


def differences(shots: Shots, h: float, **engine: Any) -> Floats:
    """Returns central differences with a change of `h`, m/s, in each direction, shaped as `exact_derivatives`."""
    changes = h * np.eye(2)
    ends = [shots.run(change, **engine).positions - shots.run(-change, **engine).positions for change in changes]
    return np.stack(ends, axis=-1) / (2.0 * h)


def sizes(derivatives: Floats) -> Floats:
    """Returns the Frobenius norm of the derivatives (m, n, 2, 2) of each shot, (m,)."""
    return np.sqrt(np.square(derivatives).sum(axis=(1, 2, 3)))


def choose(kind: str) -> dict[str, Any]:
    """Chooses the drawn shots of a kind that are smooth and have the same contacts with each timestep.

    Returns:
        `numbers`: those of the chosen shots. `smooth`: the number of smooth shots of this kind. `other`: the share of
        them with contacts that differ from those of the exact engine, by fix and timestep.
    """
    shots = draw_shots(kind)
    exact = shots.run(record=True)
    size, bounces = sizes(exact_derivatives(exact)), exact.cushions.sum(axis=1)
    single = ~exact.potted.any(axis=1)
    of_kind = {
        "one ball": single & (exact.first_hit == 1) & (bounces == 0),
        "one cushion": single & (bounces == 1),
        "whole shots": exact.first_hit == 1,
    }
    smooth = np.flatnonzero(of_kind[kind] & (exact.nonsmooth().reason == "") & (size > 0.0) & (size < MOST))
    part, same = shots.part(smooth), {}
    for cell, engine in CELLS.items():
        same[cell] = (outcomes(part.run(**engine)) == outcomes(exact)[smooth]).all(axis=1)
    return {
        "numbers": smooth[np.all(list(same.values()), axis=0)].tolist(),
        "smooth": len(smooth),
        "other": {cell: 1.0 - float(found.mean()) for cell, found in same.items()},
    }


def errors(shots: Shots, positions: Floats, derivatives: Floats, **engine: Any) -> dict[str, float]:
    """Returns the median errors of an engine.

    Args:
        shots: The shots.
        positions: (m, n, 2) the exact final positions, m.
        derivatives: (m, n, 2, 2) the exact derivatives, s.
        **engine: The engine, as arguments of `simulate_batch`.

    Returns:
        `position`, m: the distance of the final position, of the ball for which it is largest. `small` and `large`: the
        relative errors of the central differences with `SMALL` and `LARGE` (see `sizes`).
    """
    found = {"position": np.linalg.norm(shots.run(**engine).positions - positions, axis=2).max(axis=1)}
    for name, h in (("small", SMALL), ("large", LARGE)):
        found[name] = sizes(differences(shots, h, **engine) - derivatives) / sizes(derivatives)
    return {name: float(np.median(values)) for name, values in found.items()}


def cost(shots: Shots, steps: int) -> dict[str, float]:
    """Returns the run time of each fix over that of "push_apart": medians of interleaved passes over the shots."""
    some = shots.part(slice(max(20, len(shots.positions) * STEPS[0] // steps)))
    times = [[seconds(lambda fix=fix: some.run(**pit(steps, fix))) for fix in FIXES] for _ in range(PASSES)]
    ratios = np.median([np.divide(row, row[FIXES.index("push_apart")]) for row in times], axis=0)
    return dict(zip(FIXES, ratios.tolist(), strict=True))


def measure(output: Path) -> dict[str, Any]:
    """Measures what has no results, and writes the results of each cell as soon as it is measured.

    Args:
        output: The JSON file of the results.

    Returns:
        The content of the file: `machine`, `settings`, `chosen[kind]` (see `choose`), `errors[kind]`, by "exact" and by
        fix and timestep (see `errors`), and `cost[steps]` for whole shots.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    settings = {"kinds": KINDS, "steps": STEPS, "fixes": FIXES, "passes": PASSES, "seed": SEED}
    found = resumed(output, settings, chosen={}, errors={}, cost={})
    cells: dict[str, dict[str, Any]] = {"exact": {}, **CELLS}
    with tqdm(total=len(KINDS) * (1 + len(cells)) + len(STEPS), unit="cell") as bar:
        for kind in KINDS:
            bar.set_description(f"{kind}, choice")
            if kind not in found["chosen"]:
                found["chosen"][kind] = choose(kind)
                write_json(output, found)
            bar.update()
            shots, results = (
                draw_shots(kind).part(found["chosen"][kind]["numbers"]),
                found["errors"].setdefault(kind, {}),
            )
            exact = shots.run(record=True)
            derivatives = exact_derivatives(exact)
            for cell, engine in cells.items():
                bar.set_description(f"{kind}, {cell}")
                if cell not in results:
                    results[cell] = errors(shots, exact.positions, derivatives, **engine)
                    write_json(output, found)
                bar.update()
        for steps in map(str, STEPS):
            bar.set_description(f"cost, 1/{steps} s")
            if steps not in found["cost"]:
                whole = draw_shots("whole shots").part(found["chosen"]["whole shots"]["numbers"])
                found["cost"][steps] = cost(whole, int(steps))
                write_json(output, found)
            bar.update()
    return found


def percent(share: float) -> str:
    """Returns the text of a share with two digits."""
    return "< 0.001%" if 0.0 < share < 1e-5 else f"{100 * share:.2g}%"


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    fixes, steps, chosen = found["settings"]["fixes"], found["settings"]["steps"], found["chosen"]
    dts = [f"1/{n} s" for n in steps]
    ends, some = (dts[0], dts[-1]), (dts[0], dts[len(dts) // 2], dts[-1])
    rows = []
    for kind, results in found["errors"].items():
        for fix in fixes:
            at = {dt: results[f"{fix} {dt}"] for dt in dts}
            positions = (f"{at[dt]['position']:.1e} m" for dt in ends)
            small, large = (percent(at[dt]["small"]) for dt in some), (percent(at[dt]["large"]) for dt in ends)
            rows.append((kind, f"`{fix}`", *positions, *small, *large))
        exact = results["exact"]
        rows.append((kind, "exact engine", "", "", percent(exact["small"]), "", "", percent(exact["large"]), ""))
    columns = (("position", ends), ("derivative", some), ("over 2 mm/s", ends))
    head = ("shots", "fix", *(f"{name}, {dt}" for name, at in columns for dt in at))
    other, cost = chosen["whole shots"]["other"], found["cost"]
    contacts = [(f"`{fix}`", *(percent(other[f"{fix} {dt}"]) for dt in dts)) for fix in fixes]
    times = [(f"`{fix}`", *(f"{cost[str(n)][fix]:.2f}" for n in steps)) for fix in fixes]
    numbers = ", ".join(f"{len(c['numbers'])} of {c['smooth']:,} ({kind})" for kind, c in chosen.items())
    return {
        "machine": machine_line(found["machine"]),
        "errors": table(head, rows, left=2),
        "contacts": table(("whole shots with other contacts", *dts), contacts),
        "cost": table(("time over that of `push_apart`", *dts), times),
        "shots": f"Smooth shots with the same contacts for each fix and timestep: {numbers}. Times are medians of "
        f"{found['settings']['passes']} interleaved passes on one core.",
    }


def draw(found: Mapping[str, Any], path: Path) -> None:
    """Draws the errors of the positions and of the derivatives of whole shots against the timestep."""
    use_own_font()
    steps, results = found["settings"]["steps"], found["errors"]["whole shots"]
    figure = Figure(figsize=(8.4, 4.0), dpi=120, layout="constrained")
    left, right = figure.subplots(1, 2)
    for fix, style in STYLES.items():
        cells = [results[f"{fix} 1/{n} s"] for n in steps]
        left.loglog(steps, [cell["position"] for cell in cells], **style, label=fix)
        right.loglog(steps, [100.0 * cell["small"] for cell in cells], **style)
    left.set_title("Positions converge", fontsize=11)
    left.set_ylabel("error of the final position (m)")
    right.set_title("Derivatives do not, except with time_of_impact", fontsize=11)
    right.set_ylabel("error of its derivative (%)")
    right.yaxis.set_major_formatter("{x:g}")
    for axes in (left, right):
        axes.set_xticks(steps, [f"1/{n}" for n in steps])
        axes.minorticks_off()
        axes.set_xlabel("timestep (s)")
        axes.grid(alpha=0.3)
    left.legend(frameon=False, fontsize=9)
    save(figure, path)


def bounces(speeds: Floats) -> Shots:
    """Returns shots of 1 s in which a ball bounces off a cushion at right angles, without friction and without loss."""
    physics = Physics(motion="ideal", cushion="restitution", e_cushion=1.0, max_time=1.0)
    scene = Scene(Balls((0.03,), (0.2,)), Table(2.0, 1.0), physics)
    return Shots(scene, np.zeros((len(speeds), 1, 2)), np.c_[speeds, np.zeros_like(speeds)])


def draw_reason(path: Path) -> None:
    """Draws the final position of `bounces` against the speed."""
    use_own_font()
    speeds = np.linspace(1.4, 1.6, 2001)
    shots = bounces(speeds)
    figure = Figure(figsize=(8.4, 3.4), dpi=120, layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    titles = {60: "timestep 1/60 s", 240: "timestep 1/240 s: smaller jumps, the same slopes"}
    for (steps, title), axes in zip(titles.items(), panels, strict=True):
        for fix in ("push_apart", "time_of_impact"):
            places = shots.run(**pit(steps, fix)).positions[:, 0, 0]
            jumps = np.abs(np.diff(places, append=places[-1])) > 5.0 * (speeds[1] - speeds[0])
            axes.plot(speeds, np.where(jumps, np.nan, places), color=STYLES[fix]["color"], linewidth=2.2, label=fix)
        axes.plot(speeds, shots.run().positions[:, 0, 0], "k:", linewidth=1.2, label="exact")
        axes.set_title(title, fontsize=11)
        axes.set(xlabel="speed at the start (m/s)", xticks=(1.4, 1.45, 1.5, 1.55, 1.6))
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("position 1 s later (m)")
    panels[0].legend(frameon=False, fontsize=9)
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.gradient_timestep --help`."""
    files = {"output": (OUTPUT, "JSON file"), "images": (IMAGES, "folder of the pictures")}
    args = parser_of("gradient_timestep", "Measure derivatives through a timestep.", **files).parse_args(arguments)

    def work() -> dict[str, Any]:
        found = measure(args.output)
        draw(found, args.images / "gradient_timestep.png")
        draw_reason(args.images / "gradient_timestep_reason.png")
        return found

    report(work, blocks, args.output)


if __name__ == "__main__":
    main()
