"""The value of the outcomes of shots: from -1 for a lost game to 1 for a won game, or the expected lead in points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.games import GameState, Setup
from billiards_env.games.game_state import ANYWHERE, SCRATCH
from billiards_env.games.pool import EIGHT
from billiards_env.games.referee import legal_balls
from billiards_env.physics.state import CUE_BALL
from billiards_env.players import run_outs
from billiards_env.players.batch import PlayedBatch
from billiards_env.players.hints import hints_of, only_banks
from billiards_env.players.run_outs import FLOOR
from billiards_env.pots.finder import APPROACH, CUT_COS, RUN, TOLERANCE, WIDTH, find_pots
from billiards_env.shots.tables import Tables

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_UNKNOWN = 0.7  # chance to pot with the next shot after a new rack, and in games without pockets
_WITHOUT = 0.4  # probability of a win for a player who does not run out
_NEAREST = 4  # balls whose pots are found in a leave in snooker and bank pool
_SECOND = 0.03  # weight of the second pot of a leave
_LENGTH = 3.5e-3  # rad; tolerance of a usual pot with a usual leave
_IN_HAND = np.zeros(WIDTH)  # the pots with the cue ball in hand
_IN_HAND[[TOLERANCE, CUT_COS, APPROACH, RUN]] = 0.02, 1.0, 0.5, 0.5
_BITS = np.arange(32)
_DEVIATIONS = np.linspace(0.0, 4.0, 401)
_WITHIN = np.array([math.erf(x / math.sqrt(2.0)) for x in _DEVIATIONS])


def pot_probability(tolerance: Floats, noise: float) -> Floats:
    """Returns the probability of pots with tolerances, rad, under normal noise of the direction, rad."""
    return np.interp(tolerance / math.hypot(noise, FLOOR), _DEVIATIONS, _WITHIN)


class Values:
    """The values of outcomes for the player to shoot in a game."""

    def __init__(
        self,
        setup: Setup,
        game: GameState,
        max_speed: float,
        noise: tuple[float, float],
        run_out: bool = False,
        english: bool = True,
        weights: run_outs.Weights | None = None,
    ) -> None:
        """Prepares the values.

        Args:
            setup: The game.
            game: Its state before the shots.
            max_speed: Speed of the fastest shot, m/s.
            noise: Standard deviations of the direction, rad, and of the speed, m/s.
            run_out: Whether only the present turn counts.
            english: Whether to try offsets of the tip, in a scene with spin.
            weights: The network that computes the probability of a run-out, in games that are not won by points. None
                for an estimate from the next pot and the number of balls left.
        """
        self._setup, self._me, self._max_speed, self._noise = setup, game.state.player, max_speed, noise
        self._run_out, self._english = run_out, english and setup.scene.physics.motion == "sliding"
        self._weights, self._usual = weights, 0.3 + 0.7 * float(pot_probability(np.array(_LENGTH), noise[0]))

    def of(self, played: PlayedBatch, push_out: NDArray[np.bool_] | None = None) -> Floats:
        """Returns the value of each of m shots, (m,), see `Plan.value`; `push_out` (m,) marks the push outs.

        After a push out the opponent chooses who plays the next shot.
        """
        verdicts, states = played.verdicts, played.states
        push_out = np.zeros(len(states), bool) if push_out is None else push_out
        if push_out.any():
            states = states.copy()
            allowed = push_out & (verdicts["foul"] != SCRATCH)
            states["in_hand"][allowed] = states["over"][allowed] = 0
            played = played._replace(states=states)
        mine = states["player"] == self._me
        sign = np.where(mine, 1.0, -1.0)
        legal = legal_balls(self._setup.rules, states, states["player"])
        won = np.where(states["winner"] == self._me, 1.0, np.where(states["winner"] >= 0, -1.0, 0.0))
        goes_on = mine & ~push_out & ~states["over"]
        needed = goes_on if self._run_out else ~states["over"]
        if self._setup.target is not None:
            following = hints_of(self._setup).sure_pot * self.next_pot_chance(played, legal, needed)
            points = verdicts["points"] - (0 if self._run_out else verdicts["penalty"])
            return points + np.where(states["over"], 10.0 * won, following * (mine if self._run_out else sign))
        if self._weights is None:
            runs_out = self.next_pot_chance(played, legal, needed) * self._usual ** (self._left(states, legal) - 1.0)
        else:
            runs_out = run_outs.chances(self._weights, self.inputs(played, legal, needed))
        if self._run_out:
            return np.where(goes_on, runs_out, won == 1.0)
        chance = runs_out + (1.0 - runs_out) * _WITHOUT
        value = np.where(states["over"], won, sign * (2.0 * chance - 1.0))
        return np.where(push_out, -np.abs(2.0 * chance - 1.0), value)

    def _left(self, states: NDArray[Any], legal: Ints) -> Floats:
        """Returns the number of balls that the next player has to pot.

        On an open table of eight ball both groups count, at most 8 balls.
        """
        if "solids" not in self._setup.game_rules.state_names:
            return _sizes(states["object_balls"])
        return np.minimum(_sizes(legal & ~EIGHT) + 1.0, 8.0)

    def inputs(self, played: PlayedBatch, legal: Ints, needed: NDArray[np.bool_]) -> Floats:
        """Returns the inputs (m, k) of the network of `players.run_outs`; see `next_pot_chance` for the arguments.

        With the cue ball in hand, two fixed easy pots replace the pots of the position.
        """
        hand = played.states["in_hand"] > 0
        rows = self._pots(played, legal, needed & ~hand)
        cue, left = played.positions[:, CUE_BALL] / self._setup.scene.half_extents, self._left(played.states, legal)
        rows[hand], cue[hand] = _IN_HAND, 0.5
        return run_outs.inputs(rows, cue, left, _sizes(legal), self._noise, self._english)

    def next_pot_chance(self, played: PlayedBatch, legal: Ints, needed: NDArray[np.bool_]) -> Floats:
        """Returns the probability that the next player pots a ball, (m,), from the easiest pots.

        `legal` (m,) are sets of balls. The results of shots that are not `needed` (m,) are arbitrary.
        """
        verdicts, states = played.verdicts, played.states
        chance = np.full(len(states), _UNKNOWN)
        if not self._setup.game_rules.pockets:
            return chance
        hand = states["in_hand"] == ANYWHERE
        chance[hand] = pot_probability(np.array(_IN_HAND[TOLERANCE]), self._noise[0])
        known = needed & ~states["over"] & (verdicts["rack"] == 0) & (states["in_hand"] == 0)
        easiest, second = pot_probability(self._pots(played, legal, known)[..., TOLERANCE], self._noise[0]).T
        return np.where(known, np.minimum(1.0, (1.0 - _SECOND) * easiest + _SECOND * second), chance)

    def _pots(self, played: PlayedBatch, legal: Ints, needed: NDArray[np.bool_]) -> Floats:
        """Returns (m, `run_outs.POTS`, w) the easiest pots after m shots, as in `Pots.rows`; see `next_pot_chance`."""
        rows, balls = np.zeros((len(needed), run_outs.POTS, WIDTH)), np.arange(played.positions.shape[1])
        rules, most, banked = self._setup.game_rules, min(_NEAREST, len(balls)), only_banks(self._setup)
        for mask in np.unique(legal[needed]).tolist():
            which = np.flatnonzero(needed & (legal == mask))
            on_table = (played.states["object_balls"][which, None] >> balls & 1) > 0
            on_table[:, CUE_BALL] = True
            targets = (mask >> balls & 1) > 0
            if rules.has_spots or banked:  # the pots of many balls take too long
                to_cue = played.positions[which] - played.positions[which, :1]
                far = np.where(targets, np.hypot(to_cue[..., 0], to_cue[..., 1]).mean(axis=0), np.inf)
                targets &= far <= np.sort(far)[most - 1]
            targets = np.tile(targets, (len(which), 1))
            tables = Tables(self._setup.scene, played.positions[which], on_table, targets, self._max_speed)
            banks = None if rules.has_spots else banked
            pots = find_pots(tables, most=run_outs.POTS, banks=banks, speeds=False, direct=not banked)
            rows[which] = pots.rows
        return rows


def _sizes(sets: Ints) -> Floats:
    """Returns the number of balls in each of m sets, (m,)."""
    return (sets[:, None] >> _BITS & 1).sum(axis=1).astype(float)
