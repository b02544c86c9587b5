"""Colours and proportions of all pictures.

The ball colours are those of Okabe and Ito (2008), which colour-blind readers can distinguish, in the order of pool
balls. The seventh is wine from Tol (2021) and the eighth is black. Balls 9 to 15 are striped, and each object ball has
its number, so no information depends on colour alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from billiards_env.scene import Scene

CLOTH, CUSHION, RAIL, POCKET = "#dfe9e2", "#a9c4b1", "#7a5c43", "#1c1c1c"
PAPER, INK, CHALK, GREY = "#ffffff", "#222222", "#ffffff", "#6b6b6b"

RAIL_SHARE, CUSHION_SHARE = 0.04, 0.014
"""Widths of the drawn rail and cushion over the table's length."""

ARROW, ARROW_START = 0.09, 1.4
"""Length of an arrow over the speed, s; distance of its start from the ball's centre over the radius."""

_POOL = ("#f0e442", "#0072b2", "#d55e00", "#cc79a7", "#e69f00", "#009e73", "#882255", "#1c1c1c")
_CAROM = ("#d55e00", "#f0e442")
_DARK = ("#0072b2", "#882255", "#1c1c1c", GREY)

KINDS = {
    "ball_ball": "hits ball",
    "cushion": "hits a cushion",
    "pocket": "is potted",
    "sliding_rolling": "begins to roll",
    "rolling_rest": "stops",
    "spinning_rest": "stops spinning",
}
"""The text of each event kind, after the name of the ball."""


class Look(NamedTuple):
    """The appearance of a ball.

    Attributes:
        fill: Colour of the ball.
        ink: Colour of its number.
        path: Colour of its path, visible on the cloth.
        striped: Whether only a band has the colour.
        number: The number on the ball; empty for the cue ball.
    """

    fill: str
    ink: str
    path: str
    striped: bool
    number: str


def looks(scene: Scene) -> tuple[Look, ...]:
    """Returns the look of each ball: white, red and yellow in carom, otherwise pool balls; fixed balls are grey."""
    carom = not scene.table.pockets and scene.n_balls <= 3
    colours = _CAROM if carom else _POOL
    balls = [Look(CHALK, INK, "#555555", False, "")]
    for i in range(1, scene.n_balls):
        fill = GREY if math.isinf(scene.balls.mass[i]) else colours[(i - 1) % len(colours)]
        striped = fill != GREY and not carom and i % 16 > 8
        ink = CHALK if fill in _DARK else INK
        path = "#b3a600" if fill == "#f0e442" else fill
        balls.append(Look(fill, ink, path, striped, str(i)))
    return tuple(balls)
