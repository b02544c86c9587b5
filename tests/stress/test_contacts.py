"""Balls in contact: racks, cradles, wedges, pressed balls. All shots end and keep momentum, energy and symmetry."""

import math

import numpy as np
import pytest

from benchmarks.reference.stress.scenes import R, checked_shot, ideal, kinds, rough
from billiards_env.scene import CONTACT_GAP
from billiards_env.shots.simulation import simulate


@pytest.mark.parametrize("where", [[2.0 - R, 0.0], [2.0 - R, 1.0 - R], [0.0, R - 1.0]])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_hit_on_a_ball_frozen_to_cushions_ends_at_rest(where, e):
    scene = rough(1.0, 1.0, e_ball=e, e_cushion=e)
    for start in ([0.5, 0.3], [-1.0, -0.2]):
        aim = np.array(where) - start
        shot = checked_shot(scene, [start, where], 3 * aim / np.hypot(*aim))
        assert shot.status == "rest"
        assert shot.n_events < 20_000


@pytest.mark.parametrize("e_ball", [0.0, 0.3, 0.95, 1.0])
@pytest.mark.parametrize("e_cushion", [0.0, 0.5, 1.0])
def test_a_shot_with_a_ball_between_a_fixed_ball_and_a_cushion_ends(e_ball, e_cushion):
    scene = ideal(1.0, math.inf, e_ball=e_ball, e_cushion=e_cushion)
    shot = checked_shot(scene, [[2.0 - R, 0.0], [2.0 - 3 * R, 0.0]], [1.0, 0.25])
    assert shot.status in ("rest", "max_time")
    assert shot.n_events < 3000


@pytest.mark.parametrize("motion", ["rolling", "sliding"])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_ball_between_two_approaching_balls_stays_in_place(motion, e):
    scene = rough(1.0, 1.0, 1.0, motion=motion, e_ball=e)
    places = [[-2 * R, 0.0], [0.0, 0.0], [2 * R, 0.0]]
    shot = checked_shot(scene, places, [[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0]])
    assert shot.status == "rest"
    assert shot.positions[1] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert shot.positions[0] == pytest.approx(-shot.positions[2], abs=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.1, 0.5, 0.9])
def test_the_inelastic_collapse_of_a_row_ends(e):
    # Three balls collapse if e < 7 - 4 sqrt(3) = 0.07, more balls also with a larger e (McNamara and Young 1992).
    places = [[0.125 * k - 0.7, 0.0] for k in range(12)]
    velocities = [[1.0 if k < 6 else -1.0, 0.0] for k in range(12)]
    shot = checked_shot(ideal(*[1.0] * 12, e_ball=e, max_time=2.0), places, velocities)
    assert shot.status in ("rest", "max_time")
    assert shot.n_events < 50_000
    assert shot.velocities.sum(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)  # the momentum


def test_an_overlap_up_to_the_contact_gap_is_a_contact():
    scene = ideal(1.0, 1.0, max_time=0.5)
    shot = simulate(scene, [[0.0, 0.0], [2 * R - 0.9 * CONTACT_GAP, 0.0]], [1.0, 0.0], record=True)
    assert kinds(shot) == [("ball_ball", 0, 1)]
    assert shot.velocities.tolist() == [[0.0, 0.0], [1.0, 0.0]]
