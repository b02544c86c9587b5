"""The paths of the balls in a recorded shot, and their evaluation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.engine.log import SEGMENT_BALL, SEGMENT_PHASE, SEGMENT_ROW
from billiards_env.physics.laws.cloth import SLIP_RATE
from billiards_env.physics.state import (
    AIRBORNE,
    AX,
    AY,
    LASTS,
    POTTED,
    ROLLING,
    SLIDING,
    T0,
    T0_LO,
    UX,
    UY,
    VX,
    VY,
    VZ,
    WZ,
    X,
    Y,
    Z,
)
from billiards_env.support.checks import numbers

Floats = NDArray[np.float64]


class Trajectory(NamedTuple):
    """The paths of n balls as k pieces, in the order in which they begin.

    On a piece the position is r0 + v0 t + a t^2 / 2, where t is the time since the piece began. A ball keeps its last
    position until its next piece begins.

    Attributes:
        ball: (k,) int, the ball of each piece. The first n pieces are those of balls 0 to n - 1.
        phase: (k,) int, the ball's phase, see `physics.state`.
        rows: (k, WIDTH or FLIGHT_WIDTH) float64, the ball's motion at the beginning of the piece, see `physics.state`.
    """

    ball: NDArray[np.intp]
    phase: NDArray[np.intp]
    rows: Floats

    @classmethod
    def of(cls, segments: Floats) -> Trajectory:
        """Returns the trajectory of rows of `Log.segments`."""
        ball, phase = segments[:, [SEGMENT_BALL, SEGMENT_PHASE]].T.astype(np.intp)
        return cls(ball, phase, segments[:, SEGMENT_ROW:].copy())

    @property
    def start(self) -> Floats:
        """(k,) Time at which each piece begins, s."""
        return self.rows[:, T0]

    @property
    def moving(self) -> NDArray[np.bool_]:
        """(k,) Whether the ball moves on the piece."""
        return (self.phase >= ROLLING) & (self.phase != POTTED)

    @property
    def duration(self) -> Floats:
        """(k,) Longest time for which the ball moves on the piece, s; it may be infinite."""
        return np.where(self.moving, self.rows[:, LASTS], 0.0)

    @property
    def position(self) -> Floats:
        """(k, 2) Position at the beginning of each piece, m."""
        return self.rows[:, [X, Y]]

    @property
    def velocity(self) -> Floats:
        """(k, 2) Velocity at the beginning of each piece, m/s."""
        return np.where(self.moving[:, None], self.rows[:, [VX, VY]], 0.0)

    @property
    def acceleration(self) -> Floats:
        """(k, 2) Acceleration on each piece, m/s^2."""
        return np.where(self.moving[:, None], self.rows[:, [AX, AY]], 0.0)

    @property
    def potted_at(self) -> Floats:
        """(n,) Time at which each ball was potted, s: 0 if it was not in play, infinite if it stayed on the table."""
        times = np.full(int(self.ball.max()) + 1, np.inf)
        for k in np.flatnonzero(self.phase == POTTED)[::-1]:
            times[self.ball[k]] = self.start[k]
        return times

    def path(self, ball: int, times: ArrayLike, before: bool = False) -> Floats:
        """Returns the positions of a ball.

        Args:
            ball: The ball.
            times: (m,) s, >= 0.
            before: Whether to use the earlier of two pieces at the time at which one ends and the next begins.

        Returns:
            (m, 2) m.
        """
        at = numbers("times", times)
        return self.at_pieces(self._pieces(ball, at, before), at)

    def heights(self, ball: int, times: Floats, g: float) -> Floats:
        """Returns the heights of a ball above its height on the cloth, (m,) m, at times (m,), s; `g` is gravity."""
        pieces = self._pieces(ball, times)
        rows, flies = self.rows[pieces], self.phase[pieces] == AIRBORNE
        if not flies.any():
            return np.zeros(len(pieces))
        t = np.clip(self._since(pieces, times), 0.0, rows[:, LASTS])
        return np.where(flies, np.maximum(rows[:, Z] + t * (rows[:, VZ] - 0.5 * t * g), 0.0), 0.0)

    def rises(self, ball: int, times: Floats, g: float) -> Floats:
        """Returns the vertical velocities of a ball, (m,) m/s, as `velocities`; `g` is gravity."""
        pieces = self._pieces(ball, times)
        since, rows = self._since(pieces, times), self.rows[pieces]
        flies = (self.phase[pieces] == AIRBORNE) & (since < rows[:, LASTS])
        return np.where(flies, rows[:, VZ] - g * since, 0.0) if flies.any() else np.zeros(len(pieces))

    def velocities(self, ball: int, times: Floats) -> Floats:
        """Returns the velocities of a ball, (m, 2) m/s, at times (m,), s; at an event the velocity after it."""
        return self.velocities_on(self._pieces(ball, times), times)

    def velocities_on(self, pieces: NDArray[np.intp], times: Floats) -> Floats:
        """Returns the velocities (m, 2), m/s, on pieces (m,) at times (m,), s."""
        since, rows = self._since(pieces, times), self.rows[pieces]
        moves = self.moving[pieces] & (since < rows[:, LASTS])
        return np.where(moves[:, None], rows[:, [VX, VY]] + since[:, None] * rows[:, [AX, AY]], 0.0)

    def spins(self, ball: int, times: Floats, radius: float, spin_decay: float) -> Floats:
        """Returns the spins of a ball at times (m,), s, as (m, 3) rad/s; `spin_decay` as in `Physics`, rad/s^2."""
        pieces = self._pieces(ball, times)
        since, rows, phase = self._since(pieces, times), self.rows[pieces], self.phase[pieces]
        rates = np.where(phase == SLIDING, SLIP_RATE * since, 0.0)[:, None]
        has_slip = ((phase == SLIDING) | (phase == AIRBORNE))[:, None]
        slips = np.where(has_slip, rows[:, [UX, UY]] + rates * rows[:, [AX, AY]], 0.0)
        roll = (self.velocities_on(pieces, times) - slips) / radius
        upright = np.maximum(abs(rows[:, WZ]) - np.where(phase == AIRBORNE, 0.0, spin_decay) * since, 0.0)
        spins = np.column_stack((-roll[:, 1], roll[:, 0], np.copysign(upright, rows[:, WZ])))
        return np.where((since < rows[:, LASTS])[:, None], spins, 0.0)

    def _pieces(self, ball: int, times: Floats, before: bool = False) -> NDArray[np.intp]:
        mine = np.flatnonzero(self.ball == ball)
        last = np.searchsorted(self.start[mine], times, side="left" if before else "right") - 1
        return mine[np.maximum(last, 0)]

    def _since(self, pieces: NDArray[np.intp], times: Floats) -> Floats:
        """Returns the times since the beginning of some pieces, s."""
        return (times - self.rows[pieces, T0]) - self.rows[pieces, T0_LO]

    def at(self, t: float) -> Floats:
        """Returns the positions of all balls at time t (s), (n, 2) m."""
        begun = self.start <= t
        n = int(self.ball.max()) + 1
        last = np.zeros(n, np.intp)
        last[self.ball[begun]] = np.flatnonzero(begun)  # NumPy assigns the last value of a repeated index
        return self.at_pieces(last, np.full(n, t))

    def at_pieces(self, pieces: NDArray[np.intp], times: Floats) -> Floats:
        """Returns the positions on some pieces (m,) at some times (m,), s, (m, 2) m."""
        rows, since = self.rows[pieces], self._since(pieces, times)
        t = np.where(self.moving[pieces], np.clip(since, 0.0, rows[:, LASTS]), 0.0)[:, None]
        return rows[:, [X, Y]] + t * (rows[:, [VX, VY]] + 0.5 * t * rows[:, [AX, AY]])
