"""The failures of Warkari and Jamsandekar: the results of PIC and PIT."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from billiards_env.engine import PIC, Engine
from billiards_env.engine.overlaps import FIXES
from billiards_env.shots import simulation
from reference import oracle
from studies.failures import FAILURES, Failure

cases = pytest.mark.parametrize("name", FAILURES)
fixes = pytest.mark.parametrize("fix", FIXES)
late_fixes = pytest.mark.parametrize("fix", ["push_apart", "none"])


def play(case: Failure, fix: str | None = None, dt: float | None = None, ahead: float = 0.0) -> Any:
    """Returns the recorded shot, by PIC without a fix and by PIT with one; it starts `ahead` s later on the paths."""
    places = np.array(case.positions) + ahead * np.array(case.velocities)
    engine = PIC if fix is None else Engine("pit", case.dt if dt is None else dt, fix)
    return simulation.simulate(case.scene, places, case.velocities, engine=engine, record=True)


def hits(shot: Any) -> list[tuple[str, int, int]]:
    return [(str(e["kind"]), int(e["ball"]), int(e["other"])) for e in shot.events]


def degrees_between(a: Any, b: Any) -> Any:
    """Returns the (n,) angles between the rows of (n, 2) arrays; 0 if both are zero."""
    return np.degrees(np.abs(np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=-1))))


def velocities_after_impact(case: Failure, normal: Any) -> Any:
    """Returns the (2, 2) velocities after an elastic impact along a normal; masses are equal, or ball 1 is fixed."""
    u, n = np.array(case.velocities), np.array(normal) / math.hypot(*normal)
    closing = (u[0] - u[1]) @ n
    if math.isinf(case.scene.balls.mass[1]):
        return u - np.array([2 * closing * n, [0.0, 0.0]])
    return u + closing * np.array([-n, n])


def line_of_centres(case: Failure, t: float) -> Any:
    """Returns the vector from ball 0 to ball 1 at time t if no collision happens before."""
    a, b = np.array(case.positions) + t * np.array(case.velocities)
    return b - a


# PIC


@cases
def test_pic_agrees_with_the_reference(name):
    case = FAILURES[name]
    shot, true = play(case), oracle.run(case.scene, case.positions, case.velocities)
    assert hits(shot) == [(e.kind, e.ball, e.other) for e in true.events]
    assert shot.events["time"] == pytest.approx([float(e.time) for e in true.events], abs=1e-14)
    assert shot.positions == pytest.approx(np.array(true.positions, dtype=float), abs=1e-13)
    assert shot.velocities == pytest.approx(np.array(true.velocities, dtype=float), abs=1e-12)


@pytest.mark.parametrize(
    ("name", "times", "velocities"),
    [
        ("missed_collision", [0.088], [[0.0, 3.0], [4.0, 0.0]]),
        ("penetration", [0.1835], [[0.72, -0.96], [1.28, 0.96]]),
        ("wrong_bounce", [0.1835], [[-0.56, -1.92], [0.0, 0.0]]),
    ],
)
def test_pic_agrees_with_hand_calculation(name, times, velocities):
    shot = play(FAILURES[name])
    assert shot.events["time"] == pytest.approx(times, abs=1e-15)
    assert shot.velocities == pytest.approx(np.array(velocities), abs=1e-14)
    normal = line_of_centres(FAILURES[name], times[0])
    assert math.hypot(*normal) == pytest.approx(0.06, abs=1e-15)
    assert velocities_after_impact(FAILURES[name], normal) == pytest.approx(np.array(velocities), abs=1e-14)


def test_pic_finds_all_three_collisions_within_one_timestep():
    case = FAILURES["multiple_collisions"]
    shot = play(case)
    assert hits(shot) == [("ball_ball", 0, 1), ("cushion", 1, 1), ("ball_ball", 0, 1)]
    assert set(np.floor(shot.events["time"] / case.dt)) == {5.0}
    assert shot.velocities[0, 0] < -1.5 < -0.5 < shot.velocities[1, 0] < 0


# PIT at the failure's dt


@fixes
def test_pit_misses_the_collision(fix):
    case = FAILURES["missed_collision"]
    shot = play(case, fix)
    assert hits(shot) == []
    assert shot.first_hit == -1
    assert shot.velocities.tolist() == [list(v) for v in case.velocities]
    straight = np.array(case.positions) + case.scene.physics.max_time * np.array(case.velocities)
    assert shot.positions == pytest.approx(straight, abs=1e-15)
    # The balls overlap only between two timesteps.
    instants = np.arange(0, 6) * case.dt
    assert min(math.hypot(*line_of_centres(case, t)) for t in instants) > 0.06 * 1.5
    assert math.hypot(*line_of_centres(case, 0.1)) < 1e-15


@late_fixes
@pytest.mark.parametrize(("name", "wrong"), [("penetration", [30.51, 30.51]), ("wrong_bounce", [61.02, 0.0])])
def test_pit_uses_a_late_line_of_centres(name, wrong, fix):
    case = FAILURES[name]
    shot = play(case, fix)
    assert hits(shot) == hits(play(case))
    [hit] = shot.events
    assert hit["time"] == pytest.approx(0.2)
    late = line_of_centres(case, 0.2)
    assert late == pytest.approx([0.015, 0.036])
    assert shot.velocities == pytest.approx(velocities_after_impact(case, late), abs=1e-14)
    # The angle between the true line, along (4, 3), and the late one, along (5, 12); a bounce doubles it.
    turned = math.degrees(math.atan2(12, 5) - math.atan2(3, 4)) * (2 if name == "wrong_bounce" else 1)
    assert degrees_between(shot.velocities, play(case).velocities)[0] == pytest.approx(turned, abs=1e-12)
    assert degrees_between(shot.velocities, play(case).velocities) == pytest.approx(wrong, abs=0.005)


@pytest.mark.parametrize("fix", ["move_back", "time_of_impact"])
@pytest.mark.parametrize("name", ["penetration", "wrong_bounce"])
def test_a_fix_with_the_true_line_of_centres_has_the_right_velocities(name, fix):
    case = FAILURES[name]
    shot, exact = play(case, fix), play(case)
    assert hits(shot) == hits(exact)
    assert shot.velocities == pytest.approx(exact.velocities, abs=1e-12)
    lag = 0.2 - exact.events["time"][0] if fix == "move_back" else 0.0  # the balls move on from the timestep
    assert shot.positions == pytest.approx(exact.positions - lag * exact.velocities, abs=1e-13)


@fixes
def test_pit_misses_the_second_collision(fix):
    case = FAILURES["multiple_collisions"]
    shot, exact = play(case, fix), play(case)
    assert hits(shot) == [("ball_ball", 0, 1), ("cushion", 1, 1)]
    assert shot.events["time"][0] == pytest.approx(0.24)
    if fix in ("push_apart", "none"):
        assert shot.velocities == pytest.approx(np.array([[0.2, -0.6], [-1.8, 0.6]]), abs=1e-13)
    # In PIT ball 1 comes back instead of ball 0.
    assert exact.velocities[0, 0] < -1.5 < 0 < shot.velocities[0, 0] < 0.25
    assert shot.velocities[1, 0] < -1.75 < -0.3 < exact.velocities[1, 0]
    assert (degrees_between(shot.velocities, exact.velocities) > 50).all()


@cases
@fixes
def test_failures_do_not_depend_on_rounding(name, fix):
    case = FAILURES[name]
    for ahead in (-1e-4, 1e-4):
        for dt in (case.dt * (1 - 1e-4), case.dt * (1 + 1e-4)):
            assert hits(play(case, fix, dt, ahead)) == hits(play(case, fix))
