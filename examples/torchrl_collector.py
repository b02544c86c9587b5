"""A collector of TorchRL on many tables: `python examples/torchrl_collector.py` (needs the package torchrl).

One step runs the shots of all environments in one compiled call. TorchRL's own work in each step takes longer than the
shots. Most of this work copies observations and infos into tensors.
"""

import gymnasium as gym
import torch
from torchrl.collectors import Collector  # pyright: ignore[reportMissingImports]
from torchrl.envs import GymWrapper  # pyright: ignore[reportMissingImports]


def run(steps: int, num_envs: int = 64, policy=None) -> float:
    """Collects a number of steps with a policy, by default random shots. Returns the mean reward of a shot."""
    env = GymWrapper(gym.make_vec("billiards_env:Billiards-v0", num_envs=num_envs))
    total, count = 0.0, 0
    for batch in Collector(env, policy, frames_per_batch=16 * num_envs, total_frames=steps):
        total += batch["next", "reward"].sum().item()  # batch: (num_envs, 16), with "observation", "action", "next"
        count += batch.numel()
    return total / count


if __name__ == "__main__":
    torch.set_num_threads(1)
    print(f"mean reward of random shots: {run(100_000, num_envs=1024):.3f}")
