"""The scenes of pooltool reproduce its shots with throw, compliant cushions and jaws."""

import pytest

from benchmarks.validation import pooltool


@pytest.mark.parametrize("number", range(120))
def test_a_shot_agrees_with_pooltool(number):
    found = pooltool.compare(pooltool.reference()[number])
    assert found["same_contacts"]
    assert found["same_potted"]
    assert found["error_m"] < 1e-4
    assert found["error_s"] < 1e-4
