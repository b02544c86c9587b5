"""The rules of every game, as compiled functions of the numbers of one shot and as functions of arrays of shots.

`judge_shots(game, states, facts, calls)` judges m shots of any states in one call. The modules `pool`, `snooker` and
`carom` hold the rules, with their sources and simplifications. A set of balls is a bit mask: bit i is ball i.
"""

from billiards_env.rules.arrays import CALL, CALLS, FACTS, FOULS, IN_HAND, RERACKS, STATE, VERDICT, FactNumbers
from billiards_env.rules.facts import Counts, facts_of_shots
from billiards_env.rules.games import GAMES, callable_balls, judge_shots, legal_balls

__all__ = [
    "CALL",
    "CALLS",
    "FACTS",
    "FOULS",
    "GAMES",
    "IN_HAND",
    "RERACKS",
    "STATE",
    "VERDICT",
    "Counts",
    "FactNumbers",
    "callable_balls",
    "facts_of_shots",
    "judge_shots",
    "legal_balls",
]
