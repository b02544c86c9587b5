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

The live state of m episodes is one block of memory with one array after the other (`StateArrays`). A copy of the block
is a copy of the state. The block of one episode is also its row.
"""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
from collections.abc import Iterator, Set
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.compile import PIC, cached_by_scene
from billiards_env.engine.shot_input import check_shot
from billiards_env.envs.arguments import Model
from billiards_env.envs.tasks import task_of
from billiards_env.games.game_state import REPLACE, check_indices
from billiards_env.jit import streams
from billiards_env.scene import Scene
from billiards_env.support.checks import is_masked_array, short, short_name
from billiards_env.support.files import MAX_ARCHIVE, check_path, read_arrays, write_atomically

EpisodeState = NDArray[np.void]


class StateArrays(NamedTuple):
    """The fields of a state, in order, as arrays of m episodes.

    Attributes:
        scene: (m,) uint64: a hash of the scene and of the names in `randomize`.
        stream: (m, 4) uint64: the random stream of the layouts, see `jit.streams`; 0 before it is seeded.
        noise_stream: (m, 4) uint64: the random stream of the execution noise and of the scatter; 0 without both.
        episode_seed: (m, 8) uint64: both streams before the draws of the episode, so at its start.
        positions: (m, n, 2) float64, m.
        goals: (m, g, 2) float64, m: one goal (g = 1) in the tasks with a goal, none in the others.
        physics: (m, p) float64: the numbers of `randomize`, in its order.
        before_positions: (m, n, 2) m, the positions before the last shot, in games in which a player may have it
            played again; (m, 0, 2) in others.
        game: (m,) `Game.state_type` in the tasks that are games, (m, 0) in the others.
        before_game: (m,) `Game.state_type` before the last shot, or (m, 0), as `before_positions`.
        score: (m,) int64: points of the episode; undefined if `fresh`.
        shots_left: (m,) int64: number of shots left; undefined if `fresh`.
        in_play: (m, n) bool: whether a ball is on the table.
        legal_balls: (m, n) bool in the tasks that are games, (m, 0) in the others, see `EpisodeArrays`.
        is_success: (m,) bool: whether the task is achieved; undefined if `fresh`.
        fresh: (m,) bool: whether the episode has had no shot.
        over: (m,) bool: whether the episode has ended; True before the first episode.
        begun: (m,) bool: whether there was a first episode.
        task: (m,) S24, or longer for a longer name: the name of the task, without its module.
    """

    scene: NDArray[np.uint64]
    stream: NDArray[np.uint64]
    noise_stream: NDArray[np.uint64]
    episode_seed: NDArray[np.uint64]
    positions: NDArray[np.float64]
    goals: NDArray[np.float64]
    physics: NDArray[np.float64]
    before_positions: NDArray[np.float64]
    game: NDArray[np.void]
    before_game: NDArray[np.void]
    score: NDArray[np.int64]
    shots_left: NDArray[np.int64]
    in_play: NDArray[np.bool_]
    legal_balls: NDArray[np.bool_]
    is_success: NDArray[np.bool_]
    fresh: NDArray[np.bool_]
    over: NDArray[np.bool_]
    begun: NDArray[np.bool_]
    task: NDArray[np.bytes_]


def state_type(model: Model) -> np.dtype[np.void]:
    """Returns the type of a row. The fields of 8 bytes come first, so that all arrays of a block are aligned."""
    n, task = model.scene.n_balls, task_of(model.task, model.n_players)
    is_game, game = task.is_game, task.game.state_type
    replaces = model.setup is not None and model.setup.miss
    kinds = (
        *("u8", ("u8", 4), ("u8", 4), ("u8", 8), ("f8", (n, 2)), ("f8", (1 if model.goal_radius else 0, 2))),
        *(("f8", (len(model.randomize),)), ("f8", (n if replaces else 0, 2))),
        *(game if is_game else (game, (0,)), game if replaces else (game, (0,)), "i8", "i8"),
        *(("?", (n,)), ("?", (n if is_game else 0,))),
        *("?", "?", "?", "?", ("S", max(24, len(short_name(model.task))))),
    )
    return np.dtype(list(zip(StateArrays._fields, kinds, strict=True)))


def hashed_names(model: Model) -> tuple[str, ...]:
    """Returns the texts that are part of the hash of a scene: the names in `randomize`, and the number of players."""
    return (*model.randomize, *([] if model.n_players == 1 else [f"{model.n_players} players"]))


@cached_by_scene
def scene_hash(scene: Scene, names: tuple[str, ...]) -> int:
    """Returns a hash of a scene and of the names of the numbers that vary, the same in every process."""
    text = json.dumps([scene.to_dict(), names])
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big")


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
    if (
        not isinstance(state, (np.ndarray, np.void))
        or is_masked_array(state)
        or state.dtype.names != StateArrays._fields
    ):
        raise TypeError(f"state = {short(state)}: expected an array that get_state returned")


def parts(count: int) -> Iterator[slice]:
    """Returns slices of an array of `count` rows. Each slice fits in the cache of a core."""
    return (slice(at, at + 2048) for at in range(0, count, 2048))


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
        if isinstance(value, gym.Space):
            space = values[name] = object.__new__(type(value))
            space.__dict__.update(value.__dict__, _np_random=copy.deepcopy(value._np_random))
        else:
            values[name] = copy.deepcopy(value, memo)
    twin.__dict__.update(values)  # at the end: a copy that fails owns nothing
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
    if state is None or state.dtype.names != StateArrays._fields:
        raise ValueError(f"path = {os.fspath(path)!r}: expected a file of save_state, it holds other arrays")
    return state
