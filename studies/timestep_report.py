"""What a study of timesteps says of each world: means over the seeds, and tables of them.

A mean over the policies of a world has Student's 95 % interval over their seeds, of which there are few: it is about
what another run of the training would give. The layouts are the same for all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from agents.intervals import as_percent, difference, over_seeds
from studies.causes import CAUSES
from studies.timestep_measure import QUANTILES


def summary(result: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """What is told of each world: the policies trained in it, over seeds.

    Args:
        result: What `measure` returns.

    Returns:
        By world: `own` and `exact`, the success in the world itself and in the exact one; `gap`, own less exact;
        `behind`, the success in the exact world less that of the policies trained there; `false`, the share of the
        successes in the own world that fail in the exact one, and `causes`, these shares by cause; `speed`, `turn` and
        `cut_angle`, the medians of the speed (m/s), the turn and the cut angle (degrees), None where there are none;
        `aimed_at_ball`, the share of the shots whose line meets the nearest ball to pot; `training_seconds` of a run
        and `shots_per_second` of the world.
    """
    told = {}
    mine = {w: [p for p in result["policies"] if p["world"] == w] for w in result["worlds_measured"]}
    exact = {w: [p["success"]["exact"]["rate"] for p in policies] for w, policies in mine.items()}
    for world, policies in mine.items():
        own = [p["success"][world]["rate"] for p in policies]
        rests = [p["rests_on"] for p in policies]
        successes = [max(r["successes"], 1) for r in rests]
        medians = {name: [p[name]["quantiles"] for p in policies] for name in ("speed", "turn", "cut_angle")}
        middle = QUANTILES.index(0.5)
        told[world] = {
            "own": over_seeds(own),
            "exact": over_seeds(exact[world]),
            "gap": over_seeds([a - b for a, b in zip(own, exact[world], strict=True)]),
            "behind": difference(exact[world], exact["exact"]),
            "false": over_seeds([r["fail_in_exact"] / n for r, n in zip(rests, successes, strict=True)]),
            "causes": {
                name: over_seeds([r["causes"][name] / n for r, n in zip(rests, successes, strict=True)])
                for name in CAUSES
            },
            **{
                name: over_seeds([q[middle] for q in quantiles]) if None not in quantiles else None
                for name, quantiles in medians.items()
            },
            "aimed_at_ball": over_seeds([p["aimed_at_ball"] for p in policies]),
            "training_seconds": over_seeds([p["training_seconds"] for p in policies]),
            "shots_per_second": result["worlds_measured"][world]["shots_per_second"],
        }
    return told


def transfer(result: Mapping[str, Any]) -> dict[str, dict[str, dict[str, Any]]]:
    """By the world of training and the world of the test: the success, over seeds."""
    worlds = result["worlds_measured"]
    return {
        trained: {
            tested: over_seeds([p["success"][tested]["rate"] for p in result["policies"] if p["world"] == trained])
            for tested in worlds
        }
        for trained in worlds
    }


def tables(result: Mapping[str, Any]) -> dict[str, tuple[tuple[str, ...], list[tuple[str, ...]]]]:
    """Heads and rows of the tables "conclusion", "causes", "shots" and "transfer", one row a world of training."""
    told, matrix = summary(result), transfer(result)
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
                for world, t in told.items()
            ],
        ),
        "causes": (
            ("trained in", "false successes", *(name.replace("_", " ") for name in CAUSES)),
            [
                (_name(world), *(as_percent(share) for share in (t["false"], *t["causes"].values())))
                for world, t in told.items()
                if world != "exact"
            ],
        ),
        "shots": (
            (
                "trained in",
                "median speed, m/s",
                "median turn, degrees",
                "median cut angle, degrees",
                "aimed at the ball",
            ),
            [
                (
                    _name(world),
                    *(_number(t[name]) for name in ("speed", "turn", "cut_angle")),
                    as_percent(t["aimed_at_ball"]),
                )
                for world, t in told.items()
            ],
        ),
        "transfer": (
            ("trained in", *(f"played in {_name(world)}" for world in told)),
            [(_name(a), *(f"{matrix[a][b]['mean']:.1%}" for b in told)) for a in told],
        ),
    }


def findings(result: Mapping[str, Any]) -> list[str]:
    """What the study found, in sentences: which timesteps will do, what the others teach, and what each costs.

    Args:
        result: What `studies.timestep` wrote.

    Returns:
        Three sentences; none if there is no world with a timestep.
    """
    told, dts = summary(result), {world: m["dt"] for world, m in result["worlds_measured"].items()}
    exact, stepped = told["exact"], {world: t for world, t in told.items() if world != "exact"}
    if not stepped:
        return []
    worse = [w for w, t in stepped.items() if t["behind"]["interval"] is not None and t["behind"]["interval"][1] < 0]
    last = min(stepped, key=lambda world: stepped[world]["behind"]["mean"])
    falsest = max(stepped, key=lambda world: stepped[world]["false"]["mean"])
    causes = stepped[falsest]["causes"]
    cause = max(causes, key=lambda name: causes[name]["mean"])
    finest = min(stepped, key=lambda world: dts[world])
    minutes = {world: told[world]["training_seconds"]["mean"] / 60 for world in ("exact", finest)}
    rates = {world: told[world]["shots_per_second"] for world in ("exact", finest)}
    return [
        f"Policies trained with the exact engine succeed with it on {as_percent(exact['exact'])} of the layouts. "
        f"Those trained at {', '.join(worse) + ' s' if worse else 'no timestep'} are worse by more than the interval. "
        f"The largest difference is at {_name(last)}: {_points(stepped[last]['behind'])} points.",
        f"Of the successes of the policies trained at {_name(falsest)}, with their own engine, "
        f"{as_percent(stepped[falsest]['false'])} fail with the exact engine. The most frequent cause is "
        f"{cause.replace('_', ' ')}: {as_percent(causes[cause])} of the successes. No other timestep has a larger "
        "share.",
        f"A run takes {minutes['exact']:.1f} min with the exact engine and {minutes[finest]:.1f} min at "
        f"{_name(finest)}; one core runs {rates['exact']:,.0f} and {rates[finest]:,.0f} shots/s.",
    ]


def _name(world: str) -> str:
    return world if world == "exact" else f"{world} s"


def _points(value: Mapping[str, Any]) -> str:
    if value["interval"] is None:
        return f"{100 * value['mean']:+.1f}"
    low, high = (100 * end for end in value["interval"])
    return f"{100 * value['mean']:+.1f} ({low:+.1f} to {high:+.1f})"


def _number(value: Mapping[str, Any] | None) -> str:
    if value is None:
        return "-"
    if value["interval"] is None:
        return f"{value['mean']:.2f}"
    low, high = value["interval"]
    return f"{value['mean']:.2f} ({low:.2f} to {high:.2f})"
