"""The network of `billiards_env.sb3.AimPolicy`: from the positions of the balls to a mixture of Gaussians over actions.

It is a mixture density network (Bishop 1994). Each component of the mixture aims at a learned point next to an object
ball. The network contains no pockets, and without `diameter` no ghost balls or cut angles. With `diameter` it also
computes the direction of the object ball after the hit, and whether other balls are in the paths of both balls.
`agents.likelihood` and `examples/ppo.py` train it without PPO of Stable-Baselines3.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import torch
from torch import Tensor, nn

TIP = 3
"""The number of entries of a strike after its velocity: side, top and elevation."""

_MOST = 0.7  # largest mean side and top over the miscue offset, so that the mean is no miscue
_MOST_FACTOR = 1.5  # largest logarithm of a component's own factor of a standard deviation
_LEVEL = -0.5  # the mean elevation before the training: below 0 the cue is level
_FAR = 60.0  # densities of exp(-60) have no effect, and much smaller ones are denormal numbers, which are slow
_LEAST_WORTH = 1e-3  # of a mixture that is joined with others
_EVEN, _WIDE = 0.3, 2.0  # sharpness and spread of the most varied proposals
_PATH_UNITS = 16  # hidden units of the network of the paths
_NEVER = -1e4  # the logit of a component whose ball is not on the table, or not legal

ACTIVATIONS: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU, "elu": nn.ELU, "silu": nn.SiLU}
"""The activations of policies, by their names in a configuration."""

OBSERVED = ("positions", "goal", "legal_balls", "shots_left", "physics", "in_hand")
"""The features of observations that the networks can take. The others follow from the positions."""


class Mixture(NamedTuple):
    """m mixtures of k Gaussians over actions.

    An action begins with a velocity, divided by the largest speed. Each Gaussian has one standard deviation along its
    direction and one across it. A rotation does not change areas, so the density is also the density of the velocity. A
    strike has three more numbers, which are independent. Its side turns the direction of the ball, so the direction of
    the cue is the direction of the Gaussian turned back by an angle with the tangent `turn * side`.

    Attributes:
        log_weight: (m, k) logarithms of the weights.
        dx, dy: (m, k) direction, a unit vector.
        speed: (m, k) mean along the direction.
        across: (m, k) standard deviation across the direction.
        along: (m, k) standard deviation along it.
        log_width: (m, k) logarithm of the product of the component's own factors of `across` and `along`; 0 without
            `own_std` of `AimNetwork`.
        tip: (m, 3, k) means of side, top and elevation; (m, 0, k) without strikes.
        tip_std: () their standard deviation.
        turn: ().
    """

    log_weight: Tensor
    dx: Tensor
    dy: Tensor
    speed: Tensor
    across: Tensor
    along: Tensor
    log_width: Tensor
    tip: Tensor
    tip_std: Tensor
    turn: Tensor

    def sample(self, sharpness: float = 1.0, spread: float = 1.0, generator: torch.Generator | None = None) -> Tensor:
        """Returns a random action of each mixture, (m, 2) or (m, 5).

        Args:
            sharpness: The exponent of the weights; less than 1 chooses the components more evenly.
            spread: The factor of the standard deviations.
            generator: The generator to draw from; None for that of PyTorch.
        """
        component = torch.multinomial((sharpness * self.log_weight).exp(), 1, generator=generator)
        shape, device = (2 + self.tip.shape[1], len(component)), component.device
        return self._action(component, spread * torch.randn(shape, device=device, generator=generator))

    def samples(self, count: int) -> Tensor:
        """Returns `count` random actions of each mixture, (m, count, a)."""
        component = torch.multinomial(self.log_weight.exp(), count, replacement=True).reshape(-1, 1)
        errors = torch.randn(2 + self.tip.shape[1], len(component))
        return self.repeated(count)._action(component, errors).unflatten(0, (-1, count))

    def proposals(self, count: int, generator: torch.Generator) -> Tensor:
        """Returns `count` proposed actions of one mixture, (count, a): the mode first.

        The means of the components, in the order of `mode`, take turns with random actions, and with random actions
        of more even weights and larger deviations. The best of 64 such actions succeeds more often than the best of 64
        random ones, with and without noise.
        """
        possible = int((self.log_weight > -_FAR).sum())
        means = self._heights().argsort(1, descending=True)[0, : min((count + 2) // 3, possible)]
        many = self.repeated(max(1, (count - len(means) + 1) // 2))
        parts = (
            self.repeated(len(means))._action(means[:, None], self.log_weight.new_zeros(2 + self.tip.shape[1], 1)),
            many.sample(generator=generator),
            many.sample(_EVEN, _WIDE, generator),
        )
        turns = torch.cat([torch.arange(len(part)) * 3 + k for k, part in enumerate(parts)]).argsort()
        return torch.cat(parts)[turns][:count]

    def joined(self, worth: Tensor) -> Mixture:
        """Returns one mixture of the components of all m, whose weights are multiplied by `worth` (m,)."""
        m, k = self.dx.shape
        log_weight = (self.log_weight + worth.clamp(min=_LEAST_WORTH).log()[:, None]).reshape(1, -1).log_softmax(1)
        names = ("dx", "dy", "speed", "across", "along", "log_width")
        parts = {name: getattr(self, name).reshape(1, m * k) for name in names}
        return self._replace(log_weight=log_weight, tip=self.tip.transpose(0, 1).flatten(1)[None], **parts)

    def repeated(self, count: int) -> Mixture:
        """Returns each mixture `count` times."""
        parts = (part.repeat_interleave(count, 0) if part.dim() else part for part in self)
        return Mixture(*parts)

    def mode(self, errors: Tensor | None = None) -> Tensor:
        """Returns the mean of the Gaussian with the largest weight over its own factors, (m, 2) or (m, 5).

        Args:
            errors: (2, m) or (5, m), added to the mean, in standard deviations; None for no errors.
        """
        if errors is None:
            errors = self.log_weight.new_zeros(2 + self.tip.shape[1], 1)
        return self._action(self._heights().argmax(1, keepdim=True), errors)

    def _heights(self) -> Tensor:
        """Returns the logarithms (m, k) of the weights over the own factors of the standard deviations."""
        return self.log_weight - self.log_width

    def _action(self, component: Tensor, errors: Tensor) -> Tensor:
        """Returns the actions of components (m, 1); `errors` are in standard deviations."""
        dx, dy, speed, across, along = (part.gather(1, component)[:, 0] for part in self[1:6])
        ahead, aside = speed + errors[0] * along, errors[1] * across
        x, y = ahead * dx - aside * dy, ahead * dy + aside * dx
        numbers = self.tip.shape[1]
        if not numbers:
            return torch.stack((x, y), 1)
        means = self.tip.gather(2, component[:, None].expand(-1, numbers, 1))[:, :, 0]
        tip = means + self.tip_std * errors[2:].T
        return torch.cat((torch.stack(_turned(x, y, -self.turn * tip[:, 0]), 1), tip), 1)

    def log_prob(self, actions: Tensor) -> Tensor:
        """Returns the logarithms of the densities of actions.

        Args:
            actions: (m, a), or (m, n, a) for n actions of each mixture.

        Returns:
            (m,) or (m, n).
        """
        if actions.dim() == 2:
            return self.log_prob(actions[:, None])[:, 0]
        x, y, tip = actions[..., :1], actions[..., 1:2], actions[..., 2:]
        numbers = self.tip.shape[1]
        if numbers:
            x, y = _turned(x, y, self.turn * tip[..., :1])
        dx, dy, speed, across, along = (part[:, None] for part in self[1:6])
        ahead = x * (dx / along) + y * (dy / along) - speed / along
        aside = y * (dx / across) - x * (dy / across)
        far = (0.5 * (ahead * ahead + aside * aside)).clamp(max=_FAR)
        logs = (self.log_weight[:, None] - (across * along).log()) - far
        if numbers:
            logs = logs - 0.5 * ((tip[..., None] - self.tip[:, None]) / self.tip_std).square().sum(2)
        constant = numbers * self.tip_std.log() + (1 + 0.5 * numbers) * math.log(2 * math.pi)
        highest = logs.detach().amax(2, keepdim=True)
        near = (logs - highest).clamp(min=-_FAR).exp()  # exp of much less gives denormal numbers
        return near.sum(2).log() + highest[..., 0] - constant

    def entropy(self) -> Tensor:
        """Returns the entropies (m,) of the choice of the component. The entropy of a mixture has no closed form."""
        return -(self.log_weight.exp() * self.log_weight).sum(1)


class Layouts(NamedTuple):
    """m layouts as the networks take them, once for each of f object balls, see `AimNetwork`.

    Attributes:
        choice: (m, f, c) the outputs of the first network of the choice.
        signs: (m, f, 2) 1 or -1, the reflection of x and y.
        dx: (m, f, p) the directions to the points, reflected back.
        dy: (m, f, p)
        inverse: (m, f, p) 1/m: 1 over the distances of the points.
        paths: (m, f, r * p) what the paths add to the logits; (m, f, 0) without `diameter` or with one object ball.
        allowed: (m, f) bool, whether a component may aim at the ball.
    """

    choice: Tensor
    signs: Tensor
    dx: Tensor
    dy: Tensor
    inverse: Tensor
    paths: Tensor
    allowed: Tensor


class _OtherBalls(NamedTuple):
    """The other object balls of m layouts, for each of f balls in first place.

    Attributes:
        places: (m, f, n - 1, 2) reflected positions.
        vectors: (m, f, n - 1, 2) m, from the cue ball to them.
        present: (m, f, n - 1) bool, whether they are on the table.
        flags: (m, f, n - 1, 1) 1 for a legal ball; (m, f, n - 1, 0) without legal balls.
    """

    places: Tensor
    vectors: Tensor
    present: Tensor
    flags: Tensor


class _Inputs(NamedTuple):
    """What the networks take for m layouts, once for each of f object balls, see `AimNetwork`.

    Attributes:
        features: (m * f, i) the inputs of the first layers.
        near: (m * f, j) the inputs that depend only on the ball in first place.
        signs: (m * f, 2) 1 or -1, the reflection of x and y.
        to_ball: (m * f, 2) m, from the cue ball to the ball in first place, reflected.
        others: The other object balls; None with one object ball.
        chosen, judged, aimed: (m * f, units) what they add to the first layers of `choice`, `critic` and `points`; None
            with one object ball.
        possible: (m, f) bool, whether a component may aim at the ball.
        counted: (m, f) bool, whether the ball counts in the value.
    """

    features: Tensor
    near: Tensor
    signs: Tensor
    to_ball: Tensor
    others: _OtherBalls | None
    chosen: Tensor | None
    judged: Tensor | None
    aimed: Tensor | None
    possible: Tensor
    counted: Tensor


class AimNetwork(nn.Module):
    """The mixture for observations, and the value function.

    The networks take a layout once for each object ball, with this ball in first place. A table has two axes of
    symmetry, so each layout is reflected to x >= 0 and y >= 0 for this ball, and the directions are reflected back. The
    other object balls enter as the sum of the outputs of one network (Zaheer et al. 2017, Deep sets). So the weights
    fit any number of balls, and the order of the balls does not matter. Before the training the other balls have no
    effect.

    Args:
        half_extents: Half the length and half the width of the table, m: the units of the observation.
        points: The number of points to aim at next to each object ball.
        speeds: Borders of the ranges of mean speeds, over the largest speed. Each point has a component in each range.
        hidden: Units of each hidden layer of the choice; the other networks have half as many.
        aim: Whether the points depend on the position of their "ball", or on the whole "layout" and the goal.
        features: The shapes of the features that the networks observe, by name, some of `OBSERVED`. With "legal_balls"
            only the components of legal balls have weight.
        strikes: Whether the actions are strikes.
        waves: The number of octaves of sines and cosines of the positions that the networks also take. With them they
            learn fine differences faster (Tancik et al. 2020, Fourier features).
        goal_units: Units of two more layers of the choice, the only ones that depend on the goal. Many goals of one
            layout then share the other layers. If `aim` is "layout", the last of them also moves the point of
            each component sideways. 0 for no such layers: the goal is then an input of all networks. It has no effect
            without a goal.
        diameter: The diameter of a ball, m. With it the logits also depend on how clear two paths are: that of the cue
            ball to its contact with the ball in first place, and that of this ball from there on. 0 for no such paths.
        own_std: Whether each component also has its own factors of the standard deviations of speed and point, which
            depend on the layout (Bishop 1994, Mixture density networks). Shots that need more precision get smaller
            ones.
        activation: The activation of all hidden layers except those of `TableCritic`, one of `ACTIVATIONS`. "silu"
            (Elfwing et al. 2018, Sigmoid-weighted linear units) is smooth; "relu" has a kink at 0.

    Attributes:
        std: Standard deviations of the speed, over the largest, of the point aimed at, m, and of the three other
            numbers of a strike.
    """

    half_extents: Tensor
    slowest: Tensor
    faster: Tensor
    std: Tensor
    CIRCLE = 0.05
    """m: radius of the circle around the object ball on which the points are before the training."""

    def __init__(
        self,
        half_extents: Sequence[float],
        points: int,
        speeds: Sequence[float],
        hidden: int,
        aim: str = "ball",
        *,
        features: Mapping[str, tuple[int, ...]] = MappingProxyType({}),
        strikes: bool = False,
        waves: int = 0,
        goal_units: int = 0,
        diameter: float = 0.0,
        own_std: bool = False,
        activation: str = "relu",
    ) -> None:
        super().__init__()
        unit = ACTIVATIONS[activation]
        self.aim, self.waves, self.diameter, self.own_std = aim, waves, diameter, own_std
        self.ranges = len(speeds) - 1
        self.numbers = TIP * strikes
        self.goal, self.legal = "goal" in features, "legal_balls" in features
        self.rest = [name for name in ("shots_left", "physics") if name in features]
        self.goal_units = goal_units = goal_units * self.goal
        goals = 2 * (self.goal and not goal_units)
        inputs, half = 8 + 8 * waves + goals + sum(math.prod(features[name]) for name in self.rest), hidden // 2
        borders, angles = torch.tensor(speeds), 2 * math.pi / points * torch.arange(points)
        self.register_buffer("half_extents", torch.tensor(half_extents))
        self.register_buffer("slowest", borders[:-1].repeat_interleave(points))
        self.register_buffer("faster", borders.diff().repeat_interleave(points))
        self.register_buffer("std", torch.ones(3))
        self.first_points = nn.Parameter(self.CIRCLE * torch.stack((angles.cos(), angles.sin())))
        self.shifts = goal_units > 0 and aim == "layout"
        self.kinds = 2 + 2 * own_std + self.shifts + self.numbers
        outputs = self.kinds * points * self.ranges
        self.points = _Layers(unit, 2 + 4 * waves if aim == "ball" else inputs, half, 2 * points, 0.02)
        self.choice = _Layers(unit, inputs, hidden, goal_units or outputs, 1.0 if goal_units else 0.02)
        if goal_units:
            self.of_goal = nn.Linear(2 + 4 * waves, goal_units, bias=False)
            _, _, *later = _Layers(unit, goal_units, goal_units, outputs, 0.02)
            self.choice_for_goal = nn.Sequential(unit(), *later)
        of_table = self.legal and "in_hand" in features
        self.critic = TableCritic(half) if of_table else _Layers(unit, inputs, half, 1)
        self.turn = nn.Parameter(torch.zeros(()))
        self.widths = hidden, half, half if aim == "layout" else 0
        self.other_ball = nn.Sequential(nn.Linear(5 + self.legal, half), unit(), nn.Linear(half, half), unit())
        self.other_balls = nn.Linear(half, sum(self.widths), bias=False)
        nn.init.zeros_(self.other_balls.weight)
        if diameter:
            last = nn.Linear(_PATH_UNITS, self.ranges)
            nn.init.zeros_(last.weight)
            self.of_paths = nn.Sequential(nn.Linear(2, _PATH_UNITS), unit(), last)

    def forward(self, positions: Tensor, legal: Tensor | None = None, **others: Tensor) -> tuple[Mixture, Tensor]:
        """Returns the mixtures and the values (m,) for m layouts of n object balls, for any n.

        Args:
            positions: (m, 1 + n, 2), the feature "positions".
            legal: (m, n) bool, the balls at which a component may aim; None for the feature "legal_balls", or for all.
            others: The other features by name, as in the construction.
        """
        layouts, values = self.layouts(positions, legal, **others)
        return self.mixtures(layouts, others.get("goal")), values

    def layouts(self, positions: Tensor, legal: Tensor | None = None, **others: Tensor) -> tuple[Layouts, Tensor]:
        """Returns the layouts for `mixtures`, and the values (m,). The arguments are those of `forward`."""
        m = positions.shape[0]  # len() would fix the number of layouts in an ONNX file
        inputs = self._inputs(positions, legal, **others)
        offset = self.points(inputs.near) if self.aim == "ball" else self.points(inputs.features, inputs.aimed)
        points = inputs.to_ball[:, :, None] + (self.first_points + self.CIRCLE * offset.unflatten(1, (2, -1)))
        dx, dy = points.unbind(1)
        inverse = torch.rsqrt(dx * dx + dy * dy + 1e-9)
        dx, dy = dx * inverse, dy * inverse
        f, signs = inputs.possible.shape[1], inputs.signs
        paths = positions.new_empty(m, f, 0)
        if inputs.others is not None and self.diameter:
            # Without a gradient to the points: clear paths do not move them.
            paths = self._paths(inputs.others, inputs.to_ball, dx.detach(), dy.detach())
        choice = self.choice(inputs.features, inputs.chosen)
        parts = choice, signs, dx * signs[:, :1], dy * signs[:, 1:], inverse, paths
        layouts = Layouts._make((*(part.reshape(m, f, -1) for part in parts), inputs.possible))
        if isinstance(self.critic, TableCritic):
            return layouts, self.values(positions=positions, **others)
        return layouts, self._values(inputs)

    def values(self, **seen: Tensor) -> Tensor:
        """Returns the values (m,) for the features of m layouts by name."""
        if isinstance(self.critic, TableCritic):
            return self.critic(seen["positions"], seen["legal_balls"], seen["in_hand"], self.half_extents)
        return self._values(self._inputs(**seen))

    def _values(self, inputs: _Inputs) -> Tensor:
        """Returns the mean value of each layout over the balls that count, (m,)."""
        values = self.critic(inputs.features, inputs.judged).reshape(inputs.counted.shape) * inputs.counted
        return values.sum(1) / inputs.counted.sum(1).clamp(min=1)

    def _inputs(self, positions: Tensor, legal: Tensor | None = None, **others: Tensor) -> _Inputs:
        """Returns the inputs of the networks. The arguments are those of `forward`."""
        m, n = positions.shape[0], positions.shape[1] - 1
        places = torch.cat((positions, others["goal"]), 1) if self.goal and not self.goal_units else positions
        flags = others["legal_balls"] if self.legal else positions.new_empty(m, 0)
        if legal is None and self.legal:
            legal = flags > 0
        rest = torch.cat([positions.new_empty(m, 0), *(others[name].reshape(m, -1) for name in self.rest)], 1)
        on_table = (positions[:, 1:].abs() != 1).all(2)  # a ball out of play is at an edge, one on the table never is
        allowed = on_table if legal is None else on_table & legal
        first = self._first_balls(allowed)
        f = first.shape[1]
        balls = positions[:, 1:].gather(1, first[:, :, None].expand(-1, -1, 2))
        signs = torch.where(balls < 0, -1.0, 1.0)
        tables = places[:, None] * signs[:, :, None]  # (m, f, 1 + n + goals, 2), one for each ball in first place
        cue_ball, ball, signs = tables[:, :, 0].flatten(0, 1), (balls * signs).flatten(0, 1), signs.flatten(0, 1)
        to_ball = (ball - cue_ball) * self.half_extents
        distance = to_ball.norm(dim=1, keepdim=True).clamp(min=1e-6)  # two balls in the same pocket have distance 0
        way = to_ball / distance
        goals, rest = tables[:, :, 1 + n :].reshape(m * f, -1), rest.repeat_interleave(f, 0)
        waves = self._waves(cue_ball), self._waves(ball)
        features = torch.cat((cue_ball, ball, way, distance, 1 / (distance + 0.1), goals, rest, *waves), 1)
        other_balls, chosen, judged, aimed = None, None, None, None
        if n > 1:
            other_balls = self._others_of(tables, first, flags, on_table)
            chosen, judged, aimed = self._other_balls(other_balls, ball, way)
        possible = allowed.gather(1, first)
        counted = possible if self.legal else on_table.gather(1, first)
        near = torch.cat((ball, waves[1]), 1)
        return _Inputs(features, near, signs, to_ball, other_balls, chosen, judged, aimed, possible, counted)

    def _first_balls(self, allowed: Tensor) -> Tensor:
        """Returns the balls (m, f) that are put in first place: all n, or with "legal_balls" those that are allowed.

        If a layout has fewer of them than another, balls that are not allowed follow.
        """
        m, n = allowed.shape
        if not self.legal or torch.compiler.is_exporting():  # the shapes in an ONNX file do not depend on the layout
            return torch.arange(n, device=allowed.device).expand(m, n)
        most = max(int(allowed.sum(1).max()), 1)
        return allowed.int().sort(dim=1, descending=True, stable=True).indices[:, :most]

    def mixtures(self, layouts: Layouts, goal: Tensor | None = None, rows: Tensor | None = None) -> Mixture:
        """Returns the mixtures for layouts.

        Args:
            layouts: m layouts.
            goal: (k, 1, 2), the feature "goal"; used with `goal_units` alone.
            rows: (k,) the layout of each goal; None for one goal for each layout.
        """
        if rows is not None:
            layouts = Layouts(*(part.index_select(0, rows) for part in layouts))
        choice, signs, *parts, paths, allowed = layouts
        dx, dy, inverse = (part.repeat(1, 1, self.ranges) for part in parts)
        if self.goal_units and goal is not None:
            near = (goal * signs).flatten(0, 1)
            near = self.of_goal(torch.cat((near, self._waves(near)), 1))
            choice = self.choice_for_goal(choice + near.reshape(choice.shape))
        logit, faster, *tip = choice.chunk(self.kinds, 2)
        if self.shifts:
            shift, *tip = tip
            dx, dy = _turned(dx, dy, self.CIRCLE * shift * inverse * signs.prod(2, keepdim=True))
        if paths.shape[2]:
            logit = logit + paths
        logit = logit.masked_fill(~allowed[:, :, None], _NEVER)
        speed = self.slowest + self.faster * faster.sigmoid()
        # The std of the direction is the std of the point over its distance. The limit is for points near the cue ball.
        across = speed * self.std[1] * inverse.clamp(max=10.0)
        along, log_width = self.std[0].expand_as(speed), torch.zeros_like(speed)
        if self.own_std:
            *tip, longer, wider = tip
            longer, wider = (_MOST_FACTOR * (part / _MOST_FACTOR).tanh() for part in (longer, wider))
            along, across, log_width = along * longer.exp(), across * wider.exp(), longer + wider
        if tip:
            side, top, elevation = tip  # a reflection at one axis changes the sign of the side
            tip = [_MOST * side.tanh() * signs.prod(2, keepdim=True), _MOST * top.tanh(), _LEVEL + elevation]
        parts = (logit, dx, dy, speed, across, along, log_width, *tip)
        logit, dx, dy, speed, across, along, log_width, *tip = (part.flatten(1) for part in parts)
        strike = torch.stack(tip, 1) if tip else logit.new_empty(logit.shape[0], 0, 1)
        weights = logit.log_softmax(1)
        return Mixture(weights, dx, dy, speed, across, along, log_width, strike, self.std[2], self.turn)

    def _waves(self, places: Tensor) -> Tensor:
        """Returns sines and cosines (k, 4 * waves) of places (k, 2)."""
        octaves = math.pi * 2.0 ** torch.arange(self.waves, device=places.device)
        angles = (places[:, :, None] * octaves).flatten(1)
        return torch.cat((angles.sin(), angles.cos()), 1)

    def _others_of(self, tables: Tensor, first: Tensor, flags: Tensor, on_table: Tensor) -> _OtherBalls:
        """Returns the `_OtherBalls` of the layouts.

        Args:
            tables: (m, f, 1 + n + goals, 2) the reflected layouts.
            first: (m, f) the balls in first place.
            flags: (m, n) 1 for a legal ball; (m, 0) without legal balls.
            on_table: (m, n) the balls on the table.
        """
        n, f = on_table.shape[1], first.shape[1]
        numbers = torch.tensor([[j for j in range(n) if j != i] for i in range(n)], device=first.device)[first]
        places = tables.gather(2, 1 + numbers[:, :, :, None].expand(-1, -1, -1, 2))
        vectors = (places - tables[:, :, :1]) * self.half_extents
        present = on_table[:, None].expand(-1, f, -1).gather(2, numbers)
        flags = flags[:, None].expand(-1, f, -1).gather(2, numbers)[..., None] if self.legal else places[..., :0]
        return _OtherBalls(places, vectors, present, flags)

    def _other_balls(self, others: _OtherBalls, ball: Tensor, way: Tensor) -> Sequence[Tensor]:
        """Returns what the other object balls add to the first layers of `choice`, `critic` and `points`.

        Args:
            others: The other object balls.
            ball: (m * f, 2) the reflected position of the ball in first place.
            way: (m * f, 2) directions from the cue ball to it.
        """
        m, f = others.present.shape[:2]
        dx, dy = others.vectors.unbind(3)
        ux, uy = way.reshape(m, f, 1, 2).unbind(3)
        near = 1 / (((others.places - ball.reshape(m, f, 1, 2)) * self.half_extents).norm(dim=3) + 0.1)
        features = torch.stack((dx * ux + dy * uy, dy * ux - dx * uy, near), 3)
        features = torch.cat((others.places, features, others.flags), 3)
        total = (self.other_ball(features) * others.present[..., None]).sum(2)
        return self.other_balls(total.flatten(0, 1)).split(self.widths, 1)

    def _paths(self, others: _OtherBalls, to_ball: Tensor, dx: Tensor, dy: Tensor) -> Tensor:
        """Returns what the paths add to the logits, (m, f, r * p).

        A path of the cue ball that misses the ball counts as the thinnest hit.

        Args:
            others: The other object balls.
            to_ball: (m * f, 2) m, from the cue ball to the ball in first place.
            dx: (m * f, p) the directions to the points.
            dy: (m * f, p)
        """
        (m, f), diameter = others.present.shape[:2], self.diameter
        vectors, present = others.vectors.flatten(0, 1), others.present.flatten(0, 1)
        along, aside = (part[:, :, 0] for part in _components(to_ball[:, None], dx, dy))
        aside = aside.clamp(-diameter, diameter)
        ahead = (diameter * diameter - aside * aside).sqrt()  # from the cue ball at the contact to the ball it hits
        hit_x, hit_y = (ahead * dx - aside * dy) / diameter, (ahead * dy + aside * dx) / diameter
        length = (along - ahead + 0.5 * diameter)[:, :, None]  # a ball just beyond the contact can be in the way
        before = _clearance(vectors, present, dx, dy, diameter, length)
        after = _clearance(vectors - to_ball[:, None], present, hit_x, hit_y, diameter)
        return self.of_paths(torch.stack((before, after), 2)).transpose(1, 2).reshape(m, f, -1)


class TableCritic(nn.Module):
    """The value function of games of two players, which takes each layout once.

    One network takes each object ball with the cue ball, in a layout that is reflected so that the cue ball has x >= 0
    and y >= 0. Another one takes the sums and the largest values of its outputs.
    """

    def __init__(self, units: int) -> None:
        super().__init__()
        self.ball = nn.Sequential(nn.Linear(11, units), nn.ReLU(), nn.Linear(units, units), nn.ReLU())
        self.table = _Layers(nn.ReLU, 2 * units + 4, units, 1, 0.1)

    def forward(self, positions: Tensor, legal_balls: Tensor, in_hand: Tensor, half_extents: Tensor) -> Tensor:
        """Returns the values (m,) for features of m layouts."""
        on_table = (positions[:, 1:].abs() != 1).all(2)[..., None]
        tables = positions * torch.where(positions[:, :1] < 0, -1.0, 1.0)
        cue, balls = tables[:, :1], tables[:, 1:]
        ways = (balls - cue) * half_extents
        distances = ways.norm(dim=2, keepdim=True).clamp(min=1e-6)
        cues, near = cue.expand(-1, balls.shape[1], -1), 1 / (distances + 0.1)
        features = torch.cat((cues, balls, ways, ways / distances, distances, near, legal_balls[..., None]), 2)
        outputs = self.ball(features) * on_table
        return self.table(torch.cat((0.2 * outputs.sum(1), outputs.amax(1), cue[:, 0], in_hand), 1))[:, 0]


class _Layers(nn.Sequential):
    """A network with two hidden layers, each followed by an activation of the class `unit`.

    `scale` multiplies the first weights of the last layer.
    """

    def __init__(self, unit: type[nn.Module], inputs: int, hidden: int, outputs: int, scale: float = 1.0) -> None:
        last = nn.Linear(hidden, outputs)
        with torch.no_grad():
            last.weight.mul_(scale)
            last.bias.zero_()
        super().__init__(nn.Linear(inputs, hidden), unit(), nn.Linear(hidden, hidden), unit(), last)

    def forward(self, input: Tensor, added: Tensor | None = None) -> Tensor:
        """Returns the outputs. `added` is added to the output of the first layer."""
        first, *layers = self
        x = first(input)
        if added is not None:
            x = x + added
        for layer in layers:
            x = layer(x)
        return x


def _components(vectors: Tensor, dx: Tensor, dy: Tensor) -> tuple[Tensor, Tensor]:
    """Returns the components (k, p, j) of vectors (k, j, 2) along directions (k, p), and to the left of them."""
    (x, y), dx, dy = vectors[:, None].unbind(3), dx[:, :, None], dy[:, :, None]
    return x * dx + y * dy, y * dx - x * dy


def _clearance(
    vectors: Tensor, present: Tensor, dx: Tensor, dy: Tensor, diameter: float, length: Tensor | float = math.inf
) -> Tensor:
    """Returns how clear the paths of a ball are, (k, p).

    The number is (d - D) / (D / 2), limited to the interval from -1 to 1. D is the diameter, and d is the least
    distance of the centre of another ball from the line of the path. The number is negative if a ball is in the way,
    and 1 if no ball is beside the path.

    Args:
        vectors: (k, j, 2) m, from the start of the paths to the other balls.
        present: (k, j) bool, whether they are on the table.
        dx: (k, p) the directions of the paths.
        dy: (k, p)
        diameter: The diameter of a ball, m.
        length: (k, p, 1) the lengths of the paths, m; infinite by default.
    """
    along, aside = _components(vectors, dx, dy)
    elsewhere = ~present[:, None] | (along < 0) | (along > length)
    clear = (2 * aside.abs() / diameter - 2).masked_fill(elsewhere, 1.0)
    return clear.amin(2).clamp(-1.0, 1.0)


def _turned(x: Tensor, y: Tensor, tangent: Tensor) -> tuple[Tensor, Tensor]:
    """Returns vectors turned to the left by angles with these tangents."""
    shorter = torch.rsqrt(1 + tangent * tangent)
    return (x - tangent * y) * shorter, (y + tangent * x) * shorter
