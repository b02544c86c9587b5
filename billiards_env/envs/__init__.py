"""The Gymnasium side: environments, one or many at once, and the tasks they set."""

from billiards_env.envs.billiards import BilliardsEnv
from billiards_env.envs.rendering import RecordVideo
from billiards_env.envs.vector import BilliardsVectorEnv

__all__ = ["BilliardsEnv", "BilliardsVectorEnv", "RecordVideo"]
