"""Tables and a picture of the results of `benchmarks.accuracy`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks import metres, new_figure, ratio, save, table

LEVELS = {"10 cm": 0.1, "1 cm": 1e-2, "1 mm": 1e-3, "0.1 mm": 1e-4}
ENOUGH = 0.99
PIC_STYLE: dict[str, Any] = {"marker": "*", "color": "black", "markersize": 13, "linestyle": "none"}
PIT_STYLES: dict[str, dict[str, Any]] = {
    "push_apart": {"marker": "o", "color": "#0072b2", "markersize": 6, "linewidth": 1.2},
    "move_back": {"marker": "s", "color": "#d55e00", "markersize": 4, "linewidth": 1.2},
    "none": {"marker": "^", "color": "#009e73", "markersize": 4, "linewidth": 1.2, "linestyle": "--"},
}
"""Plot styles of the fixes."""
FLOOR = 1e-17  # m, zero errors are drawn at this value


def _pit(scene: dict[str, Any], fix: str) -> list[dict[str, Any]]:
    """Returns the rows of PIT with a fix, from the coarsest timestep to the finest."""
    return sorted((row for row in scene["methods"] if row["fix"] == fix), key=lambda row: row["steps_per_second"])


def _pic(scene: dict[str, Any]) -> dict[str, Any]:
    return next(row for row in scene["methods"] if row["method"] == "PIC")


def _when(scene: dict[str, Any]) -> str:
    return "at the end" if scene["error_at"] == "end" else f"after {scene['error_at']:g} s"


def coarsest_from(rows: list[dict[str, Any]], good: list[bool]) -> dict[str, Any] | None:
    """Returns the coarsest row that is good together with all finer rows; None if there is none."""
    last_bad = max((k for k, fine in enumerate(good) if not fine), default=-1)
    return rows[last_bad + 1] if last_bad + 1 < len(rows) else None


def levels(scenes: dict[str, Any]) -> str:
    """Returns the table of the run times, over PIC's, of the fastest PIT with a median error below each level."""
    lines = []
    for name, scene in scenes.items():
        line, pic = [f"{name}, {_when(scene)}"], _pic(scene)
        for level in LEVELS.values():
            reach = []
            for fix in PIT_STYLES:
                rows = _pit(scene, fix)
                row = coarsest_from(rows, [r["median_error_m"] <= level for r in rows])
                reach += [] if row is None else [row]
            best = min(reach, key=lambda row: row["time_over_pic"], default=None)
            line.append("-" if best is None else f"{ratio(best['time_over_pic'])} (1/{best['steps_per_second']} s)")
        least = min(row["median_error_m"] for row in scene["methods"] if row["method"] == "PIT")
        lines.append([*line, metres(least), metres(pic["median_error_m"])])
    return table(["median error of PIT below", *LEVELS, "PIT's least error", "PIC's error"], lines)


def enough(scenes: dict[str, Any]) -> str:
    """Returns the table of the largest timesteps with 99% right outcomes, and their run times."""
    lines = []
    for name, scene in scenes.items():
        for fix in ("push_apart", "move_back"):
            rows = _pit(scene, fix)
            if "wrong_scores" not in rows[0]:
                continue
            line = [name, fix]
            for key in ("wrong_outcomes", "wrong_scores"):
                row = coarsest_from(rows, [r[key] <= 1 - ENOUGH for r in rows])
                finest = rows[-1]
                line += (
                    [f"none ({100 * (1 - finest[key]):.1f}% at 1/{finest['steps_per_second']} s)", ""]
                    if row is None
                    else [f"1/{row['steps_per_second']} s", ratio(row["time_over_pic"])]
                )
            lines.append([*line, f"{rows[-1]['scoring_shots']}"])
    head = ["scene", "fix", "all shots", "time / PIC", "shots that score", "time / PIC ", "scoring shots"]
    return table(head, lines, left=2)


def shots_line(result: dict[str, Any]) -> str:
    """Returns a sentence with the numbers of shots."""
    scenes, count = result["scenes"].items(), result["shots"]
    partly = [
        f"{name} ({s['compared']} shots, {s['followed_to_the_end']} to the end)"
        for name, s in scenes
        if s["compared"] < count
    ]
    outcomes = ", ".join(f"{name} {s['outcome_shots']:,}" for name, s in scenes if s["outcome_shots"])
    return (
        f"{count} shots of each scene have a reference. Compared only in part: {', '.join(partly) or 'none'}. The "
        f"outcomes below come from more shots: {outcomes}."
    )


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    scenes = result["scenes"]
    return {"shots": shots_line(result), "levels": levels(scenes), "enough": enough(scenes)}


def draw(result: dict[str, Any], folder: Path) -> None:
    """Draws run time against error, one panel per scene."""
    figure = new_figure(8.4, 10.5)
    *panels, key = figure.subplots(4, 2, sharey=True).flat
    for (name, scene), axes in zip(result["scenes"].items(), panels, strict=True):
        curves = [(_pit(scene, fix), style) for fix, style in PIT_STYLES.items()]
        for rows, style in (*curves, ([_pic(scene)], PIC_STYLE)):
            axes.loglog([r["us_per_shot"] for r in rows], [max(FLOOR, r["median_error_m"]) for r in rows], **style)
        pit = _pit(scene, "push_apart")
        for row, side in ((pit[0], "left"), (pit[len(pit) // 2], "center"), (pit[-1], "right")):
            at, label = (row["us_per_shot"], 4), f"1/{row['steps_per_second']} s"
            axes.annotate(label, at, fontsize=8.5, ha=side, va="bottom", color="#444444")
            axes.plot([at[0]] * 2, [row["median_error_m"], at[1]], ":", color="#888888", linewidth=0.8)
        axes.set_title(f"{name}, {_when(scene)}", fontsize=11)
        axes.set_ylim(FLOOR / 3, 600)
        axes.grid(alpha=0.3)
    for axes in panels[::2]:
        axes.set_ylabel("median error (m)")
    for axes in panels[-2:]:
        axes.set_xlabel("run time (us per shot)")
    key.axis("off")
    for label, style in (("PIC", PIC_STYLE), *((f"PIT, {fix}", style) for fix, style in PIT_STYLES.items())):
        key.plot([], [], **style, label=label)
    key.legend(loc="center", frameon=False, title="left: faster, down: more exact")
    save(figure, folder / "pareto.png")
