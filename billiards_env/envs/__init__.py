"""The Gymnasium environment `Billiards-v0`: the environments and their tasks."""

from typing import Any

from billiards_env import doors
from billiards_env.engine import STATUS
from billiards_env.envs.arguments import Model, make_model
from billiards_env.envs.billiards import BilliardsEnv, make_env
from billiards_env.envs.opponents import Opponents
from billiards_env.envs.snapshots import load_state, save_state
from billiards_env.envs.trials import Outcomes
from billiards_env.envs.vector import BilliardsVectorEnv, make_vector_env

__all__ = [
    "STATUS",
    "BilliardsEnv",
    "BilliardsVectorEnv",
    "Model",
    "Opponents",
    "Outcomes",
    "RecordVideo",
    "load_state",
    "make_env",
    "make_model",
    "make_vector_env",
    "save_state",
]

RecordVideo: Any


def __getattr__(name: str) -> Any:
    return doors.attribute(__name__, name)
