"""The state of m episodes: all their arrays, in one block of memory.

    row of episode k
    +-- saved: all that a step may read or change, what `get_state` returns -------------------------------+
    | scene  stream  noise_stream  episode_seed  positions  goals  physics  before_positions  game         |
    | before_game  measures  score  shots_left  in_play  legal_balls  is_success  fresh  over  begun  task |
    +-- the rest of a shot, see `engine.Shots`: the start, which the engine replaces by the end ------------+
    | velocities  spins  cue  heights  time  cushions  ...  first_hit_time                                 |
    +-- results of the last step -------------------------------------------------------------------------+
    | actions  points  rewards  facts  viewers  mask  potted  scratch  miscues                             |
    +------------------------------------------------------------------------------------------------------+

The block has all rows of one array, then those of the next, so each array is contiguous. The saved arrays come first:
a copy of the first bytes of a block is a copy of what a step may read or change. The block of one episode is also its
row.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import Engine, Shots
from billiards_env.engine.compile import cached_by_scene, varied_fields, varied_shot, vary, with_scatter
from billiards_env.engine.measures import measures_type
from billiards_env.engine.shots import arrays_in, row_type
from billiards_env.envs.actions import action_named
from billiards_env.envs.arguments import Model
from billiards_env.envs.episode_arrays import EpisodeArrays
from billiards_env.envs.tasks import task_of
from billiards_env.games.game_state import CALL
from billiards_env.physics.scatter import Scatter
from billiards_env.physics.state import CUE_BALL
from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult
from billiards_env.support.checks import short_name

EpisodeState = NDArray[np.void]
"""Saved rows, (m,) or (), with the fields `SAVED`."""

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Int64s = NDArray[np.int64]


class RowTypes(NamedTuple):
    """The types of a row of a `State`.

    Attributes:
        saved: That of the saved arrays.
        whole: That of all arrays, which begins with `saved`.
    """

    saved: np.dtype[np.void]
    whole: np.dtype[np.void]


SAVED = (
    *("scene", "stream", "noise_stream", "episode_seed", "positions", "goals", "physics", "before_positions", "game"),
    *("before_game", "measures", "score", "shots_left", "in_play", "legal_balls", "is_success", "fresh", "over"),
    *("begun", "task"),
)
"""The names of the saved arrays, in order."""


def row_types(model: Model, choices: int) -> RowTypes:
    """Returns the types of a row; `choices` is the number of possible actions, 0 if an action is not a choice."""
    saved, n, shot = saved_type(model), model.scene.n_balls, row_type(model.scene.n_balls, model.scene.physics.flight)
    rest = [(name, shot[name]) for name in shot.names or () if name not in SAVED]
    rest += [("actions", "f8", (action_named(model.action).size,)), ("points", "i8"), ("rewards", "f8")]
    task = task_of(model.task, model.n_players)
    rest += [("facts", task.game.facts_type, () if task.is_game else (0,))]
    rest += [("viewers", "i8", () if model.n_players > 1 else (0,)), ("mask", "i1", (choices,))]
    rest += [("potted", "?", (n,)), ("scratch", "?"), ("miscues", "?")]
    after, begin = np.dtype(rest, align=True), -(-saved.itemsize // 8) * 8
    fields = {name: field[:2] for name, field in (saved.fields or {}).items()}
    fields |= {name: (kind, begin + at) for name, (kind, at, *_) in (after.fields or {}).items()}
    formats, offsets = zip(*fields.values(), strict=True)
    size = begin + after.itemsize
    whole = np.dtype({"names": [*fields], "formats": [*formats], "offsets": [*offsets], "itemsize": size})
    return RowTypes(saved, whole)


def saved_type(model: Model) -> np.dtype[np.void]:
    """Returns the type of a saved row. The fields of 8 bytes come first, so that all arrays of a block are aligned."""
    n, task = model.scene.n_balls, task_of(model.task, model.n_players)
    is_game, game = task.is_game, task.game.state_type
    replaces = model.setup is not None and model.setup.miss
    kinds = (
        *("u8", ("u8", 4), ("u8", 4), ("u8", 8), ("f8", (n, 2)), ("f8", (1 if model.goal_radius else 0, 2))),
        *(("f8", (len(model.randomize),)), ("f8", (n if replaces else 0, 2))),
        *(game if is_game else (game, (0,)), game if replaces else (game, (0,))),
        *(measures_type(model.measures, n) or ("f8", (0,)), "i8", "i8"),
        *(("?", (n,)), ("?", (n if is_game else 0,))),
        *("?", "?", "?", "?", ("S", max(24, len(short_name(model.task))))),
    )
    return np.dtype(list(zip(SAVED, kinds, strict=True)))


_shots_of, _arrays_of = itemgetter(*Shots._fields), itemgetter(*EpisodeArrays._fields)


class State:
    """The arrays of m episodes of a model, see the module.

    Args:
        model: The arguments of the environment, which the episodes read.
        types: The types of a row.
        block: The memory of all arrays, such as from `first_block`.

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
        measures: (m,) of the last shots, see `Model.measures`; (m, 0) for none.
        score: (m,) int64: points of the episode; undefined if `fresh`.
        shots_left: (m,) int64: number of shots left; undefined if `fresh`.
        in_play: (m, n) bool: whether a ball is on the table.
        legal_balls: (m, n) bool in the tasks that are games, (m, 0) in the others, see `EpisodeArrays`.
        is_success: (m,) bool: whether the task is achieved; undefined if `fresh`.
        fresh: (m,) bool: whether the episode has had no shot.
        over: (m,) bool: whether the episode has ended; True before the first episode.
        begun: (m,) bool: whether there was a first episode.
        task: (m,) S24, or longer for a longer name: the name of the task, without its module.
        actions: (m, 2) or (m, 5), the velocities or strikes that were played, clipped and with noise.
        rewards: (m,) float64, memory for the rewards of a step.
        mask: (m, choices) int8: 1 for the choices that are possible in the next shot.
        miscues: (m,) bool: whether the tip slipped; False for the action "velocity".
        types: The types of a row.
        block: The memory of all arrays.
        memory: The memory of the saved arrays, a part of `block`.
        shots: The fields of `engine.Shots`, as a plain tuple.
        arrays: The fields of `EpisodeArrays`, as a plain tuple.
        turns: The last shots of games of several players; None in other tasks.
        strokes: (m, size): the numbers of the strokes where a part of a step changes those of the actions.
        seen: The episodes as a player observes them: `arrays`, but in a game with two cue balls the cue ball of the
            next shot is ball 0.
        varied: The columns of `physics` by name.
        fields: The fields of the scene of each episode for the engine, as a plain tuple, see `SceneArrays`.
        scatter: The scatter of the cushions in the last shots, or None.
        recorded: The last shots with their trajectories, by episode.
    """

    scene: NDArray[np.uint64]
    stream: NDArray[np.uint64]
    noise_stream: NDArray[np.uint64]
    episode_seed: NDArray[np.uint64]
    positions: Floats
    goals: Floats
    physics: Floats
    before_positions: Floats
    game: NDArray[np.void]
    before_game: NDArray[np.void]
    measures: NDArray[Any]
    score: Int64s
    shots_left: Int64s
    in_play: Bools
    legal_balls: Bools
    is_success: Bools
    fresh: Bools
    over: Bools
    begun: Bools
    task: NDArray[np.bytes_]
    velocities: Floats
    spins: Floats
    cue: Int64s
    heights: Floats
    time: Floats
    cushions: NDArray[np.int32]
    n_events: Int64s
    status: Int64s
    first_hit: Int64s
    actions: Floats
    rewards: Floats
    mask: NDArray[np.int8]
    miscues: Bools
    potted: Bools

    def __init__(self, model: Model, types: RowTypes, block: NDArray[np.uint8]) -> None:
        self.model, self.types, self.block = model, types, block
        arrays = named_arrays(block, types.whole)
        self.__dict__.update(arrays)
        self.memory = block[: len(self.over) * types.saved.itemsize]
        arrays["states"] = arrays["game"]
        arrays |= {name: arrays[name].reshape(-1) for name in ("states", "facts", "viewers")}
        arrays |= {"heights": arrays.get("heights"), "measures": arrays["measures"] if model.measures else None}
        self.shots, self.arrays = _shots_of(arrays), _arrays_of(arrays)
        self.seen = EpisodeArrays(*self.arrays)
        self.turns: TurnArrays | None = None
        self.strokes = self.actions
        if model.setup is not None:
            self.turns = turn_arrays(self, model.n_players, model.n_numbers[0])
            self.strokes = self.turns.strokes
            if len(model.setup.game_rules.cue_balls) > 1:
                names = ("positions", "in_play", "legal_balls")
                self.seen = self.seen._replace(**{name: np.zeros_like(arrays[name]) for name in names})
        self.varied = {name: self.physics[:, j] for j, name in enumerate(model.randomize)}
        m, scatter = len(self.over), model.scatter
        self.scatter = None if scatter is None else Scatter(scatter, np.full(m, -1, np.int64))
        self.fields = with_scatter(varied_fields(model.scene, model.engine, self.varied, m), self.scatter)
        self.recorded: dict[int, ShotResult] = {}

    def copy(self) -> State:
        """Returns a state with its own arrays."""
        twin = State(self.model, self.types, self.block.copy())
        twin.recorded = dict(self.recorded)
        return twin

    def put(self, rows: Int64s | None, states: EpisodeState) -> None:
        """Replaces some rows, None for all, by `states`, one for each or one for all."""
        for part in parts(len(self.over) if rows is None else len(rows)):
            chosen, values = part if rows is None else rows[part], states[part] if len(states) > 1 else states
            for name in SAVED:
                getattr(self, name)[chosen] = values[name]

    def take(self, rows: Int64s | None) -> EpisodeState:
        """Returns a copy of some rows, None for all."""
        taken = np.empty(len(self.over) if rows is None else len(rows), self.types.saved)
        for part in parts(len(taken)):
            for name in SAVED:
                taken[name][part] = getattr(self, name)[part if rows is None else rows[part]]
        return taken

    def set_physics(self, rows: Any, numbers: Mapping[str, Floats]) -> None:
        """Sets numbers of the physics of episodes, for which it varies. `rows` are the numbers of the episodes."""
        for name, values in numbers.items():
            self.varied[name][rows] = values
        if self.varied:
            varied = {name: values[rows] for name, values in self.varied.items()}
            vary(self.fields[0], rows, self.model.scene, self.model.engine, varied)

    def scene_and_engine(self, k: int) -> tuple[Scene, Engine]:
        """Returns the scene and the engine of episode k."""
        return varied_shot(self.model.scene, self.model.engine, self.varied, k)


def named_arrays(block: NDArray[np.uint8], kind: np.dtype[np.void]) -> dict[str, Any]:
    """Returns the arrays in a block of memory by name, see `arrays_in`."""
    if len(block) == kind.itemsize:
        row = np.ndarray(1, kind, block)
        return {name: row[name] for name in kind.names or ()}
    return dict(zip(kind.names or (), arrays_in(block, kind), strict=True))


def first_block(model: Model, types: RowTypes, count: int, opening: NDArray[Any]) -> NDArray[np.uint8]:
    """Returns the memory of episodes before their first reset; `opening` is that of `TaskNumbers`."""
    block = np.zeros(count * types.whole.itemsize, np.uint8)
    arrays = named_arrays(block, types.whole)
    arrays["scene"][:], arrays["task"][:] = scene_hash(model.scene, hashed_names(model)), short_name(model.task)
    arrays["game"].reshape(-1)[:] = opening
    arrays["cue"][:], arrays["viewers"][:] = CUE_BALL, -1
    for name in "in_play", "fresh", "over":
        arrays[name][:] = True
    for j, (low, _) in enumerate(model.randomize.values()):
        arrays["physics"][:, j] = low
    return block


class TurnArrays(NamedTuple):
    """The last shots of m games of p players.

    Attributes:
        calls: (m,) `games.CALL` of the shots.
        strokes: (m, size) float64, the numbers of the actions that describe the shots; zeros for a call without a shot,
            and NaN if the last shot is not known.
        places: (m, 2) float64, m: where the player placed a cue ball in hand; NaN if it was not in hand.
        player: (m,) int64, the player of the shot.
        next_player: (m,) int64, the player of the next shot.
        foul: (m,) int64, index in `games.FOULS`.
        winner: (m,) int64, the player who has won, or -1.
        scores: (m, p) int64, the score of each player.
        rewards: (m, p) float64, the rewards of all players.
        spotted: (m, n) bool, the balls that return to the table.
        before_positions: (m, n, 2) m, the positions before the last shot, if players may have a shot played again (the
            call "replace"); else (m, 0, 2).
        before_states: (m,) `Game.state_type` before the last shot, or (0,).
    """

    calls: Any
    strokes: Any
    places: Any
    player: Any
    next_player: Any
    foul: Any
    winner: Any
    scores: Any
    rewards: Any
    spotted: Any
    before_positions: Any
    before_states: Any


def turn_arrays(state: State, players: int, size: int) -> TurnArrays:
    """Returns the arrays of the games of a state, before the first shot; `size` numbers describe a shot."""
    count, n = state.in_play.shape
    whole = np.zeros((4, count), np.int64)
    return TurnArrays(
        calls=np.zeros(count, CALL),
        strokes=np.full((count, size), np.nan),
        places=np.full((count, 2), np.nan),
        player=whole[0],
        next_player=whole[1],
        foul=whole[2],
        winner=whole[3],
        scores=np.zeros((count, players), np.int64),
        rewards=np.zeros((count, players)),
        spotted=np.zeros((count, n), np.bool_),
        before_positions=state.before_positions,
        before_states=state.before_game.reshape(-1),
    )


def parts(count: int) -> Iterator[slice]:
    """Returns slices of an array of `count` rows. Each slice fits in the cache of a core."""
    return (slice(at, at + 2048) for at in range(0, count, 2048))


def hashed_names(model: Model) -> tuple[str, ...]:
    """Returns the texts that are part of the hash of a scene: the names in `randomize`, and the number of players."""
    return (*model.randomize, *([] if model.n_players == 1 else [f"{model.n_players} players"]))


@cached_by_scene
def scene_hash(scene: Scene, names: tuple[str, ...]) -> int:
    """Returns a hash of a scene and of the names of the numbers that vary, the same in every process."""
    text = json.dumps([scene.to_dict(), names])
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big")
