"""The Gymnasium side: environments, and the tasks they set."""

from billiards_env.envs.billiards import BilliardsEnv

__all__ = ["BilliardsEnv"]
