"""The impact of two balls with friction, whose coefficient falls with the sliding speed: Alciatore (2019), TP A.14."""

from __future__ import annotations

from billiards_env.jit import inlined
from billiards_env.physics.elementary import exponential
from billiards_env.physics.laws.balls import BallLaw, constant_restitution


@inlined
def falling_friction(numbers, speed):
    """Returns the coefficient of friction of two balls whose surfaces slide at `speed`, m/s."""
    return numbers.mu_limit + numbers.mu_drop * exponential(-numbers.mu_rate * speed)


@inlined
def friction_coefficient(numbers, speed):
    """Returns `falling_friction`. A constant friction needs no exponential."""
    if numbers.mu_drop > 0.0:
        return falling_friction(numbers, speed)
    return numbers.mu_limit


BALLS = BallLaw(constant_restitution, friction_coefficient)
