"""The laws of the package compared with measurements: `python -m benchmarks.validation`.

It runs balls on the cloth, impacts, strikes, banks and paths into pockets as in published measurements, prints tables,
writes `benchmarks/results/validation.json` and draws the picture of docs/validation.md. The sources are next to the
numbers in `motion`, `collisions`, `cushions`, `pockets` and `pooltool`.
"""

from __future__ import annotations

from typing import Any

from benchmarks.validation import collisions, cushions, motion, pockets, pooltool
from billiards_env.commands import Job

PARTS = {"motion": motion, "collisions": collisions, "cushions": cushions, "pockets": pockets, "pooltool": pooltool}


def measure(job: Job) -> dict[str, Any]:
    """Returns the results of all parts. Each part is a job."""
    result = {}
    for name, part in PARTS.items():
        with job(name):
            result[name] = part.measure()
    return result


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    return {name: text for key in result for name, text in PARTS[key].blocks(result[key]).items()}
