"""The engines that run shots in compiled code: `pic` (event-driven) and `pit` (fixed timestep)."""

from billiards_env.engine.compile import MAX_EVENTS, PIC, Engine, scene_fields, scene_kernels, typed_run
from billiards_env.engine.log import KINDS, NO_LOG
from billiards_env.engine.shot_input import ShotInput
from billiards_env.engine.shots import STATUS, Shots, empty_shots
from billiards_env.engine.threads import parallel_for

__all__ = [
    "KINDS",
    "MAX_EVENTS",
    "NO_LOG",
    "PIC",
    "STATUS",
    "Engine",
    "ShotInput",
    "Shots",
    "empty_shots",
    "parallel_for",
    "scene_fields",
    "scene_kernels",
    "typed_run",
]
