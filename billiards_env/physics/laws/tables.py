"""The laws of cushions and of two balls by name.

Each law is in a module of its own: `cushion_*` with the constant `CUSHION` and `balls_*` with the constant `BALLS`.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from typing import Any, NamedTuple

from billiards_env.physics.laws.balls import BallLaw
from billiards_env.physics.laws.cushion import Cushion
from billiards_env.scene import scene as scenes


def _entries(names: Iterable[str], modules: str, constant: str) -> dict[str, Any]:
    """Returns the constant of the module of each name."""
    package = __name__.rpartition(".")[0]
    return {name: getattr(importlib.import_module(f"{package}.{modules}_{name}"), constant) for name in names}


CUSHIONS: dict[str, Cushion] = _entries(scenes.CUSHION_NAMES, "cushion", "CUSHION")
"""The cushions of scenes."""
BALL_LAWS: dict[str, BallLaw] = _entries(scenes.BALL_BALL_NAMES, "balls", "BALLS")
"""The laws of two balls."""


class Laws(NamedTuple):
    """The laws of the impacts of a scene, as kernels.

    Attributes:
        restitution: `BallLaw.restitution`.
        friction: `BallLaw.friction`; None for balls without friction.
        cushion: `Cushion.law`.
    """

    restitution: Any
    friction: Any
    cushion: Any


def laws_of(ball_ball: str, cushion: str) -> Laws:
    """Returns the laws with these names."""
    law = BALL_LAWS[ball_ball]
    return Laws(law.restitution, law.friction, CUSHIONS[cushion].law)
