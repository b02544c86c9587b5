"""A 50-digit simulator, written from the laws of motion and impact.

It shares no code with the engine. Every number is an `mpmath.mpf`. Event times are found by isolating all real roots of
the gap polynomial, and the next event is the earliest at which a pair touches *and approaches*. Floats are used only to
show, with a margin far above their rounding, that a pair cannot meet before some time.

>>> from billiards_env.scene import Scene
>>> shot = reference_shot(Scene.named("carom", 0), [[0.0, 0.0]], [1.0, 0.0])
>>> [event.kind for event in shot.events], shot.status
(['sliding_rolling', 'cushion', 'sliding_rolling', 'rolling_rest'], 'rest')
"""

from benchmarks.reference.oracle.simulate import (
    CollapseError,
    Event,
    OracleError,
    OracleShot,
    RestingContactError,
    reference_shot,
)

__all__ = ["CollapseError", "Event", "OracleError", "OracleShot", "RestingContactError", "reference_shot"]
