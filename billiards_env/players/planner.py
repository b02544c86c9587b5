"""A player that plans under execution noise: "planner:100ms", "planner:1s".

A decision takes the given processor time on one core, and a break takes four times as long. It has three parts:

* Candidates: pots by geometry (direct and off one cushion) from each place of the cue ball, with several speeds and
  offsets of the tip, and random shots.
* Selection: each candidate is simulated without errors, and those with the lowest values are dropped. The others are
  simulated with random errors of direction and speed, and the worse half is dropped, until a few are left (sequential
  halving: Karnin, Koren and Somekh 2013, Almost optimal exploration in multi-armed bandits). Copies of the better ones,
  corrected by the mean error of their better outcomes, join them.
* Values: the value of an outcome is the probability of a win from there, or the expected lead in points. It depends on
  the success of the easiest pot of the player who shoots next.

The size of the errors is an argument. The error of the shot that is played is drawn later.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import real
from billiards_env.games import NO_CALL, Call, GameState, Setup, Stroke
from billiards_env.games.batch import PlayedBatch, play_batch
from billiards_env.games.placement import cue_ball_area, cue_ball_point
from billiards_env.physics.state import CUE_BALL
from billiards_env.players.pots import DY, GAPS, SPEED, TOLERANCE, Tables, find_pots
from billiards_env.rules import IN_HAND, legal_balls
from billiards_env.scene import Scene
from billiards_env.shots.strikes import strike

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Noise = tuple[float, float]
Tips = tuple[tuple[float, float], ...]

NOISE = (0.057, 0.02)
"""The errors that a player expects if none are given: standard deviations of direction, degrees, and speed, m/s."""

TIPS = ((0.0, 0.0), (0.0, 0.35), (0.0, -0.35), (0.35, 0.0), (-0.35, 0.0), (0.25, -0.25), (-0.25, -0.25))
"""The offsets of the tip that the planner tries: to the left and up, in ball radii."""

PLACES = 24
"""The number of places for a cue ball in hand."""

FINALISTS = 4
"""The planner samples this many candidates to the end."""

_SHOTS_PER_CANDIDATE = 12
_CANDIDATES = 120, 4000  # their least and largest number
_GEOMETRY = 0.7  # share of the candidates that are pots by geometry, if there are any
_CHUNK = 100  # shots without errors between two readings of the clock
_RATE = 40_000  # shots in a second; a slower machine leaves some candidates out
_TURN = 0.2  # random turn of a pot over its tolerance
_UNKNOWN = 0.7  # ease of the next shot after a new rack, and in games without pockets
_KEPT, _KEPT_BREAKS = 0.25, 0.125  # share of the candidates after the first simulation
_LONGER = 4.0  # budget of a break over that of another shot
_WITHOUT = 0.4  # probability to win for a player without a pot, who plays safe
_BREAKS = 3.8, 5.6  # m/s; speeds of a break: faster ones depend more on the errors
_SCRATCH = 0.5  # factor for the ease of a pot that, by geometry, scratches at every speed
_FLOOR = math.radians(0.03)  # error of a leave's pot in addition to the noise
_EASY = 0.02  # rad; tolerance of the first pot with the ball in hand
_POTS = 3  # pots of a leave that count
_NEAREST = 4  # balls whose pots are found in a leave in snooker
_SECOND = 0.03  # weight of the second pot of a leave
_LENGTH = 3.5e-3  # rad; tolerance of a usual pot with a usual leave
_POINTS = {"snooker": 8.0, "straight": 4.0}  # expected points after a sure pot
_DEVIATIONS = np.linspace(0.0, 4.0, 401)
_WITHIN = np.array([math.erf(x / math.sqrt(2.0)) for x in _DEVIATIONS])
_QUANTILES = np.array([NormalDist().inv_cdf((k + 0.5) / 1024) for k in range(1024)])


class Plan(NamedTuple):
    """A shot and what the planner expects of it.

    Attributes:
        stroke: The stroke.
        value: The mean value of its noisy outcomes, from -1 for a lost game to 1 for a won game. In a game that is won
            by points it is the expected lead.
        probability: The share of its noisy outcomes that win the game or continue the turn.
        ball: The ball of the pot that it plans; -1 if it was drawn at random.
        pocket: The pocket of this pot, or -1.
        leave: (n, 2) m: the balls after the shot without errors.
        samples: The number of noisy outcomes.
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
        f"{math.hypot(x, y):.2f} m/s at {math.degrees(math.atan2(y, x)):.2f} degrees",
        *(["with spin"] if any(spin) else []),
        *([f"from ({place[0]:.2f}, {place[1]:.2f}) m"] if place else []),
        f"ball {plan.ball} in pocket {plan.pocket}" if plan.ball >= 0 else "no pot by geometry",
        f"probability {plan.probability:.2f}, value {plan.value:.2f} ({plan.samples} samples)",
    ]
    return ", ".join(parts)


class Shots(NamedTuple):
    """k candidates.

    Attributes:
        velocities: (k, 2) m/s.
        spins: (k, 3) rad/s.
        places: (k, 2) m, of the cue ball.
        targets: (k, 2) the ball and the pocket of the pot that a shot plans, or -1.
    """

    velocities: Floats
    spins: Floats
    places: Floats
    targets: Ints

    def of(self, which: Any) -> Shots:
        """Returns some of the candidates."""
        arrays: Any = (array[which] for array in self)
        return Shots(*arrays)

    def and_also(self, others: Shots) -> Shots:
        """Returns these candidates and others."""
        arrays: Any = (np.concatenate(pair) for pair in zip(self, others, strict=True))
        return Shots(*arrays)


class Budget:
    """The processor time or the number of simulated shots that a decision may use.

    Attributes:
        used: The number of shots that were simulated.
    """

    def __init__(self, seconds: float = math.inf, shots: float = math.inf) -> None:
        """Starts the clock."""
        self._begin, self._seconds, self._shots, self.used = time.thread_time(), seconds, shots, 0

    @property
    def left(self) -> float:
        """The number of shots that can still be simulated, from the time that the shots up to now have taken."""
        if math.isinf(self._seconds):
            return self._shots - self.used
        taken = time.thread_time() - self._begin
        return min(self._shots - self.used, (self._seconds - taken) * max(self.used, 1) / max(taken, 1e-6))


def planner(setup: Setup, argument: str = "", noise: Noise = NOISE) -> Callable[..., Stroke]:
    """Returns a player for `players.game_player.find_player`.

    Args:
        setup: The game.
        argument: The time of a decision, such as "100ms" or "1s", or a number of simulated shots, such as "5000". With
            a number of shots a seed repeats a game on every machine. The default is "100ms".
        noise: The errors that it expects: standard deviations of the direction, degrees, and of the speed, m/s.

    Raises:
        ValueError: If the argument is neither a time nor a number.
    """
    seconds, shots = parse_budget(argument)
    noise = real("noise[0]", noise[0], "angle_std"), real("noise[1]", noise[1], "speed_std")

    def stroke(setup: Setup, game: GameState, max_speed: float, rng: np.random.Generator) -> Stroke:
        return plan(setup, game, max_speed, rng, seconds, shots, noise).stroke

    return stroke


def parse_budget(text: str) -> tuple[float, float]:
    """Returns the seconds and the number of shots of a budget, infinite for the one that is not given.

    An empty text is "100ms".
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)(ms|s)|(\d+)", text or "100ms")
    amount = float(found[1] or found[3]) if found else 0.0
    if found is None or amount <= 0.0:
        raise ValueError(f"player = 'planner:{text}': expected a time such as 'planner:100ms' or a number of shots")
    if found[2] is None:
        return math.inf, amount
    return amount * {"ms": 1e-3, "s": 1.0}[found[2]], math.inf


def plan(
    setup: Setup,
    game: GameState,
    max_speed: float,
    rng: np.random.Generator,
    seconds: float = 0.1,
    shots: float = math.inf,
    noise: Noise = NOISE,
    run_out: bool = False,
    english: bool = True,
    values: Callable[[PlayedBatch], Floats] | None = None,
) -> Plan:
    """Returns the best shot that the planner finds.

    Args:
        setup: The game.
        game: Its state.
        max_speed: Speed of the fastest shot, m/s.
        rng: The generator to draw from.
        seconds: Processor time of the decision, s; infinite for no limit.
        shots: Number of shots to simulate; infinite for no limit.
        noise: Standard deviations of the direction, degrees, and of the speed, m/s.
        run_out: Whether only a win without another turn of an opponent counts, in a game that is not won by points. The
            value is then the probability of a run-out.
        english: Whether to try offsets of the tip, in a scene with spin.
        values: A function that returns the value (m,) of each of m shots; None for that of `Plan.value`.
    """
    if game.state.break_shot:
        seconds, shots = _LONGER * seconds, _LONGER * shots
    budget = Budget(seconds, shots)
    errors = math.radians(noise[0]), noise[1]
    evaluate = Values(setup, game, max_speed, errors[0], run_out).of if values is None else values
    count = min(shots, _RATE * seconds) / _SHOTS_PER_CANDIDATE
    tips = TIPS if english and setup.scene.physics.motion == "sliding" else TIPS[:1]
    every = _candidates(setup, game, max_speed, rng, int(np.clip(count, *_CANDIDATES)), errors[0], tips)

    # Without errors. The calls of random shots are those of the pots that happen.
    exact = np.empty(0)
    while len(exact) < len(every.velocities) and not (len(exact) and budget.left < 2 * budget.used):
        part = every.of(slice(len(exact), len(exact) + _CHUNK))
        played = play_batch(setup, game, part.velocities, part.spins, part.places, threads=1)
        budget.used += len(part.velocities)
        _set_targets(setup, game, part.targets, played)
        exact = np.concatenate((exact, evaluate(played)))
    share = _KEPT_BREAKS if game.state.break_shot else _KEPT
    alive = every.of(np.argsort(-exact, kind="stable")[: max(FINALISTS, int(share * len(exact)))])

    found = Sums(*np.zeros((3, len(alive.velocities))))
    while True:
        rounds = max(1, math.ceil(math.log2(len(found.samples) / FINALISTS)) + 1)
        samples = max(1, int(budget.left / rounds / len(found.samples)))
        some, shifts = _sample(setup, game, alive, samples, errors, max_speed, evaluate, rng, budget)
        found = Sums(*(before + new for before, new in zip(found, some, strict=True)))
        order = found.order()
        if rounds == 1 or budget.left < len(order):
            break
        order = order[: max(FINALISTS, len(order) // 2)]
        # The worse half of these become copies of the better half, with the mean error of the better outcomes.
        half = len(order) // 2 if rounds > 2 else 0
        copied, order = order[:half], order[: len(order) - half]
        velocities, spins = with_errors(alive.velocities[copied], alive.spins[copied], shifts[copied], max_speed)
        copies = alive.of(copied)._replace(velocities=velocities, spins=spins)
        alive = alive.of(order).and_also(copies)
        found = Sums(*(np.concatenate((sums[order], np.zeros(half))) for sums in found))

    order = order[:FINALISTS]
    best = alive.of(order)
    leaves = play_batch(setup, game, best.velocities, best.spins, best.places, best.targets, threads=1).positions
    plans = []
    for k, leave in zip(order.tolist(), leaves, strict=True):
        ball, pocket = alive.targets[k].tolist()
        call = Call(ball, pocket) if game.state.call_shot and not game.state.break_shot and ball >= 0 else NO_CALL
        x, y = alive.velocities[k].tolist()
        place = None if game.state.in_hand == "no" else tuple(alive.places[k].tolist())
        stroke = Stroke((x, y), place, tuple(alive.spins[k].tolist()), call)
        value, probability = (float(sums[k] / found.samples[k]) for sums in found[:2])
        plans.append(Plan(stroke, value, probability, ball, pocket, leave, int(found.samples[k])))
    return plans[0]._replace(alternatives=tuple(plans[1:]))


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

    def order(self) -> Ints:
        """Returns the candidates with samples, the best first; few samples count against a candidate."""
        sampled = np.flatnonzero(self.samples)
        means = self.total[sampled] / self.samples[sampled]
        return sampled[np.argsort(means.std() / np.sqrt(self.samples[sampled]) - means, kind="stable")]


def _sample(
    setup: Setup,
    game: GameState,
    shots: Shots,
    samples: int,
    noise: Noise,
    max_speed: float,
    values: Callable[[PlayedBatch], Floats],
    rng: np.random.Generator,
    budget: Budget,
) -> tuple[Sums, Floats]:
    """Simulates each of k candidates `samples` times with errors, fewer if the budget ends.

    Returns:
        The sums, and (k, 2) the mean error of the outcomes that are better than the mean of a candidate.
    """
    k = len(shots.velocities)
    errors = _errors(k, samples, noise, rng)
    part = shots.of(np.repeat(np.arange(k), samples))
    velocities, spins = with_errors(part.velocities, part.spins, errors, max_speed)
    found, kept = np.full(k * samples, np.nan), np.zeros(k * samples)
    end = 0
    while end < k * samples and (end == 0 or budget.left > 0):
        some = slice(end, end + int(np.clip(0.25 * budget.left, 25, 1000)))
        end = some.stop
        played = play_batch(
            setup, game, velocities[some], spins[some], part.places[some], part.targets[some], threads=1
        )
        budget.used += len(played.verdicts)
        found[some] = values(played)
        kept[some] = played.verdicts["continues"] | (played.verdicts["winner"] == game.state.player)
    done, found = ~np.isnan(found).reshape(k, samples), np.nan_to_num(found).reshape(k, samples)
    sums = Sums(found.sum(axis=1), kept.reshape(k, samples).sum(axis=1), done.sum(axis=1).astype(float))
    better = np.where(done, np.maximum(found - (sums.total / np.maximum(sums.samples, 1.0))[:, None], 0.0), 0.0)
    shifts = (better[..., None] * errors.reshape(k, samples, 2)).sum(axis=1)
    return sums, shifts / np.maximum(better.sum(axis=1), 1e-9)[:, None]


def _set_targets(setup: Setup, game: GameState, targets: Ints, played: PlayedBatch) -> None:
    """Sets the calls (k, 2) of random shots: the first ball that a shot pots and that may be called."""
    if not game.state.call_shot or game.state.break_shot:
        return
    pockets = np.array([(p.x, p.y) for p in setup.scene.table.pockets])
    for ball in sorted(setup.game_rules.callable(game.state, game.state.player) & game.state.on_table):
        hits = (played.positions[:, ball, None] == pockets).all(axis=2)
        new = hits.any(axis=1) & (targets[:, 0] < 0)
        targets[new] = np.column_stack((np.full(new.sum(), ball), hits[new].argmax(axis=1)))


def with_errors(velocities: Floats, spins: Floats, errors: Floats, max_speed: float) -> tuple[Floats, Floats]:
    """Returns strokes with errors: turned, and with another speed of the cue.

    Args:
        velocities: (m, 2) m/s.
        spins: (m, 3) rad/s. The spin changes with the speed in proportion.
        errors: (m, 2) of the direction, rad, and of the speed, m/s.
        max_speed: The largest speed, m/s; the least is 0.

    Returns:
        The velocities (m, 2) and the spins (m, 3).
    """
    speed = np.hypot(velocities[:, 0], velocities[:, 1])
    scale = (np.clip(speed + errors[:, 1], 0.0, np.maximum(max_speed, speed)) / np.maximum(speed, 1e-9))[:, None]
    turned = scale * turn(velocities, errors[:, 0])
    return turned, np.column_stack((scale * turn(spins[:, :2], errors[:, 0]), scale * spins[:, 2:]))


def turn(vectors: Floats, angles: Floats) -> Floats:
    """Returns vectors (m, 2) turned counterclockwise by angles (m,), rad."""
    c, s = np.cos(angles), np.sin(angles)
    return np.column_stack((c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]))


def _errors(shots: int, samples: int, noise: Noise, rng: np.random.Generator) -> Floats:
    """Returns (shots * samples, 2) normal errors, stratified over the samples of each shot."""
    ranks = rng.permuted(np.broadcast_to(np.arange(samples)[:, None], (shots, samples, 1)).repeat(2, 2), axis=1)
    shares = (ranks + rng.random((shots, samples, 2))) / samples
    return (np.array(noise) * _QUANTILES[(1024 * shares).astype(np.int64)]).reshape(-1, 2)


def _candidates(
    setup: Setup, game: GameState, max_speed: float, rng: np.random.Generator, count: int, error: float, tips: Tips
) -> Shots:
    """Returns `count` candidates in random order."""
    places = _places(setup, game, rng)
    pots = None if game.state.break_shot else _pots(setup, game, places, max_speed, error, tips)
    near = int(_GEOMETRY * count) if pots is not None else 0
    every = _anywhere(setup, game, places, count - near, max_speed, rng, tips)
    if pots is not None:
        every = every.and_also(_near(setup.scene, places, pots, near, max_speed, rng))
    return every.of(rng.permutation(count))


def _places(setup: Setup, game: GameState, rng: np.random.Generator) -> Floats:
    """Returns (p, 2) places of the cue ball, m: random ones, if it is in hand."""
    if game.state.in_hand == "no":
        return game.positions[None, game.state.cue_balls[0]]
    x_low, x_high, y_low, y_high = cue_ball_area(setup.scene, game.state)
    drawn = rng.uniform((x_low, y_low), (x_high, y_high), (PLACES, 2)).tolist()
    return np.array([cue_ball_point(setup.scene, game.positions, game.state, (x, y)) for x, y in drawn])


class _Pots(NamedTuple):
    """The pots by geometry from all places with all tips.

    Attributes:
        place: (k,) the place of the cue ball.
        tip: (k,) index in `TIPS`.
        target: (k, 2) ball and pocket.
        shots: (k, s, w) as in `Pots.shots`.
        tolerance: (k,) rad.
        share: (k,) the share of the candidates.
    """

    place: Ints
    tip: Ints
    target: Ints
    shots: Floats
    tolerance: Floats
    share: Floats


def _pots(setup: Setup, game: GameState, places: Floats, max_speed: float, error: float, tips: Tips) -> _Pots | None:
    """Returns the pots of the legal balls; None if there are none."""
    state, n = game.state, len(game.positions)
    targets = np.isin(np.arange(n), sorted(setup.game_rules.legal(state, state.player)))
    potted = np.broadcast_to(~np.isin(np.arange(n), sorted(state.on_table)), (len(places), n))
    positions = np.repeat(game.positions[None], len(places), axis=0)
    positions[:, state.cue_balls[0]] = places
    tables = Tables(setup.scene, targets, positions, np.ascontiguousarray(potted), max_speed, state.cue_balls[0])
    if not setup.game_rules.pockets:
        return None
    parts = []
    for tip, offset in enumerate(tips):
        pots = find_pots(tables, most=12, offset=offset, banks=tip == 0)
        place, k = np.nonzero(np.arange(pots.ball.shape[1]) < pots.count[:, None])
        tolerance = pots.rows[place, k, TOLERANCE]
        target = np.column_stack((pots.ball[place, k], pots.pocket[place, k]))
        share = success(tolerance, error) + 0.02
        parts.append((place, np.full(len(k), tip), target, pots.shots[place, k], tolerance, share))
    found = _Pots(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
    return found if len(found.place) else None


def _near(scene: Scene, places: Floats, pots: _Pots, count: int, max_speed: float, rng: np.random.Generator) -> Shots:
    """Returns shots at pots, the easier pots more often, with random speeds and small turns."""
    k = rng.choice(len(pots.share), count, p=pots.share / pots.share.sum())
    possible = pots.shots[k, :, SPEED] > 0
    s = np.where(possible, rng.random(possible.shape), -1.0).argmax(axis=1)
    following = np.minimum(s + 1, possible.shape[1] - 1)
    following = np.where(possible[np.arange(count), following], following, s)
    part = rng.random(count)[:, None]
    low, high = pots.shots[k, s], pots.shots[k, following]
    ways = (1.0 - part) * low[:, : DY + 1] + part * high[:, : DY + 1]
    ways /= np.hypot(ways[:, 0], ways[:, 1])[:, None]
    speeds = (1.0 - part[:, 0]) * low[:, SPEED] + part[:, 0] * high[:, SPEED]
    ways = turn(ways, _TURN * pots.tolerance[k] * rng.standard_normal(count))
    velocities, spins = _with_spin(scene, speeds[:, None] * ways, pots.tip[k], max_speed)
    return Shots(velocities, spins, places[pots.place[k]], pots.target[k])


def _anywhere(
    setup: Setup,
    game: GameState,
    places: Floats,
    count: int,
    max_speed: float,
    rng: np.random.Generator,
    tips: Tips,
) -> Shots:
    """Returns random shots: half of them towards a legal ball, in a break all of them, towards the nearest one."""
    state, radius = game.state, setup.scene.balls.radius
    balls = np.array(sorted(setup.game_rules.legal(state, state.player) & state.on_table))
    from_places = places[rng.integers(len(places), size=count)]
    to_balls = game.positions[balls] - from_places[:, None]
    far = np.hypot(to_balls[..., 0], to_balls[..., 1])
    chosen = far.argmin(axis=1) if state.break_shot else rng.integers(len(balls), size=count)
    to, far = to_balls[np.arange(count), chosen], far[np.arange(count), chosen]
    reach = np.array(radius)[balls[chosen]] + radius[state.cue_balls[0]]
    angles = np.arctan2(to[:, 1], to[:, 0]) + np.arcsin(np.minimum(1.0, reach / far)) * rng.uniform(-1.0, 1.0, count)
    free = (rng.random(count) < 0.5) & (not state.break_shot)
    angles = np.where(free, rng.uniform(-math.pi, math.pi, count), angles)
    breaks = state.break_shot and not setup.game_rules.has_spots
    share = rng.uniform(*_BREAKS, count) / max_speed if breaks else 0.03 + 0.97 * rng.random(count) ** 2
    velocities = max_speed * np.minimum(share, 1.0)[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    velocities, spins = _with_spin(setup.scene, velocities, rng.integers(len(tips), size=count), max_speed)
    return Shots(velocities, spins, from_places, np.full((count, 2), -1))


def _with_spin(scene: Scene, velocities: Floats, tips: Ints, max_speed: float) -> tuple[Floats, Floats]:
    """Returns level strokes with velocities (k, 2) and offsets of the tip; a stroke that is too fast is slower."""
    if not tips.any():
        return velocities, np.zeros((len(velocities), 3))
    made = strike(scene, 1.0, 0.0, *np.array(TIPS).T)
    unit, spin = made.velocity[tips], made.spin[tips]
    speed, gain = np.hypot(velocities[:, 0], velocities[:, 1]), np.hypot(unit[:, 0], unit[:, 1])
    cue = np.minimum(speed / gain, max_speed / made.velocity[0, 0])
    angles = np.arctan2(velocities[:, 1], velocities[:, 0]) - np.arctan2(unit[:, 1], unit[:, 0])
    turned = np.column_stack((turn(spin[:, :2], angles), spin[:, 2:]))
    return (cue * gain / speed)[:, None] * velocities, cue[:, None] * turned


def success(tolerance: Floats, error: float) -> Floats:
    """Returns the probability of pots with tolerances, rad, under normal errors of the direction, rad."""
    return np.interp(tolerance / math.hypot(error, _FLOOR), _DEVIATIONS, _WITHIN)


class Values:
    """The values of outcomes for the player to shoot in a game."""

    def __init__(self, setup: Setup, game: GameState, max_speed: float, error: float, run_out: bool) -> None:
        """Prepares the values; `error` is the standard deviation of the direction, rad."""
        self._run_out = run_out
        self._setup, self._me, self._max_speed, self._error = setup, game.state.player, max_speed, error
        self._usual = 0.3 + 0.7 * float(success(np.array(_LENGTH), error))

    def of(self, played: PlayedBatch) -> Floats:
        """Returns the value of each of m shots, (m,); see `Plan.value`."""
        verdicts, states = played.verdicts, played.states
        mine = states["player"] == self._me
        sign = np.where(mine, 1.0, -1.0)
        legal = legal_balls(self._setup.rules, states, states["player"])
        ease = self.ease(played, legal)
        won = np.where(verdicts["winner"] == self._me, 1.0, np.where(verdicts["winner"] >= 0, -1.0, 0.0))
        if self._setup.target is not None:
            points = verdicts["points"] - verdicts["penalty"]
            following = _POINTS.get(self._setup.rules, 1.0) * ease * sign
            return points + np.where(verdicts["over"], 10.0 * won, following)
        left = self._left(states, legal)
        if self._run_out:
            return np.where(verdicts["over"], won == 1.0, mine * ease * self._usual ** (left - 1.0))
        chance = ease * (0.5 + 0.5 * self._usual ** (left - 1.0)) + (1.0 - ease) * _WITHOUT
        return np.where(verdicts["over"], won, sign * (2.0 * chance - 1.0))

    def _left(self, states: NDArray[Any], legal: Ints) -> Floats:
        """Returns the number of balls that the next player has to pot."""
        counts = np.array([[bin(mask).count("1") for mask in row] for row in (states["object_balls"], legal)], float)
        return np.minimum(counts[0], 8.0 if self._setup.rules == "eight_ball" else 15.0)

    def ease(self, played: PlayedBatch, legal: Ints) -> Floats:
        """Returns the probability that the next player pots a ball, (m,), from the easiest pots."""
        verdicts, states = played.verdicts, played.states
        ease = np.full(len(states), _UNKNOWN)
        if not self._setup.game_rules.pockets:
            return ease
        hand = verdicts["in_hand"] == IN_HAND.index("anywhere")
        ease[hand] = success(np.array(_EASY), self._error)
        balls = np.arange(played.positions.shape[1])
        known = ~(hand | verdicts["over"] | states["break_shot"]) & (verdicts["in_hand"] == 0)
        for mask in np.unique(legal[known]).tolist():
            which = np.flatnonzero(known & (legal == mask))
            potted = (states["object_balls"][which, None] >> balls & 1) == 0
            potted[:, CUE_BALL] = False
            targets = (mask >> balls & 1) > 0
            if self._setup.game_rules.has_spots:  # the banks of many balls take too long
                to_cue = played.positions[which] - played.positions[which, :1]
                far = np.where(targets, np.hypot(to_cue[..., 0], to_cue[..., 1]).mean(axis=0), np.inf)
                targets &= far <= np.sort(far)[_NEAREST - 1]
            tables = Tables(self._setup.scene, targets, played.positions[which], potted, self._max_speed)
            pots = find_pots(tables, most=_POTS)
            clean = ((pots.shots[..., SPEED] > 0) & (pots.shots[..., GAPS:].min(axis=-1) >= 0.0)).any(axis=-1)
            good = np.sort(success(pots.rows[..., TOLERANCE], self._error) * np.where(clean, 1.0, _SCRATCH), axis=1)
            ease[which] = np.minimum(1.0, (1.0 - _SECOND) * good[:, -1] + _SECOND * good[:, -2])
        return ease
