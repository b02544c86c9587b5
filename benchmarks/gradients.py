"""The cost of the derivatives of shots, and their errors through a timestep: `python -m benchmarks.gradients`.

* Cost: for each case a batch is simulated, simulated with a record, and differentiated, on one core. The parts take
  turns in one process; medians of the ratios to the plain batch are reported.
* Errors: automatic differentiation of a simulation with a timestep returns the derivative with each contact fixed at
  its timestep. A central difference so small that no contact moves to another timestep equals it: here one over 2e-9
  m/s. This difference, and one over 2e-3 m/s, are compared with the exact derivative, for each fix and each timestep.
  Each shot has the same contacts with all of them.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import in_turns, machine, new_figure, run_command, save, table
from benchmarks.accuracy_report import PIT_STYLES
from benchmarks.speed import Case, breaks, quartiles, random_shots, seconds
from billiards_env import derivatives
from billiards_env.commands import Job
from billiards_env.engine import PIC, Engine
from billiards_env.engine.overlaps import FIXES
from billiards_env.scene import Balls, Physics, Scene, layouts
from billiards_env.scene.table import Table
from billiards_env.shots.simulation import BatchResult, simulate_batch

Floats = NDArray[np.float64]

PARTS = ("record", "jvp", "vjp", "record and jvp", "record and vjp")

STEPS = (60, 240, 960, 3840, 15360)
"""Numbers of timesteps per second."""

DRAWN, SLOWEST, FASTEST = 2300, 0.5, 4.0
"""The number of drawn shots, and the least and the largest speed, m/s."""

SMALL, LARGE = 1e-9, 1e-3
"""Changes of the velocity for the central differences, m/s."""

MOST = 30.0
"""s. Shots whose derivative is larger are left out: 1 mm/s moves a ball by more than 3 cm."""

SEED = 0

STYLES: dict[str, dict[str, Any]] = {
    **PIT_STYLES,
    "time_of_impact": {"marker": "D", "color": "#cc79a7", "markersize": 4, "linewidth": 1.6},
}


def cases(scale: float = 1.0) -> list[Case]:
    """Returns the cases; with `scale` = 1 a pass over the shots of a case takes about a tenth of a second."""

    def count(shots: int) -> int:
        return max(1, round(shots * scale))

    return [
        random_shots("pool, 1 object ball", Scene.named("pool", 1), count(20_000)),
        random_shots("real pool, 1 object ball", Scene.named("real_pool", 1), count(10_000)),
        breaks("15-ball break, loose rack", "pool", "rack", count(500)),
        breaks("real pool, 15-ball break, loose rack", "real_pool", "rack", count(500)),
    ]


def measure(repeats: int, job: Job, scale: float = 1.0) -> dict[str, Any]:
    """Runs all measurements `repeats` times.

    Args:
        repeats: Number of passes over the cases.
        job: Runs the jobs: each case, the choice of the shots, and each engine.
        scale: Factor on the number of shots in a pass.

    Returns:
        `cases`: a list with one entry per case; and what `errors` returns.
    """
    on, all_cases, rows = machine(), {case.name: case for case in cases(scale)}, []
    calls = {name: functools.partial(time_parts, case) for name, case in all_cases.items()}
    for name, passes in in_turns(calls, repeats + 1, job).items():
        plain, *parts = np.transpose(passes[1:])  # the first compiles
        record, jvp, vjp = (part / plain for part in parts)
        ratios = zip(PARTS, (record, jvp, vjp, record + jvp, record + vjp), strict=True)
        us = 1e6 * float(np.median(plain)) / len(all_cases[name].positions)
        rows.append({"case": name, "us_per_shot": us, "ratios": {part: quartiles(row) for part, row in ratios}})
    return {"machine": on, "repeats": repeats, "cases": rows, **errors(job)}


def time_parts(case: Case) -> list[float]:
    """Returns the seconds of a plain batch, a recorded one, a jvp by and a vjp for all velocities."""
    scene, positions, velocities = case.scene, case.positions, case.velocities
    batch = simulate_batch(scene, positions, velocities, record=True, threads=1)
    ones = np.ones(positions.shape)
    return [
        seconds(lambda: simulate_batch(scene, positions, velocities, threads=1)),
        seconds(lambda: simulate_batch(scene, positions, velocities, record=True, threads=1)),
        seconds(lambda: derivatives.jvp(batch, {"velocities": ones}, "positions", threads=1)),
        seconds(lambda: derivatives.vjp(batch, {"positions": ones}, "velocities", threads=1)),
    ]


class SceneShots(NamedTuple):
    """Shots of n balls in one scene: positions (m, n, 2), m, and velocities of the cue ball (m, 2), m/s."""

    scene: Scene
    positions: Floats
    velocities: Floats

    def batch(self, change: float | Floats = 0.0, engine: Engine = PIC, record: bool = False) -> BatchResult:
        """Runs the shots on one core, with the velocities changed by `change` m/s."""
        moving = self.velocities + change
        return simulate_batch(self.scene, self.positions, moving, engine=engine, record=record, threads=1)

    def part(self, chosen: Any) -> SceneShots:
        """Returns some of the shots."""
        return SceneShots(self.scene, self.positions[chosen], self.velocities[chosen])


def pit(steps: int, fix: str) -> Engine:
    """Returns the engine with a number of timesteps per second and a fix."""
    return Engine("pit", 1.0 / steps, fix)


ENGINES = {f"{fix} 1/{steps} s": pit(steps, fix) for steps in STEPS for fix in FIXES}
"""The engines with a timestep."""


def draw_shots() -> SceneShots:
    """Returns random shots with one object ball. The cue ball is aimed at it, at any cut."""
    scene, rng = Scene.named("pool", 1), np.random.default_rng(SEED)
    positions = np.array([layouts.draw("random", scene, rng) for _ in range(DRAWN)])
    rng.uniform(size=DRAWN)  # skips these numbers, so that the shots are the published ones
    x, y = (positions[:, 1] - positions[:, 0]).T
    offset = rng.uniform(-0.95, 0.95, DRAWN) * sum(scene.balls.radius[:2])
    headings = np.arctan2(y, x) + np.arcsin(offset / np.hypot(x, y))
    speeds = rng.uniform(SLOWEST, FASTEST, DRAWN)[:, None]
    return SceneShots(scene, positions, speeds * np.c_[np.cos(headings), np.sin(headings)])


def outcomes(batch: BatchResult) -> NDArray[np.int64]:
    """Returns the ball that is hit first, the cushions of each ball and the potted balls of each shot, (m, ...)."""
    return np.c_[batch.first_hit, batch.cushions, batch.potted]


def exact_derivatives(batch: BatchResult) -> Floats:
    """Returns the derivatives of the final positions by the cue ball's velocity, (m, n, 2, 2)."""
    return derivatives.jacobian(batch, "positions", "velocities", threads=1)[:, :, :, 0]


def differences(shots: SceneShots, h: float, engine: Engine = PIC) -> Floats:
    """Returns central differences with a change of `h`, m/s, in each direction, shaped as `exact_derivatives`."""
    changes = h * np.eye(2)
    ends = [shots.batch(change, engine).positions - shots.batch(-change, engine).positions for change in changes]
    return np.stack(ends, axis=-1) / (2.0 * h)


def sizes(derivatives: Floats) -> Floats:
    """Returns the Frobenius norm of the derivatives (m, n, 2, 2) of each shot, (m,)."""
    return np.sqrt(np.square(derivatives).sum(axis=(1, 2, 3)))


def choose() -> dict[str, Any]:
    """Chooses the drawn shots that are smooth and have the same contacts with each timestep.

    Returns:
        `numbers`: the numbers of the chosen shots. `smooth`: the number of smooth shots. `other`: the share of them
        with contacts that the exact engine does not have, by fix and timestep.
    """
    shots = draw_shots()
    exact = shots.batch(record=True)
    size = sizes(exact_derivatives(exact))
    hit, smooth = exact.first_hit == 1, derivatives.nonsmooth(exact).reason == ""
    smooth = np.flatnonzero(hit & smooth & (size > 0.0) & (size < MOST))
    part, same = shots.part(smooth), {}
    for name, engine in ENGINES.items():
        same[name] = (outcomes(part.batch(engine=engine)) == outcomes(exact)[smooth]).all(axis=1)
    return {
        "numbers": smooth[np.all(list(same.values()), axis=0)].tolist(),
        "smooth": len(smooth),
        "other": {name: 1.0 - float(agrees.mean()) for name, agrees in same.items()},
    }


def errors_of(shots: SceneShots, engine: Engine) -> dict[str, float]:
    """Returns the median errors of an engine in shots.

    Returns:
        `position`, m: the largest distance of a ball's final position. `small` and `large`: the relative
        errors of the central differences with `SMALL` and `LARGE` (see `sizes`).
    """
    exact = shots.batch(record=True)
    derivatives = exact_derivatives(exact)
    away = np.linalg.norm(shots.batch(engine=engine).positions - exact.positions, axis=2)
    relative = {"position": away.max(axis=1)}
    for name, h in (("small", SMALL), ("large", LARGE)):
        relative[name] = sizes(differences(shots, h, engine) - derivatives) / sizes(derivatives)
    return {name: float(np.median(values)) for name, values in relative.items()}


def errors(job: Job) -> dict[str, Any]:
    """Returns `steps` and `fixes`; `chosen`, see `choose`; and `errors`, see `errors_of`, by "exact" and by engine."""
    result: dict[str, Any] = {"steps": STEPS, "fixes": FIXES, "errors": {}}
    with job("choice of the shots"):
        chosen = choose()
        shots, result["chosen"] = draw_shots().part(chosen["numbers"]), chosen
        for name, engine in {"exact": PIC, **ENGINES}.items():
            with job(name):
                result["errors"][name] = errors_of(shots, engine)
    return result


def percent(share: float) -> str:
    """Returns the text of a share with two digits."""
    return "< 0.001%" if 0.0 < share < 1e-5 else f"{100 * share:.2g}%"


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    costs = [
        (row["case"], f"{row['us_per_shot']:.1f}", *(f"{row['ratios'][name]['median']:.2f}" for name in PARTS))
        for row in result["cases"]
    ]
    cost = {
        "how": f"One core; medians of {result['repeats']} interleaved passes. The other columns are times "
        "divided by the time of the plain batch.",
        "cost": table(("shots", "us/shot", *PARTS), costs),
    }
    return cost | (_errors(result) if "chosen" in result else {})


def _errors(result: dict[str, Any]) -> dict[str, str]:
    """Returns the blocks of the errors. Those of an engine that failed are empty."""
    steps, chosen, errors = result["steps"], result["chosen"], result["errors"]

    def cell(name: str, error: str) -> str:
        value = errors.get(name, {}).get(error)
        return "" if value is None else f"{value:.1e} m" if error == "position" else percent(value)

    dts = [f"1/{n} s" for n in steps]
    ends, shown = (dts[0], dts[-1]), (dts[0], dts[len(dts) // 2], dts[-1])
    rows = []
    for fix in result["fixes"]:
        columns = {"position": ends, "small": shown, "large": ends}
        cells = (cell(f"{fix} {dt}", error) for error, at in columns.items() for dt in at)
        rows.append((f"`{fix}`", *cells))
    rows.append(("exact engine", "", "", cell("exact", "small"), "", "", cell("exact", "large"), ""))
    columns = (("position", ends), ("derivative", shown), ("over 2 mm/s", ends))
    head = ("fix", *(f"{name}, {dt}" for name, at in columns for dt in at))
    other = (f"{percent(chosen['other'][f'time_of_impact {dt}'])} (timestep {dt})" for dt in dts)
    return {
        "errors": table(head, rows),
        "contacts": f"Shots in which `time_of_impact` makes other contacts: {', '.join(other)}.",
        "shots": f"{len(chosen['numbers'])} of {chosen['smooth']:,} smooth shots are compared: those with the same "
        "contacts for each fix and timestep.",
    }


def draw(result: dict[str, Any], folder: Path) -> None:
    """Draws the errors of whole shots, and the reason for them."""
    draw_errors(result, folder / "gradient_timestep.png")
    draw_reason(folder / "gradient_timestep_reason.png")


def draw_errors(measured: dict[str, Any], path: Path) -> None:
    """Draws the errors of the positions and of the derivatives of whole shots against the timestep."""
    steps, results = measured["steps"], measured["errors"]
    figure = new_figure(8.4, 4.0, dpi=120)
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


def bounces(speeds: Floats) -> SceneShots:
    """Returns shots of 1 s in which a ball bounces off a cushion at right angles, without friction and without loss."""
    physics = Physics(motion="ideal", cushion="restitution", e_cushion=1.0, max_time=1.0)
    scene = Scene(Balls((0.03,), (0.2,)), Table(2.0, 1.0), physics)
    return SceneShots(scene, np.zeros((len(speeds), 1, 2)), np.c_[speeds, np.zeros_like(speeds)])


def draw_reason(path: Path) -> None:
    """Draws the final position of `bounces` against the speed."""
    speeds = np.linspace(1.4, 1.6, 2001)
    shots = bounces(speeds)
    figure = new_figure(8.4, 3.4, dpi=120)
    panels = figure.subplots(1, 2, sharey=True)
    titles = {60: "timestep 1/60 s", 240: "timestep 1/240 s: smaller jumps, the same slopes"}
    for (steps, title), axes in zip(titles.items(), panels, strict=True):
        for fix in ("push_apart", "time_of_impact"):
            places = shots.batch(engine=pit(steps, fix)).positions[:, 0, 0]
            jumps = np.abs(np.diff(places, append=places[-1])) > 5.0 * (speeds[1] - speeds[0])
            axes.plot(speeds, np.where(jumps, np.nan, places), color=STYLES[fix]["color"], linewidth=2.2, label=fix)
        axes.plot(speeds, shots.batch().positions[:, 0, 0], "k:", linewidth=1.2, label="exact")
        axes.set_title(title, fontsize=11)
        axes.set(xlabel="speed at the start (m/s)", xticks=(1.4, 1.45, 1.5, 1.55, 1.6))
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("position 1 s later (m)")
    panels[0].legend(frameon=False, fontsize=9)
    save(figure, path)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.gradients --help`."""
    about, repeats = "Measure the cost of derivatives, and their errors through a timestep.", (11, "number of passes")
    run_command("benchmarks.gradients", about, arguments, measure, blocks, {"repeats": repeats}, draw, jobs=True)


if __name__ == "__main__":
    main()
