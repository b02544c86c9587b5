"""DQN of Stable-Baselines3 chooses a ball, a pocket and a speed: `python examples/plans.py` (extra `train`)."""

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import DQN

from billiards_env.sb3 import SameStepVecEnv

SHOTS = 5


def make(num_envs: int) -> gym.vector.VectorEnv:
    """Returns tables with three balls to clear."""
    observe = ("positions", "potted", "shots_left")
    arguments = {"task": "clear", "n_object_balls": 3, "max_shots": SHOTS, "observe": observe, "action": "plan"}
    return gym.make_vec("billiards_env:Billiards-v0", num_envs, **arguments)


def success(values, episodes: int) -> float:
    """Returns the share of episodes that are won with the possible plans of the largest values."""
    envs = make(episodes)
    observations, infos = envs.reset(seed=1)
    over, won = np.zeros(episodes, bool), np.zeros(episodes, bool)
    for _ in range(SHOTS):
        plans = np.where(infos["action_mask"], values(observations), -np.inf).argmax(axis=1)
        observations, _, ends, _, infos = envs.step(plans)
        if ends.any():
            won |= ~over & ends & infos["final_info"]["is_success"]
        over |= ends
    return won.mean()


def run(steps: int, episodes: int = 1000) -> tuple[float, float]:
    """Trains, and returns the success of random possible plans and of those that DQN values most."""
    torch.set_num_threads(1)
    settings = {"learning_starts": 1000, "train_freq": 1, "gradient_steps": 8, "batch_size": 256, "gamma": 0.9}
    model = DQN("MlpPolicy", SameStepVecEnv(make(64)), **settings, buffer_size=100_000, device="cpu").learn(steps)
    rng = np.random.default_rng(0)

    def valued(observations):
        with torch.no_grad():
            return model.q_net(torch.as_tensor(observations)).numpy()

    return success(lambda seen: rng.random((len(seen), 90)), episodes), success(valued, episodes)


if __name__ == "__main__":
    chance, learned = run(100_000)
    print(f"random plans win {chance:.1%} of 1,000 new tables, DQN {learned:.1%}")
