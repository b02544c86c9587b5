"""Tables and a picture of the results of `benchmarks.accuracy`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks import machine_line, table
from benchmarks.convergence import PIT_STYLES
from benchmarks.figures import save

LEVELS = {"10 cm": 0.1, "1 cm": 1e-2, "1 mm": 1e-3, "0.1 mm": 1e-4}
ENOUGH = 0.99
PIC_STYLE: dict[str, Any] = {"marker": "*", "color": "black", "markersize": 13, "linestyle": "none"}
OTHERS: dict[str, dict[str, Any]] = {
    "pymunk": {"marker": "v", "color": "#cc79a7", "linestyle": "--", "markersize": 4, "linewidth": 1},
    "Box2D": {"marker": "D", "color": "#e69f00", "linestyle": "--", "markersize": 4, "linewidth": 1},
    "python-billiards": {"marker": "P", "color": "#56b4e9", "linestyle": "none", "markersize": 8},
}
FLOOR = 1e-17  # m, zero errors are drawn at this value


def unpacked(result: dict[str, Any]) -> dict[str, Any]:
    """Returns what `accuracy.json` holds, with the rows of each scene as mappings."""
    scenes = {}
    for name, scene in result["scenes"].items():
        columns, rows = scene["methods"]["columns"], scene["methods"]["rows"]
        scenes[name] = {**scene, "methods": [dict(zip(columns, row, strict=True)) for row in rows]}
    return {**result, "scenes": scenes}


def _pit(scene: dict[str, Any], fix: str) -> list[dict[str, Any]]:
    """Returns the rows of PIT with a fix, from the coarsest timestep to the finest."""
    return sorted((row for row in scene["methods"] if row["fix"] == fix), key=lambda row: row["steps_per_second"])


def _pic(scene: dict[str, Any]) -> dict[str, Any]:
    return next(row for row in scene["methods"] if row["method"] == "PIC")


def _error(scene: dict[str, Any], row: dict[str, Any]) -> float:
    return row[f"median_error_{scene['error_at']}_m"]


def _when(scene: dict[str, Any]) -> str:
    return "at the end" if scene["error_at"] == "end" else f"after {scene['error_at']:g} s"


def _metres(error: float | None) -> str:
    return "" if error is None else f"{error:.1e} m"


def _ratio(value: float) -> str:
    return f"{value:.2f}" if value < 1 else f"{value:.1f}" if value < 10 else f"{value:,.0f}"


def coarsest_from(rows: list[dict[str, Any]], good: list[bool]) -> dict[str, Any] | None:
    """Returns the coarsest row that is good together with all finer rows; None if there is none."""
    last_bad = max((k for k, fine in enumerate(good) if not fine), default=-1)
    return rows[last_bad + 1] if last_bad + 1 < len(rows) else None


def scene_table(scene: dict[str, Any]) -> str:
    """Returns the table of PIT's errors, outcomes and run times at each timestep."""
    fixes = list(PIT_STYLES)
    rows = {fix: _pit(scene, fix) for fix in fixes}
    scores = "wrong_scores" in rows[fixes[0]][0]
    head = ["timestep", *(f"error, {fix}" for fix in fixes)]
    head += [f"scores right, {fix}" for fix in fixes] if scores else []
    head += ["us/shot", "time / PIC"]
    lines = []
    for k, row in enumerate(rows[fixes[0]]):
        line = [f"1/{row['steps_per_second']} s", *(_metres(_error(scene, rows[fix][k])) for fix in fixes)]
        line += [f"{100 * (1 - rows[fix][k]['wrong_scores']):.1f} %" for fix in fixes] if scores else []
        lines.append([*line, f"{row['us_per_shot']:,.0f}", _ratio(row["time_over_pic"])])
    pic = _pic(scene)
    lines.append(
        ["PIC", _metres(_error(scene, pic)), "", "", *([""] * 3 if scores else []), f"{pic['us_per_shot']:,.1f}", "1"]
    )
    return table(head, lines)


def levels(scenes: dict[str, Any]) -> str:
    """Returns the table of the run time, over that of PIC, of the fastest PIT with a median error below each level."""
    lines = []
    for name, scene in scenes.items():
        line, pic = [f"{name}, {_when(scene)}"], _pic(scene)
        for level in LEVELS.values():
            reach = []
            for fix in PIT_STYLES:
                rows = _pit(scene, fix)
                row = coarsest_from(rows, [_error(scene, r) <= level for r in rows])
                reach += [] if row is None else [row]
            best = min(reach, key=lambda row: row["time_over_pic"], default=None)
            line.append("-" if best is None else f"{_ratio(best['time_over_pic'])} (1/{best['steps_per_second']} s)")
        least = min(_error(scene, row) for row in scene["methods"] if row["method"] == "PIT")
        lines.append([*line, _metres(least), _metres(_error(scene, pic))])
    return table(["median error of PIT below", *LEVELS, "PIT's least error", "PIC's error"], lines)


def enough(scenes: dict[str, Any]) -> str:
    """Returns the table of the largest timesteps with 99 % right outcomes, and their run times."""
    lines = []
    for name, scene in scenes.items():
        for fix in PIT_STYLES:
            rows = _pit(scene, fix)
            if "wrong_scores" not in rows[0]:
                continue
            line = [name, fix]
            for key in ("wrong_outcomes", "wrong_scores"):
                row = coarsest_from(rows, [r[key] <= 1 - ENOUGH for r in rows])
                finest = rows[-1]
                line += (
                    [f"none ({100 * (1 - finest[key]):.1f} % at 1/{finest['steps_per_second']} s)", ""]
                    if row is None
                    else [f"1/{row['steps_per_second']} s", _ratio(row["time_over_pic"])]
                )
            lines.append([*line, f"{rows[-1]['scoring_shots']}"])
    head = ["scene", "fix", "all shots", "time / PIC", "shots that score", "time / PIC ", "scoring shots"]
    return table(head, lines, left=2)


def contacts(scenes: dict[str, Any]) -> str:
    """Returns the table of the number of contacts equal to those of the oracle."""
    lines = []
    for name, scene in scenes.items():
        chosen = [r for r in _pit(scene, "push_apart") if r["steps_per_second"] in (60, 960, 15360)]
        for row in (*chosen, _pic(scene)):
            what = "PIC" if row["method"] == "PIC" else f"PIT, 1/{row['steps_per_second']} s"
            until = row["median_first_difference_s"]
            lines.append(
                [
                    name,
                    what,
                    f"{row['median_same_contacts']:.0f} of {row['median_contacts']:.0f}",
                    f"{row['share_all_contacts_same']:.0%}",
                    "" if until is None else f"{until:.2f} s",
                ]
            )
    head = ["scene", "engine", "correct contacts", "shots with all correct", "first difference after"]
    return table(head, lines, left=2)


def others_table(scene: dict[str, Any]) -> str:
    """Returns the table of the other simulators, PIT and PIC."""
    rows = [r for r in scene["methods"] if r["method"] in OTHERS and r["steps_per_second"] in (None, 60, 480, 1920)]
    pit = [r for r in _pit(scene, "push_apart") if r["steps_per_second"] in (60, 480, 1920)]
    lines = []
    for row in (*rows, *pit, _pic(scene)):
        what = row["method"] + (f", 1/{row['steps_per_second']} s" if row["steps_per_second"] else "")
        errors = [_metres(row[f"median_error_{t}_m"]) for t in ("0.5", "1.0", "2.0", "5.0")]
        lines.append([what, *errors, f"{row['us_per_shot']:,.0f}", _ratio(row["time_over_pic"])])
    return table(["simulator", "0.5 s", "1 s", "2 s", "5 s", "us/shot", "time / PIC"], lines)


def orders_table(families: dict[str, Any]) -> str:
    """Returns the table of the observed orders of convergence."""
    lines = []
    for family, fixes in families.items():
        for fix, found in fixes.items():
            orders = [found[f"order_of_{what}"] for what in ("places", "velocities")]
            lines.append([family, fix, *("rounding" if o is None else f"{o:.2f}" for o in orders)])
    return table(["collision", "fix", "places", "velocities"], lines, left=2)


def shots_table(result: dict[str, Any]) -> str:
    """Returns the table of the numbers of shots."""
    rows = [
        [
            name,
            f"{result['shots']}",
            f"{scene['compared']} {_when(scene)}",
            f"{scene['followed_to_the_end']}",
            f"{scene['pic_outcome_as_oracle']}" if scene["outcome_shots"] else "",
            f"{scene['outcome_shots']:,}" if scene["outcome_shots"] else "",
        ]
        for name, scene in result["scenes"].items()
    ]
    return table(
        ["scene", "shots with reference", "compared", "to the end", "same outcome", "shots for outcomes"], rows
    )


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    scenes = unpacked(result)["scenes"]
    found = {
        "machine": machine_line(result["machine"]),
        "versions": ", ".join(f"{name} {version}" for name, version in result["versions"].items())
        or "no other simulator",
        "shots": shots_table(result),
        "levels": levels(scenes),
        "enough": enough(scenes),
        "contacts": contacts(scenes),
        "orders": orders_table(result["convergence"]),
    }
    for name, scene in scenes.items():
        if any(row["method"] in OTHERS for row in scene["methods"]):
            found[f"others, {name}"] = others_table(scene)
        found[name] = scene_table(scene)
    return found


def print_report(result: dict[str, Any]) -> None:
    """Prints all tables."""
    titles = {
        "shots": "Shots compared with the oracle, and shots whose outcomes are compared with PIC",
        "levels": "Run time of the fastest PIT below an error, over that of PIC",
        "enough": f"The largest timestep with {ENOUGH:.0%} of PIC's outcomes, and its run time over that of PIC",
        "contacts": "Contacts equal to those of the oracle (medians; PIT with push_apart)",
        "orders": "Order of PIT's error in dt after one collision",
    }
    for name, scene in result["scenes"].items():
        titles[f"others, {name}"] = f"{name}: median error after the given time; 10 s are simulated"
        titles[name] = f"{name}: median error {_when(scene)}"
    for name, text in blocks(result).items():
        print(f"{titles[name]}\n\n{text}\n" if name in titles else f"{text}\n")


def draw_pareto(result: dict[str, Any], path: Path) -> None:
    """Draws run time against error, one panel per scene."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 6), dpi=95, layout="constrained")
    *panels, key = figure.subplots(2, 4, sharey=True).flat
    for (name, scene), axes in zip(result["scenes"].items(), panels, strict=True):
        curves = [(_pit(scene, fix), style) for fix, style in PIT_STYLES.items()]
        for other, style in OTHERS.items():
            curves.append(([row for row in scene["methods"] if row["method"] == other], style))
        for rows, style in (*curves, ([_pic(scene)], PIC_STYLE)):
            axes.loglog([r["us_per_shot"] for r in rows], [max(FLOOR, _error(scene, r)) for r in rows], **style)
        pit = _pit(scene, "push_apart")
        for row, side in ((pit[0], "left"), (pit[len(pit) // 2], "center"), (pit[-1], "right")):
            at, label = (row["us_per_shot"], 4), f"1/{row['steps_per_second']} s"
            axes.annotate(label, at, fontsize=7.5, ha=side, va="bottom", color="#444444")
            axes.plot([at[0]] * 2, [_error(scene, row), at[1]], ":", color="#888888", linewidth=0.8)
        axes.set_title(f"{name}, {_when(scene)}", fontsize=10)
        axes.set_ylim(FLOOR / 3, 60)
        axes.grid(alpha=0.3)
    for axes in (panels[0], panels[4]):
        axes.set_ylabel("median error of the positions (m)")
    for axes in panels[3:]:
        axes.set_xlabel("run time (us per shot)")
    key.axis("off")
    for label, style in (("PIC", PIC_STYLE), *((f"PIT, {fix}", style) for fix, style in PIT_STYLES.items())):
        key.plot([], [], **style, label=label)
    for other in result["versions"]:
        key.plot([], [], **OTHERS[other], label=other)
    key.legend(loc="center", frameon=False, title="left: faster, down: more exact")
    save(figure, path)
