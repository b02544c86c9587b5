"""Players in `Billiards-v0`: `env_situation` makes the situation, and `acting` a function from observations to actions.

Example:
    >>> from billiards_env.envs import make_env
    >>> from billiards_env.players.strategies import geometric
    >>> env = make_env()
    >>> observation, _ = env.reset(seed=1)
    >>> act = acting(geometric, env)
    >>> env.step(act(observation))[1]
    1.0
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.strikes import level_strike, strike
from billiards_env.envs import BilliardsEnv, BilliardsVectorEnv, make_model
from billiards_env.envs.actions import PLAYED, action_named, converted, converter_of, cue_strike
from billiards_env.envs.observations import nth
from billiards_env.envs.tasks import TASKS, task_of
from billiards_env.games import GameState, Setup, Stroke, members, play
from billiards_env.games.game_state import NOT_IN_HAND, changed, set_of, to_dict
from billiards_env.games.placement import cue_ball_area
from billiards_env.games.playing import check_stroke, opening_state
from billiards_env.physics.state import CUE_BALL
from billiards_env.players.aim import FirstTouch, Goal, Leave, Pot, Touch, carom_goals
from billiards_env.players.named import find_player
from billiards_env.players.situation import Noise, Player, Situation, game_situation, rating, stroke_of
from billiards_env.shots.tables import Tables
from billiards_env.support.checks import finite, numbers, one_of

Floats = NDArray[np.float64]
Act = Callable[[Any], NDArray[np.floating[Any]]]
"""A function that returns the action for an observation."""


class ActionStroke(Stroke):
    """A stroke that holds the action from which it was made. An action computed from the spin has rounding errors.

    A changed stroke, as from `_replace`, has no action.

    Attributes:
        action: The numbers of the action.
    """

    action: tuple[float, ...] = ()


def acting(player: Player, env: gym.Env[Any, Any], noise: Noise = (0.0, 0.0), seed: int | None = None) -> Act:
    """Returns the function `act(observation) -> action` of a player in an environment.

    Args:
        player: The player.
        env: The environment, which may have wrappers.
        noise: The execution noise that the player expects, see `Situation`.
        seed: The seed of the random numbers of the player.
    """
    base, rng = cast(BilliardsEnv, env.unwrapped), np.random.default_rng(seed)
    return lambda observation: action_of(base, stroke_of(player, env_situation(base, observation, noise), rng))


def env_situation(env: BilliardsEnv, observation: Any = None, noise: Noise = (0.0, 0.0)) -> Situation:
    """Returns the situation in an environment.

    In a task the rating of an action is its reward. In a game it is that of `game_situation`; a win is also a point if
    the action is a whole one of the environment.

    Args:
        env: The environment.
        observation: The observation of the environment; None outside of one.
        noise: The expected execution noise: standard deviations of the direction, degrees, and of the speed, m/s.
    """
    if env.model.setup is not None:
        situation = game_situation(*_game_played(env), env.max_speed, noise)
        return situation._replace(
            observe=lambda: observation,
            rate=lambda actions, noise=None: _game_ratings(env, situation, actions, noise),
            stroke=lambda action: _game_stroke(env, situation, action),
        )
    on_table, legal = ~env.potted, env.legal_balls if env.legal_balls.size else env.model.targets
    table = Tables(env.episode_scene, env.positions[None], on_table[None], legal[None], env.max_speed)
    return Situation(
        table=table,
        action=env.action,
        strike=action_named(env.action).has_cue,
        rate=lambda actions, noise=None: env.try_actions(actions, noise=noise).rewards,
        stroke=lambda action: _stroke(env, table, action),
        find_game=lambda: _game(env),
        goals=_goals(env, np.flatnonzero(table.targets[0]).tolist()),
        noise=noise,
        run_out=env.task != "clear",
        observe=lambda: observation,
    )


def game_observation(setup: Setup, game: GameState, max_speed: float, **arguments: Any) -> Any:
    """Returns the observation of a state of a game in an environment.

    A player that is trained with other arguments than the usual ones calls it with `situation.find_game()`.

    Args:
        setup: The game.
        game: Its state.
        max_speed: The speed of the fastest shot, m/s.
        arguments: Other arguments of `Billiards-v0`, such as `observe`.
    """
    same = {name: getattr(setup, name) for name in ("scene", "n_players", "target", "edition", "innings")}
    same |= dataclasses.asdict(setup.engine) | {"task": setup.rules, "max_speed": max_speed}
    return begin_at(BilliardsEnv(make_model(**{**same, **arguments})), game)


def begin_at(env: BilliardsEnv, game: GameState) -> Any:
    """Begins an episode of a game at a state, without its choices, and returns the observation."""
    assert env.model.setup is not None
    state, given = to_dict(game.state), env.model.setup.game_rules.given
    fields = {name: state[name] for name in given if name != "choices"}  # no feature depends on the choices
    return env.reset(options={"positions": game.positions, "state": fields})[0]


def acting_in(player: Player, envs: BilliardsVectorEnv, seed: int | None = None) -> Callable[[Any, Any], Floats]:
    """Returns the function `policy(observations, rows) -> actions` of a player in some games of a vector environment.

    Args:
        player: The player.
        envs: The environment.
        seed: The seed of the random numbers of the player.
    """
    env, rng = BilliardsEnv(envs.single_env.model), np.random.default_rng(seed)

    def policy(observations: Any, rows: Any) -> Floats:
        actions = []
        for k, state in enumerate(envs.get_state(rows)):
            env.set_state(state)
            actions.append(action_of(env, stroke_of(player, env_situation(env, nth(observations, k)), rng)))
        return np.array(actions)

    return policy


def acting_by_name(name: str, envs: BilliardsVectorEnv, seed: int | None = 0) -> Callable[[Any, Any], Floats]:
    """Returns `acting_in` for the name of a player of games, see `players.named`.

    Raises:
        OSError, TypeError, ValueError: As in `find_player`, or the environment is no game of several players.
    """
    setup = envs.single_env.model.setup
    if setup is None:
        raise ValueError("envs with n_players = 1: expected a game of several players")
    return acting_in(find_player(name, setup), envs, seed)


def _game_ratings(
    env: BilliardsEnv, situation: Situation, actions: Floats, noise: np.random.Generator | None
) -> Floats:
    """Returns the ratings (m,) of velocities, or of whole actions of the environment, see `Situation.rate`."""
    if actions.shape[1:] != env.action_space.shape:
        return situation.rate(actions)
    infos, player = env.try_actions(actions, noise=noise).infos, env.game.state.player
    return rating(player, infos["winner"], infos["points"], infos["next_player"] == player, infos["foul"] > 0)


def _game_stroke(env: BilliardsEnv, situation: Situation, action: Any) -> Stroke:
    """Returns the stroke of a velocity, or of a whole action of the environment."""
    array = numbers("action", action)
    if array.shape != env.action_space.shape:
        return situation.stroke(action)
    stroke = ActionStroke((0.0, 0.0))
    stroke.action = tuple(array.ravel().tolist())
    return stroke


def _game_played(env: BilliardsEnv) -> tuple[Setup, GameState]:
    """Returns the game of several players in an environment, and its state."""
    setup, game = env.model.setup, env.game
    assert setup is not None
    if not env.model.can_place:
        game.state.in_hand = NOT_IN_HAND
    return dataclasses.replace(setup, scene=env.episode_scene), game


def action_of(env: BilliardsEnv, stroke: Stroke) -> Floats:
    """Returns the action that plays a stroke.

    An `ActionStroke` has its own action. For others it is computed from the velocity, the spin, the place and the call.

    Raises:
        TypeError, ValueError: If a number of the stroke is wrong, or the stroke has no action, and the environment
            converts its actions.
    """
    if isinstance(stroke, ActionStroke) and stroke.action:
        return np.array(stroke.action).reshape(env.action_space.shape)
    check_stroke(env.scene, stroke)
    parts = [_shot_numbers(env, stroke)]
    if env.model.can_place:
        area, place = np.array(cue_ball_area(env.scene, env.game.state)).reshape(2, 2), stroke.place
        parts.append(
            np.zeros(2) if place is None else (2.0 * np.array(place) - area.sum(1)) / (area[:, 1] - area[:, 0])
        )
    if env.model.can_call:
        parts.append(_call_numbers(env, stroke))
    return np.concatenate(parts)


def _call_numbers(env: BilliardsEnv, stroke: Stroke) -> Floats:
    """Returns the numbers of a call in an action. Each number is the middle of its part.

    An action always nominates a ball. A stroke that calls no ball nominates the one that it touches first.
    """
    (setup, game), call = _game_played(env), stroke.call
    if call.ball < 0 and call.kind == "shot":
        touched = members(play(setup, game, stroke).facts.first)
        call = call._replace(ball=touched[0] if touched else setup.legal(game.state)[0])
    kinds = setup.kinds(game.state)[1:]
    counts = env.scene.n_balls - 1, len(env.scene.table.pockets)
    ball, pocket = (
        (2 * max(i, 0) + 1) / count - 1.0 for i, count in zip((call.ball - 1, call.pocket), counts, strict=True)
    )
    return np.array([ball, pocket, (kinds.index(call.kind) + 0.5) / len(kinds) if call.kind in kinds else -1.0])


def _shot_numbers(env: BilliardsEnv, stroke: Stroke) -> Floats:
    if not any(stroke.velocity):
        return np.zeros(action_named(env.action).size)
    one_of("action of the environment of a player", env.action, PLAYED)
    if not action_named(env.action).has_cue:
        return np.array(stroke.velocity[:2]) / env.max_speed
    scene = env.episode_scene
    cue, heading, side, top = level_strike(scene, stroke.velocity[:2], stroke.spin)
    share = cue * float(strike(scene, 1.0, 0.0).velocity[0]) / env.max_speed
    offsets = side / scene.cue.miscue_offset, top / scene.cue.miscue_offset
    return np.array([share * np.cos(heading), share * np.sin(heading), *offsets, 0.0])


def _stroke(env: BilliardsEnv, table: Tables, action: Any) -> ActionStroke:
    array = finite("action", action, env.action_space.shape)
    converter = converter_of(env.action, env.scene, table.max_speed)
    played = array if converter is None else converted(env.action, converter, array[None], table)[0]
    velocity, spin, _ = cue_strike(played, table.scene, table.max_speed)
    wx, wy, wz = spin.tolist()
    stroke = ActionStroke(tuple(velocity.tolist()), None, (wx, wy, wz))
    stroke.action = tuple(array.ravel().tolist())
    return stroke


def _goals(env: BilliardsEnv, balls: list[int]) -> tuple[tuple[Goal, ...], ...]:
    """Returns the ways to score in the task of an environment, with the legal balls."""
    task = task_of(env.task)
    if task.cushions is not None:
        return carom_goals(balls, task.cushions)
    leave = tuple(Leave((x, y), env.model.goal_radius) for x, y in env.goals.tolist())
    if task.pockets:
        return tuple((FirstTouch(ball), Pot(ball), *leave) for ball in balls)
    return (tuple((Touch(ball), *leave) for ball in balls) or (leave,)) if leave else ()


def _game(env: BilliardsEnv) -> tuple[Setup, GameState]:
    """Returns the game whose rules the task of an environment follows, and its state."""
    rules = task_of(env.task).rules
    if not rules:
        with_rules = tuple(name for name, task in TASKS.items() if task.rules)
        one_of("task of the player 'planner'", env.task, with_rules)
    setup = Setup(rules, env.episode_scene)
    object_balls = set_of(np.flatnonzero(~env.potted).tolist()) & ~set_of([CUE_BALL])
    plain = changed(opening_state(setup), break_shot=False, in_hand=NOT_IN_HAND, object_balls=object_balls)
    of_task = np.atleast_1d(env.get_state()["game"])  # (0,) if the task is no game
    return setup, GameState(env.positions, next(iter(of_task), plain))
