"""Checks which outcomes are certain (`ShotResult.certain`) against the 50-digit reference.

A shot counts as false if its certain contacts differ from the first contacts of the reference, or have another order.

    python -m benchmarks.certain                          # 10,000 shots
    python -m benchmarks.certain --shots 20 --breaks 5
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks import machine, rows_table, run_command, run_kinds, workers
from benchmarks.error_limit import KINDS
from billiards_env.shots.simulation import simulate
from reference.oracle import OracleError, run

SHOTS = "1 object ball", "5 object balls", "carom", "real pool, 5 object balls"
BREAKS = "9-ball break, loose", "15-ball break, loose"
CONTACTS = ("ball_ball", "cushion", "pocket")


def check(kind: str, seed: int) -> dict[str, Any]:
    """Runs a shot of one of `SHOTS` or `BREAKS` with the engine, and its certain events with the reference.

    Returns:
        certain (whether the outcome is certain), contacts and certain_contacts (the numbers of all and of the certain
        contacts), and false (whether the certain contacts differ from the contacts of the reference).
    """
    scene, draw = KINDS[kind]
    places, velocities = draw(scene, np.random.default_rng([seed, list(KINDS).index(kind), 1]))
    shot = simulate(scene, places, velocities, record=True)
    assert shot.events is not None
    found, times = shot.certain(), shot.events["time"]
    # The reference stops between the last certain event and the next one.
    until = None if found.outcome else float(times[[max(found.events - 1, 0), found.events]].mean())
    ours = [(str(e["kind"]), int(e["ball"]), int(e["other"])) for e in shot.events[: found.events]]
    contacts = [event for event in ours if event[0] in CONTACTS]
    theirs: list[Any] = []
    if contacts:
        try:
            exact = run(scene, places.tolist(), velocities.tolist(), max_time=until)
        except OracleError as stopped:
            exact = stopped.shot
        theirs = [tuple(event[1:]) for event in exact.events if event.kind in CONTACTS][: len(contacts)]
    return {
        "certain": bool(found.outcome),
        "contacts": int(np.isin(shot.events["kind"], CONTACTS).sum()),
        "certain_contacts": len(contacts),
        "false": contacts != theirs,
    }


def summary(shots: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Returns the number of shots, the sums of the numbers of `check`, and the median of the certain contacts."""
    total = {key: int(sum(shot[key] for shot in shots)) for key in shots[0]}
    return {"shots": len(shots), **total, "median": float(np.median([shot["certain_contacts"] for shot in shots]))}


def measure(shots: int, breaks: int, workers: int) -> dict[str, Any]:
    """Checks `shots` of each of `SHOTS` and `breaks` of each of `BREAKS`."""
    on, kinds = machine(), run_kinds(check, SHOTS, shots, workers) | run_kinds(check, BREAKS, breaks, workers)
    return {"machine": on, "kinds": {kind: summary(found) for kind, found in kinds.items()}}


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    columns = {
        "shots of a kind": "{kind}",
        "certain outcomes": "{certain:,} of {shots:,}",
        "certain contacts": "{share:.1%}",
        "certain contacts, median": "{median:.0f}",
        "false": "{false}",
    }
    kinds = result["kinds"].items()
    rows = [{"kind": kind, **s, "share": s["certain_contacts"] / s["contacts"]} for kind, s in kinds]
    return {"kinds": rows_table(columns, rows)}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.certain --help`."""
    options = {
        "shots": (2350, "shots of each kind without a break"),
        "breaks": (300, "breaks of each kind"),
        "workers": workers(),
    }
    about = "Check the certain outcomes against the reference."
    run_command("benchmarks.certain", about, arguments, measure, blocks, options)


if __name__ == "__main__":
    main()
