"""Episodes of one environment or many: their state in arrays, and the compiled loops over them."""

from __future__ import annotations

import copy
import functools
import math
import warnings
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import MAX_EVENTS, NO_LOG, STATUS, Engine, ShotInput, Shots, run_shots_of
from billiards_env.engine.compile import varied_fields, varied_shot, vary, with_scatter
from billiards_env.engine.frozen_strike import strike_frozen
from billiards_env.engine.shots import arrays_in, row_type, start_fields
from billiards_env.envs.actions import (
    SIDE,
    action_named,
    add_noise,
    clipped,
    converted,
    converter_of,
    possible,
    shorten,
    strike_balls,
)
from billiards_env.envs.arguments import NO_OPTIONS, Model, ResetOptions, cue_ball_alone
from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.envs.info import InfoArrays, SingleInfo, info_arrays, starts_of
from billiards_env.envs.observations import Observer, Source
from billiards_env.envs.snapshots import EpisodeState, StateArrays, hashed_names, parts, scene_hash, state_type
from billiards_env.envs.tasks import judge_pot, opening_of, task_of, write_legal_balls
from billiards_env.games.game_state import REPLACE
from billiards_env.jit import Typed, address_of, entry_point, kept, kernels_of, moved, specialised, streams
from billiards_env.physics.scatter import Scatter
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.physics.strike import cue_numbers
from billiards_env.scene import Scene
from billiards_env.scene.layouts import Drawer, layout_plan
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import run_shot
from billiards_env.shots.tables import Tables
from billiards_env.support.checks import is_foreign, real, short, short_name

if TYPE_CHECKING:
    from billiards_env.games.playing import GameState, Stroke

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_NO_LOG = kept(NO_LOG)


class Episodes:
    """m episodes in arrays.

    The methods process the episodes from `begin` to `end - 1`. Several threads may call them for different episodes.

    Attributes:
        model: The arguments of the environment.
        kind: The type of a row of the state, see `envs.snapshots`.
        memory: The state of the episodes, one block.
        state: The arrays in `memory`.
        shots: The balls and, after `shoot`, the outcomes of the shots (see `engine.Shots`).
        arrays: The episodes after their last shots. Its arrays are those of `state` and `shots`, and the results.
        observer: The features of the observations.
        choices: The number of possible actions; 0 if an action is not a choice.
        actions: (m, 2) or (m, 5), the velocities or strikes of the last shots, clipped and with noise.
        mask: (m, choices) int8: 1 for the choices that are possible in the next shot.
        miscues: (m,) bool: whether the tip slipped in the last shot; False for the action "velocity".
        rewards: (m,) float64, memory for the rewards of `shoot`.
        physics: The numbers of `BilliardsEnv.randomize` by name, (m,) each: columns of the state.
        scatter: The scatter of the cushions in the last shots, or None.
        of_shots: The arrays of `info` that change with each shot.
        of_episode: Those that do not change in an episode.
        starts: Those of `of_shots` at the starts of episodes.
        recorded: The last shot of the first `n_recorded` episodes with its trajectory, by episode.
    """

    def __init__(self, count: int, model: Model, n_recorded: int = 0, memory: NDArray[np.uint8] | None = None) -> None:
        scene = model.scene
        self.model, self.n_recorded = model, n_recorded
        self.recorded: dict[int, ShotResult] = {}
        entry, setup = task_of(model.task, model.n_players), model.setup
        self._layout = Drawer(layout_plan(model.layout, scene, "" if setup is None else setup.rack))
        self._goal_layout = Drawer(layout_plan("random", cue_ball_alone(scene))) if model.goal_radius else None
        with kernels_of(f"task = {model.task!r}"):
            opening, legal = opening_of(entry, scene, model.layout, **(setup.state_fields if setup else {}))
        numbers = TaskNumbers(
            targets=model.targets,
            bits=np.left_shift(1, np.arange(scene.n_balls)),
            opening=opening,
            legal=legal,
            goal_radius=model.goal_radius,
            max_shots=model.max_shots,
            scratch_penalty=model.scratch_penalty,
        )
        self._numbers = kept(tuple(numbers))
        self._run_shots = Typed(run_shots_of(model.engine, scene.n_balls))
        self._start, self._begin, self._keep_seeds = Typed(start_shots), Typed(begin_episodes), Typed(keep_seeds)
        self._has_foreign_judge = setup is None and is_foreign(entry.judge)
        self._score: Any = Typed(scoring(entry.judge)) if setup is None else None
        self._game: Any = None
        if setup is not None:
            from billiards_env.envs.turns import GameKernels

            self._game = GameKernels(setup, model.n_numbers)
        self._limit = scene.physics.max_time or math.inf
        self._converter: Any = converter_of(model.action, scene, model.max_speed)
        self.choices = getattr(self._converter, "choices", 0)
        self._cue = tuple(cue_numbers(scene)) if action_named(model.action).has_cue else None
        self.kind = state_type(model)
        self._block_kind = block_type(self.kind, model, self.choices)
        self._allocate(np.zeros(count * self._block_kind.itemsize, np.uint8))
        source = Source(model, self.seen, numbers, self.physics)
        self.observer = Observer(model.observe, source)
        with kernels_of(f"observe = {short(self.observer.names)}"):
            self.observer.write(0, 0, self.observer.new(0))
        with kernels_of(f"task = {model.task!r}"):  # compiles
            if self._game is None:
                self._score.call(0, 0, self._numbers, self._arrays, self.rewards)
            else:
                self._game.begin(0, 0, self.state.over, self._arrays)
                self._game.score(0, 0, self._numbers, self._arrays, self.turns, self.rewards)
        self.shots.cue[:] = CUE_BALL
        if memory is None:
            state = self.state
            state.scene[:], state.task[:] = scene_hash(scene, hashed_names(model)), short_name(model.task)
            self.arrays.states[:] = opening
            state.in_play[:] = state.fresh[:] = state.over[:] = True
            for j, (low, _) in enumerate(model.randomize.values()):
                state.physics[:, j] = low
        self.starts = starts_of(self.of_shots, model.max_shots)
        self.scatter = None if model.scatter is None else Scatter(model.scatter, np.full(count, -1, np.int64))
        self._set_scene(with_scatter(varied_fields(scene, model.engine, self.physics, count), self.scatter))
        if memory is not None:
            self.undo(memory)

    def _allocate(self, block: NDArray[np.uint8], like: Episodes | None = None) -> None:
        """Sets the arrays of the episodes, which are in a block of memory; `like` has a block of the same type."""
        names = self._block_kind.names or ()
        arrays: dict[str, Any] = dict(zip(names, arrays_in(block, self._block_kind), strict=True))
        arrays["states"] = arrays["game"]
        arrays |= {name: arrays[name].reshape(-1) for name in ("states", "facts", "viewers")}
        arrays.setdefault("heights", None)
        self.state = state = StateArrays(*map(arrays.__getitem__, StateArrays._fields))
        self.shots = shots = Shots(*map(arrays.__getitem__, Shots._fields))
        self.arrays = EpisodeArrays(*map(arrays.__getitem__, EpisodeArrays._fields))
        self.miscues, self.actions, self.mask = arrays["miscues"], arrays["actions"], arrays["mask"]
        self.rewards = arrays["rewards"]
        self._block, self.memory = block, block[: len(state.over) * self.kind.itemsize]
        if like is None:
            self.arrays.viewers[:] = -1
            self._arrays, self._shots = kept(tuple(self.arrays)), kept(tuple(shots))
        else:
            distance = address_of(block) - address_of(like._block)
            self._arrays = moved(like._arrays, tuple(self.arrays), distance)
            self._shots = moved(like._shots, tuple(shots), distance)
        self._single_info = None
        self.physics = {name: state.physics[:, j] for j, name in enumerate(self.model.randomize)}
        rows = {"episode_seed": state.episode_seed.view(np.int64)} | (
            {"action_mask": self.mask} if self.choices else {}
        )
        self.of_episode = InfoArrays(self.physics, rows)
        self.of_shots = info_arrays(shots, self.arrays, self.actions, None if self._cue is None else self.miscues)
        self.turns: Any = None
        self.seen = self.arrays
        if self._game is not None:
            self.turns, self.seen = self._game.allocate(state, self.arrays)
            of_shots, of_episode = self._game.infos(self.turns, self.arrays.states)
            self.of_shots, self.of_episode = self.of_shots.joined(of_shots), self.of_episode.joined(of_episode)

    def __deepcopy__(self, memo: dict[int, Any]) -> Episodes:
        twin = object.__new__(Episodes)
        twin.__dict__.update(self.__dict__)
        twin.recorded = dict(self.recorded)
        twin._allocate(self._block.copy(), self)
        twin._copy_tables(0, len(twin.state.over))
        twin.observer = self.observer.bound(twin.seen, twin.physics)
        twin.scatter = None if self.scatter is None else self.scatter._replace(seeds=self.scatter.seeds.copy())
        if self.physics or self.scatter is not None:
            twin._set_scene(with_scatter((self._scene[0].copy(), *self._scene[1:]), twin.scatter))
        return twin

    def __reduce__(self) -> tuple[Any, ...]:
        return Episodes, (len(self.state.over), self.model, self.n_recorded, self.memory)

    @property
    def single_info(self) -> SingleInfo:
        """The `info` of a single episode."""
        if self._single_info is None:
            self._single_info = SingleInfo(self.of_shots, self.of_episode, self.starts)
        return self._single_info

    def _set_scene(self, fields: tuple[Any, ...]) -> None:
        """Sets the fields of the scene for the entry points."""
        self._scene, self._kept_scene = fields, kept(fields)

    def put(self, rows: NDArray[np.int64] | None, states: EpisodeState) -> None:
        """Replaces the state of some episodes, None for all, by the rows of `states`, one for each or one for all."""
        for part in parts(len(self.state.over) if rows is None else len(rows)):
            chosen, values = part if rows is None else rows[part], states[part] if len(states) > 1 else states
            for name, array in zip(StateArrays._fields, self.state, strict=True):
                array[chosen] = values[name]
        self._follow_state(slice(None) if rows is None else rows)

    def take(self, rows: NDArray[np.int64] | None) -> EpisodeState:
        """Returns a copy of the state of some episodes, None for all: one row for each."""
        taken = np.empty(len(self.state.over) if rows is None else len(rows), self.kind)
        for part in parts(len(taken)):
            for name, array in zip(StateArrays._fields, self.state, strict=True):
                taken[name][part] = array[part if rows is None else rows[part]]
        return taken

    def undo(self, memory: NDArray[np.uint8]) -> None:
        """Replaces the state of all episodes by a copy of `memory`."""
        self.memory[:] = memory
        self._follow_state(slice(None))

    def go_on(self, mask: Bools, over: Bools) -> None:
        """Restores the episodes in the mask (m,), which `shoot` left out; `over` (m,) has their values from before."""
        self.state.over[mask] = over[mask]
        if self.choices:
            self._write_mask(0, len(mask), mask & ~over)

    def _follow_state(self, rows: Any) -> None:
        """Sets what follows from the state of episodes: the physics of the engine, and the possible choices."""
        self.set_physics(rows, {})
        if self.turns is not None:
            self.turns.strokes[rows] = math.nan
        self._copy_tables(0, len(self.state.over))
        if self.choices:
            changed = np.zeros(len(self.mask), np.bool_)
            changed[rows] = True
            self._write_mask(0, len(changed), changed & self.state.begun & ~self.state.over)

    def restart(self, begin: int, end: int, mask: Bools, observations: Any, options: ResetOptions = NO_OPTIONS) -> None:
        """Begins new episodes in the mask (m,), and writes all observations.

        Args:
            begin: The first episode.
            end: The episode after the last one.
            mask: (m,) bool.
            observations: Out, memory from `Observer.new`.
            options: The parts of the starting states that are not drawn.

        Raises:
            ValueError: If there is no free position for a ball.
        """
        state = self.state
        if options.episode_seed is not None:
            rows = begin + np.flatnonzero(mask[begin:end])
            state.stream[rows], state.noise_stream[rows] = np.split(options.episode_seed[rows], 2, axis=1)
        self._keep_seeds.call(begin, end, mask, state.stream, state.noise_stream, state.episode_seed)
        self.draw(begin, end, mask, options)
        self.begin(begin, end, mask, observations, options.states)

    def draw(self, begin: int, end: int, mask: Bools, options: ResetOptions = NO_OPTIONS) -> None:
        """Draws positions of the balls, then goals if the task has any, then the physics of the episodes if it varies.

        Args:
            begin: The first episode.
            end: The episode after the last one.
            mask: (m,) bool, the episodes to draw for.
            options: What takes the place of the drawn positions, goals and numbers.

        Raises:
            ValueError: If there is no free position for a ball.
        """
        state = self.state
        for array, values, layout in (
            (state.positions, options.positions, self._layout),
            (state.goals, options.goals, self._goal_layout),  # the cue ball anywhere, alone on the table
        ):
            if values is not None:
                np.copyto(array[begin:end], values[begin:end], where=mask[begin:end, None, None])
            elif layout is not None:
                layout.draw(begin, end, mask, state.stream, array)
        if self.physics:
            units, rows = np.empty((end - begin, len(self.physics))), np.flatnonzero(mask[begin:end])
            draw_units(begin, end, mask, state.stream, units)
            numbers = {name: values[begin + rows] for name, values in options.physics.items()}
            self.set_physics(begin + rows, self.scaled(units[rows]) | numbers)

    def scaled(self, units: Floats) -> dict[str, Floats]:
        """Returns numbers in the ranges of the physics that varies, by name, for draws (m, p) from [0, 1)."""
        ranges = self.model.randomize.items()
        return {
            name: np.minimum(low + (high - low) * units[:, j], high) for j, (name, (low, high)) in enumerate(ranges)
        }

    def set_physics(self, rows: Any, numbers: Mapping[str, Floats]) -> None:
        """Sets numbers of the physics of episodes, for which it varies. `rows` are the numbers of the episodes."""
        for name, values in numbers.items():
            self.physics[name][rows] = values
        if self.physics:
            varied = {name: values[rows] for name, values in self.physics.items()}
            vary(self._scene[0], rows, self.model.scene, self.model.engine, varied)

    def scene_and_engine(self, k: int) -> tuple[Scene, Engine]:
        """Returns the scene and the engine of episode k."""
        return varied_shot(self.model.scene, self.model.engine, self.physics, k)

    def begin(self, begin: int, end: int, mask: Bools, observations: Any, states: NDArray[Any] | None = None) -> None:
        """Begins the episodes in the mask (m,) with the balls where they are, and writes all observations.

        `states`, (1,) or (m,) `Game.state_type`, are those of games of several players; None for the opening.
        """
        self._begin.call(begin, end, mask, self._numbers, self._arrays)
        if self._game is not None:
            if states is not None:
                rows = begin + np.flatnonzero(mask[begin:end])
                self.arrays.states[rows] = states[rows if len(states) > 1 else 0]
            self._game.begin(begin, end, mask, self._arrays)
        if self.choices:
            self._write_mask(begin, end, mask)
        self.observe(begin, end, observations)

    def observe(self, begin: int, end: int, observations: Any) -> None:
        """Writes the observations of the episodes from `begin` to `end - 1`, memory from `Observer.new`."""
        self._copy_tables(begin, end)
        self.observer.write(begin, end, observations)

    def _copy_tables(self, begin: int, end: int) -> None:
        """Copies the tables of games with two cue balls to the arrays that players observe."""
        if self.seen is not self.arrays:
            self._game.copy_tables(begin, end, self._arrays, self.seen)

    def observe_as(self, player: int, observations: Any) -> None:
        """Writes the observations of a player of games, memory from `Observer.new`."""
        arrays = self.arrays
        arrays.viewers[:] = player
        self._game.write_legal(self._arrays, len(arrays.over))
        try:
            self.observe(0, len(arrays.over), observations)
        finally:
            arrays.viewers[:] = -1
            self._game.write_legal(self._arrays, len(arrays.over))

    def game_state(self, k: int) -> GameState:
        """Returns game k of several players before its next shot."""
        from billiards_env.games.playing import GameState

        state, before = self.state, None
        if self.arrays.states[k].choices >> REPLACE & 1:
            before = GameState(state.before_positions[k].copy(), state.before_game[k].copy())
        return GameState(state.positions[k].copy(), self.arrays.states[k].copy(), before)

    def stroke(self, k: int) -> Stroke | None:
        """Returns the last stroke in game k of several players, see `BilliardsEnv.stroke`."""
        return None if self.state.fresh[k] else self._game.stroke(k, self.model, self.turns)

    def shoot(self, begin: int, end: int, actions: Floats, rewards: Floats, observations: Any) -> None:
        """Plays a shot in each episode that is not over. The others have the reward 0, and their tally does not change.

        If the call is interrupted, the state is undefined: see `undo`.

        Args:
            begin: The first episode.
            end: The episode after the last one.
            actions: (m, 2), (m, 5) or (m,), see `envs.actions`, finite. With noise it changes to those with noise.
            rewards: (m,) float64 out.
            observations: Out, memory from `Observer.new`.
        """
        model, shots, over = self.model, self.shots, self.state.over
        if self._game is not None:
            self._game.take(begin, end, actions, self._arrays, self.turns)
            actions = actions if self.choices else self.turns.strokes
        if self._converter:
            shooting = ~over if self._game is None else ~over & self._game.shoots(self.turns)
            rows = begin + np.flatnonzero(shooting[begin:end])
            velocities = converted(model.action, self._converter, actions[rows], self._tables(rows))
            actions = self.actions if self.turns is None else self.turns.strokes
            actions[rows] = velocities / model.max_speed
        if model.noise is not None:
            add_noise(begin, end, over, actions, model.noise, self.state.noise_stream)
        if self.scatter is not None:
            draw_scatter(begin, end, over | (model.scatter is None), self.state.noise_stream, self.scatter.seeds)
        self._start.call(begin, end, actions, model.max_speed, self._shots, self._arrays, self.actions)
        if shots.heights is not None:
            shots.heights[begin:end] = 0.0
        if self._cue is not None:
            starts = shots.velocities, shots.spins, shots.cue, shots.heights, self.miscues
            strike_balls(begin, end, over, actions, self._cue, starts)
        if self._cue is not None or self._game is not None:
            strike_frozen(model.scene, self._scene, start_fields(shots), begin, end)
        first = begin
        while first < end and first < self.n_recorded:
            self.recorded[first] = self._record(first)
            first += 1
        if first < end:
            self._run_shots.call(first, end, self._kept_scene, self._limit, MAX_EVENTS, self._shots, _NO_LOG)
        if self._game is None:
            self._score.call(begin, end, self._numbers, self._arrays, rewards)
        else:
            self._game.score(begin, end, self._numbers, self._arrays, self.turns, rewards)
        if self._has_foreign_judge:
            for reward in rewards[begin:end][~np.isfinite(rewards[begin:end])]:
                real(f"reward of task {model.task!r}", reward)  # raises
        self.observe(begin, end, observations)
        if self.choices:
            self._write_mask(begin, end, ~over)

    def _tables(self, rows: NDArray[np.int64]) -> Tables:
        """Returns the tables of some episodes."""
        model, arrays, on_table = self.model, self.seen, self.seen.in_play[rows]
        legal = arrays.legal_balls[rows] if arrays.legal_balls.size else np.tile(model.targets, (len(rows), 1))
        return Tables(model.scene, arrays.positions[rows], on_table, legal, model.max_speed)

    def _write_mask(self, begin: int, end: int, mask: Bools) -> None:
        """Writes which choices are possible in the episodes in the mask (m,); in those that are over, none is."""
        assert self._converter is not None
        rows = begin + np.flatnonzero(mask[begin:end])
        self.mask[begin:end] *= ~self.state.over[begin:end, None]
        self.mask[rows] = possible(self.model.action, self._converter, self._tables(rows))

    def _record(self, k: int) -> ShotResult:
        """Runs the shot of episode k as the engine does, and returns it with its trajectory."""
        shots, (scene, engine) = self.shots, self.scene_and_engine(k)
        scatter = None if self.scatter is None else self.scatter._replace(seeds=self.scatter.seeds[k : k + 1].copy())
        fields: Any = (None if array is None else array[k].copy() for array in start_fields(shots))
        start = ShotInput(*fields, limit=self._limit, scatter=scatter)
        shot = run_shot(scene, start, engine, record=True)
        for name, array in shots._asdict().items():
            if name == "in_play":
                array[k] = ~shot.potted
            elif array is not None:
                array[k] = STATUS.index(shot.status) if name == "status" else getattr(shot, name)
        return shot

    def warn_cut_off(self, k: int, before: NDArray[np.uint8]) -> None:
        """Warns the caller of `step` that the engine ended the shot of episode k at its limit.

        `before` is the memory before the step.
        """
        n_events, seconds = self.shots.n_events[k], self.shots.time[k]
        start = StateArrays(*arrays_in(before, self.kind)).positions[k].tolist()
        warnings.warn(
            f"the engine ended a shot at its limit, after {n_events} events and {seconds} s; "
            f"scene {self.scene_and_engine(k)[0].to_dict()}, positions {start}, action {self.actions[k].tolist()}",
            RuntimeWarning,
            stacklevel=3,
        )


class SpareEpisodes:
    """Arrays of copies of an environment that no longer exist. A later copy uses them and allocates none.

    Args:
        episodes: The arrays of the environment.
    """

    def __init__(self, episodes: Episodes) -> None:
        self._like, self._spare = episodes, deque[Episodes](maxlen=16)

    def __reduce__(self) -> tuple[Any, ...]:
        return SpareEpisodes, (self._like,)

    def put(self, episodes: Episodes) -> None:
        """Keeps the arrays of an environment that no longer exists, unless there are many."""
        self._spare.append(episodes)

    def take(self, memory: NDArray[np.uint8]) -> Episodes:
        """Returns arrays with a state."""
        try:
            episodes = self._spare.pop()
        except IndexError:  # also if another thread was faster
            episodes = copy.deepcopy(self._like)
        episodes.undo(memory)
        episodes.recorded.clear()
        return episodes


def block_type(state: np.dtype[np.void], model: Model, choices: int) -> np.dtype[np.void]:
    """Returns the type of a row of the arrays of `Episodes`: the state, then the rest of `Shots` and the results."""
    n, shots = model.scene.n_balls, row_type(model.scene.n_balls, model.scene.physics.flight)
    rest = [(name, shots[name]) for name in shots.names or () if name not in StateArrays._fields]
    rest += [("actions", "f8", (action_named(model.action).size,)), ("points", "i8"), ("rewards", "f8")]
    task = task_of(model.task, model.n_players)
    rest += [("facts", task.game.facts_type, () if task.is_game else (0,))]
    rest += [("viewers", "i8", () if model.n_players > 1 else (0,)), ("mask", "i1", (choices,))]
    rest += [("potted", "?", (n,)), ("scratch", "?"), ("miscues", "?")]
    after, begin = np.dtype(rest, align=True), -(-state.itemsize // 8) * 8
    fields = {name: field[:2] for name, field in (state.fields or {}).items()}
    fields |= {name: (kind, begin + at) for name, (kind, at, *_) in (after.fields or {}).items()}
    formats, offsets = zip(*fields.values(), strict=True)
    size = begin + after.itemsize
    return np.dtype({"names": [*fields], "formats": [*formats], "offsets": [*offsets], "itemsize": size})


def noise_stream(seed: int, noise_seed: int | None) -> NDArray[np.uint64]:
    """Returns the random stream of the noise, which is independent of that of the layouts with the same seed.

    A seed of -1, which Gymnasium uses for a generator of unknown seed, gives a random stream.
    """
    return streams.seeded(np.random.SeedSequence(None if seed < 0 else seed, spawn_key=noise_key(noise_seed)))


def noise_key(noise_seed: int | None) -> tuple[int, ...]:
    """Returns the key of `np.random.SeedSequence` for the noise."""
    return (0,) if noise_seed is None else (0, noise_seed)


@entry_point
def draw_units(begin, end, mask, episode_streams, units):
    """Draws numbers (end - begin, p) from [0, 1) for the episodes in the mask, each from its own stream."""
    for k in range(begin, end):
        if mask[k]:
            for j in range(units.shape[1]):
                units[k - begin, j] = streams.next_double(episode_streams[k])


@entry_point
def draw_scatter(begin, end, skip, noise_streams, seeds):
    """Draws the seeds of the scatter of shots, each from its own stream; -1 for the shots to skip."""
    for k in range(begin, end):
        seeds[k] = -1 if skip[k] else np.int64(streams.next_uint64(noise_streams[k]) >> np.uint64(1))


@entry_point
def keep_seeds(begin, end, mask, episode_streams, noise_streams, seeds):
    """Copies the random streams of the episodes in the mask, (m, 4) each, to `seeds`, (m, 8)."""
    for k in range(begin, end):
        if mask[k]:
            for i in range(4):
                seeds[k, i], seeds[k, 4 + i] = episode_streams[k, i], noise_streams[k, i]


@entry_point
def begin_episodes(begin, end, mask, numbers, arrays):
    """Begins episodes, see `Episodes.begin`."""
    numbers, arrays = TaskNumbers(*numbers), EpisodeArrays(*arrays)
    for k in range(begin, end):
        if mask[k]:
            for i in range(arrays.in_play.shape[1]):
                arrays.in_play[k, i] = True
            arrays.fresh[k], arrays.over[k] = True, False
            if len(numbers.opening):
                arrays.states[k] = numbers.opening[0]
                write_legal_balls(k, numbers.legal, arrays)


@entry_point
def start_shots(begin, end, actions, max_speed, shots, arrays, played):
    """Sets the velocities of the cue balls in the episodes with a shot, and all other velocities and spins to 0.

    Writes the actions, clipped, to `played`, (m, 2) or (m, 5); 0 in the episodes without a shot.
    """
    balls, over, states = Shots(*shots), EpisodeArrays(*arrays).over, EpisodeArrays(*arrays).states
    for k in range(begin, end):
        for i in range(balls.in_play.shape[1]):
            for c in range(2):
                balls.velocities[k, i, c] = 0.0
            for c in range(3):
                balls.spins[k, i, c] = 0.0
        if over[k]:
            for c in range(played.shape[1]):
                played[k, c] = 0.0
            continue
        cue = states[k].cue_balls[0] if len(states) else CUE_BALL
        balls.cue[k] = cue
        balls.velocities[k, cue, X], balls.velocities[k, cue, Y] = shorten(actions[k, X], actions[k, Y], max_speed)
        played[k, X], played[k, Y] = shorten(actions[k, X], actions[k, Y], 1.0)
        for c in range(SIDE, played.shape[1]):
            played[k, c] = clipped(actions, k, c)


judge = judge_pot  # `scoring` puts the kernel of each task in its place


@functools.cache
def scoring(judge: Callable[..., Any]) -> Callable[..., None]:
    """Returns `score_shots` with the kernel of a task. An environment compiles only the kernel of its task."""
    return specialised(score_shots, judge=judge)


def score_shots(begin, end, numbers, arrays, rewards):
    """Computes the rewards of the shots, see `Episodes.shoot`."""
    numbers, arrays = TaskNumbers(*numbers), EpisodeArrays(*arrays)
    for k in range(begin, end):
        for i in range(arrays.in_play.shape[1]):
            arrays.potted[k, i] = not arrays.in_play[k, i]
        rewards[k] = 0.0
        if not arrays.over[k]:
            points, decided, success = judge(k, numbers, arrays)
            scratch = arrays.potted[k, CUE_BALL]
            if arrays.fresh[k]:
                arrays.score[k], arrays.shots_left[k], arrays.is_success[k] = 0, numbers.max_shots, False
                arrays.fresh[k] = False
            arrays.points[k], arrays.scratch[k] = points, scratch
            arrays.score[k] += points
            arrays.shots_left[k] -= 1
            arrays.is_success[k] = arrays.is_success[k] or success
            arrays.over[k] = decided or arrays.shots_left[k] == 0
            rewards[k] = points - numbers.scratch_penalty if scratch else float(points)
