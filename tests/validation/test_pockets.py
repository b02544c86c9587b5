"""Paths of single balls into pockets."""

import pytest

from benchmarks.validation import pockets as p


@pytest.fixture(scope="module")
def board():
    return p.papers_table()


def test_the_side_pocket_is_as_wide_as_published(board):
    potted, clean = p.opening_widths(board, "side", p.SPEEDS["slow"], 0.0)
    assert potted == pytest.approx(3.35, abs=0.05)
    assert clean < 5.0625 - 2.25


def test_the_steepest_path_into_a_side_pocket_is_the_published_one(board):
    assert p.steepest(board, p.SPEEDS["slow"]) == pytest.approx(68.3, abs=0.2)


@pytest.mark.parametrize("pocket", ["side", "corner"])
def test_fast_balls_have_a_smaller_target(board, pocket):
    slow, fast = (p.opening_widths(board, pocket, speed, 0.0)[0] for speed in p.SPEEDS.values())
    assert fast < slow
