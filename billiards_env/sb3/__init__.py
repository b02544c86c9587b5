"""Stable-Baselines3: an adapter of the vector environment, and policies with their files. Needs the extra `train`.

Example:
    >>> import gymnasium as gym
    >>> from stable_baselines3 import PPO
    >>> envs = SameStepVecEnv(gym.make_vec("billiards_env:Billiards-v0", num_envs=64))
    >>> model = PPO(AimPolicy, envs, **{**PPO_SETTINGS, "batch_size": 64})
    >>> model.learn(128).num_timesteps
    128
"""

from billiards_env.support.checks import missing

try:
    import stable_baselines3  # noqa: F401
    import yaml  # noqa: F401
except ModuleNotFoundError as error:
    raise missing(error.name or "stable_baselines3", "train") from error

from billiards_env.sb3.aim_policy import PPO_SETTINGS, AimPolicy, arguments_of
from billiards_env.sb3.vec_env import SameStepVecEnv
from billiards_env.sb3.weights import load_policy

__all__ = ["PPO_SETTINGS", "AimPolicy", "SameStepVecEnv", "arguments_of", "load_policy"]
