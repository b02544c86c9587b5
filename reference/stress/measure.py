"""Measurements with long runs: drift, time reversal, numbers of collisions, chaos."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env import layouts
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.sensitivity import UNIT_ROUNDOFF
from billiards_env.simulation import simulate
from billiards_env.table import Table
from reference import oracle
from reference.stress import draw
from reference.stress.checks import DRIFT_X, DRIFT_Y, IMPACTS, MOMENTUM, OVERLAP, check_shots

LONG = 1e9  # s; longer than any run of an ideal gas here


def gas(n: int, length: float = 1.0, width: float = 1.0, radius: float = 0.03, masses: Any = None) -> Scene:
    """Returns a scene of n elastic disks without friction and elastic cushions."""
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=LONG)
    mass = (0.17,) * n if masses is None else tuple(masses)
    return Scene(Balls((radius,) * n, mass), Table(length, width), physics)


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
        places, velocities = r.positions[0], r.velocities[0]
        found = r.found[0]
        momentum += found[[DRIFT_X, DRIFT_Y]]
        overlap, worst = max(overlap, float(found[OVERLAP])), max(worst, float(found[MOMENTUM]))
        done, events = done + int(found[IMPACTS]), events + int(r.n_events[0])
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


def reversal(seed: int, time: float = 1.0, n: int = 16) -> dict[str, float]:
    """Runs an ideal gas, reverses all velocities and runs it back.

    Returns:
        `error`, the largest error of a final position, m; `predicted`, the error that amplified roundoff predicts, m;
        and `collisions`, their number.
    """
    rng = np.random.default_rng(seed)
    scene = gas(n)
    places, velocities = gas_state(scene, rng)
    there = simulate(scene, places, velocities, max_time=time, record=True)
    back = simulate(scene, there.positions, -there.velocities, max_time=time, record=True)
    assert there.events is not None
    return {
        "error": float(np.abs(back.positions - places).max()),
        "predicted": UNIT_ROUNDOFF * back.sensitivity().condition,
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


def lyapunov(seed: int, n: int = 16, spans: int = 60, span: float = 0.1, size: float = 1e-8) -> dict[str, float]:
    """Returns the largest Lyapunov exponent of an ideal gas, 1/s, from two trajectories and from the sensitivity.

    Two trajectories: a small separation grows for a span of time and is scaled back repeatedly (Benettin, Galgani and
    Strelcyn 1976). Sensitivity: the slope of the logarithm of the norm of the positions' derivative.
    """
    rng = np.random.default_rng(seed)
    scene = gas(n)
    places, velocities = gas_state(scene, rng)
    settle = 20 * span
    first = simulate(scene, places, velocities, max_time=settle)
    places, velocities = first.positions, first.velocities
    shift = rng.normal(size=(2, n, 2))
    for _ in range(10):  # overlapping positions are drawn again
        shift *= size / np.sqrt((shift**2).sum())
        try:
            simulate(scene, places + shift[0], velocities + shift[1], max_time=0.0)
            break
        except ValueError:
            shift = rng.normal(size=(2, n, 2))
    total, begin = 0.0, (places, velocities)
    for _ in range(spans):
        a = simulate(scene, places, velocities, max_time=span)
        b = simulate(scene, places + shift[0], velocities + shift[1], max_time=span)
        shift = np.stack([b.positions - a.positions, b.velocities - a.velocities])
        growth = np.sqrt((shift**2).sum()) / size
        total += math.log(growth)
        shift /= growth
        places, velocities = a.positions, a.velocities
    shot = simulate(scene, *begin, max_time=spans * span, record=True)
    assert shot.events is not None
    early, late = (np.linalg.norm(s.jacobian) for s in shot.sensitivities([10 * span, spans * span]))
    collisions = int((shot.events["kind"] == "ball_ball").sum())
    return {
        "two_trajectories": total / (spans * span),
        "sensitivity": float(math.log(late / early) / ((spans - 10) * span)),
        "collisions_per_second": collisions / (spans * span),
    }


def predictability(
    scene: Scene, places: NDArray[np.float64], velocities: NDArray[np.float64], collisions: int, digits: int = 50
) -> dict[str, Any]:
    """Returns the growth of the error of a shot: the engine against the 50-digit simulator.

    Returns:
        `errors`, the largest error of a position at each ball-ball collision up to the first difference of the event
        sequences, m; `predicted`, the errors that amplified roundoff predicts, up to the first event at which the shot
        does not depend smoothly on its start, m; `agree`, the number of ball-ball collisions up to the first
        difference; and `all`, the number of all.
    """
    try:
        exact = oracle.run(scene, places, velocities, stop_after=collisions, digits=digits, max_time=LONG)
    except oracle.OracleError as error:  # balls press against each other
        exact = error.shot
    limit = float(exact.time) if scene.physics.motion == "ideal" else None
    shot = simulate(scene, places, velocities, max_time=limit, record=True)
    assert shot.events is not None
    errors, times = [], []
    total = sum(event.kind == "ball_ball" for event in exact.events)
    for mine, event in zip(shot.events, exact.events, strict=False):
        if (str(mine["kind"]), int(mine["ball"]), int(mine["other"])) != (event.kind, event.ball, event.other):
            break
        if event.kind == "ball_ball":
            times.append(float(event.time))
            reference = np.array([[float(x) for x in p] for p in exact.positions_at(event.time)])
            errors.append(float(np.abs(shot.at(times[-1]) - reference).max()))
    hits = shot.events["time"][shot.events["kind"] == "ball_ball"]
    predicted = [UNIT_ROUNDOFF * s.condition for s in shot.sensitivities(hits) if s.smooth]
    return {"errors": errors, "predicted": predicted, "agree": len(errors), "all": total}


def break_shot(kind: str, seed: int, balls: int = 15) -> tuple[Scene, NDArray[np.float64], NDArray[np.float64]]:
    """Returns a break: the pool scene, positions (n, 2) of a "rack" or "tight_rack", and velocities (n, 2)."""
    rng = np.random.default_rng(seed)
    scene = Scene.named("pool", balls)
    places = layouts.draw(kind, scene, rng)
    aim = places[1] - places[0] + [0.0, rng.uniform(-0.01, 0.01)]
    velocities = np.zeros_like(places)
    velocities[0] = rng.uniform(5, 11) * aim / np.hypot(*aim)
    return scene, places, velocities


def closed_pool_break(seed: int) -> tuple[Scene, NDArray[np.float64], NDArray[np.float64]]:
    """Returns a 15-ball break of a loose rack on a table without pockets."""
    scene, places, velocities = break_shot("rack", seed)
    return dataclasses.replace(scene, table=dataclasses.replace(scene.table, pockets=())), places, velocities
