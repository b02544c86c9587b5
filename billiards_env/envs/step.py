"""A step of episodes: from actions to strokes, play, judge, observe.

Each of these verbs is a list of parts. A part is a function of the `State` and of the episodes from `begin` to
`end - 1`. An environment has only the parts that its arguments need:

    strokes    a game makes calls and places cue balls; a converter makes strokes of other actions; noise is added
    play       scatter is drawn; the cue balls start; a cue strikes them; the engine runs the shots, or records them
    judge      the task, or the referee of a game, scores the shots; the rewards of another package are checked
    observe    a game with two cue balls shows the one of the next shot as ball 0; then the features are written

In an environment whose action is a choice, the possible choices of the next shot are written at the end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import MAX_EVENTS, NO_LOG, STATUS, ShotInput, Shots, typed_run
from billiards_env.engine.frozen_strike import strike_frozen
from billiards_env.engine.shots import start_fields
from billiards_env.envs.actions import (
    SIDE,
    action_named,
    add_noise,
    clipped,
    converted,
    possible,
    shorten,
    strike_balls,
)
from billiards_env.envs.arguments import Model
from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.envs.state import State
from billiards_env.envs.tasks import task_of
from billiards_env.jit import Typed, entry_point, streams
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.physics.strike import cue_numbers
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import run_shot
from billiards_env.shots.tables import Tables
from billiards_env.support.checks import is_foreign, real

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Step(NamedTuple):
    """The parts of a step, see the module.

    Attributes:
        strokes: Functions of actions that return the strokes: (m, 2) or (m, 5), or (m,) for an action that a later part
            converts.
        play: Functions of the strokes. The last one runs the shots.
        judge: Functions that write rewards (m,), and what follows from the shots.
        observe: Functions that are called before the features are written.
        choices: Functions that write the mask of possible actions of the episodes in a mask (m,).
    """

    strokes: list[Callable[[State, int, int, Any], Any]]
    play: list[Callable[[State, int, int, Floats], Any]]
    judge: list[Callable[[State, int, int, Floats], Any]]
    observe: list[Callable[[State, int, int], Any]]
    choices: list[Callable[[State, int, int, Bools], Any]]


def step_of(
    model: Model, numbers: TaskNumbers, converter: Any, game: Any, n_recorded: int = 0, is_noisy: bool = True
) -> Step:
    """Returns the step of an environment.

    Args:
        model: The arguments of the environment.
        numbers: The constants of the task.
        converter: The object that converts its actions, or None.
        game: The `turns.GameKernels` of a game of several players, or None.
        n_recorded: The number of episodes whose shots are recorded, the first ones.
        is_noisy: Whether noise and scatter are drawn.
    """
    has_cue, has_choices = action_named(model.action).has_cue, getattr(converter, "choices", 0) > 0
    strokes, play, judge, observe, choices = [], [], [], [], []
    if game is not None:
        strokes.append(game.take)
    if converter is not None:
        strokes.append(conversion(model, converter, is_going_on if game is None else game.shoots))
    if model.noise is not None and is_noisy:
        strokes.append(noise(model.noise))
    if model.scatter is not None:
        play.append(scatter_cushions if is_noisy else leave_cushions)
    play.append(start(model))
    if model.scene.physics.flight:
        play.append(set_on_cloth)
    if has_cue:
        play.append(cue_stroke(model))
    if has_cue or game is not None:
        play.append(drive_frozen)
    run = recording(engine_run(model), n_recorded) if n_recorded else engine_run(model)
    play.append(keeping_measures(run) if model.measures else run)
    if game is None:
        judge.append(score(model, numbers))
        if is_foreign(task_of(model.task).judge):
            judge.append(check_rewards)
    else:
        judge.append(game.score)
        if game.has_two_cue_balls:
            observe.append(game.see)
    if has_choices:
        choices.append(choice(model, converter))
    return Step(strokes, play, judge, observe, choices)


def is_going_on(state: State) -> Bools:
    """Returns which episodes have a shot, (m,)."""
    return ~state.over


def conversion(model: Model, converter: Any, shooting: Callable[[State], Bools]) -> Callable[..., Floats]:
    """Returns the part that converts actions to strokes with a converter, in the episodes with a shot."""

    def convert(state: State, begin: int, end: int, actions: NDArray[Any]) -> Floats:
        rows = begin + np.flatnonzero(shooting(state)[begin:end])
        state.strokes[rows] = converted(model.action, converter, actions[rows], tables(state, rows))
        return state.strokes

    return convert


def tables(state: State, rows: NDArray[np.int64]) -> Tables:
    """Returns the tables of some episodes as their players observe them."""
    model, seen, m = state.model, state.seen, len(rows)
    legal = seen.legal_balls[rows] if seen.legal_balls.size else np.tile(model.targets, (m, 1))
    return Tables(model.scene, seen.positions[rows], seen.in_play[rows], legal, model.max_speed)


def noise(deviations: Floats) -> Callable[..., Floats]:
    """Returns the part that adds noise to strokes, which change; `deviations` is `Model.noise`."""

    def add(state: State, begin: int, end: int, strokes: Floats) -> Floats:
        add_noise(begin, end, state.over, strokes, deviations, state.noise_stream)
        return strokes

    return add


def scatter_cushions(state: State, begin: int, end: int, strokes: Floats) -> None:
    """Draws the scatter of the shots."""
    assert state.scatter is not None
    draw_scatter(begin, end, state.over, state.noise_stream, state.scatter.seeds)


def leave_cushions(state: State, begin: int, end: int, strokes: Floats) -> None:
    """Sets no scatter for the shots."""
    assert state.scatter is not None
    state.scatter.seeds[begin:end] = -1


@entry_point
def draw_scatter(begin, end, skip, noise_streams, seeds):
    """Draws the seeds of the scatter of shots, each from its own stream; -1 for the shots to skip."""
    for k in range(begin, end):
        seeds[k] = -1 if skip[k] else np.int64(streams.next_uint64(noise_streams[k]) >> np.uint64(1))


def start(model: Model) -> Callable[..., None]:
    """Returns the part that starts the cue balls, see `start_shots`."""
    set_off, max_speed = Typed(start_shots), model.max_speed

    def begin_shots(state: State, begin: int, end: int, strokes: Floats) -> None:
        balls = state.velocities, state.spins, state.cue
        set_off.call(begin, end, strokes, max_speed, balls, state.seen.states, state.over, state.actions)

    return begin_shots


@entry_point
def start_shots(begin, end, strokes, max_speed, balls, states, over, played):
    """Sets the velocities of the cue balls in the episodes with a shot, and all other velocities and spins to 0.

    Args:
        begin: First episode.
        end: One past the last.
        strokes: (m, 2) or (m, 5) float64.
        max_speed: m/s.
        balls: Velocities (m, n, 2), m/s, spins (m, n, 3), rad/s, and the struck balls (m,), all out.
        states: (m,) `Game.state_type` in the tasks that are games, (0,) in the others.
        over: (m,) bool, the episodes without a shot.
        played: (m, 2) or (m, 5) out, the strokes, clipped; 0 in the episodes without a shot.
    """
    velocities, spins, cues = balls
    for k in range(begin, end):
        for i in range(velocities.shape[1]):
            for c in range(2):
                velocities[k, i, c] = 0.0
            for c in range(3):
                spins[k, i, c] = 0.0
        if over[k]:
            for c in range(played.shape[1]):
                played[k, c] = 0.0
            continue
        cue = states[k].cue_balls[0] if len(states) else CUE_BALL
        cues[k] = cue
        velocities[k, cue, X], velocities[k, cue, Y] = shorten(strokes[k, X], strokes[k, Y], max_speed)
        played[k, X], played[k, Y] = shorten(strokes[k, X], strokes[k, Y], 1.0)
        for c in range(SIDE, played.shape[1]):
            played[k, c] = clipped(strokes, k, c)


def set_on_cloth(state: State, begin: int, end: int, strokes: Floats) -> None:
    """Sets the heights and the vertical velocities of all balls to 0."""
    state.heights[begin:end] = 0.0


def cue_stroke(model: Model) -> Callable[..., None]:
    """Returns the part that strikes the cue balls with a cue, see `actions.strike_balls`."""
    cue, strike, has_flight = tuple(cue_numbers(model.scene)), Typed(strike_balls), model.scene.physics.flight

    def strike_cue_balls(state: State, begin: int, end: int, strokes: Floats) -> None:
        heights = state.heights if has_flight else None
        starts = state.velocities, state.spins, state.cue, heights, state.miscues
        strike.call(begin, end, state.over, strokes, cue, starts)

    return strike_cue_balls


def drive_frozen(state: State, begin: int, end: int, strokes: Floats) -> None:
    """Lets the cue drive the balls that touch a cue ball, see `engine.frozen_strike`."""
    strike_frozen(state.model.scene, state.fields, start_fields(state.shots), begin, end)


def engine_run(model: Model) -> Callable[..., None]:
    """Returns the part that runs the shots."""
    run_shots = typed_run(model.scene, model.engine, model.scatter is not None, model.measures)
    limit = time_limit(model)

    def run(state: State, begin: int, end: int, strokes: Floats) -> None:
        run_shots.call(begin, end, state.fields, limit, MAX_EVENTS, state.shots, NO_LOG)

    return run


def time_limit(model: Model) -> float:
    """Returns the longest time of a shot, s."""
    return model.scene.physics.max_time or math.inf


def recording(run: Callable[..., None], n_recorded: int) -> Callable[..., None]:
    """Returns `run` with a record of the shots of the first episodes."""

    def run_and_record(state: State, begin: int, end: int, strokes: Floats) -> None:
        first = max(begin, min(end, n_recorded))
        for k in range(begin, first):
            state.recorded[k] = record(state, k)
        if first < end:
            run(state, first, end, strokes)

    return run_and_record


def keeping_measures(run: Callable[..., None]) -> Callable[..., None]:
    """Returns `run` so that it keeps the measures of the episodes that are over, which have no shot."""

    def run_and_keep(state: State, begin: int, end: int, strokes: Floats) -> None:
        over, measures = state.over[begin:end], state.measures[begin:end]
        kept = measures[over]
        run(state, begin, end, strokes)
        measures[over] = kept

    return run_and_keep


def record(state: State, k: int) -> ShotResult:
    """Runs the shot of episode k as the engine does, and returns it with its trajectory."""
    scene, engine = state.scene_and_engine(k)
    scatter = None if state.scatter is None else state.scatter._replace(seeds=state.scatter.seeds[k : k + 1].copy())
    fields: Any = (None if array is None else array[k].copy() for array in start_fields(state.shots))
    begun = ShotInput(*fields, limit=time_limit(state.model), scatter=scatter)
    shot = run_shot(scene, begun, engine, record=True, measures=state.model.measures)
    for name, array in zip(Shots._fields, state.shots, strict=True):
        if name == "in_play":
            array[k] = ~shot.potted
        elif array is not None:
            array[k] = STATUS.index(shot.status) if name == "status" else getattr(shot, name)
    return shot


def score(model: Model, numbers: TaskNumbers) -> Callable[..., None]:
    """Returns the part that scores the shots of a task, see `score_shots`."""
    score_task, judge, constants = Typed(score_shots), task_of(model.task).judge, tuple(numbers)

    def score_episodes(state: State, begin: int, end: int, rewards: Floats) -> None:
        score_task.call(judge, begin, end, constants, state.arrays, rewards)

    return score_episodes


@entry_point
def score_shots(judge, begin, end, numbers, arrays, rewards):
    """Computes the rewards of the shots by the kernel `Task.judge`, see `Episodes.shoot`."""
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


def check_rewards(state: State, begin: int, end: int, rewards: Floats) -> None:
    """Raises a ValueError if the task of another package returns a reward that is not finite."""
    for reward in rewards[begin:end][~np.isfinite(rewards[begin:end])]:
        real(f"reward of task {state.model.task!r}", reward)  # raises


def choice(model: Model, converter: Any) -> Callable[..., None]:
    """Returns the part that writes which choices are possible in the episodes in a mask (m,).

    In those that are over, none is.
    """

    def write_mask(state: State, begin: int, end: int, mask: Bools) -> None:
        rows = begin + np.flatnonzero(mask[begin:end])
        state.mask[begin:end] *= ~state.over[begin:end, None]
        state.mask[rows] = possible(model.action, converter, tables(state, rows))

    return write_mask
