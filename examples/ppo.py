"""PPO in one file: learns billiards from the positions of the balls alone.

    python examples/ppo.py --policy policy.pt
    python examples/ppo.py --shots 5e6 --hidden 192 --epochs 3 --until 0.12 --entropy 0.03 0.006
    python examples/ppo.py --env '{"n_object_balls": 3, "max_shots": 5}' --rate 4e-3 --envs 2048 --minibatch 512
    python examples/ppo.py --env '{"mode": "pit", "dt": 0.0167}'

The environment is `Billiards-v0`, by default with one ball to pot in one shot: the observation is the positions of the
balls, and the action is the velocity of the cue ball. The advantage of a shot is its points minus the value of the
layout. The points are the reward without its fraction: one pot with a scratch has a reward of 0.9 and no point.

The policy is `billiards_env.sb3.aim_network.AimNetwork`, a mixture of Gaussians over the velocity. Each component aims
at a point next to an object ball. A network learns this point, by default from the position of this ball alone. Another
network chooses the component and its speed. The program contains no pockets, cut angles or ghost balls.
`billiards_env.sb3.AimPolicy` is the same policy for PPO of Stable-Baselines3.

Sources: Schulman et al., Proximal Policy Optimization Algorithms (2017); Huang et al., CleanRL (2022), for the form.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import VectorEnv
from torch import Tensor, nn
from torch.optim import Adam

from billiards_env.bench.evaluation import evaluation_seeds, play_together
from billiards_env.sb3.aim_network import AimNetwork

ENV_ID = "billiards_env:Billiards-v0"


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Returns the settings of a run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    add = parser.add_argument
    add("--shots", type=lambda text: int(float(text)), default=1_000_000, help="shots of the training")
    add("--seed", type=int, default=0)
    add("--threads", type=int, default=1, help="threads of PyTorch and of the environment")
    add("--envs", type=int, default=4096, help="environments, which are the shots of one update")
    add("--minibatch", type=int, default=1024)
    add("--epochs", type=int, default=4, help="passes over the shots of an update")
    add("--points", type=int, default=16, help="points to aim at; each has a Gaussian for each range of speeds")
    add("--speeds", type=float, nargs="+", default=(0.2, 0.4, 0.8), help="borders of the ranges of mean speeds")
    add("--aim", choices=("ball", "layout"), default="ball", help="what the points next to a ball depend on")
    add("--hidden", type=int, default=128, help="units of each of the two hidden layers of the choice")
    add("--rate", type=float, default=2e-3, help="learning rate at the start; falls linearly to a hundredth")
    add("--clip", type=float, default=0.2, help="largest change of a probability, as a share")
    add("--entropy", type=float, nargs=2, default=(0.03, 0.003), help="first and last weight of the choice's entropy")
    add("--std-speed", type=float, nargs=2, default=(0.1, 0.03), help="first and last std of the speed")
    add("--std-aim", type=float, nargs=2, default=(0.025, 0.0015), help="first and last std of the point aimed at, m")
    add("--until", type=float, default=0.4, help="share of the shots after which the last three are constant")
    add("--evaluate-every", type=lambda text: int(float(text)), default=250_000, help="shots between two evaluations")
    add("--env", type=json.loads, default={}, help="arguments of gym.make as JSON")
    add("--episodes", type=int, default=10_000, help="new layouts of an evaluation")
    add("--policy", type=Path, help="file for the weights")
    return parser.parse_args(argv)


def update(
    policy: AimNetwork, optimizer: Adam, batch: Sequence[Tensor], entropy: float, args: argparse.Namespace
) -> None:
    """Improves the policy with the shots of `batch`: positions, velocities, log-densities, values and points."""
    for _ in range(args.epochs):
        for rows in torch.randperm(len(batch[0])).split(args.minibatch):
            positions, velocities, log_densities, values, rewards = (part[rows] for part in batch)
            mixture, value = policy(positions)
            advantages = (rewards - values) / values.clamp(0.1, 1.0)  # the gradient of the logarithm of the success
            advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
            ratio = (mixture.log_prob(velocities) - log_densities).exp()
            gain = torch.min(advantages * ratio, advantages * ratio.clamp(1 - args.clip, 1 + args.clip)).mean()
            loss = 0.5 * (value - rewards).square().mean() - gain - entropy * mixture.entropy().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(policy.parameters(), 5.0)
            optimizer.step()


def positions_of(envs: Any, observations: np.ndarray) -> Tensor:
    """Returns the positions of the balls (m, n, 2) in observations."""
    return torch.from_numpy(envs.decode(observations)["positions"])


def success(policy: AimNetwork, envs: VectorEnv, seed: int) -> float:
    """Returns the share of new layouts on which the mode of the policy achieves the task."""

    def act(observations: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return policy(positions_of(envs, observations))[0].mode().clamp(-1, 1).numpy()

    return play_together(envs, act, evaluation_seeds(seed, envs.num_envs).tolist())["success_rate"]


def train(args: argparse.Namespace) -> tuple[AimNetwork, list[dict[str, Any]]]:
    """Trains a policy; prints and returns its success on new layouts during the training."""
    torch.manual_seed(args.seed)
    torch.set_num_threads(args.threads)
    torch.set_flush_denormal(True)  # tiny densities are slow otherwise
    envs = gym.make_vec(ENV_ID, num_envs=args.envs, threads=args.threads, **args.env)
    tests: Any = gym.make_vec(ENV_ID, num_envs=args.episodes, threads=args.threads, **args.env)
    policy = AimNetwork(tests.single_env.scene.half_extents, args.points, args.speeds, args.hidden, args.aim)
    optimizer = Adam(policy.parameters(), eps=1e-5, fused=True)
    positions = positions_of(envs, envs.reset(seed=args.seed * args.envs)[0])
    done, curve, seconds = 0, [], 0.0
    while done < args.shots:
        begin = time.perf_counter()
        share = done / args.shots
        part = min(share / args.until, 1.0)
        schedules = args.entropy, args.std_speed, args.std_aim
        entropy, *std = (first * (last / first) ** part for first, last in schedules)
        policy.std[:2] = torch.tensor(std)
        optimizer.param_groups[0]["lr"] = args.rate * (1 - 0.99 * share)
        with torch.no_grad():
            mixture, values = policy(positions)
            velocities = mixture.sample()
            log_densities = mixture.log_prob(velocities)
        following, rewards, *_ = envs.step(velocities.clamp(-1, 1).numpy())
        rewards = torch.from_numpy(rewards).clamp(min=0).floor().float()
        update(policy, optimizer, (positions, velocities, log_densities, values, rewards), entropy, args)
        positions = positions_of(envs, following)
        done += args.envs
        seconds += time.perf_counter() - begin
        if done >= args.shots or done // args.evaluate_every > len(curve):
            rate = success(policy, tests, args.seed)
            print(f"{done:>11,} shots, {seconds:5.0f} s, success {rate:.1%}, exploring {rewards.mean():.1%}")
            curve.append({"shots": done, "success": rate})
    if args.policy:
        torch.save(policy.state_dict(), args.policy)
    return policy, curve


if __name__ == "__main__":
    train(arguments())
