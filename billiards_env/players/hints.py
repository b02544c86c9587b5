"""What the players use of a game besides its rules."""

from __future__ import annotations

from typing import NamedTuple

from billiards_env.games import Setup
from billiards_env.games.facts import banked
from billiards_env.support.checks import short_name


class Hints(NamedTuple):
    """What the players use of a game.

    Attributes:
        sure_pot: The expected points of a turn with a sure pot, in a game that is won by points.
        pots_any: Whether a legal shot may pot any ball, and not only those that may be touched first.
    """

    sure_pot: float = 1.0
    pots_any: bool = False


HINTS = {
    "straight": Hints(sure_pot=4.0),
    "nine_ball": Hints(pots_any=True),
    "ten_ball": Hints(pots_any=True),
    "snooker": Hints(sure_pot=8.0),
}
"""The games with other hints than the usual ones. Another package may add its game."""


def hints_of(setup: Setup) -> Hints:
    """Returns the hints for a game."""
    return HINTS.get(short_name(setup.rules), Hints())


def only_banks(setup: Setup) -> bool:
    """Returns whether a ball scores only after it hits a cushion."""
    return setup.game_rules.scoring is banked
