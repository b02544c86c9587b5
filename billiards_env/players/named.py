"""Players by name: `find_player`. A player is a function `(situation, rng) -> Stroke`, see `players.situation`.

`PLAYERS` is the table of the names. A colon and an argument may follow a name: "search:500", "planner:100ms",
"planner:club" (a level, see `players.levels`), "policy:runs/pot" (the folder of a run of `agents.train`),
"policy:runs/pot:16" (the best of 16 actions that the policy proposes), "noisy:club:geometric" (another player, whose
strokes have the noise of a level).
"module:NAME" and "module:NAME:ARGUMENT" name a player that the module adds with `register_player`. Other names are
those of makers. A *maker* is a function `(argument) -> player`, whose argument is a text:

* "module:function" and "module:function:ARGUMENT" name a function of a module;
* the name of an entry point in the group `billiards_env.players` of an installed package loads a maker.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from billiards_env.derivatives.shot_derivatives import check_derivatives
from billiards_env.doors import Entries, offered
from billiards_env.games import Setup, Stroke
from billiards_env.players.levels import LEVELS, LevelPlayer, planning
from billiards_env.players.situation import Player, Situation
from billiards_env.players.strategies import SHOTS, geometric, random, reach_goals, search
from billiards_env.support.checks import add_entry, check_call, is_foreign, one_of, result_of, suggestion

Where = Setup | gym.Env[Any, Any]
"""The game that a player plays, or the environment."""

GROUP = "billiards_env.players"
"""The group of entry points under which other packages offer makers of players."""


class PlayerEntry(NamedTuple):
    """A player with a name.

    Attributes:
        make: Returns the player from its argument and `Where`.
        argument: The argument if the name has none; None for a player without an argument.
        needs_pockets: Whether it refuses a game without pockets.
        needs_derivatives: Whether it refuses a scene whose shots have no derivatives.
    """

    make: Callable[[str, Where], Player]
    argument: str | None = None
    needs_pockets: bool = False
    needs_derivatives: bool = False


class NamedPlayer(NamedTuple):
    """A player of another package, with its name for error messages."""

    name: str
    player: Player

    def __call__(self, situation: Situation, rng: np.random.Generator) -> Stroke:
        """Returns the stroke of the player."""
        return self.player(situation, rng)

    def __repr__(self) -> str:
        return f"player {self.name!r}"


def _searching(argument: str, where: Where) -> Player:
    if not argument.isdecimal() or int(argument) < 1:
        raise ValueError(f"player = 'search:{argument}': expected 'search:K' with a whole number K >= 1")
    return functools.partial(search, shots=int(argument))


def _noisy(argument: str, where: Where) -> Player:
    level, _, player = argument.partition(":")
    one_of("level of the player 'noisy'", level, tuple(LEVELS))
    return LevelPlayer(find_player(player, where), LEVELS[level].noise)


PLAYERS: Entries[PlayerEntry] = {
    "random": PlayerEntry(lambda argument, where: random),
    "geometric": PlayerEntry(lambda argument, where: geometric, needs_pockets=True),
    "search": PlayerEntry(_searching, argument=str(SHOTS)),
    "aim": PlayerEntry(lambda argument, where: reach_goals, needs_derivatives=True),
    "planner": PlayerEntry(lambda argument, where: planning(argument), argument="100ms"),
    "noisy": PlayerEntry(lambda argument, where: _noisy(argument, where), argument=""),
} | offered("player")
"""The players by name; "policy" needs the extra `train`."""


def register_player(name: str, player: PlayerEntry) -> None:
    """Adds a player of another package to `PLAYERS`. The errors are those of `checks.add_entry`."""
    add_entry("player", name, player, PLAYERS, PlayerEntry, make=2)


def find_player(text: str, where: Where, others: Sequence[str] = ()) -> Player:
    """Returns the player of a name.

    Args:
        text: See the module's docstring.
        where: The game to be played, or the environment of a task.
        others: Names of other players, for the message of an error.

    Raises:
        OSError: If the folder of a policy holds no finished run.
        ModuleNotFoundError: If the extra `train` is not installed and a policy needs it.
        ValueError: If there is no such player, or it cannot play this game.
        TypeError: If a function does not take the arguments above.
    """
    name, colon, argument = text.partition(":")
    if name in PLAYERS:
        return _made(PLAYERS[name], text, argument if colon else None, where)
    offered = importlib.metadata.entry_points(group=GROUP)
    if name in offered.names:
        maker = offered[name].load()
    else:
        function, colon, argument = argument.partition(":")
        maker = _imported(text, name, function, sorted({*PLAYERS, *offered.names, *others}))
        if isinstance(maker, PlayerEntry):
            return _made(maker, text, argument if colon else None, where)
    _check_call(text, maker, 1, "(argument) that returns a player")
    return _checked(text, maker, argument)


def _made(entry: PlayerEntry, text: str, argument: str | None, where: Where) -> Player:
    """Returns the player of an entry. Raises a ValueError if it takes no argument or cannot play the game."""
    if argument is not None and entry.argument is None:
        raise ValueError(f"player = {text!r}: expected {text.removesuffix(f':{argument}')!r}, a name without ':'")
    if entry.needs_pockets and isinstance(where, Setup) and not where.game_rules.pockets:
        raise ValueError(f"player = {text!r} with rules = {where.rules!r}: expected a game with pockets")
    if entry.needs_derivatives:
        world: Any = where if isinstance(where, Setup) else where.unwrapped
        check_derivatives(world.scene, f"player = {text!r}", "another player, such as 'search:200'")
    return _checked(text, entry.make, entry.argument or "" if argument is None else argument, where)


def _checked(text: str, maker: Callable[..., Any], *arguments: Any) -> Player:
    """Returns the player that a function makes. Raises a TypeError if it is no player."""
    player = result_of(f"player {text!r}", object, maker, *arguments)
    _check_call(text, player, 2, "that returns a player (situation, rng)")
    return NamedPlayer(text, player) if is_foreign(player) else player


def _imported(text: str, module: str, function: str, names: Sequence[str]) -> Any:
    """Returns the maker of a module, or the entry of `PLAYERS` that it registers.

    Raises a ValueError that lists the known names if there is neither.
    """
    try:
        found, entry = importlib.import_module(module), PLAYERS.data.get(function)
        theirs = isinstance(entry, PlayerEntry) and entry.make.__module__.partition(".")[0] == module.partition(".")[0]
        return entry if theirs else getattr(found, function)  # an entry of another package hides no function
    except SyntaxError as error:
        where = f"{error.filename}, line {error.lineno}: {error.msg}"
        raise ValueError(f"player = {text!r}: expected a module of Python ({where})") from error
    except (Exception, SystemExit) as error:  # the code of the module may raise any
        name, ours = text.partition(":")[0], module.removesuffix(".py")
        if ours != module or (not function and isinstance(error, AttributeError)):
            why = f" (did you mean '{ours}:{function or 'FUNCTION'}'?)"
        else:
            why = ("" if name in names else suggestion(name, names)) or f" ({error})"
        expected = f"one of {', '.join(map(repr, names))}, or module:function"
        raise ValueError(f"player = {text!r}: expected {expected}{why}") from error


def _check_call(text: str, function: Any, arguments: int, what: str) -> None:
    """Raises a TypeError unless a function takes a number of arguments; `what` describes a right one."""
    check_call(f"player = {text!r}", function, arguments, f"a function {what}, see billiards_env.players.named")
