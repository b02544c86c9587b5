"""Games for two or more players: states, rules, the referee, and a PettingZoo environment in `games.billiards_v0`.

Only `games.billiards_v0` imports PettingZoo.
"""

from billiards_env.games.game import (
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
from billiards_env.games.referee import GAMES
from billiards_env.games.state import CALL, CALLS, FACTS, FOULS, IN_HAND, STATE, VERDICT, members, to_dict

__all__ = [
    "CALL",
    "CALLS",
    "FACTS",
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
