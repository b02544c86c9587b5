"""Players by name, for tasks and for games: `find_player`.

A player of a task is a function `act(observation) -> action`. A player of a game is a function
`(setup, game, max_speed, rng) -> Stroke`. Its arguments are the setup and the state of the game, the speed of the
fastest shot in m/s and a random generator. Both have these names:

* "random", "geometric", "search" and "aim", the strategies of `billiards_env.players.strategies`;
* "planner", which plans under execution noise (`billiards_env.players.planner`): "planner:100ms", "planner:1s";
* a level of the planner, whose strokes are noisy (`billiards_env.players.levels`): "planner:club";
* "policy:FOLDER", the policy of a run of `agents.train` (needs the extra `train`);
* "module:function". In a task the function is the player. In a game it is a *maker*, a function
  `(setup, argument) -> player`;
* in a game, the name of an entry point in the group `billiards_env.players` of an installed package; it loads a maker.

A colon and an argument may follow a name: "search:500", "policy:runs/pot", and in a game "mine:player:fast".
"""

from __future__ import annotations

import importlib
import importlib.metadata
import inspect
from collections.abc import Callable, Sequence
from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import suggestion
from billiards_env.games import Setup
from billiards_env.players.env_player import planned, task_situation
from billiards_env.players.game_player import Player, strategic
from billiards_env.players.levels import planning
from billiards_env.players.strategies import STRATEGIES, find_strategy

Act = Callable[[NDArray[np.float32]], NDArray[np.floating[Any]]]

GROUP = "billiards_env.players"
"""The group of entry points under which other packages offer makers of players."""

KNOWN = (*STRATEGIES, "planner", "policy")
"""The names of players, without the names of entry points."""


def find_player(
    text: str,
    where: Setup | gym.Env[Any, Any],
    noise: tuple[float, float] = (0.0, 0.0),
    seed: int | None = None,
    others: Sequence[str] = (),
) -> Any:
    """Returns the player of a name.

    Args:
        text: See the module's docstring.
        where: The game to be played, or the environment of a task.
        noise: The execution noise that "search", "aim" and "planner" expect, see `strategies.search`. Without noise
            "planner" expects `planner.NOISE`.
        seed: The seed of the random numbers of a player of a task.
        others: Names of other players, for the message of an error.

    Raises:
        OSError: If the folder of a policy holds no finished run.
        ModuleNotFoundError: If the extra `train` is not installed and a policy needs it.
        ValueError: If there is no such player, or it cannot play this game.
        TypeError: If a function does not take the arguments above.
    """
    name, _, argument = text.partition(":")
    in_game, rng, host = isinstance(where, Setup), np.random.default_rng(seed), cast(Any, where)
    if name in STRATEGIES:
        if in_game:
            return strategic(host, text, noise)
        strategy = find_strategy(text, noise)
        return lambda observation: strategy(task_situation(host.unwrapped), rng)
    if name == "planner":
        if in_game:
            return planning(argument, noise)
        return lambda observation: planned(host.unwrapped, argument, noise, rng)
    if name == "policy":
        policies = importlib.import_module("billiards_env.sb3.policy_player")
        return (policies.policy if in_game else policies.task_policy)(host, argument)
    if not in_game:
        act = _imported(text, name, argument, KNOWN)
        _check_call(text, act, (None,), "act(observation) that returns an action")
        return act
    offered = importlib.metadata.entry_points(group=GROUP)
    if name in offered.names:
        return _made(text, offered[name].load(), host, argument)
    function, _, argument = argument.partition(":")
    return _made(text, _imported(text, name, function, sorted({*KNOWN, *offered.names, *others})), host, argument)


def _made(text: str, maker: Any, setup: Setup, argument: str) -> Player:
    """Returns the player of a maker, after a check of their arguments."""
    see = "see billiards_env.players.named"
    _check_call(text, maker, (setup, argument), f"(setup, argument) that returns a player, {see}")
    player = maker(setup, argument)
    what = f"that returns a player (setup, game, max_speed, rng), {see}"
    _check_call(text, player, (setup, None, 1.0, None), what)
    return player


def _imported(text: str, module: str, function: str, names: Sequence[str]) -> Any:
    """Returns a function of a module. Raises a ValueError that lists the known names if there is none."""
    try:
        return getattr(importlib.import_module(module), function)
    except SyntaxError as error:
        where = f"{error.filename}, line {error.lineno}: {error.msg}"
        raise ValueError(f"player = {text!r}: expected a module of Python ({where})") from error
    except (AttributeError, ImportError, ValueError) as error:
        name, ours = text.partition(":")[0], module.removesuffix(".py")
        if ours != module or (not function and isinstance(error, AttributeError)):
            why = f" (did you mean '{ours}:{function or 'FUNCTION'}'?)"
        else:
            why = ("" if name in names else suggestion(name, names)) or f" ({error})"
        expected = f"one of {', '.join(map(repr, names))}, or module:function"
        raise ValueError(f"player = {text!r}: expected {expected}{why}") from error


def _check_call(text: str, function: Any, arguments: tuple[Any, ...], what: str) -> None:
    """Raises a TypeError unless a function takes some arguments; `what` describes a right one."""
    try:
        inspect.signature(function).bind(*arguments)
    except (TypeError, ValueError):  # a ValueError for a built-in function without a signature
        raise TypeError(f"player = {text!r}: expected a function {what}") from None
