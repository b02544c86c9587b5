"""The motion of a ball on the cloth: how fast a rolling ball and a sliding ball slow down."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks import table
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate

MEASURED = {"rolls": (0.124, 0.126), "slides": (1.75, 2.40)}
"""m/s^2, the least and the largest deceleration of a snooker ball: Mathavan, Jackson and Parkin (2009)."""

SPEED = 0.5
"""m/s, at the start."""


def decelerations(scene: Scene) -> dict[str, float]:
    """Returns the deceleration, m/s^2, of the cue ball while it rolls and while it slides."""
    positions, alone = np.zeros((scene.n_balls, 2)), np.arange(scene.n_balls) == 0
    shots = {
        phase: simulate(scene, positions, [SPEED, 0.0], spins=[0.0, spin, 0.0], in_play=alone, record=True)
        for phase, spin in (("rolls", SPEED / scene.balls.radius[0]), ("slides", 0.0))
    }
    events = shots["slides"].events
    assert events is not None
    rolling = events["time"][0]  # at 5/7 of the speed
    return {"rolls": SPEED**2 / (2 * float(shots["rolls"].positions[0, 0])), "slides": float(2 / 7 * SPEED / rolling)}


def measure() -> dict[str, Any]:
    """Runs both shots in the scene "snooker"."""
    return decelerations(Scene.named("snooker", 2))


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = [
        [f"deceleration of a ball that {phase}, m/s²", f"{least:.3f} to {most:.3f}", f"{result[phase]:.4f}"]
        for phase, (least, most) in MEASURED.items()
    ]
    near, far = (SPEED**2 / (2 * rate) for rate in MEASURED["rolls"][::-1])
    way = SPEED**2 / (2 * result["rolls"])
    rows.append([f"distance that a ball rolls from {SPEED} m/s, m", f"{near:.3f} to {far:.3f}", f"{way:.3f}"])
    return {"motion": table(["snooker", "measured", "model"], rows)}
