"""Many environments at once: all shots of a step in compiled code, on several threads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from billiards_env import streams
from billiards_env.checks import choose, whole
from billiards_env.engine import STATUS, spread
from billiards_env.engine.shots import AT_EVENT_LIMIT
from billiards_env.envs.billiards import BilliardsEnv, check_options, goal_circles, warn_cut_off
from billiards_env.envs.episodes import POINTS, SCORE, SHOTS_LEFT, SUCCESS
from billiards_env.envs.rendering import FPS, RENDER_MODES, DrawnShot, Renderer, balls_at_rest

Bools = NDArray[np.bool_]

_STATUS = np.array(STATUS, dtype=object)
_NOTHING = np.array(None, dtype=object)

MAX_DRAWN = 4
"""Largest number of environments that are drawn."""


class BilliardsVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """`num_envs` times `BilliardsEnv`, stepped together: what `gym.make_vec("Billiards-v0", num_envs)` gives.

    It says what Gymnasium's `SyncVectorEnv` of as many `BilliardsEnv` would say, bit for bit, `infos` included, only
    faster: layouts are drawn, shots played and rewards given in compiled code on several threads. Environment i plays
    the episodes of a `BilliardsEnv` that is seeded alike; `reset(seed=7)` seeds it with `7 + i`, a list gives each its
    own seed.

    `reset(options={"positions": ...})` takes `(num_envs, n, 2)` places in metres from the table's centre, "goal" in the
    task "place" `(num_envs, 2)`, and `options={"reset_mask": ...}`, `(num_envs,)` bool, resets these environments only.

    What happens when an episode ends is one of Gymnasium's autoreset modes:

    - `"NextStep"` (Gymnasium's own default): the next `step` ignores the action for that environment and resets it,
      with reward 0. With one shot an episode every other step of an environment is such a reset.
    - `"SameStep"`: it is reset at once. The observation is that of the new episode; the last one and its info are in
      `infos["final_obs"]` and `infos["final_info"]`. This is what training uses.
    - `"Disabled"`: it has to be reset by hand, with `reset_mask`, before the next `step`.

    With a render mode the first four tables are drawn side by side, in the modes of `BilliardsEnv`: `render()` gives
    one frame of all of them, or the frames of the last steps.

    Every array given out is a new one. The arguments of `BilliardsEnv` are taken beside these:

    | Argument | Type | Default | Description |
    |---|---|---|---|
    | `num_envs` | int | `1` | how many environments |
    | `autoreset_mode` | str or AutoresetMode | `"NextStep"` | see above |
    | `threads` | int or None | `None` | threads that a step uses; None for one a core |

    Attributes:
        single_env: An environment with the same arguments, checked and with their defaults; it is never played.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": list(RENDER_MODES),
        "render_fps": FPS,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        **arguments: Any,
    ) -> None:
        self.num_envs = whole("num_envs", num_envs, "num_envs")
        if not isinstance(autoreset_mode, AutoresetMode):
            choose("autoreset_mode", autoreset_mode, tuple(mode.value for mode in AutoresetMode))
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.threads = None if threads is None else whole("threads", threads, "threads")
        self.single_env = BilliardsEnv(**arguments)
        env = self.single_env
        self.render_mode = env.render_mode
        self._renderer = (
            None if env.render_mode is None else Renderer(env.scene, env.render_mode, env.mode, env.dt, env.fix)
        )
        self.metadata = {**BilliardsVectorEnv.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space = self.single_env.observation_space
        self.single_action_space = self.single_env.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

        self._episodes = self.single_env.episodes(self.num_envs)
        self._streams = np.zeros((self.num_envs, 4), np.uint64)
        self._seeds = [-1] * self.num_envs  # less than 0 for one that has none yet
        self._begun = np.zeros(self.num_envs, np.bool_)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The seed of each environment; it is drawn for one that was never given any."""
        self._seed_the_rest()
        return tuple(self._seeds)

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """For each environment a generator that stands where its stream does; drawing from it moves no environment."""
        generators = []
        for seed, row in zip(self.np_random_seed, self._streams, strict=True):
            generators.append(np.random.Generator(np.random.PCG64(seed)))
            streams.write(generators[-1], row)
        return tuple(generators)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(num_envs, n, 2) where the balls are, m, a copy; a potted ball is at its pocket's centre."""
        return self._episodes.shots.positions.copy()

    @property
    def potted(self) -> Bools:
        """(num_envs, n) the balls off the table, a copy."""
        return ~self._episodes.shots.in_play

    @property
    def goals(self) -> NDArray[np.float64]:
        """(num_envs, g, 2) the goals, m, a copy: one a table in the task "place", none in the others."""
        return self._episodes.goals.copy()

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Starts an episode in every environment, or in those of a mask.

        Args:
            seed: Environment i is seeded with `seed + i`, or with entry i of a sequence; None seeds none anew.
            options: None or a dict with any of "positions": (num_envs, n, 2) places of the balls, m, "goal":
                (num_envs, 2) m, in the task "place", and "reset_mask": (num_envs,) bool array, the environments to
                reset; the others are neither reset nor seeded.

        Returns:
            (num_envs, size) observations of all environments, and an empty info.

        Raises:
            ValueError: If a seed or an option is wrong, or the balls cannot be placed so.
            TypeError: If the options are no mapping or the mask no bool array.
            ResetNeeded: If the mask leaves out environments that were never reset.
        """
        seeds = self._checked_seeds(seed)
        mask = np.ones(self.num_envs, np.bool_)
        if isinstance(options, dict) and "reset_mask" in options:
            mask = self._checked_mask(options["reset_mask"])
            options = {key: value for key, value in options.items() if key != "reset_mask"}
        positions, goals = check_options(self.single_env.scene, self.single_env.task, options, mask)
        if not (self._begun | mask).all():
            raise ResetNeeded("reset_mask leaves out environments that have never been reset: reset all of them first")
        if seeds is not None:
            for i in np.flatnonzero(mask).tolist():
                if seeds[i] is not None:
                    self._seed(i, seeds[i])
        if not self._begun.all():
            self._seed_the_rest()
        episodes = self._episodes
        if positions is not None:
            episodes.shots.positions[mask] = positions[mask]
        if goals is not None:
            episodes.goals[mask] = goals[mask]
        observations = self._new_observations()

        def work(begin: int, end: int) -> None:
            episodes.draw(begin, end, mask, self._streams, balls=positions is None, goals=goals is None)
            episodes.begin(begin, end, mask, observations)

        self._begun &= ~mask  # should the work be interrupted
        spread(work, self.num_envs, self.threads)
        self._begun |= mask
        if self._renderer is not None:
            self._renderer.begin([self._balls_at_rest(k) for k in range(self._n_drawn())])
        return observations, {}

    def step(self, actions: ArrayLike) -> tuple[NDArray[np.float32], NDArray[np.float64], Bools, Bools, dict[str, Any]]:
        """Plays one shot in every environment, save those that this step resets.

        A step that is interrupted (by Ctrl-C) leaves the environments as they were before it.

        Args:
            actions: (num_envs, 2) the cue balls' velocities over `max_speed`.

        Returns:
            (num_envs, size) observations, (num_envs,) rewards, terminated and truncated (always False), and infos: the
            keys of `BilliardsEnv`'s info, each an array over the environments, beside a bool array `_key` that tells
            which of them have it.

        Raises:
            ResetNeeded: If no episode is under way in an environment.
            ValueError: If an action is not two finite numbers.
        """
        episodes, m = self._episodes, self.num_envs
        shots, env = episodes.shots, self.single_env
        if not self._begun.all():
            raise ResetNeeded("The episodes have not begun: call reset() before step()")
        skip = np.zeros(m, np.bool_)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            skip = episodes.over.copy()
        elif episodes.over.any():
            raise ResetNeeded(
                f"The episode of environment {np.argmax(episodes.over)} is over: call reset() with a reset_mask"
            )
        checked = self._checked_actions(actions, skip)
        resets = skip.any()
        same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
        rewards, potted, last = np.empty(m), np.empty(shots.in_play.shape, np.bool_), self._new_observations()
        over, tally = np.empty(m, np.bool_), np.empty_like(episodes.tally)
        goals = episodes.goals if self._renderer is None else episodes.goals[: self._n_drawn()].copy()
        observations = self._new_observations() if same_step else last

        def work(begin: int, end: int) -> None:
            episodes.shoot(begin, end, skip, checked, rewards, potted, last)
            tally[begin:end] = episodes.tally[begin:end]
            if resets:
                episodes.draw(begin, end, skip, self._streams)
                episodes.begin(begin, end, skip, last)
            over[begin:end] = episodes.over[begin:end]
            if same_step:
                episodes.draw(begin, end, over, self._streams)
                episodes.begin(begin, end, over, observations)

        before = [(array, array.copy()) for array in (shots.positions, shots.in_play, episodes.tally)]
        if resets or same_step:
            before += [(array, array.copy()) for array in (self._streams, episodes.goals)]
        try:
            spread(work, m, self.threads)
        except BaseException:
            episodes.over[...] = skip
            for array, values in before:
                array[...] = values
            raise
        if self._renderer is not None:
            self._renderer.step(
                [
                    self._balls_at_rest(k)
                    if skip[k]
                    else env.drawn_shot(episodes, k, checked[k], rewards[k], tally[k], goals[k])
                    for k in range(self._n_drawn())
                ]
            )
        cut_off = (shots.status >= AT_EVENT_LIMIT) & ~skip
        if cut_off.any():
            k = int(np.argmax(cut_off))
            warn_cut_off(episodes, k, env.scene, checked[k])
        info = self._info(tally, potted)
        if same_step and over.any():
            infos = {
                **_masked(info, ~over),
                "final_obs": _rows(last, over),
                "_final_obs": over.copy(),
                "final_info": _masked(info, over),
                "_final_info": over.copy(),
            }
        else:
            infos = _masked(info, ~skip)
        return observations, rewards, over, np.zeros(m, np.bool_), infos

    def render(self) -> Any:
        """Shows the shots of the first few tables side by side.

        Returns:
            A frame (height, width, 3) uint8, a list of frames, or None, by the render mode.

        Raises:
            DependencyNotInstalled: If pygame is not installed.
        """
        return self.single_env.render() if self._renderer is None else self._renderer.render()

    def close_extras(self, **kwargs: Any) -> None:
        """Closes the window of the render mode "human"."""
        if self._renderer is not None:
            self._renderer.close()

    def _n_drawn(self) -> int:
        return min(MAX_DRAWN, self.num_envs)

    def _balls_at_rest(self, k: int) -> DrawnShot:
        shots = self._episodes.shots
        circles = goal_circles(self._episodes.goals[k])
        return balls_at_rest(shots.positions[k], self.single_env.task, shots.in_play[k], circles)

    def _info(self, tally: NDArray[np.int64], potted: Bools) -> dict[str, NDArray[Any]]:
        shots = self._episodes.shots
        success = tally[:, SUCCESS] == 1
        return {
            "shot_time": shots.time.copy(),
            "n_events": shots.n_events.copy(),
            "status": _STATUS[shots.status],
            "first_hit": shots.first_hit.copy(),
            "cushions": shots.cushions.copy(),
            "potted": potted,
            "scratch": potted[:, 0].copy(),
            "points": tally[:, POINTS].copy(),
            "score": tally[:, SCORE].copy(),
            "shots_left": tally[:, SHOTS_LEFT].copy(),
            "success": success,
            "is_success": success.copy(),
        }

    def _new_observations(self) -> NDArray[np.float32]:
        return np.empty((self.num_envs, len(self.single_observation_space.low)), np.float32)  # pyright: ignore

    def _seed(self, i: int, seed: int) -> None:
        self._streams[i] = streams.seeded(seed)
        self._seeds[i] = seed

    def _seed_the_rest(self) -> None:
        """Draws a seed for each environment that has none."""
        unseeded = [i for i, seed in enumerate(self._seeds) if seed < 0]
        for i, seed in zip(unseeded, np.random.SeedSequence().generate_state(len(unseeded), np.uint64), strict=True):
            self._seed(i, int(seed))

    def _checked_seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None] | None:
        """One seed an environment, or None."""
        if seed is None:
            return None
        if isinstance(seed, (int, np.integer)):
            seed = [int(seed) + i for i in range(self.num_envs)]
        seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed has {len(seeds)} entries: expected {self.num_envs}, one an environment")
        return [v if v is None else whole(f"seed of environment {i}", v, "seed") for i, v in enumerate(seeds)]

    def _checked_mask(self, mask: Any) -> Bools:
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"options['reset_mask'] = {mask!r}: expected a numpy array of bool")
        if mask.shape != (self.num_envs,):
            raise ValueError(f"options['reset_mask'] has shape {mask.shape}: expected ({self.num_envs},)")
        if not mask.any():
            raise ValueError("options['reset_mask'] is False throughout: expected an environment to reset")
        return mask.copy()

    def _checked_actions(self, actions: ArrayLike, skip: Bools) -> NDArray[np.float64]:
        aimed = np.array(actions, dtype=np.float64)
        if aimed.shape != (self.num_envs, 2):
            raise ValueError(f"actions has shape {aimed.shape}: expected ({self.num_envs}, 2)")
        finite = np.isfinite(aimed)
        if not finite.all():
            bad = np.flatnonzero(~finite.all(axis=1) & ~skip)
            if len(bad):
                raise ValueError(
                    f"action of environment {bad[0]} = {aimed[bad[0]].tolist()}: expected two finite numbers"
                )
        return aimed


def _masked(info: dict[str, NDArray[Any]], mask: Bools) -> dict[str, Any]:
    """The infos of the environments in the mask, as `VectorEnv._add_info` lays them out: nothing for the others."""
    if not mask.any():
        return {}
    whole = mask.all()
    infos: dict[str, Any] = {}
    for key, values in info.items():
        if whole:
            infos[key] = values
        elif values.dtype == object:
            infos[key] = np.where(mask, values, _NOTHING)
        else:
            infos[key] = values * (mask if values.ndim == 1 else mask[:, None])
        infos[f"_{key}"] = mask.copy()
    return infos


def _rows(array: NDArray[np.float32], mask: Bools) -> NDArray[Any]:
    """An object array of the rows in the mask, None elsewhere."""
    rows = np.full(len(array), None)
    rows[mask] = np.fromiter(array[mask], dtype=object)
    return rows
