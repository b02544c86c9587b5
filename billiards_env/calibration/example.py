"""Tracks of simulated shots, to try `calibrate` without a camera."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from billiards_env.calibration.calibrate import free_names
from billiards_env.calibration.fit import values_of, with_physics
from billiards_env.calibration.tracks import Track, observed, write_tracks
from billiards_env.scene import Scene, layouts
from billiards_env.shots.simulation import simulate

SHOTS, FPS, NOISE, CHANGE = 10, 30, 0.001, 0.95
"""The number of shots, the frames per second, the noise of a coordinate, m, and the constants over those of a scene."""


def write_example(path: str | os.PathLike[str], scene: Scene) -> str:
    """Writes tracks of shots on a table whose constants are a little smaller than those of a scene.

    Returns:
        A sentence with the constants.

    Raises:
        FileExistsError: If the file exists.
        ValueError: If the scene has no object ball, or its shots have no derivatives.
    """
    if Path(path).exists():
        raise FileExistsError(f"tracks = {str(path)!r}: expected a new file for the example")
    if scene.n_balls < 2:
        raise ValueError("scene without object balls: expected at least one for the example")
    free = free_names(scene, None)
    table = with_physics(scene, **{name: CHANGE * value for name, value in values_of(scene, free).items()})
    write_tracks(path, [_track(table, k) for k in range(SHOTS)])
    values = ", ".join(f"{name} {value:.4g}" for name, value in values_of(table, free).items())
    return f"wrote {path}: {SHOTS} simulated shots with {values}"


def _track(scene: Scene, number: int) -> Track:
    """Returns the track of a random shot that hits ball 1."""
    rng = np.random.default_rng(number)
    places = layouts.draw("random", scene, rng)
    ahead = places[1] - places[0]
    angle = np.arctan2(ahead[1], ahead[0]) + rng.uniform(-1.0, 1.0) * scene.balls.radius[0] / np.hypot(*ahead)
    velocity = rng.uniform(1.5, 3.0) * np.array([np.cos(angle), np.sin(angle)])
    shot = simulate(scene, places, velocity, record=True)
    return observed(str(number + 1), shot, np.arange(0.0, shot.time, 1 / FPS), NOISE, number)
