"""Episodes of one environment or many: their state in arrays, and the compiled loops over them."""

from __future__ import annotations

import dataclasses
import functools
import math
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import MAX_EVENTS, NO_LOG, STATUS, Engine, ShotInput, empty_shots, run_shots_of, scene_fields
from billiards_env.envs.actions import shorten, strike_balls
from billiards_env.envs.tasks import BREAKS, TASKS, Outcome, judge_pot, write_on
from billiards_env.jit import entry_point, inlined
from billiards_env.jit.specialised import specialised
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.physics.strike import cue_numbers
from billiards_env.scene import Balls, Scene, layouts
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import run_shot

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The checked arguments of an environment, except for those of observation and rendering.

    Attributes:
        scene: The scene.
        task: One of `TASKS`.
        targets: (n,) bool, the balls of the task.
        layout: Name of the layout at the start of an episode.
        action: One of `actions.ACTIONS`.
        max_shots: Number of shots after which an episode ends.
        max_speed: Speed of an action of length 1, m/s.
        scratch_penalty: Reward subtracted for a scratch.
        engine: The engine.
    """

    scene: Scene
    task: str
    targets: Bools
    layout: str
    action: str
    max_shots: int
    max_speed: float
    scratch_penalty: float
    engine: Engine


class Rules(NamedTuple):
    """The settings that the kernels use.

    Attributes:
        targets: (n,) bool, the balls of the task.
        bits: (n,) int64, each ball as a set of balls.
        goal_radius: See `Task`.
        opening_on: The balls that are on in the first shot of a run-out, as a set of balls.
        max_shots: Number of shots after which an episode ends.
        scratch_penalty: Reward subtracted for a scratch.
        half_length: Scale of x in observations, m, see `Scene.half_extents`.
        half_width: Scale of y in observations, m.
    """

    targets: Any
    bits: Any
    goal_radius: float
    opening_on: int
    max_shots: int
    scratch_penalty: float
    half_length: float
    half_width: float


class Starts(NamedTuple):
    """The balls before m shots. The last two arrays are copies, because the engine overwrites the first four.

    Attributes:
        positions: (m, n, 2) float64, m.
        velocities: (m, n, 2) float64, m/s.
        spins: (m, n, 3) float64, rad/s.
        in_play: (m, n) bool.
        start: (m, n, 2) float64, m: positions before the last shot.
        potted_before: (m, n) bool: balls off the table before the last shot.
    """

    positions: Any
    velocities: Any
    spins: Any
    in_play: Any
    start: Any
    potted_before: Any


class Tally(NamedTuple):
    """The counts of m episodes. Each field has the name of its key in `info`.

    Attributes:
        points: (m,) int64: points of the last shot.
        score: (m,) int64: points of the episode.
        shots_left: (m,) int64: number of shots left.
        scratch: (m,) bool: whether the last shot potted the cue ball.
        is_success: (m,) bool: whether the task is achieved in the episode so far.
    """

    points: Any
    score: Any
    shots_left: Any
    scratch: Any
    is_success: Any


class Progress(NamedTuple):
    """The progress of m episodes. The fields between `in_play` and `over` are those of `Tally`.

    Attributes:
        positions: (m, n, 2) float64, m.
        goals: (m, g, 2) float64, m.
        in_play: (m, n) bool.
        over: (m,) bool: whether the episode has ended.
        on: (m, n) bool in a run-out, None in other tasks: the balls that are on.
    """

    positions: Any
    goals: Any
    in_play: Any
    points: Any
    score: Any
    shots_left: Any
    scratch: Any
    is_success: Any
    over: Any
    on: Any


class Episodes:
    """m episodes in arrays.

    The methods process the episodes from `begin` to `end - 1`. Several threads may call them for different episodes.

    Attributes:
        settings: The arguments of the environment.
        shots: The balls and, after `shoot`, the outcomes of the shots (see `engine.Shots`).
        tally: The `Tally`.
        potted: (m, n) bool: balls off the table after the last shot.
        info: The array of each key of `info`, with one entry per episode. That of "status" holds indices into `STATUS`.
        over: (m,) bool: whether the episode has ended; True before the first episode.
        start: (m, n, 2) float64, m: positions before the last shot.
        potted_before: (m, n) bool: balls off the table before the last shot.
        miscues: (m,) bool: whether the tip slipped in the last shot; False for the action "velocity".
        plan: The layout at the start of an episode.
        goals: (m, g, 2) float64, m: one goal (g = 1) in the tasks with a goal, none in the others.
        on: (m, n) bool in a run-out, (m, 0) in other tasks: the balls that are on.
        recorded: The last shot of each episode with its trajectory, by episode; None unless `record` is True.
        goal_plan: The layout that goals are drawn from: the cue ball anywhere, alone on the table. None if the task has
            no goal.
    """

    def __init__(self, count: int, settings: Settings, record: bool = False) -> None:
        scene, n, task = settings.scene, settings.scene.n_balls, TASKS[settings.task]
        self.settings = settings
        self.shots = empty_shots(count, n)
        for array in self.shots:
            array[...] = 0
        self.shots.in_play[...] = True
        self.tally = Tally(*np.zeros((3, count), np.int64), *np.zeros((2, count), np.bool_))
        self.potted = np.zeros((count, n), np.bool_)
        self.recorded: dict[int, ShotResult] | None = {} if record else None
        self.over = np.ones(count, np.bool_)
        self.start = np.zeros((count, n, 2))
        self.potted_before = np.zeros((count, n), np.bool_)
        self.miscues = np.zeros(count, np.bool_)
        self.plan = layouts.plan(settings.layout, scene)
        self.goal_plan = layouts.plan("random", cue_ball_alone(scene)) if task.goal_radius else None
        self.goals = np.zeros((count, 0 if self.goal_plan is None else 1, 2))
        self.on = np.zeros((count, n if task.on else 0), np.bool_)
        # The arguments of the kernels, as plain tuples: numba unpacks them faster than NamedTuples. The arrays are
        # those of the attributes above, also after a deep copy.
        shots = self.shots
        self._run_shots = run_shots_of(settings.engine, n)
        self._scene, self._shots = scene_fields(scene, settings.engine), tuple(shots)
        self._limit = scene.physics.max_time or math.inf
        self._max_speed = settings.max_speed
        self._rules = (
            settings.targets,
            np.left_shift(1, np.arange(n)),
            task.goal_radius,
            task.on[settings.layout not in BREAKS] if task.on else 0,
            settings.max_shots,
            settings.scratch_penalty,
            *scene.half_extents,
        )
        self._starts = *shots[:4], self.start, self.potted_before
        on = self.on if task.on else None
        self._progress = shots.positions, self.goals, shots.in_play, *self.tally, self.over, on
        self._cue = tuple(cue_numbers(scene)) if settings.action == "strike" else None
        self._struck = shots.velocities, shots.spins, self.miscues
        self._hits = shots.cushions, shots.cushions_before_hit, shots.first_hit, self.potted_before, self.potted
        self.info = {
            "shot_time": shots.time,
            "n_events": shots.n_events,
            "status": shots.status,
            "first_hit": shots.first_hit,
            "cushions": shots.cushions,
            "potted": self.potted,
            **self.tally._asdict(),
            **({} if self._cue is None else {"miscue": self.miscues}),
        }

    def draw(
        self, begin: int, end: int, mask: Bools, streams: NDArray[np.uint64], balls: bool = True, goals: bool = True
    ) -> None:
        """Draws positions of the balls, then goals if the task has any.

        Args:
            begin: First episode.
            end: Last episode plus 1.
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
            layouts.draw_tables(self.goal_plan, begin, end, mask, streams, self.goals)

    def begin(self, begin: int, end: int, mask: Bools, observations: NDArray[np.float32]) -> None:
        """Begins episodes with the balls at their present positions, and writes the observations of all episodes.

        Args:
            begin: First episode.
            end: Last episode plus 1.
            mask: (m,) bool, the episodes that begin.
            observations: (m, size) float32 out.
        """
        begin_episodes(begin, end, mask, self._rules, self._progress, observations)

    def shoot(
        self,
        begin: int,
        end: int,
        skip: Bools,
        actions: Floats,
        rewards: Floats,
        observations: NDArray[np.float32],
    ) -> None:
        """Plays a shot in each episode.

        If the call is interrupted, the balls keep the positions that they had before it.

        Args:
            begin: First episode.
            end: Last episode plus 1.
            skip: (m,) bool, the episodes without a shot. Their reward is 0, and their tally does not change.
            actions: (m, 2) or (m, 5), see `envs.actions`, finite.
            rewards: (m,) float64 out.
            observations: (m, size) float32 out.
        """
        start_shots(begin, end, skip, actions, self._max_speed, self._starts)
        if self._cue is not None:
            strike_balls(begin, end, skip, actions, self._cue, self._struck)
        try:
            if self.recorded is None:
                self._run_shots(begin, end, self._scene, self._limit, MAX_EVENTS, self._shots, NO_LOG)
            else:
                for k in range(begin, end):
                    self.recorded[k] = self._record(k)
        except BaseException:
            self.shots.positions[begin:end] = self.start[begin:end]
            self.shots.in_play[begin:end] = ~self.potted_before[begin:end]
            raise
        results = rewards, observations
        scoring(self.settings.task)(begin, end, skip, self._rules, self._progress, self._hits, results)

    def _record(self, k: int) -> ShotResult:
        """Runs the shot of episode k as the engine does, and returns it with its trajectory."""
        settings, shots = self.settings, self.shots
        positions, velocities, spins, in_play = (array[k].copy() for array in shots[:4])
        start = ShotInput(positions, velocities, spins, in_play, self._limit)
        shot = run_shot(settings.scene, start, settings.engine, record=True)
        for name, array in shots._asdict().items():
            if name == "in_play":
                array[k] = ~shot.potted
            else:
                array[k] = STATUS.index(shot.status) if name == "status" else getattr(shot, name)
        return shot

    def warn_cut_off(self, k: int, action: Floats) -> None:
        """Warns the caller of `step` that the engine ended the shot of episode k at its limit."""
        warnings.warn(
            f"the engine ended a shot at its limit, after {self.shots.n_events[k]} events and {self.shots.time[k]} s; "
            f"scene {self.settings.scene.to_dict()}, positions {self.start[k].tolist()}, action {action.tolist()}",
            RuntimeWarning,
            stacklevel=3,
        )


def cue_ball_alone(scene: Scene) -> Scene:
    """Returns the scene without its object balls."""
    return dataclasses.replace(scene, balls=Balls(scene.balls.radius[:1], scene.balls.mass[:1]))


@inlined
def observe(k, rules, progress, observations):
    """Writes the observation of episode k.

    It holds the positions of the balls and goals, divided by `Scene.half_extents`, and in a run-out whether each object
    ball is on. If there is room for one more number, this is the fraction of the shots that are left.
    """
    positions, goals = progress.positions, progress.goals
    n, n_goals = positions.shape[1], goals.shape[1]
    for i in range(n):
        observations[k, 2 * i] = min(max(positions[k, i, X] / rules.half_length, -1.0), 1.0)
        observations[k, 2 * i + 1] = min(max(positions[k, i, Y] / rules.half_width, -1.0), 1.0)
    for i in range(n_goals):
        observations[k, 2 * (n + i)] = goals[k, i, X] / rules.half_length
        observations[k, 2 * (n + i) + 1] = goals[k, i, Y] / rules.half_width
    last = observe_on(progress.on, k, 2 * (n + n_goals), observations)
    if observations.shape[1] > last:
        observations[k, last] = progress.shots_left[k] / rules.max_shots


@inlined
def observe_on(on, k, begin, observations):
    """Writes whether each object ball of episode k is on, from column `begin`. Returns the next column."""
    if on is None:
        return begin
    for i in range(1, on.shape[1]):
        observations[k, begin + i - 1] = 1.0 if on[k, i] else 0.0
    return begin + on.shape[1] - 1


@entry_point
def begin_episodes(begin, end, mask, rules, progress, observations):
    """Begins episodes, see `Episodes.begin`; `rules` is a `Rules` and `progress` a `Progress`, as plain tuples."""
    rules, progress = Rules(*rules), Progress(*progress)
    for k in range(begin, end):
        if mask[k]:
            for i in range(progress.in_play.shape[1]):
                progress.in_play[k, i] = True
            progress.score[k], progress.shots_left[k], progress.is_success[k] = 0, rules.max_shots, False
            progress.over[k] = False
            write_on(progress.on, k, rules.opening_on)
        observe(k, rules, progress, observations)


@entry_point
def start_shots(begin, end, skip, actions, max_speed, starts):
    """Sets the velocities of the cue balls in the episodes with a shot, and all other velocities and spins to 0.

    `starts` is a `Starts`, as a plain tuple.
    """
    starts = Starts(*starts)
    for k in range(begin, end):
        for i in range(starts.in_play.shape[1]):
            starts.potted_before[k, i] = not starts.in_play[k, i]
            for c in range(2):
                starts.start[k, i, c] = starts.positions[k, i, c]
                starts.velocities[k, i, c] = 0.0
            for c in range(3):
                starts.spins[k, i, c] = 0.0
        if not skip[k]:
            starts.velocities[k, 0, X], starts.velocities[k, 0, Y] = shorten(actions[k, X], actions[k, Y], max_speed)


judge = judge_pot  # `scoring` puts the kernel of each task in its place


@functools.cache
def scoring(task: str) -> Callable[..., None]:
    """Returns `score_shots` with the kernel of a task. An environment compiles only the kernel of its task."""
    return specialised(score_shots, judge=TASKS[task].judge)


def score_shots(begin, end, skip, rules, progress, hits, results):
    """Computes the rewards of the shots and the observations after them.

    Args:
        begin: First episode.
        end: Last episode plus 1.
        skip: (m,) bool, the episodes without a shot.
        rules: `Rules`, as a plain tuple.
        progress: `Progress`, as a plain tuple.
        hits: `cushions`, `cushions_before_hit` and `first_hit` of `engine.Shots`, `potted_before`, and `potted` out.
        results: `rewards` and `observations` of `Episodes.shoot`.
    """
    rules, progress = Rules(*rules), Progress(*progress)
    cushions, cushions_before_hit, first_hit, potted_before, potted = hits
    rewards, observations = results
    outcome = Outcome(
        progress.positions,
        progress.goals,
        rules.goal_radius,
        potted_before,
        potted,
        cushions,
        cushions_before_hit,
        first_hit,
        rules.bits,
        progress.on,
    )
    for k in range(begin, end):
        for i in range(progress.in_play.shape[1]):
            potted[k, i] = not progress.in_play[k, i]
        rewards[k] = 0.0
        if not skip[k]:
            points, decided, success = judge(k, rules.targets, outcome)
            scratch = potted[k, CUE_BALL]
            progress.points[k], progress.scratch[k] = points, scratch
            progress.score[k] += points
            progress.shots_left[k] -= 1
            progress.is_success[k] = progress.is_success[k] or success
            progress.over[k] = decided or progress.shots_left[k] == 0
            rewards[k] = points - rules.scratch_penalty if scratch else float(points)
        observe(k, rules, progress, observations)
