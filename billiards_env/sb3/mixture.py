"""Mixtures of Gaussians over actions, as a distribution of Stable-Baselines3."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import torch
from stable_baselines3.common.distributions import Distribution
from torch import Tensor, nn

NEVER = -30.0
"""The logit of a component that does not exist."""

_VELOCITY = 6  # fields of `Components` that describe the velocity


class Components(NamedTuple):
    """The components of m mixtures of k Gaussians. Each field but the last two is (m, k).

    A component is one Gaussian. The first two numbers of an action are the cue ball's velocity divided by the largest
    speed. The axes of a component's covariance are along and across its direction. An action may have e other numbers,
    which are independent.

    Attributes:
        logit: Logarithm of the weight, up to a constant.
        dx, dy: Direction, a unit vector.
        speed: Mean along the direction.
        log_along: Logarithm of the standard deviation along the direction.
        log_across: Logarithm of the standard deviation across it.
        others: (m, e, k) means of the other numbers.
        log_others: (m, e, k) logarithms of their standard deviations.
    """

    logit: Tensor
    dx: Tensor
    dy: Tensor
    speed: Tensor
    log_along: Tensor
    log_across: Tensor
    others: Tensor
    log_others: Tensor

    def flat(self) -> Tensor:
        """Returns the components as one tensor, (m, (6 + 2 e) k)."""
        parts = torch.stack(self[:_VELOCITY], 1)
        return torch.cat((parts, self.others, self.log_others), 1).flatten(1)

    @classmethod
    def from_flat(cls, flat: Tensor, others: int) -> Components:
        """Returns the components from the output of `flat`; `others` is e."""
        parts = flat.unflatten(1, (_VELOCITY + 2 * others, -1))
        return cls(*parts[:, :_VELOCITY].unbind(1), *parts[:, _VELOCITY:].chunk(2, 1))


class MixtureDistribution(Distribution):
    """m mixtures of Gaussians over actions.

    A rotation does not change areas, so the log-density is that of the velocity vector.

    Args:
        others: e, the length of an action minus 2.
    """

    components: Components
    log_weight: Tensor

    def __init__(self, others: int = 0) -> None:
        super().__init__()
        self.others = others

    def proba_distribution_net(self, *args: Any, **kwargs: Any) -> nn.Module:
        """Returns a network without layers: the latent variables are the components."""
        return nn.Identity()

    def proba_distribution(self, latent: Tensor) -> MixtureDistribution:
        """Sets the components, which are the output of `Components.flat`."""
        self.components = Components.from_flat(latent, self.others)
        self.log_weight = self.components.logit.log_softmax(1)
        return self

    def log_prob(self, actions: Tensor) -> Tensor:
        """Returns the logarithms of the densities (m,) of actions (m, 2 + e)."""
        c, x, y = self.components, actions[:, :1], actions[:, 1:2]
        along = (x * c.dx + y * c.dy - c.speed) * torch.exp(-c.log_along)
        across = (y * c.dx - x * c.dy) * torch.exp(-c.log_across)
        logs = self.log_weight - 0.5 * (along * along + across * across) - c.log_along - c.log_across
        if self.others:
            errors = (actions[:, 2:, None] - c.others) * torch.exp(-c.log_others)
            logs = logs - (0.5 * errors * errors + c.log_others).sum(1)
        return logs.logsumexp(1) - 0.5 * (2 + self.others) * math.log(2 * math.pi)

    def entropy(self) -> Tensor:
        """Returns the entropies (m,) of the choice of the component. The entropy of a mixture has no closed form."""
        return -(self.log_weight.exp() * self.log_weight).sum(1)

    def sample(self) -> Tensor:
        """Draws an action from each mixture, (m, 2 + e)."""
        m = len(self.log_weight)
        return self._action(torch.multinomial(self.log_weight.exp(), 1)[:, 0], torch.randn(m, 2 + self.others))

    def mode(self) -> Tensor:
        """Returns the mean of the component with the largest weight, (m, 2 + e)."""
        m = len(self.log_weight)
        return self._action(self.log_weight.argmax(1), torch.zeros(m, 2 + self.others))

    def _action(self, chosen: Tensor, errors: Tensor) -> Tensor:
        """Returns the actions of the components `chosen` (m,); `errors` are in standard deviations."""
        rows = torch.arange(len(chosen))
        c = Components(*(part[rows, ..., chosen] for part in self.components))
        along, across = c.speed + errors[:, 0] * c.log_along.exp(), errors[:, 1] * c.log_across.exp()
        velocity = torch.stack((along * c.dx - across * c.dy, along * c.dy + across * c.dx), 1)
        return torch.cat((velocity, c.others + errors[:, 2:] * c.log_others.exp()), 1)

    def actions_from_params(self, latent: Tensor, deterministic: bool = False) -> Tensor:
        """Returns actions for the output of `Components.flat`."""
        return self.proba_distribution(latent).get_actions(deterministic)

    def log_prob_from_params(self, latent: Tensor) -> tuple[Tensor, Tensor]:
        """Returns sampled actions and their log-densities for the output of `Components.flat`."""
        actions = self.actions_from_params(latent)
        return actions, self.log_prob(actions)
