"""The compared methods: PIC, PIT with its timesteps, and the simulators of `benchmarks.others`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import others
from billiards_env.scene import Scene
from billiards_env.simulation import BatchResult, simulate_batch

Floats = NDArray[np.float64]

LEAST_SECONDS = 0.02
"""s. A timed call of the engine runs as many copies of the shots as take about this time."""


class Method(NamedTuple):
    """A method to run a shot.

    Attributes:
        name: "PIC", "PIT" or one of `others.MODULES`.
        steps: Timesteps per second; None for a method without a timestep.
        fix: The fix of PIT for overlaps.
    """

    name: str
    steps: int | None = None
    fix: str | None = None

    @property
    def ours(self) -> bool:
        """Whether the method is an engine of this package."""
        return self.name in ("PIC", "PIT")

    @property
    def dt(self) -> float | None:
        """The timestep, s."""
        return None if self.steps is None else 1 / self.steps

    @property
    def engine(self) -> dict[str, Any]:
        """The arguments of `simulate` and `simulate_batch` that select the engine."""
        return {"mode": self.name.lower(), "dt": self.dt, "fix": self.fix}


PIC = Method("PIC")


def run_all(scene: Scene, positions: Floats, velocities: Floats, method: Method, threads: int = 1) -> BatchResult:
    """Runs shots, (m, n, 2) m and m/s, by PIC or PIT."""
    return simulate_batch(scene, positions, velocities, threads=threads, **method.engine)


def run_other(
    scene: Scene, positions: Floats, velocities: Floats, method: Method, times: Sequence[float]
) -> tuple[list[Floats], float]:
    """Runs a shot by another simulator; returns the positions at some times (s) and the run time, s."""
    go_to = others.prepare(method.name, scene, positions, velocities, method.dt)
    begin = perf_counter()
    positions_at = [go_to(t) for t in times]
    return positions_at, perf_counter() - begin


def timer(scene: Scene, positions: Floats, velocities: Floats, method: Method) -> Callable[[], float]:
    """Returns a function that runs shots, (m, n, 2) m and m/s, and returns the seconds per shot without the set-up."""
    if not method.ours:
        assert scene.physics.max_time is not None
        end, pairs = [scene.physics.max_time], list(zip(positions, velocities, strict=True))
        return lambda: sum(run_other(scene, p, v, method, end)[1] for p, v in pairs) / len(pairs)

    def call(copies: int = 1) -> float:
        many = np.tile(positions, (copies, 1, 1)), np.tile(velocities, (copies, 1, 1))
        begin = perf_counter()
        run_all(scene, *many, method)
        return (perf_counter() - begin) / len(many[0])

    run_all(scene, positions[:1], velocities[:1], method)  # compiles
    copies = max(1, round(LEAST_SECONDS / (call() * len(positions))))
    return lambda: call(copies)
