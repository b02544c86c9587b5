"""Shots that are tried from states of an environment, which does not change.

>>> import numpy as np
>>> from billiards_env.envs import make_env
>>> env = make_env()
>>> _ = env.reset(seed=1)
>>> outcomes = env.try_actions(np.random.default_rng(0).uniform(-1.0, 1.0, (1000, 2)))
>>> outcomes.rewards.shape, outcomes.infos["first_hit"].shape, outcomes.states["positions"].shape
((1000,), (1000,), (1000, 2, 2))
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from billiards_env.engine.threads import parallel_for
from billiards_env.envs.arguments import Model
from billiards_env.envs.episodes import Episodes
from billiards_env.envs.snapshots import checked_state
from billiards_env.envs.state import EpisodeState
from billiards_env.jit import streams
from billiards_env.support.checks import finite, numbers, short


class Outcomes(NamedTuple):
    """The results of m tried shots.

    Attributes:
        observations: (m, size) the observations after the shots, or a dict of arrays.
        rewards: (m,) float64.
        terminated: (m,) bool, whether the episodes are over.
        infos: The keys of `info` after a step, except `episode_seed`, each an array with m rows.
        states: (m,) the states after the shots, see `envs.snapshots`. An episode that is not over can continue from
            them. Without `noise` they have the stream of the noise from before the shots.
    """

    observations: Any
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    infos: dict[str, NDArray[Any]]
    states: EpisodeState


class Trials:
    """Plays shots from states. Its arrays are kept between calls.

    Args:
        model: The arguments of the environment.
        shape: The shape of an action.
    """

    def __init__(self, model: Model, shape: tuple[int, ...]) -> None:
        self._model, self._shape = model, shape
        self._without_noise = model._replace(noise=None, scatter=None)
        self._episodes: Episodes | None = None
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        return Trials, (self._model, self._shape)

    def __deepcopy__(self, memo: dict[int, Any]) -> Trials:
        return self  # copies can share it, because it plays one call after the other

    def try_actions(
        self,
        actions: ArrayLike,
        own: EpisodeState,
        states: EpisodeState | None,
        noise: np.random.Generator | None,
        threads: int | None,
    ) -> Outcomes:
        """Plays actions, see `BilliardsEnv.try_actions`; `own` are the states of the environment."""
        given = numbers("actions", actions)
        m = len(given) if given.ndim else 0
        actions = finite("actions", given, (m, *self._shape))
        if not isinstance(noise, np.random.Generator | None):
            raise TypeError(f"noise = {short(noise)}: expected a numpy.random.Generator, or None for no noise")
        with self._lock:
            if self._episodes is None or len(self._episodes.state.over) < m:
                self._episodes = Episodes(1 << max(m - 1, 0).bit_length(), self._model)
            episodes, rows = self._episodes, np.arange(m)
            if states is not None:
                own = checked_state(states, episodes.state.types.saved, self._without_noise, m)
            elif m % len(own):
                raise ValueError(f"actions: expected a multiple of {len(own)}, the number of environments, not {m}")
            ended = np.flatnonzero(own["over"] | ~own["begun"])
            if len(ended):
                row = f"environment {ended[0]}" if states is None else f"states[{ended[0]}]"
                raise ResetNeeded(f"{row} has not begun or is over: call reset(), or leave out the `terminated` rows")
            if len(own) not in (1, m):
                own = own.repeat(m // len(own))
            episodes.put(rows, own)
            is_noisy = self._model.is_noisy and noise is not None
            if noise is not None and is_noisy:
                episodes.state.noise_stream[:m] = streams.drawn(m, noise)
            rewards, observations = np.empty(m), episodes.observer.new(m)

            def work(begin: int, end: int) -> None:
                episodes.shoot(begin, end, actions, rewards, observations, is_noisy)

            parallel_for(work, m, threads)
            arrays = {
                name: array for part in (*episodes.of_shots, *episodes.of_episode) for name, array in part.items()
            }
            infos = {name: array[:m].copy() for name, array in arrays.items() if name != "episode_seed"}
            over = episodes.state.over[:m].copy()
            return Outcomes(observations, rewards, over, infos, episodes.state.take(rows))
