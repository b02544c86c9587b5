"""Measurements with long runs: drift, time reversal, numbers of collisions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.reference.stress import draw
from benchmarks.reference.stress.checks import DRIFT_X, DRIFT_Y, IMPACTS, MOMENTUM, OVERLAP, check_shots
from benchmarks.reference.stress.scenes import ideal
from billiards_env import derivatives
from billiards_env.derivatives.shot_derivatives import UNIT_ROUNDOFF
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate

LONG = 1e9  # s; longer than any run of an ideal gas here


def gas(n: int, length: float = 1.0, width: float = 1.0, radius: float = 0.03, masses: Any = None) -> Scene:
    """Returns a scene of n elastic disks without friction and elastic cushions."""
    masses = (0.17,) * n if masses is None else masses
    return ideal(*masses, radius=(radius,) * n, length=length, width=width, max_time=LONG)


def gas_state(scene: Scene, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns random positions and velocities, (n, 2) m and m/s."""
    places = draw.layouts(scene, rng, 1)
    assert places is not None
    return places[0], rng.normal(size=(scene.n_balls, 2))


def drift(n: int, collisions: int, seed: int = 0, chunk: int = 20_000) -> dict[str, Any]:
    """Returns the drift of the energy and momentum of an ideal gas after a number of ball-ball collisions.

    The momentum is the sum of the changes by collisions of balls, which should be zero.
    """
    rng = np.random.default_rng(seed)
    scene = {2: gas(2, 0.3, 0.25), 16: gas(16), 100: gas(100, 2.54, 1.27)}.get(n) or gas(n)
    places, velocities = gas_state(scene, rng)
    mass = np.array(scene.balls.mass)[:, None]
    energy = start = float((mass * velocities**2).sum() / 2)
    momentum, done, overlap, worst, events = np.zeros(2), 0, 0.0, 0.0, 0
    while done < collisions:
        r = check_shots(scene, places[None], velocities[None], max_events=chunk, log_rows=chunk + 64)
        places, velocities = r.shots.positions[0], r.shots.velocities[0]
        findings = r.findings[0]
        momentum += findings[[DRIFT_X, DRIFT_Y]]
        overlap, worst = max(overlap, float(findings[OVERLAP])), max(worst, float(findings[MOMENTUM]))
        done, events = done + int(findings[IMPACTS]), events + int(r.shots.n_events[0])
        energy = float((mass * velocities**2).sum() / 2)
    total = float((mass[:, 0] * np.hypot(*velocities.T)).sum())
    return {
        "disks": n,
        "collisions": done,
        "events": events,
        "energy_drift": abs(energy / start - 1),
        "momentum_drift": math.hypot(momentum[0], momentum[1]) / total,
        "momentum_of_one_collision": worst,
        "deepest_overlap_m": overlap,
    }


def reversal(seed: int) -> dict[str, float]:
    """Runs an ideal gas, reverses all velocities and runs it back.

    Returns:
        `error`, the largest error of a final position, m; `predicted`, the error that amplified roundoff predicts, m;
        and `collisions`, their number.
    """
    rng = np.random.default_rng(seed)
    scene = gas(16)
    places, velocities = gas_state(scene, rng)
    there = simulate(scene, places, velocities, max_time=1.0, record=True)
    back = simulate(scene, there.positions, -there.velocities, max_time=1.0, record=True)
    assert there.events is not None
    return {
        "error": float(np.abs(back.positions - places).max()),
        "predicted": UNIT_ROUNDOFF * derivatives.sensitivity(back).condition,
        "collisions": int((there.events["kind"] == "ball_ball").sum()),
    }


def blocks(k: int, wall: str = "cushion") -> int:
    """Returns the number of collisions of Galperin's blocks (2003, Playing pool with pi), which is floor(pi 10^k).

    A mass of 100^k hits a mass of 1 in front of a wall, which is a cushion or a ball of infinite mass.
    """
    radius, heavy = 0.03125, 1
    unit = 2.0**-20  # kg; a power of two is exact, and masses of 10^10 kg are outside `checks.RANGES`
    masses, x = (unit, unit * 100.0**k), [-31.5, -31.0]
    if wall == "ball":
        masses, x = (*masses, math.inf), [-0.5, 0.0, -1.0]
    scene = gas(len(masses), 64.0, 1.0, radius, masses)  # room to the right for slow last collisions
    velocities = np.zeros((len(x), 2))
    velocities[heavy, 0] = -1.0
    shot = simulate(
        scene, np.stack([x, np.zeros(len(x))], 1), velocities, max_time=1000.0, max_events=4_000_000, record=True
    )
    assert shot.events is not None
    kinds, ball, other = shot.events["kind"], shot.events["ball"], shot.events["other"]
    far = np.flatnonzero((kinds == "cushion") & (other == 1))  # the events after the collisions at the wall
    end = int(far[0]) if len(far) else len(kinds)
    near = (kinds == "ball_ball") | ((kinds == "cushion") & (other == 0) & (ball == 0))
    return int(near[:end].sum())
