"""PPO of Stable-Baselines3 from images of 84 x 84 pixels: `python examples/pixels.py` (extra `train`)."""

import gymnasium as gym
import torch
from stable_baselines3 import PPO

from billiards_env.sb3 import SameStepVecEnv


def run(steps: int, num_envs: int = 64) -> PPO:
    """Trains for a number of steps. Returns the model."""
    torch.set_num_threads(1)
    envs = gym.make_vec("billiards_env:Billiards-v0", num_envs, observe=[("pixels", 84, 84)])
    return PPO("CnnPolicy", SameStepVecEnv(envs), n_steps=16, batch_size=256).learn(steps)


if __name__ == "__main__":
    run(20_000).save("policy.zip")
