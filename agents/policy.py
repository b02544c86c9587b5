"""The networks: what a policy computes from the observed positions before its first layer, and what feeds its last."""

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
# Adam moves all weights alike, whatever they are multiplied by: the larger the inputs of a layer, the more an update
# changes what it gives. What is linear in the features is learnt first; what the hidden layers add to it jitters less
# (Yang et al. 2022, "Tensor programs V", on such factors).
_DIRECT, _HIDDEN = 2.0, 0.3


class Shape(NamedTuple):
    """What `Geometry` knows of a table, lengths in metres.

    Attributes:
        n_balls: How many balls are observed, the cue ball among them.
        targets: Numbers of the balls to pot.
        half: Half the table's length and width.
        radius: Of every ball.
        pockets: (x, y, radius) of each pocket.
    """

    n_balls: int
    targets: tuple[int, ...]
    half: tuple[float, float]
    radius: float
    pockets: tuple[tuple[float, float, float], ...]


def shape(env: BilliardsEnv) -> Shape:
    """What `Geometry` needs to know of an environment.

    Args:
        env: The environment.

    Returns:
        Its shape.

    Raises:
        ValueError: If the task is not to pot, the pockets are not those of a table that is its own mirror image, or the
            balls are not of one size.
    """
    scene = env.scene
    if env.task != "pot":
        raise ValueError(f"policy.features = 'geometry' in the task {env.task!r}: expected 'raw'")
    pockets = {(p.x, p.y, p.radius) for p in scene.table.pockets}
    if pockets != {(-x, y, r) for x, y, r in pockets} or pockets != {(x, -y, r) for x, y, r in pockets}:
        raise ValueError("policy.features = 'geometry' with pockets that are no mirror images: expected 'raw'")
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
    """The observation, and how the nearest ball to pot could be sent into each pocket.

    The balls to pot come in the order of their distance from the cue ball, as the action frames choose them, those off
    the table last. For each pocket the shot at the nearest one is described by the cut that sends it there (what the
    action frame "cut" takes), the cosine of that, the room for error in units of that action, the ways of the object
    ball and of the cue ball, and the room for error of the cue ball's direction (see
    `billiards_env.players.pots.direct_pots`). The pockets come in the order of the last, the easiest first. Of a shot
    that is thinner than a graze, or with a cushion where the cue ball would have to be, only the ways are told; these
    come last, the nearest pocket first. What stands in the way, how fast a shot has to be and where the cue ball goes
    is not told: that is left to be learnt.

    A table is its own mirror image. Each layout is shown in the one of its four images in which the cut into the first
    pocket is not negative and the cue ball is in the half x >= 0, so that what is learnt of one is known of all. The
    first column of the features is -1 where the image is a mirrored one, in which a cut has the other sign, else 1.

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
        # A ball drops once its centre is within the pocket's radius, but that comes no nearer to a cushion than the
        # ball's radius: along the cushion this leaves a chord open. One that meets a cushion beside a corner pocket is
        # led into it, so that both chords count there.
        chords = torch.sqrt((radii**2 - shape.radius**2).clamp(min=0.0))
        # They follow from the configuration, so they are not saved with the weights.
        for name, value in (
            ("sides", half),
            ("room", room),
            ("mouths", torch.minimum(torch.maximum(centres, -room), room)),
            ("openings", chords[:, None] * walls),
        ):
            self.register_buffer(name, value, persistent=False)

    def forward(self, observations: Tensor) -> Tensor:
        """(m, features_dim) features of (m, size) observations."""
        balls = observations[:, : 2 * self.n_balls].reshape(len(observations), self.n_balls, 2)
        targets = balls[:, self.targets]
        gone = (targets.abs() >= 1.0).any(-1)  # in a pocket: no ball in play has its centre on a cushion line
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
        """(m, k, 6) features of the shots at a ball (m, 2) into k pockets."""
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
        told = (offset * possible, cosine * possible, 2 * room, run, distance, 10 * angle)
        features = torch.stack(told, -1)
        order = torch.where(possible, angle, -run).argsort(1, descending=True)
        return features.gather(1, order[..., None].expand_as(features))


class GeometryPolicy(ActorCriticPolicy):
    """A policy in the action frame "cut" that sees the features of `Geometry`.

    They feed its last layer, too ("wide and deep learning", Cheng et al. 2016): what is linear in them, such as "aim at
    the easiest pocket", need not be learnt through the layers. The cut is that of the image that they show.
    """

    def _build_mlp_extractor(self) -> None:
        layers = MlpExtractor(self.features_dim - 1, self.net_arch, self.activation_fn, self.device)
        self.mlp_extractor = _Latent(layers, self.features_dim - 1)  # pyright: ignore[reportAttributeAccessIssue]

    def _get_action_dist_from_latent(self, latent_pi: Tensor) -> Distribution:
        sign, latent = latent_pi[:, :1], latent_pi[:, 1:]
        cut, speed = self.action_net(latent).split(1, 1)
        distribution = cast(DiagGaussianDistribution, self.action_dist)
        # Beyond the fastest shot all are the same: a mean that got there would learn nothing more.
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
        sign, seen = features[:, :1], features[:, 1:]
        return torch.cat((sign, _DIRECT * seen, _HIDDEN * self.layers.forward_actor(seen)), 1)

    def forward_critic(self, features: Tensor) -> Tensor:
        return self.layers.forward_critic(features[:, 1:])
