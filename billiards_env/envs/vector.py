"""The vector environment of `Billiards-v0`, which plays all shots of a step in compiled code on several threads."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from billiards_env.doors import load
from billiards_env.engine import parallel_for
from billiards_env.engine.shots import AT_EVENT_LIMIT
from billiards_env.envs.arguments import Model, OfArguments, check_options, fixed, json_spec, model_of
from billiards_env.envs.billiards import FPS, RENDER_MODES, BilliardsEnv
from billiards_env.envs.episodes import Episodes
from billiards_env.envs.info import copied_info, masked_info, with_starts
from billiards_env.envs.observations import nth
from billiards_env.envs.reset import noise_key, noise_stream
from billiards_env.envs.snapshots import SPACES, OfEpisodes, checked_state, copied
from billiards_env.envs.state import EpisodeState
from billiards_env.envs.trials import Outcomes, Trials
from billiards_env.jit import streams
from billiards_env.support.checks import integer, one_of, shaped, short, suggestion

Bools = NDArray[np.bool_]

_OF_EACH = {"positions", "potted", "goals", "legal_balls", "np_random", "np_random_seed"}
"""The attributes of `BilliardsVectorEnv` with one entry per environment."""


@functools.cache
def warn_of_wrong_returns() -> None:
    """Warns once if the installed Gymnasium records wrong returns with the mode "SameStep"."""
    if tuple(map(int, gym.__version__.split(".")[:2])) < (1, 4):
        warnings.warn(
            f"Gymnasium {gym.__version__}: RecordEpisodeStatistics and NormalizeReward return wrong numbers with the "
            'autoreset mode "SameStep". Install Gymnasium 1.4 or later. RecordEpisodeStatistics is also right with '
            'autoreset_mode="NextStep".',
            stacklevel=3,
        )


class BilliardsVectorEnv(OfEpisodes, OfArguments, VectorEnv[Any, Any, NDArray[Any]]):
    """A vector of `BilliardsEnv` that plays all shots of a step in compiled code on several threads.

    `gym.make_vec("Billiards-v0", num_envs)` returns this environment. Its results, including the infos, equal those of
    Gymnasium's `SyncVectorEnv` with `num_envs` environments of the class `BilliardsEnv` and the same autoreset mode,
    bit for bit. Only the type of `scratch`, `is_success` and `miscue` differs: `SyncVectorEnv` returns these bools as
    objects. Stable-Baselines3 needs the adapter `billiards_env.sb3.SameStepVecEnv(envs)`.

    ## Reset

    `reset(seed=7)` seeds environment i with `7 + i`. A list of seeds contains one seed per environment. Each
    environment plays the same episodes as a `BilliardsEnv` with the same seed.

    `reset` has these options:

    | Option         | Shape              | Description                                                           |
    |----------------|--------------------|-----------------------------------------------------------------------|
    | `positions`    | `(num_envs, n, 2)` | positions of the balls, in metres from the centre of the table        |
    | `goal`         | `(num_envs, 2)`    | goals of tasks with a goal, in metres from the centre of the table    |
    | `physics`      | `(num_envs,)` each | numbers of `randomize` by name                                        |
    | `state`        | mapping            | the state of all games, see `games.custom_opening`                    |
    | `episode_seed` | `(num_envs, 8)`    | seeds of earlier episodes, as in `infos`, which begin again           |
    | `reset_mask`   | `(num_envs,)` bool | the environments to reset; the others continue their episodes         |

    Positions `(n, 2)`, a goal `(2,)` or one number of `physics` apply to all environments.

    ## Autoreset

    `autoreset_mode` is one of Gymnasium's modes. It determines what happens after the end of an episode:

    - `"SameStep"` (the default): the same `step` resets the environment and returns the first observation of the new
      episode. The last observation and info of the old episode are in `infos["final_obs"]` and `infos["final_info"]`.
    - `"NextStep"`: the next `step` ignores the action of the environment and resets it. The reward of this step is 0.
    - `"Disabled"`: the environment has to be reset with `reset_mask` before the next `step`.

    The default of Gymnasium's own vector environments is `"NextStep"`. In this mode every second step of an environment
    with `max_shots=1` is a reset, which plays no shot, and a training loop has to leave these steps out. Not all of
    Gymnasium's wrappers work with `"SameStep"`; the documentation has a table (Gotchas, Autoreset).

    ## Arguments

    ```python
    >>> import gymnasium as gym
    >>> envs = gym.make_vec("billiards_env:Billiards-v0", num_envs=3)
    >>> observations, infos = envs.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    >>> observations.shape, infos["final_info"]["status_code"].tolist()
    ((3, 4), [0, 0, 0])

    ```

    | Argument         | Type                 | Default      | Description                                          |
    |------------------|----------------------|--------------|------------------------------------------------------|
    | `num_envs`       | int                  | `1`          | number of environments                               |
    | `autoreset_mode` | str or AutoresetMode | `"SameStep"` | what happens after the end of an episode             |
    | `threads`        | int or None          | `None`       | threads; None for the number of `set_num_threads`    |

    `gym.make_vec` and `make_vector_env` have these arguments and the arguments of `BilliardsEnv`, which apply to every
    environment. The constructor takes a `Model` from `make_model` in place of the arguments of `BilliardsEnv`.

    ## Rendering

    The render modes are as in `BilliardsEnv`. `render()` returns a tuple with one item for each environment: the
    result of `BilliardsEnv.render()`. Gymnasium's wrappers `gymnasium.wrappers.vector.RecordVideo` and `HumanRendering`
    combine the frames of the mode `"rgb_array"`. In the mode `"human"` a window shows the first environment.

    Attributes:
        single_env: A `BilliardsEnv` with the same arguments. It holds their checked values and is never stepped.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": list(RENDER_MODES),
        "render_fps": FPS,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }
    _which = slice(None)
    _spec = None
    spec = json_spec
    num_envs: int = fixed()
    autoreset_mode: AutoresetMode = fixed()
    single_env: BilliardsEnv = fixed()
    _renderer: Any = None  # Gymnasium closes an environment even if its construction failed

    def __init__(
        self,
        num_envs: int,
        model: Model,
        autoreset_mode: str | AutoresetMode = AutoresetMode.SAME_STEP,
        threads: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.num_envs = integer("num_envs", num_envs, "num_envs")
        if not isinstance(autoreset_mode, AutoresetMode):
            one_of("autoreset_mode", autoreset_mode, tuple(mode.value for mode in AutoresetMode))
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            warn_of_wrong_returns()
        self.threads = None if threads is None else integer("threads", threads, "threads")
        self.single_env = env = BilliardsEnv(model, render_mode)
        self._set_arguments({name: getattr(env, name) for name in model.arguments})
        self.render_mode = render_mode
        self._renderer = None if render_mode is None else load("render_mode")(model.scene, render_mode, self.num_envs)
        self.metadata = {**BilliardsVectorEnv.metadata, **env.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space = env.observation_space
        self.single_action_space = env.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._actions_shape = self.num_envs, *env._action_shape

        self._n_shown = 0 if self._renderer is None else self._renderer.n_shown
        self._episodes = Episodes(self.num_envs, model, self._n_shown)
        self._trials = Trials(model, env._action_shape)
        self._seeds = np.full(self.num_envs, -1, object)  # -1: not known
        self._shared = {*vars(self), "_shared", "_spec"} - {
            "single_env",
            "_episodes",
            "_renderer",
            "_seeds",
            *SPACES,
        }

    def __repr__(self) -> str:
        return f"BilliardsVectorEnv({self.num_envs} environments, {self.single_env.model.summary})"

    def __deepcopy__(self, memo: dict[int, Any]) -> BilliardsVectorEnv:
        """Returns a copy that continues with the same bits. It shares what does not change, such as the scene."""
        return copied(self, self._shared, memo)

    def get_state(self, rows: Any = None) -> EpisodeState:
        """Returns the states of environments: all that a step may read or change.

        Args:
            rows: The environments, an index for an array (num_envs,), such as a list of numbers; None for all.

        Returns:
            A structured array with one row for each environment, see `envs.snapshots`.

        Raises:
            ValueError: If there is no such environment.
        """
        return self._episodes.state.take(self._rows(rows))

    def set_state(self, state: EpisodeState, rows: Any = None) -> None:
        """Sets the states of environments, which continue from them bit for bit.

        Args:
            state: One row for each of the environments, or one row for all, such as from `get_state` of this or of a
                single environment with the same scene and task.
            rows: The environments, see `get_state`.

        Raises:
            TypeError: If `state` is not an array that `get_state` returned.
            ValueError: If it is of another scene or task, has another number of rows, or holds invalid numbers.
        """
        chosen, episodes = self._rows(rows), self._episodes
        count = self.num_envs if chosen is None else len(chosen)
        episodes.put(chosen, checked_state(state, episodes.state.types.saved, episodes.model, count))
        self._seeds[... if chosen is None else chosen] = -1
        self._draw_layouts()

    def try_actions(
        self, actions: ArrayLike, states: EpisodeState | None = None, noise: np.random.Generator | None = None
    ) -> Outcomes:
        """Plays a shot for each action, and does not change the environments.

        Args:
            actions: (m, 2), (m, 5) or (m,), as in `step`.
            states: The states to play from, one for each action or one for all, as from `get_state`. None for the
                present states, with k actions for each environment: first those of environment 0, then of 1 and so on.
            noise: The generator from which the execution noise and the scatter of the environment are drawn; None for
                neither. The next step draws others.

        Raises:
            ResetNeeded: If an episode has not begun, or is over.
            TypeError: As in `set_state`.
            ValueError: As in `set_state`, or if the actions have another shape or a number is not finite.
        """
        return self._trials.try_actions(actions, self.get_state(), states, noise, self.threads)

    def _rows(self, rows: Any) -> NDArray[np.int64] | None:
        """Returns the numbers of environments after a check, None for all."""
        if rows is None:
            return None
        try:
            return np.arange(self.num_envs)[rows].reshape(-1)
        except (IndexError, ValueError) as error:  # a ValueError for lists of several lengths
            raise ValueError(f"rows = {short(rows)}: expected numbers of environments ({error})") from None

    def _draw_layouts(self) -> None:
        """Draws the balls of the environments that are shown, without their shots."""
        if self._renderer is not None:
            self._renderer.begin(self._episodes)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The seed of each environment. An environment that was not seeded gets a random seed."""
        self._seed_unseeded()
        return tuple(self._seeds.tolist())

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """A copy of each environment's random generator in its present state."""
        self._seed_unseeded()
        return tuple(map(streams.generator, self._episodes.state.stream))

    @property
    def action_masks(self) -> Callable[[], Bools]:
        """A method that returns the possible plans of each environment, (num_envs, choices), see `BilliardsEnv`."""
        _ = self.single_env.action_masks  # raises if there is none
        return lambda: self._episodes.state.mask.astype(np.bool_)

    def decode(self, observations: Any) -> dict[str, Any]:
        """Returns the features of observations (..., size) by name, see `observations.decode`."""
        return self.single_env.decode(observations)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Returns an attribute of each environment, as `SyncVectorEnv.get_attr` does.

        Raises:
            AttributeError: If a `BilliardsEnv` has no such attribute.
        """
        if name == "episode_scene":
            return tuple(self._episodes.state.scene_and_engine(k)[0] for k in range(self.num_envs))
        if name in _OF_EACH:
            return tuple(getattr(self, name))
        if name in ("game", "stroke"):
            _ = getattr(self.single_env, name)  # raises if there is one player
            of_one = self._episodes.game_state if name == "game" else self._episodes.stroke
            return tuple(map(of_one, range(self.num_envs)))
        if name == "action_masks":
            masks = self.action_masks
            return tuple(lambda k=k: masks()[k] for k in range(self.num_envs))
        return (getattr(self.single_env, name),) * self.num_envs

    def set_attr(self, name: str, values: Any) -> None:
        """Sets an attribute of all environments.

        Args:
            name: The name of an attribute of `BilliardsEnv`.
            values: A value, or a list or tuple with the same value for each environment, because they are one object.

        Raises:
            AttributeError: If a `BilliardsEnv` has no such attribute, or only the constructor or the episodes set it,
                such as `max_speed` and `positions`.
            ValueError: If the values differ.
        """
        values = list(values) if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(values) != self.num_envs or any(value is not values[0] for value in values):
            raise ValueError(f"{name} = {short(values)}: expected one value for all {self.num_envs} environments")
        what = f"{name} = {short(values[0])}: expected"
        declared = getattr(BilliardsEnv, name, None)
        if name in _OF_EACH or (isinstance(declared, property) and declared.fset is None):
            raise AttributeError(f"{what} no change; use the seed or the options of reset, or set_state")
        if not hasattr(self.single_env, name):
            raise AttributeError(f"{what} an attribute of BilliardsEnv{suggestion(name, [*vars(OfArguments)])}")
        setattr(self.single_env, name, values[0])

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Returns the results of a method of each environment, or the values of an attribute, as in `SyncVectorEnv`.

        Raises:
            ValueError: If the method changes an environment.
        """
        if name in ("reset", "step", "close", "set_state", "set_wrapper_attr"):
            raise ValueError(f"call({name!r}): expected the method of the vector environment, or set_attr")
        if name == "get_state":
            return tuple(np.asarray(row) for row in self.get_state())
        if name == "action_masks":
            return tuple(self.action_masks())
        if name == "observe_as":
            self.single_env.observe_as(*args, **kwargs)  # raises if there is no such player
            observations = self._episodes.observer.new(self.num_envs)
            self._episodes.observe_as(*args, **kwargs, observations=observations)
            return tuple(nth(observations, k) for k in range(self.num_envs))
        if name == "render":
            return self.render() or (None,) * self.num_envs
        if name == "get_wrapper_attr":
            return self.get_attr(*args, **kwargs)
        if not callable(method := getattr(self.single_env, name)):
            return self.get_attr(name)
        return (method(*args, **kwargs),) * self.num_envs

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins an episode in every environment, or in those of a mask.

        Args:
            seed: Seed of the first environment, from which environment i gets `seed + i`, or a sequence with one seed
                per environment. None leaves the random streams as they are.
            options: None or a dict with any of the options of the class. Environments outside the mask are neither
                reset nor seeded.

        Returns:
            (num_envs, size) observations of all environments, and the infos of those that are reset.

        Raises:
            ValueError: If a seed or an option is wrong, or a position or a goal is invalid.
            TypeError: If the options are not a mapping or the mask is not a bool array.
            ResetNeeded: If environments outside the mask were never reset.
        """
        seeds = self._checked_seeds(seed)
        mask = np.ones(self.num_envs, np.bool_)
        if isinstance(options, dict) and "reset_mask" in options:
            mask = _checked_mask("options['reset_mask']", options["reset_mask"], self.num_envs)
            options = {key: value for key, value in options.items() if key != "reset_mask"}
        episodes, state = self._episodes, self._episodes.state
        checked = check_options(episodes.model, options, mask)
        if not (state.begun | mask).all():
            raise ResetNeeded(
                "reset_mask leaves out environments that have never been reset: reset all environments first"
            )
        if seeds is not None:
            self._seed_rows([i for i in np.flatnonzero(mask).tolist() if seeds[i] is not None], seeds)
        if not state.begun.all():
            self._seed_unseeded()
        observations = episodes.observer.new(self.num_envs)

        def work(begin: int, end: int) -> None:
            episodes.restart(begin, end, mask, observations, checked)

        state.begun[mask] = False  # an interrupted reset has to be repeated
        parallel_for(work, self.num_envs, self.threads)
        state.begun[mask] = True
        self._draw_layouts()
        return observations, masked_info(copied_info(episodes.starts, episodes.of_episode), mask)

    def step(self, actions: ArrayLike) -> tuple[Any, NDArray[np.float64], Bools, Bools, dict[str, Any]]:
        """Plays one shot in every environment, except in those that this step resets.

        If the call is interrupted (by Ctrl-C), the environments keep the state that they had before it.

        Args:
            actions: (num_envs, 2) velocities of the cue balls divided by `max_speed`, or (num_envs, 5) with
                `action="strike"`.

        Returns:
            (num_envs, size) observations, (num_envs,) rewards, terminated and truncated (always False), and infos. The
            infos contain the keys of `BilliardsEnv`, each an array over the environments. For each key there is also a
            bool array `_key`, which is True for the environments that have this key.

        Raises:
            ResetNeeded: If an episode has not begun or, in the mode "Disabled", is over.
            ValueError: If the actions do not have the shape of the action space, or a number is not finite.
        """
        episodes, m, state = self._episodes, self.num_envs, self._episodes.state
        if np.count_nonzero(state.begun) < m:
            raise ResetNeeded("The episodes have not begun: call reset() before step()")
        memory = state.memory.copy()
        skip, goals, physics, seeds = (
            array.copy() for array in (state.over, state.goals, state.physics, state.episode_seed)
        )  # before the step
        same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        resets = np.count_nonzero(skip) > 0
        if resets and self.autoreset_mode is not AutoresetMode.NEXT_STEP:
            raise ResetNeeded(f"The episode of environment {np.argmax(skip)} is over: call reset() with a reset_mask")
        checked = self._checked_actions(actions, skip)
        rewards, over, last = np.empty(m), np.empty(m, np.bool_), episodes.observer.new(m)
        observations = episodes.observer.new(m) if same_step else last

        def work(begin: int, end: int) -> None:
            episodes.shoot(begin, end, checked, rewards, last)
            if resets:
                episodes.restart(begin, end, skip, last)
            over[begin:end] = state.over[begin:end]
            if same_step:
                episodes.restart(begin, end, over, observations)

        try:
            parallel_for(work, m, self.threads)
        except BaseException:
            episodes.undo(memory)
            raise
        if self._renderer is not None:
            self._renderer.step(episodes, rewards, goals, skip)
        status = state.status
        if np.count_nonzero(cut := status >= AT_EVENT_LIMIT):
            for k in np.flatnonzero(cut & ~skip)[:1]:
                episodes.warn_cut_off(k, memory)
        info = copied_info(episodes.of_shots)
        info |= {name: physics[:, j].copy() for j, name in enumerate(state.varied)}
        info["episode_seed"] = seeds.view(np.int64)
        if episodes.choices:
            info["action_mask"] = state.mask * ~over[:, None]
        begun = over if same_step else skip  # the episodes that this step has begun
        infos = masked_info(with_starts(info, begun, episodes.starts, episodes.of_episode), np.ones(m, np.bool_))
        if same_step and np.count_nonzero(over):
            infos["final_obs"], infos["final_info"] = masked_rows(last, over), masked_info(info, over)
            infos["_final_obs"], infos["_final_info"] = over.copy(), over.copy()
        return observations, rewards, over, np.zeros(m, np.bool_), infos

    def step_where(
        self, mask: Bools, actions: ArrayLike
    ) -> tuple[Any, NDArray[np.float64], Bools, Bools, dict[str, Any]]:
        """Plays one shot in some environments, and resets none. The others do not change.

        In games it plays the turns of some players only, see `envs.opponents`. The shots are not rendered, and a shot
        that the engine cuts gives no warning.

        Args:
            mask: (num_envs,) bool, the environments.
            actions: As in `step`; those of the other environments are not used.

        Returns:
            As `step`, with the reward 0 outside the mask; the infos are those of the environments in the mask.

        Raises:
            ResetNeeded: If an episode in the mask has not begun or is over.
            TypeError: If the mask is not a bool array.
            ValueError: As in `step`, or if the mask has another shape or is False everywhere.
        """
        episodes, m, state = self._episodes, self.num_envs, self._episodes.state
        mask = _checked_mask("mask", mask, m)
        if (mask & (state.over | ~state.begun)).any():
            raise ResetNeeded("An episode in the mask is over or has not begun: call reset() with a reset_mask")
        memory, over, checked = state.memory.copy(), state.over.copy(), self._checked_actions(actions, ~mask)
        rewards, observations = np.empty(m), episodes.observer.new(m)
        state.over[~mask] = True  # leaves the other environments out
        try:
            parallel_for(lambda begin, end: episodes.shoot(begin, end, checked, rewards, observations), m, self.threads)
        except BaseException:
            episodes.undo(memory)
            raise
        episodes.go_on(~mask, over)
        infos = masked_info(copied_info(episodes.of_shots, episodes.of_episode), mask)
        return observations, rewards, state.over.copy(), np.zeros(m, np.bool_), infos

    def render(self) -> tuple[Any, ...] | None:
        """Renders the shots of all environments, see the class.

        Returns:
            A tuple with one item for each environment. "rgb_array": a frame (height, width, 3) uint8. "rgb_array_list":
            a list of frames. None in the mode "human" and without a render mode.

        Raises:
            DependencyNotInstalled: If pygame is not installed.
        """
        if self._renderer is None:
            self.single_env.render()  # warns
            return None
        return self._renderer.render()

    def close_extras(self, **kwargs: Any) -> None:
        """Closes the window of the render mode "human"."""
        if self._renderer is not None:
            self._renderer.close()

    def _seed_rows(self, rows: list[int], seeds: Sequence[Any]) -> None:
        """Seeds some environments; `seeds` has an entry for each environment."""
        state, model = self._episodes.state, self._episodes.model
        chosen = [seeds[i] for i in rows]
        self._seeds[rows] = chosen
        if max(chosen, default=0) < 2**64:
            array = np.array(chosen, np.uint64)
            state.stream[rows] = streams.seeded_all(array)
            if model.is_noisy:
                state.noise_stream[rows] = streams.seeded_all(array, noise_key(model.noise_seed))
        else:
            for i in rows:
                state.stream[i] = streams.seeded(seeds[i])
                if model.is_noisy:
                    state.noise_stream[i] = noise_stream(seeds[i], model.noise_seed)

    def _seed_unseeded(self) -> None:
        """Draws a seed for each environment that has none."""
        unseeded = np.flatnonzero(self._episodes.state.stream[:, 3] == 0)
        seeds = np.zeros(self.num_envs, np.uint64)
        seeds[unseeded] = np.random.SeedSequence().generate_state(len(unseeded), np.uint64)
        self._seed_rows(unseeded.tolist(), seeds.tolist())

    def _checked_seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None] | None:
        """Returns one seed per environment, or None."""
        if seed is None:
            return None
        if isinstance(seed, (int, np.integer)):
            first = integer("seed of environment 0", int(seed), "seed")
            return list(range(first, first + self.num_envs))
        if not isinstance(seed, (list, tuple, np.ndarray)) or (isinstance(seed, np.ndarray) and seed.ndim == 0):
            raise TypeError(f"seed = {short(seed)}: expected a whole number >= 0, or a list with one per environment")
        seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed has {len(seeds)} entries: expected {self.num_envs}, one per environment")
        return [v if v is None else integer(f"seed of environment {i}", v, "seed") for i, v in enumerate(seeds)]

    def _checked_actions(self, actions: ArrayLike, skip: Bools) -> NDArray[np.float64]:
        """Returns a copy of the actions; those in `skip` may be any numbers."""
        array = shaped("actions", actions, self._actions_shape)
        finite = np.isfinite(array)
        if np.count_nonzero(finite) < finite.size:
            bad = np.flatnonzero(~finite.reshape(len(skip), -1).all(axis=1) & ~skip)
            if len(bad):
                raise ValueError(f"action of environment {bad[0]} = {array[bad[0]].tolist()}: expected finite numbers")
        return array


def make_vector_env(
    num_envs: int = 1,
    autoreset_mode: str | AutoresetMode = AutoresetMode.SAME_STEP,
    threads: int | None = None,
    render_mode: str | None = None,
    **arguments: Any,
) -> BilliardsVectorEnv:
    """Returns the environment of `gym.make_vec("Billiards-v0", ...)`.

    The docstrings of `BilliardsVectorEnv` and `BilliardsEnv` describe the arguments.

    Raises:
        ValueError: If an argument is invalid.
        TypeError: If an argument is unknown or has the wrong type.
    """
    if "max_episode_steps" in arguments:
        steps = short(arguments["max_episode_steps"])
        raise ValueError(f"max_episode_steps = {steps}: expected max_shots, one step is one shot")
    return BilliardsVectorEnv(num_envs, model_of(make_vector_env, arguments), autoreset_mode, threads, render_mode)


def _checked_mask(name: str, mask: Any, num_envs: int) -> Bools:
    """Returns a copy of a mask of environments."""
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        raise TypeError(f"{name} = {short(mask)}: expected a NumPy array of bool")
    if mask.shape != (num_envs,):
        raise ValueError(f"{name} has shape {mask.shape}: expected ({num_envs},)")
    if not mask.any():
        raise ValueError(f"{name} is False everywhere: expected at least one environment")
    return mask.copy()


def masked_rows(observations: Any, mask: Bools) -> NDArray[Any]:
    """Returns an object array of the observations in the mask, with None for the others."""
    if isinstance(observations, dict):
        return np.array([nth(observations, k) if chosen else None for k, chosen in enumerate(mask.tolist())])
    if np.count_nonzero(mask) == len(mask):
        return np.fromiter(observations, object, len(mask))
    rows = np.full(len(mask), None)
    rows[mask] = np.fromiter(observations[mask], object)
    return rows
