"""The strategies in `Billiards-v0`.

Example:
    >>> import numpy as np
    >>> from billiards_env.envs import make_env
    >>> from billiards_env.players.strategies import geometric
    >>> env = make_env()
    >>> _ = env.reset(seed=1)
    >>> env.step(geometric(task_situation(env), np.random.default_rng(0)))[1]
    1.0
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import one_of
from billiards_env.engine.threads import parallel_for
from billiards_env.envs import BilliardsEnv
from billiards_env.envs.actions import ACTIONS, PLAYED
from billiards_env.envs.episodes import Episodes
from billiards_env.envs.tasks import TASKS
from billiards_env.games import GameState, Setup
from billiards_env.games.game import opening_state
from billiards_env.games.state import NOT_IN_HAND, changed, set_of
from billiards_env.physics.state import CUE_BALL
from billiards_env.players.aim import FirstTouch, Goal, Leave, Pot, Touch, carom_goals
from billiards_env.players.levels import planning
from billiards_env.players.planner import Options
from billiards_env.players.strategies import Situation
from billiards_env.shots.strikes import level_strike, strike

Floats = NDArray[np.float64]


def task_situation(env: BilliardsEnv) -> Situation:
    """Returns the situation in an environment. The rating of an action is its reward."""
    one_of("action of the environment of a player", env.action, PLAYED)
    targets = env.legal_balls if env.legal_balls.size else env.model.targets
    return Situation(
        env.episode_scene,
        env.positions,
        env.potted,
        targets,
        env.max_speed,
        lambda actions: rewards(env, actions),
        action_size=ACTIONS[env.action].size,
        goals=_goals(env, np.flatnonzero(targets & ~env.potted).tolist()),
        strike=env.action == "strike",
    )


def _goals(env: BilliardsEnv, balls: list[int]) -> tuple[tuple[Goal, ...], ...]:
    """Returns the ways to score in the task of an environment, with the legal balls."""
    task = TASKS[env.task]
    if task.cushions is not None:
        return carom_goals(balls, task.cushions)
    leave = tuple(Leave((x, y), env.model.goal_radius) for x, y in env.goals.tolist())
    if task.pockets:
        return tuple((FirstTouch(ball), Pot(ball), *leave) for ball in balls)
    return (tuple((Touch(ball), *leave) for ball in balls) or (leave,)) if leave else ()


RULES_OF_TASKS = {name: task.rules for name, task in TASKS.items() if task.rules}
"""The tasks that the planner can play, with the games whose rules it follows."""


def planned(env: BilliardsEnv, argument: str, noise: tuple[float, float], rng: np.random.Generator) -> Floats:
    """Returns the action of the player "planner", (2,) or (5,), see `players.planner`.

    Args:
        env: The environment.
        argument: The budget of the player, such as "100ms", or the name of a level in `players.levels.LEVELS`.
        noise: The execution noise that it expects, see `levels.planning`.
        rng: The generator to draw from.

    Raises:
        ValueError: If the planner cannot play the task, or there is no such budget.
    """
    one_of("task of the player 'planner'", env.task, tuple(RULES_OF_TASKS))
    setup = Setup(RULES_OF_TASKS[env.task], env.episode_scene)
    lying = set_of(np.flatnonzero(~env.potted).tolist()) & ~set_of([CUE_BALL])
    plain = changed(opening_state(setup), break_shot=False, in_hand=NOT_IN_HAND, object_balls=lying)
    of_task = np.atleast_1d(env.get_state()["game"])  # (0,) if the task is no game
    game, run_out = GameState(env.positions, next(iter(of_task), plain)), env.task != "clear"
    english = env.action == "strike"
    player = planning(argument, noise, Options(run_out, english, leaves=False))
    stroke = player(setup, game, env.max_speed, rng)
    if not english:
        return np.array(stroke.velocity) / env.max_speed
    scene = env.episode_scene
    cue, heading, side, top = level_strike(scene, stroke.velocity, stroke.spin)
    share = cue * float(strike(scene, 1.0, 0.0).velocity[0]) / env.max_speed
    offsets = side / scene.cue.miscue_offset, top / scene.cue.miscue_offset
    return np.array([share * np.cos(heading), share * np.sin(heading), *offsets, 0.0])


def rewards(env: BilliardsEnv, actions: Floats) -> Floats:
    """Returns the reward (m,) of each action (m, 2) or (m, 5), if it were the next step of the environment.

    The environment does not change. Its execution noise is left out.
    """
    m = len(actions)
    episodes, earned = Episodes(m, env.model._replace(noise=None)), np.empty(m)
    episodes.put(None, env.get_state()[None])
    episodes.state.over[:] = False
    observations = episodes.observer.new(m)

    def work(begin: int, end: int) -> None:
        episodes.shoot(begin, end, actions, earned, observations)

    parallel_for(work, m)
    return earned
