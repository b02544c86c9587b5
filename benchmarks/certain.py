"""Checks which outcomes are certain (`ShotResult.certain`) against the 50-digit reference.

A certain event is false if the contacts up to it are not those of the reference, in the same order.

    python -m benchmarks.certain              # 1,700 shots of each kind
    python -m benchmarks.certain --shots 20
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks import Count, machine, machine_line, parser_of, report, run_kinds, table, workers
from benchmarks.error_limit import KINDS
from billiards_env.shots.simulation import simulate
from reference.oracle import OracleError, run

CHECKED = (
    "1 object ball",
    "5 object balls",
    "carom",
    "9-ball break, loose",
    "15-ball break, loose",
    "real pool, 5 object balls",
)
CONTACTS = ("ball_ball", "cushion", "pocket")


def check(kind: str, seed: int) -> dict[str, Any]:
    """Runs a shot of one of `CHECKED` by the engine, and its certain events by the reference.

    Returns:
        certain (whether the outcome is), contacts and certain_contacts (their numbers), and false (whether the certain
        contacts are not those of the reference).
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


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = []
    for kind, shots in result["kinds"].items():
        total = {key: sum(shot[key] for shot in shots) for key in shots[0]}
        outcomes, contacts = total["certain"] / len(shots), total["certain_contacts"] / max(total["contacts"], 1)
        median = np.median([shot["certain_contacts"] for shot in shots])
        false = f"{total['false']} of {len(shots):,}"
        rows.append((kind, f"{outcomes:.1%}", f"{contacts:.1%}", f"{median:.0f}", false))
    head = ("shots of a kind", "certain outcomes", "certain contacts", "certain contacts, median", "shots with a false one")
    return {"machine": machine_line(result["machine"]), "kinds": table(head, rows)}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.certain --help`."""
    description, shots = "Check the certain outcomes against the reference.", Count(1700, "shots of each kind")
    args = parser_of("certain", description, shots=shots, workers=workers()).parse_args(arguments)
    on = machine()
    report({"machine": on, "kinds": run_kinds(check, CHECKED, args.shots, args.workers)}, blocks, args.output)


if __name__ == "__main__":
    main()
