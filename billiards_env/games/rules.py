"""The games by name: `RULES[name].judge(state, facts, call)` judges a shot.

`facts.facts_of` computes the facts from the recorded events of a shot, `judge` returns a `Verdict`, and
`state.next_state(state, facts, verdict)` returns the state for the next shot. The rules stand in `billiards_env.rules`,
which judges arrays of shots.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.facts import CUE, Facts
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
from billiards_env.rules import judge_shots, legal_balls
from billiards_env.scene import Scene


class Rules(NamedTuple):
    """The rules of a game.

    Attributes:
        name: The name of the game.
        scene: The name of the usual scene.
        layouts: The opening layouts; the first is the default. "random" has no break.
        n_object_balls: The smallest and the largest number of object balls; the largest is the default.
        n_players: The smallest and the largest number of players.
        cue_balls: The balls used as cue ball.
        target: The default score that wins, or 0 if no score does; None for a game that is not won by points.
        can_call: Whether the game has called shots and safeties.
        choices: The choices that a player may have besides a shot, of `CALLS`.
        counts_fouls: Whether consecutive fouls are penalised.
        spot: Function `(scene, positions, on_table, balls)` that places spotted balls.
        pockets: Whether the table has pockets.
    """

    name: str
    scene: str
    layouts: tuple[str, ...]
    n_object_balls: tuple[int, int]
    n_players: tuple[int, int] = (2, 4)
    cue_balls: tuple[int, ...] = (CUE,)
    target: int | None = None
    can_call: bool = False
    choices: tuple[str, ...] = ()
    counts_fouls: bool = False
    spot: Callable[[Scene, NDArray[Any], Iterable[int], Iterable[int]], None] = spot_at_foot
    pockets: bool = True

    def judge(self, state: RuleState, facts: Facts, call: Call = NO_CALL) -> Verdict:
        """Returns the verdict on a shot."""
        verdicts = judge_shots(self.name, state_array([state]), fact_array([facts]), call_array([call], [facts]))
        return verdict_of(verdicts[0], highest_first=self.spot is spot_colours)

    def legal(self, state: RuleState, player: int) -> frozenset[int]:
        """Returns the balls that a player may touch first."""
        return frozenset(balls_of(int(legal_balls(self.name, state_array([state]), np.array([player]))[0])))


_RACKS = ("rack", "tight_rack", "random")
_carom = functools.partial(
    Rules,
    scene="carom",
    layouts=("carom_opening", "random"),
    n_object_balls=(2, 2),
    cue_balls=(0, 2),
    target=10,
    pockets=False,
)

RULES: dict[str, Rules] = {
    rules.name: rules
    for rules in (
        Rules("straight", "pool", _RACKS, (1, 15), target=0, can_call=True, counts_fouls=True),
        Rules("eight_ball", "pool", _RACKS, (15, 15), (2, 2), can_call=True),
        Rules("nine_ball", "pool", _RACKS, (9, 9), choices=("push_out", "hand_back"), counts_fouls=True),
        Rules(
            "snooker",
            "snooker",
            ("snooker", "random"),
            (6, 21),
            (2, 2),
            target=0,
            choices=("hand_back", "replace"),
            spot=spot_colours,
        ),
        _carom("carom"),
        _carom("three_cushion"),
    )
}
