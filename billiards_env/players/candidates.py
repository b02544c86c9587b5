"""The shots among which the planner chooses: pots by geometry from each place of the cue ball, and random shots."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.derivatives.shot_derivatives import has_derivatives
from billiards_env.engine import PIC
from billiards_env.engine.strikes import strike
from billiards_env.games import GameState, Setup
from billiards_env.games.game_state import PUSH_OUT, is_in, members, on_table
from billiards_env.players.hints import hints_of, only_banks
from billiards_env.players.situation import draw_places
from billiards_env.players.values import pot_probability
from billiards_env.pots.budget import Budget
from billiards_env.pots.finder import DY, SPEED, TOLERANCE, find_pots
from billiards_env.pots.indirect import find_indirect
from billiards_env.scene import Scene
from billiards_env.shots.tables import Tables

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Tips = tuple[tuple[float, float], ...]

TIPS = ((0.0, 0.0), (0.0, 0.35), (0.0, -0.35), (0.35, 0.0), (-0.35, 0.0), (0.25, -0.25), (-0.25, -0.25))
"""The offsets of the tip that the planner tries: to the left and up, in ball radii."""

PLACES = 24
"""The number of places for a cue ball in hand."""

LEAST_CANDIDATES = 120
"""The least number of candidates."""

_MOST_CANDIDATES = 4000
_GEOMETRY = 0.7  # share of the candidates that are pots by geometry, if there are any
_POT_TIME = 0.25  # share of the time for pots by geometry; then `indirect.TIME` for indirect pots
_PUSH_OUTS = 0.3  # share of the other candidates that are push outs, if the rules offer one
_LEAST_SHARE = 0.02  # share of a pot with tolerance 0 over the share of a sure pot
_PER_TIP, _PER_WAY = 3, 4  # candidates for each tip and legal ball, and for each indirect pot and ball on the table
_MANY = 8  # with more legal balls there are no banks
_SURE = 0.9  # with a pot of at least this share there are no indirect pots
_TURN = 0.2  # standard deviation of the random turn of a pot, over its tolerance
_BREAKS = 3.8, 5.6  # m/s; speeds of a break: faster ones depend more on the noise


class Candidates(NamedTuple):
    """k candidates.

    Attributes:
        velocities: (k, 2) m/s.
        spins: (k, 3) rad/s.
        places: (k, 2) m, of the cue ball.
        targets: (k, 2) the ball and the pocket of the pot that a shot plans, or -1.
        push_out: (k,) bool, whether a shot is a push out.
    """

    velocities: Floats
    spins: Floats
    places: Floats
    targets: Ints
    push_out: NDArray[np.bool_]

    def take(self, which: Any) -> Candidates:
        """Returns some of the candidates."""
        arrays: Any = (array[which] for array in self)
        return Candidates(*arrays)

    def joined(self, others: Candidates) -> Candidates:
        """Returns these candidates and others."""
        arrays: Any = (np.concatenate(pair) for pair in zip(self, others, strict=True))
        return Candidates(*arrays)


def rotated(vectors: Floats, angles: Floats) -> Floats:
    """Returns vectors (m, 2) turned counterclockwise by angles (m,), rad."""
    c, s = np.cos(angles), np.sin(angles)
    return np.column_stack((c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]))


def candidates(
    setup: Setup,
    game: GameState,
    max_speed: float,
    rng: np.random.Generator,
    most: float,
    noise: float,
    tips: Tips,
    budget: Budget,
) -> Candidates:
    """Returns candidates in random order, about `most`.

    Geometry takes at most a share of the time of a budget.

    If `most` is less than `LEAST_CANDIDATES`, there are `LEAST_CANDIDATES` shots and no indirect pots, which would take
    the place of direct pots.
    """
    count = int(np.clip(most, LEAST_CANDIDATES, _MOST_CANDIDATES))
    places, legal = _places(setup, game, rng), len(setup.legal(game.state))
    tips = tips[: max(1, count // (_PER_TIP * legal))]
    ways = count // (_PER_WAY * len(members(on_table(game.state)))) if most >= count else 0
    pots = None if game.state.break_shot else _pots(setup, game, places, max_speed, noise, tips, ways, budget)
    near = int(_GEOMETRY * count) if pots is not None else 0
    shots = _anywhere(setup, game, places, count - near, max_speed, rng, tips)
    if pots is not None:
        shots = shots.joined(_near(setup.scene, places, pots, near, max_speed, rng))
    return shots.take(rng.permutation(count))


def _places(setup: Setup, game: GameState, rng: np.random.Generator) -> Floats:
    """Returns (p, 2) places of the cue ball, m: random ones, if it is in hand."""
    if not game.state.in_hand:
        return game.positions[None, game.state.cue_balls[0]]
    return np.array(draw_places(setup, game, rng, PLACES))


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


def _pots(
    setup: Setup, game: GameState, places: Floats, max_speed: float, noise: float, tips: Tips, most: int, budget: Budget
) -> _Pots | None:
    """Returns the pots of the legal balls, at most `most` of them indirect; None if there are none."""
    state, n, banked = game.state, len(game.positions), only_banks(setup)
    targets = np.isin(np.arange(n), setup.legal(state))
    in_play, legal = (np.tile(balls, (len(places), 1)) for balls in (is_in(on_table(state), n), targets))
    positions = np.repeat(game.positions[None], len(places), axis=0)
    positions[:, state.cue_balls[0]] = places
    if not setup.game_rules.pockets:
        return None
    tables = Tables(setup.scene, positions, in_play, legal, max_speed, int(state.cue_balls[0]))
    parts, many = [], targets.sum() > _MANY  # the banks of many balls take too long
    for tip, offset in enumerate(tips):
        for piece in budget.pieces(len(places), _POT_TIME, first=tip == 0):
            banks = banked or (None if many else tip == 0)
            pots = find_pots(tables.take(piece), most=12, offset=offset, banks=banks, direct=not banked)
            place, k = np.nonzero(np.arange(pots.ball.shape[1]) < pots.count[:, None])
            tolerance = pots.rows[place, k, TOLERANCE]
            target = np.column_stack((pots.ball[place, k], pots.pocket[place, k]))
            share = pot_probability(tolerance, noise) + _LEAST_SHARE
            shots = pots.shots[place, k]
            parts.append((piece.start + place, np.full(len(k), tip), target, shots, tolerance, share))
    easiest = max((part[-1].max(initial=0.0) for part in parts), default=0.0)
    corrects = setup.engine == PIC and has_derivatives(setup.scene) and not (state.in_hand or banked)
    if corrects and easiest < _SURE and most:
        potted = np.arange(n) if hints_of(setup).pots_any else np.flatnonzero(targets)
        ways = find_indirect(tables, potted, most, budget)
        pots = ways.target[:, 0] >= 0
        share = len(tips) * (pots * pot_probability(ways.tolerance, noise) + _LEAST_SHARE)
        nothing = np.zeros(len(share), np.int64)
        parts.append((nothing, nothing, ways.target, ways.shots, ways.tolerance, share))
    joined = _Pots(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
    return joined if len(joined.place) else None


def _near(
    scene: Scene, places: Floats, pots: _Pots, count: int, max_speed: float, rng: np.random.Generator
) -> Candidates:
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
    ways = rotated(ways, _TURN * pots.tolerance[k] * rng.standard_normal(count))
    velocities, spins = _with_spin(scene, speeds[:, None] * ways, pots.tip[k], max_speed)
    return Candidates(velocities, spins, places[pots.place[k]], pots.target[k], np.zeros(count, bool))


def _anywhere(
    setup: Setup, game: GameState, places: Floats, count: int, max_speed: float, rng: np.random.Generator, tips: Tips
) -> Candidates:
    """Returns random shots: half of them towards a legal ball, in a break all of them, towards the nearest one."""
    state, radius = game.state, setup.scene.balls.radius
    balls = np.array(setup.legal(state))
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
    push_out = (rng.random(count) < _PUSH_OUTS) & (state.choices >> PUSH_OUT & 1 > 0)
    return Candidates(velocities, spins, from_places, np.full((count, 2), -1), push_out)


def _with_spin(scene: Scene, velocities: Floats, tips: Ints, max_speed: float) -> tuple[Floats, Floats]:
    """Returns level strokes with velocities (k, 2) and offsets of the tip; a stroke that is too fast is slower."""
    if not tips.any():
        return velocities, np.zeros((len(velocities), 3))
    made = strike(scene, 1.0, 0.0, *np.array(TIPS).T)
    unit, spin = made.velocity[tips], made.spin[tips]
    speed, gain = np.hypot(velocities[:, 0], velocities[:, 1]), np.hypot(unit[:, 0], unit[:, 1])
    cue = np.minimum(speed / gain, max_speed / made.velocity[0, 0])
    angles = np.arctan2(velocities[:, 1], velocities[:, 0]) - np.arctan2(unit[:, 1], unit[:, 0])
    turned = np.column_stack((rotated(spin[:, :2], angles), spin[:, 2:]))
    return (cue * gain / speed)[:, None] * velocities, cue[:, None] * turned
