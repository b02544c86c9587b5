"""A player that plans under execution noise: "planner:100ms", "planner:1s".

A decision takes the given processor time on one core, and a break takes four times as long. It has three parts:

* Candidates: pots by geometry (direct, off one cushion, and indirect) from each place of the cue ball, with several
  speeds and offsets of the tip, and random shots.
* Selection: each candidate is simulated without noise, and those with the lowest values are dropped. The others are
  simulated with noise in direction and speed, and the worse half is dropped, until a few are left (sequential
  halving: Karnin, Koren and Somekh 2013, Almost optimal exploration in multi-armed bandits). Copies of the better ones
  replace some of the others. A copy is shifted by the mean noise of the outcomes that were better than the mean.
* Values: the value of an outcome is an estimate, from -1 for a lost game to 1 for a won game, or the expected lead in
  points. It depends on the easiest pots of the player who shoots next, see `players.values`.

The size of the noise is an argument. The noise of the shot that is played is drawn later.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.games import NO_CALL, Call, GameState, Setup, Stroke, choices
from billiards_env.players import run_outs
from billiards_env.players.batch import PlayedBatch, play_batch
from billiards_env.players.candidates import LEAST_CANDIDATES, TIPS, Candidates, candidates, rotated
from billiards_env.players.values import Values
from billiards_env.pots.budget import Budget

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Noise = tuple[float, float]

EXPECTED_NOISE = (0.057, 0.02)
"""The noise that a player expects if none is given: standard deviations of direction, degrees, and speed, m/s."""

FINALISTS = 4
"""The number of candidates that are left at the end of the selection."""

_SHOTS_PER_CANDIDATE = 12  # budget over the number of first candidates
_CHUNK, _NOISY_CHUNK = (20, 100), (25, 1000)  # least and largest number of shots between two readings of the clock
_RATE = 100_000  # shots in a second; a slower machine leaves some candidates out
_KEPT = 0.25  # share of the candidates after the first simulation
_LONGER = 4.0  # budget of a break over the budget of another shot
_QUANTILES = np.array([NormalDist().inv_cdf((k + 0.5) / 1024) for k in range(1024)])


class Plan(NamedTuple):
    """A shot and what the planner expects of it.

    Attributes:
        stroke: The stroke.
        value: The mean value of its noisy outcomes, from -1 for a lost game to 1 for a won game. In a game that is won
            by points it is the expected lead. With a budget too small for noisy outcomes it is the value of the shot
            without noise.
        probability: The share of its noisy outcomes that win the game or continue the turn, or whether the shot without
            noise does.
        ball: The ball that it plans to pot, or -1.
        pocket: The pocket of this pot, or -1.
        leave: (n, 2) m: the positions of the balls after the shot without noise; NaN without `Options.leaves`.
        samples: The number of noisy outcomes, or 1.
        alternatives: Other shots, the best first; they have no alternatives.
    """

    stroke: Stroke
    value: float
    probability: float
    ball: int
    pocket: int
    leave: Floats
    samples: int
    alternatives: tuple[Plan, ...] = ()

    def __str__(self) -> str:
        return "\n".join(_line(plan) for plan in (self, *self.alternatives))


def _line(plan: Plan) -> str:
    (x, y), place, spin, _ = plan.stroke
    parts = [
        *([plan.stroke.call.kind] if plan.stroke.call.kind != "shot" else []),
        f"{math.hypot(x, y):.2f} m/s at {math.degrees(math.atan2(y, x)):.2f} degrees",
        *(["with spin"] if any(spin) else []),
        *([f"from ({place[0]:.2f}, {place[1]:.2f}) m"] if place else []),
        f"ball {plan.ball} in pocket {plan.pocket}" if plan.ball >= 0 else "no pot by geometry",
        f"probability {plan.probability:.2f}, value {plan.value:.2f} ({plan.samples} samples)",
    ]
    return ", ".join(parts)


class Options(NamedTuple):
    """What the planner plays for, and which strokes it may play.

    Attributes:
        run_out: Whether only the present turn counts. The value is then the probability of a run-out, or in a game that
            is won by points the expected points of the turn.
        english: Whether to try offsets of the tip, in a scene with spin.
        values: A function that returns the values (m,) of m simulated shots; None for the usual ones, see `Plan.value`.
        leaves: Whether to compute `Plan.leave`, which simulates the final shots once more.
        watch: A function that is called while the planner selects, with the best shot of each pot up to now, at most
            `FINALISTS`, the best first; None for no call.
    """

    run_out: bool = False
    english: bool = True
    values: Callable[[PlayedBatch], Floats] | None = None
    leaves: bool = True
    watch: Callable[[tuple[Plan, ...]], None] | None = None


_USUAL = Options()


def parse_budget(text: str) -> tuple[float, float]:
    """Returns the seconds and the number of shots of a budget, infinite for the one that is not given.

    An empty text is "100ms".
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(ms|s)|(\d+)", text or "100ms")
    amount = float(match[1] or match[3]) if match else 0.0
    if match is None or amount <= 0.0:
        raise ValueError(f"player = 'planner:{text}': expected a time such as 'planner:100ms' or a number of shots")
    if match[2] is None:
        return math.inf, amount
    return amount * {"ms": 1e-3, "s": 1.0}[match[2]], math.inf


def plan(
    setup: Setup,
    game: GameState,
    max_speed: float,
    rng: np.random.Generator,
    seconds: float = 0.1,
    shots: float = math.inf,
    noise: Noise = EXPECTED_NOISE,
    options: Options = _USUAL,
) -> Plan:
    """Returns the best shot that the planner finds.

    Args:
        setup: The game.
        game: Its state.
        max_speed: Speed of the fastest shot, m/s.
        rng: The generator to draw from.
        seconds: Processor time of the decision, s; infinite for no limit. It is exceeded by the time of a few shots.
        shots: Number of shots to simulate; infinite for no limit.
        noise: Standard deviations of the direction, degrees, and of the speed, m/s.
        options: See `Options`.
    """
    low_budget = min(shots, _RATE * seconds) < LEAST_CANDIDATES * _SHOTS_PER_CANDIDATE
    if game.state.break_shot:
        seconds, shots = _LONGER * seconds, _LONGER * shots
    budget = Budget(seconds, shots)
    deviations = math.radians(noise[0]), noise[1]
    values = _values(setup, game, max_speed, deviations, options, low_budget)
    search = _Search(setup, game, max_speed, deviations, values, rng, budget, options.watch)

    count = min(shots, _RATE * seconds) / _SHOTS_PER_CANDIDATE
    tips = TIPS if options.english and setup.scene.physics.motion == "sliding" else TIPS[:1]
    first = candidates(setup, game, max_speed, rng, count, deviations[0], tips, budget)

    budget.begin_shots()
    exact = _without_noise(search, first)
    order = np.argsort(-exact.total, kind="stable")[: max(FINALISTS, int(_KEPT * len(exact.total)))]
    finalists, totals = first.take(order), exact.take(order)
    if budget.left > 0:
        finalists, totals = _halved(search, finalists)
    leaves = None
    if options.leaves:
        top = finalists.take(slice(FINALISTS))
        leaves = play_batch(setup, game, top.velocities, top.spins, top.places, top.targets, threads=1).positions
    plans = _plans(game, finalists, totals, leaves)
    best = plans[0]
    if "hand_back" in choices(game.state) and best.value < 0.0 and not options.run_out:
        none = Stroke((0.0, 0.0), call=Call(kind="hand_back"))
        return Plan(none, -best.value, 0.0, -1, -1, game.positions, best.samples, plans[:-1])
    return best._replace(alternatives=plans[1:])


def _plans(game: GameState, shots: Candidates, totals: Sums, leaves: Floats | None = None) -> tuple[Plan, ...]:
    """Returns the first `FINALISTS` shots with the means of their outcomes; `leaves` (k, n, 2) may be None."""
    plans = []
    for k in range(min(FINALISTS, len(shots.velocities))):
        ball, pocket = shots.targets[k].tolist()
        call = Call(ball, pocket) if game.state.call_shot and not game.state.break_shot and ball >= 0 else NO_CALL
        call = Call(kind="push_out") if shots.push_out[k] else call
        x, y = shots.velocities[k].tolist()
        place = tuple(shots.places[k].tolist()) if game.state.in_hand else None
        stroke = Stroke((x, y), place, tuple(shots.spins[k].tolist()), call)
        value, probability = (float(sums[k] / totals.samples[k]) for sums in totals[:2])
        leave = np.full(game.positions.shape, np.nan) if leaves is None else leaves[k]
        plans.append(Plan(stroke, value, probability, ball, pocket, leave, int(totals.samples[k])))
    return tuple(plans)


def _values(
    setup: Setup, game: GameState, max_speed: float, noise: Noise, options: Options, low_budget: bool
) -> Callable[[PlayedBatch, NDArray[np.bool_]], Floats]:
    """Returns the function that rates shots, see `_Search.values`."""
    values = options.values
    if values is not None:
        return lambda played, _: values(played)
    # With few shots the network overestimates positions without a pot: its training had 0.1 s for a decision.
    weights = None if low_budget or setup.target is not None else run_outs.trained()
    return Values(setup, game, max_speed, noise, options.run_out, options.english, weights).of


class Sums(NamedTuple):
    """Sums over the noisy outcomes of k candidates.

    Attributes:
        total: (k,) of the values.
        kept: (k,) number that win or continue the turn.
        samples: (k,) number of outcomes.
    """

    total: Floats
    kept: Floats
    samples: Floats

    def take(self, which: Any) -> Sums:
        """Returns the sums of some of the candidates."""
        return Sums(self.total[which], self.kept[which], self.samples[which])

    def order(self) -> Ints:
        """Returns the candidates with samples, the best first; few samples count against a candidate."""
        sampled = np.flatnonzero(self.samples)
        means = self.total[sampled] / self.samples[sampled]
        return sampled[np.argsort(means.std() / np.sqrt(self.samples[sampled]) - means, kind="stable")]


class _Search(NamedTuple):
    """What the simulations of a decision have in common.

    Attributes:
        setup: The game.
        game: Its state.
        max_speed: Speed of the fastest shot, m/s.
        noise: Standard deviations of the direction, rad, and of the speed, m/s.
        values: A function that returns the values (m,) of m simulated shots; its second argument is
            `Candidates.push_out`.
        rng: The generator to draw from.
        budget: What is left for the decision.
        watch: See `Options`.
    """

    setup: Setup
    game: GameState
    max_speed: float
    noise: Noise
    values: Callable[[PlayedBatch, NDArray[np.bool_]], Floats]
    rng: np.random.Generator
    budget: Budget
    watch: Callable[[tuple[Plan, ...]], None] | None


def _halved(search: _Search, survivors: Candidates) -> tuple[Candidates, Sums]:
    """Simulates candidates with noise, and drops the worse half until few are left. Returns these, the best first."""
    budget, totals = search.budget, Sums(*np.zeros((3, len(survivors.velocities))))
    while True:
        rounds = max(1, math.ceil(math.log2(len(totals.samples) / FINALISTS)) + 1)
        samples = max(1, int(budget.left / rounds / len(totals.samples)))
        new, shifts = _sample(search, survivors, samples)
        totals = Sums(*(before + after for before, after in zip(totals, new, strict=True)))
        order = totals.order()
        if search.watch is not None:
            _, pots = np.unique(survivors.targets[order], axis=0, return_index=True)
            best = order[np.sort(pots)[:FINALISTS]]
            search.watch(_plans(search.game, survivors.take(best), totals.take(best)))
        if rounds == 1 or budget.left < len(order):
            return survivors.take(order[:FINALISTS]), totals.take(order[:FINALISTS])
        order = order[: max(FINALISTS, len(order) // 2)]
        # Copies of the better half, shifted by the noise of their better outcomes, replace the worse half.
        half = len(order) // 2 if rounds > 2 else 0
        copied, order = order[:half], order[: len(order) - half]
        noisy = survivors.velocities[copied], survivors.spins[copied], shifts[copied]
        velocities, spins = noisy_strokes(*noisy, search.max_speed)
        copies = survivors.take(copied)._replace(velocities=velocities, spins=spins)
        survivors = survivors.take(order).joined(copies)
        totals = Sums(*(np.concatenate((sums[order], np.zeros(half))) for sums in totals))


def _kept(search: _Search, played: PlayedBatch, push_out: NDArray[np.bool_]) -> Floats:
    """Returns 1 for the shots that win the game or continue the turn, and 0 for the others, (m,)."""
    return 1.0 * ((played.verdicts["continues"] | (played.states["winner"] == search.game.state.player)) & ~push_out)


def _without_noise(search: _Search, first: Candidates) -> Sums:
    """Simulates the first candidates without noise, and sets the calls of random shots to their pots."""
    setup, game, budget, exact = search.setup, search.game, search.budget, Sums(*np.empty((3, 0)))
    while len(exact.total) < len(first.velocities) and not (budget.used and budget.left < 2 * budget.used):
        part = first.take(slice(budget.used, budget.used + budget.chunk(0.1, *_CHUNK)))
        played = play_batch(setup, game, part.velocities, part.spins, part.places, threads=1)
        budget.used += len(part.velocities)
        new = np.flatnonzero((played.called >= 0) & (part.targets[:, 0] < 0))
        part.targets[new] = np.column_stack((played.called[new], played.pockets[new, played.called[new]]))
        new = search.values(played, part.push_out), _kept(search, played, part.push_out), np.ones(len(part.velocities))
        exact = Sums(*(np.concatenate(pair) for pair in zip(exact, new, strict=True)))
    return exact


def _sample(search: _Search, shots: Candidates, samples: int) -> tuple[Sums, Floats]:
    """Simulates each of k candidates `samples` times with noise, fewer if the budget ends.

    Returns:
        The sums, and (k, 2) the weighted mean noise of the outcomes that are better than the mean of their candidate.
    """
    setup, game, budget, k = search.setup, search.game, search.budget, len(shots.velocities)
    noise = _draw_noise(k, samples, search.noise, search.rng)
    part = shots.take(np.repeat(np.arange(k), samples))
    velocities, spins = noisy_strokes(part.velocities, part.spins, noise, search.max_speed)
    values, kept = np.full(k * samples, np.nan), np.zeros(k * samples)
    end = 0
    while end < k * samples and (end == 0 or budget.left > 0):
        piece = slice(end, end + budget.chunk(0.25, *_NOISY_CHUNK))
        end = piece.stop
        played = play_batch(
            setup, game, velocities[piece], spins[piece], part.places[piece], part.targets[piece], threads=1
        )
        budget.used += len(played.verdicts)
        values[piece] = search.values(played, part.push_out[piece])
        kept[piece] = _kept(search, played, part.push_out[piece])
    done, values = ~np.isnan(values).reshape(k, samples), np.nan_to_num(values).reshape(k, samples)
    sums = Sums(values.sum(axis=1), kept.reshape(k, samples).sum(axis=1), done.sum(axis=1).astype(float))
    better = np.where(done, np.maximum(values - (sums.total / np.maximum(sums.samples, 1.0))[:, None], 0.0), 0.0)
    shifts = (better[..., None] * noise.reshape(k, samples, 2)).sum(axis=1)
    return sums, shifts / np.maximum(better.sum(axis=1), 1e-9)[:, None]


def noisy_strokes(velocities: Floats, spins: Floats, noise: Floats, max_speed: float) -> tuple[Floats, Floats]:
    """Returns strokes with given noise: turned, and with another speed of the cue.

    Args:
        velocities: (m, 2) m/s.
        spins: (m, 3) rad/s. The spin changes with the speed in proportion.
        noise: (m, 2) of the direction, rad, and of the speed, m/s.
        max_speed: The largest speed, m/s; the least is 0.

    Returns:
        The velocities (m, 2) and the spins (m, 3).
    """
    speed = np.hypot(velocities[:, 0], velocities[:, 1])
    scale = (np.clip(speed + noise[:, 1], 0.0, np.maximum(max_speed, speed)) / np.maximum(speed, 1e-9))[:, None]
    turned = scale * rotated(velocities, noise[:, 0])
    return turned, np.column_stack((scale * rotated(spins[:, :2], noise[:, 0]), scale * spins[:, 2:]))


def _draw_noise(shots: int, samples: int, noise: Noise, rng: np.random.Generator) -> Floats:
    """Returns (shots * samples, 2) normal noise, stratified over the samples of each shot."""
    ranks = rng.permuted(np.broadcast_to(np.arange(samples)[:, None], (shots, samples, 1)).repeat(2, 2), axis=1)
    shares = (ranks + rng.random((shots, samples, 2))) / samples
    return (np.array(noise) * _QUANTILES[(1024 * shares).astype(np.int64)]).reshape(-1, 2)
