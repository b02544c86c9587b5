"""The rows of many tracks as arrays, and where the numbers of a start are in its row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


_GROUPS, _LEAST = 8, 6  # most groups, and the least number of shots in each


class Layout(NamedTuple):
    """Where the numbers of the start of a shot with n balls are in an array: the fields are indices and slices."""

    n: int

    @property
    def places(self) -> slice:
        """The coordinates x and y of each ball, m."""
        return slice(0, 2 * self.n)

    @property
    def velocity(self) -> slice:
        """The cue ball's velocity, m/s."""
        return slice(2 * self.n, 2 * self.n + 2)

    @property
    def spin(self) -> slice:
        """Its spin, rad/s."""
        return slice(2 * self.n + 2, 2 * self.n + 5)

    @property
    def side(self) -> int:
        """Its spin about the vertical axis."""
        return 2 * self.n + 4

    @property
    def instant(self) -> int:
        """The instant of the strike, s after the first row."""
        return 2 * self.n + 5

    @property
    def width(self) -> int:
        """The length of the array."""
        return 2 * self.n + 6


class Prior(NamedTuple):
    """What is known of the starts besides rows: `matrix` @ start has the mean `target` and a standard deviation of 1.

    Attributes:
        matrix: (m, p, width).
        target: (m, p).
    """

    matrix: Floats
    target: Floats


class Rows(NamedTuple):
    """The rows of m tracks in the order of time, in arrays with room for r rows each.

    Attributes:
        ball: (m, r) int, the ball; 0 without a row.
        frame: (m, r) int, the index of the time.
        places: (m, r, 2) m.
        seen: (m, r) bool, whether there is a row.
        judged: (m, r) bool, whether it counts in reports: it is of a ball that moves, and was not added.
        used: (m, r) bool, whether the row is fitted.
        scale: (m, r) m, the error of a coordinate above which the loss grows slowly.
        after: (m, r) int, the number of contacts of the cue ball before the row.
        times: (m, q) s since the first row, ascending; the last is repeated.
        in_play: (m, n) bool, whether the ball has rows.
        latest: (m,) s, the latest instant of the strike after the first row.
        known: (m, width), the numbers of the starts that are not fitted; NaN for the others.
        prior: The `Prior` of the starts.
    """

    ball: NDArray[np.int64]
    frame: NDArray[np.int64]
    places: Floats
    seen: Bools
    judged: Bools
    used: Bools
    scale: Floats
    after: NDArray[np.int64]
    times: Floats
    in_play: Bools
    latest: Floats
    known: Floats
    prior: Prior

    @property
    def time(self) -> Floats:
        """(m, r) s, the times of the rows."""
        return np.take_along_axis(self.times, self.frame, axis=1)

    def of(self, shots: Sequence[int] | NDArray[np.intp]) -> Rows:
        """Returns the rows of some shots."""
        prior = Prior._make(array[shots] for array in self.prior)
        return Rows._make([*(array[shots] for array in self if not isinstance(array, Prior)), prior])

    def until(self, ends: Floats) -> Rows:
        """Returns the rows before times, (m,) s, without room for others."""
        seen = self.seen & (self.time < ends[:, None])
        r = max(1, int(seen.sum(axis=1).max()))
        q = int(self.frame[:, :r].max(initial=0, where=seen[:, :r])) + 1
        last = np.take_along_axis(self.times, self.frame.max(axis=1, where=seen, initial=0)[:, None], axis=1)
        return self._replace(
            ball=self.ball[:, :r],
            places=self.places[:, :r],
            judged=self.judged[:, :r],
            scale=self.scale[:, :r],
            after=self.after[:, :r],
            times=np.minimum(self.times[:, :q], last),
            frame=np.minimum(self.frame[:, :r], q - 1),
            seen=seen[:, :r],
            used=(self.used & seen)[:, :r],
        )

    def groups(self) -> Iterator[tuple[NDArray[np.intp], Rows]]:
        """Returns an iterator over groups of shots with about as many rows each: indices, and rows with little room."""
        order = np.argsort(self.seen.sum(axis=1), kind="stable")
        for some in np.array_split(order, max(1, min(_GROUPS, len(order) // _LEAST))):
            yield some, self.of(some).until(np.full(len(some), np.inf))
