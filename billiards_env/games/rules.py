"""The games by name: `RULES[name].judge(state, facts, call)` judges a shot.

`facts.facts_of` computes the facts from the recorded events of a shot, `judge` returns a `Verdict`, and
`state.next_state(state, facts, verdict)` returns the state for the next shot. The rules and the table of the games are
in `billiards_env.rules`, which judges arrays of shots.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.facts import Facts
from billiards_env.games.placement import spot_at_foot, spot_colours
from billiards_env.games.state import (
    NO_CALL,
    Call,
    RuleState,
    Verdict,
    balls_of,
    call_array,
    fact_array,
    state_array,
    verdict_of,
)
from billiards_env.rules import GAMES, judge_shots, legal_balls
from billiards_env.rules.games import Game
from billiards_env.scene import Scene


class Rules(Game):
    """The rules of a game for single shots; `rules.games.Game` describes the attributes."""

    def judge(self, state: RuleState, facts: Facts, call: Call = NO_CALL) -> Verdict:
        """Returns the verdict on a shot."""
        verdicts = judge_shots(self.name, state_array([state]), fact_array([facts]), call_array([call], [facts]))
        return verdict_of(verdicts[0], highest_first=self.has_spots)

    def legal(self, state: RuleState, player: int) -> frozenset[int]:
        """Returns the balls that a player may touch first."""
        return frozenset(balls_of(int(legal_balls(self.name, state_array([state]), np.array([player]))[0])))

    def spot(self, scene: Scene, positions: NDArray[Any], on_table: Iterable[int], balls: Iterable[int]) -> None:
        """Places spotted balls, see `placement.spot_at_foot` and `placement.spot_colours`."""
        (spot_colours if self.has_spots else spot_at_foot)(scene, positions, on_table, balls)


RULES = {name: Rules(*game) for name, game in GAMES.items()}
