"""Engines that run shots: `simulate` one, `simulate_batch` many, and what they give back."""

from billiards_env.engine.batch import BatchResult, simulate_batch
from billiards_env.engine.log import KINDS, NO_LOG, STATUS, Shots, empty_shots
from billiards_env.engine.shot import (
    MAX_EVENTS,
    ShotInput,
    ShotResult,
    check_mode,
    engine_of,
    run_checked,
    scene_arrays,
    simulate,
)
from billiards_env.engine.threads import spread

__all__ = [
    "KINDS",
    "MAX_EVENTS",
    "NO_LOG",
    "STATUS",
    "BatchResult",
    "ShotInput",
    "ShotResult",
    "Shots",
    "check_mode",
    "empty_shots",
    "engine_of",
    "run_checked",
    "scene_arrays",
    "simulate",
    "simulate_batch",
    "spread",
]
