"""The scenes of pooltool reproduce its shots with throw, compliant cushions and jaws."""

import pytest

from benchmarks.validation import pooltool


@pytest.mark.parametrize("number", range(120))
def test_a_shot_agrees_with_pooltool(number):
    comparison = pooltool.compare(pooltool.recorded_shots()[number])
    assert comparison["same_contacts"]
    assert comparison["same_potted"]
    assert comparison["error_m"] < 1e-4
    assert comparison["error_s"] < 1e-4
