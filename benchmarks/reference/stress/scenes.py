"""Small scenes with round numbers, for tests with known results."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.reference.stress.checks import check_shots
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.table import Table
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import simulate

R = 0.03125  # m, a power of two: sums and halves of it are exact


def ideal(
    *masses: float,
    e_ball: float = 1.0,
    e_cushion: float = 1.0,
    radius: tuple[float, ...] | None = None,
    length: float = 4.0,
    width: float = 2.0,
    max_time: float = 10.0,
) -> Scene:
    """Returns a scene of balls of these masses, kg, without friction."""
    physics = Physics(motion="ideal", cushion="restitution", e_ball=e_ball, e_cushion=e_cushion, max_time=max_time)
    return Scene(Balls(radius or (R,) * len(masses), masses), Table(length, width), physics)


def rough(*masses: float, length: float = 4.0, width: float = 2.0, **physics: Any) -> Scene:
    """Returns a scene of balls that slide and roll; cushions have simple restitution by default."""
    laws: dict[str, Any] = {"cushion": "restitution"} | physics
    return Scene(Balls((R,) * len(masses), masses), Table(length, width, 1.2 * R), Physics(**laws))


def checked_shot(scene: Scene, places: Any, velocities: Any, spins: Any = None, **options: Any) -> ShotResult:
    """Returns the recorded shot after a check of all rules at every event."""
    shot = simulate(scene, places, velocities, spins=spins, record=True, **options)
    moving, turning = np.array([velocities], float), None if spins is None else np.array([spins], float)
    result = check_shots(scene, np.array([places], float), moving, turning, **options)
    assert not result.bad(scene.physics.motion == "ideal").any(), result.findings
    return shot


def kinds(shot: ShotResult, *selected: str) -> list[tuple[str, int, int]]:
    """Returns (kind, ball, other) of the events, or only of the events of the given kinds."""
    assert shot.events is not None
    names = [(str(e["kind"]), int(e["ball"]), int(e["other"])) for e in shot.events]
    return [name for name in names if not selected or name[0] in selected]
