"""A policy that rates candidate shots with a network and plays the best one.

A candidate is a hit of the cue ball on an object ball. Each shot that is played is one example. Without a goal the
network learns the probability of a point. With a goal it learns the probability that the shot touches or pots a ball,
and where the cue ball comes to rest. The goal is not an input, so one shot is an example for all goals.

The inputs need no simulation: the places and directions of both balls at the hit, the speed and the direction of the
cue ball once it rolls, and the straight lines that it then follows between cushions. A rule of thumb gives the speed
after a cushion. The lines ignore english, other balls, pockets, and a cushion that the cue ball meets while it slides.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3.common.policies import BasePolicy
from torch import Tensor, nn
from torch.nn import functional

from billiards_env.envs import BilliardsEnv
from billiards_env.envs.tasks import TASKS
from billiards_env.players import pots
from billiards_env.sb3.policy import find_game
from billiards_env.sb3.pot_head import POT_TASKS

RATED_HEADS = ("rated_hits", "rated_pots")
"""The kinds of candidates.

* "rated_hits": hits on each ball, from thin on one side to thin on the other, at several speeds.
* "rated_pots": pots that geometry finds, with several small turns of the direction and at several speeds.
"""

_SPEEDS, _SPEEDS_TO_GOAL = 12, 24  # candidates with the same direction
_TURNS = 5  # candidates with the same pot and speed
_WIDEST = 0.9  # the largest turn of a pot, over its tolerance
_LEGS = 5  # straight lines of the cue ball after the hit
_REFINED, _FINER = 8, 5  # the best candidates of the grid, and steps near each in both directions
_LAYOUTS = 64  # rated together, to limit the memory
_LEAST_LOG, _MOST_LOG = -4.5, 2.0  # of the standard deviation of a place in metres


class Candidates(NamedTuple):
    """c candidate shots.

    Attributes:
        layout: (c,) the number of the layout.
        ball: (c,) the object ball that the cue ball hits.
        direction: (c, 2) direction of the cue ball.
        speed: (c, 1) m/s.
        of_pot: (c, 7) for pots: the turn to the left over the tolerance, the logarithms of the tolerance and of the
            mouth, the length of the ball's path, the gap to other balls, whether it is a bank, and the least speed.
            (c, 0) for hits.
    """

    layout: Tensor
    ball: Tensor
    direction: Tensor
    speed: Tensor
    of_pot: Tensor


class Inputs(NamedTuple):
    """Inputs of the network for c candidates. The tables are reflected so that the cue ball rolls towards +x and +y.

    Attributes:
        columns: (c, size).
        signs: (c, 2) the reflection.
        end: (c, 2) m, the end of the straight lines.
    """

    columns: Tensor
    signs: Tensor
    end: Tensor


class RatedPolicy(BasePolicy):
    """Rates candidate shots and plays the best one.

    Args:
        observation_space, action_space: The spaces of the environment.
        env: Arguments of `gym.make("Billiards-v0", ...)`.
        head: One of `RATED_HEADS`.
        components: The number of hits on each ball, or the largest number of pots.
        speeds: The smallest and the largest speed of a hit, over the largest speed of the environment. Pots use only
            the largest one; their smallest speed is the least at which the ball reaches the pocket.
        banks: Whether to find banks also on tables with a direct pot.
        net_arch: The number of units of each hidden layer.
        activation_fn: The class of the activation function.

    Raises:
        ValueError: If actions are strikes, if "rated_hits" has more than two object balls, or if "rated_pots" has a
            task that is not one of `POT_TASKS`.
    """

    def __init__(
        self,
        observation_space: gym.spaces.Space[Any],
        action_space: gym.spaces.Space[Any],
        *,
        env: Mapping[str, Any],
        head: str,
        components: int,
        speeds: Sequence[float],
        banks: bool = False,
        net_arch: Sequence[int] = (192, 192, 192),
        activation_fn: type[nn.Module] = nn.ReLU,
    ) -> None:
        super().__init__(observation_space, action_space)
        self.game, self.head, self.components, self.speeds, self.banks = find_game(env), head, components, speeds, banks
        self.net_arch, self.activation_fn = list(net_arch), activation_fn
        _check(self.game, head)
        self.radius = TASKS[self.game.task].goal_radius if len(self.game.goals) else None
        size = len(_inputs(self.game, *self._random(torch.rand(1, *observation_space.shape or ())))[0].columns[0])
        widths = (size, *net_arch)
        layers = [layer for a, b in itertools.pairwise(widths) for layer in (nn.Linear(a, b), activation_fn())]
        self.rating = nn.Sequential(*layers, nn.Linear(widths[-1], 1 if self.radius is None else 4))

    def draw(self, observations: Tensor, drawn: int, kept: int) -> tuple[Tensor, Inputs]:
        """Draws random candidates and returns some of them.

        Args:
            observations: (m, size).
            drawn: The number of random candidates of each layout.
            kept: The number of returned candidates of each layout, even. One half is random; the other half are those
                with the best ratings among the rest.

        Returns:
            The actions (m * kept, 2) and the inputs of the network, grouped by layout.
        """
        with torch.no_grad():
            positions, candidates = self._random(observations, drawn)
            inputs, hits = _inputs(self.game, positions, candidates)
            ratings = torch.where(hits, self._ratings(inputs, self._goals(observations, drawn)), -torch.inf)
            ratings = ratings.view(-1, drawn)
            ratings[:, : kept // 2] = torch.inf  # they are random already
            chosen = ratings.topk(kept).indices + drawn * torch.arange(len(ratings))[:, None]
            chosen = chosen.flatten()
        return self._actions(candidates)[chosen], Inputs(*(part[chosen] for part in inputs))

    def loss(self, inputs: Inputs, reached: Tensor, rest: Tensor) -> Tensor:
        """Returns the loss of played candidates.

        Args:
            inputs: As returned by `draw`.
            reached: (m,) whether the shot is a success. In a task with a goal: whether it touches or pots a ball and
                keeps the cue ball on the table.
            rest: (m, 2) m, the places where the cue balls come to rest. They have no effect in tasks without a goal.
        """
        found, wanted = self.rating(inputs.columns), reached.float()
        loss = functional.binary_cross_entropy_with_logits(found[:, 0], wanted)
        if self.radius is None:
            return loss
        # The negative logarithm of the density of a Gaussian
        log_std = found[:, 3].clamp(_LEAST_LOG, _MOST_LOG)
        errors = (inputs.end + found[:, 1:3] - rest * inputs.signs).square().sum(1)
        return loss + (wanted * (0.5 * errors * torch.exp(-2.0 * log_std) + 2.0 * log_std)).mean()

    def _predict(self, observation: Any, deterministic: bool = False) -> Tensor:
        """Returns the best candidates as actions (m, 2); `deterministic` has no effect."""
        return torch.cat([self._best(part) for part in observation.split(_LAYOUTS)])

    def _best(self, observations: Tensor) -> Tensor:
        """Returns the best action of each layout, (m, 2), found on a grid and then near its best points."""
        m, positions, rows = len(observations), _points(self.game, observations)[0], torch.arange(len(observations))
        found = self._find_pots(positions) if self.head == "rated_pots" else None
        grid, steps = self._grid()
        count = len(grid[0])
        places = rows.repeat_interleave(count), *(part.repeat(m) for part in grid)
        ratings, candidates = self._rate(observations, positions, found, *places)
        best = ratings.view(m, count).topk(min(_REFINED, count)).indices + count * rows[:, None]
        near = torch.linspace(-0.5, 0.5, _FINER)
        aside, faster = (part.flatten() for part in torch.meshgrid(near * steps[0], near * steps[1], indexing="ij"))
        which, chosen, share, pace = (part[best.flatten()].repeat_interleave(len(aside)) for part in places)
        share = (share + aside.repeat(best.numel())).clamp(-1.0, 1.0)
        pace = (pace + faster.repeat(best.numel())).clamp(0.0, 1.0)
        ratings, candidates = self._rate(observations, positions, found, which, chosen, share, pace)
        best = ratings.view(m, -1).argmax(1) + len(ratings) // m * rows
        return self._actions(Candidates(*(part[best] for part in candidates)))

    def _rate(
        self, observations: Tensor, positions: Tensor, found: pots.Pots | None, *places: Tensor
    ) -> tuple[Tensor, Candidates]:
        """Returns the ratings (c,) of candidates, minus infinity for pots that do not exist, and the candidates."""
        candidates = self._candidates(positions, found, *places)
        inputs, hits = _inputs(self.game, positions, candidates)
        if found is not None:
            hits &= places[1] < torch.as_tensor(found.count)[candidates.layout]
        goals = None if self.radius is None else _points(self.game, observations)[1][candidates.layout, 0]
        return torch.where(hits, self._ratings(inputs, goals), -torch.inf), candidates

    def _grid(self) -> tuple[tuple[Tensor, Tensor, Tensor], tuple[float, float]]:
        """Returns the candidates of a grid: balls or pots, shares and paces, (c,), and the steps of the last two."""
        hits, speeds = self.head == "rated_hits", _SPEEDS if self.radius is None else _SPEEDS_TO_GOAL
        first = torch.arange(1, self.game.scene.n_balls) if hits else torch.arange(self.components)
        shares = (torch.arange(self.components) + 0.5) * (2.0 / self.components) - 1.0
        shares = shares if hits else torch.linspace(-_WIDEST, _WIDEST, _TURNS)
        i, j, k = torch.meshgrid(*map(torch.arange, (len(first), len(shares), speeds)), indexing="ij")
        grid = first[i].flatten(), shares[j].flatten(), torch.linspace(0.0, 1.0, speeds)[k].flatten()
        return grid, (float(shares[1] - shares[0]), 1.0 / (speeds - 1))

    def _candidates(
        self, positions: Tensor, found: pots.Pots | None, which: Tensor, chosen: Tensor, share: Tensor, pace: Tensor
    ) -> Candidates:
        """Returns candidates, see `_hits` and `_pot_candidates`. All arguments but the first two are (c,)."""
        if found is None:
            return self._hits(positions, which, chosen, share[:, None], pace[:, None])
        return _pot_candidates(found, which, chosen, share[:, None], pace[:, None], self._most())

    def _goals(self, observations: Tensor, times: int) -> Tensor | None:
        """Returns the goal of each layout, repeated; None in a task without a goal."""
        if self.radius is None:
            return None
        return _points(self.game, observations)[1][:, 0].repeat_interleave(times, 0)

    def _ratings(self, inputs: Inputs, goals: Tensor | None) -> Tensor:
        """Returns the logarithms (c,) of the estimated probabilities of success."""
        found = self.rating(inputs.columns)
        chance = functional.logsigmoid(found[:, 0])
        if self.radius is None or goals is None:
            return chance
        # A Gaussian around the predicted place. A Gaussian with the same variance replaces the disc around the goal.
        variance = torch.exp(2.0 * found[:, 3]) + 0.25 * self.radius**2
        errors = ((inputs.end + found[:, 1:3]) * inputs.signs - goals).square().sum(1)
        return chance - 0.5 * errors / variance + torch.log(0.5 * self.radius**2 / variance).clamp(max=0.0)

    def _actions(self, candidates: Candidates) -> Tensor:
        return candidates.direction * candidates.speed / self.game.max_speed

    def _random(self, observations: Tensor, drawn: int = 1) -> tuple[Tensor, Candidates]:
        """Returns the positions (m, n, 2) and `drawn` random candidates of each layout, grouped by layout."""
        positions, which = _points(self.game, observations)[0], torch.arange(len(observations)).repeat_interleave(drawn)
        found, share, pace = None, 2.0 * torch.rand(len(which)) - 1.0, torch.rand(len(which))
        if self.head == "rated_hits":
            playing = (positions[:, 1:].abs() < self._half()).all(2)
            chosen = 1 + torch.multinomial(playing.float() + 1e-9, drawn, replacement=True).flatten()
        else:
            found, share = self._find_pots(positions), _WIDEST * share
            chosen = (torch.rand(len(which)) * torch.as_tensor(found.count)[which]).long()
        return positions, self._candidates(positions, found, which, chosen, share, pace)

    def _half(self) -> Tensor:
        return torch.tensor(self.game.scene.half_extents)

    def _most(self) -> float:
        return self.speeds[1] * self.game.max_speed

    def _hits(self, positions: Tensor, which: Tensor, ball: Tensor, share: Tensor, pace: Tensor) -> Candidates:
        """Returns hits on the balls `ball` (c,) of the layouts `which` (c,).

        `share` (c, 1) is the sine of the cut angle. `pace` (c, 1) is 0 for the smallest speed and 1 for the largest;
        between them the speed is interpolated geometrically.
        """
        reach = float(self.game.scene.balls.contact_distances(0)[1])
        way = positions[which, ball] - positions[which, 0]
        distance = _length(way)
        sine = (share * reach / distance).clamp(-0.99, 0.99)
        ahead = way / distance
        direction = ahead * torch.sqrt(1.0 - sine * sine) - _left(ahead) * sine
        slowest = self.speeds[0] * self.game.max_speed
        speed = slowest * (self._most() / slowest) ** pace
        return Candidates(which, ball, direction, speed, torch.empty(len(which), 0))

    def _find_pots(self, positions: Tensor) -> pots.Pots:
        """Returns the pots of all layouts; for a layout without a pot, a full hit on the nearest target."""
        game, places = self.game, positions.double().numpy()
        potted = (positions.abs() >= self._half()).any(2).numpy()
        tables = pots.Tables(game.scene, game.targets, places, potted, game.max_speed)
        found = pots.find_pots(tables, most=self.components, banks=self.banks)
        none = np.flatnonzero(found.count == 0)
        ways = places[none] - places[none, :1]
        lengths = np.where(game.targets & ~potted[none], np.hypot(ways[..., 0], ways[..., 1]), np.inf)
        nearest = lengths.argmin(1)
        found.count[none], found.ball[none, 0] = 1, nearest
        ahead = ways[np.arange(len(none)), nearest]
        found.shots[none, 0, :, pots.DX : pots.DY + 1] = (ahead / np.hypot(*ahead.T).clip(1e-9)[:, None])[:, None]
        found.shots[none, 0, :, pots.SPEED] = game.max_speed
        found.rows[none, 0] = 0.0
        found.rows[none, 0, pots.TOLERANCE] = found.rows[none, 0, pots.MOUTH] = 1e-3
        found.rows[none, 0, pots.LEAST_SPEED] = 0.5 * game.max_speed
        return found


def _check(game: BilliardsEnv, head: str) -> None:
    name = f"policy.head = {head!r}"
    if game.action != "velocity":
        raise ValueError(f"{name} with action = {game.action!r}: expected 'velocity'")
    if head == "rated_pots" and game.task not in POT_TASKS:
        raise ValueError(f"{name} in the task {game.task!r}: expected one of the tasks {', '.join(POT_TASKS)}")
    if head == "rated_hits" and not (game.scene.n_balls in (2, 3) and game.targets.sum() == game.scene.n_balls - 1):
        raise ValueError(f"{name} with {game.scene.n_balls - 1} object balls: expected one or two")


def _points(game: BilliardsEnv, observations: Tensor) -> tuple[Tensor, Tensor]:
    """Returns the positions of the balls (m, n, 2) and the goals (m, g, 2) of observations (m, size), m."""
    n, half = game.scene.n_balls, torch.tensor(game.scene.half_extents)
    points = observations[:, : 2 * (n + len(game.goals))].unflatten(1, (-1, 2)) * half
    return points[:, :n], points[:, n:]


def _pot_candidates(
    found: pots.Pots, which: Tensor, chosen: Tensor, turn: Tensor, pace: Tensor, most: float
) -> Candidates:
    """Returns candidates near pots.

    Args:
        found: The pots of all layouts.
        which: (c,) the layouts.
        chosen: (c,) the pots. The first pot of the layout replaces one that does not exist.
        turn: (c, 1) the turns to the left, over the tolerance.
        pace: (c, 1) 0 for the least speed, 1 for `most`; between them the speed is interpolated geometrically.
        most: m/s, the largest speed.
    """
    chosen = torch.where(chosen < torch.as_tensor(found.count)[which], chosen, 0)
    rows, shots = (torch.as_tensor(part[which.numpy(), chosen.numpy()]) for part in (found.rows, found.shots))
    least = rows[:, pots.LEAST_SPEED, None].clamp(min=1e-3, max=most)
    speed = least * (most / least) ** pace
    # The direction at the nearest possible speed
    gaps = (shots[..., pots.SPEED] - speed).abs() + 1e9 * (shots[..., pots.SPEED] <= 0)
    shot = shots[torch.arange(len(which)), gaps.argmin(1)]
    ahead = shot[:, pots.DX : pots.DY + 1]
    angle = turn * rows[:, pots.TOLERANCE, None]
    direction = ahead * angle.cos() + _left(ahead) * angle.sin()
    of_pot = (
        turn,
        rows[:, pots.TOLERANCE, None].clamp(min=1e-4).log() + 4.0,
        rows[:, pots.MOUTH, None].clamp(min=1e-4).log() + 3.0,
        rows[:, pots.RUN, None],
        _squashed(rows[:, pots.BALL_GAP, None], 0.02),
        (rows[:, pots.WALL, None] >= 0).double(),
        least,
    )
    ball = torch.as_tensor(found.ball)[which, chosen]
    return Candidates(which, ball, direction.float(), speed.float(), torch.cat(of_pot, 1).float())


def _inputs(game: BilliardsEnv, positions: Tensor, candidates: Candidates) -> tuple[Inputs, Tensor]:
    """Returns the inputs of the network for candidates, and whether they reach a ball in play (c,).

    The speed of the cue ball falls by sliding and then by rolling (`physics.motion`). After the hit it slides on a
    parabola until it rolls.
    """
    scene, numbers = game.scene, game.scene.physics
    slide, roll = numbers.mu_slide * numbers.g, numbers.mu_roll * numbers.g
    half, reach = torch.tensor(scene.half_extents), float(scene.balls.contact_distances(0)[1])
    table, ahead, speed = positions[candidates.layout], candidates.direction, candidates.speed
    cue_ball = table[:, 0]
    ball = table[torch.arange(len(table)), candidates.ball]
    way = ball - cue_ball
    aside = _cross(ahead, way).clamp(-reach, reach)
    approach = _dot(way, ahead) - torch.sqrt((reach**2 - aside**2).clamp(min=0.0))
    hit = cue_ball + approach * ahead
    line = (ball - hit) / reach
    cosine = _dot(ahead, line)

    begins_to_roll = 12 / 49 * speed**2 / slide
    sliding = torch.sqrt((speed**2 - 2.0 * slide * approach).clamp(min=0.0))
    rolling = torch.sqrt(((5 / 7 * speed) ** 2 - 2.0 * roll * (approach - begins_to_roll)).clamp(min=0.0))
    slides = approach < begins_to_roll
    arrival = torch.where(slides, sliding, rolling)
    slip = torch.where(slides, speed - 3.5 * (speed - arrival), 0.0) * ahead
    push = 0.5 * (1.0 + numbers.e_ball) * cosine * arrival * line
    after, slip = arrival * ahead - push, slip - push
    rolled = after - 2 / 7 * slip
    time = _length(slip) * (2 / 7 / slide)
    begin = hit + 0.5 * time * (after + rolled)

    signs = torch.where(rolled < 0, -1.0, 1.0)
    cue_ball, ball, hit, begin, ahead, line, after, rolled = (
        part * signs for part in (cue_ball, ball, hit, begin, ahead, line, after, rolled)
    )
    hand = signs.prod(1, keepdim=True)
    leaves, rolls = _unit(after), _unit(rolled)
    speeds = _length(rolled), _length(after), arrival, speed
    places = cue_ball, ball, hit, begin
    numbers_of_hit = cosine, aside / reach * hand, aside.abs() / reach, approach, 1.0 / (approach + 0.1), time
    columns = [*(place / half for place in places), ahead, line, leaves, rolls, *speeds, *numbers_of_hit]
    columns += [_cross(leaves, rolls), _length(begin - hit), _log_length(rolled, roll)]
    if candidates.of_pot.shape[1]:
        columns += [candidates.of_pot[:, :1] * hand, candidates.of_pot[:, 1:]]
    target = None
    if TASKS[game.task].cushions is not None and scene.n_balls == 3:
        target = table[torch.arange(len(table)), 3 - candidates.ball] * signs
        columns += [target / half, *_seen(target - cue_ball, ahead), *_seen(target - hit, leaves)]
    lines, end = _lines(begin, rolled, half - scene.balls.radius[0], slide, roll, target)
    hits = (ball.abs() < half).all(1) & (arrival[:, 0] > 0.0)
    return Inputs(torch.cat((*columns, *lines, end / half), 1), signs, end), hits


def _lines(
    place: Tensor, velocity: Tensor, room: Tensor, slide: float, roll: float, target: Tensor | None
) -> tuple[list[Tensor], Tensor]:
    """Returns the inputs about the straight lines of a rolling ball between cushions, and their end (c, 2).

    After a cushion the ball keeps a share of its speed across the cushion and another share along it. Both are linear
    in the sine of the angle between the path and the cushion. The shares once the ball rolls again are a fit to the
    cushions of the scene "pool".

    Args:
        place: (c, 2) m, where the ball begins to roll.
        velocity: (c, 2) m/s.
        room: (2,) m, the largest coordinates of the ball's centre.
        slide: m/s^2, deceleration of the ball while it slides.
        roll: m/s^2, the same while it rolls.
        target: (c, 2) m, the ball to touch; None if there is none.
    """
    found, place = [], torch.minimum(torch.maximum(place, -room), room)
    for _ in range(_LEGS):
        speed, way = _length(velocity), _unit(velocity)
        to_sides = (torch.where(way < 0, -room, room) - place) / torch.where(way.abs() < 1e-4, 1e-4, way)
        run = to_sides.clamp(min=0.0).amin(1, keepdim=True)
        longest = speed**2 / (2.0 * roll)
        length = torch.minimum(run, longest)
        if target is not None:
            found += [*_seen(target - place, way), _squashed(length - _dot(target - place, way), 0.1)]
        place = place + length * way
        found += [place, way, 0.5 * torch.log(length + 0.01), _squashed(longest - run, 0.3)]
        is_end = to_sides[:, :1] <= to_sides[:, 1:]  # a short cushion
        sine = torch.where(is_end, way[:, :1], way[:, 1:]).abs()
        kept = torch.sqrt((speed**2 - 2.0 * roll * run).clamp(min=0.0)) * way
        is_across = torch.cat((is_end, ~is_end), 1)
        at_once = kept * torch.where(is_across, -(0.75 + 0.09 * sine), 1.0 - 0.36 * sine)
        velocity = kept * torch.where(is_across, -(0.265 + 0.305 * sine), 0.985 - 0.295 * sine)
        place = place + 0.5 * _length(at_once - velocity) / slide * (at_once + velocity)
        place = torch.minimum(torch.maximum(place, -room), room)
    return found, place


def _seen(way: Tensor, ahead: Tensor) -> tuple[Tensor, ...]:
    """Returns inputs about a point: the cosine and sine of its angle to a line, and its distances.

    The distances are that from the start of the line, and that from the line itself on two scales.
    """
    distance, aside = _length(way), _cross(ahead, way)
    return _dot(ahead, way) / distance, aside / distance, distance, _squashed(aside, 0.05), _squashed(aside, 0.2)


def _squashed(x: Tensor, unit: float) -> Tensor:
    """Maps numbers to the range from -1 to 1; `unit` becomes 0.5."""
    return x / (x.abs() + unit)


def _log_length(velocity: Tensor, roll: float) -> Tensor:
    """Returns half the logarithm of the distance that a ball rolls."""
    return 0.5 * torch.log(_dot(velocity, velocity).clamp(min=1e-6) / (2.0 * roll))


def _dot(a: Tensor, b: Tensor) -> Tensor:
    return (a * b).sum(1, keepdim=True)


def _cross(a: Tensor, b: Tensor) -> Tensor:
    return a[:, :1] * b[:, 1:] - a[:, 1:] * b[:, :1]


def _left(way: Tensor) -> Tensor:
    return torch.stack((-way[:, 1], way[:, 0]), 1)


def _length(a: Tensor) -> Tensor:
    return torch.sqrt(_dot(a, a).clamp(min=1e-12))


def _unit(a: Tensor) -> Tensor:
    return a / _length(a)
