"""The keys of `info`: both environments return the keys of `InfoArrays`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import STATUS
from billiards_env.envs.arrays import TALLY
from billiards_env.envs.episodes import Episodes

_STATUS = np.array(STATUS, dtype=object)
_NOTHING = np.array(None, dtype=object)


class InfoArrays(NamedTuple):
    """The arrays of the keys of `info`, with one entry per episode.

    Attributes:
        numbers: The keys with a number, (m,). That of "status" is an index into `STATUS`.
        rows: The keys with an array, (m, n).
        physics: Those of the keys with a number that `reset` returns, too: the numbers that each episode draws.
    """

    numbers: dict[str, NDArray[Any]]
    rows: dict[str, NDArray[Any]]
    physics: dict[str, NDArray[Any]]


def info_arrays(episodes: Episodes) -> InfoArrays:
    """Returns the arrays of the keys of `info`, which change with the episodes."""
    shots, arrays = episodes.shots, episodes.arrays
    numbers = {
        "shot_time": shots.time,
        "n_events": shots.n_events,
        "status": shots.status,
        "first_hit": shots.first_hit,
        **{name: getattr(arrays, name) for name in TALLY},
        **episodes.physics,
    }
    if episodes.env.action == "strike":
        numbers["miscue"] = episodes.miscues
    rows = {"cushions": shots.cushions, "potted": arrays.potted}
    return InfoArrays(numbers, rows, episodes.physics)


def single_info(arrays: InfoArrays) -> dict[str, Any]:
    """Returns the `info` of a single episode."""
    info = {key: values.item() for key, values in arrays.numbers.items()}
    info["status"] = STATUS[info["status"]]
    for key, values in arrays.rows.items():
        info[key] = values[0].copy()
    return info


def single_physics(arrays: InfoArrays) -> dict[str, float]:
    """Returns the `info` of the reset of a single episode."""
    return {key: values.item() for key, values in arrays.physics.items()}


def copied_info(arrays: InfoArrays) -> dict[str, NDArray[Any]]:
    """Returns copies of the arrays, with the names of the status."""
    info = {key: values.copy() for key, values in (arrays.numbers | arrays.rows).items()}
    return {**info, "status": _STATUS[info["status"]]}


def copied_physics(arrays: InfoArrays) -> dict[str, NDArray[Any]]:
    """Returns copies of the arrays of the physics."""
    return {key: values.copy() for key, values in arrays.physics.items()}


def masked_info(info: dict[str, NDArray[Any]], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Returns the infos of the environments in the mask, in the format of `VectorEnv._add_info`."""
    if not mask.any():
        return {}
    everywhere = mask.all()
    infos: dict[str, Any] = {}
    for (key, values), copy in zip(info.items(), np.repeat(mask[None], len(info), axis=0), strict=True):
        if everywhere:
            infos[key] = values
        elif values.dtype == object:
            infos[key] = np.where(mask, values, _NOTHING)
        else:
            infos[key] = values * (mask if values.ndim == 1 else mask[:, None])
        infos[f"_{key}"] = copy
    return infos
