"""The keys of `info`: both environments return the keys of `InfoArrays`.

All values are numbers, because TorchRL cannot read infos of vector environments that contain text.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.measures import MEASURES
from billiards_env.envs.episode_arrays import TALLY
from billiards_env.envs.state import State


class InfoArrays(NamedTuple):
    """The arrays of the keys of `info`, with one entry per episode.

    Attributes:
        numbers: The keys with a number, (m,).
        rows: The keys with an array, (m, n) or of another length.
    """

    numbers: dict[str, NDArray[Any]]
    rows: dict[str, NDArray[Any]]

    def joined(self, other: InfoArrays) -> InfoArrays:
        """Returns the keys of both."""
        return InfoArrays(self.numbers | other.numbers, self.rows | other.rows)


def info_arrays(state: State, has_cue: bool, has_choices: bool) -> tuple[InfoArrays, InfoArrays]:
    """Returns the arrays of the keys of `info`: those that change with each shot, and those of an episode.

    The arrays change with the episodes.

    Args:
        state: The episodes.
        has_cue: Whether a cue strikes the cue balls.
        has_choices: Whether an action is a choice.
    """
    numbers = {
        "shot_time": state.time,
        "n_events": state.n_events,
        "status_code": state.status,
        "first_hit": state.first_hit,
        **{name: getattr(state, name) for name in TALLY},
    }
    if has_cue:
        numbers["miscue"] = state.miscues
    of_shots = {"played_action": state.actions, "cushions": state.cushions, "potted": state.potted}
    for name in state.model.measures:
        (numbers if state.measures[name].ndim == 1 else of_shots)[name] = state.measures[name]
    of_episode: dict[str, NDArray[Any]] = {"episode_seed": state.episode_seed.view(np.int64)}
    if has_choices:
        of_episode["action_mask"] = state.mask
    return InfoArrays(numbers, of_shots), InfoArrays(state.varied, of_episode)


def starts_of(info: InfoArrays, max_shots: int) -> InfoArrays:
    """Returns the constant arrays of the keys of `info_arrays` at the starts of episodes."""
    first = {"first_hit": -1, "shots_left": max_shots, "player": -1, "winner": -1}  # the others are 0 or False
    first |= dict.fromkeys(MEASURES, math.inf)

    def starts(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        return {key: np.full_like(values, first.get(key, 0)) for key, values in arrays.items()}

    return InfoArrays(starts(info.numbers), starts(info.rows))


class Entries(NamedTuple):
    """The `info` of a single episode: keys with views of the first rows of their arrays."""

    numbers: list[tuple[str, NDArray[Any]]]
    rows: list[tuple[str, NDArray[Any]]]


def entries_of(*parts: InfoArrays) -> Entries:
    """Returns the entries of an episode, which change with the arrays."""
    numbers = [entry for part in parts for entry in part.numbers.items()]
    return Entries(numbers, [(key, values[0]) for part in parts for key, values in part.rows.items()])


def filled(keys: dict[str, Any], *parts: Entries) -> dict[str, Any]:
    """Returns a new dict with numbers and copies of rows; a copy of `keys`, which has all keys, is made fast."""
    info = keys.copy()
    for numbers, rows in parts:
        for key, values in numbers:
            info[key] = values[0]
        for key, values in rows:
            info[key] = values.copy()
    return info


def copied_info(*parts: InfoArrays) -> dict[str, NDArray[Any]]:
    """Returns copies of the arrays."""
    return {key: values.copy() for arrays in parts for part in arrays for key, values in part.items()}


def with_starts(info: dict[str, NDArray[Any]], mask: NDArray[np.bool_], *starts: InfoArrays) -> dict[str, NDArray[Any]]:
    """Returns the rows of `starts` in the mask, in new arrays, and those of `info` outside of it."""
    count = np.count_nonzero(mask)  # faster than `any` and `all`
    if count == 0:
        return info
    begun = copied_info(*starts)
    if count < len(mask):
        for key, values in begun.items():
            np.copyto(values, info[key], where=_rows_like(~mask, values))
    return begun


def _rows_like(mask: NDArray[np.bool_], values: NDArray[Any]) -> NDArray[np.bool_]:
    """Returns a mask (m,) with as many axes as an array (m, ...)."""
    return mask.reshape(len(mask), *(1,) * (values.ndim - 1))


def masked_info(info: dict[str, NDArray[Any]], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Returns the infos of the environments in the mask, in the format of `VectorEnv._add_info`."""
    infos = info.copy()
    if np.count_nonzero(mask) < len(mask):
        for key, values in info.items():  # False keeps the type; a product with the mask gives negative zeros
            infos[key] = np.where(_rows_like(mask, values), values, False)
    infos.update(zip(_mask_keys(tuple(info)), mask[None].repeat(len(info), axis=0), strict=True))
    return infos


@functools.cache
def _mask_keys(keys: tuple[str, ...]) -> list[str]:
    """Returns the key of the mask of each key of `info`."""
    return [f"_{key}" for key in keys]
