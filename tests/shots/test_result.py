import math

import numpy as np
import pytest

from billiards_env import Scene, simulate_batch
from billiards_env.engine.log import KINDS
from billiards_env.scene import Balls, Physics, layouts
from tests.helpers.shots import simulate

POOL = Scene.named("pool")
PLACES = [[-0.5, 0.0], [0.5, 0.0]]


# Records


SCATTERED = layouts.draw("random", Scene.named("pool", 15), np.random.default_rng(4))


@pytest.fixture(scope="module")
def recorded():
    """Returns a shot in which all sixteen balls move at first; five are potted."""
    velocities = np.random.default_rng(4).normal(size=(16, 2)) * 2
    return simulate(Scene.named("pool", 15), SCATTERED, velocities, record=True)


def test_the_motion_at_a_time_is_that_of_a_shot_that_ends_there(recorded):
    times = np.append(np.random.default_rng(0).uniform(0.0, recorded.time, 6), [0.0, recorded.time + 1.0])
    velocities, spins = recorded.motion_at(times)
    assert (velocities.shape, spins.shape) == ((8, 16, 2), (8, 16, 3))
    for k, time in enumerate(times.tolist()):
        cut = simulate(recorded.scene, SCATTERED, velocities[6], max_time=max(time, 1e-9))
        np.testing.assert_allclose(velocities[k], cut.velocities, atol=1e-9)
        np.testing.assert_allclose(spins[k], cut.spins, atol=1e-6)
    assert abs(spins[:6, :, 2]).max() > 1.0
    ideal = simulate(Scene.named("ideal"), PLACES, [1.0, 0.0], record=True)
    assert [array.tolist() for array in ideal.motion_at(0.5)] == [[[1.0, 0.0], [0.0, 0.0]], [[0.0] * 3] * 2]


def test_positions_are_continuous_until_a_ball_moves_to_its_pocket(recorded):
    gone = {e["ball"] for e in recorded.events if e["kind"] == "pocket"}
    stay = [i for i in range(16) if i not in gone]
    for t in np.unique(recorded.events["time"]):
        before, after = recorded.at(max(0.0, t - 1e-10)), recorded.at(t + 1e-10)
        assert np.abs(after - before)[stay].max() < 3e-9  # at 10 m/s at most
    pockets = Scene.named("pool").table.pockets
    captures = recorded.events[recorded.events["kind"] == "pocket"]
    assert len(captures) > 0
    for event in captures:
        pocket = pockets[event["other"]]
        edge = recorded.at(float(np.nextafter(event["time"], 0)))[event["ball"]]
        assert math.dist(edge, (pocket.x, pocket.y)) == pytest.approx(pocket.radius, abs=1e-12)
        assert recorded.at(event["time"])[event["ball"]].tolist() == [pocket.x, pocket.y]
        assert recorded.positions[event["ball"]].tolist() == [pocket.x, pocket.y]
    assert np.flatnonzero(recorded.potted).tolist() == sorted(captures["ball"])


def test_events_have_positions_and_speeds(recorded):
    events = recorded.events
    assert set(events["kind"]) <= set(KINDS)
    for event in events[events["kind"] != "pocket"][::10]:
        assert recorded.at(event["time"])[event["ball"]] == pytest.approx((event["x"], event["y"]), abs=1e-14)
    contact = np.isin(events["kind"], ["ball_ball", "cushion", "pocket"])
    assert (events["speed"][contact] >= 0).all()
    assert not events["speed"][~contact].any()


def test_a_log_that_exceeds_its_initial_size_is_complete():
    scene = Scene.named("ideal", 15)
    rng = np.random.default_rng(0)
    places, velocities = layouts.draw("random", scene, rng), rng.normal(size=(16, 2)) * 2
    shot = simulate(scene, places, velocities, record=True, max_time=30.0)
    assert shot.n_events > 1000
    assert len(shot.events) == shot.n_events
    assert shot.status == "max_time"
    assert shot.at(30.0) == pytest.approx(shot.positions, abs=1e-15)
    first = simulate(scene, places, velocities, record=True, max_time=float(shot.events["time"][100]))
    assert np.array_equal(first.events, shot.events[: first.n_events])
    assert first.n_events >= 100


def test_positions_at_an_array_of_times(recorded):
    times = np.append(np.linspace(0.0, recorded.time + 1.0, 7), recorded.events["time"][:5]).reshape(4, 3)
    positions = recorded.at(times)
    assert positions.shape == (4, 3, *recorded.positions.shape)
    for index in np.ndindex(4, 3):
        expected = recorded.trajectory.at(min(times[index], recorded.time))
        assert positions[index].tobytes() == recorded.at(times[index]).tobytes() == expected.tobytes()
    assert recorded.at([]).shape == (0, *recorded.positions.shape)


# Input


def test_one_velocity_is_that_of_the_cue_ball():
    one = simulate(POOL, PLACES, [2.0, 0.1], spins=[1.0, 2.0, 3.0])
    all_of_them = simulate(POOL, PLACES, [[2.0, 0.1], [0.0, 0.0]], spins=[[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    assert np.array_equal(one.positions, all_of_them.positions)
    assert one.time == all_of_them.time
    other = simulate(POOL, PLACES, [[0.0, 0.0], [0.0, 0.5]], record=True)  # one for each of two balls
    assert set(other.events["ball"]) == {1}


def test_balls_not_in_play_are_ignored_and_reported_as_potted():
    alone = simulate(Scene.named("pool", 0), PLACES[:1], [3.0, 0.0])
    shot = simulate(POOL, PLACES, [3.0, 0.0], in_play=[True, False])
    assert shot.potted.tolist() == [False, True]
    assert np.array_equal(shot.positions, [alone.positions[0], PLACES[1]])
    assert (shot.time, shot.n_events, shot.first_hit) == (alone.time, alone.n_events, -1)
    elsewhere = simulate(POOL, [PLACES[0], [9.0, 9.0]], [3.0, 0.0], in_play=[True, False])
    assert np.array_equal(elsewhere.positions[0], alone.positions[0])


def test_results_have_the_documented_types():
    shot = simulate(POOL, [[-1, 0], [0, 0]], [1, 0])
    assert (shot.positions.shape, shot.velocities.shape, shot.spins.shape) == ((2, 2), (2, 2), (2, 3))
    assert shot.positions.dtype == shot.velocities.dtype == shot.spins.dtype == np.float64
    assert shot.potted.dtype == np.bool_
    assert (type(shot.time), type(shot.n_events), type(shot.status)) == (float, int, str)
    assert (type(shot.first_hit), type(shot.n_contact_rule)) == (int, int)


def test_spin_is_zero_if_the_motion_has_no_spin():
    physics = Physics(motion="rolling", cushion="restitution")
    assert not simulate(Scene(Balls.uniform(1), physics=physics), [[0, 0]], [1, 0], max_time=0.1).spins.any()
    rolling = simulate(Scene.named("carom", 0), [[0, 0]], [1, 0], max_time=0.5)
    assert rolling.spins[0] == pytest.approx([0, rolling.velocities[0, 0] / 0.03075, 0])


def test_a_shot_prints_its_result_in_a_few_lines():
    start = Scene.named("pool"), [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45]
    lines = [
        "ShotResult: 2 balls, rest after 4.642 s, 8 events",
        "  balls potted: 1",
        "  first hit: ball 1",
        "  cushion contacts: 1 of the cue ball, 0 of other balls",
    ]
    assert repr(simulate(*start)).splitlines() == lines
    *recorded, last = repr(simulate(*start, record=True)).splitlines()
    assert recorded == lines
    assert last.startswith("  recorded (PIC): events, at(t), plot()")
    places, velocity, in_play = [[-0.5, 0.3], [0.0, 0.3], [0.3, 0.5]], [0.0, 8.0, 4.0], [True, True, False]
    away = simulate("jump_pool", places, velocity, in_play=in_play)
    assert repr(away).splitlines()[1:4] == [
        "  balls potted: none",
        "  balls driven off the table: 0",
        "  balls not in play: 2",
    ]
    batch = repr(simulate_batch("jump_pool", [places] * 2, [velocity, [0.0, 0.0, 0.0]], in_play=in_play)).splitlines()
    assert batch[-2] == "  shots with a potted ball: cue ball 0, object balls 0"
    assert batch[-1] == "  shots with a ball driven off the table: 1"
    rest = simulate(start[0], start[1], [0.0, 0.0])
    assert repr(rest).splitlines()[1:3] == ["  balls potted: none", "  first hit: none"]
