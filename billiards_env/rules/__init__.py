"""The rules of every game, as compiled functions of the numbers of one shot and as functions of arrays of shots.

`judge_shots(game, states, facts, calls)` judges m shots of any states in one call. The modules `pool`, `snooker` and
`carom` hold the rules, with their sources and simplifications. A set of balls is a bit mask: bit i is ball i.
"""

from billiards_env.rules.facts import FACTS, Counts, FactNumbers, facts_of_shots
from billiards_env.rules.games import GAMES, judge_shots, legal_balls
from billiards_env.rules.state import CALL, CALLS, FOULS, IN_HAND, RACKS, STATE, VERDICT

__all__ = [
    "CALL",
    "CALLS",
    "FACTS",
    "FOULS",
    "GAMES",
    "IN_HAND",
    "RACKS",
    "STATE",
    "VERDICT",
    "Counts",
    "FactNumbers",
    "facts_of_shots",
    "judge_shots",
    "legal_balls",
]
