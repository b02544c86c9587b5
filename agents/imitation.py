"""Supervised learning from the shots that a search tries."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor
from tqdm import tqdm

from agents.config import Config, Imitation
from agents.ppo import make_vector, training_seed
from billiards_env.players.env_player import Tables, try_pots

_TABLES = 4096  # layouts that are searched in one call
_EACH = 12  # shots on each layout that an update uses
_LIKELIHOOD = 0.1  # weight of the second term of the loss
# The logarithm of a uniform density that is added, so that a shot far from all components has hardly any effect.
_BACKGROUND = torch.tensor(-8.0)


class Examples(NamedTuple):
    """m layouts, and s shots that the search tried on each.

    Attributes:
        observations: (m, size), of the layouts.
        actions: (m, s, 2) or (m, s, 5), the shots.
        rewards: (m, s), of the shots.
    """

    observations: Tensor
    actions: Tensor
    rewards: Tensor


def imitate(policy: ActorCriticPolicy, config: Config) -> None:
    """Trains a policy with the shots that a search tries, before PPO.

    Two terms are maximized. The first is the expected reward if the policy chooses one of the shots of the search, each
    with a probability proportional to its density. The second is the log-density of the shots, weighted by their
    positive rewards (Peters and Schaal 2007, reward-weighted regression). It keeps the means of the components near
    the shots. The standard deviations are not trained, because shots without noise would reduce them to 0.

    Args:
        policy: The policy, which changes.
        config: The configuration of the run, with `imitation`.
    """
    settings = cast(Imitation, config.imitation)
    examples = search(config, settings)
    with torch.no_grad():
        features = torch.cat([policy.features_extractor(part) for part in examples.observations.split(_TABLES)])
    learned = [parameter for name, parameter in policy.named_parameters() if "log_" not in name]
    optimizer = torch.optim.Adam(learned, settings.learning_rate)
    steps = settings.n_epochs * -(-settings.layouts // settings.batch_size)
    schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.01, steps)
    generator = torch.Generator().manual_seed(config.seed)
    with tqdm(total=settings.n_epochs * settings.layouts, unit_scale=True, desc="imitation", unit=" layouts") as bar:
        for _ in range(settings.n_epochs):
            for batch in torch.randperm(settings.layouts, generator=generator).split(settings.batch_size):
                chosen = torch.randint(settings.shots, (len(batch), _EACH), generator=generator)
                shots, rewards = (array[batch[:, None], chosen] for array in (examples.actions, examples.rewards))
                distribution = policy.get_distribution(features[batch])
                log_prob = torch.stack([distribution.log_prob(shot) for shot in shots.unbind(1)], 1)
                log_prob = torch.logaddexp(log_prob, _BACKGROUND)
                expected = (log_prob.softmax(1) * rewards).sum(1).mean()
                likelihood = (log_prob * rewards.clamp(min=0.0)).mean()
                optimizer.zero_grad()
                (-expected - _LIKELIHOOD * likelihood).backward()
                torch.nn.utils.clip_grad_norm_(learned, config.ppo.max_grad_norm)
                optimizer.step()
                schedule.step()
                bar.update(len(batch))


def search(config: Config, settings: Imitation) -> Examples:
    """Returns random layouts, and the shots that a search tries on them without execution noise."""
    rng = np.random.default_rng((config.seed, 1))
    found: list[tuple[Any, ...]] = []
    with tqdm(total=settings.layouts, unit_scale=True, desc="search", unit=" layouts") as bar:
        for first in range(0, settings.layouts, _TABLES):
            count = min(_TABLES, settings.layouts - first)
            envs: Any = make_vector(config, count)
            observations, _ = envs.reset(seed=training_seed(config, first))
            game = envs.unwrapped
            tables = Tables(game.positions, game.potted, game.goals, game.on)
            found.append((observations, *try_pots(game.single_env, tables, settings.shots, rng, settings.vary)))
            bar.update(count)
    return Examples(*(torch.from_numpy(np.concatenate(parts)).float() for parts in zip(*found, strict=True)))
