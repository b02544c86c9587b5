"""The value of the outcomes of shots: from -1 for a lost game to 1 for a won game, or the expected lead in points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.games import GameState, Setup
from billiards_env.games.batch import PlayedBatch
from billiards_env.physics.state import CUE_BALL
from billiards_env.players.pots import GAPS, SPEED, TOLERANCE, Tables, find_pots
from billiards_env.rules import FOULS, IN_HAND, legal_balls

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_UNKNOWN = 0.7  # ease of the next shot after a new rack, and in games without pockets
_WITHOUT = 0.4  # probability of a win for a player without a pot, who plays safe
_SCRATCH = 0.5  # factor for the ease of a pot that, by geometry, scratches at every speed
_FLOOR = math.radians(0.03)  # error of a leave's pot in addition to the noise
_EASY = 0.02  # rad; tolerance of the first pot with the ball in hand
_POTS = 3  # pots that are found in a leave; the two easiest count
_NEAREST = 4  # balls whose pots are found in a leave in snooker
_SECOND = 0.03  # weight of the second pot of a leave
_LENGTH = 3.5e-3  # rad; tolerance of a usual pot with a usual leave
_DEVIATIONS = np.linspace(0.0, 4.0, 401)
_WITHIN = np.array([math.erf(x / math.sqrt(2.0)) for x in _DEVIATIONS])


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

    def of(self, played: PlayedBatch, push_out: NDArray[np.bool_] | None = None) -> Floats:
        """Returns the value of each of m shots, (m,), see `Plan.value`; `push_out` (m,) marks the push outs.

        After a push out the opponent chooses who plays the next shot.
        """
        verdicts, states = played.verdicts, played.states
        push_out = np.zeros(len(states), bool) if push_out is None else push_out
        if push_out.any():
            verdicts = verdicts.copy()
            allowed = push_out & (verdicts["foul"] != FOULS.index("scratch"))
            verdicts["in_hand"][allowed] = verdicts["over"][allowed] = 0
            played = played._replace(verdicts=verdicts)
        mine = states["player"] == self._me
        sign = np.where(mine, 1.0, -1.0)
        legal = legal_balls(self._setup.rules, states, states["player"])
        goes_on = mine & ~push_out
        ease = self.ease(played, legal, goes_on if self._run_out else np.ones(len(states), bool))
        won = np.where(verdicts["winner"] == self._me, 1.0, np.where(verdicts["winner"] >= 0, -1.0, 0.0))
        if self._setup.target is not None:
            following = self._setup.game_rules.sure_pot * ease * (mine if self._run_out else sign)
            points = verdicts["points"] - (0 if self._run_out else verdicts["penalty"])
            return points + np.where(verdicts["over"], 10.0 * won, following)
        left = self._left(states, legal)
        if self._run_out:
            return np.where(verdicts["over"], won == 1.0, goes_on * ease * self._usual ** (left - 1.0))
        chance = ease * (0.5 + 0.5 * self._usual ** (left - 1.0)) + (1.0 - ease) * _WITHOUT
        value = np.where(verdicts["over"], won, sign * (2.0 * chance - 1.0))
        return np.where(push_out, -np.abs(2.0 * chance - 1.0), value)

    def _left(self, states: NDArray[Any], legal: Ints) -> Floats:
        """Returns the number of balls that the next player has to pot."""
        counts = np.array([[bin(mask).count("1") for mask in row] for row in (states["object_balls"], legal)], float)
        return np.minimum(counts[0], 8.0 if self._setup.game_rules.groups else 15.0)

    def ease(self, played: PlayedBatch, legal: Ints, wanted: NDArray[np.bool_]) -> Floats:
        """Returns the probability that the next player pots a ball, (m,), from the easiest pots.

        `legal` (m,) are sets of balls. The results of shots that are not `wanted` (m,) are arbitrary.
        """
        verdicts, states = played.verdicts, played.states
        ease = np.full(len(states), _UNKNOWN)
        if not self._setup.game_rules.pockets:
            return ease
        hand = verdicts["in_hand"] == IN_HAND.index("anywhere")
        ease[hand] = success(np.array(_EASY), self._error)
        balls = np.arange(played.positions.shape[1])
        known = wanted & ~(hand | verdicts["over"] | states["break_shot"]) & (verdicts["in_hand"] == 0)
        for mask in np.unique(legal[known]).tolist():
            which = np.flatnonzero(known & (legal == mask))
            potted = (states["object_balls"][which, None] >> balls & 1) == 0
            potted[:, CUE_BALL] = False
            targets = (mask >> balls & 1) > 0
            banks: bool | None = False
            if self._setup.game_rules.has_spots:  # the pots of many balls take too long
                banks = None
                to_cue = played.positions[which] - played.positions[which, :1]
                far = np.where(targets, np.hypot(to_cue[..., 0], to_cue[..., 1]).mean(axis=0), np.inf)
                targets &= far <= np.sort(far)[_NEAREST - 1]
            tables = Tables(self._setup.scene, targets, played.positions[which], potted, self._max_speed)
            pots = find_pots(tables, most=_POTS, banks=banks)
            clean = ((pots.shots[..., SPEED] > 0) & (pots.shots[..., GAPS:].min(axis=-1) >= 0.0)).any(axis=-1)
            good = np.sort(success(pots.rows[..., TOLERANCE], self._error) * np.where(clean, 1.0, _SCRATCH), axis=1)
            ease[which] = np.minimum(1.0, (1.0 - _SECOND) * good[:, -1] + _SECOND * good[:, -2])
        return ease
