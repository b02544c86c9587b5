"""Episodes of one environment or many: a model, a state, a reset and a step.

The arguments of the environment (`Model`) do not change. The `State` has all arrays. A `Reset` begins episodes, and a
`Step` plays a shot in each. Copies share the model, the reset and the step.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.envs.actions import action_named, converter_of
from billiards_env.envs.arguments import NO_OPTIONS, Model, ResetOptions
from billiards_env.envs.info import entries_of, filled, info_arrays, starts_of
from billiards_env.envs.observations import Observer, Source
from billiards_env.envs.reset import Reset
from billiards_env.envs.state import EpisodeState, State, first_block, named_arrays, row_types
from billiards_env.envs.step import step_of
from billiards_env.envs.tasks import task_numbers
from billiards_env.games.game_state import REPLACE
from billiards_env.jit import kernels_of
from billiards_env.support.checks import short

if TYPE_CHECKING:
    from billiards_env.games.playing import GameState, Stroke

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Episodes:
    """m episodes.

    The methods process the episodes from `begin` to `end - 1`. Several threads may call them for different episodes.

    Attributes:
        model: The arguments of the environment.
        state: The arrays.
        reset: Begins episodes.
        step: The parts of a step.
        quiet_step: Those without noise and scatter.
        observer: The features of the observations.
        choices: The number of possible actions; 0 if an action is not a choice.
        of_shots: The arrays of `info` that change with each shot.
        of_episode: Those that do not change in an episode.
        starts: Those of `of_shots` at the starts of episodes.
    """

    def __init__(self, count: int, model: Model, n_recorded: int = 0, memory: NDArray[np.uint8] | None = None) -> None:
        self.model, self._n_recorded, self._game = model, n_recorded, None
        with kernels_of(f"task = {model.task!r}"):
            numbers = task_numbers(model)
        if model.setup is not None:
            from billiards_env.envs.turns import GameKernels

            self._game = GameKernels(model, numbers)
        converter = converter_of(model.action, model.scene, model.max_speed)
        self.choices: int = getattr(converter, "choices", 0)
        self._has_cue = action_named(model.action).has_cue
        self.reset = Reset(model, numbers, self._game)
        self.step = step_of(model, numbers, converter, self._game, n_recorded)
        self.quiet_step = step_of(model, numbers, converter, self._game, n_recorded, is_noisy=False)
        types = row_types(model, self.choices)
        self.state = state = State(model, types, first_block(model, types, count, numbers.opening))
        self.observer = Observer(model.observe, Source(model, state.seen, numbers, state.varied))
        with kernels_of(f"observe = {short(self.observer.names)}"):  # compiles
            self.observer.write(0, 0, self.observer.new(0))
        with kernels_of(f"task = {model.task!r}"):
            self.reset.begin(state, 0, 0, state.over)
            for part in self.step.judge:
                part(state, 0, 0, state.rewards)
        self._set_info()
        self.starts = starts_of(self.of_shots, model.max_shots)
        self._of_start, self._keys = entries_of(self.starts), filled({}, self._of_shot)
        if memory is not None:
            self.undo(memory)

    def _set_info(self) -> None:
        state = self.state
        self.of_shots, self.of_episode = info_arrays(state, self._has_cue, self.choices > 0)
        if self._game is not None:
            of_shots, of_episode = self._game.infos(state)
            self.of_shots, self.of_episode = self.of_shots.joined(of_shots), self.of_episode.joined(of_episode)
        self._of_shot, self._of_episode = entries_of(self.of_shots, self.of_episode), entries_of(self.of_episode)

    def __deepcopy__(self, memo: dict[int, Any]) -> Episodes:
        twin = object.__new__(Episodes)
        twin.__dict__.update(self.__dict__, state=self.state.copy())
        for part in twin.step.observe:
            part(twin.state, 0, len(twin.state.over))
        twin.observer = self.observer.bound(twin.state.seen, twin.state.varied)
        twin._set_info()
        return twin

    def __reduce__(self) -> tuple[Any, ...]:
        return Episodes, (len(self.state.over), self.model, self._n_recorded, self.state.memory)

    def info_at_start(self) -> dict[str, Any]:
        """Returns the `info` of a single episode after a reset."""
        return filled(self._keys, self._of_start, self._of_episode)

    def info_after_shot(self) -> dict[str, Any]:
        """Returns the `info` of a single episode after a shot."""
        return filled(self._keys, self._of_shot)

    def put(self, rows: NDArray[np.int64] | None, states: EpisodeState) -> None:
        """Replaces the state of some episodes, None for all, by the rows of `states`, one for each or one for all."""
        self.state.put(rows, states)
        self._follow_state(slice(None) if rows is None else rows)

    def undo(self, memory: NDArray[np.uint8]) -> None:
        """Replaces the state of all episodes by a copy of `State.memory`."""
        self.state.memory[:] = memory
        self._follow_state(slice(None))

    def go_on(self, mask: Bools, over: Bools) -> None:
        """Restores the episodes in the mask (m,), which `shoot` left out; `over` (m,) has their values from before."""
        self.state.over[mask] = over[mask]
        self._write_choices(0, len(mask), mask & ~over)

    def _follow_state(self, rows: Any) -> None:
        """Sets what follows from the saved arrays of episodes."""
        state = self.state
        state.set_physics(rows, {})
        if state.turns is not None:
            state.turns.strokes[rows] = np.nan
        for part in self.step.observe:
            part(state, 0, len(state.over))
        changed = np.zeros(len(state.over), np.bool_)
        changed[rows] = True
        self._write_choices(0, len(changed), changed & state.begun & ~state.over)

    def _write_choices(self, begin: int, end: int, mask: Bools) -> None:
        """Writes which actions are possible in the episodes in the mask (m,)."""
        for part in self.step.choices:
            part(self.state, begin, end, mask)

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
        self.reset.draw(self.state, begin, end, mask, options)
        self.begin(begin, end, mask, observations, options.states)

    def begin(self, begin: int, end: int, mask: Bools, observations: Any, states: NDArray[Any] | None = None) -> None:
        """Begins the episodes in the mask (m,) with the balls where they are, and writes all observations.

        `states` are as in `Reset.begin`.
        """
        self.reset.begin(self.state, begin, end, mask, states)
        self._write_choices(begin, end, mask)
        self.observe(begin, end, observations)

    def shoot(
        self, begin: int, end: int, actions: Floats, rewards: Floats, observations: Any, is_noisy: bool = True
    ) -> None:
        """Plays a shot in each episode that is not over. The others have the reward 0, and their tally does not change.

        If the call is interrupted, the state is undefined: see `undo`.

        Args:
            begin: The first episode.
            end: The episode after the last one.
            actions: (m, 2), (m, 5) or (m,), see `envs.actions`, finite. With noise it changes to those with noise.
            rewards: (m,) float64 out.
            observations: Out, memory from `Observer.new`.
            is_noisy: Whether noise and scatter are drawn.
        """
        state, step, strokes = self.state, self.step if is_noisy else self.quiet_step, actions
        for part in step.strokes:
            strokes = part(state, begin, end, strokes)
        for part in step.play:
            part(state, begin, end, strokes)
        for part in step.judge:
            part(state, begin, end, rewards)
        self.observe(begin, end, observations)
        for part in step.choices:
            part(state, begin, end, ~state.over)

    def observe(self, begin: int, end: int, observations: Any) -> None:
        """Writes the observations of the episodes from `begin` to `end - 1`, memory from `Observer.new`."""
        for part in self.step.observe:
            part(self.state, begin, end)
        self.observer.write(begin, end, observations)

    def observe_as(self, player: int, observations: Any) -> None:
        """Writes the observations of a player of games, memory from `Observer.new`."""
        assert self._game is not None
        viewers, count = self.state.seen.viewers, len(self.state.over)
        viewers[:] = player
        self._game.write_legal(self.state)
        try:
            self.observe(0, count, observations)
        finally:
            viewers[:] = -1
            self._game.write_legal(self.state)

    def game_state(self, k: int) -> GameState:
        """Returns game k of several players before its next shot."""
        from billiards_env.games.playing import GameState

        state, game, before = self.state, self.state.seen.states[k], None
        if game.choices >> REPLACE & 1:
            before = GameState(state.before_positions[k].copy(), state.before_game[k].copy())
        return GameState(state.positions[k].copy(), game.copy(), before)

    def stroke(self, k: int) -> Stroke | None:
        """Returns the last stroke in game k of several players, see `BilliardsEnv.stroke`."""
        assert self._game is not None
        return None if self.state.fresh[k] else self._game.stroke(self.state, k)

    def warn_cut_off(self, k: int, before: NDArray[np.uint8]) -> None:
        """Warns the caller of `step` that the engine ended the shot of episode k at its limit.

        `before` is the memory before the step.
        """
        state = self.state
        saved = named_arrays(before, state.types.saved)
        warnings.warn(
            f"the engine ended a shot at its limit, after {state.n_events[k]} events and {state.time[k]} s; "
            f"scene {state.scene_and_engine(k)[0].to_dict()}, positions {saved['positions'][k].tolist()}, "
            f"action {state.actions[k].tolist()}",
            RuntimeWarning,
            stacklevel=3,
        )
