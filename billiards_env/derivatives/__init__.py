"""The derivatives of recorded shots, the margins to other outcomes, and where there is no derivative.

Modules:
    tangent: Makes the derivative of a law from its source.
    rules: The derivatives of laws that `tangent` does not make.
    state_laws: The laws as functions of the states of balls.
    lanes: The change of balls through a stretch or an event.
    sweeps: How a change passes through a whole shot, forwards and backwards.
    nonsmooth_events: Events without a derivative.
    margin_sweep: The distances to other outcomes.
    passing: The bodies that a ball passes between two events.
    error_bounds: Bounds of the rounding errors of a shot.
    shot_derivatives: The derivatives of shots by name.
    functions: Shots as functions of arrays, for `billiards_env.torch` and `.jax`.
"""

from billiards_env.derivatives.shot_derivatives import (
    certainty,
    jacobian,
    jvp,
    margins,
    nonsmooth,
    sensitivities,
    sensitivity,
    vjp,
)

__all__ = ["certainty", "jacobian", "jvp", "margins", "nonsmooth", "sensitivities", "sensitivity", "vjp"]
