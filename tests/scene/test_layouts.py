import hashlib
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env import simulate
from billiards_env.scene import SCENES, Balls, Scene, check_positions, layouts
from tests.helpers.scenes import LARGE_AND_SMALL, ideal, three_balls


def draws(name, scene, count, seed=0):
    rng = np.random.default_rng(seed)
    return np.array([layouts.draw(name, scene, rng) for _ in range(count)])


def reach_of(scene):
    """Returns the largest abs(x) and abs(y) of the centre of each ball, (n, 2) m."""
    half = np.array([scene.table.length, scene.table.width]) / 2
    return half - np.array(scene.balls.radius)[:, None] - layouts.PLACING_GAP


def check_clear(scene, positions):
    """Checks that balls (m, n, 2) are clear of each other, of cushions and of pockets."""
    check_positions(scene, positions)
    radius, gaps = scene.balls.radius, []
    assert np.all(np.abs(positions) <= reach_of(scene))
    for i, j in itertools.combinations(range(scene.n_balls), 2):
        gaps.append(np.linalg.norm(positions[:, i] - positions[:, j], axis=-1) - (radius[i] + radius[j]))
    for pocket in scene.table.pockets:
        gaps += list(np.linalg.norm(positions - (pocket.x, pocket.y), axis=-1) - pocket.radius)
    assert all(gap.min() >= layouts.PLACING_GAP - 1e-15 for gap in gaps)


@pytest.mark.parametrize("n_object_balls", [0, 1, 2, 9, 15])
@pytest.mark.parametrize("scene", SCENES)
def test_random_balls_are_clear_of_each_other_of_cushions_and_of_pockets(scene, n_object_balls):
    scene = Scene.named(scene, n_object_balls)
    check_clear(scene, draws("random", scene, 300))


def test_random_balls_are_uniform_over_the_table():
    scene = Scene.named("carom", 1)
    uniform = draws("random", scene, 4000) / reach_of(scene)
    assert np.abs(uniform).max() > 0.995
    assert np.abs(uniform.mean(axis=0)).max() < 0.05
    np.testing.assert_allclose((uniform**2).mean(axis=0), 1 / 3, atol=0.03)


ONE_LARGE = ideal(Balls(radius=(*[0.03] * 60, 0.5), mass=(0.2,) * 61))


@pytest.mark.parametrize(("scene", "count"), [(LARGE_AND_SMALL, 300), (ONE_LARGE, 20), (Scene.named("ideal", 500), 1)])
def test_random_places_balls_of_any_size_and_number(scene, count):
    check_positions(scene, draws("random", scene, count))


@pytest.mark.parametrize("name", ["rack", "tight_rack"])
@pytest.mark.parametrize("n_object_balls", [0, 1, 2, 3, 6, 9, 10, 15])
@pytest.mark.parametrize("scene", SCENES)
def test_racks_are_valid_and_the_cue_ball_is_behind_the_head_string(scene, n_object_balls, name):
    scene = Scene.named(scene, n_object_balls)
    positions = draws(name, scene, 50)
    check_positions(scene, positions)
    cue = positions[:, 0]
    assert np.all(cue[:, 0] <= scene.table.head_x)
    behind = scene.table.length / 2 + scene.table.head_x
    assert np.ptp(cue[:, 0]) > 0.84 * (behind - scene.balls.radius[0])
    assert np.ptp(cue[:, 1]) > 0.7 * scene.table.width


def neighbour_gaps(scene, positions):
    """Returns the gaps, m, between neighbouring object balls of the rack."""
    radius = scene.balls.radius[0]
    pairs = itertools.combinations(range(1, scene.n_balls), 2)
    gaps = np.array([np.linalg.norm(positions[:, i] - positions[:, j], axis=-1) for i, j in pairs]) - 2 * radius
    return gaps[gaps.min(axis=1) < radius / 2]


@pytest.mark.parametrize(("n_object_balls", "contacts"), [(2, 1), (3, 3), (9, 16), (15, 30)])
def test_a_loose_rack_has_small_random_gaps_and_a_tight_rack_has_no_gaps(n_object_balls, contacts):
    scene = Scene.named("pool", n_object_balls)
    loose = neighbour_gaps(scene, draws("rack", scene, 500))
    low, high = layouts.RACK_GAP
    assert len(loose) == contacts
    assert low <= loose.min() < low + 1e-4
    assert high - 1e-4 < loose.max() <= high
    tight = neighbour_gaps(scene, draws("tight_rack", scene, 1))
    assert len(tight) == contacts
    assert np.abs(tight).max() < 1e-15


def test_a_rack_is_filled_row_by_row_from_the_foot_spot():
    scene = Scene.named("pool", 15)
    rack = layouts.draw("tight_rack", scene, np.random.default_rng(0))[1:]
    assert rack[0].tolist() == [scene.table.length / 4, 0.0]
    rows, counts = np.unique(rack[:, 0].round(9), return_counts=True)
    assert counts.tolist() == [1, 2, 3, 4, 5]
    np.testing.assert_allclose(np.diff(rows), math.sqrt(3) * scene.balls.radius[0], atol=1e-8)
    diamond = layouts.draw("tight_rack", Scene.named("pool", 9), np.random.default_rng(0))[1:]
    assert np.unique(diamond[:, 0].round(9), return_counts=True)[1].tolist() == [1, 2, 3, 2, 1]


def places_in_rack(name, n_object_balls, count):
    """Returns the numbers of the balls, (count, n_object_balls), in the order of the places of a tight rack."""
    scene = Scene.named("pool", n_object_balls)
    spots = layouts.draw("tight_rack", scene, np.random.default_rng(0))[1:]
    spots[:, 0] = (spots[:, 0] - spots[0, 0]) * (1 + 3e-4 / 0.05715) + spots[0, 0]
    balls = []
    for positions in draws(name, scene, count):
        distance = np.linalg.norm(positions[1:, None] - spots[None], axis=2)
        assert distance.min(axis=0).max() < 3e-3
        balls.append(1 + distance.argmin(axis=0))
    return np.array(balls)


RACK_PLACES = [
    ("nine_ball", {1: 0, 9: 4}, [1, 2, 3, 5, 6, 7, 8]),
    ("ten_ball", {1: 0, 10: 4}, [1, 2, 3, 5, 6, 7, 8, 9]),
    ("eight_ball", {8: 4}, [0, 10, 14]),
]


@pytest.mark.parametrize(("game", "fixed", "random"), RACK_PLACES)
def test_the_rack_of_a_game(game, fixed, random):
    """Some balls have a place, and every other ball is at the random places equally often."""
    n = len(layouts.RACKS[game].balls)
    racks = places_in_rack(game, n, 600)
    assert all((racks[:, place] == ball).all() for ball, place in fixed.items())
    assert (np.sort(racks, axis=1) == np.arange(1, n + 1)).all()
    others = np.setdiff1d(np.arange(1, n + 1), list(fixed))
    counts = (racks[:, random, None] == others).sum(axis=0)
    assert np.abs(counts - 600 / len(others)).max() < 5 * np.sqrt(600 / len(others))
    if game == "eight_ball":
        assert ((racks[:, [10, 14]] < 8).sum(axis=1) == 1).all()


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("n_object_balls", [1, 2])
def test_the_carom_opening_is_fixed(scene, n_object_balls):
    scene = Scene.named(scene, n_object_balls)
    first, second = draws("carom_opening", scene, 2)
    check_positions(scene, first)
    length, width = scene.table.length, scene.table.width
    spots = [[-length / 4, -0.1825 / 1.42 * width], [length / 4, 0.0], [-length / 4, 0.0]]
    np.testing.assert_allclose(first, spots[: len(first)], rtol=1e-15)
    assert np.array_equal(first, second)


def test_a_frame_of_snooker_begins_with_the_colours_on_their_spots():
    scene = Scene.named("snooker")
    positions = draws("snooker", scene, 400)
    check_positions(scene, positions)
    check_positions(Scene.named("snooker", 12), draws("snooker", Scene.named("snooker", 12), 1))  # fewer red balls
    assert (positions[:, 1:] == positions[0, 1:]).all()
    baulk, d, r = 0.737 - 3.569 / 2, 0.292, 0.02625
    spots = [[baulk, -d], [baulk, d], [baulk, 0], [0, 0], [3.569 / 4, 0], [3.569 / 2 - 0.324, 0]]
    np.testing.assert_allclose(positions[0, -6:], spots, rtol=1e-12, atol=1e-12)
    reds = positions[0, 1:16]
    assert 2 * r < reds[0, 0] - 3.569 / 4 < 2 * r + 1e-3
    assert np.unique(reds[:, 0].round(9), return_counts=True)[1].tolist() == [1, 2, 3, 4, 5]
    # The cue ball is anywhere in the D.
    cue = positions[:, 0]
    assert (cue[:, 0] <= baulk).all()
    distance = np.hypot(cue[:, 0] - baulk, cue[:, 1])
    assert 0.95 * d < distance.max() <= d
    assert np.ptp(cue[:, 1]) > 1.8 * d


def test_random_balls_are_inside_an_outline_that_is_no_rectangle():
    hexagon = [(-1.0, 0.0), (-0.5, -0.75), (0.5, -0.75), (1.0, 0.0), (0.5, 0.75), (0.2, 0.75), (0.0, 0.4), (-0.5, 0.75)]
    corners = [{"x": x, "y": y} for x, y in hexagon]
    corners[6]["radius"] = 0.1
    table = {"length": 2.0, "width": 1.5, "outline": corners}
    scene = Scene.from_dict({"balls": {"radius": [0.03] * 5, "mass": [0.2] * 5}, "table": table})
    positions = draws("random", scene, 300)
    check_positions(scene, positions)
    gaps = scene.table.clearance(positions) - 0.03
    assert layouts.PLACING_GAP <= gaps.min() < 2 * layouts.PLACING_GAP


@pytest.mark.parametrize("scene", SCENES)
def test_line_places_both_balls_on_the_long_axis(scene):
    scene = Scene.named(scene, 1)
    length = scene.table.length
    assert draws("line", scene, 1)[0].tolist() == [[-length / 4, 0.0], [length / 4, 0.0]]


RADII = st.floats(0.02, 0.05)
SNOOKERED = st.tuples(RADII, RADII, RADII).map(lambda r: three_balls(r[0], *sorted(r[1:])))


@given(scene=SNOOKERED, seed=st.integers(0, 2**32))
def test_snookered_balls_lie_on_a_line_clear_of_everything(scene, seed):
    places = layouts.draw("snookered", scene, np.random.default_rng(seed))
    check_clear(scene, places[None])
    assert places[2].tolist() == (0.5 * (places[0] + places[1])).tolist()


@given(scene=SNOOKERED, seed=st.integers(0, 2**32), cut=st.floats(-1, 1), speed=st.floats(2.0, 8.0))
def test_no_straight_path_of_a_snookered_cue_ball_meets_ball_1_first(scene, seed, cut, speed):
    places = layouts.draw("snookered", scene, np.random.default_rng(seed))
    # The cue ball's initial line passes the centre of ball 1 at `cut` times the sum of the radii.
    way, reach = places[1] - places[0], scene.balls.radius[0] + scene.balls.radius[1]
    angle = math.atan2(way[1], way[0]) + math.asin(cut * reach / math.hypot(*way))
    velocity = speed * math.cos(angle), speed * math.sin(angle)
    shot = simulate(scene, places, velocity, record=True)
    assert shot.events is not None
    touched = shot.events[shot.events["kind"] != "sliding_rolling"][0]
    assert (touched["kind"], touched["ball"], touched["other"]) == ("ball_ball", 0, 2)


def test_snookered_covers_the_whole_table():
    scene = Scene.named("blocked_pool")
    positions = draws("snookered", scene, 3000)
    shares = positions / reach_of(scene)
    assert (np.abs(shares[:, :2]).max(axis=(0, 1)) > 0.99).all()
    assert np.abs(shares.mean(axis=0)).max() < 0.05
    # Each ball is on the left with probability 1/2, so neither is drawn relative to the other.
    assert abs((positions[:, 0, 0] < positions[:, 1, 0]).mean() - 0.5) < 0.03


def test_draws_are_the_same_on_every_machine():
    """Compares a digest of the raw doubles, so any different bit fails."""
    digest = hashlib.sha256()
    for name, n_object_balls in [("random", 15), ("rack", 9), ("tight_rack", 15), ("carom_opening", 2), ("line", 1)]:
        digest.update(draws(name, Scene.named("pool", n_object_balls), 20, seed=1).astype("<f8").tobytes())
    assert digest.hexdigest() == "01be9ea39cf79dfa4a23726c49a685923818f97f1e3bcb706892d17c0055080e"
