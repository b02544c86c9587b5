"""What the kernels of the environments read and write: the arrays of the episodes and the numbers of the task.

Entry points take both as plain tuples, which numba unpacks faster than NamedTuples (0.3 us per call).
"""

from __future__ import annotations

from typing import Any, NamedTuple

TALLY = ("points", "score", "shots_left", "scratch", "is_success")
"""The fields of `EpisodeArrays` with the results of the last shot. They have the names of the keys of `info`."""


class TaskNumbers(NamedTuple):
    """The constants of the task and of the scene.

    Attributes:
        targets: (n,) bool, the balls of the task.
        bits: (n,) int64, each ball as a set of balls.
        opening: (1,) `Game.state_type` before the first shot of a task that is a game, (0,) in other tasks.
        legal: The legal balls of the first shot of a game, as a set of balls; 0 in other tasks.
        goal_radius: m, see `Task`.
        max_shots: Number of shots after which an episode ends.
        scratch_penalty: Reward subtracted for a scratch.
    """

    targets: Any
    bits: Any
    opening: Any
    legal: int
    goal_radius: float
    max_shots: int
    scratch_penalty: float


class EpisodeArrays(NamedTuple):
    """m episodes after their last shots: the balls, what the shots did to them, and the results.

    Attributes:
        positions: As in `engine.Shots`.
        in_play: As in `engine.Shots`.
        potted: (m, n) bool: balls out of play after the last shot.
        cue: As in `engine.Shots`.
        cushions: As in `engine.Shots`.
        cushions_before_hit: As in `engine.Shots`.
        first_hit: As in `engine.Shots`.
        pockets: As in `engine.Shots`.
        pot_order: As in `engine.Shots`.
        touched_first: As in `engine.Shots`.
        measures: As in `engine.Shots`: those of `Model.measures`.
        goals: (m, g, 2) float64, m: one goal (g = 1) in the tasks with a goal, none in the others.
        states: (m,) `Game.state_type` before the next shots in the tasks that are games, (0,) in the others.
        facts: (m,) `Game.facts_type` of the last shots in the tasks that are games, (m, 0) in the others.
        legal_balls: (m, n) bool in the tasks that are games, (m, 0) in the others: the balls that the cue ball may
            touch first in the next shot.
        viewers: (m,) int64 in games of several players: the player who observes, -1 for the player to shoot; (0,) in
            other tasks.
        points: (m,) int64: points of the last shot.
        score: (m,) int64: points of its episode up to the last shot.
        shots_left: (m,) int64: number of shots left after it.
        scratch: (m,) bool: whether it potted the cue ball.
        is_success: (m,) bool: whether the task is achieved in its episode so far.
        fresh: (m,) bool: whether a new episode has begun since the last shot.
        over: (m,) bool: whether the episode has ended; True before the first episode.
    """

    positions: Any
    in_play: Any
    potted: Any
    cue: Any
    cushions: Any
    cushions_before_hit: Any
    first_hit: Any
    pockets: Any
    pot_order: Any
    touched_first: Any
    measures: Any
    goals: Any
    states: Any
    facts: Any
    legal_balls: Any
    viewers: Any
    points: Any
    score: Any
    shots_left: Any
    scratch: Any
    is_success: Any
    fresh: Any
    over: Any
