"""The frozen tasks as lists of calls of compiled functions, with which JavaScript plays a file of `billiards bench`.

`Episodes` calls these functions in `reset` and `step`. They are recorded here with their arguments and do not run.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import frozen_strike, pic
from billiards_env.engine.compile import scene_fields
from billiards_env.envs import episodes, make_env
from billiards_env.frozen import FROZEN
from billiards_env.jit.decorators import EntryPoint

COUNT = 9973
"""The number of recorded episodes. No other number or side of an array is equal to it."""

TASKS = tuple(name for name, task in FROZEN.items() if not task.noise)
"""The tasks of the module. The normal numbers of the noise need functions of the C library."""

Call = tuple[Any, tuple[Any, ...]]


class Program(NamedTuple):
    """The calls of a task.

    Attributes:
        arguments: The arguments of its environment.
        scene: The fields of its scene.
        begin: The functions that begin episodes, with their arguments.
        shoot: Those that play a shot.
        arrays: Arrays of the episodes by the names that JavaScript uses.
    """

    arguments: dict[str, Any]
    scene: tuple[Any, ...]
    begin: list[Call]
    shoot: list[Call]
    arrays: dict[str, NDArray[Any]]


def program(name: str) -> Program:
    """Returns the calls of a frozen task."""
    arguments = FROZEN[name].arguments
    env = make_env(**arguments)
    model = env.model
    # JavaScript has no functions for few balls, which compute the same bits
    with patch.object(episodes, "run_shots_of", lambda *_: pic.run_shots):
        played = episodes.Episodes(COUNT, model)
    size = 5 if model.action == "strike" else 2
    actions, mask = np.zeros((COUNT, size)), np.ones(COUNT, np.bool_)
    rewards, observations = np.zeros(COUNT), np.zeros((COUNT, played.observer.size), np.float32)
    with _recorded() as begin:
        played.draw(0, COUNT, mask)
        played.begin(0, COUNT, mask, observations)
    with _recorded() as shoot:
        played.shoot(0, COUNT, actions, env.max_speed, rewards, observations)
    state, shots = played.state, played.shots
    arrays = {
        "stream": state.stream,
        "actions": actions,
        "observations": observations,
        "rewards": rewards,
        "times": shots.time,
        "over": state.over,
        "success": state.is_success,
        "positions": shots.positions,
        "velocities": shots.velocities,
        "spins": shots.spins,
        "in_play": shots.in_play,
    }
    return Program(arguments, scene_fields(model.scene), begin, shoot, arrays)


@contextmanager
def _recorded() -> Iterator[list[Call]]:
    """Records the calls of compiled functions by Python. They do not run and return -1, no ball without a place."""
    calls: list[Call] = []

    def record(function: EntryPoint, *arguments: Any) -> int:
        calls.append((function, arguments))
        return -1

    with ExitStack() as patches:
        patches.enter_context(patch.object(EntryPoint, "__call__", record, create=True))
        # whether a ball is frozen to others is not known yet; the function that follows changes no other shots
        patches.enter_context(patch.object(frozen_strike, "_is_ahead", lambda *_: True))
        yield calls
