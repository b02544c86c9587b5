"""The head "pots": components for each pot that `billiards_env.players.pots` finds.

A pot has one component for each of several speeds and, if actions are strikes, for each of several offsets of the tip.
Geometry gives the aim and the path of the cue ball for each of them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Generator, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, create_mlp
from stable_baselines3.common.type_aliases import RolloutBufferSamples
from torch import Tensor, nn

from billiards_env.envs import BilliardsEnv
from billiards_env.envs.tasks import TASKS
from billiards_env.physics.strike import CueNumbers
from billiards_env.players import pots
from billiards_env.sb3.cue_parts import MOST, NUMBERS, cue_of, cue_parts, speed_gain, turned
from billiards_env.sb3.mixture import NEVER

Floats = NDArray[np.float64]

_S = len(pots.SPEEDS)
_FARTHEST = 1.5  # m; larger distances from the goal are inputs of this size

POT_TASKS = tuple(name for name, task in TASKS.items() if task.pots_any_ball)
"""The tasks of the head."""

_SHARES = (-0.6, -0.3, 0.3, 0.6)
OFFSETS = ((0.0, 0.0), *((0.0, top) for top in _SHARES), *((side, 0.0) for side in _SHARES))
"""Offsets of the tip (side, top) in the components of a policy of strikes, divided by the miscue offset. None has both,
because the cue ball would then swerve, which geometry ignores."""

_NEAR = 0.01  # m; the input of a gap of this size is half that of a very large gap


def offsets(cue: CueNumbers | None) -> Sequence[tuple[float, float]]:
    """Returns the offsets of the tip at which each pot has components, divided by the miscue offset."""
    return OFFSETS if cue is not None else OFFSETS[:1]


def _hand(rows: Floats) -> Floats:
    """Returns 1 for pots that cut the object ball to the left, and -1 for the others, for `Pots.rows`."""
    return np.where(rows[..., pots.CUT_SIN] < 0, -1.0, 1.0)


class Columns(NamedTuple):
    """The columns of a pot's features, as slices. `ease` and those after it are inputs of the networks.

    The inputs are of order 1. Reflecting the table does not change them.

    Attributes:
        exists: 1 if the pot exists.
        turn: 1 if the object ball goes to the left of the cue ball's direction, else -1.
        tolerance: The largest error of the direction, radians.
        dx, dy: The cue ball's direction at each speed.
        speed: The speeds, divided by the largest speed; 0 if the pot is not possible at this speed.
        ease: The logarithm of the tolerance.
        geometry: The mouth, the angle of the cut, the path lengths of both balls, the room, and whether it is a bank.
        pace: The same as `speed`.
        gaps: The gaps along the path of the cue ball after the hit, for each speed.
        rest: The share of the balls that are left, and the rest of the observation after the goal.
        goal: The goal, see `PotFeatures._goal`; no columns without a goal.
        distances: The distance from the goal for each speed; no columns without a goal.
        offset: The offset of the tip, to the side of the cut and above; no columns if actions are velocities.
    """

    exists: Any
    turn: Any
    tolerance: Any
    dx: Any
    dy: Any
    speed: Any
    ease: Any
    geometry: Any
    pace: Any
    gaps: Any
    rest: Any
    goal: Any
    distances: Any
    offset: Any

    @property
    def width(self) -> int:
        """The number of columns."""
        return self.offset.stop

    @property
    def inputs(self) -> slice:
        """The inputs of the networks."""
        return slice(self.ease.start, None)


def columns(rest: int, goals: int, strikes: bool) -> Columns:
    """Returns the columns of a pot.

    `rest` is the number of values after the goal in an observation, and `goals` is 0 or 1.
    """
    with_goal = (10 + 2 * _S) * goals, _S * goals
    widths = (1, 1, 1, _S, _S, _S, 1, 7, _S, _S * pots.N_GAPS, 1 + rest, *with_goal, 2 * strikes)
    return Columns(*(slice(end - width, end) for width, end in zip(widths, itertools.accumulate(widths), strict=True)))


class Layouts(NamedTuple):
    """The observations of m tables, in metres.

    Attributes:
        positions: (m, n, 2), the balls.
        potted: (m, n) bool.
        goals: (m, g, 2), the goals.
        rest: (m, size), the rest of the observations.
    """

    positions: Floats
    potted: NDArray[np.bool_]
    goals: Floats
    rest: Floats


class PotFeatures(BaseFeaturesExtractor):
    """Features of the easiest pots of each layout, one pot after the other, (m, size).

    If actions are strikes, the pots are listed once for each offset in `OFFSETS`. On a table without a pot, the first
    pot is a full hit on the nearest ball.

    Args:
        space: The space of observations, `(size,)`.
        env: The environment.
        most: The largest number of pots.
        banks: Whether to find banks also on tables with a direct pot.

    Raises:
        ValueError: If the task of the environment is not one of `POT_TASKS`.
    """

    def __init__(self, space: gym.spaces.Box, env: BilliardsEnv, most: int, banks: bool = False) -> None:
        if env.task not in POT_TASKS:
            raise ValueError(
                f"policy.head = 'pots' in the task {env.task!r}: expected one of the tasks {', '.join(POT_TASKS)}, or "
                "another head"
            )
        self.scene, self.max_speed, self.targets, self.most = env.scene, env.max_speed, env.targets, most
        self.banks = banks
        self.goals, self.cue = len(env.goals), cue_of(env)
        rest = int(np.prod(space.shape)) - 2 * (self.scene.n_balls + self.goals)
        self.at = columns(rest, self.goals, self.cue is not None)
        self.n_rows = most * len(offsets(self.cue))
        super().__init__(space, self.n_rows * self.at.width)
        self.scale = np.array(self.scene.half_extents)
        self.last: tuple[Tensor, Tensor] = torch.empty(0), torch.empty(0)

    def forward(self, observations: Tensor) -> Tensor:
        """Returns the features of observations (m, size). An input of the size of features is returned unchanged.

        The last result is stored, so a second call with the same observations is fast.
        """
        if observations.shape[1] == self.features_dim:
            return observations
        if not torch.equal(self.last[0], observations):
            self.last = observations.clone(), self.compute(observations)
        return self.last[1]

    def compute(self, observations: Tensor) -> Tensor:
        """Returns the features of observations (m, size)."""
        layouts = self._layouts(observations.numpy().astype(np.float64))
        features = np.concatenate([self._pots(layouts, offset) for offset in offsets(self.cue)], axis=1)
        alone = ~features[..., self.at.exists].any((1, 2))
        if alone.any():
            features[alone, 0] = self._full_hits(layouts.positions[alone], layouts.potted[alone])
        return torch.from_numpy(features).flatten(1)

    def _layouts(self, points: Floats) -> Layouts:
        """Returns the layouts of observations (m, size)."""
        m, n = len(points), self.scene.n_balls
        balls, goals, rest = np.split(points, (2 * n, 2 * (n + self.goals)), axis=1)
        balls = balls.reshape(m, n, 2)
        potted = np.any(np.abs(balls) >= 1.0, axis=-1)  # a ball in play is inside
        return Layouts(balls * self.scale, potted, goals.reshape(m, self.goals, 2) * self.scale, rest)

    def _pots(self, layouts: Layouts, offset: tuple[float, float]) -> NDArray[np.float32]:
        """Returns the features (m, most, width) of the pots for an offset of the tip, divided by the miscue offset."""
        positions, potted, goals, rest = layouts
        tip, fastest = offset, self.max_speed
        if self.cue is not None:  # a strike off the centre gives the ball less speed
            tip = self.cue.miscue * offset[0], self.cue.miscue * offset[1]
            fastest *= speed_gain(self.cue, *torch.tensor(offset, dtype=torch.float64)).item()
        tables = pots.Tables(self.scene, self.targets, positions, potted, fastest)
        found = pots.find_pots(tables, most=self.most, offset=tip, banks=self.banks)
        m, k = found.ball.shape
        rows, shots = found.rows, found.shots
        exists = np.arange(k) < found.count[:, None]
        tolerance = np.where(exists, rows[..., pots.TOLERANCE], 1.0)
        speed, gaps = shots[..., pots.SPEED] / self.max_speed, shots[..., pots.GAPS :]
        hand = _hand(rows)
        left, none = (~potted[:, self.targets]).mean(1), np.empty((m, k, 0))
        goal, distances = self._goal(rows, shots, positions[:, 0], goals[:, 0]) if self.goals else (none, none)
        pot = Columns(
            exists=exists,
            turn=hand,
            tolerance=tolerance,
            dx=shots[..., pots.DX],
            dy=shots[..., pots.DY],
            speed=speed,
            ease=np.log(tolerance) + 4.0,
            geometry=np.stack(
                (
                    np.log(np.where(exists, rows[..., pots.MOUTH], 1.0)) + 3.0,
                    rows[..., pots.CUT_COS],
                    np.abs(rows[..., pots.CUT_SIN]),
                    rows[..., pots.APPROACH],
                    rows[..., pots.RUN],
                    rows[..., pots.BALL_GAP] / pots.FAR,
                    rows[..., pots.WALL] >= 0,
                ),
                axis=-1,
            ),
            pace=speed,
            gaps=gaps / (np.abs(gaps) + _NEAR),
            rest=np.broadcast_to(np.column_stack((left, rest))[:, None], (m, k, 1 + rest.shape[1])),
            goal=goal,
            distances=distances,
            offset=none if self.cue is None else np.stack((offset[0] * hand, np.full((m, k), offset[1])), -1),
        )
        features = np.empty((m, k, self.at.width), np.float32)
        for at, values in zip(self.at, pot, strict=True):
            features[..., at] = values.reshape(m, k, at.stop - at.start)
        features *= exists[..., None]
        return features

    def _goal(self, rows: Floats, shots: Floats, cue_ball: Floats, goals: Floats) -> tuple[Floats, Floats]:
        """Returns the inputs about the goals (m, 2) for `Pots.rows` and `Pots.shots`.

        They are the same for reflected tables: the goal as seen from the hit, ahead and on the side of the cut; the
        places of the hit and the goal, the direction of the cue ball and the side of the cut on a table that is
        reflected so that the direction is positive; and, for each speed, the way from the goal to the place where
        geometry expects the cue ball to come to rest, on this table. The second array is the length of this way.
        """
        ghost = rows[..., pots.GHOST_X : pots.GHOST_Y + 1]
        hand = _hand(rows)[..., None]
        ahead, way = ghost - cue_ball[:, None], goals[:, None] - ghost
        ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True).clip(1e-9)
        left = np.stack((-ahead[..., 1], ahead[..., 0]), -1)
        signs = np.where(ahead < 0, -1.0, 1.0)
        missing = shots[..., pots.END_X : pots.END_Y + 1] - goals[:, None, None]
        missing = np.where(shots[..., pots.SPEED, None] > 0, missing * signs[:, :, None], _FARTHEST)
        goal = np.concatenate(
            (
                (way * ahead).sum(-1, keepdims=True),
                (way * left).sum(-1, keepdims=True) * hand,
                np.linalg.norm(way, axis=-1, keepdims=True),
                ghost * signs / self.scale,
                goals[:, None] * signs / self.scale,
                np.abs(ahead),
                hand * signs.prod(-1, keepdims=True),
                missing.clip(-_FARTHEST, _FARTHEST).reshape(*rows.shape[:2], -1),
            ),
            axis=-1,
        )
        return goal, np.linalg.norm(missing, axis=-1).clip(max=_FARTHEST)

    def _full_hits(self, positions: Floats, potted: NDArray[np.bool_]) -> Any:
        """Returns the features of full hits on the nearest ball at the largest speed, one for each table."""
        ways = positions - positions[:, :1]
        lengths = np.where(self.targets & ~potted, np.hypot(ways[..., 0], ways[..., 1]), np.inf)
        nearest = ways[np.arange(len(ways)), lengths.argmin(1)]
        nearest /= np.hypot(*nearest.T).clip(1e-9)[:, None]
        hits = np.zeros((len(ways), self.at.width), np.float32)
        for at in (self.at.exists, self.at.turn, self.at.tolerance, self.at.speed):
            hits[:, at] = 1.0
        hits[:, self.at.dx], hits[:, self.at.dy] = nearest[:, :1], nearest[:, 1:]
        return hits


class FeatureBuffer(RolloutBuffer):
    """A rollout buffer that also stores features, so that they are computed once and not in each epoch.

    Its samples have features instead of observations. `PotFeatures` returns these unchanged.

    Args:
        args: Positional arguments of `RolloutBuffer`.
        extractor: The features extractor of the policy. It is set after the construction. Without it, for example
            after `PPO.load`, samples have observations.
        kwargs: Keyword arguments of `RolloutBuffer`.
    """

    extractor: PotFeatures | None = None

    def reset(self) -> None:
        """Empties the buffer."""
        super().reset()
        self.features: list[Tensor] = []

    def add(self, obs: np.ndarray, *args: Any, **kwargs: Any) -> None:
        """Adds a step of all environments."""
        if self.extractor is not None:
            self.features.append(self.extractor(torch.from_numpy(obs)))
        super().add(obs, *args, **kwargs)

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """Yields minibatches in a random order."""
        if self.features and not self.generator_ready:
            # The order of the other arrays, see `RolloutBuffer.swap_and_flatten`.
            self.flat_features = torch.stack(self.features, 1).flatten(0, 1)
            self.features = []
        yield from super().get(batch_size)

    def _get_samples(self, batch_inds: np.ndarray, env: Any = None) -> RolloutBufferSamples:
        samples = super()._get_samples(batch_inds, env)
        if self.extractor is None:
            return samples
        return samples._replace(observations=self.flat_features[torch.from_numpy(batch_inds)])


class PotHead(nn.Module):
    """Networks with the same weights for every pot.

    They play with any number of balls. Their shots do not depend on the order of the balls, and reflected tables have
    reflected shots. For each pot, offset of the tip and speed they compute the weight of the component, a factor of the
    speed, and a turn of the direction as a multiple of the tolerance. Before the training the weights are large for
    large tolerances and low speeds. They are small for shots with spin, and for shots after which the cue ball
    enters a pocket before it meets a cushion.

    Args:
        features_dim: The size of the features.
        components: The largest number of pots.
        hidden, activation, cue: As in `PositionHead`.
        goals: The number of goals, 0 or 1. With a goal the weights are large before the training if geometry expects
            the cue ball to come to rest near it.
    """

    def __init__(
        self,
        features_dim: int,
        components: int,
        hidden: Sequence[int],
        activation: type[nn.Module],
        cue: CueNumbers | None,
        goals: int,
    ) -> None:
        super().__init__()
        others = 0 if cue is None else NUMBERS
        self.n_rows, self.cue, self.others = components * len(offsets(cue)), cue, others
        rest = features_dim // self.n_rows - columns(0, goals, cue is not None).width
        self.at = columns(rest, goals, cue is not None)
        last = hidden[-1]
        layers = create_mlp(self.at.width - self.at.inputs.start, -1, list(hidden), activation)
        self.layers, self.value_net = nn.Sequential(*layers), nn.Sequential(nn.Linear(2 * last, last), activation())
        self.output = nn.Linear(last, (3 + others) * _S)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)
        # Effects on the weight of a component: of the tolerance, of a scratch and of the speed.
        self.ease, self.scratch, self.haste = (nn.Parameter(torch.tensor(value)) for value in (3.0, 6.0, 1.0))
        self.near = nn.Parameter(torch.tensor(6.0)) if goals else None  # of the distance from the goal
        self.spin = nn.Parameter(torch.tensor(2.0)) if cue is not None else None  # of the tip's offset
        self.log_along = nn.Parameter(torch.tensor(math.log(0.04)))
        self.log_across = nn.Parameter(torch.tensor(math.log(0.3)))  # over the tolerance
        self.log_others = nn.Parameter(torch.full((others, 1), math.log(0.1)))
        self.latent_dim_vf = last

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the components of the mixtures, see `Components.flat`, and the input of the value function."""
        table = features.view(-1, self.at.width)
        places = table[:, self.at.exists].nonzero()[:, 0]
        pots_found = table[places]
        pot = Columns(*(pots_found[:, at] for at in self.at))
        hidden = self.layers(pots_found[:, self.at.inputs])
        weight, faster, aside, *others = self.output(hidden).chunk(3 + self.others, 1)
        gaps = pot.gaps.unflatten(1, (_S, pots.N_GAPS))
        logit = weight + self.ease * pot.ease - self.scratch * (gaps[..., 0] < 0) - self.haste * pot.speed
        if self.near is not None:
            logit = logit - self.near * pot.distances
        angle, speed = aside * pot.tolerance * pot.turn, pot.speed * torch.exp(0.5 * faster.tanh())
        if self.cue is not None and self.spin is not None:
            logit = logit - self.spin * pot.offset.norm(dim=1, keepdim=True)
            left, above = torch.atanh(pot.offset / MOST).split(1, 1)
            cue = cue_parts(self.cue, others[0] + left, others[1] + above, others[2])
            side = cue.side * pot.turn  # a reflection changes the side
            angle, speed = angle + cue.turn * pot.turn, speed / cue.gain
            others = [side, cue.top, cue.elevation]
        speed = speed.clamp(0.01, 1.0)
        parts = (
            torch.where(pot.speed > 0, logit, NEVER),
            *turned(pot.dx, pot.dy, angle),
            speed,
            self.log_along.expand_as(speed),
            self.log_across + torch.log(pot.tolerance * speed),
            *others,
            *(log_std.expand_as(speed) for log_std in self.log_others),
        )
        none = torch.tensor([NEVER] * _S + [0.0] * (len(parts) - 1) * _S)
        latent = none.repeat(len(table), 1).index_copy(0, places, torch.cat(parts, 1))
        pooled = torch.zeros(len(table), hidden.shape[1]).index_copy(0, places, hidden).unflatten(0, (-1, self.n_rows))
        # From the order (pot, part, speed) to (part, pot, speed).
        latent = latent.view(-1, self.n_rows, len(parts), _S).transpose(1, 2).flatten(1)
        return latent, self.value_net(torch.cat((pooled.sum(1), pooled.amax(1)), 1))

    def forward_actor(self, features: Tensor) -> Tensor:
        """Returns the components of the mixtures."""
        return self(features)[0]

    def forward_critic(self, features: Tensor) -> Tensor:
        """Returns the input of the value function."""
        return self(features)[1]
