"""Situations in which other simulators are known to fail."""

import itertools

import numpy as np
import pytest

from benchmarks.reference import oracle
from benchmarks.reference.stress import families
from benchmarks.reference.stress.scenes import R, checked_shot, kinds, rough
from billiards_env.physics.geometry.contact import circle_time
from billiards_env.physics.motion import Path


@pytest.mark.parametrize("motion", ["rolling", "sliding"])
def test_balls_ten_centimetres_apart_do_not_collide_at_time_0(motion):
    scene = rough(1.0, 1.0, motion=motion)
    shot = checked_shot(scene, [[0.0, 0.0], [0.1 + 2 * R, 0.0]], [1.0, 0.0])
    assert shot.events is not None
    first = shot.events[shot.events["kind"] == "ball_ball"][0]
    assert first["time"] > 0.1
    away = checked_shot(scene, [[0.0, 0.0], [0.1 + 2 * R, 0.0]], [-0.3, 0.0])
    assert kinds(away, "ball_ball") == []


def test_a_fast_rolling_ball_hits_a_slow_one_once():
    scene = rough(1.0, 1.0, motion="rolling", length=100.0, e_ball=1.0)
    shot = checked_shot(scene, [[0.0, 0.0], [0.5, 0.0]], [[1.0, 0.0], [0.5, 0.0]])
    assert kinds(shot, "ball_ball") == [("ball_ball", 0, 1)]


@pytest.mark.parametrize("rack", ["loose", "tight"])
def test_two_hundred_breaks_end(rack):
    """In another simulator one in two hundred does not end."""
    result = families.check_family(f"15-ball break, {rack} rack", seed=7, shots=200)
    assert result["bad"] == []
    assert result["most_events"] < 20_000


@pytest.mark.slow
def test_a_ball_that_a_spinning_ball_wedges_into_a_corner_comes_to_rest():
    """The spin lasts for 414 s. Before, the shot had ten million impacts in seven seconds and did not end."""
    result = families.check_family("wild outlines", seed=1155, shots=50)
    assert result["bad"] == []
    assert result["most_events"] < 2_000_000


@pytest.mark.parametrize("speed", [1.0, 10.0, 100.0])
@pytest.mark.parametrize("offset", [0.0, 0.5, 0.99])
def test_a_fast_ball_does_not_pass_through_another(speed, offset):
    scene = rough(1.0, 1.0, length=20.0, e_ball=1.0)
    shot = checked_shot(scene, [[-1.0, 2 * R * offset], [0.0, 0.0]], [speed, 0.0])
    assert kinds(shot, "ball_ball")[:1] == [("ball_ball", 0, 1)]


def test_a_ball_does_not_pass_through_a_column_of_balls():
    scene = rough(*[1.0] * 12, width=11 * 2 * R + 1e-3, length=6.0, e_ball=1.0)
    column = [[0.0, (2 * R + 5e-5) * (k - 5)] for k in range(11)]
    for speed, y in itertools.product((1.0, 20.0), (0.0, R, 0.21)):
        shot = checked_shot(scene, [[-2.0, y], *column], [speed, 0.0])
        assert shot.first_hit > 0


def test_balls_pressed_together_after_a_plastic_impact_do_not_overlap():
    """The normal velocity is a rounding error, and friction accelerates the balls towards each other."""
    d = 0.07555368088804269 - 0.032461604912339626, -0.013281604238335772 - 0.02611486056148335
    w = -0.017122560659014407, -0.018728753672848042
    b = (-0.7138650904257209, 0.9617146344222578)
    reach = 0.02380369697768553 + 0.03458301769799349
    t = circle_time(Path(*d, *w, *b), reach, 0.13277429667059007, 0.0)
    place = [x + t * (v + t * a / 2) for x, v, a in zip(d, w, b, strict=True)]
    assert np.hypot(place[0], place[1]) == pytest.approx(reach, abs=1e-15)


@pytest.mark.parametrize("short", [1e-3, 1e-6, 1e-9])
def test_a_graze_on_a_curved_path_agrees_with_the_reference(short):
    scene = rough(1.0, 1.0)
    places, velocities, spins = [[-0.25, 2 * R * (1 - short)], [0.0, 0.0]], [2.0, 0.0], [0.0, 80.0, 0.0]
    shot = checked_shot(scene, places, velocities, spins)
    exact = oracle.reference_shot(scene, places, velocities, spins)
    assert kinds(shot) == [(e.kind, e.ball, e.other) for e in exact.events]
    final = [[float(x) for x in place] for place in exact.positions]
    assert shot.positions == pytest.approx(np.array(final), abs=1e-9)
