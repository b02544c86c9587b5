"""The policy with geometric features: the features, and how they enter the networks."""

from __future__ import annotations

from typing import NamedTuple, cast

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution, Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, MlpExtractor
from torch import Tensor, nn

from billiards_env.envs import BilliardsEnv

_THINNEST = 0.05  # cosine of the thinnest cut that counts as a shot
_PER_POCKET = 6  # features
# Adam changes all weights at the same rate, so larger inputs of a layer mean larger changes of its output. With these
# factors the part that is linear in the features is learned first, and the part of the hidden layers varies less (see
# Yang et al. 2022, "Tensor programs V").
_DIRECT, _HIDDEN = 2.0, 0.3


class Shape(NamedTuple):
    """The table that `Geometry` computes features of; lengths in m.

    Attributes:
        n_balls: The number of observed balls, with the cue ball.
        targets: The numbers of the balls to pot.
        half: Half the table's length and width.
        radius: The radius of every ball.
        pockets: (x, y, radius) of each pocket.
    """

    n_balls: int
    targets: tuple[int, ...]
    half: tuple[float, float]
    radius: float
    pockets: tuple[tuple[float, float, float], ...]


def shape(env: BilliardsEnv) -> Shape:
    """Returns the table of an environment.

    Raises:
        ValueError: If the task is not "pot", the pockets are not symmetric about both axes, or the balls have different
            radii.
    """
    scene = env.scene
    if env.task != "pot":
        raise ValueError(f"policy.features = 'geometry' in the task {env.task!r}: expected 'raw'")
    pockets = {(p.x, p.y, p.radius) for p in scene.table.pockets}
    if pockets != {(-x, y, r) for x, y, r in pockets} or pockets != {(x, -y, r) for x, y, r in pockets}:
        raise ValueError("policy.features = 'geometry' with asymmetric pockets: expected 'raw'")
    if len(set(scene.balls.radius)) > 1:
        raise ValueError(f"policy.features = 'geometry' with balls of radii {scene.balls.radius}: expected one radius")
    return Shape(
        scene.n_balls,
        tuple(np.flatnonzero(env.targets).tolist()),
        (scene.table.length / 2, scene.table.width / 2),
        scene.balls.radius[0],
        tuple((p.x, p.y, p.radius) for p in scene.table.pockets),
    )


class Geometry(BaseFeaturesExtractor):
    """The observation, and the shots that send the nearest ball to pot into each pocket.

    The balls to pot are in the order of their distance from the cue ball, as for the action frames; balls off the table
    are last. Each pocket has six features: the cut that sends the nearest ball into it (the action of the frame "cut"),
    its cosine, its tolerance in units of that action, the distances of the object ball and of the cue ball, and the
    tolerance of the cue ball's direction (see `billiards_env.players.pots.direct_pots`). The pockets are in the order
    of the last feature, easiest first. If the cut is too thin, or a cushion is in the place of the cue ball, only the
    distances are not 0; such pockets are last, the nearest first. The features do not contain obstacles, the speed of
    a shot and the path of the cue ball after it.

    A table is symmetric about both axes. Of the four images of a layout, the features describe the one in which the cut
    into the first pocket is not negative and the cue ball is in the half x >= 0. So the policy learns the same for all
    four. The first feature is -1 if a cut has the opposite sign in the image, else 1.

    Args:
        space: The space of observations, `(size,)`.
        shape: The table.
    """

    sides: Tensor
    room: Tensor
    mouths: Tensor
    openings: Tensor

    def __init__(self, space: gym.spaces.Box, shape: Shape) -> None:
        size = int(np.prod(space.shape))
        super().__init__(space, 1 + size + len(shape.targets) + _PER_POCKET * len(shape.pockets))
        self.n_balls, self.radius, self.targets = shape.n_balls, shape.radius, list(shape.targets)
        self.others = [i for i in range(1, shape.n_balls) if i not in shape.targets]
        pockets, half = torch.tensor(shape.pockets), torch.tensor(shape.half)
        centres, radii = pockets[:, :2], pockets[:, 2]
        room = half - shape.radius
        walls = centres.abs() > room
        # A ball is potted when its centre is within the pocket's radius. The centre keeps the ball's radius from a
        # cushion, so the opening along the cushion is a chord. A cushion next to a corner pocket guides a ball into it,
        # so both chords of a corner pocket count.
        chords = torch.sqrt((radii**2 - shape.radius**2).clamp(min=0.0))
        # These follow from the configuration, so they are not saved with the weights.
        for name, value in (
            ("sides", half),
            ("room", room),
            ("mouths", torch.minimum(torch.maximum(centres, -room), room)),
            ("openings", chords[:, None] * walls),
        ):
            self.register_buffer(name, value, persistent=False)

    def forward(self, observations: Tensor) -> Tensor:
        """Returns the features of observations (m, size), (m, features_dim)."""
        balls = observations[:, : 2 * self.n_balls].reshape(len(observations), self.n_balls, 2)
        targets = balls[:, self.targets]
        gone = (targets.abs() >= 1.0).any(-1)  # potted: the centre of a ball in play is never on a cushion line
        ways = (targets - balls[:, :1]) * self.sides
        order = (ways.norm(dim=-1) + 100.0 * gone).argsort(1)
        targets, gone = targets.gather(1, order[..., None].expand_as(targets)), gone.gather(1, order)
        pots = self._pots(balls[:, 0] * self.sides, targets[:, 0] * self.sides)
        one = torch.ones(len(observations))
        sign = torch.where(pots[:, 0, 0] < 0, -one, one)
        turn = torch.where(balls[:, 0, 0] < 0, -one, one)
        image = torch.stack((turn, turn * sign), 1)[:, None]
        cuts = sign[:, None, None]
        parts = (
            sign[:, None],
            observations[:, 2 * self.n_balls :],
            (balls[:, [0, *self.others]] * image).flatten(1),
            (targets * ~gone[..., None] * image).flatten(1),
            (~gone).float(),
            torch.cat((pots[..., :1] * cuts, pots[..., 1:]), -1).flatten(1),
        )
        return torch.cat(parts, 1)

    def _pots(self, cue: Tensor, ball: Tensor) -> Tensor:
        """Returns the features of the shots that send a ball (m, 2) into k pockets, (m, k, 6)."""
        way = self.mouths - ball[:, None]
        run = way.norm(dim=-1) + 1e-6
        line = way / run[..., None]
        reach = 2 * self.radius
        ghost = ball[:, None] - reach * line
        approach = ghost - cue[:, None]
        distance = approach.norm(dim=-1) + 1e-6
        direction = approach / distance[..., None]
        between = (ball - cue)[:, None]
        offset = (between[..., 1] * direction[..., 0] - between[..., 0] * direction[..., 1]) / reach
        cosine = (direction * line).sum(-1)
        opening = (line.abs() * self.openings).sum(-1)
        possible = (cosine > _THINNEST) & (ghost.abs() <= self.room + 1e-3).all(-1)
        room = torch.where(possible, opening / run * cosine, 0.0).clamp(max=1.0)
        angle = room * reach / distance.clamp(min=reach)
        parts = (offset * possible, cosine * possible, 2 * room, run, distance, 10 * angle)
        features = torch.stack(parts, -1)
        order = torch.where(possible, angle, -run).argsort(1, descending=True)
        return features.gather(1, order[..., None].expand_as(features))


class GeometryPolicy(ActorCriticPolicy):
    """A policy with the action frame "cut" and the features of `Geometry`.

    The features are also inputs of the last layer ("wide and deep learning", Cheng et al. 2016), which represents
    linear functions of them, such as "aim at the easiest pocket". The cut refers to the image of the layout.
    """

    def _build_mlp_extractor(self) -> None:
        layers = MlpExtractor(self.features_dim - 1, self.net_arch, self.activation_fn, self.device)
        self.mlp_extractor = _Latent(layers, self.features_dim - 1)  # pyright: ignore[reportAttributeAccessIssue]

    def _get_action_dist_from_latent(self, latent_pi: Tensor) -> Distribution:
        sign, latent = latent_pi[:, :1], latent_pi[:, 1:]
        cut, speed = self.action_net(latent).split(1, 1)
        distribution = cast(DiagGaussianDistribution, self.action_dist)
        # tanh keeps the mean below the fastest shot: all actions beyond it are equal, so the gradient is 0 there.
        return distribution.proba_distribution(torch.cat((sign * cut, speed.tanh()), 1), self.log_std)


class _Latent(nn.Module):
    def __init__(self, layers: MlpExtractor, features_dim: int) -> None:
        super().__init__()
        self.layers = layers
        self.latent_dim_pi = layers.latent_dim_pi + features_dim
        self.latent_dim_vf = layers.latent_dim_vf

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: Tensor) -> Tensor:
        sign, inputs = features[:, :1], features[:, 1:]
        return torch.cat((sign, _DIRECT * inputs, _HIDDEN * self.layers.forward_actor(inputs)), 1)

    def forward_critic(self, features: Tensor) -> Tensor:
        return self.layers.forward_critic(features[:, 1:])
