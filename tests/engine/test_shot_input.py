"""The arrays of shots, and the check of their input with few and with many balls."""

import dataclasses
import itertools

import numpy as np
import pytest

from billiards_env.engine.compile import MANY_BALLS, scene_fields, scene_kernels
from billiards_env.engine.shot_input import check_shot, is_valid_fast, is_valid_fast_of_many
from billiards_env.engine.shots import Shots, empty_shots
from billiards_env.scene import CONTACT_GAP, Balls, Physics, Scene, Table, check_positions
from billiards_env.support.checks import short
from tests.helpers.looks import looks
from tests.helpers.shots import lattice

IDEAL = Physics(motion="ideal", cushion="restitution", max_time=1.0)


def rows_of_balls(n, gap):
    """Returns a scene of n balls of 1 cm, and their positions in rows of touching balls; the rows are `gap` apart."""
    places = lattice(n, [0.02 + gap, 0.02])
    return Scene(Balls.uniform(n, 0.01), Table(*(np.ptp(places, axis=0) + 1.0).tolist()), IDEAL), places


def first_overlap(scene, positions, in_play):
    """Returns the message of the first overlap of two balls in play; None if there is none. It compares all pairs."""
    for i, j in itertools.combinations(range(scene.n_balls), 2):
        reach = scene.balls.contact_distances(i)[j]
        for k in range(len(positions)):
            distance = np.hypot(*(positions[k, j] - positions[k, i]))
            if in_play[k, i] and in_play[k, j] and distance < reach - CONTACT_GAP:
                return f"positions: shot {k}, balls {i} and {j} are {short(distance)} m apart"
    return None


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("m", [1, 3])
def test_the_arrays_of_shots_have_one_entry_for_each_ball(m, n):
    """NumPy 1.26 reads the type ("?", 1) as a scalar."""
    of_balls = {"positions": (2,), "velocities": (2,), "spins": (3,)}
    of_balls |= dict.fromkeys(("in_play", "cushions", "cushions_before_hit"), ())
    of_balls |= dict.fromkeys(("pockets", "pot_order", "touched_first"), ())
    of_balls["heights"] = (2,)
    arrays = empty_shots(m, n, flight=True, measures=("first_hit_velocities",))
    for name, array in zip(Shots._fields, arrays, strict=True):
        assert array is not None
        assert array.shape == ((m, n, *of_balls[name]) if name in of_balls else (m,)), name


@pytest.mark.parametrize("shape", ["disk", "sphere"])
def test_the_check_by_cells_finds_the_overlaps_of_all_pairs(shape):
    rng, n, m, overlaps = np.random.default_rng(0), 30, 3, 0
    for _ in range(60):
        balls = Balls(tuple(rng.uniform(0.01, 0.03, n).tolist()), (0.1,) * n, shape=shape)
        scene = Scene(balls, Table(*rng.choice([0.8, 3.0], 2).tolist()), IDEAL)
        room = np.array([scene.table.length, scene.table.width]) / 2 - np.array(balls.radius)[:, None]
        positions = rng.uniform(-1, 1, (m, n, 2)) * room
        in_play = rng.random((m, n)) < rng.choice([0.2, 0.5])
        positions[~in_play] *= 100.0
        message = first_overlap(scene, positions, in_play)
        starts = positions, np.zeros((m, n, 2)), np.zeros((m, n, 3)), in_play, np.zeros(m, np.int64), None
        for check in (is_valid_fast, is_valid_fast_of_many):
            assert check(scene_kernels(scene), 0, m, scene_fields(scene), starts) == (message is None)
        if message is None:
            check_positions(scene, positions, in_play=in_play)
        else:
            overlaps += 1
            with pytest.raises(ValueError, match=r"apart: expected at least .* at which they touch") as error:
                check_positions(scene, positions, in_play=in_play)
            assert str(error.value).startswith(message)
    assert 10 < overlaps < 50


@pytest.mark.parametrize("gap", [1e-3, 0.0])
def test_the_check_of_many_balls_does_not_compare_all_pairs(gap, monkeypatch):
    """It took 4 s for 100,000 balls apart from each other, and half an hour for balls that touch."""
    pairs, n, distances = 0, 20_000, Balls.contact_distances

    def counted(balls, i, j=slice(None)):
        nonlocal pairs
        pairs += np.size(i) if np.ndim(i) else len(balls)
        return distances(balls, i, j)

    monkeypatch.setattr(Balls, "contact_distances", counted)
    scene, places = rows_of_balls(n, gap)
    assert looks(monkeypatch, lambda: check_shot(scene, places, np.zeros((n, 2)), None, None, None))[0] == 0
    assert pairs == 0
    check_positions(scene, places)  # the slow check, which decides if balls are too close to a limit
    assert n < pairs < 3 * n**1.5


def test_many_balls_that_overlap_are_refused():
    scene, places = rows_of_balls(MANY_BALLS, 1e-3)
    places[100] = places[99] + [0.0, 0.015]
    with pytest.raises(ValueError, match="balls 99 and 100 are"):
        check_shot(scene, places, np.zeros((MANY_BALLS, 2)), None, None, None)
    half = dataclasses.replace(scene, table=dataclasses.replace(scene.table, length=0.1))
    with pytest.raises(ValueError, match="ball 0 is at"):
        check_shot(half, places, np.zeros((MANY_BALLS, 2)), None, None, None)
