"""The choice of the engine, and the conversion of a scene to arrays."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from billiards_env.checks import RANGES, choose, fits, short
from billiards_env.engine import pic, pit
from billiards_env.engine.contact_rule import set_rule
from billiards_env.physics.state import (
    CUSHION,
    CUSHION_HEIGHT,
    DT,
    E_BALL,
    E_CUSHION,
    E_FLOOR,
    E_LOSS,
    E_ONSET,
    FIX,
    FIXES,
    HALF_LENGTH,
    HALF_WIDTH,
    HAN2005,
    IDEAL,
    MATHAVAN2010,
    MOTION,
    MU_CUSHION,
    N_PARAMS,
    RESTITUTION,
    ROLL,
    ROLLING_ONLY,
    SLIDE,
    SLIDING_AND_ROLLING,
    SPIN_DECAY,
    STRONGE,
    Floats,
    SceneArrays,
)
from billiards_env.physics.walls import outline_arrays
from billiards_env.scene import Physics, Scene, ball_friction

MODES = {"pic": pic.run_shots, "pit": pit.run_shots}
"""The function that runs shots for each mode. `engine_of` returns other functions of PIC for at most two and for many
balls. All have the same arguments."""

MOTIONS = {"ideal": IDEAL, "rolling": ROLLING_ONLY, "sliding": SLIDING_AND_ROLLING}
"""The entry MOTION of `SceneArrays.params` for each motion of a scene."""

CUSHIONS: dict[str, tuple[int, Callable[[Physics], dict[str, Floats]]]] = {
    "restitution": (RESTITUTION, lambda physics: {}),
    "han2005": (HAN2005, lambda physics: {}),
    "stronge": (STRONGE, lambda physics: {"stronge": np.array([physics.cushion_frequency_ratio])}),
    "mathavan2010": (MATHAVAN2010, lambda physics: {"mathavan": np.array([physics.mu_slide])}),
}
"""The entry CUSHION of `SceneArrays.params`, and the other fields of `SceneArrays`, for each cushion of a scene."""

BALL_BALL: dict[str, Callable[[Physics], Floats | None]] = {
    "frictionless": lambda physics: None,
    "frictional": lambda physics: np.array(ball_friction(physics)),
}
"""`SceneArrays.ball_friction` for each contact between balls of a scene."""

MANY_BALLS = 160
"""From this number of balls on PIC uses `engine.cell_grid`.

The grid is faster from this number on in a thin gas, and from about 110 balls on in a dense gas. In a rack, which fills
only a few cells, it is not faster with up to 400 balls.
"""

MAX_EVENTS = 10_000_000
"""Default number of events after which the engine ends a shot.

A break has hundreds of events, at most thousands; a heap of balls pressed into a corner by extreme spins has millions.
"""


def engine_of(mode: str, n_balls: int) -> Callable[..., None]:
    """Returns the function that runs shots of a number of balls in a mode."""
    if mode == "pic" and n_balls <= 2:
        return pic.run_shots_of_two
    return pic.run_shots_of_many if mode == "pic" and n_balls >= MANY_BALLS else MODES[mode]


def check_mode(mode: str, dt: float | None, fix: str | None) -> None:
    """Raises a ValueError unless `mode` is an engine, and `dt` and `fix` are valid for it."""
    choose("mode", mode, tuple(MODES))
    if mode == "pic":
        if dt is not None:
            raise ValueError(
                f"dt = {short(dt)} with mode='pic': expected None, PIC has no timestep (mode='pit' has one)"
            )
        if fix is not None:
            raise ValueError(f"fix = {short(fix)} with mode='pic': expected None, PIC has no overlaps to fix")
        return
    if not fits(dt, "dt"):
        least, most, unit, _ = RANGES["dt"]
        raise ValueError(
            f"dt = {short(dt)} with mode='pit': expected the timestep, a number from {least:g} to {most:g} {unit}, "
            f"such as 1/60{', not str' if isinstance(dt, str) else ''}"
        )
    if fix is not None:
        choose("fix", fix, FIXES)


def scene_arrays(scene: Scene, dt: float | None = None, fix: str | None = None) -> SceneArrays:
    """Returns the arrays of a scene, with the settings of PIT. The same arguments return the same arrays."""
    global _latest
    for_scene, for_dt, for_fix, arrays = _latest
    if for_scene is scene and for_dt == dt and for_fix == fix:
        return arrays  # faster than the cache, which hashes the scene in a microsecond
    arrays = _scene_arrays(scene, dt, fix)
    _latest = scene, dt, fix, arrays
    return arrays


_latest: tuple[Any, Any, Any, Any] = None, None, None, None  # the arguments and the result of the last call


@functools.lru_cache(maxsize=256)
def _scene_arrays(scene: Scene, dt: float | None, fix: str | None) -> SceneArrays:
    p = scene.physics
    for name, laws in (("motion", MOTIONS), ("cushion", CUSHIONS), ("ball_ball", BALL_BALL)):
        choose(f"physics.{name}", getattr(p, name), tuple(laws))  # a name of `scene` without a law
    params = np.zeros(N_PARAMS)
    params[MOTION] = MOTIONS[p.motion]
    params[CUSHION], cushion = CUSHIONS[p.cushion][0], CUSHIONS[p.cushion][1](p)
    params[SLIDE], params[ROLL] = p.mu_slide * p.g, p.mu_roll * p.g
    params[SPIN_DECAY] = p.spin_decay
    params[E_BALL], params[E_CUSHION], params[MU_CUSHION] = p.e_ball, p.e_cushion, p.mu_cushion
    params[HALF_LENGTH], params[HALF_WIDTH] = scene.table.length / 2, scene.table.width / 2
    params[CUSHION_HEIGHT] = scene.table.cushion_height
    params[E_LOSS], params[E_ONSET], params[E_FLOOR] = p.e_cushion_loss, p.e_cushion_onset, p.e_cushion_floor
    set_rule(params, scene.balls.mass)
    params[DT] = 0.0 if dt is None else dt
    params[FIX] = FIXES.index(FIXES[0] if fix is None else fix)
    pockets = np.array([(q.x, q.y, q.radius) for q in scene.table.pockets]).reshape(-1, 3)
    outline = None
    if scene.table.outline:
        outline = outline_arrays(scene.table.outline, params[HALF_LENGTH], params[HALF_WIDTH], pockets.tolist())
    sizes = len(set(scene.balls.radius))
    spheres = np.array(scene.balls.radius) if scene.balls.shape == "sphere" and sizes > 1 else None
    return SceneArrays(
        params,
        np.array(scene.balls.radius),
        1.0 / np.array(scene.balls.mass),
        pockets,
        outline,
        BALL_BALL[p.ball_ball](p),
        spheres=spheres,
        **cushion,
    )
