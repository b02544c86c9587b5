"""PPO of Stable-Baselines3 on 1,024 tables, with curves for tensorboard: `python examples/sb3_ppo.py`.

The learning curves are in `runs/sb3_ppo`: `tensorboard --logdir runs`.
"""

import gymnasium as gym
import torch
from stable_baselines3 import PPO

from billiards_env.sb3 import PPO_SETTINGS, AimPolicy, SameStepVecEnv


def run(steps: int, logs: str | None = "runs/sb3_ppo") -> PPO:
    """Trains for a number of steps, and writes curves into the folder `logs`. Returns the model."""
    torch.set_num_threads(1)  # small networks are faster on one thread
    envs = SameStepVecEnv(gym.make_vec("billiards_env:Billiards-v0", num_envs=1024))
    # The policy aims at learned points next to the ball. "MlpPolicy" works too.
    return PPO(AimPolicy, envs, **PPO_SETTINGS, verbose=1, tensorboard_log=logs).learn(steps, log_interval=10)


if __name__ == "__main__":
    run(500_000).save("policy.zip")
