"""Summarizes a study of timesteps: means over the seeds, tables and the figure.

The mean over the policies of a world has Student's 95% interval over the few seeds of the training. The layouts are
the same for all policies.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks import save, table, use_own_font
from billiards_env.intervals import as_percent, difference, over_seeds
from studies.causes import CAUSES


def summary(result: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Returns the means over the seeds of the policies trained in each world, from the result of `studies.timestep`.

    Returns:
        By world: `own` and `exact`, the success in the world itself and in the exact one; `behind`, the success in the
        exact world less that of the policies trained there; `false`, the share of the successes in the own world that
        fail in the exact one, and `causes`, these shares by cause; `training_seconds` of a run; and `shots_per_second`
        of the world.
    """
    found = {}
    by_world = {w: [p for p in result["policies"] if p["world"] == w] for w in result["worlds_measured"]}
    exact = {world: rates(result, world, "exact") for world in by_world}
    for world, policies in by_world.items():
        own = rates(result, world, world)
        successes = [max(p["success"][world], 1) for p in policies]
        causes = [p["false_successes"] for p in policies]
        found[world] = {
            "own": over_seeds(own),
            "exact": over_seeds(exact[world]),
            "behind": difference(exact[world], exact["exact"]),
            "false": over_seeds([sum(c.values()) / n for c, n in zip(causes, successes, strict=True)]),
            "causes": {
                name: over_seeds([c[name] / n for c, n in zip(causes, successes, strict=True)]) for name in CAUSES
            },
            "training_seconds": over_seeds([p["curve"][-1][1] for p in policies]),
            "shots_per_second": result["worlds_measured"][world]["shots_per_second"],
        }
    return found


def rates(result: Mapping[str, Any], trained: str, tested: str) -> list[float]:
    """Returns the success in the world `tested` of each policy trained in the world `trained`."""
    return [p["success"][tested] / result["layouts"] for p in result["policies"] if p["world"] == trained]


def tables(result: Mapping[str, Any]) -> dict[str, tuple[tuple[str, ...], list[tuple[str, ...]]]]:
    """Returns the heads and rows of the tables, by name; a row for each world of training."""
    means = summary(result)
    return {
        "conclusion": (
            (
                "trained in",
                "success with its engine",
                "success with the exact engine",
                "difference to exact training, points",
                "false successes",
                "training",
                "shots/s",
            ),
            [
                (
                    _name(world),
                    as_percent(t["own"]),
                    as_percent(t["exact"]),
                    "" if world == "exact" else _points(t["behind"]),
                    "" if world == "exact" else as_percent(t["false"]),
                    f"{t['training_seconds']['mean'] / 60:.1f} min",
                    f"{t['shots_per_second']:,.0f}",
                )
                for world, t in means.items()
            ],
        ),
        "causes": (
            ("trained in", "false successes", *(name.replace("_", " ") for name in CAUSES)),
            [
                (_name(world), *(as_percent(share) for share in (t["false"], *t["causes"].values())))
                for world, t in means.items()
                if world != "exact"
            ],
        ),
        "transfer": (
            ("trained in", *(f"played in {_name(world)}" for world in means)),
            [(_name(a), *(f"{np.mean(rates(result, a, b)):.1%}" for b in means)) for a in means],
        ),
    }


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables as Markdown, by name."""
    minutes = sum(p["curve"][-1][1] for p in result["policies"]) / 60
    return {
        **{name: table(head, rows) for name, (head, rows) in tables(result).items()},
        "time": f"- `{result['study']}`: {minutes:.0f} minutes on one core",
    }


def draw(result: Mapping[str, Any], path: Path) -> None:
    """Draws the success in the world of the training and in the exact world, against the timestep."""
    use_own_font()
    means = summary(result)
    # The exact world, whose timestep would be 0, is on the left.
    worlds = sorted(means, key=lambda world: result["worlds_measured"][world]["dt"] or 0.0)
    figure = Figure(figsize=(6.6, 3.8), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for shift, key, colour, label in (
        (-0.08, "exact", "#0072b2", "in the exact world"),
        (0.08, "own", "#d55e00", "in the world of the training"),
    ):
        for k, world in enumerate(worlds):
            played = "exact" if key == "exact" else world
            found = rates(result, world, played)
            axes.plot([k + shift] * len(found), 100 * np.array(found), ".", color=colour, alpha=0.5, markersize=5)
        heights = 100 * np.array([means[world][key]["mean"] for world in worlds])
        intervals = [means[world][key]["interval"] or [means[world][key]["mean"]] * 2 for world in worlds]
        ends = np.abs(100 * np.clip(intervals, 0.0, 1.0).T - heights)
        axes.errorbar(np.arange(len(worlds)) + shift, heights, ends, fmt="o-", color=colour, capsize=3, label=label)
    axes.set_xticks(range(len(worlds)), worlds)
    axes.set(xlabel="timestep of the training (s)", ylabel="success (%)", ylim=(0.0, None))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
    save(figure, path)


def _name(world: str) -> str:
    return world if world == "exact" else f"{world} s"


def _points(value: Mapping[str, Any]) -> str:
    if value["interval"] is None:
        return f"{100 * value['mean']:+.1f}"
    low, high = (100 * end for end in value["interval"])
    return f"{100 * value['mean']:+.1f} ({low:+.1f} to {high:+.1f})"
