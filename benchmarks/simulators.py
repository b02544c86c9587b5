"""Shots in other simulators, pooltool and pymunk, in processes with an environment of their own.

pooltool needs other versions of numba and llvmlite than billiards-env. `make bench` creates the environment,
in which `benchmarks/simulators_worker.py` runs:

    python3 -m venv .venv-simulators
    .venv-simulators/bin/pip install --no-deps -r benchmarks/simulators.txt
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from benchmarks import ROOT, worker
from billiards_env.scene import Scene

Floats = NDArray[np.float64]

PYTHON = ROOT / ".venv-simulators" / "bin" / "python"
WORKER = Path(__file__).with_name("simulators_worker.py")


class Outcome(NamedTuple):
    """The outcome of a shot: positions (n, 2), m, the run time, and whether the simulator ran the whole shot.

    The positions are None if it stopped before the time of comparison.
    """

    positions: Floats | None
    seconds: float
    finished: bool = True


Runner: TypeAlias = Callable[[Scene, Floats, Floats, float | None], Outcome]
"""Runs a shot. The arguments are the scene, the positions, the velocity of the cue ball, and the time of the returned
positions, s, or None for the end of the shot."""


def installed() -> bool:
    """Returns whether the environment exists."""
    return PYTHON.exists()


@contextlib.contextmanager
def runner(name: str, argument: float) -> Iterator[tuple[str, Runner]]:
    """Yields the version and the runner of a simulator. The name is that of an entry of `SIMULATORS` in the worker."""
    with worker(WORKER.name, [PYTHON, WORKER]) as ask:

        def run_shot(scene: Scene, positions: Floats, velocity: Floats, time: float | None) -> Outcome:
            shot = {"scene": scene.to_dict(), "positions": positions.tolist(), "velocity": velocity.tolist()}
            answer = Outcome(**ask({**shot, "time": time}))
            return answer if answer.positions is None else answer._replace(positions=np.array(answer.positions))

        yield ask([name, argument]), run_shot
