"""Tables on which episodes are played: what one environment, and many at once, do in compiled code."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from billiards_env import layouts
from billiards_env.engine import MAX_EVENTS, NO_LOG, empty_shots, engine_of, scene_arrays
from billiards_env.engine.log import CUSHIONS, CUSHIONS_BEFORE_HIT
from billiards_env.envs.tasks import TASKS, judge
from billiards_env.physics.jit import entry_point, kernel
from billiards_env.scene import Balls, Scene

# Columns of `tally`, an episode's counters.
POINTS, SCORE, SHOTS_LEFT, SUCCESS = 0, 1, 2, 3
N_TALLY = 4


class Tables:
    """m tables of one game, as arrays that compiled code plays on in place.

    The methods take the tables from `begin` to `end`; several threads may call them for different tables.

    Attributes:
        shots: The balls and, after `shoot`, what happened (see `engine.Shots`).
        tally: (m, N_TALLY) int64: points of the last shot, points of the episode, shots left, whether the episode was
            a success so far.
        over: (m,) bool: whether the episode has ended; it has, too, before the first.
        starts: (m, n, 2) float64, m: where the balls were before the last shot.
        potted_before: (m, n) bool: the balls that were off the table before it.
        plan: The layout that episodes start from.
        goals: (m, g, 2) float64, m: the places that the task is about, see `envs.tasks`.
        goal_plan: Where goals are drawn: anywhere that the cue ball, alone on the table, can lie; None if the task has
            no goal.
    """

    def __init__(
        self,
        count: int,
        scene: Scene,
        plan: layouts.Plan,
        task: str,
        targets: NDArray[np.bool_],
        max_shots: int,
        mode: str,
        dt: float | None,
        fix: str | None,
    ) -> None:
        n = scene.n_balls
        self.shots = empty_shots(count, n)
        for array in self.shots:
            array[...] = 0
        self.shots.in_play[...] = True
        self.tally = np.zeros((count, N_TALLY), np.int64)
        self.over = np.ones(count, np.bool_)
        self.starts = np.zeros((count, n, 2))
        self.plan = plan
        self.goal_plan = layouts.plan("random", cue_ball_alone(scene)) if task == "place" else None
        self.goals = np.zeros((count, 0 if self.goal_plan is None else 1, 2))
        self.potted_before = np.zeros((count, n), np.bool_)
        # Prepared for the calls of each step; made of the very arrays, so that a deep copy plays on its own ones.
        self._engine = engine_of(mode, n)
        self._scene, self._plain_shots = tuple(scene_arrays(scene, dt, fix)), tuple(self.shots)
        self._aimed = *self.shots[:4], self.starts, self.potted_before
        self._limit = scene.physics.max_time or math.inf
        self._task = TASKS.index(task)
        self._targets = targets
        self._max_shots = max_shots
        self._half = scene.table.length / 2, scene.table.width / 2

    def draw(
        self,
        begin: int,
        end: int,
        wanted: NDArray[np.bool_],
        rows: NDArray[np.uint64],
        balls: bool = True,
        goals: bool = True,
    ) -> None:
        """Draws where the balls lie, then the goals if the task has any.

        Args:
            begin: First table.
            end: One past the last.
            wanted: (m,) the tables to draw for.
            rows: (m, 4) their streams, which move on.
            balls: Whether to draw the balls' places.
            goals: Whether to draw the goals.

        Raises:
            ValueError: If a ball finds no room.
        """
        if balls:
            layouts.draw_tables(self.plan, begin, end, wanted, rows, self.shots.positions)
        if goals and self.goal_plan is not None:
            layouts.draw_tables(self.goal_plan, begin, end, wanted, rows, self.goals)

    def start(self, begin: int, end: int, wanted: NDArray[np.bool_], observations: NDArray[np.float32]) -> None:
        """Starts episodes on the wanted tables with the balls where they have been put, and observes all tables.

        Args:
            begin: First table.
            end: One past the last.
            wanted: (m,) the tables whose episodes start.
            observations: (m, size) float32 out.
        """
        shots = self.shots
        start(
            begin,
            end,
            wanted,
            shots.positions,
            self.goals,
            shots.in_play,
            self.tally,
            self.over,
            self._max_shots,
            *self._half,
            observations,
        )

    def shoot(
        self,
        begin: int,
        end: int,
        still: NDArray[np.bool_],
        actions: NDArray[np.float64],
        max_speed: float,
        scratch_penalty: float,
        rewards: NDArray[np.float64],
        potted: NDArray[np.bool_],
        observations: NDArray[np.float32],
    ) -> None:
        """Plays a shot on each table that is not to keep still, and tells what it was worth.

        If it is interrupted, the balls of these tables lie where they lay before.

        Args:
            begin: First table.
            end: One past the last.
            still: (m,) the tables on which nothing happens: reward 0, and the tally stays.
            actions: (m, 2) finite shares of `max_speed`; those of still tables do not matter.
            max_speed: m/s.
            scratch_penalty: What a scratch costs.
            rewards: (m,) float64 out.
            potted: (m, n) bool out: the balls off the table.
            observations: (m, size) float32 out.
        """
        shots, before = self.shots, self.potted_before
        aim(begin, end, still, actions, max_speed, *self._aimed)
        try:
            self._engine(begin, end, self._scene, self._limit, MAX_EVENTS, self._plain_shots, NO_LOG)
        except BaseException:
            shots.positions[begin:end] = self.starts[begin:end]
            shots.in_play[begin:end] = ~before[begin:end]
            raise
        settle(
            begin,
            end,
            still,
            self._task,
            self._targets,
            self.goals,
            scratch_penalty,
            shots.positions,
            shots.in_play,
            shots.hits,
            before,
            self.tally,
            self.over,
            self._max_shots,
            *self._half,
            rewards,
            potted,
            observations,
        )


def cue_ball_alone(scene: Scene) -> Scene:
    """The scene without its object balls."""
    return dataclasses.replace(scene, balls=Balls(scene.balls.radius[:1], scene.balls.mass[:1]))


@kernel
def shorten(x, y, max_speed):
    """The velocity of an action (x, y): shortened to the unit disc, times `max_speed`."""
    # Into the box first, so that the squares cannot overflow.
    largest = max(abs(x), abs(y), 1.0)
    x, y = x / largest, y / largest
    # Not hypot, whose last bit depends on the C library.
    speed = max_speed / max(math.sqrt(x * x + y * y), 1.0)
    return x * speed, y * speed


@kernel
def observe(k, positions, goals, tally, max_shots, half_length, half_width, observations):
    """Observes table k: balls and goals as shares of the half table and, if there is room, the share of shots left."""
    n, n_goals = positions.shape[1], goals.shape[1]
    for i in range(n):
        observations[k, 2 * i] = min(max(positions[k, i, 0] / half_length, -1.0), 1.0)
        observations[k, 2 * i + 1] = min(max(positions[k, i, 1] / half_width, -1.0), 1.0)
    for i in range(n_goals):
        observations[k, 2 * (n + i)] = goals[k, i, 0] / half_length
        observations[k, 2 * (n + i) + 1] = goals[k, i, 1] / half_width
    if observations.shape[1] > 2 * (n + n_goals):
        observations[k, 2 * (n + n_goals)] = tally[k, SHOTS_LEFT] / max_shots


@entry_point
def start(
    begin,
    end,
    wanted,
    positions,
    goals,
    in_play,
    tally,
    over,
    max_shots,
    half_length,
    half_width,
    observations,
):
    """The loop of `Tables.start`."""
    for k in range(begin, end):
        if wanted[k]:
            for i in range(in_play.shape[1]):
                in_play[k, i] = True
            tally[k, POINTS] = tally[k, SCORE] = tally[k, SUCCESS] = 0
            tally[k, SHOTS_LEFT] = max_shots
            over[k] = False
        observe(k, positions, goals, tally, max_shots, half_length, half_width, observations)


@entry_point
def aim(begin, end, still, actions, max_speed, positions, velocities, spins, in_play, starts, potted_before):
    """Sets the balls of a shot at rest, except for the cue ball on tables that do not keep still."""
    for k in range(begin, end):
        for i in range(in_play.shape[1]):
            potted_before[k, i] = not in_play[k, i]
            for c in range(2):
                starts[k, i, c] = positions[k, i, c]
                velocities[k, i, c] = 0.0
            for c in range(3):
                spins[k, i, c] = 0.0
        if not still[k]:
            velocities[k, 0, 0], velocities[k, 0, 1] = shorten(actions[k, 0], actions[k, 1], max_speed)


@entry_point
def settle(
    begin,
    end,
    still,
    task,
    targets,
    goals,
    scratch_penalty,
    positions,
    in_play,
    hits,
    potted_before,
    tally,
    over,
    max_shots,
    half_length,
    half_width,
    rewards,
    potted,
    observations,
):
    """What the shots were worth, and what is seen after them; see `Tables.shoot`."""
    cushions, cushions_before_hit = hits[:, :, CUSHIONS], hits[:, :, CUSHIONS_BEFORE_HIT]
    for k in range(begin, end):
        for i in range(in_play.shape[1]):
            potted[k, i] = not in_play[k, i]
        rewards[k] = 0.0
        if not still[k]:
            points, decided, success = judge(
                task, k, targets, goals, potted_before, potted, cushions, cushions_before_hit, positions
            )
            tally[k, POINTS] = points
            tally[k, SCORE] += points
            tally[k, SHOTS_LEFT] -= 1
            if success:
                tally[k, SUCCESS] = 1
            over[k] = decided or tally[k, SHOTS_LEFT] == 0
            rewards[k] = points - scratch_penalty if potted[k, 0] else float(points)
        observe(k, positions, goals, tally, max_shots, half_length, half_width, observations)
