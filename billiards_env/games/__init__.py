"""Games for two or more players: rules, game states, and a PettingZoo environment in `games.billiards_v0`.

Only `games.billiards_v0` imports PettingZoo.
"""

from billiards_env.games.game import (
    GameState,
    History,
    PlayedShot,
    Setup,
    Stroke,
    custom_opening,
    opening,
    play,
    replay,
)
from billiards_env.games.judging import NO_CALL, RULES, Call, Facts, RuleState, Verdict

__all__ = [
    "NO_CALL",
    "RULES",
    "Call",
    "Facts",
    "GameState",
    "History",
    "PlayedShot",
    "RuleState",
    "Setup",
    "Stroke",
    "Verdict",
    "custom_opening",
    "opening",
    "play",
    "replay",
]
