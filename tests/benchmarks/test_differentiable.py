"""The published tasks are solved with the exact derivatives."""

from __future__ import annotations

import pytest

from benchmarks import differentiable


def test_a_break_of_difftaichi_is_moved_to_the_goal():
    found = differentiable.difftaichi(0)["own"]
    assert found["iterations"] <= 10
    assert found["distance"] < 1e-6


@pytest.mark.parametrize("control", [-5.0, -2.0, 0.1, 3.0])
def test_a_push_of_diffmjx_is_found_in_five_iterations(control):
    found = differentiable.solve_push(control)
    assert found["iterations"] <= 5
    assert found["distance"] < 1e-6


def test_the_gradient_of_nimble_is_exact():
    assert differentiable.nimble() == pytest.approx([1.0, 0.0, 1.0, 0.0], abs=1e-15)
