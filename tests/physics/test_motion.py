import math

import pytest

from billiards_env.engine.compile import scene_arrays
from billiards_env.physics.motion import advance
from billiards_env.physics.state import FREE, LASTS, T0, T0_LO, VX, Time, X, empty_state, later, since, two_sum
from billiards_env.scene import Balls, Physics, Scene


def test_times_are_sums_of_two_doubles():
    assert two_sum(1.0, 1e-20) == (1.0, 1e-20)
    assert two_sum(1e-20, 1.0) == (1.0, 1e-20)
    time = later(later(Time(10.0, 0.0), 1e-17), 3e-17)
    assert time == (10.0, 4e-17)
    assert since(time, Time(10.0, 1e-17)) == pytest.approx(3e-17, rel=1e-15, abs=0)
    assert since(time, Time(9.5, 0.0)) == 0.5


def test_the_second_part_of_a_time_changes_the_position():
    state, ideal = empty_state(1, 2), Physics(motion="ideal", cushion="restitution", max_time=1.0)
    row = state.rows[0]
    row[:], state.phase[:] = 0.0, FREE
    row[VX], row[T0], row[T0_LO], row[LASTS] = 1.0, 10.0, -1e-17, math.inf
    advance(state, 0, Time(10.0, 2e-17), scene_arrays(Scene(Balls.uniform(1), physics=ideal)).numbers)
    assert row[X] == pytest.approx(3e-17, rel=1e-15, abs=0)
