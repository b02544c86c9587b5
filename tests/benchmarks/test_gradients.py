"""The errors of derivatives through a timestep; no time is asserted."""

import json

import numpy as np
import pytest

from benchmarks import gradients
from benchmarks.gradients import blocks, errors_of, main, pit
from billiards_env.engine.overlaps import FIXES


def test_only_the_derivatives_of_time_of_impact_converge(tmp_path, monkeypatch, capsys):
    steps = (60, 240, 960)
    engines = {f"{fix} 1/{n} s": pit(n, fix) for n in steps for fix in FIXES}
    for name, value in {"STEPS": steps, "ENGINES": engines, "DRAWN": 80, "cases": lambda scale: []}.items():
        monkeypatch.setattr(gradients, name, value)
    main(["--repeats", "1", "--output", str(tmp_path / "gradients.json"), "--images", str(tmp_path)])
    content = json.loads((tmp_path / "gradients.json").read_text())
    printed = capsys.readouterr().out
    assert all(text in printed for text in blocks(content).values())
    assert {path.name for path in tmp_path.glob("*.png")} == {"gradient_timestep.png", "gradient_timestep_reason.png"}
    assert len(content["chosen"]["numbers"]) > 5
    assert content["errors"]["exact"]["small"] < 1e-5  # the rounding of the differences
    for fix in FIXES:
        coarse, *_, fine = (content["errors"][f"{fix} 1/{n} s"] for n in steps)
        assert fine["position"] < 0.2 * coarse["position"]
        assert (fine["small"] < 0.2 * coarse["small"]) == (fix == "time_of_impact")


def test_the_error_after_a_cushion_is_the_share_of_the_time_before_it():
    """Without friction x(T) = d - v (T - t), where t is the timestep of the contact instead of d / v; T is 1 s."""
    shots = gradients.bounces(np.array([1.5]))
    contact = (1.0 - 0.03) / 1.5
    for fix, share in (("push_apart", contact), ("move_back", contact), ("none", 2.0 * contact), ("time_of_impact", 0)):
        error = errors_of(shots, pit(10_000, fix))["small"]
        assert error == pytest.approx(share / np.sqrt(2.0), abs=2e-4), fix  # the motion along y has no error
