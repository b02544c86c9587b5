"""Balls in contact: racks, cradles, wedges, pressed balls. All shots end and keep momentum, energy and symmetry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from billiards_env.scene import CONTACT_GAP, Scene
from billiards_env.shots.simulation import simulate
from reference.stress.scenes import R, energy, ideal, kinds, momentum, rough, run, triangle

INF = math.inf


def cluster(name: str) -> tuple[list[float], np.ndarray, np.ndarray]:
    """Returns the masses, positions and velocities of a cluster and of the balls that hit it."""
    if name == "rack":
        places = np.vstack([triangle(5), [0.5 - 2 * R - 0.25, 0.01]])
        return [1.0] * 16, places, np.array([[0.0, 0.0]] * 15 + [[4.0, 0.0]])
    if name == "unequal rack":
        places = np.vstack([triangle(3), [0.5 - 2 * R - 0.25, 0.01]])
        return [1.0, 2.0, 0.25, 8.0, 0.5, 1.0, 3.0], places, np.array([[0.0, 0.0]] * 6 + [[4.0, 0.0]])
    if name == "cradle":
        places = np.array([[2 * R * k, 0.0] for k in range(5)] + [[-0.5, 0.0]])
        return [1.0] * 6, places, np.array([[0.0, 0.0]] * 5 + [[2.0, 0.0]])
    if name == "three at one instant":
        angle = np.deg2rad([0.0, 100.0, -130.0])
        places = np.vstack([2 * R * np.stack([np.cos(angle), np.sin(angle)], 1), [0.0, 0.0]])
        return [1.0, 1.0, 1.0, 1.0], places, np.array([[-1.0, 0.1], [0.3, -1.0], [0.5, 1.0], [0.0, 0.0]])
    if name == "squeezed":
        places = np.array([[0.0, 0.0], [-2 * R - 0.125, 0.0], [2 * R + 0.125, 0.0]])
        return [0.5, 1.0, 1.0], places, np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0]])
    places = np.array([[0.0, 0.0], [2 * R, 0.0], [R, -math.sqrt(3) * R], [0.003, 0.5]])
    return [1.0, 2.0, INF, 1.0], places, np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, -3.0]])


CLUSTERS = ["rack", "unequal rack", "cradle", "three at one instant", "squeezed", "fixed ball"]


def reordered(name: str, order: np.ndarray, e: float) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Returns the scene, positions and velocities of a cluster with its balls in another order."""
    masses, places, velocities = cluster(name)
    scene = ideal(*(masses[i] for i in order), e_ball=e, max_time=0.4)
    return scene, places[order], velocities[order]


def orders(name: str) -> list[np.ndarray]:
    """Returns a few orders of the balls; ball 0 has a finite mass in each."""
    masses = cluster(name)[0]
    rng = np.random.default_rng(0)
    drawn = [np.arange(len(masses))[::-1], *(rng.permutation(len(masses)) for _ in range(20))]
    return [order for order in drawn if math.isfinite(masses[order[0]])][:5]


@pytest.mark.parametrize("e", [0.0, 0.5, 0.95, 1.0])
@pytest.mark.parametrize("name", CLUSTERS)
def test_a_cluster_conserves_momentum_and_gains_no_energy(name, e):
    scene, places, velocities = reordered(name, np.arange(len(cluster(name)[0])), e)
    shot = run(scene, places, velocities)
    assert len(kinds(shot, "ball_ball")) >= 2
    assert kinds(shot, "cushion") == []
    before = energy(scene, velocities)
    if e == 1.0:
        assert energy(scene, shot.velocities) == pytest.approx(before, rel=1e-13)
    else:
        assert energy(scene, shot.velocities) <= before * (1 + 1e-14)
    if INF not in scene.balls.mass:
        scale = np.abs(velocities).max() * max(scene.balls.mass)
        assert momentum(scene, shot.velocities) == pytest.approx(momentum(scene, velocities), abs=1e-13 * scale)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("name", CLUSTERS)
def test_the_order_of_the_balls_changes_no_result(name, e):
    usual = np.arange(len(cluster(name)[0]))
    want = simulate(*reordered(name, usual, e))
    for order in orders(name):
        got = simulate(*reordered(name, order, e))
        # Equal bit for bit, unless rounding decides which of two close impacts is first.
        close = 1e-14 if name == "unequal rack" else 0.0
        assert got.positions == pytest.approx(want.positions[order], rel=0, abs=close)
        assert got.velocities == pytest.approx(want.velocities[order], rel=0, abs=close)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("mirror", [[-1, 1], [1, -1], [-1, -1]])
@pytest.mark.parametrize("name", CLUSTERS)
def test_a_mirrored_cluster_has_the_mirrored_result(name, mirror, e):
    scene, places, velocities = reordered(name, orders(name)[0], e)
    want = simulate(scene, places, velocities)
    got = simulate(scene, places * mirror, velocities * mirror)
    assert np.array_equal(got.positions, want.positions * mirror)
    assert np.array_equal(got.velocities, want.velocities * mirror)


def test_newtons_cradle_with_gaps_passes_the_velocity_on():
    places = [[-0.5, 0.0], *([2 * (R + 2**-20) * k, 0.0] for k in range(5))]
    shot = run(ideal(*[1.0] * 6, max_time=0.5), places, [2.0, 0.0])
    assert shot.velocities.tolist() == [[0.0, 0.0]] * 5 + [[2.0, 0.0]]


@pytest.mark.parametrize("where", [[2.0 - R, 0.0], [2.0 - R, 1.0 - R], [0.0, R - 1.0]])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_hit_on_a_ball_frozen_to_cushions_ends_at_rest(where, e):
    scene = rough(1.0, 1.0, e_ball=e, e_cushion=e)
    for start in ([0.5, 0.3], [-1.0, -0.2]):
        aim = np.array(where) - start
        shot = run(scene, [start, where], 3 * aim / np.hypot(*aim))
        assert shot.status == "rest"
        assert shot.n_events < 20_000


@pytest.mark.parametrize("e_ball", [0.0, 0.3, 0.95, 1.0])
@pytest.mark.parametrize("e_cushion", [0.0, 0.5, 1.0])
def test_a_shot_with_a_ball_between_a_fixed_ball_and_a_cushion_ends(e_ball, e_cushion):
    scene = ideal(1.0, INF, e_ball=e_ball, e_cushion=e_cushion)
    shot = run(scene, [[2.0 - R, 0.0], [2.0 - 3 * R, 0.0]], [1.0, 0.25])
    assert shot.status in ("rest", "max_time")
    assert shot.n_events < 3000


@pytest.mark.parametrize("motion", ["rolling", "sliding"])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_ball_between_two_approaching_balls_stays_in_place(motion, e):
    scene = rough(1.0, 1.0, 1.0, motion=motion, e_ball=e)
    places = [[-2 * R, 0.0], [0.0, 0.0], [2 * R, 0.0]]
    shot = run(scene, places, [[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0]])
    assert shot.status == "rest"
    assert shot.positions[1] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert shot.positions[0] == pytest.approx(-shot.positions[2], abs=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.1, 0.5, 0.9])
def test_the_inelastic_collapse_of_a_row_ends(e):
    # Three balls collapse if e < 7 - 4 sqrt(3) = 0.07, more balls also with a larger e (McNamara and Young 1992).
    places = [[0.125 * k - 0.7, 0.0] for k in range(12)]
    velocities = [[1.0 if k < 6 else -1.0, 0.0] for k in range(12)]
    shot = run(ideal(*[1.0] * 12, e_ball=e, max_time=2.0), places, velocities)
    assert shot.status in ("rest", "max_time")
    assert shot.n_events < 50_000
    assert momentum(ideal(*[1.0] * 12), shot.velocities) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_an_overlap_up_to_the_contact_gap_is_a_contact():
    scene = ideal(1.0, 1.0, max_time=0.5)
    shot = simulate(scene, [[0.0, 0.0], [2 * R - 0.9 * CONTACT_GAP, 0.0]], [1.0, 0.0], record=True)
    assert kinds(shot) == [("ball_ball", 0, 1)]
    assert shot.velocities.tolist() == [[0.0, 0.0], [1.0, 0.0]]
