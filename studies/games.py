"""The table of the games in the documentation, from their entries in `billiards_env.games.GAMES`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks import table
from billiards_env.games import GAMES

_HEAD = ("`rules`", "Players", "Object balls", "Won by", "Calls and choices")


def blocks(_: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table of the games. It needs no measurement."""
    rows = []
    for game in GAMES.values():
        calls = [*(["ball and pocket, safety"] if game.callable else []), *(c.replace("_", " ") for c in game.choices)]
        numbers = (" to ".join(map(str, dict.fromkeys(pair))) for pair in (game.n_players, game.n_object_balls))
        rows.append((f"`{game.name}`", *numbers, game.won_by, ", ".join(calls) or "-"))
    return {"games": table(_HEAD, rows, left=len(_HEAD))}
