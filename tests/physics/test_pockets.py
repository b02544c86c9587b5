"""The geometry of pockets: compiled functions and the methods of `Pocket` agree, and both agree with the definition."""

import dataclasses

import numpy as np
import pytest

from billiards_env.physics.geometry import pockets as kernels
from billiards_env.physics.geometry.contact import circle_time
from billiards_env.physics.motion import Path
from billiards_env.scene import Pocket, Table
from billiards_env.scene.table import six_pockets

POCKETS = (Pocket(0.3, -0.2, 0.06), *six_pockets()[:2])
ROWS = Table(pockets=POCKETS).pocket_rows


def points_near(pocket, count=200):
    x, y, radius = pocket.circle
    return np.random.default_rng(0).normal((x, y), radius, (count, 2))


def test_the_rows_of_a_table_are_the_fields_of_its_pockets():
    assert ROWS.tolist() == [list(dataclasses.astuple(pocket)) for pocket in POCKETS]
    assert Table(pockets=POCKETS).pocket_places.tolist() == [[pocket.x, pocket.y] for pocket in POCKETS]
    assert (Table().pocket_rows.shape, Table().pocket_places.shape) == ((0, 3), (0, 2))


@pytest.mark.parametrize("k", range(len(POCKETS)))
def test_compiled_functions_agree_with_the_methods_of_a_pocket(k):
    pocket, row = POCKETS[k], ROWS[k]
    points = points_near(pocket)
    distances = [kernels.distance_from(row, x, y) for x, y in points]
    np.testing.assert_allclose(pocket.distance(points), distances, rtol=0, atol=1e-15)
    inside = pocket.contains(points)
    assert 0 < inside.sum() < len(points)
    assert [kernels.pocket_at(ROWS[k : k + 1], x, y, 1.0) == 0 for x, y in points] == inside.tolist()
    assert pocket.contains(points, 0.01).tolist() == (pocket.distance(points) < -0.01).tolist()
    assert kernels.centre_of(row) == (pocket.x, pocket.y)
    assert kernels.bounding_circle(row) == pocket.circle
    rim = pocket.rim()
    np.testing.assert_allclose(pocket.distance(rim), 0.0, atol=1e-15)
    for x, y in rim:
        nx, ny = kernels.outwards_at(row, x, y)
        assert kernels.distance_from(row, x + 0.01 * nx, y + 0.01 * ny) > 0.0


def test_the_pockets_near_a_path_are_those_that_it_may_reach():
    rows, counts = Table(pockets=six_pockets()).pocket_rows, []
    for place, velocity in np.random.default_rng(1).normal(size=(200, 2, 2)):
        path = Path(*(place * (0.5, 0.25)), *velocity, *(-0.1 * velocity))
        first, last = kernels.pockets_near(path, 1.0, rows)
        reached = [k for k, row in enumerate(rows) if circle_time(*kernels.path_to(path, row), 1.0, 0.0) < np.inf]
        assert set(reached) <= set(range(first, last + 1))
        counts.append((len(reached), max(0, last + 1 - first)))
    assert np.array(counts).any(axis=0).all()
    assert np.mean(counts, axis=0)[1] < 2.0
    assert kernels.pockets_near(Path(0.0, 0.0, 0.1, 0.0, 0.0, 0.0), 1.0, rows)[1] == -1
