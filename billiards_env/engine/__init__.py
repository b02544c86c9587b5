"""Engines that run shots: `simulate` one, `simulate_batch` many, and what they give back."""

from billiards_env.engine.batch import BatchResult, simulate_batch
from billiards_env.engine.log import KINDS, STATUS
from billiards_env.engine.shot import MAX_EVENTS, ShotResult, check_mode, simulate

__all__ = ["KINDS", "MAX_EVENTS", "STATUS", "BatchResult", "ShotResult", "check_mode", "simulate", "simulate_batch"]
