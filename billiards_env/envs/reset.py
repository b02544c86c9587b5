"""A reset of episodes: draws layouts, goals and physics, and begins the episodes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.envs.arguments import Model, ResetOptions, cue_ball_alone
from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.envs.state import State
from billiards_env.envs.tasks import write_legal_balls
from billiards_env.jit import Typed, entry_point, streams
from billiards_env.scene.layouts import Drawer, layout_plan

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Reset:
    """Draws and begins episodes of a model. Several threads may call its methods for different episodes.

    Args:
        model: The arguments of the environment.
        numbers: The constants of the task.
        game: The `turns.GameKernels` of a game of several players, or None.
    """

    def __init__(self, model: Model, numbers: TaskNumbers, game: Any) -> None:
        rack = "" if model.setup is None else model.setup.rack
        self.layout = Drawer(layout_plan(model.layout, model.scene, rack))
        self.goal_layout = Drawer(layout_plan("random", cue_ball_alone(model.scene))) if model.goal_radius else None
        self._ranges = model.randomize
        self._numbers, self._begin, self._keep_seeds = tuple(numbers), Typed(begin_episodes), Typed(keep_seeds)
        self._games = [] if game is None else [game.begin]

    def draw(self, state: State, begin: int, end: int, mask: Bools, options: ResetOptions) -> None:
        """Draws what a reset draws in the episodes in the mask (m,), each from its own stream.

        Args:
            state: The state.
            begin: The first episode.
            end: The episode after the last one.
            mask: (m,) bool, the episodes to draw for.
            options: What takes the place of the drawn positions, goals and numbers.

        Raises:
            ValueError: If there is no free position for a ball.
        """
        if options.episode_seed is not None:
            rows = begin + np.flatnonzero(mask[begin:end])
            state.stream[rows], state.noise_stream[rows] = np.split(options.episode_seed[rows], 2, axis=1)
        self._keep_seeds.call(begin, end, mask, state.stream, state.noise_stream, state.episode_seed)
        for array, values, layout in (
            (state.positions, options.positions, self.layout),
            (state.goals, options.goals, self.goal_layout),
        ):
            if values is not None:
                np.copyto(array[begin:end], values[begin:end], where=mask[begin:end, None, None])
            elif layout is not None:
                layout.draw(begin, end, mask, state.stream, array)
        if self._ranges:
            units, rows = np.empty((end - begin, len(self._ranges))), np.flatnonzero(mask[begin:end])
            draw_units(begin, end, mask, state.stream, units)
            numbers = {name: values[begin + rows] for name, values in options.physics.items()}
            state.set_physics(begin + rows, self.scaled(units[rows]) | numbers)

    def scaled(self, units: Floats) -> dict[str, Floats]:
        """Returns numbers in the ranges of the physics that varies, by name, for draws (m, p) from [0, 1)."""
        ranges = self._ranges.items()
        return {
            name: np.minimum(low + (high - low) * units[:, j], high) for j, (name, (low, high)) in enumerate(ranges)
        }

    def begin(self, state: State, begin: int, end: int, mask: Bools, states: NDArray[Any] | None = None) -> None:
        """Begins the episodes in the mask (m,) with the balls where they are.

        `states`, (1,) or (m,) `Game.state_type`, are those of games of several players; None for the opening.
        """
        self._begin.call(begin, end, mask, self._numbers, state.arrays)
        if states is not None:
            rows = begin + np.flatnonzero(mask[begin:end])
            state.seen.states[rows] = states[rows if len(states) > 1 else 0]
        for begin_games in self._games:
            begin_games(state, begin, end, mask)


@entry_point
def draw_units(begin, end, mask, episode_streams, units):
    """Draws numbers (end - begin, p) from [0, 1) for the episodes in the mask, each from its own stream."""
    for k in range(begin, end):
        if mask[k]:
            for j in range(units.shape[1]):
                units[k - begin, j] = streams.next_double(episode_streams[k])


@entry_point
def keep_seeds(begin, end, mask, episode_streams, noise_streams, seeds):
    """Copies the random streams of the episodes in the mask, (m, 4) each, to `seeds`, (m, 8)."""
    for k in range(begin, end):
        if mask[k]:
            for i in range(4):
                seeds[k, i], seeds[k, 4 + i] = episode_streams[k, i], noise_streams[k, i]


@entry_point
def begin_episodes(begin, end, mask, numbers, arrays):
    """Begins episodes, see `Reset.begin`."""
    numbers, arrays = TaskNumbers(*numbers), EpisodeArrays(*arrays)
    for k in range(begin, end):
        if mask[k]:
            for i in range(arrays.in_play.shape[1]):
                arrays.in_play[k, i] = True
            arrays.fresh[k], arrays.over[k] = True, False
            if len(numbers.opening):
                arrays.states[k] = numbers.opening[0]
                write_legal_balls(k, numbers.legal, arrays)


def noise_stream(seed: int, noise_seed: int | None) -> NDArray[np.uint64]:
    """Returns the random stream of the noise, which is independent of that of the layouts with the same seed.

    A seed of -1, which Gymnasium uses for a generator of unknown seed, gives a random stream.
    """
    return streams.seeded(np.random.SeedSequence(None if seed < 0 else seed, spawn_key=noise_key(noise_seed)))


def noise_key(noise_seed: int | None) -> tuple[int, ...]:
    """Returns the key of `np.random.SeedSequence` for the noise."""
    return (0,) if noise_seed is None else (0, noise_seed)
