"""The games by name: `RULES[name].judge(state, facts, call)` judges a shot.

`facts.facts_of` computes the facts from the recorded events of a shot. A game's `judge` is a plain function that
returns a `Verdict`, and `state.next_state(state, facts, verdict)` returns the state for the next shot. The modules
`pool`, `snooker` and `carom` hold the rules, with their sources and simplifications.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from numpy.typing import NDArray

from billiards_env.games.carom import carom, red_to_open, three_cushion
from billiards_env.games.facts import CUE, Facts
from billiards_env.games.placement import spot_at_foot, spot_colours
from billiards_env.games.pool import any_ball, eight_ball, group_or_eight, lowest_ball, nine_ball, straight
from billiards_env.games.snooker import balls_on, snooker
from billiards_env.games.state import Call, RuleState, Verdict
from billiards_env.scene import Scene


class Rules(NamedTuple):
    """The rules of a game.

    Attributes:
        judge: Function `(state, facts, call)` that returns the verdict.
        legal: Function `(state, player)` that returns the balls that the player may touch first.
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

    judge: Callable[[RuleState, Facts, Call], Verdict]
    legal: Callable[[RuleState, int], frozenset[int]]
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


_RACKS, _CAROM_LAYOUTS = ("rack", "tight_rack", "random"), ("carom_opening", "random")


def _carom_rules(judge: Callable[[RuleState, Facts, Call], Verdict]) -> Rules:
    return Rules(judge, red_to_open, "carom", _CAROM_LAYOUTS, (2, 2), cue_balls=(0, 2), target=10, pockets=False)


RULES: dict[str, Rules] = {
    "straight": Rules(straight, any_ball, "pool", _RACKS, (1, 15), target=0, can_call=True, counts_fouls=True),
    "eight_ball": Rules(eight_ball, group_or_eight, "pool", _RACKS, (15, 15), (2, 2), can_call=True),
    "nine_ball": Rules(
        nine_ball, lowest_ball, "pool", _RACKS, (9, 9), choices=("push_out", "hand_back"), counts_fouls=True
    ),
    "snooker": Rules(
        snooker,
        balls_on,
        "snooker",
        ("snooker", "random"),
        (6, 21),
        (2, 2),
        target=0,
        choices=("hand_back", "replace"),
        spot=spot_colours,
    ),
    "carom": _carom_rules(carom),
    "three_cushion": _carom_rules(three_cushion),
}
