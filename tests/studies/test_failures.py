"""The failures of Warkari and Jamsandekar: the results of PIC and PIT."""

from typing import Any

import numpy as np
import pytest

from benchmarks.reference import oracle
from billiards_env.engine import PIC, Engine
from billiards_env.shots import simulation
from studies.failures import FAILURES, Failure, main
from tests.helpers.shots import kinds


def play(case: Failure, fix: str | None = None) -> Any:
    """Returns the recorded shot, by PIC without a fix and by PIT with one."""
    engine = PIC if fix is None else Engine("pit", case.dt, fix)
    return simulation.simulate(case.scene, case.positions, case.velocities, engine=engine, record=True)


def degrees_between(a: Any, b: Any) -> Any:
    """Returns the (n,) angles between the rows of (n, 2) arrays; 0 if both are zero."""
    return np.degrees(np.abs(np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=-1))))


@pytest.mark.parametrize("name", FAILURES)
def test_pic_agrees_with_the_reference(name):
    case = FAILURES[name]
    shot, true = play(case), oracle.reference_shot(case.scene, case.positions, case.velocities)
    assert kinds(shot) == [(e.kind, e.ball, e.other) for e in true.events]
    assert shot.events["time"] == pytest.approx([float(e.time) for e in true.events], abs=1e-14)
    assert shot.positions == pytest.approx(np.array(true.positions, dtype=float), abs=1e-13)
    assert shot.velocities == pytest.approx(np.array(true.velocities, dtype=float), abs=1e-12)


def test_pit_misses_the_collision():
    case = FAILURES["missed_collision"]
    shot = play(case, "push_apart")
    assert kinds(shot) == []
    assert shot.velocities.tolist() == [list(v) for v in case.velocities]


@pytest.mark.parametrize(("name", "wrong"), [("penetration", [30.51, 30.51]), ("wrong_bounce", [61.02, 0.0])])
def test_pit_uses_a_late_line_of_centres(name, wrong):
    shot, exact = play(FAILURES[name], "push_apart"), play(FAILURES[name])
    assert kinds(shot) == kinds(exact)
    assert shot.events["time"] == pytest.approx([0.2])
    assert degrees_between(shot.velocities, exact.velocities) == pytest.approx(wrong, abs=0.005)


def test_pit_misses_the_second_collision():
    case = FAILURES["multiple_collisions"]
    shot, exact = play(case, "push_apart"), play(case)
    assert kinds(shot) == [("ball_ball", 0, 1), ("cushion", 1, 1)]
    assert kinds(exact) == [*kinds(shot), ("ball_ball", 0, 1)]
    assert set(np.floor(exact.events["time"] / case.dt)) == {5.0}
    # In PIT ball 1 comes back instead of ball 0.
    assert exact.velocities[0, 0] < -1.5 < 0 < shot.velocities[0, 0]
    assert shot.velocities[1, 0] < -1.75 < -0.3 < exact.velocities[1, 0]


@pytest.mark.parametrize("name", ["penetration", "wrong_bounce"])
def test_a_fix_with_the_true_line_of_centres_has_the_right_velocities(name):
    shot, exact = play(FAILURES[name], "time_of_impact"), play(FAILURES[name])
    assert kinds(shot) == kinds(exact)
    assert shot.velocities == pytest.approx(exact.velocities, abs=1e-12)
    assert shot.positions == pytest.approx(exact.positions, abs=1e-13)


def test_the_command_draws_them_where_it_is_told(tmp_path):
    pytest.importorskip("matplotlib")
    main(["--output", str(tmp_path / "four.png")])
    assert (tmp_path / "four.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(SystemExit, match="expected a name that ends in"):
        main(["--output", "four.txt"])
