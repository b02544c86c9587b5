"""The facts of a shot that the rules use, from the events of a recorded shot or from a batch of shots."""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

CUE = 0
"""The cue ball's number in the games with pockets."""


class Facts(NamedTuple):
    """The facts of a shot that the rules use.

    Attributes:
        first: The balls that the cue ball touched first: none, one, or several touched at the same instant.
        touched: The balls that the cue ball touched, in order, each with the number of cushion contacts that the cue
            ball had before.
        potted: The potted balls, in order.
        cushion_after: Whether any ball hit a cushion or was potted after the cue ball's first contact with a ball.
        driven: The object balls that hit a cushion or were potted (WPA 8.4).
        pockets: The pockets of the potted balls, in the same order.
        cue_driven: Whether the cue ball hit a cushion or was potted (WPA 8.4).
    """

    first: tuple[int, ...] = ()
    touched: tuple[tuple[int, int], ...] = ()
    potted: tuple[int, ...] = ()
    cushion_after: bool = False
    driven: frozenset[int] = frozenset()
    pockets: tuple[int, ...] = ()
    cue_driven: bool = False


def facts_of(events: NDArray[Any], cue: int = CUE) -> Facts:
    """Returns the facts of a recorded shot of the ball `cue` from its `ShotResult.events`."""
    first: list[int] = []
    first_time = None
    touched: dict[int, int] = {}
    potted: dict[int, int] = {}
    driven: set[int] = set()
    cushions, cushion_after = 0, False
    columns = (events[name].tolist() for name in ("time", "kind", "ball", "other"))
    for time, kind, ball, other in zip(*columns, strict=True):
        if kind == "ball_ball" and cue in (ball, other):
            hit = other if ball == cue else ball
            touched.setdefault(hit, cushions)
            first_time = time if first_time is None else first_time
            if time == first_time and hit not in first:
                first.append(hit)
        elif kind in ("cushion", "pocket"):
            cushion_after = cushion_after or first_time is not None
            if ball != cue:
                driven.add(ball)
            elif kind == "cushion":
                cushions += 1
            if kind == "pocket":
                potted[ball] = other
    return Facts(
        tuple(first),
        tuple(touched.items()),
        tuple(potted),
        cushion_after,
        frozenset(driven),
        tuple(potted.values()),
        cushions > 0 or cue in potted,
    )
