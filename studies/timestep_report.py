"""Summarizes a study of timesteps: means over the seeds, tables and findings.

The mean over the policies of a world has Student's 95 % interval over the few seeds of the training. The layouts are
the same for all policies.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from agents.intervals import as_percent, difference, over_seeds
from benchmarks import table
from studies.causes import CAUSES


def summary(result: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Returns the means over the seeds of the policies trained in each world.

    Args:
        result: The result of a study, see `studies.timestep`.

    Returns:
        By world: `own` and `exact`, the success in the world itself and in the exact one; `gap`, own less exact;
        `behind`, the success in the exact world less that of the policies trained there; `false`, the share of the
        successes in the own world that fail in the exact one, and `causes`, these shares by cause; `training_seconds`
        of a run; and `shots_per_second` of the world.
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
            "gap": over_seeds([a - b for a, b in zip(own, exact[world], strict=True)]),
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


def transfer(result: Mapping[str, Any]) -> dict[str, dict[str, dict[str, Any]]]:
    """Returns the success over seeds, by the world of the training and then by the world of the test."""
    worlds = result["worlds_measured"]
    return {trained: {tested: over_seeds(rates(result, trained, tested)) for tested in worlds} for trained in worlds}


def tables(result: Mapping[str, Any]) -> dict[str, tuple[tuple[str, ...], list[tuple[str, ...]]]]:
    """Returns the heads and rows of the tables, by name; a row for each world of training."""
    means, matrix = summary(result), transfer(result)
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
            [(_name(a), *(f"{matrix[a][b]['mean']:.1%}" for b in means)) for a in means],
        ),
    }


def findings(result: Mapping[str, Any]) -> list[str]:
    """Returns three sentences on the timesteps that suffice, the false successes and the cost.

    The list is empty if there is no world with a timestep.
    """
    means, dts = summary(result), {world: m["dt"] for world, m in result["worlds_measured"].items()}
    exact, stepped = means["exact"], {world: t for world, t in means.items() if world != "exact"}
    if not stepped:
        return []
    worse = [w for w, t in stepped.items() if t["behind"]["interval"] is not None and t["behind"]["interval"][1] < 0]
    last = min(stepped, key=lambda world: stepped[world]["behind"]["mean"])
    falsest = max(stepped, key=lambda world: stepped[world]["false"]["mean"])
    causes = stepped[falsest]["causes"]
    cause = max(causes, key=lambda name: causes[name]["mean"])
    finest = min(stepped, key=lambda world: dts[world])
    minutes = {world: means[world]["training_seconds"]["mean"] / 60 for world in ("exact", finest)}
    speeds = {world: means[world]["shots_per_second"] for world in ("exact", finest)}
    return [
        f"Policies trained with the exact engine succeed with it on {as_percent(exact['exact'])} of the layouts. "
        f"Those trained at {', '.join(worse) + ' s' if worse else 'no timestep'} are worse by more than the interval. "
        f"The largest difference is at {_name(last)}: {_points(stepped[last]['behind'])} points.",
        f"Of the successes of the policies trained at {_name(falsest)}, with their own engine, "
        f"{as_percent(stepped[falsest]['false'])} fail with the exact engine. The most frequent cause is "
        f"{cause.replace('_', ' ')}: {as_percent(causes[cause])} of the successes. No other timestep has a larger "
        "share.",
        f"A run takes {minutes['exact']:.1f} min with the exact engine and {minutes[finest]:.1f} min at "
        f"{_name(finest)}; one core runs {speeds['exact']:,.0f} and {speeds[finest]:,.0f} shots/s.",
    ]


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the findings and tables as Markdown, by name."""
    minutes = sum(p["curve"][-1][1] for p in result["policies"]) / 60
    return {
        "findings": "\n".join(f"- {sentence}" for sentence in findings(result)),
        **{name: table(head, rows) for name, (head, rows) in tables(result).items()},
        "time": f"`{result['study']}`: {minutes:.0f} minutes of one core in total.",
    }


def _name(world: str) -> str:
    return world if world == "exact" else f"{world} s"


def _points(value: Mapping[str, Any]) -> str:
    if value["interval"] is None:
        return f"{100 * value['mean']:+.1f}"
    low, high = (100 * end for end in value["interval"])
    return f"{100 * value['mean']:+.1f} ({low:+.1f} to {high:+.1f})"
