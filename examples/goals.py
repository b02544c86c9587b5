"""SAC with hindsight experience replay of Stable-Baselines3: `python examples/goals.py` (extra `train`)."""

import gymnasium as gym
import torch
from stable_baselines3 import SAC, HerReplayBuffer

from billiards_env.sb3 import SameStepVecEnv


def make(num_envs: int) -> SameStepVecEnv:
    """Returns tables on which the cue ball has to come to rest at a place."""
    arguments = {"task": "place", "n_object_balls": 0, "max_shots": 3, "observe": "goal"}
    return SameStepVecEnv(gym.make_vec("billiards_env:Billiards-v0", num_envs, **arguments))


def run(steps: int, episodes: int = 1000) -> float:
    """Trains for a number of steps. Returns the share of the goals that the mean actions reach with the first shot."""
    torch.set_num_threads(1)
    settings = {"gamma": 0.9, "learning_starts": 1000, "batch_size": 256, "gradient_steps": 16, "device": "cpu"}
    model = SAC("MultiInputPolicy", make(64), replay_buffer_class=HerReplayBuffer, **settings, verbose=1)
    model.learn(steps, log_interval=200)
    envs = make(episodes)
    envs.seed(1)
    _, rewards, _, _ = envs.step(model.predict(envs.reset(), deterministic=True)[0])
    return float((rewards > 0).mean())


if __name__ == "__main__":
    print(f"{run(20_000):.1%} of 1,000 new goals are reached with one shot")
