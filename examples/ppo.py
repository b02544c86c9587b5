"""PPO in one file: learns billiards from the positions of the balls alone.

    python examples/ppo.py --policy policy.pt
    python examples/ppo.py --shots 5e6 --hidden 192 --epochs 3 --until 0.12 --entropy 0.03 0.006
    python examples/ppo.py --env '[{"n_object_balls": 3, "max_shots": 5}]' --rate 4e-3 --envs 2048 --minibatch 512
    python examples/ppo.py --env '[{"mode": "pit", "dt": 0.0167}]'

The environment is `Billiards-v0`, by default with one ball to pot in one shot: the observation is the positions of the
balls, and the action is the velocity of the cue ball. The advantage of a shot is its points minus the value of the
layout. The points are the reward without its fraction: one pot with a scratch has a reward of 0.9 and no point.

The policy is a mixture of Gaussians over the velocity (`Mixture`). Each component aims at a point next to an object
ball. A network learns this point, by default from the position of this ball alone. Another network chooses the
component and its speed. The program contains no pockets, cut angles or ghost balls.

Sources: Schulman et al., Proximal Policy Optimization Algorithms (2017); Huang et al., CleanRL (2022), for the form.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import VectorEnv
from torch import Tensor, nn
from torch.optim import Adam

from billiards_env.evaluation import evaluation_seeds, play_together

ENV_ID = "billiards_env:Billiards-v0"
Floats = Sequence[float]


def arguments(given: Sequence[str] | None = None) -> argparse.Namespace:
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
    add("--env", type=json.loads, default=[{}], help="JSON list of arguments of gym.make; an update draws one of them")
    add("--episodes", type=int, default=10_000, help="new layouts of an evaluation")
    add("--policy", type=Path, help="file for the weights")
    return parser.parse_args(given)


class Mixture(NamedTuple):
    """m mixtures of k Gaussians over the velocity of the cue ball divided by the largest speed.

    Each Gaussian has one standard deviation along its direction and one across it. A rotation does not change areas, so
    the density is that of the velocity.

    Attributes:
        log_weight: (m, k) logarithms of the weights.
        dx, dy: (m, k) direction, a unit vector.
        speed: (m, k) mean along the direction.
        across: (m, k) standard deviation across the direction.
        along: Standard deviation along it.
    """

    log_weight: Tensor
    dx: Tensor
    dy: Tensor
    speed: Tensor
    across: Tensor
    along: float

    def sample(self) -> Tensor:
        """Returns a random velocity of each mixture, (m, 2)."""
        return self._velocity(torch.multinomial(self.log_weight.exp(), 1), torch.randn(2, len(self.log_weight)))

    def mode(self) -> Tensor:
        """Returns the mean of the Gaussian with the largest weight, (m, 2)."""
        return self._velocity(self.log_weight.argmax(1, keepdim=True), torch.zeros(2, 1))

    def _velocity(self, component: Tensor, errors: Tensor) -> Tensor:
        dx, dy, speed, across = (part.gather(1, component)[:, 0] for part in self[1:5])
        ahead, aside = speed + errors[0] * self.along, errors[1] * across
        return torch.stack((ahead * dx - aside * dy, ahead * dy + aside * dx), 1)

    def log_density(self, velocity: Tensor) -> Tensor:
        """Returns the logarithms (m,) of the densities of velocities (m, 2), up to a constant."""
        x, y = velocity[:, :1], velocity[:, 1:]
        ahead = (x * self.dx + y * self.dy - self.speed) / self.along
        aside = (y * self.dx - x * self.dy) / self.across
        logs = self.log_weight - 0.5 * (ahead * ahead + aside * aside) - self.across.log()
        return logs.logsumexp(1)

    def choice_entropy(self) -> Tensor:
        """Returns the entropies (m,) of the choice of the component."""
        return -(self.log_weight.exp() * self.log_weight).sum(1)


def network(inputs: int, hidden: int, outputs: int, scale: float = 1.0) -> nn.Sequential:
    """Returns a network with two hidden layers. `scale` multiplies the first weights of its last layer."""
    last = nn.Linear(hidden, outputs)
    with torch.no_grad():
        last.weight.mul_(scale)
        last.bias.zero_()
    return nn.Sequential(nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), last)


class Policy(nn.Module):
    """The mixture for observations, and the value function.

    The networks take the layout once for each object ball, with this ball listed first. A table has two axes of
    symmetry, so each layout is reflected to x >= 0 and y >= 0 for this ball, and the directions are reflected back.

    Args:
        half_extents: Half the length and half the width of the table, m: the units of the observation.
        points: The number of points to aim at next to each object ball.
        speeds: Borders of the ranges of mean speeds, over the largest speed. Each point has a component in each range.
        hidden: Units of each hidden layer of the choice; the other networks have half as many.
        balls: The number of object balls.
        aim: Whether the points depend on the position of their "ball" or on the whole "layout".
    """

    half_extents: Tensor
    CIRCLE = 0.05
    """m: radius of the circle around the object ball on which the points are before the training."""

    def __init__(self, half_extents: Floats, points: int, speeds: Floats, hidden: int, balls: int, aim: str) -> None:
        super().__init__()
        self.aim, self.ranges, inputs = aim, len(speeds) - 1, 2 * balls + 6
        self.orders = [[0, *range(ball, balls + 1), *range(1, ball)] for ball in range(1, balls + 1)]
        borders, angles = torch.tensor(speeds), 2 * math.pi / points * torch.arange(points)
        self.register_buffer("half_extents", torch.tensor(half_extents))
        self.register_buffer("slowest", borders[:-1].repeat_interleave(points))
        self.register_buffer("faster", borders.diff().repeat_interleave(points))
        self.first_points = nn.Parameter(self.CIRCLE * torch.stack((angles.cos(), angles.sin())))
        self.points = network(2 if aim == "ball" else inputs, hidden // 2, 2 * points, 0.02)
        self.choice = network(inputs, hidden, 2 * points * self.ranges, 0.02)
        self.critic = network(inputs, hidden // 2, 1)
        self.std: Floats = 1.0, 1.0  # of the speed, over the largest, and of the point aimed at, m

    def forward(self, observations: Tensor) -> tuple[Mixture, Tensor]:
        """Returns the mixtures and the values (m,) for observations (m, 2 + 2 balls)."""
        layouts = observations.unflatten(1, (-1, 2))[:, self.orders].flatten(0, 1)  # (m * balls, 1 + balls, 2)
        signs = torch.where(layouts[:, 1] < 0, -1.0, 1.0)
        layouts = layouts * signs[:, None]
        cue_ball, ball = layouts[:, 0], layouts[:, 1]
        to_ball = (ball - cue_ball) * self.half_extents
        distance = to_ball.norm(dim=1, keepdim=True)
        features = torch.cat((layouts.flatten(1), to_ball / distance, distance, 1 / (distance + 0.1)), 1)
        offset = self.points(ball if self.aim == "ball" else features).unflatten(1, (2, -1))
        dx, dy = (to_ball[:, :, None] + (self.first_points + self.CIRCLE * offset)).unbind(1)
        inverse = torch.rsqrt(dx * dx + dy * dy + 1e-9)
        dx, dy = dx * inverse * signs[:, :1], dy * inverse * signs[:, 1:]
        dx, dy, inverse = (part.repeat(1, self.ranges) for part in (dx, dy, inverse))
        logit, faster = self.choice(features).chunk(2, 1)
        logit = logit.masked_fill(ball[:, 1:] == 1, -1e4)  # a potted ball: it is not on the table
        speed = self.slowest + self.faster * faster.sigmoid()
        # The std of the direction is that of the point over its distance. The limit is for points near the cue ball.
        across = speed * self.std[1] * inverse.clamp(max=10.0)
        outputs = logit, dx, dy, speed, across, self.critic(features)
        logit, dx, dy, speed, across, values = (part.reshape(len(observations), -1) for part in outputs)
        return Mixture(logit.log_softmax(1), dx, dy, speed, across, self.std[0]), values.mean(1)


def update(policy: Policy, optimizer: Adam, batch: Sequence[Tensor], entropy: float, args: argparse.Namespace) -> None:
    """Improves the policy with the shots of `batch`: observations, velocities, log-densities, values and points."""
    for _ in range(args.epochs):
        for rows in torch.randperm(len(batch[0])).split(args.minibatch):
            observations, velocities, log_densities, values, rewards = (part[rows] for part in batch)
            mixture, value = policy(observations)
            advantages = (rewards - values) / values.clamp(0.1, 1.0)  # the gradient of the logarithm of the success
            advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
            ratio = (mixture.log_density(velocities) - log_densities).exp()
            gain = torch.min(advantages * ratio, advantages * ratio.clamp(1 - args.clip, 1 + args.clip)).mean()
            loss = 0.5 * (value - rewards).square().mean() - gain - entropy * mixture.choice_entropy().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(policy.parameters(), 5.0)
            optimizer.step()


def success(policy: Policy, envs: VectorEnv, seed: int) -> float:
    """Returns the share of new layouts on which the mode of the policy achieves the task."""

    def act(observations: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return policy(torch.from_numpy(observations))[0].mode().clamp(-1, 1).numpy()

    return play_together(envs, act, evaluation_seeds(seed, envs.num_envs).tolist())["success_rate"]


def train(args: argparse.Namespace, policy: Policy | None = None) -> tuple[Policy, list[dict[str, Any]]]:
    """Trains a policy, a new one if none is given. Prints and returns its success on new layouts meanwhile."""
    torch.manual_seed(args.seed)
    torch.set_num_threads(args.threads)
    torch.set_flush_denormal(True)  # tiny densities are slow otherwise
    worlds = [gym.make_vec(ENV_ID, num_envs=args.envs, threads=args.threads, **world) for world in args.env]
    tests = gym.make_vec(ENV_ID, num_envs=args.episodes, threads=args.threads, **args.env[0])
    scene = tests.single_env.scene  # pyright: ignore
    policy = policy or Policy(scene.half_extents, args.points, args.speeds, args.hidden, scene.n_balls - 1, args.aim)
    optimizer = Adam(policy.parameters(), eps=1e-5, fused=True)
    layouts = [torch.from_numpy(envs.reset(seed=args.seed * args.envs)[0]) for envs in worlds]
    done, curve, seconds = 0, [], 0.0
    while done < args.shots:
        begin = time.perf_counter()
        share = done / args.shots
        part = min(share / args.until, 1.0)
        schedules = args.entropy, args.std_speed, args.std_aim
        entropy, *policy.std = (first * (last / first) ** part for first, last in schedules)
        optimizer.param_groups[0]["lr"] = args.rate * (1 - 0.99 * share)
        world = int(torch.randint(len(worlds), ()))
        observations = layouts[world]
        with torch.no_grad():
            mixture, values = policy(observations)
            velocities = mixture.sample()
            log_densities = mixture.log_density(velocities)
        following, rewards, *_ = worlds[world].step(velocities.clamp(-1, 1).numpy())
        rewards = torch.from_numpy(rewards).clamp(min=0).floor().float()
        update(policy, optimizer, (observations, velocities, log_densities, values, rewards), entropy, args)
        layouts[world] = torch.from_numpy(following)
        done += args.envs
        seconds += time.perf_counter() - begin
        if done >= args.shots or done // args.evaluate_every > len(curve):
            rate = success(policy, tests, args.seed)
            print(f"{done:>11,} shots, {seconds:5.0f} s, success {rate:.1%}, exploring {rewards.mean():.1%}")
            curve.append({"seed": args.seed, "shots": done, "success": rate, "seconds": round(seconds, 3)})
    if args.policy:
        torch.save(policy.state_dict(), args.policy)
    return policy, curve


if __name__ == "__main__":
    train(arguments())
