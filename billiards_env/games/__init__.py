"""Games for two or more players: states, rules, the referee, and games as plain data.

`Billiards-v0` with `n_players` is their environment, and `billiards_env.billiards_v0` its view for PettingZoo. The
names of `games.playing` are imported on first use: tasks need only the rules.
"""

import importlib
from typing import TYPE_CHECKING, Any

from billiards_env.games.game_state import CALL, CALLS, FOULS, IN_HAND, STATE, VERDICT, members, to_dict
from billiards_env.games.referee import GAMES

if TYPE_CHECKING:
    from billiards_env.games.playing import (
        NO_CALL,
        Call,
        GameState,
        History,
        PlayedShot,
        Setup,
        Stroke,
        choices,
        custom_opening,
        opening,
        play,
        replay,
    )

__all__ = [
    "CALL",
    "CALLS",
    "FOULS",
    "GAMES",
    "IN_HAND",
    "NO_CALL",
    "STATE",
    "VERDICT",
    "Call",
    "GameState",
    "History",
    "PlayedShot",
    "Setup",
    "Stroke",
    "choices",
    "custom_opening",
    "members",
    "opening",
    "play",
    "replay",
    "to_dict",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module("billiards_env.games.playing"), name)
