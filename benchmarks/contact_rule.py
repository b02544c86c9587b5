"""The effect of the contact-time rule on breaks: `python -m benchmarks.contact_rule`.

The contact time of the rule is a model parameter. Breaks are run with several values of it, and the final position of
each ball is compared with that of the default value. For comparison, the table also shows the change after the cue ball
is moved by a distance too small to measure. The change of a shot is the largest change of a ball. A ball that is potted
in either run is not counted.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import RESULTS, check_counts, machine, machine_line, print_blocks, table
from benchmarks.speed import Case, breaks
from billiards_env.engine import pic
from billiards_env.engine.contact_rule import CONTACT_TIME, set_rule
from billiards_env.engine.inputs import check_shot
from billiards_env.engine.log import NO_LOG
from billiards_env.engine.modes import MAX_EVENTS, scene_arrays
from billiards_env.engine.shots import empty_shots
from billiards_env.engine.threads import spread
from billiards_env.files import write_json

FACTORS = (0.25, 0.5, 2.0, 5.0)
MOVES = (1e-12, 1e-8)
SHOTS = 2000


class Ends(NamedTuple):
    """Results of m shots with n balls: positions (m, n, 2) m and potted (m, n) bool."""

    positions: NDArray[np.float64]
    potted: NDArray[np.bool_]


def run(case: Case, contact_time: float = CONTACT_TIME, moved: float = 0.0) -> Ends:
    """Runs a case's shots with a contact time in s, the cue ball moved by `moved` m along y."""
    positions = case.positions.copy()
    positions[:, 0, 1] += moved
    shots = empty_shots(*positions.shape[:2])
    given = check_shot(case.scene, positions, case.velocities, None, None, None, shots)
    arrays = scene_arrays(case.scene)
    params = arrays.params.copy()
    set_rule(params, case.scene.balls.mass, contact_time)
    scene = tuple(arrays._replace(params=params))
    spread(
        lambda begin, end: pic.run_shots(begin, end, scene, given.limit, MAX_EVENTS, tuple(shots), NO_LOG),
        len(positions),
    )
    return Ends(shots.positions, ~shots.in_play)


def difference(usual: Ends, other: Ends) -> dict[str, float]:
    """Returns the median and 99th percentile of the change, m, and the shares of equal ends and changed potted sets."""
    both = ~(usual.potted | other.potted)
    distances = np.hypot(*np.moveaxis(other.positions - usual.positions, -1, 0))
    change = np.where(both, distances, 0.0).max(axis=1)
    return {
        "median": float(np.median(change)),
        "percentile_99": float(np.quantile(change, 0.99)),
        "unchanged": float(((change == 0) & (usual.potted == other.potted).all(axis=1)).mean()),
        "potted_sets_changed": float((usual.potted != other.potted).any(axis=1).mean()),
    }


def measure(shots: int) -> dict[str, Any]:
    """Runs `shots` breaks of each kind with each contact time and each move of the cue ball."""
    kinds = {}
    for name, rack in (("loose rack", "rack"), ("tight rack", "tight_rack")):
        case = breaks(name, "pool", rack, shots)
        usual = run(case)
        kinds[name] = {
            "contact_time": {str(f): difference(usual, run(case, f * CONTACT_TIME)) for f in FACTORS},
            "moved": {str(m): difference(usual, run(case, moved=m)) for m in MOVES},
        }
    return {"machine": machine(), "shots": shots, "contact_time": CONTACT_TIME, "kinds": kinds}


def _length(metres: float) -> str:
    for unit, size in (("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6), ("nm", 1e-9)):
        if metres >= size:
            return f"{metres / size:.2g} {unit}"
    return f"{metres:.1g} m" if metres else "0"


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    head = ("15-ball break", "what differs", "median", "99th percentile", "same end", "other balls potted")
    rows = []
    for name, kind in result["kinds"].items():
        changes = [
            *(
                (f"contact time {1e3 * result['contact_time'] * float(f):g} ms", d)
                for f, d in kind["contact_time"].items()
            ),
            *((f"cue ball moved {_length(float(m))}", d) for m, d in kind["moved"].items()),
        ]
        rows += [
            (
                name,
                what,
                _length(d["median"]),
                _length(d["percentile_99"]),
                f"{d['unchanged']:.1%}",
                f"{d['potted_sets_changed']:.2%}",
            )
            for what, d in changes
        ]
    return {"machine": machine_line(result["machine"]), "table": table(head, rows, left=2)}


def main(argv: list[str] | None = None) -> int:
    """Measures, prints the table and writes `benchmarks/results/contact_rule.json`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shots", type=int, default=SHOTS, help="breaks of each kind (%(default)s)")
    parser.add_argument("--output", type=Path, default=RESULTS / "contact_rule.json", help="where the JSON goes")
    arguments = parser.parse_args(argv)
    check_counts(parser, arguments, shots=1)
    result = measure(arguments.shots)
    print_blocks(blocks(result))
    write_json(arguments.output, result)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
