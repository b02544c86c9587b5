"""The compared methods: PIC, and PIT with its timesteps and fixes."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import Engine
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate_batch

Floats = NDArray[np.float64]

LEAST_SECONDS = 0.02
"""s. A timed call of the engine runs as many copies of the shots as take about this time."""


class Method(NamedTuple):
    """A method to run a shot: "PIC", or "PIT" with a number of timesteps per second and a fix for overlaps."""

    name: str
    steps: int | None = None
    fix: str | None = None

    @property
    def engine(self) -> Engine:
        """The engine."""
        return Engine(self.name.lower(), None if self.steps is None else 1 / self.steps, self.fix)


PIC = Method("PIC")


def timer(scene: Scene, positions: Floats, velocities: Floats, method: Method) -> Callable[[], float]:
    """Returns a function that runs shots, see `simulate_batch`, and returns the seconds per shot."""

    def call(copies: int = 1) -> float:
        many = np.concatenate([positions] * copies), np.concatenate([velocities] * copies)
        begin = perf_counter()
        simulate_batch(scene, *many, threads=1, engine=method.engine)
        return (perf_counter() - begin) / len(many[0])

    simulate_batch(scene, positions[:1], velocities[:1], threads=1, engine=method.engine)  # compiles
    copies = max(1, round(LEAST_SECONDS / (call() * len(positions))))
    return lambda: call(copies)
