"""The heads that compute components from the positions of the balls: "mixture" and "hits"."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, cast

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, create_mlp
from torch import Tensor, nn

from billiards_env.envs import BilliardsEnv
from billiards_env.physics.strike import CueNumbers
from billiards_env.sb3.cue_parts import NUMBERS, cue_parts, turned
from billiards_env.sb3.mixture import NEVER, Components

_CRITIC = 32  # units of each of the two hidden layers of the value function


class Reflected(BaseFeaturesExtractor):
    """Reflects layouts so that the first object ball has x >= 0 and y >= 0.

    The features are the two signs of the reflection and then the observation of the reflected layout.

    Args:
        space: The space of observations, `(size,)`.
        env: The environment.
    """

    def __init__(self, space: gym.spaces.Box, env: BilliardsEnv) -> None:
        super().__init__(space, 2 + int(np.prod(space.shape)))
        self.points = env.scene.n_balls + len(env.goals)

    def forward(self, observations: Tensor) -> Tensor:
        """Returns the features of observations (m, size). An input of the size of features is returned unchanged."""
        if observations.shape[1] == self.features_dim:
            return observations
        signs, end = torch.where(observations[:, 2:4] < 0, -1.0, 1.0), 2 * self.points
        return torch.cat((signs, observations[:, :end] * signs.repeat(1, self.points), observations[:, end:]), 1)


class Aims(NamedTuple):
    """Directions of the k components on each of m tables, (m, k).

    Attributes:
        dx, dy: The direction, a unit vector.
        log_turn: Logarithm of the unit of the direction's standard deviation, radians.
        exists: Whether the component exists. A hit on a potted ball does not.
    """

    dx: Tensor
    dy: Tensor
    log_turn: Tensor
    exists: Tensor


class PointAims(nn.Module):
    """Directions from the cue ball to learned points.

    The direction is the sum of a linear function of all positions and a network of the positions of the object balls.
    The network does not need the position of the cue ball: to pot a ball, the cue ball must move to the ghost ball, and
    the ghost ball depends only on the object ball and the pocket. Before the training the direction is the first object
    ball's position minus that of the cue ball, plus a small constant that differs between components. The positions are
    in units of the observation (half the length and half the width of the table), so this direction points only roughly
    towards the ball.

    Args:
        inputs: The size of the reflected observation.
        count: k.
        hidden, activation: As in `PositionHead`.
    """

    outputs, std = 0, (0.1, 0.15)

    def __init__(self, inputs: int, count: int, hidden: Sequence[int], activation: type[nn.Module]) -> None:
        super().__init__()
        self.count = count
        self.linear = nn.Linear(inputs, 2 * count)
        self.network = nn.Sequential(*create_mlp(inputs - 2, 2 * count, list(hidden), activation))
        _shrink(self.network)
        angles = 2 * math.pi / count * torch.arange(count)
        with torch.no_grad():
            self.linear.weight.zero_()
            for axis, rows in enumerate((slice(count), slice(count, 2 * count))):
                self.linear.weight[rows, axis], self.linear.weight[rows, 2 + axis] = -1.0, 1.0
            self.linear.bias.copy_(0.1 * torch.cat((angles.cos(), angles.sin())))

    def forward(self, positions: Tensor) -> Aims:
        """Returns the directions for reflected observations (m, size)."""
        dx, dy = (self.linear(positions) + self.network(positions[:, 2:])).chunk(2, 1)
        shorter = torch.rsqrt(dx * dx + dy * dy + 1e-9)
        return Aims(dx * shorter, dy * shorter, torch.zeros_like(dx), torch.ones_like(dx, dtype=torch.bool))


class HitAims(nn.Module):
    """Several hits on each ball of the task.

    The sine of the cut angle is the distance from the centre of the ball to the line along which the cue ball starts,
    over the distance of the centres at contact. It is between -1 and 1. This interval is divided into equal parts, one
    for each hit. A hit starts in the middle of its part, and training can move it by at most the width of a part.
    Standard deviations of the direction are those of this sine.

    Args:
        env: The environment.
        each: The number of hits on a ball.

    Raises:
        ValueError: If the task of the environment has no object ball.
    """

    outputs, std = 1, (0.1, 0.06)
    scale: Tensor
    reach: Tensor
    sines: Tensor

    def __init__(self, env: BilliardsEnv, each: int) -> None:
        super().__init__()
        self.balls = np.flatnonzero(env.targets).tolist()
        if not self.balls:
            raise ValueError(
                f"policy.head = 'hits' in the task {env.task!r}: expected at least one object ball or another head"
            )
        self.count, self.width = each * len(self.balls), 2.0 / each
        for name, value in (
            ("scale", np.array(env.scene.half_extents)),
            ("reach", env.scene.balls.contact_distances(0)[self.balls, None]),
            ("sines", self.width * (np.arange(each) + 0.5) - 1.0),
        ):
            self.register_buffer(name, torch.as_tensor(value, dtype=torch.float32), persistent=False)

    def forward(self, positions: Tensor, change: Tensor) -> Aims:
        """Returns the directions for reflected observations (m, size) and outputs (m, k) of a network."""
        points = positions[:, : 2 * (1 + max(self.balls))].unflatten(1, (-1, 2))
        balls = points[:, self.balls]
        ways = (balls - points[:, :1]) * self.scale
        distances = ways.norm(dim=2, keepdim=True).clamp(min=1e-6)
        ux, uy = (ways / distances).unsqueeze(2).unbind(3)
        ratio = self.reach / distances
        # The law of sines, see `billiards_env.envs.action_frames.aim`.
        sine = (self.sines + self.width * change.unflatten(1, (len(self.balls), -1)).tanh()) * ratio
        sine = sine.clamp(-0.99, 0.99)
        cosine = torch.sqrt(1 - sine * sine)
        exists = (balls.abs() < 1.0).all(2, keepdim=True).expand_as(sine)
        aims = Aims(ux * cosine + uy * sine, uy * cosine - ux * sine, (ratio / cosine).log(), exists)
        return Aims(*(part.flatten(1) for part in aims))


class PositionHead(nn.Module):
    """Networks that compute the components from the positions of the balls.

    Args:
        features_dim: The size of the features, see `Reflected`.
        aims: The directions of the components.
        speeds: The smallest and the largest mean speed, divided by the largest speed of the environment.
        hidden: The number of units of each hidden layer.
        activation: The class of the activation function.
        cue: The cue, or None if actions are velocities.
    """

    def __init__(
        self,
        features_dim: int,
        aims: PointAims | HitAims,
        speeds: tuple[float, float],
        hidden: Sequence[int],
        activation: type[nn.Module],
        cue: CueNumbers | None,
    ) -> None:
        super().__init__()
        others = 0 if cue is None else NUMBERS
        self.aims, self.speeds, self.cue, self.parts = aims, speeds, cue, 2 + aims.outputs + others
        inputs, k = features_dim - 2, aims.count
        self.actor = nn.Sequential(*create_mlp(inputs, self.parts * k, list(hidden), activation))
        _shrink(self.actor)
        self.value_net = nn.Sequential(*create_mlp(inputs, -1, [_CRITIC, _CRITIC], activation))
        self.log_along, self.log_across = (nn.Parameter(torch.tensor(math.log(std))) for std in aims.std)
        self.log_others = nn.Parameter(torch.full((others, 1), math.log(0.1)))
        self.latent_dim_vf = _CRITIC

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the components of the mixtures, see `Components.flat`, and the input of the value function."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: Tensor) -> Tensor:
        """Returns the components of the mixtures."""
        signs, positions = features[:, :2], features[:, 2:]
        logit, faster, *rest = self.actor(positions).chunk(self.parts, 1)
        aims = self.aims(positions, *rest[: self.aims.outputs])
        slowest, fastest = self.speeds
        speed = slowest + (fastest - slowest) * faster.sigmoid()
        dx, dy, more = aims.dx, aims.dy, speed[:, None][:, :0]
        if self.cue is not None:
            cue = cue_parts(self.cue, *rest[self.aims.outputs :])
            dx, dy = turned(dx, dy, cue.turn)
            speed = (speed / cue.gain).clamp(max=1.0)
            # A reflection changes the side.
            more = torch.stack((signs.prod(1, keepdim=True) * cue.side, cue.top, cue.elevation), 1)
        return Components(
            torch.where(aims.exists, logit, NEVER),
            signs[:, :1] * dx,
            signs[:, 1:] * dy,
            speed,
            self.log_along.expand_as(speed),
            self.log_across + speed.log() + aims.log_turn,
            more,
            self.log_others.expand_as(more),
        ).flat()

    def forward_critic(self, features: Tensor) -> Tensor:
        """Returns the input of the value function."""
        return self.value_net(features[:, 2:])


def _shrink(network: nn.Sequential) -> None:
    """Makes the outputs of a network small, so that they hardly depend on its inputs before the training."""
    last = cast(nn.Linear, network[-1])
    with torch.no_grad():
        last.weight.mul_(0.02)
        last.bias.zero_()
