"""A policy over the velocity of the cue ball whose distribution is a mixture of Gaussians.

It plays `Billiards-v0` without a wrapper: an action is the velocity vector of the environment, or a strike with
`action="strike"`. The head is the part of the policy that computes the mixture. The heads differ in their prior
knowledge of the game; `HEADS` lists them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor, nn

from billiards_env.checks import one_of
from billiards_env.sb3.aim_policy import find_game
from billiards_env.sb3.cue_parts import NUMBERS, cue_of
from billiards_env.sb3.mixture import MixtureDistribution
from billiards_env.sb3.position_heads import HitAims, PointAims, PositionHead, Reflected
from billiards_env.sb3.pot_head import PotFeatures, PotHead

HEADS = ("mixture", "hits", "pots")
"""The heads, from the least prior knowledge to the most.

A component is one Gaussian of the mixture, with axes along and across its direction. The components are

* "mixture": several with learned directions.
* "hits": one for each of several hits on each ball, from thin on one side to thin on the other.
* "pots": one for each pot that geometry finds, at each of several speeds and, if actions are strikes, for each of
  several offsets of the tip. The task must be "pot", "clear" or "position".
"""


class MixturePolicy(ActorCriticPolicy):
    """An actor and critic with a mixture of Gaussians over the action.

    Args:
        args: Positional arguments of `ActorCriticPolicy`.
        env: Arguments of `gym.make("Billiards-v0", ...)`.
        head: One of `HEADS`.
        components: The number of components. With "hits" it is the number for each ball, with "pots" the largest number
            of pots.
        speeds: See `agents.config.Policy`.
        banks: See `agents.config.Policy`.
        net_arch: The number of units of each hidden layer, at least one layer.
        kwargs: Other keyword arguments of `ActorCriticPolicy`.

    Raises:
        ValueError: If the head is unknown or does not fit the environment.

    Example:
        >>> from stable_baselines3 import PPO
        >>> model = PPO(MixturePolicy, "billiards_env:Billiards-v0", device="cpu", seed=0)
        >>> env = gym.make("billiards_env:Billiards-v0")
        >>> observation, _ = env.reset(seed=0)
        >>> action, _ = model.predict(observation, deterministic=True)
        >>> env.step(action)[1]
        1.0
    """

    def __init__(
        self,
        *args: Any,
        env: Mapping[str, Any] | None = None,
        head: str = "pots",
        components: int = 4,
        speeds: Sequence[float] = (0.1, 1.0),
        banks: bool = False,
        net_arch: Sequence[int] = (64, 64),
        **kwargs: Any,
    ) -> None:
        one_of("policy.head", head, HEADS)
        self.own = {
            "env": dict(env or {}),
            "head": head,
            "components": components,
            "speeds": tuple(speeds),
            "banks": banks,
        }
        self.game = find_game(self.own["env"])
        space = args[0] if args else kwargs["observation_space"]
        if space.shape != self.game.observation_space.shape:
            raise ValueError(
                f"env = {dict(env or {})}: expected the arguments of the environment, whose observation has the shape "
                f"{space.shape}, not {self.game.observation_space.shape}"
            )
        kwargs.setdefault("optimizer_kwargs", {"eps": 1e-5, "fused": True})  # eps as in Stable-Baselines3
        kwargs["features_extractor_class"] = PotFeatures if head == "pots" else Reflected
        kwargs["features_extractor_kwargs"] = {"env": self.game}
        if head == "pots":
            kwargs["features_extractor_kwargs"] |= {"most": components, "banks": banks}
        super().__init__(*args, net_arch=list(net_arch), **kwargs)

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        cue = cue_of(self.game)
        name, k, layers = self.own["head"], self.own["components"], (cast(Any, self.net_arch), self.activation_fn)
        if name == "pots":
            head: Any = PotHead(self.features_dim, k, *layers, cue, len(self.game.goals))
        else:
            aims = HitAims(self.game, k) if name == "hits" else PointAims(self.features_dim - 2, k, *layers)
            head = PositionHead(self.features_dim, aims, self.own["speeds"], *layers, cue)
        self.mlp_extractor = head
        self.action_dist = MixtureDistribution(0 if cue is None else NUMBERS)  # pyright: ignore[reportAttributeAccessIssue]
        self.value_net = nn.Linear(head.latent_dim_vf, 1)
        optimizer: Any = self.optimizer_class
        self.optimizer = optimizer(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)

    def set_std(self, std: Sequence[float]) -> None:
        """Sets the standard deviations of the components and stops learning them.

        The first is that of the speed, divided by the largest speed. The second is that of the direction, in radians.
        With "hits" it is that of the sine of the cut angle, and with "pots" it is a multiple of the tolerance.
        """
        head: Any = self.mlp_extractor
        for parameter, value in zip((head.log_along, head.log_across), std, strict=True):
            parameter.requires_grad_(False).fill_(math.log(value))

    def _get_action_dist_from_latent(self, latent_pi: Tensor) -> MixtureDistribution:
        return MixtureDistribution(self.action_dist.others).proba_distribution(latent_pi)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        parameters = super()._get_constructor_parameters()
        del parameters["features_extractor_class"], parameters["features_extractor_kwargs"]
        return parameters | self.own
