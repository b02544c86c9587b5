"""The scenes of pooltool reproduce its shots with friction between balls, compliant cushions and jaws."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate

SHOTS: list[dict[str, Any]] = json.loads(
    (Path(__file__).resolve().parents[1] / "data" / "pooltool_real_shots.json").read_text(encoding="utf-8")
)["shots"]
"""Shots of pooltool 0.6.0."""
SCENES = {"carom": "pooltool_real_carom", "pool": "pooltool_pool"}


@pytest.mark.parametrize("number", range(120))
def test_a_shot_agrees_with_pooltool(number):
    shot = SHOTS[number]
    n = len(shot["positions"])
    start = shot["positions"], shot["velocity"]
    result = simulate(Scene.named(SCENES[shot["table"]], n - 1), *start, spins=shot["spin"], record=True)
    assert result.events is not None
    found = [
        (time, kind, {ball, other} if kind == "ball_ball" else {ball})
        for time, kind, ball, other, *_ in result.events.tolist()
        if kind in ("ball_ball", "cushion", "pocket")
    ]
    for (time, kind, balls), (their_time, their_kind, their_balls) in zip(found, shot["events"], strict=True):
        assert kind == their_kind
        assert set(their_balls) <= balls  # some events of the file lack a ball
        assert time == pytest.approx(their_time, abs=1e-4)
    assert result.potted.tolist() == [place is None for place in shot["final"]]
    for place, final in zip(result.positions, shot["final"], strict=True):
        assert final is None or np.hypot(*(place - final)) < 1e-4
