"""Engines that run shots: `simulate` one, `simulate_batch` many, and what they give back."""

from billiards_env.engine.batch import BatchResult, simulate_batch
from billiards_env.engine.log import KINDS, STATUS
from billiards_env.engine.shot import MAX_EVENTS, ShotInput, ShotResult, check_mode, run_checked, simulate

__all__ = [
    "KINDS",
    "MAX_EVENTS",
    "STATUS",
    "BatchResult",
    "ShotInput",
    "ShotResult",
    "check_mode",
    "run_checked",
    "simulate",
    "simulate_batch",
]
