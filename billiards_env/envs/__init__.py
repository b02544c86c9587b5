"""The Gymnasium side: environments, and the tasks they set."""

from billiards_env.envs.billiards import BilliardsEnv
from billiards_env.envs.rendering import RecordVideo

__all__ = ["BilliardsEnv", "RecordVideo"]
