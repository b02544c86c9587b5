"""The state of episodes: everything that a step may read or change, as a structured array with a row for each episode.

`get_state` of an environment returns such an array. NumPy indexes, stacks, repeats and compares it like any other:

    >>> import numpy as np
    >>> from billiards_env.envs import make_env, make_vector_env
    >>> env, envs = make_env(max_shots=3), make_vector_env(4, max_shots=3)
    >>> _ = env.reset(seed=1)
    >>> _ = envs.reset()
    >>> envs.set_state(env.get_state().repeat(4))  # four branches of one position
    >>> bool((envs.positions == env.positions).all()), bool((envs.get_state() == env.get_state()).all())
    (True, True)

`envs.state` lists the fields.
"""

from __future__ import annotations

import copy
import io
import os
from collections.abc import Set
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.compile import PIC
from billiards_env.engine.shot_input import check_shot
from billiards_env.envs.arguments import Model
from billiards_env.envs.state import SAVED, EpisodeState, hashed_names, parts, scene_hash
from billiards_env.games.game_state import REPLACE, check_indices
from billiards_env.jit import streams
from billiards_env.support.checks import is_masked_array, short, short_name
from billiards_env.support.files import MAX_ARCHIVE, check_path, read_arrays, write_atomically


def checked_state(state: Any, kind: np.dtype[np.void], model: Model, count: int) -> EpisodeState:
    """Returns the rows of a state, (1,) or (count,), after a check.

    Raises:
        TypeError: If `state` is not an array that `get_state` returned.
        ValueError: If it is a state of another scene or task, has another number of rows, or holds invalid numbers.
    """
    _check_fields(state)
    rows = np.asarray(state).reshape(-1)
    if len(rows) not in (1, count):
        raise ValueError(f"state has {len(rows)} rows: expected {count}" + " or 1" * (count > 1))
    for part in parts(len(rows)):
        _check_rows(rows[part], kind, model)
    return rows


def _check_fields(state: Any) -> None:
    if not isinstance(state, (np.ndarray, np.void)) or is_masked_array(state) or state.dtype.names != SAVED:
        raise TypeError(f"state = {short(state)}: expected an array that get_state returned")


def _check_rows(rows: EpisodeState, kind: np.dtype[np.void], model: Model) -> None:
    own = {"task": short_name(model.task).encode(), "scene": scene_hash(model.scene, hashed_names(model))}
    for name, value in own.items():
        if np.count_nonzero(bad := rows[name] != value):
            other = rows[name][bad].flat[0].item()
            raise ValueError(f"state[{name!r}] = {other}: expected {value}, the {name} of the environment")
    if rows.dtype != kind:
        raise ValueError(f"state has the type {rows.dtype}: expected {kind}")
    for name in ("positions", "goals", "physics", "before_positions"):
        if np.count_nonzero(np.isfinite(rows[name])) < rows[name].size:
            raise ValueError(f"state[{name!r}] has numbers that are not finite: expected finite numbers")
    for j, (name, (low, high)) in enumerate(model.randomize.items()):
        numbers = rows["physics"][:, j]
        if not ((low <= numbers) & (numbers <= high)).all():
            expected = f"expected numbers from {low:g} to {high:g}, as in randomize"
            raise ValueError(f"state['physics'], {name} = {short(numbers)}: {expected}")
    if model.engine == PIC:  # balls that PIT has moved may overlap
        begun = rows[rows["begun"]]
        check_shot(model.scene, begun["positions"], np.zeros((len(begun), 2)), None, begun["in_play"], None)
    _check_games(rows["game"], model)
    replaceable = rows["game"]["choices"] >> REPLACE & 1 > 0
    if np.count_nonzero(replaceable):
        if not rows["before_game"].size:
            raise ValueError("state['game'] has the choice 'replace': expected no such choice without the miss rule")
        before = rows[replaceable]
        _check_games(before["before_game"], model)
        on_table = before["before_game"]["object_balls"] | 1 << before["before_game"]["cue_balls"][:, 0]
        in_play = on_table[:, None] >> np.arange(model.scene.n_balls) & 1 > 0
        check_shot(model.scene, before["before_positions"], np.zeros((len(before), 2)), None, in_play, None)
    left = rows["shots_left"]
    if not (rows["fresh"] | rows["over"] | ((left > 0) & (left <= model.max_shots))).all():
        raise ValueError(f"state['shots_left'] = {short(left)}: expected 1 to max_shots = {model.max_shots}")
    _check_streams(rows, model.is_noisy)


def _check_games(games: Any, model: Model) -> None:
    """Raises a ValueError unless the states of games have valid indices and the settings of the environment."""
    check_indices(games, model.scene.n_balls)
    for name, value in (model.setup.state_fields if model.setup else {}).items():
        if np.count_nonzero(games[name] != value):
            raise ValueError(f"state['game'], {name} = {short(games[name])}: expected {value}, as in the environment")


def _check_streams(rows: EpisodeState, noisy: bool) -> None:
    """Raises a ValueError unless each stream is seeded. The first reset seeds those that are not seeded before it."""
    before = ~rows["begun"]
    unseeded = before & (rows["stream"][:, 3] == 0) & (rows["noise_stream"][:, 3] == 0)
    for name, count, allowed in (
        ("stream", 1, unseeded),
        ("noise_stream", int(noisy), unseeded),
        ("episode_seed", 1 + noisy, before),
    ):
        seeded = streams.are_seeded(rows[name].reshape(len(rows), -1, 4)[:, :count])
        if not (seeded.all(axis=1) | allowed).all():
            expected = "a state of an environment" + " with noise" * noisy
            raise ValueError(f"state[{name!r}] is not seeded: expected {expected}")


class OfEpisodes:
    """The balls of the episodes of an environment, as copies: of episode 0, or of all m episodes with the first axis m.

    A subclass sets `_episodes`, and `_which` to the index of its episodes.
    """

    _which: Any = 0

    @property
    def positions(self: Any) -> NDArray[np.float64]:
        """(n, 2) positions of the balls, m. A potted ball is at the centre of its pocket."""
        return self._episodes.state.positions[self._which].copy()

    @property
    def potted(self: Any) -> NDArray[np.bool_]:
        """(n,) balls out of play."""
        return ~self._episodes.state.in_play[self._which]

    @property
    def goals(self: Any) -> NDArray[np.float64]:
        """(g, 2) goals, m: one in a task with a goal, none in the others."""
        return self._episodes.state.goals[self._which].copy()

    @property
    def legal_balls(self: Any) -> NDArray[np.bool_]:
        """(n,) balls that the cue ball may touch first in a run-out or a game; (0,) in other tasks."""
        return self._episodes.state.legal_balls[self._which].copy()


SPACES = {prefix + name for prefix in ("", "single_") for name in ("action_space", "observation_space")}
"""The attributes of environments that are spaces."""


def copied(env: Any, shared: Set[str], memo: dict[int, Any], **changed: Any) -> Any:
    """Returns a deep copy of an environment that shares some attributes. Others have the values in `changed`.

    The spaces have their own random numbers. Their arrays are shared.
    """
    twin, values = object.__new__(type(env)), {**vars(env), **changed}
    memo[id(env)] = twin
    for name in values.keys() - shared:
        value = values[name]
        if name in SPACES:
            space = values[name] = object.__new__(type(value))
            space.__dict__.update(value.__dict__, _np_random=streams.copied(value._np_random))
        else:
            values[name] = copy.deepcopy(value, memo)
    twin.__dict__.update(values)
    return twin


def save_state(path: str | os.PathLike[str], state: EpisodeState) -> None:
    """Writes a state to a file `.npz`, completely or not at all.

    Raises:
        OSError: If the file cannot be written.
        TypeError: If `state` is not an array that `get_state` returned.
        ValueError: If the path has another suffix, or `load_state` would refuse the file because it is too large.
    """
    target, most, content = check_path(path, ".npz"), MAX_ARCHIVE - 2**16, io.BytesIO()  # 64 KiB for the headers
    _check_fields(state)
    if state.nbytes > most:
        raise ValueError(f"state has {state.nbytes} bytes: expected at most {most}")
    np.savez_compressed(content, state=state)
    write_atomically(target, content.getvalue())


def load_state(path: str | os.PathLike[str]) -> EpisodeState:
    """Reads a state that `save_state` wrote. The file cannot run code. `set_state` checks its content.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is not a file of a state, or is larger than `files.MAX_ARCHIVE`.
    """
    state = read_arrays(path, "save_state").get("state")
    if state is None or state.dtype.names != SAVED:
        raise ValueError(f"path = {os.fspath(path)!r}: expected a file of save_state, it holds other arrays")
    return state
