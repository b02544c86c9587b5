"""Balls in contact: racks, cradles, wedges, pressed balls. Momentum, energy, symmetry, and an end to every shot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from billiards_env.scene import CONTACT_GAP, Scene
from billiards_env.simulation import simulate
from reference.stress.scenes import R, energy, ideal, kinds, momentum, rough, run, triangle

INF = math.inf


def cluster(name: str) -> tuple[list[float], np.ndarray, np.ndarray]:
    """Masses, places and velocities of a cluster that is hit; the last ball does the hitting."""
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


CLUSTERS = ["rack", "unequal rack", "cradle", "three at one instant", "squeezed", "beside an obstacle"]


def shuffled(name: str, order: np.ndarray, e: float) -> tuple[Scene, np.ndarray, np.ndarray]:
    masses, places, velocities = cluster(name)
    scene = ideal(*(masses[i] for i in order), e_ball=e, max_time=0.4)
    return scene, places[order], velocities[order]


def orders(name: str) -> list[np.ndarray]:
    """A few numberings; ball 0 has a finite mass in each."""
    masses = cluster(name)[0]
    rng = np.random.default_rng(0)
    drawn = [np.arange(len(masses))[::-1], *(rng.permutation(len(masses)) for _ in range(20))]
    return [order for order in drawn if math.isfinite(masses[order[0]])][:5]


@pytest.mark.parametrize("e", [0.0, 0.5, 0.95, 1.0])
@pytest.mark.parametrize("name", CLUSTERS)
def test_a_cluster_keeps_momentum_and_no_more_than_its_energy(name, e):
    scene, places, velocities = shuffled(name, np.arange(len(cluster(name)[0])), e)
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
def test_the_numbering_of_the_balls_does_not_matter(name, e):
    usual = np.arange(len(cluster(name)[0]))
    want = simulate(*shuffled(name, usual, e))
    for order in orders(name):
        got = simulate(*shuffled(name, order, e))
        # Bit for bit, unless impacts follow each other so closely that rounding decides which comes first.
        close = 1e-14 if name == "unequal rack" else 0.0
        assert got.positions == pytest.approx(want.positions[order], rel=0, abs=close)
        assert got.velocities == pytest.approx(want.velocities[order], rel=0, abs=close)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("mirror", [[-1, 1], [1, -1], [-1, -1]])
@pytest.mark.parametrize("name", CLUSTERS)
def test_a_mirrored_cluster_goes_the_mirrored_way(name, mirror, e):
    scene, places, velocities = shuffled(name, orders(name)[0], e)
    want = simulate(scene, places, velocities)
    got = simulate(scene, places * mirror, velocities * mirror)
    assert np.array_equal(got.positions, want.positions * mirror)
    assert np.array_equal(got.velocities, want.velocities * mirror)


@pytest.mark.parametrize("mirror", [[-1, 1], [1, -1]])
def test_a_mirrored_break_goes_the_mirrored_way_bit_for_bit(mirror):
    scene = Scene.named("pool", 15)
    radius = scene.balls.radius[0]
    places = np.vstack([[-0.6, 0.02], triangle(5, 0.635, radius)])
    want = simulate(scene, places, [7.0, -0.1])
    got = simulate(scene, places * mirror, np.array([7.0, -0.1]) * mirror)
    assert np.array_equal(got.positions, want.positions * mirror)


def test_a_frozen_symmetric_rack_breaks_symmetrically():
    scene, places, velocities = shuffled("rack", np.arange(16), 1.0)
    places[-1, 1] = 0.0
    shot = run(scene, places, velocities)
    by_place = {(round(x, 6), round(y, 6)): k for k, (x, y) in enumerate(places)}
    twin = [by_place[round(x, 6), round(-y, 6) + 0.0] for x, y in places]
    assert shot.velocities[twin] == pytest.approx(shot.velocities * [1, -1], abs=1e-13)


def test_newtons_cradle_with_gaps_passes_the_velocity_on():
    places = [[-0.5, 0.0], *([2 * (R + 2**-20) * k, 0.0] for k in range(5))]
    shot = run(ideal(*[1.0] * 6, max_time=0.5), places, [2.0, 0.0])
    assert shot.velocities.tolist() == [[0.0, 0.0]] * 5 + [[2.0, 0.0]]


@pytest.mark.parametrize("where", [[2.0 - R, 0.0], [2.0 - R, 1.0 - R], [0.0, R - 1.0]])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_ball_frozen_to_cushions_is_hit(where, e):
    scene = rough(1.0, 1.0, e_ball=e, e_cushion=e)
    for start in ([0.5, 0.3], [-1.0, -0.2]):
        aim = np.array(where) - start
        shot = run(scene, [start, where], 3 * aim / np.hypot(*aim))
        assert shot.status == "rest"
        assert shot.n_events < 20_000


@pytest.mark.parametrize("e_ball", [0.0, 0.3, 0.95, 1.0])
@pytest.mark.parametrize("e_cushion", [0.0, 0.5, 1.0])
def test_a_ball_wedged_between_an_obstacle_and_a_cushion_comes_free_or_to_rest(e_ball, e_cushion):
    scene = ideal(1.0, INF, e_ball=e_ball, e_cushion=e_cushion)
    shot = run(scene, [[2.0 - R, 0.0], [2.0 - 3 * R, 0.0]], [1.0, 0.25])
    assert shot.status in ("rest", "max_time")
    assert shot.n_events < 3000


@pytest.mark.parametrize("motion", ["rolling", "sliding"])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_ball_at_rest_between_two_others_is_squeezed_by_both(motion, e):
    scene = rough(1.0, 1.0, 1.0, motion=motion, e_ball=e)
    places = [[-2 * R, 0.0], [0.0, 0.0], [2 * R, 0.0]]
    shot = run(scene, places, [[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0]])
    assert shot.status == "rest"
    assert shot.positions[1] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert shot.positions[0] == pytest.approx(-shot.positions[2], abs=1e-12)


@pytest.mark.parametrize("spin", [50.0, 300.0])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("cushion", ["restitution", "han2005"])
def test_a_top_spinning_ball_pressed_against_a_cushion_ends(cushion, e, spin):
    scene = rough(1.0, cushion=cushion, e_cushion=e)
    shot = run(scene, [[2.0 - R, 0.0]], [1e-3, 0.0], [0.0, spin, 0.0])
    assert shot.status == "rest"
    # Pressed for the time of its slip at most, it leaves the cushion for a contact time each time.
    assert shot.n_events < 100 + 2 * (spin * R / (3.5 * 0.2 * 9.81)) / 2e-4


@pytest.mark.parametrize("spin", [50.0, 300.0])
@pytest.mark.parametrize("e", [0.0, 0.5, 0.95, 1.0])
def test_a_top_spinning_ball_pressed_against_a_ball_ends(e, spin):
    scene = rough(1.0, 1.0, e_ball=e)
    shot = run(scene, [[0.0, 0.0], [2 * R, 0.0]], [1e-3, 0.0], [0.0, spin, 0.0])
    assert shot.status == "rest"
    assert shot.n_events < 20_000


@pytest.mark.parametrize("e", [0.0, 0.1, 0.5, 0.9])
def test_inelastic_collapse_of_a_row_ends(e):
    # Below e = 7 - 4 sqrt(3) = 0.07 three balls collapse, more balls at a higher e (McNamara and Young 1992).
    places = [[0.125 * k - 0.7, 0.0] for k in range(12)]
    velocities = [[1.0 if k < 6 else -1.0, 0.0] for k in range(12)]
    shot = run(ideal(*[1.0] * 12, e_ball=e, max_time=2.0), places, velocities)
    assert shot.status in ("rest", "max_time")
    assert shot.n_events < 50_000
    assert momentum(ideal(*[1.0] * 12), shot.velocities) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_rule_says_when_it_has_acted_and_leaves_ordinary_shots_alone():
    pressed = run(rough(1.0, e_cushion=0.0), [[2.0 - R, 0.0]], [1e-3, 0.0], [0.0, 100.0, 0.0])
    assert pressed.n_contact_rule > 0
    ordinary = run(rough(1.0, 1.0), [[0.0, 0.0], [1.0, 0.01]], [3.0, 0.0])
    assert ordinary.n_contact_rule == 0


def test_balls_placed_an_overlap_of_the_contact_gap_apart_only_touch():
    scene = ideal(1.0, 1.0, max_time=0.5)
    shot = simulate(scene, [[0.0, 0.0], [2 * R - 0.9 * CONTACT_GAP, 0.0]], [1.0, 0.0], record=True)
    assert kinds(shot) == [("ball_ball", 0, 1)]
    assert shot.velocities.tolist() == [[0.0, 0.0], [1.0, 0.0]]
