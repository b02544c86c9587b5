"""The laws of cushions and of two balls by name, and the choice of a law, for which numba compiles only its code.

Each law is in a module of its own: `cushion_*` with the constant `CUSHION` and `balls_*` with the constant `BALLS`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable
from typing import Any

from billiards_env.jit import inlined
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

CUSHION_LAWS = tuple(dict.fromkeys(cushion.law for cushion in CUSHIONS.values()))
RESTITUTIONS = tuple(dict.fromkeys(law.restitution for law in BALL_LAWS.values()))
FRICTIONS = tuple(dict.fromkeys(law.friction for law in BALL_LAWS.values() if law.friction is not None))
"""The kernels of these laws, each once."""


def choice(kernels: tuple[Callable[..., Any], ...], chosen: Callable[..., Any]) -> tuple[tuple[Any, Any], ...]:
    """Returns the choice of a kernel for `by_law`: (None, True) for each kernel before it, and (True, None) for it.

    It does not depend on the kernels after it. So a new law at the end changes the types of no other scene.
    """
    return ((None, True),) * kernels.index(chosen) + ((True, None),)


def by_law(kernel: Callable[..., Any], *others: Callable[..., Any]) -> Callable[..., Any]:
    """Returns a kernel that calls one of the given kernels, that of the scene's law.

    The arguments of the returned kernel are the `choice` and a tuple with the arguments of the given kernel. Numba
    compiles only the kernel that is called. In a condition `x is None` it leaves out the other branch if x is None, but
    no branch if x is not None, so each law has two arguments of which one is None.
    """
    others_by_law: Any = by_law(*others) if others else None

    @inlined
    def call(is_law, is_other, laws, arguments):
        if is_law is None:
            if is_other is None:
                raise ValueError  # never
            return others_by_law(laws[1:], arguments)
        return kernel(*arguments)

    @inlined
    def call_last(laws, arguments):
        return kernel(*arguments)

    @inlined
    def call_first(laws, arguments):
        is_law, is_other = laws[0]
        return call(is_law, is_other, laws, arguments)

    return call_first if others else call_last


_restitution, _friction = by_law(*RESTITUTIONS), by_law(*FRICTIONS)


@inlined
def restitution_of(law, numbers, closing):
    """Returns the restitution of two balls that approach at `closing`, m/s; `law` is `SceneArrays.ball_restitution`."""
    return _restitution(law, (numbers, closing))


@inlined
def friction_of(law, numbers, speed):
    """Returns the coefficient of friction at a sliding speed, m/s; `law` is `SceneArrays.ball_friction`."""
    return _friction(law, (numbers, speed))
