"""The tasks: a table with an entry for each task, and the kernels that compute the points of a shot.

Each kernel has the arguments

    k: index of the episode, from 0 to m - 1.
    numbers: `TaskNumbers`.
    arrays: `EpisodeArrays` of the m episodes after their shots. Views of one episode would take longer than the kernel.

and returns the points of the shot, whether the episode is decided, and whether the task is achieved. The kernels of the
games also change the state of the game and write the `legal_balls` of the next shot. The limit on shots and the penalty
for a scratch are not part of a task. The rules of games are in `billiards_env.games`, and the types of the arguments in
`envs.episode_arrays`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.measures import checked_measures
from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.games.carom import CUSHIONS_TO_TOUCH, is_carom
from billiards_env.games.entry import Game
from billiards_env.games.facts import cushions_before_first, cushions_before_last, driven_off, first, scratch, touched
from billiards_env.games.game_state import NO_FOUL, NOT_IN_HAND, SHOT, Called, size
from billiards_env.games.pool import EIGHT, eight_ball, group_of, group_or_eight, lowest_ball, nine_ball
from billiards_env.games.referee import GAMES, first_state, judged, legal_balls
from billiards_env.jit import check_kernel, inlined, kernel
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.scene import Scene
from billiards_env.support.checks import RANGES, Range, add_entry, check_attributes, entry_of, short, short_name


@kernel
def judge_pot(k, numbers, arrays):
    """Pots the object balls: 1 point for each.

    The episode is decided if all object balls are potted or the cue ball is potted (a scratch). The task is
    achieved if all object balls are potted and the cue ball is not. A ball that is driven off the table ends the
    episode.
    """
    points, cleared, lost = 0, True, False
    for i in range(len(numbers.targets)):
        if numbers.targets[i]:
            if not arrays.potted[k, i]:
                cleared = False
            elif arrays.pockets[k, i] >= 0:
                points += 1
            elif arrays.pot_order[k, i] >= 0:
                lost = True
    lost = lost or arrays.potted[k, CUE_BALL]
    return points, cleared or lost, cleared and not lost


@kernel
def judge_carom(k, numbers, arrays):
    """Touches every object ball with the cue ball in one shot: 1 point.

    A shot that pots the cue ball scores 0 points. The episode is decided if any ball is potted, because a potted ball
    cannot be touched again. Otherwise the episode continues, with or without a point.
    """
    return judge_cushions(k, numbers, arrays, 0)


@kernel
def judge_three_cushion(k, numbers, arrays):
    """Touches every object ball with the cue ball, the last one after at least three cushion contacts: 1 point.

    The other rules are as in `judge_carom`. Several contacts with the same cushion count.
    """
    return judge_cushions(k, numbers, arrays, CUSHIONS_TO_TOUCH)


@inlined
def judge_cushions(k, numbers, arrays, cushions):
    """Returns the result of a carom that needs some cushion contacts."""
    bits, over = numbers.bits, False
    for i in range(len(numbers.targets)):
        over = over or arrays.potted[k, i]
    balls, contacts = touched(arrays, k, bits), cushions_before_last(arrays, k, bits)
    success = is_carom(balls, contacts, len(bits) - 1, cushions) and not scratch(arrays, k, bits)
    return (1 if success else 0), over, success


@kernel
def judge_sum_to_three(k, numbers, arrays):
    """Touches the object ball in a shot in which the two balls have exactly three cushion contacts: 1 point.

    This is the game of pooltool and of LightZero's zoo/pooltool (Niu et al. 2023). Contacts before and after the hit
    count. Never decided: the episode continues, with or without a point.
    """
    total = arrays.cushions[k, CUE_BALL] + arrays.cushions[k, 1]
    success = arrays.cushions_before_hit[k, 1] >= 0 and total == 3
    return (1 if success else 0), False, success


@kernel
def judge_place(k, numbers, arrays):
    """Touches an object ball and brings the cue ball to rest near the goal: 1 point.

    Any object ball counts, and it may be potted. If no object ball is on the table, the cue ball does not have to touch
    one. The episode is decided if the shot scores the point or the cue ball is potted.
    """
    success = is_near_goal(k, numbers, arrays) and touches_a_ball(k, numbers, arrays)
    return (1 if success else 0), success or arrays.potted[k, CUE_BALL], success


@kernel
def judge_position(k, numbers, arrays):
    """Pots an object ball and brings the cue ball to rest near the goal, in one shot: 1 point.

    The episode is decided if the shot scores the point, the cue ball is potted, or no object ball is left.
    """
    _, cleared, _ = judge_pot(k, numbers, arrays)
    success = pots_a_ball(k, numbers, arrays) and is_near_goal(k, numbers, arrays)
    return (1 if success else 0), success or cleared, success


@kernel
def touches_a_ball(k, numbers, arrays):
    """Returns whether the cue ball touched an object ball in shot k, or there was none on the table."""
    touched, left = False, False
    for i in range(len(numbers.targets)):
        if numbers.targets[i] and (not arrays.potted[k, i] or arrays.pockets[k, i] >= 0):
            left = True
            touched = touched or arrays.cushions_before_hit[k, i] >= 0
    return touched or not left


@kernel
def pots_a_ball(k, numbers, arrays):
    """Returns whether shot k potted an object ball."""
    points, _, _ = judge_pot(k, numbers, arrays)
    return points > 0


@kernel
def is_near_goal(k, numbers, arrays):
    """Returns whether the cue ball of shot k is on the table, at most the radius of the task from the goal."""
    dx = arrays.positions[k, CUE_BALL, X] - arrays.goals[k, 0, X]
    dy = arrays.positions[k, CUE_BALL, Y] - arrays.goals[k, 0, Y]
    return dx * dx + dy * dy <= numbers.goal_radius * numbers.goal_radius and not arrays.potted[k, CUE_BALL]


@kernel
def judge_clear(k, numbers, arrays):
    """Pots the last object ball, but not the cue ball: 1 point.

    The episode is decided if all object balls are potted or the cue ball is potted.
    """
    _, decided, success = judge_pot(k, numbers, arrays)
    return (1 if success else 0), decided, success


@kernel
def judge_jump(k, numbers, arrays):
    """Pots ball 1, which the cue ball touches before any other ball or cushion: 1 point.

    A shot that pots the cue ball or drives a ball off the table scores 0 points. The episode is decided if ball 1 or
    the cue ball is out of play.
    """
    bits = numbers.bits
    _, decided, potted = judge_pot(k, numbers, arrays)
    direct = first(arrays, k, bits) == bits[1] and cushions_before_first(arrays, k, bits) == 0
    success = potted and direct and driven_off(arrays, k, bits) == 0
    return (1 if success else 0), decided, success


@kernel
def judge_nine_ball(k, numbers, arrays):
    """Pots balls in shots that first touch the lowest ball on the table: 1 point for each.

    A shot that pots the nine ball also scores the balls that are left, so a run-out scores 9 points. The episode is
    decided by a foul, by a shot that pots no ball, or when the nine ball is potted. The task is achieved if the nine
    ball is potted without a foul.
    """
    state, facts = arrays.states[k], arrays.facts[k]
    record_nine_ball(arrays, k, numbers.bits, facts)
    on_table = state.object_balls
    verdict = judged(nine_ball, state, facts, NO_CALL)
    write_legal_balls(k, lowest_ball(state, 0) & ~facts.potted, arrays)
    if verdict.foul != NO_FOUL:
        return 0, True, False
    return size(on_table if state.over else facts.potted), not verdict.continues or state.over, state.over


@kernel
def judge_eight_ball(k, numbers, arrays):
    """Pots the balls of one group, 1 to 7 or 9 to 15, and then the eight ball: 1 point for each.

    All balls are legal in the break. Then both groups are legal until a shot pots a ball of a group. The group of the
    ball that this shot pots first is then the one to pot. The episode is decided by a foul, by a shot that pots no ball
    of the group, or when the eight ball is potted. The task is achieved if the eight ball is potted without a foul when
    it is legal, and not in the break.
    """
    state, facts = arrays.states[k], arrays.facts[k]
    record_eight_ball(arrays, k, numbers.bits, facts)
    verdict = judged(eight_ball, state, facts, NO_CALL)
    write_legal_balls(k, group_or_eight(state, 0), arrays)
    if verdict.foul != NO_FOUL:
        return 0, True, False
    won = state.winner == 0
    points = size(facts.potted & group_of(state, 0)) + (1 if won else 0)
    return points, points == 0 or facts.potted & EIGHT != 0, won


NO_CALL = Called(-1, -1, SHOT, False)
record_nine_ball, record_eight_ball = GAMES["nine_ball"].record, GAMES["eight_ball"].record


@inlined
def write_legal_balls(k, balls, arrays):
    """Writes the legal balls of the next shot of episode k, a set of balls; nothing if the task is no game."""
    for i in range(arrays.legal_balls.shape[1]):
        arrays.legal_balls[k, i] = balls >> i & 1


class Task(NamedTuple):
    """A task.

    Attributes:
        judge: The kernel, see the module's docstring; None only for a game of several players, which has a referee.
        layout: The layout of an environment without the argument `layout`.
        scene: The name of the default scene.
        n_object_balls: The smallest and the largest number of object balls; None for no limit.
        n_targets: The number of object balls that count, from ball 1 on; None for all.
        pockets: Whether the table must have pockets; None for any table.
        max_shots: The default of the number of shots after which an episode ends.
        goal_radius: m. Largest distance from the goal at which the cue ball may come to rest; 0 for a task without a
            goal.
        condition: Of a task with a goal: the kernel that returns whether a shot meets its condition other than the
            place of the cue ball.
        cushions: For a carom: the cushion contacts that the cue ball needs before the last ball; None for other tasks.
        rules: The game whose rules the player "planner" follows; empty if it cannot play the task.
        is_game: Whether each episode is a game with these `rules`: it has a state, and the cue ball may touch only the
            legal balls first.
        breaks: The layouts whose first shot is the break of the game.
        flies: Whether the cue ball must leave the cloth: the scene needs flights, and the action a cue.
        measures: The measures that the shots record for the kernels, see `engine.measures`.
    """

    judge: Callable[..., Any] | None
    layout: str = "random"
    scene: str = "pool"
    n_object_balls: tuple[int, int | None] = (1, None)
    n_targets: int | None = None
    pockets: bool | None = None
    max_shots: int = 1
    goal_radius: float = 0.0
    condition: Callable[..., Any] | None = None
    cushions: int | None = None
    rules: str = ""
    is_game: bool = False
    breaks: tuple[str, ...] = ()
    flies: bool = False
    measures: tuple[str, ...] = ()

    @property
    def action(self) -> str:
        """The default action."""
        return "strike" if self.flies else "velocity"

    @property
    def game(self) -> Game:
        """The game of a task that is a game; for the empty arrays of other tasks, straight pool."""
        return entry_of("rules", self.rules if self.is_game else "straight", GAMES)


TASKS = {
    "pot": Task(judge=judge_pot, layout="random", pockets=True, rules="straight"),
    "carom": Task(judge=judge_carom, layout="carom_opening", scene="carom", cushions=0),
    "three_cushion": Task(judge=judge_three_cushion, layout="carom_opening", scene="carom", cushions=CUSHIONS_TO_TOUCH),
    "sum_to_three": Task(
        judge=judge_sum_to_three, layout="line", scene="sum_to_three", n_object_balls=(1, 1), pockets=False
    ),
    "place": Task(
        judge=judge_place, layout="random", n_object_balls=(0, None), goal_radius=0.15, condition=touches_a_ball
    ),
    "position": Task(judge=judge_position, layout="random", pockets=True, goal_radius=0.3, condition=pots_a_ball),
    "clear": Task(judge=judge_clear, layout="random", pockets=True, rules="straight"),
    "jump": Task(
        judge=judge_jump,
        layout="snookered",
        scene="jump_pool",
        n_object_balls=(2, 2),
        n_targets=1,
        pockets=True,
        flies=True,
    ),
    "nine_ball": Task(
        judge=judge_nine_ball,
        layout="nine_ball",
        n_object_balls=(9, 9),
        pockets=True,
        max_shots=30,
        rules="nine_ball",
        is_game=True,
    ),
    "eight_ball": Task(
        judge=judge_eight_ball,
        layout="eight_ball",
        n_object_balls=(15, 15),
        pockets=True,
        max_shots=30,
        rules="eight_ball",
        is_game=True,
        breaks=("eight_ball", "rack", "tight_rack"),
    ),
}

_RANGES = {
    "n_object_balls": Range(0, None),
    "n_targets": Range(0, None),
    "max_shots": RANGES["max_shots"],
    "goal_radius": Range(0.0, RANGES["length"].most, "m"),
    "cushions": Range(0, None),
}
"""The ranges of the numbers of a `Task`."""

GAME_SHOTS = 200
"""The default of `max_shots` of a game of several players."""


def register_task(name: str, task: Task) -> None:
    """Adds a task of another package to `TASKS`. The errors are those of `checks.add_entry`.

    Raises:
        TypeError: Also if the judge is not a kernel.
        ValueError: Also if the judge or the condition uses a field that `TaskNumbers` or `EpisodeArrays` does not have.
    """
    if isinstance(task, Task):
        check_kernel(f"judge of task {name!r} = {short(task.judge)}", task.judge)
        checked_measures(task.measures)
    add_entry("task", name, task, dict(TASKS), Task, _RANGES, judge=3, condition=3)  # checks the types
    for attribute, function in (("judge", task.judge), ("condition", task.condition)):
        if function is not None:
            what = f"{attribute} of task {name!r}"
            check_attributes(what, function, (), TaskNumbers._fields, EpisodeArrays._fields)
    TASKS[name] = task


def task_of(name: str, n_players: int = 1) -> Task:
    """Returns a task: that of `TASKS` for one player, and for several players that of the game of `GAMES`.

    The referee judges the shots of a game of several players, see `envs.turns`. Its `Task.judge` is None.
    """
    if n_players == 1:
        return entry_of("task", name, TASKS)
    game = entry_of("task", name, GAMES)
    return Task(
        judge=None,
        layout=game.layouts[0],
        scene=game.scene,
        n_object_balls=game.n_object_balls,
        pockets=game.pockets,
        max_shots=GAME_SHOTS,
        cushions=None if game.pockets else game.cushions,
        rules=name,
        is_game=True,
        breaks=tuple(layout for layout in game.layouts if layout != "random"),
    )


def opening_of(entry: Task, scene: Scene, layout: str, **fields: Any) -> tuple[NDArray[Any], int]:
    """Returns the state before the first shot of a task that is a game, (1,) `Game.state_type`, and its legal balls.

    There are none in other tasks: (0,), 0. The cue ball is in hand before a break with several players.

    Args:
        entry: The task.
        scene: The scene.
        layout: The layout at the start.
        **fields: Fields of the state of a game of several players.
    """
    if not entry.is_game:
        return np.zeros(0, entry.game.state_type), 0
    fields["break_shot"] = short_name(layout) in entry.breaks
    if not (fields["break_shot"] and "n_players" in fields):
        fields["in_hand"] = NOT_IN_HAND
    states = np.array([first_state(entry.rules, scene.n_balls, **fields)])
    return states, int(legal_balls(entry.rules, states, np.zeros(1, np.int64))[0])


def task_targets(task: str, scene: Scene, n_players: int = 1) -> NDArray[np.bool_]:
    """Returns the balls that count in a task: all object balls, or `Task.n_targets` of them.

    Tasks with pockets count only those of finite mass.

    Args:
        task: The name of a task or, for several players, of a game.
        scene: The scene.
        n_players: The number of players.

    Returns:
        (n,) bool.

    Raises:
        ValueError: If the task cannot be played in the scene.
    """
    entry, count = task_of(task, n_players), scene.n_balls - 1
    (least, most), pockets = entry.n_object_balls, len(scene.table.pockets)
    if count == 0 < least:
        raise ValueError(f"task = {task!r} with a scene of the cue ball alone: expected at least one object ball")
    if not least <= count <= (count if most is None else most) or entry.pockets not in (None, pockets > 0):
        balls = f"{least} object ball{'s' * (least > 1)}" if least == most else "object balls"
        table = {None: "", True: " and a table with pockets", False: " and a table without pockets"}[entry.pockets]
        raise ValueError(
            f"task = {task!r} with {count} object ball{'s' * (count != 1)} and {pockets} pockets: expected "
            f"{balls}{table}, such as scene {entry.scene!r}"
        )
    targets = np.arange(scene.n_balls) > 0
    if entry.n_targets is not None:
        targets[1 + entry.n_targets :] = False
    if entry.pockets:
        targets &= np.isfinite(scene.balls.mass)
        if not targets.any():
            raise ValueError(f"task = {task!r} with object balls of infinite mass only: expected one of finite mass")
    return targets
