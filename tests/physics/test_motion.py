import math

import numpy as np
import pytest

from billiards_env.engine.compile import scene_arrays
from billiards_env.physics.elementary import norm
from billiards_env.physics.laws.cloth import spin_after
from billiards_env.physics.motion import advance, begin_phase, end_phase, motion_after
from billiards_env.physics.state import (
    AX,
    AY,
    FREE,
    LASTS,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    SPINNING,
    T0,
    T0_LO,
    UX,
    UY,
    VX,
    VY,
    WZ,
    State,
    Time,
    X,
    Y,
    empty_state,
    later,
    own_time,
    since,
    two_sum,
)
from billiards_env.scene import Balls, Physics, Scene

SLIDE, ROLL = 0.2 * 9.81, 0.01 * 9.81


def numbers(**physics):
    if physics.get("motion", "sliding") != "sliding":
        physics |= {"cushion": "restitution", "max_time": 1.0}
    return scene_arrays(Scene(Balls.uniform(1), physics=Physics(**physics))).numbers


def ball(constants, **columns):
    """Returns the state of one ball at the start of its phase, and its row."""
    index = {"x": X, "y": Y, "vx": VX, "vy": VY, "ux": UX, "uy": UY, "wz": WZ}
    state = empty_state(1)
    state.rows[:], state.phase[:] = 0.0, REST
    for name, value in columns.items():
        state.rows[0, index[name]] = value
    begin_phase(state, 0, constants)
    return state, state.rows[0]


def finish(state, constants):
    """Ends the phase of the ball and starts the next."""
    end_phase(state, 0, later(own_time(state, 0), state.rows[0, LASTS]), constants)
    begin_phase(state, 0, constants)


@pytest.mark.parametrize(
    ("x", "y", "size"), [(3.0, -4.0, 5.0), (0.0, 0.0, 0.0), (0.0, -2.0, 2.0), (3e-200, 4e-200, 5e-200)]
)
def test_norm_is_correct_if_squares_underflow(x, y, size):
    assert norm(x, y) == pytest.approx(size, rel=1e-15)


@pytest.mark.parametrize(
    ("motion", "columns", "phase", "acceleration", "lasts"),
    [
        ("sliding", {"vx": 1, "vy": 2, "ux": 3, "uy": -4}, SLIDING, (-SLIDE * 0.6, SLIDE * 0.8), 10 / (7 * SLIDE)),
        ("sliding", {"ux": 1}, SLIDING, (-SLIDE, 0), 2 / (7 * SLIDE)),
        ("sliding", {"vx": 0.3, "vy": -0.4, "wz": 1}, ROLLING, (-ROLL * 0.6, ROLL * 0.8), 0.5 / ROLL),
        ("sliding", {"wz": -20}, SPINNING, (0, 0), 2),
        ("sliding", {}, REST, (0, 0), math.inf),
        ("rolling", {"vx": 1, "ux": 1}, ROLLING, (-ROLL, 0), 1 / ROLL),
        ("ideal", {"vx": 1}, FREE, (0, 0), math.inf),
        ("ideal", {}, REST, (0, 0), math.inf),
    ],
)
def test_velocity_slip_and_spin_begin_a_phase(motion, columns, phase, acceleration, lasts):
    state, row = ball(numbers(motion=motion), **columns)
    assert state.phase[0] == phase
    assert row[[AX, AY]] == pytest.approx(acceleration, abs=0)
    assert row[LASTS] == pytest.approx(lasts)


def test_a_potted_ball_does_not_change():
    state = empty_state(1)
    state.rows[:], state.phase[:] = 1.0, POTTED
    begin_phase(state, 0, numbers())
    assert state.phase[0] == POTTED
    assert (state.rows == 1).all()
    assert motion_after(state, 0, 5.0) == (1.0, 1.0, 0.0, 0.0)


def test_several_advances_equal_one():
    constants = numbers()
    state, one = ball(constants, x=0.1, vx=1.0, vy=2.0, ux=3.0, uy=-4.0, wz=5.0)
    stepped = State(state.rows.copy(), state.phase)
    advance(state, 0, Time(0.3, 0.0), constants)
    for t in (0.1, 0.2, 0.3):
        advance(stepped, 0, Time(t, 0.0), constants)
    assert one == pytest.approx(stepped.rows[0], rel=1e-14)
    assert one[[UX, UY]] == pytest.approx([3 - 3.5 * SLIDE * 0.6 * 0.3, -4 + 3.5 * SLIDE * 0.8 * 0.3])
    assert one[X] == pytest.approx(0.1 + 0.3 - 0.5 * SLIDE * 0.6 * 0.09)
    assert one[WZ] == pytest.approx(5 - 10 * 0.3)
    assert one[T0] == 0.3
    assert one[LASTS] == pytest.approx(10 / (7 * SLIDE) - 0.3)


def test_after_sliding_a_ball_rolls_exactly():
    constants = numbers()
    state, row = ball(constants, vx=1.0, vy=0.5, ux=1.0, uy=0.5)
    finish(state, constants)
    assert state.phase[0] == ROLLING
    assert (row[UX], row[UY]) == (0.0, 0.0)
    assert row[[VX, VY]] == pytest.approx([5 / 7, 5 / 14])


def test_after_rolling_a_ball_rests_or_spins_exactly():
    constants = numbers()
    for spin, after in ((0.0, REST), (1e4, SPINNING)):
        state, row = ball(constants, vx=1.0, vy=0.5, wz=spin)
        finish(state, constants)
        assert state.phase[0] == after
        assert (row[VX], row[VY]) == (0.0, 0.0)
        assert row[[X, Y]] == pytest.approx(np.array([1.0, 0.5]) * math.sqrt(1.25) / (2 * ROLL))
    finish(state, constants)
    assert state.phase[0] == REST
    assert row[WZ] == 0.0


@pytest.mark.parametrize(("wz", "t", "after"), [(5.0, 0.2, 3.0), (-5.0, 0.2, -3.0), (5.0, 0.5, 0.0), (-5.0, 9.0, 0.0)])
def test_spin_decays_to_zero(wz, t, after):
    assert spin_after(wz, t, numbers()) == pytest.approx(after)


def test_times_are_sums_of_two_doubles():
    assert two_sum(1.0, 1e-20) == (1.0, 1e-20)
    assert two_sum(1e-20, 1.0) == (1.0, 1e-20)
    time = later(later(Time(10.0, 0.0), 1e-17), 3e-17)
    assert time == (10.0, 4e-17)
    assert since(time, Time(10.0, 1e-17)) == pytest.approx(3e-17, rel=1e-15)
    assert since(time, Time(9.5, 0.0)) == 0.5


def test_the_second_part_of_a_time_changes_the_position():
    constants = numbers(motion="ideal")
    state, row = ball(constants, vx=1.0)
    row[T0], row[T0_LO] = 10.0, -1e-17
    advance(state, 0, Time(10.0, 2e-17), constants)
    assert row[X] == pytest.approx(3e-17, rel=1e-15)
