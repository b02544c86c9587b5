"""Players that are programs, found by name.

A player is a function `(setup, table, max_speed, rng) -> Stroke`, called with the game, the table, the speed of the
fastest shot in m/s and a generator to draw from. What makes one is a function `(setup, argument) -> player`, to be
named on the command line as

* "random", which is here;
* a name under the entry point group `billiards_env.players` of an installed package (see its `pyproject.toml`), such as
  "geometric" or "search";
* "module:function", for one's own.

Each may be followed by a colon and an argument, a text: "search:500", "policy:runs/pot", "mine:player:fast".
"""

from __future__ import annotations

import importlib
import importlib.metadata
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from billiards_env.games import GameState, Setup, Stroke
from billiards_env.games.placement import Point, placement_area
from billiards_env.play.model import HUMAN

Player = Callable[[Setup, GameState, float, np.random.Generator], Stroke]

GROUP = "billiards_env.players"
"""The entry points under which packages offer players."""


def find_player(text: str, setup: Setup) -> Player | None:
    """The player that a text names.

    Args:
        text: As in the module's docstring, or `HUMAN`.
        setup: The game that it is to play.

    Returns:
        The player; None for a person.

    Raises:
        ValueError: If there is no such player, or it cannot play this game.
    """
    name, _, argument = text.partition(":")
    if text == HUMAN:
        return None
    if name == "random":
        return random_player(setup, argument)
    offered = importlib.metadata.entry_points(group=GROUP)
    if name in offered.names:
        return offered[name].load()(setup, argument)
    function, _, argument = argument.partition(":")
    try:
        make: Any = getattr(importlib.import_module(name), function)
    except (AttributeError, ImportError, ValueError) as error:
        known = ", ".join(sorted({HUMAN, "random", *offered.names}))
        raise ValueError(f"player {text!r}: {error}; expected one of {known}, or module:function") from error
    return make(setup, argument)


def random_player(setup: Setup, argument: str = "") -> Player:
    """A player who shoots anywhere at any speed.

    Args:
        setup: The game.
        argument: None is taken.

    Returns:
        The player.

    Raises:
        ValueError: If there is an argument.
    """
    if argument:
        raise ValueError(f"player 'random:{argument}': expected 'random', it takes no argument")

    def stroke(setup: Setup, table: GameState, max_speed: float, rng: np.random.Generator) -> Stroke:
        angle, speed = math.tau * rng.random(), max_speed * rng.random()
        return Stroke((speed * math.cos(angle), speed * math.sin(angle)), any_place(setup, table, rng))

    return stroke


def any_place(setup: Setup, table: GameState, rng: np.random.Generator) -> Point | None:
    """A place drawn for a cue ball in hand, m; None if it is not in hand."""
    state = table.state
    if state.in_hand == "no":
        return None
    x_low, x_high, y_low, y_high = placement_area(setup.scene, state.cue_balls[0], state.in_hand == "behind")
    return x_low + (x_high - x_low) * rng.random(), y_low + (y_high - y_low) * rng.random()
