"""Balls that touch two cushions at one instant."""

import dataclasses
import math

import numpy as np
import pytest

from benchmarks.reference.oracle import reference_shot
from billiards_env import Engine, Scene, derivatives
from billiards_env.engine.compile import scene_arrays
from billiards_env.engine.overlaps import FIXES
from billiards_env.jit import allocating, entry_point
from billiards_env.physics.state import UX, UY, VX, VY, X, Y, empty_state
from billiards_env.pots.paths import follow_path
from billiards_env.scene import Balls, Physics, Table
from tests.helpers.outlines import table, with_corners
from tests.helpers.shots import FREE, SLIDING, instants, kinds, kinetic_energy, simulate

R = 0.028575
SQUARE = Table(4.5, 4.5)
DIAMOND = table([(0, -0.7), (1.2, 0), (0, 0.7), (-1.2, 0)])
JAWS = table([(0, 0), (1, 0), (1, 0.96, 0.02), (1.2, 1.16), (1.16, 1.2), (0.96, 1, 0.02), (0, 1)])
"""A square with a mouth on its diagonal, which has two tips and is 0.6 mm narrower than a ball."""


def scene_of(law, a_table=SQUARE, n=1, **physics):
    """Returns n balls and cushions of a law, with an engine that other tests compile too."""
    if law in ("stronge", "mathavan2010"):
        a_table = a_table if a_table.outline else with_corners(a_table)
        numbers = Scene.named("real_pool" if law == "stronge" else "snooker").physics
        n = n if law == "stronge" else max(n, 3)
        return Scene(Balls.uniform(n, R), a_table, dataclasses.replace(numbers, **physics))
    return Scene(Balls.uniform(n, R), a_table, Physics(**{**SLIDING, "cushion": law, **physics}))


def play(scene, start, velocity, spin):
    """Returns the recorded shot of the first ball. The others are not in play."""
    places = [*start, *[[9.0, 0.0]] * (scene.n_balls - 1)]
    in_play = np.arange(scene.n_balls) == 0
    return simulate(scene, places, np.ravel(velocity), spins=np.ravel(spin), in_play=in_play, record=True)


ROOT = math.sqrt(0.5)
AXES = {
    "square": (SQUARE, (ROOT, ROOT)),
    "length of a diamond": (DIAMOND, (1.0, 0.0)),
    "width of a diamond": (DIAMOND, (0.0, 1.0)),
    "jaws": (JAWS, (ROOT, ROOT)),
}
axes = pytest.mark.parametrize(("a_table", "axis"), AXES.values(), ids=AXES)


@pytest.mark.parametrize("law", ["restitution", "han2005", "stronge", "mathavan2010"])
@axes
def test_a_ball_stays_on_the_axis_of_symmetry_of_a_table(law, a_table, axis):
    for spin in (0.0, -60.0, -20.0, 60.0):
        start, velocity = 0.1 * np.array([axis]), (3.0 if a_table is SQUARE else 1.5) * np.array([axis])
        turning = [-spin * axis[1], spin * axis[0], 0.0]  # as a ball that rolls
        shot = play(scene_of(law, a_table), start, velocity, turning)
        first, second = shot.events[shot.events["kind"] == "cushion"][:2]
        assert first["time"] == second["time"]
        assert first["speed"] == pytest.approx(second["speed"], rel=1e-12)
        x, y = shot.positions[0]
        assert x == y if a_table is SQUARE else axis[0] * y == pytest.approx(axis[1] * x, abs=1e-12)


@pytest.mark.parametrize("e", [1.0, 0.5, 0.0])
@axes
def test_without_friction_a_corner_of_any_angle_reverses_the_velocity(a_table, axis, e):
    scene = Scene(Balls.uniform(1, R), a_table, Physics(**{**FREE, "e_cushion": e}))
    shot = simulate(scene, 0.1 * np.array([axis]), axis, max_time=3.2, max_events=2, record=True)
    assert [k for k, _, _ in kinds(shot)] == ["cushion", "cushion"]
    assert shot.velocities[0] == pytest.approx(-e * np.array(axis), abs=1e-15)


@pytest.mark.parametrize("law", ["han2005", "stronge", "mathavan2010"])
def test_a_corner_that_is_hit_across_its_bisector_is_symmetric(law):
    """The two contact times are equal up to rounding; a shift of less than a contact gap changes nothing either."""
    velocity, spin = np.array([[1.7, 1.1]]), np.array([[10.0, -25.0, 40.0]])
    scene = scene_of(law)
    start = np.array([[2.25 - R, 2.25 - R]])
    places, hits = [], []
    for shift in (0.0, 3e-13, -3e-13):
        for swap in (False, True):
            place, v, w = start - np.array([[shift, 0.0]]), velocity, spin
            if swap:
                place, v, w = place[:, ::-1], v[:, ::-1], -w[:, [1, 0, 2]]  # spins are axial vectors
            shot = play(scene, place, v, w)
            hits.append(shot.events["time"][:2])
            places.append(shot.positions[0, ::-1] if swap else shot.positions[0])
    assert (np.array(hits) < 1e-11).all()
    np.testing.assert_array_equal(places[0], places[1])
    np.testing.assert_allclose(places, [places[0]] * 6, atol=1e-9)


@pytest.mark.parametrize("law", ["restitution", "han2005", "stronge"])
@pytest.mark.parametrize(("a_table", "axis"), [(SQUARE, (0.8, 0.8)), (DIAMOND, (1.0, 0.0)), (DIAMOND, (0.0, 1.0))])
@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (8.0, -20.0, 30.0)])
def test_a_corner_agrees_with_the_reference(law, a_table, axis, spin):
    scene = scene_of(law, a_table)
    start, velocity = 0.1 * np.array([axis]), 1.5 * np.array([axis])
    if any(spin):  # starts in the corner, because the spin takes the ball off the bisector
        x, y = axis
        gap = R * math.hypot(1.2, 0.7)
        start = np.array([axis]) * ((2.25 - R) / x if x == y else (1.2 - gap / 0.7 if x else 0.7 - gap / 1.2))
    shot = simulate(scene, start, velocity, spins=[spin], record=True)
    exact = reference_shot(scene, start, velocity, [spin])
    assert kinds(shot) == [(e.kind, e.ball, e.other) for e in exact.events]
    assert shot.positions[0] == pytest.approx([float(x) for x in exact.positions[0]], abs=1e-12)


@pytest.mark.parametrize("law", ["han2005", "stronge", "mathavan2010"])
@pytest.mark.parametrize("angle", [60.0, 20.0])
def test_the_impacts_of_an_instant_in_an_acute_corner_end(law, angle):
    """After the joint impact the ball may approach a cushion again: up to hundreds of times, as spin drives it in."""
    sine, slope = math.sin(math.radians(angle / 2)), math.tan(math.radians(angle / 2))
    scene = scene_of(law, table([(0, 0), (1.5, -1.5 * slope), (1.5, 1.5 * slope)]))
    place, rng, longest = np.array([[R / sine - 0.75, 0.0]]), np.random.default_rng(0), 0
    for _ in range(15):
        heading = math.pi + math.radians(rng.uniform(-0.7, 0.7) * angle)
        v, w = rng.uniform(0.05, 5.0) * np.array([math.cos(heading), math.sin(heading)]), rng.normal(0.0, 100.0, 3)
        shot = play(scene, place, v, w)
        image = play(scene, place, v * [1.0, -1.0], w * [-1.0, 1.0, -1.0])
        assert (shot.status, shot.n_events) == (image.status, image.n_events)
        assert shot.status == "rest"
        np.testing.assert_array_equal(shot.positions, image.positions * [1.0, -1.0])
        energies = [kinetic_energy(motion, scene) for _, *both in instants(shot) for motion in both]
        assert (np.diff(energies) <= 1e-12 * energies[0]).all()
        longest = max(longest, np.count_nonzero(shot.events["time"] < 1e-9))
    assert longest > (2 if angle == 60.0 else 8)


@pytest.mark.parametrize("n", [2, 4])
def test_balls_in_a_corner_stay_symmetric_about_the_diagonal(n):
    """The cue ball hits a ball that touches both cushions; balls 2 and 3 touch it and one cushion each."""
    x = 2.25 - R
    places = [[0.2, 0.2], [x, x], [x - 2 * R, x], [x, x - 2 * R]][:n]
    shot = simulate(scene_of("han2005", n=n, e_ball=0.95), places, [2.0, 2.0], record=True)
    assert shot.cushions.sum() >= 2
    assert shot.positions[0, 0] == pytest.approx(shot.positions[0, 1], abs=1e-12)
    assert shot.positions[1, 0] == pytest.approx(shot.positions[1, 1], abs=1e-12)
    if n == 4:
        assert shot.positions[2] == pytest.approx(shot.positions[3, ::-1], abs=1e-12)


def test_two_balls_in_two_corners_at_one_instant():
    """Their four events are in the order of the balls, with a piece of a trajectory for each."""
    shot = simulate(scene_of("han2005", n=2), [[0.2, 0.2], [-0.2, 0.2]], [[1.5, 1.5], [-1.5, 1.5]], record=True)
    assert [(b, o) for k, b, o in kinds(shot) if k == "cushion"] == [(0, 1), (0, 3), (1, 0), (1, 3)]
    np.testing.assert_array_equal(shot.positions[0], shot.positions[1] * [-1.0, 1.0])
    assert shot.cushions.tolist() == [2, 2]
    np.testing.assert_array_equal(shot.at(shot.time), shot.positions)


@pytest.mark.parametrize("law", ["restitution", "han2005"])
def test_the_derivative_at_a_corner_is_that_of_the_order_of_the_record(law):
    scene, axis = scene_of(law), np.array([1.5, 1.5])
    both = simulate(scene, [[0.2, 0.2]], axis, record=True)
    assert derivatives.nonsmooth(both) == (2, "simultaneous")
    jacobian = derivatives.jacobian(both)[0, :, 0]
    np.testing.assert_allclose(derivatives.vjp(both, {"positions": [[1.0, 0.0]]})[0], jacobian[0], rtol=1e-12)
    assert (np.abs(jacobian) < 10.0).all()
    if law == "restitution":  # both orders have the same result
        first = simulate(scene, [[0.2 + 1e-9, 0.2]], axis, record=True)
        assert derivatives.nonsmooth(first) == (-1, "")
        np.testing.assert_allclose(jacobian, derivatives.jacobian(first)[0, :, 0], atol=1e-6)


@pytest.mark.parametrize("fix", FIXES)
def test_pit_is_symmetric_about_the_diagonal(fix):
    scene, engine = scene_of("han2005"), Engine("pit", 1 / 60, fix)
    shot = simulate(scene, [[0.2, 0.2]], [1.5, 1.5], engine=engine)
    assert shot.positions[0, 0] == pytest.approx(shot.positions[0, 1], abs=1e-12)
    for y in (0.201, 0.21, 0.23):
        one = simulate(scene, [[0.2, y]], [1.5, 1.5], engine=engine)
        two = simulate(scene, [[y, 0.2]], [1.5, 1.5], engine=engine)
        assert one.positions[0] == pytest.approx(two.positions[0, ::-1], abs=1e-12)
    across = simulate(scene_of("han2005", DIAMOND), [[0.1, 0.0]], [1.5, 0.0], engine=engine)
    assert across.positions[0, 1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("law", ["restitution", "han2005"])
@pytest.mark.parametrize("outline", [False, True])
def test_a_ball_that_spin_presses_into_a_corner_stays_on_its_diagonal(law, outline):
    scene, x = scene_of(law, with_corners(SQUARE) if outline else SQUARE), 2.25 - R
    shot = simulate(scene, [[x, x]], [0.0, 0.0], spins=[[-50.0, 50.0, 0.0]])
    assert shot.n_contact_rule > 0
    assert shot.positions[0, 0] == shot.positions[0, 1]
    assert shot.positions[0, 0] == pytest.approx(x, abs=1e-6)


@entry_point
def end_of_path(scene, start, velocity, gaps):
    """Returns the end of the path that the players compute for a ball that slides without spin, m."""
    return _end_of_path(scene, start, velocity, gaps)


@allocating
def _end_of_path(scene, start, velocity, gaps):
    state = empty_state(1, 2)
    row = state.rows[0]
    row[:] = 0.0
    row[X], row[Y] = start
    row[VX], row[VY] = row[UX], row[UY] = velocity
    follow_path(scene, state, 0, gaps)
    return row[X], row[Y]


@pytest.mark.parametrize("velocity", [(1.5, 1.5), (1.5, 1.2)])
def test_the_paths_of_players_leave_a_corner_as_the_engine_does(velocity):
    scene = scene_of("han2005")
    shot = simulate(scene, [[0.2, 0.2]], velocity)
    assert end_of_path(scene_arrays(scene), (0.2, 0.2), velocity, np.empty(8)) == tuple(shot.positions[0])
