"""The keys of `info`: both environments return the keys of `InfoArrays`.

All values are numbers, because TorchRL cannot read infos of vector environments that contain text.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import Shots
from billiards_env.envs.episode_arrays import TALLY, EpisodeArrays


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


def info_arrays(
    shots: Shots, arrays: EpisodeArrays, actions: NDArray[np.float64], miscues: NDArray[np.bool_] | None
) -> InfoArrays:
    """Returns the arrays of the keys of `info` after the last shots. The arrays change with the episodes.

    Args:
        shots: The shots.
        arrays: The episodes.
        actions: The velocities or strikes that were played.
        miscues: Whether the tip slipped; None without a cue.
    """
    numbers = {
        "shot_time": shots.time,
        "n_events": shots.n_events,
        "status_code": shots.status,
        "first_hit": shots.first_hit,
        **{name: getattr(arrays, name) for name in TALLY},
    }
    if miscues is not None:
        numbers["miscue"] = miscues
    return InfoArrays(numbers, {"played_action": actions, "cushions": shots.cushions, "potted": arrays.potted})


def starts_of(info: InfoArrays, max_shots: int) -> InfoArrays:
    """Returns the constant arrays of the keys of `info_arrays` at the starts of episodes."""
    first = {"first_hit": -1, "shots_left": max_shots, "player": -1, "winner": -1}  # the others are 0 or False

    def starts(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        return {key: np.full_like(values, first.get(key, 0)) for key, values in arrays.items()}

    return InfoArrays(starts(info.numbers), starts(info.rows))


class SingleInfo:
    """The `info` of a single episode.

    Args:
        of_shots: The arrays of the keys that change with each shot.
        of_episode: Those of the keys that do not change in an episode.
        starts: Those of `of_shots` at the start of an episode.
    """

    def __init__(self, of_shots: InfoArrays, of_episode: InfoArrays, starts: InfoArrays) -> None:
        self._shot, self._start = _entries(of_shots, of_episode), _entries(starts._replace(numbers={}), of_episode)
        self._first = _filled({}, *_entries(starts, of_episode))

    def after_shot(self) -> dict[str, Any]:
        """Returns the `info` after the last shot, with copies of the arrays."""
        return _filled(self._first, *self._shot)

    def at_start(self) -> dict[str, Any]:
        """Returns the `info` at the start of the episode."""
        return _filled(self._first, *self._start)


_Entries = list[tuple[str, NDArray[Any]]]


def _entries(*parts: InfoArrays) -> tuple[_Entries, _Entries]:
    """Returns the arrays of the numbers, and views of the first rows of the others."""
    numbers = [entry for part in parts for entry in part.numbers.items()]
    return numbers, [(key, values[0]) for part in parts for key, values in part.rows.items()]


def _filled(first: dict[str, Any], numbers: _Entries, rows: _Entries) -> dict[str, Any]:
    """Returns a copy of a dict with the first numbers and with copies of the rows."""
    info = first.copy()  # faster than a new dict, which is resized several times
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
            np.copyto(values, info[key], where=~mask if values.ndim == 1 else ~mask[:, None])
    return begun


def masked_info(info: dict[str, NDArray[Any]], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Returns the infos of the environments in the mask, in the format of `VectorEnv._add_info`."""
    infos = info.copy()
    if np.count_nonzero(mask) < len(mask):
        for key, values in info.items():  # False keeps the type; a product with the mask gives negative zeros
            infos[key] = np.where(mask if values.ndim == 1 else mask[:, None], values, False)
    for key in info:
        infos[f"_{key}"] = mask.copy()
    return infos
