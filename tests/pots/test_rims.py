"""The rims of pockets as seen from a point: they agree with the methods of `Pocket`."""

import numpy as np
import pytest

from billiards_env.pots import rims
from billiards_env.scene import Pocket, Table

POCKET = Pocket(0.3, -0.2, 0.06)
(ROW,) = Table(pockets=(POCKET,)).pocket_rows


def test_the_width_is_that_of_the_pocket():
    assert rims.half_width_of(ROW) == POCKET.half_width


def test_the_gap_of_a_segment_is_its_least_distance_from_the_rim():
    for a, b in np.random.default_rng(0).normal(POCKET.circle[:2], POCKET.radius, (100, 2, 2)):
        path = a + np.linspace(0, 1, 2001)[:, None] * (b - a)
        assert rims.segment_gap(ROW, *a, *b) == pytest.approx(POCKET.distance(path).min(), abs=1e-4)


def test_the_ends_of_a_rim_are_tangents():
    right_x, right_y, left_x, left_y = rims.rim_ends(ROW, 0.0, 0.0, 1.0, 1.0, 0.0)
    for end in ((right_x, right_y), (left_x, left_y)):
        assert POCKET.distance(end) == pytest.approx(0.0, abs=1e-15)
        assert np.dot(end, np.subtract(end, (POCKET.x, POCKET.y))) == pytest.approx(0.0, abs=1e-15)
    assert right_x * left_y - right_y * left_x > 0.0
    assert rims.rim_ends(ROW, POCKET.x, POCKET.y, 1.0, 1.0, 0.0) == (0.0, 0.0, 0.0, 0.0)
    assert rims.distance_along(ROW, POCKET.x - 1.0, POCKET.y, 1.0, 0.0) == pytest.approx(1.0 - 0.06)
