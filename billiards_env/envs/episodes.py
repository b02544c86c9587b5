"""Episodes of one environment or many: their state in arrays, and the compiled loops over them."""

from __future__ import annotations

import dataclasses
import functools
import math
import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import MAX_EVENTS, NO_LOG, STATUS, ShotInput, empty_shots, run_shots_of
from billiards_env.engine.compile import varied_fields, varied_shot, vary
from billiards_env.engine.frozen_strike import strike_frozen
from billiards_env.envs.actions import shorten, strike_balls
from billiards_env.envs.arrays import BallArrays, EpisodeArrays, TaskNumbers
from billiards_env.envs.tasks import TASKS, judge_pot, opening_of, write_legal_balls
from billiards_env.jit import entry_point, inlined, specialised, streams
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.physics.strike import cue_numbers
from billiards_env.scene import Balls, Scene, layouts
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import run_shot

if TYPE_CHECKING:
    from billiards_env.engine import Engine
    from billiards_env.envs.billiards import BilliardsEnv

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Episodes:
    """m episodes in arrays.

    The methods process the episodes from `begin` to `end - 1`. Several threads may call them for different episodes.

    Attributes:
        env: The environment with the arguments of the episodes.
        shots: The balls and, after `shoot`, the outcomes of the shots (see `engine.Shots`).
        balls: The balls before and after the last shots. They are part of `shots`.
        arrays: The state of the episodes. Its balls are those of `balls`.
        plan: The layout at the start of an episode.
        goal_plan: The layout that goals are drawn from: the cue ball anywhere, alone on the table. None if the task has
            no goal.
        miscues: (m,) bool: whether the tip slipped in the last shot; False for the action "velocity".
        physics: The numbers of `BilliardsEnv.randomize` by name, (m,) each.
        recorded: The last shot of the first `n_recorded` episodes with its trajectory, by episode.
    """

    def __init__(self, count: int, env: BilliardsEnv, n_recorded: int = 0) -> None:
        scene, n, task = env.scene, env.scene.n_balls, TASKS[env.task]
        self.env, self.n_recorded = env, n_recorded
        self.recorded: dict[int, ShotResult] = {}
        self.plan = layouts.layout_plan(env.layout, scene)
        self.goal_plan = layouts.layout_plan("random", cue_ball_alone(scene)) if task.goal_radius else None
        self.shots = shots = empty_shots(count, n)
        for array in shots:
            array[...] = 0
        shots.in_play[...] = True
        self.balls = BallArrays(
            *shots[:4], positions_before=np.zeros((count, n, 2)), potted_before=np.zeros((count, n), np.bool_)
        )
        opening, legal = opening_of(env.task, scene, env.layout)
        self.arrays = EpisodeArrays(
            positions=shots.positions,
            in_play=shots.in_play,
            potted_before=self.balls.potted_before,
            cushions=shots.cushions,
            cushions_before_hit=shots.cushions_before_hit,
            first_hit=shots.first_hit,
            potted=np.zeros((count, n), np.bool_),
            goals=np.zeros((count, 0 if self.goal_plan is None else 1, 2)),
            states=opening.repeat(count),
            legal_balls=np.zeros((count, n if task.is_game else 0), np.bool_),
            points=np.zeros(count, np.int64),
            score=np.zeros(count, np.int64),
            shots_left=np.zeros(count, np.int64),
            scratch=np.zeros(count, np.bool_),
            is_success=np.zeros(count, np.bool_),
            fresh=np.ones(count, np.bool_),
            over=np.ones(count, np.bool_),
        )
        self.miscues = np.zeros(count, np.bool_)
        numbers = TaskNumbers(
            targets=env.targets,
            bits=np.left_shift(1, np.arange(n)),
            opening=opening,
            legal=legal,
            goal_radius=task.goal_radius,
            max_shots=env.max_shots,
            scratch_penalty=env.scratch_penalty,
            half_length=scene.half_extents[0],
            half_width=scene.half_extents[1],
            observe_shots_left=env.observe_shots_left,
        )
        # The arguments of the entry points. These tuples hold the arrays above, also after a deep copy.
        self._numbers, self._arrays = tuple(numbers), tuple(self.arrays)
        self._shots, self._balls = tuple(shots), tuple(self.balls)
        self.physics = {name: np.full(count, low) for name, (low, _) in env.randomize.items()}
        self._run_shots = run_shots_of(env.engine, n)
        self._scene = varied_fields(scene, env.engine, self.physics, count)
        self._limit = scene.physics.max_time or math.inf
        self._cue = tuple(cue_numbers(scene)) if env.action == "strike" else None

    def draw(
        self, begin: int, end: int, mask: Bools, streams: NDArray[np.uint64], balls: bool = True, goals: bool = True
    ) -> None:
        """Draws positions of the balls, then goals if the task has any, then the physics of the episodes if it varies.

        Args:
            begin: See the class.
            end: See the class.
            mask: (m,) bool, the episodes to draw for.
            streams: (m, 4) random streams of the episodes, which are advanced (see `billiards_env.jit.streams`).
            balls: Whether to draw positions of the balls.
            goals: Whether to draw goals.

        Raises:
            ValueError: If there is no free position for a ball.
        """
        if balls:
            layouts.draw_tables(self.plan, begin, end, mask, streams, self.shots.positions)
        if goals and self.goal_plan is not None:
            layouts.draw_tables(self.goal_plan, begin, end, mask, streams, self.arrays.goals)
        if self.physics:
            units, rows = np.empty((end - begin, len(self.physics))), np.flatnonzero(mask[begin:end])
            draw_units(begin, end, mask, streams, units)
            self.set_physics(begin + rows, self.scaled(units[rows]))

    def scaled(self, units: Floats) -> dict[str, Floats]:
        """Returns numbers in the ranges of the physics that varies, by name, for draws (m, p) from [0, 1)."""
        ranges = self.env.randomize.items()
        return {
            name: np.minimum(low + (high - low) * units[:, j], high) for j, (name, (low, high)) in enumerate(ranges)
        }

    def set_physics(self, rows: NDArray[np.int64], numbers: Mapping[str, Floats]) -> None:
        """Sets numbers of the physics of episodes, for which it varies. `rows` are the numbers of the episodes."""
        for name, values in numbers.items():
            self.physics[name][rows] = values
        varied = {name: values[rows] for name, values in self.physics.items()}
        vary(self._scene[0], rows, self.env.scene, self.env.engine, varied)

    def physics_arrays(self) -> list[NDArray[Any]]:
        """Returns the arrays that `set_physics` changes, none without physics that varies."""
        return [*self.physics.values(), self._scene[0]] if self.physics else []

    def scene_and_engine(self, k: int) -> tuple[Scene, Engine]:
        """Returns the scene and the engine of episode k."""
        return varied_shot(self.env.scene, self.env.engine, self.physics, k)

    def begin(self, begin: int, end: int, mask: Bools, observations: NDArray[np.float32]) -> None:
        """Begins the episodes in the mask (m,) with the balls where they are, and writes all observations (m, size)."""
        begin_episodes(begin, end, mask, self._numbers, self._arrays, observations)
        if self.env.observe_physics:
            self._observe_physics(begin, end, observations)

    def _observe_physics(self, begin: int, end: int, observations: NDArray[np.float32]) -> None:
        first = observations.shape[1] - len(self.physics)
        for j, (name, (low, high)) in enumerate(self.env.randomize.items()):
            observations[begin:end, first + j] = 2.0 * (self.physics[name][begin:end] - low) / (high - low) - 1.0

    def shoot(self, begin: int, end: int, actions: Floats, rewards: Floats, observations: NDArray[np.float32]) -> None:
        """Plays a shot in each episode that is not over. The others have the reward 0, and their tally does not change.

        If the call is interrupted, the balls keep the positions that they had before it.

        Args:
            begin: See the class.
            end: See the class.
            actions: (m, 2) or (m, 5), see `envs.actions`, finite.
            rewards: (m,) float64 out.
            observations: (m, size) float32 out.
        """
        balls, over = self.balls, self.arrays.over
        start_shots(begin, end, over, actions, self.env.max_speed, self._balls)
        if self._cue is not None:
            strike_balls(begin, end, over, actions, self._cue, (balls.velocities, balls.spins, self.miscues))
            strike_frozen(self.env.scene, self._scene, self._shots[:4], begin=begin, end=end)
        first = begin
        try:
            while first < end and first < self.n_recorded:
                self.recorded[first] = self._record(first)
                first += 1
            if first < end:
                self._run_shots(first, end, self._scene, self._limit, MAX_EVENTS, self._shots, NO_LOG)
        except BaseException:
            balls.positions[begin:end] = balls.positions_before[begin:end]
            balls.in_play[begin:end] = ~balls.potted_before[begin:end]
            raise
        scoring(self.env.task)(begin, end, self._numbers, self._arrays, rewards, observations)
        if self.env.observe_physics:
            self._observe_physics(begin, end, observations)

    def _record(self, k: int) -> ShotResult:
        """Runs the shot of episode k as the engine does, and returns it with its trajectory."""
        shots, (scene, engine) = self.shots, self.scene_and_engine(k)
        positions, velocities, spins, in_play = (array[k].copy() for array in shots[:4])
        start = ShotInput(positions, velocities, spins, in_play, self._limit)
        shot = run_shot(scene, start, engine, record=True)
        for name, array in shots._asdict().items():
            if name == "in_play":
                array[k] = ~shot.potted
            else:
                array[k] = STATUS.index(shot.status) if name == "status" else getattr(shot, name)
        return shot

    def warn_cut_off(self, k: int, action: Floats) -> None:
        """Warns the caller of `step` that the engine ended the shot of episode k at its limit."""
        n_events, seconds, start = self.shots.n_events[k], self.shots.time[k], self.balls.positions_before[k].tolist()
        warnings.warn(
            f"the engine ended a shot at its limit, after {n_events} events and {seconds} s; "
            f"scene {self.scene_and_engine(k)[0].to_dict()}, positions {start}, action {action.tolist()}",
            RuntimeWarning,
            stacklevel=3,
        )


def cue_ball_alone(scene: Scene) -> Scene:
    """Returns the scene without its object balls."""
    return dataclasses.replace(scene, balls=Balls(scene.balls.radius[:1], scene.balls.mass[:1]))


@inlined
def observe(k, numbers, arrays, observations):
    """Writes the observation of episode k.

    It holds the positions of the balls and goals, divided by `Scene.half_extents`, and in a run-out whether each object
    ball is legal, then the fraction of the shots that are left, if it is observed.
    """
    positions, goals, legal = arrays.positions, arrays.goals, arrays.legal_balls
    n, n_goals = positions.shape[1], goals.shape[1]
    for i in range(n):
        observations[k, 2 * i] = min(max(positions[k, i, X] / numbers.half_length, -1.0), 1.0)
        observations[k, 2 * i + 1] = min(max(positions[k, i, Y] / numbers.half_width, -1.0), 1.0)
    for i in range(n_goals):
        observations[k, 2 * (n + i)] = goals[k, i, X] / numbers.half_length
        observations[k, 2 * (n + i) + 1] = goals[k, i, Y] / numbers.half_width
    last = 2 * (n + n_goals)
    for i in range(1, legal.shape[1]):
        observations[k, last] = 1.0 if legal[k, i] else 0.0
        last += 1
    if numbers.observe_shots_left:
        observations[k, last] = 1.0 if arrays.fresh[k] else arrays.shots_left[k] / numbers.max_shots


@entry_point
def draw_units(begin, end, mask, episode_streams, units):
    """Draws numbers (end - begin, p) from [0, 1) for the episodes in the mask, each from its own stream."""
    for k in range(begin, end):
        if mask[k]:
            for j in range(units.shape[1]):
                units[k - begin, j] = streams.next_double(episode_streams[k])


@entry_point
def begin_episodes(begin, end, mask, numbers, arrays, observations):
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
        observe(k, numbers, arrays, observations)


@entry_point
def start_shots(begin, end, over, actions, max_speed, balls):
    """Sets the velocities of the cue balls in the episodes with a shot, and all other velocities and spins to 0."""
    balls = BallArrays(*balls)
    for k in range(begin, end):
        for i in range(balls.in_play.shape[1]):
            balls.potted_before[k, i] = not balls.in_play[k, i]
            for c in range(2):
                balls.positions_before[k, i, c] = balls.positions[k, i, c]
                balls.velocities[k, i, c] = 0.0
            for c in range(3):
                balls.spins[k, i, c] = 0.0
        if not over[k]:
            velocity = shorten(actions[k, X], actions[k, Y], max_speed)
            balls.velocities[k, CUE_BALL, X], balls.velocities[k, CUE_BALL, Y] = velocity


judge = judge_pot  # `scoring` puts the kernel of each task in its place


@functools.cache
def scoring(task: str) -> Callable[..., None]:
    """Returns `score_shots` with the kernel of a task. An environment compiles only the kernel of its task."""
    return specialised(score_shots, judge=TASKS[task].judge)


def score_shots(begin, end, numbers, arrays, rewards, observations):
    """Computes the rewards of the shots and the observations after them, see `Episodes.shoot`."""
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
        observe(k, numbers, arrays, observations)
