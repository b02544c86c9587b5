"""The frozen tasks as lists of calls of compiled functions. JavaScript makes these calls to replay a leaderboard file.

`Episodes` makes the calls in `reset` and `step`. This module records them with their arguments and does not run them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from billiards_env.bench.frozen import FROZEN
from billiards_env.engine import frozen_strike, pic
from billiards_env.engine.compile import scene_fields
from billiards_env.envs import episodes, make_env
from billiards_env.envs.actions import ACTIONS
from billiards_env.jit.decorators import EntryPoint, Typed

COUNT = 9973
"""The number of episodes during the recording. No other number and no length of an array has this value."""

TASKS = tuple(name for name, task in FROZEN.items() if not task.noise)
"""The tasks without noise. The normally distributed numbers of the noise need functions of the C library."""

Call = tuple[Any, tuple[Any, ...]]


class Program(NamedTuple):
    """The calls of a task.

    Attributes:
        arguments: The arguments of the environment.
        scene: The fields of the scene.
        begin: The calls that begin episodes.
        shoot: The calls that play a shot.
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
    model = make_env(**arguments).model
    # JavaScript lacks the functions for few balls; the general ones compute the same bits
    with patch.object(episodes, "run_shots_of", lambda *_: pic.run_shots):
        played = episodes.Episodes(COUNT, model)
    actions, mask = np.zeros((COUNT, ACTIONS[model.action].size)), np.ones(COUNT, np.bool_)
    rewards, observations = np.zeros(COUNT), played.observer.new(COUNT)
    with _recorded() as begin:
        played.draw(0, COUNT, mask)
        played.begin(0, COUNT, mask, observations)
    with _recorded() as shoot:
        played.shoot(0, COUNT, actions, rewards, observations)
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
    """Records Python's calls of compiled functions without running them. Each returns -1: every ball has a place."""
    calls: list[Call] = []

    def record(function: EntryPoint, *arguments: Any) -> int:
        calls.append((function, arguments))
        return -1

    with ExitStack() as patches:
        patches.enter_context(patch.object(EntryPoint, "__call__", record, create=True))
        patches.enter_context(patch.object(Typed, "__call__", lambda call, *arguments: record(call.entry, *arguments)))
        # True, because the shots are not drawn yet; `_drive`, which follows, changes no shots without frozen balls
        patches.enter_context(patch.object(frozen_strike, "_is_ahead", lambda *_: True))
        yield calls
