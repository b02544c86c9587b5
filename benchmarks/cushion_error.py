"""The error of impacts on `"mathavan2010"` cushions: `python -m benchmarks.cushion_error`.

The law and the 50-digit reference compute random impacts of several kinds, most with the numbers of the scene
"snooker". The command divides the largest error of the velocities, and of the spins times the radius, by the normal
velocity before the impact, and also by the unavoidable error. This is the error of an exact law whose input is rounded
to double precision. The reference has no result if both contacts have no slip at one instant.

    python -m benchmarks.cushion_error               # 200 impacts of each kind
    python -m benchmarks.cushion_error --impacts 20
"""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from benchmarks import machine, rows_table, run_command, run_kinds, workers
from benchmarks.reference.oracle import mathavan as reference
from billiards_env.commands import Job
from billiards_env.derivatives import rules as _rules  # noqa: F401  (the derivatives of iterations)
from billiards_env.derivatives.shot_derivatives import UNIT_ROUNDOFF
from billiards_env.derivatives.tangent import tangent_of
from billiards_env.physics.laws.mathavan import CushionNose, follow_impact

KINDS = (
    "rolling",
    "almost rolling",
    "stun",
    "spin",
    "heavy spin",
    "grazing",
    "slip almost stops",
    "slip begins",
    "slip creeps",
    "other numbers",
)
CREEPS = (-0.5459130408019652, 1.308226205794522, 0.0, 0.0, -0.1063503967833219)
"""An impact whose slip at the nose almost stops, and begins again."""
_D_IMPACT = tangent_of(follow_impact, constant=("nose", "e"))


def draw(kind: str, rng: np.random.Generator) -> tuple[tuple[float, ...], CushionNose, float]:
    """Draws the motion (vx, vy, rwx, rwy, rwz) before an impact of one of `KINDS`, the nose and the restitution."""
    sin, mu, mu_cloth, e = 0.4, 0.14, 0.212, rng.uniform(0.6, 0.995)
    angle = rng.uniform(1.5, 1.5707) if kind == "grazing" else rng.uniform(-1.5, 1.5)
    speed = 0.05 + 1.5 * abs(rng.normal())
    vx, vy = speed * math.sin(angle), speed * math.cos(angle)
    rwx, rwy, rwz = rng.normal(size=3) * (8.0 if kind == "heavy spin" else 0.8)
    small = vy * 10.0 ** -rng.uniform(1.0, 12.0) * rng.normal(size=2)
    match kind:
        case "rolling":
            rwx, rwy = -vy, vx
        case "almost rolling":
            rwx, rwy = small[0] - vy, small[1] + vx
        case "stun":
            rwx = rwy = 0.0
        case "slip almost stops":
            vx, rwx, rwy = 0.2 * vx, 0.0, 0.0
            rwz = (vx - small[0]) / math.sqrt(1.0 - sin * sin)
        case "slip begins":
            rwx = vy * sin + small[0]
            rwz = (vx + rwy * sin - small[1]) / math.sqrt(1.0 - sin * sin)
        case "slip creeps":
            vx, vy, rwx, rwy, rwz = speed * (np.array(CREEPS) + small[0] / vy * rng.normal(size=5))
        case "other numbers":
            sin, mu, mu_cloth = rng.uniform((0.1, 0.02, 0.05), (0.6, 0.9, 0.9))
    before = tuple(float(x) for x in (vx, vy, rwx, rwy, rwz))
    return before, CushionNose(float(sin), math.sqrt(1.0 - sin * sin), float(mu), float(mu_cloth)), float(e)


def unavoidable(before: tuple[float, ...], nose: CushionNose, e: float) -> float:
    """Returns the largest error of the motion after an impact if each number of the motion before it is rounded."""
    change: NDArray[np.float64] = np.zeros(5)
    for one in np.eye(5):
        (_, (after, _, _)) = _D_IMPACT(before, nose, e, tuple((one * before).tolist()))
        change += np.abs(after)
    return UNIT_ROUNDOFF * float(change.max())


def compare(kind: str, seed: int) -> dict[str, float | bool]:
    """Returns the error of an impact over the normal velocity and over the unavoidable error."""
    before, nose, e = draw(kind, np.random.default_rng([seed, KINDS.index(kind)]))
    after, _, steps = follow_impact(before, nose, e)
    with mpmath.workdps(50):
        numbers = reference.Nose(*map(mpmath.mpf, nose))
        try:
            exact = reference.impact([mpmath.mpf(x) for x in before], numbers, mpmath.mpf(e))
        except ValueError:
            return {"compared": False}
        error = max(float(abs(x - y)) for x, y in zip(after, exact, strict=True))
    return {"compared": True, "error": error / before[1], "ratio": error / unavoidable(before, nose, e), "steps": steps}


def measure(impacts: int, workers: int, job: Job) -> dict[str, Any]:
    """Compares `impacts` of each of `KINDS`."""
    on, rows = machine(), []
    for kind, results in run_kinds(compare, KINDS, impacts, workers, job).items():
        compared = [row for row in results if row["compared"]]
        row: dict[str, Any] = {"kind": kind, "impacts": len(results), "compared": len(compared)}
        for name in ("error", "ratio", "steps"):
            median, most, largest = np.quantile([r[name] for r in compared], (0.5, 0.99, 1.0)).tolist()
            row |= {f"{name}_median": median, f"{name}_99": most, f"{name}_largest": largest}
        rows.append(row)
    return {"machine": on, "kinds": rows}


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    columns = {
        "impacts": "{kind}",
        "compared": "{compared} of {impacts}",
        "error": "{error_median:.1e}",
        "99%": "{error_99:.1e}",
        "largest": "{error_largest:.1e}",
        "ratio": "{ratio_median:.1f}",
        "99% ": "{ratio_99:.1f}",
        "largest ": "{ratio_largest:.1f}",
        "most steps": "{steps_largest:.0f}",
    }
    return {"kinds": rows_table(columns, result["kinds"])}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.cushion_error --help`."""
    about = "Compare impacts on the cushion mathavan2010 with the 50-digit reference."
    options = {"impacts": (200, "impacts of each kind"), "workers": workers()}
    run_command("benchmarks.cushion_error", about, arguments, measure, blocks, options, jobs=True)


if __name__ == "__main__":
    main()
