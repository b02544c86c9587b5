"""The Gymnasium environment `Billiards-v0`: the environments, their tasks and rendering."""

from billiards_env.engine import STATUS
from billiards_env.envs.billiards import BilliardsEnv
from billiards_env.envs.rendering import RecordVideo
from billiards_env.envs.state import load_state, save_state
from billiards_env.envs.vector import BilliardsVectorEnv

__all__ = ["STATUS", "BilliardsEnv", "BilliardsVectorEnv", "RecordVideo", "load_state", "save_state"]
