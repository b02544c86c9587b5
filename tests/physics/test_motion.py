import math

import numpy as np
import pytest

from billiards_env.engine.modes import scene_arrays
from billiards_env.physics.motion import finish, move, norm, place, spin_after, start
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
    WIDTH,
    WZ,
    X,
    Y,
    later,
    since,
    two_sum,
)
from billiards_env.scene import Balls, Physics, Scene

SLIDE, ROLL = 0.2 * 9.81, 0.01 * 9.81


def params(**physics):
    if physics.get("motion", "sliding") != "sliding":
        physics |= {"cushion": "restitution", "max_time": 1.0}
    return scene_arrays(Scene(Balls.uniform(1), physics=Physics(**physics)))[0]


def ball(constants, **columns):
    """One ball's state and phase, started."""
    index = {"x": X, "y": Y, "vx": VX, "vy": VY, "ux": UX, "uy": UY, "wz": WZ}
    state, phase = np.zeros((1, WIDTH)), np.zeros(1, np.int8)
    for name, value in columns.items():
        state[0, index[name]] = value
    start(state, phase, 0, constants)
    return state, phase


@pytest.mark.parametrize(
    ("x", "y", "size"), [(3.0, -4.0, 5.0), (0.0, 0.0, 0.0), (0.0, -2.0, 2.0), (3e-200, 4e-200, 5e-200)]
)
def test_norm_is_right_even_where_squares_underflow(x, y, size):
    assert norm(x, y) == pytest.approx(size, rel=1e-15)


def test_a_slipping_ball_slides_until_its_slip_is_used_up():
    state, phase = ball(params(), vx=1.0, vy=2.0, ux=3.0, uy=-4.0)
    assert phase[0] == SLIDING
    assert state[0, [AX, AY]] == pytest.approx([-SLIDE * 0.6, SLIDE * 0.8])
    assert state[0, LASTS] == pytest.approx(2 * 5 / (7 * SLIDE))


def test_a_ball_without_slip_rolls_until_it_stops():
    state, phase = ball(params(), vx=0.3, vy=-0.4, wz=1.0)
    assert phase[0] == ROLLING
    assert state[0, [AX, AY]] == pytest.approx([-ROLL * 0.6, ROLL * 0.8])
    assert state[0, LASTS] == pytest.approx(0.5 / ROLL)


def test_a_ball_that_turns_on_the_spot_spins_until_its_spin_has_decayed():
    state, phase = ball(params(spin_decay=4.0), wz=-8.0)
    assert phase[0] == SPINNING
    assert state[0, LASTS] == 2.0
    assert not state[0, [AX, AY]].any()


def test_slip_without_velocity_is_sliding():
    state, phase = ball(params(), ux=1.0)
    assert phase[0] == SLIDING
    assert state[0, AX] < 0


def test_a_ball_with_nothing_left_rests():
    state, phase = ball(params())
    assert phase[0] == REST
    assert state[0, LASTS] == math.inf


def test_the_other_laws_heed_neither_slip_nor_spin():
    state, phase = ball(params(motion="rolling"), vx=1.0, ux=1.0, wz=0.0)
    assert phase[0] == ROLLING
    assert state[0, AX] == pytest.approx(-ROLL)
    state, phase = ball(params(motion="ideal"), vx=1.0)
    assert phase[0] == FREE
    assert (state[0, AX], state[0, LASTS]) == (0.0, math.inf)
    assert ball(params(motion="ideal"))[1][0] == REST


def test_a_potted_ball_stays_as_it_is():
    state, phase = np.ones((1, WIDTH)), np.full(1, POTTED, np.int8)
    start(state, phase, 0, params())
    assert phase[0] == POTTED
    assert (state == 1).all()
    assert place(state, phase, 0, 5.0) == (1.0, 1.0, 0.0, 0.0)


def test_moving_on_in_steps_is_moving_on_at_once():
    constants = params()
    one, phase = ball(constants, x=0.1, vx=1.0, vy=2.0, ux=3.0, uy=-4.0, wz=5.0)
    two = one.copy()
    move(one, phase, 0, 0.3, 0.0, constants)
    for t in (0.1, 0.2, 0.3):
        move(two, phase, 0, t, 0.0, constants)
    assert one == pytest.approx(two, rel=1e-14)
    assert one[0, [UX, UY]] == pytest.approx([3 - 3.5 * SLIDE * 0.6 * 0.3, -4 + 3.5 * SLIDE * 0.8 * 0.3])
    assert one[0, X] == pytest.approx(0.1 + 0.3 - 0.5 * SLIDE * 0.6 * 0.09)
    assert one[0, WZ] == pytest.approx(5 - 10 * 0.3)
    assert one[0, T0] == 0.3
    assert one[0, LASTS] == pytest.approx(10 / (7 * SLIDE) - 0.3)


def test_the_end_of_a_slide_is_rolling_exactly():
    constants = params()
    state, phase = ball(constants, vx=1.0, vy=0.5, ux=1.0, uy=0.5)
    finish(state, phase, 0, state[0, LASTS], 0.0, constants)
    assert phase[0] == ROLLING
    assert (state[0, UX], state[0, UY]) == (0.0, 0.0)
    assert state[0, [VX, VY]] == pytest.approx([5 / 7, 5 / 14])


def test_the_end_of_rolling_is_rest_or_spinning_exactly():
    constants = params()
    for spin, after in ((0.0, REST), (1e4, SPINNING)):
        state, phase = ball(constants, vx=1.0, vy=0.5, wz=spin)
        finish(state, phase, 0, state[0, LASTS], 0.0, constants)
        assert phase[0] == after
        assert (state[0, VX], state[0, VY]) == (0.0, 0.0)
        assert state[0, [X, Y]] == pytest.approx(np.array([1.0, 0.5]) * math.sqrt(1.25) / (2 * ROLL))
    finish(state, phase, 0, state[0, T0] + state[0, LASTS], 0.0, constants)
    assert phase[0] == REST
    assert state[0, WZ] == 0.0


@pytest.mark.parametrize(("wz", "t", "after"), [(5.0, 0.2, 3.0), (-5.0, 0.2, -3.0), (5.0, 0.5, 0.0), (-5.0, 9.0, 0.0)])
def test_spin_decays_towards_zero_and_stays_there(wz, t, after):
    assert spin_after(wz, t, params()) == pytest.approx(after)


def test_times_are_sums_of_two_doubles():
    assert two_sum(1.0, 1e-20) == (1.0, 1e-20)
    assert two_sum(1e-20, 1.0) == (1.0, 1e-20)
    hi, lo = later(10.0, 0.0, 1e-17)
    hi, lo = later(hi, lo, 3e-17)
    assert (hi, lo) == (10.0, 4e-17)
    assert since(hi, lo, 10.0, 1e-17) == pytest.approx(3e-17, rel=1e-15)
    assert since(hi, lo, 9.5, 0.0) == 0.5


def test_a_ball_s_place_heeds_the_small_half_of_its_time():
    constants = params(motion="ideal")
    state, phase = ball(constants, vx=1.0)
    state[0, T0], state[0, T0_LO] = 10.0, -1e-17
    move(state, phase, 0, 10.0, 2e-17, constants)
    assert state[0, X] == pytest.approx(3e-17, rel=1e-15)
