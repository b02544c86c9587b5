"""The error of PIT against its timestep: proportional to dt in single collisions, limited by chaos in a gas."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import save
from billiards_env.physics.state import FIXES
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.simulation import simulate_batch
from billiards_env.table import Table

Floats = NDArray[np.float64]

STEPS = [15 * 2**k for k in range(11)]
FIT_FROM = 240  # steps per second; coarser timesteps miss collisions
COUNT = 200
END = 0.5  # s, well after the collision
PIT_STYLES: dict[str, dict[str, Any]] = {
    "push_apart": {"marker": "o", "color": "#0072b2", "markersize": 6, "linewidth": 1.2},
    "move_back": {"marker": "s", "color": "#d55e00", "markersize": 4, "linewidth": 1.2},
    "none": {"marker": "^", "color": "#009e73", "markersize": 4, "linewidth": 1.2, "linestyle": "--"},
}
"""Plot styles of the fixes."""


def two_balls(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draws a ball that hits a resting ball after 0.05 to 0.2 s, at most 64 degrees off the line of centres."""
    reach = 2 * RADIUS
    angle, speed, off = rng.uniform(0, 2 * np.pi), rng.uniform(1, 2), rng.uniform(-0.9, 0.9) * reach
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    away = np.sqrt(reach**2 - off**2) + speed * rng.uniform(0.05, 0.2)
    return np.array([off * across - away * along, [0.0, 0.0]]), np.array([speed * along, [0.0, 0.0]])


def one_cushion(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draws a ball that hits the cushion at +x after about 0.05 to 0.2 s, at most 60 degrees off the normal."""
    angle, speed = rng.uniform(-np.pi / 3, np.pi / 3), rng.uniform(1, 2)
    velocity = speed * np.array([np.cos(angle), np.sin(angle)])
    return np.array([[2.0 - RADIUS - velocity[0] * rng.uniform(0.05, 0.2), 0.0]]), velocity[None]


RADIUS, MASS = 0.028575, 0.170097
_TABLE = Table(4.0, 4.0)
_IDEAL = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=END)
FAMILIES: dict[str, tuple[Scene, Callable[[np.random.Generator], tuple[Floats, Floats]]]] = {
    "elastic disks": (Scene(Balls((RADIUS,) * 2, (MASS,) * 2), _TABLE, _IDEAL), two_balls),
    "sliding balls": (Scene(Balls((RADIUS,) * 2, (MASS,) * 2), _TABLE), two_balls),
    "sliding ball, cushion": (Scene(Balls((RADIUS,), (MASS,)), _TABLE), one_cushion),
}


def order(errors: list[float]) -> float | None:
    """Returns the slope of log error over log dt; None if the errors are rounding errors."""
    fine = [k for k, steps in enumerate(STEPS) if steps >= FIT_FROM]
    if max(errors[k] for k in fine) < 1e-12:
        return None
    return float(np.polyfit([-np.log(STEPS[k]) for k in fine], [np.log(errors[k]) for k in fine], 1)[0])


def measure() -> dict[str, Any]:
    """Measures root-mean-square errors after one collision, of positions (m) and velocities (m/s), and their orders."""
    found = {}
    for family, (scene, draw) in FAMILIES.items():
        rng = np.random.default_rng(0)
        shots = [np.array(part) for part in zip(*(draw(rng) for _ in range(COUNT)), strict=True)]
        exact = simulate_batch(scene, *shots, max_time=END)
        found[family] = {}
        for fix in FIXES:
            runs = [simulate_batch(scene, *shots, max_time=END, mode="pit", dt=1 / s, fix=fix) for s in STEPS]
            places = [float(np.sqrt(((r.positions - exact.positions) ** 2).sum(-1).mean())) for r in runs]
            velocities = [float(np.sqrt(((r.velocities - exact.velocities) ** 2).sum(-1).mean())) for r in runs]
            found[family][fix] = {
                "error_m": places,
                "error_m_per_s": velocities,
                "order_of_places": order(places),
                "order_of_velocities": order(velocities),
            }
    return found


def draw(result: dict[str, Any], path: Path) -> None:
    """Draws the errors of a single collision with their slopes, and of the gas at several times, against dt."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 3.9), dpi=110, layout="constrained")
    first, second, third = figure.subplots(1, 3)
    dts = [1 / s for s in STEPS]
    for axes, key, what, unit in (
        (first, "error_m", "order_of_places", "error of the positions (m)"),
        (second, "error_m_per_s", "order_of_velocities", "error of the velocities (m/s)"),
    ):
        for fix, found in result["convergence"]["sliding balls"].items():
            slope = "rounding" if found[what] is None else f"order {found[what]:.2f}"
            axes.loglog(dts, found[key], **PIT_STYLES[fix], label=f"{fix}: {slope}")
        axes.set(xlabel="timestep (s)", ylabel=unit)
        axes.set_title("One collision of two sliding balls", fontsize=10)
    gas = result["scenes"]["gas of 16 disks"]["methods"]
    pit = [row for row in gas if row["fix"] == "push_apart"]
    pic = next(row for row in gas if row["method"] == "PIC")
    keys = [(k, k.split("_")[2]) for k in pic if k.startswith("median_error")]
    for (key, t), colour in zip(keys, ("#56b4e9", "#0072b2", "#009e73", "#e69f00", "#d55e00"), strict=True):
        label = f"after {'10' if t == 'end' else t.removesuffix('.0')} s"
        third.loglog(
            [1 / r["steps_per_second"] for r in pit],
            [r[key] for r in pit],
            "o-",
            color=colour,
            markersize=4,
            label=label,
        )
        third.plot(2.2e-5, pic[key], "*", color=colour, markersize=11, markeredgecolor="black", markeredgewidth=0.5)
    third.plot([], [], "*", color="white", markersize=11, markeredgecolor="black", markeredgewidth=0.5, label="PIC")
    third.set(xlabel="timestep (s); at the left end: PIC", ylabel="median error (m)")
    third.set_title("Gas of 16 disks, push_apart", fontsize=10)
    for axes in (first, second, third):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    save(figure, path)
