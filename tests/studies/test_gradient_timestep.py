"""The study of derivatives through a timestep."""

import json

import numpy as np
import pytest

from billiards_env.engine.overlaps import FIXES
from studies import gradient_timestep
from studies.gradient_timestep import Shots, blocks, draw_shots, errors, exact_derivatives, main, pit


@pytest.fixture
def small(tmp_path, monkeypatch):
    """Returns the arguments of a tiny study."""
    steps = (60, 240, 960)
    monkeypatch.setattr(gradient_timestep, "STEPS", steps)
    monkeypatch.setattr(gradient_timestep, "CELLS", {f"{fix} 1/{n} s": pit(n, fix) for n in steps for fix in FIXES})
    kinds = {kind: (*numbers, 80) for kind, (*numbers, _) in gradient_timestep.KINDS.items()}
    monkeypatch.setattr(gradient_timestep, "KINDS", kinds)
    monkeypatch.setattr(gradient_timestep, "PASSES", 1)
    return ["--output", str(tmp_path / "gradient_timestep.json"), "--images", str(tmp_path)]


def test_the_study_runs_and_continues_where_it_was_interrupted(small, tmp_path, monkeypatch, capsys):
    measured = []

    def spy(*arguments, **engine):
        measured.append(engine)
        if len(measured) == 5:
            raise KeyboardInterrupt
        return errors(*arguments, **engine)

    monkeypatch.setattr(gradient_timestep, "errors", spy)
    with pytest.raises(SystemExit):
        main(small)
    main(small)
    assert len(measured) == 1 + 3 * (1 + 3 * len(FIXES))
    assert measured[5] == measured[4]
    found = json.loads((tmp_path / "gradient_timestep.json").read_text())
    printed = capsys.readouterr().out
    assert all(text in printed for text in blocks(found).values())
    assert {path.name for path in tmp_path.glob("*.png")} == {"gradient_timestep.png", "gradient_timestep_reason.png"}
    for kind, results in found["errors"].items():
        assert len(found["chosen"][kind]["numbers"]) > 5
        assert results["exact"]["small"] < 1e-5  # the rounding of the differences
        for fix in FIXES:
            coarse, *_, fine = (results[f"{fix} 1/{n} s"] for n in (60, 240, 960))
            assert fine["position"] < 0.2 * coarse["position"]
            assert (fine["small"] < 0.2 * coarse["small"]) == (fix == "time_of_impact")
    main(small)
    assert len(measured) == 1 + 3 * (1 + 3 * len(FIXES))


def test_the_error_of_the_derivative_after_a_cushion_is_the_share_of_the_time_before_it():
    """Without friction x(T) = d - v (T - t), where t is the timestep of the contact instead of d / v; T is 1 s."""
    shots = gradient_timestep.bounces(np.array([1.5]))
    exact = shots.run(record=True)
    derivatives = exact_derivatives(exact)
    contact = (1.0 - 0.03) / 1.5
    for fix, share in (("push_apart", contact), ("move_back", contact), ("none", 2.0 * contact), ("time_of_impact", 0)):
        found = errors(shots, exact.positions, derivatives, **pit(10_000, fix))["small"]
        assert found == pytest.approx(share / np.sqrt(2.0), abs=2e-4), fix  # the motion along y has no error


def test_shots_are_drawn_at_the_object_ball():
    shots = draw_shots("one ball")
    assert isinstance(shots, Shots)
    assert (shots.run(max_time=60.0).first_hit >= 0).mean() > 0.5
