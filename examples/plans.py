"""DQN and MaskablePPO choose a ball, a pocket and a speed: `python examples/plans.py` (extras `train` and `masks`)."""

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import DQN

from billiards_env.sb3 import SameStepVecEnv
from billiards_env.support.checks import missing

try:
    from sb3_contrib import MaskablePPO
except ImportError:
    MaskablePPO = None

SHOTS = 5


def make(num_envs: int) -> gym.vector.VectorEnv:
    """Returns tables with three balls to clear."""
    observe = ("positions", "potted", "shots_left")
    arguments = {"task": "clear", "n_object_balls": 3, "max_shots": SHOTS, "observe": observe, "action": "plan"}
    return gym.make_vec("billiards_env:Billiards-v0", num_envs, **arguments)


def success(choose, episodes: int) -> float:
    """Returns the share of episodes that are won with the plans that `choose` returns for observations and masks."""
    envs = make(episodes)
    observations, infos = envs.reset(seed=1)
    over, won = np.zeros(episodes, bool), np.zeros(episodes, bool)
    for _ in range(SHOTS):
        observations, _, ends, _, infos = envs.step(choose(observations, infos["action_mask"]))
        if ends.any():
            won |= ~over & ends & infos["final_info"]["is_success"]
        over |= ends
    return won.mean()


def run(steps: int, episodes: int = 1000) -> dict[str, float]:
    """Trains, and returns the success of random play with the masks and that of each learner."""
    torch.set_num_threads(1)
    rng = np.random.default_rng(0)
    shares = {
        "random plans with the masks": success(lambda _, masks: (rng.random(masks.shape) * masks).argmax(1), episodes)
    }

    settings = {"learning_starts": 1000, "train_freq": 1, "gradient_steps": 8, "batch_size": 256, "gamma": 0.9}
    dqn = DQN("MlpPolicy", SameStepVecEnv(make(64)), **settings, buffer_size=100_000, device="cpu", verbose=1)
    dqn.learn(steps, log_interval=1000)

    def most_valued(observations, masks):
        with torch.no_grad():
            values = dqn.q_net(torch.as_tensor(observations)).numpy()
        return np.where(masks, values, -np.inf).argmax(axis=1)

    shares["DQN"] = success(most_valued, episodes)
    if MaskablePPO is None:
        print(missing("sb3_contrib", "masks"))
        return shares
    settings = {"n_steps": 32, "batch_size": 512, "gamma": 0.9, "ent_coef": 0.01, "learning_rate": 1e-3}
    ppo = MaskablePPO("MlpPolicy", SameStepVecEnv(make(64)), **settings, device="cpu", verbose=1)
    ppo.learn(steps, log_interval=5)

    def most_probable(observations, masks):
        return ppo.predict(observations, action_masks=masks, deterministic=True)[0]

    shares["MaskablePPO"] = success(most_probable, episodes)
    return shares


if __name__ == "__main__":
    for name, share in run(100_000).items():
        print(f"{name}: {share:.1%} of 1,000 new tables won")
