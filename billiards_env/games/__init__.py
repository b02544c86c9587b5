"""Games of two and more players: their rules, how a game goes on, and a PettingZoo environment in `games.billiards_v0`.

PettingZoo is imported by `games.billiards_v0` alone.
"""

from billiards_env.games.play import History, Played, Setup, Stroke, Table, opening, play, replay, set_table
from billiards_env.games.rules import RULES, Facts, State, Verdict

__all__ = [
    "RULES",
    "Facts",
    "History",
    "Played",
    "Setup",
    "State",
    "Stroke",
    "Table",
    "Verdict",
    "opening",
    "play",
    "replay",
    "set_table",
]
