"""The second referees agree with the games, and a wrong verdict is found."""

import pytest

from benchmarks.referees import CASES, Rotation, compare


@pytest.mark.parametrize("name", CASES)
def test_both_referees_agree(name):
    turns, _, difference = compare(name, 0)
    assert turns > 1
    assert not difference


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_both_referees_agree_in_many_games(name):
    found = [difference for seed in range(1, 100) if (difference := compare(name, seed)[2])]
    # The games try 81 places of a cue ball in hand in the D (`snooker.is_snookered`), and the second referee 711.
    assert [one for one in found if "free_ball True, second referee False" not in one] == []
    assert len(found) < 5


def test_a_wrong_verdict_is_found(monkeypatch):
    monkeypatch.setattr(Rotation, "third_foul", lambda self, foul: False)
    found = next(difference for seed in range(20) if (difference := compare("nine_ball", seed)[2]))
    assert found.startswith("nine_ball, seed ")
    assert "over True, second referee False" in found
