"""The processor time or the number of simulated shots that a decision may use."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

LEAST_SHOTS = 4
"""The least number of shots between two readings of the clock, if the time is limited."""


class Budget:
    """What a decision may use, and what it has used.

    Attributes:
        used: The number of shots that were simulated.
    """

    def __init__(self, seconds: float = math.inf, shots: float = math.inf) -> None:
        """Starts the clock of the thread. An infinite number means no limit."""
        self._begin = self._first = time.thread_time()
        self._seconds, self._shots, self.used = seconds, shots, 0

    def begin_shots(self) -> None:
        """Starts the clock from which `left` estimates the time of a shot."""
        self._first = time.thread_time()

    @property
    def left(self) -> float:
        """The number of shots that can still be simulated, estimated from the time of the shots so far."""
        if math.isinf(self._seconds):
            return self._shots - self.used
        now = time.thread_time()
        rate = self.used / max(now - self._first, 1e-6)
        return min(self._shots - self.used, (self._begin + self._seconds - now) * rate)

    def chunk(self, share: float, least: int, most: int) -> int:
        """Returns how many shots to simulate before the next reading of the clock.

        They are a share of the shots left, from `least` to `most`. If the time is limited, `least` is not more than the
        shots left, but at least `LEAST_SHOTS`.
        """
        left = self.left
        if not math.isinf(self._seconds):
            least = max(LEAST_SHOTS, int(min(least, left)))
        return int(min(max(share * left, least), most))

    def pieces(self, total: int, share: float, first: bool = False) -> Iterator[slice]:
        """Yields consecutive pieces of range(total), or a single piece if the time is not limited.

        Otherwise the first piece has one entry. Each later piece has as many entries as fit in a share of the whole
        time, estimated from the time of the entries before. `first`: whether the first piece is always yielded.
        """
        if math.isinf(self._seconds):
            yield slice(0, total)
            return
        begin, end, done = time.thread_time(), self._begin + share * self._seconds, 0
        while done < total:
            now = time.thread_time()
            fit = (end - now) * done / max(now - begin, 1e-6) if done else float(first or now < end)
            if fit < 1.0:
                return
            yield slice(done, done + int(min(fit, total - done)))
            done += int(min(fit, total - done))
