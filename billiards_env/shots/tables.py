"""Tables before a shot, for the environments and the players."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.scene import Scene


class Tables(NamedTuple):
    """k tables before a shot.

    Attributes:
        scene: Balls, table and physics.
        positions: (k, n, 2) m.
        in_play: (k, n) bool, the balls on the table.
        legal: (k, n) bool, the balls that count and that the cue ball may touch first, if they are on the table.
        max_speed: Speed of the fastest shot, m/s.
        cue: The number of the cue ball.
    """

    scene: Scene
    positions: NDArray[np.float64]
    in_play: NDArray[np.bool_]
    legal: NDArray[np.bool_]
    max_speed: float
    cue: int = 0

    @property
    def targets(self) -> NDArray[np.bool_]:
        """(k, n) bool, the legal balls on the table."""
        return self.legal & self.in_play

    def nearest(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Returns the target nearest to the cue ball, (k,), and the vector to it, (k, 2) m; any ball without one."""
        ways = self.positions - self.positions[:, self.cue, None]
        balls = np.where(self.targets, np.hypot(ways[..., 0], ways[..., 1]), np.inf).argmin(axis=1)
        return balls, ways[np.arange(len(ways)), balls]

    def take(self, which: Any) -> Tables:
        """Returns some of the tables."""
        positions, in_play, legal = (array[which] for array in self[1:4])
        return self._replace(positions=positions, in_play=in_play, legal=legal)
