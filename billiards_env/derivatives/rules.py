"""The tangents of kernels that `derivatives.tangent` does not make from their sources.

These are elementary functions, the solutions of equations, and kernels with a branch that has the value of the other
branch but another derivative.
"""

from __future__ import annotations

import math

from billiards_env.derivatives.tangent import rule, tangent_of
from billiards_env.jit import expanded, inlined
from billiards_env.physics.elementary import arccosine, exponential, norm, sine_cosine
from billiards_env.physics.laws.balls import rub, rubbed
from billiards_env.physics.laws.balls_frictional import falling_friction, friction_coefficient
from billiards_env.physics.laws.cushion_han2005_variable import gain_is_smooth, han2005_variable
from billiards_env.physics.laws.cushion_mathavan2010 import impact_is_smooth, mathavan2010
from billiards_env.physics.laws.cushion_stronge import known_end
from billiards_env.physics.laws.mathavan import bracketed_rate, bracketed_root, room, step_length

SMOOTH = {mathavan2010: impact_is_smooth, han2005_variable: gain_is_smooth}
"""For each law of cushions that has states without a derivative, the kernel that finds them."""


@rule(norm)
@inlined
def _d_norm(x, y, d_x, d_y):
    size = math.sqrt(x * x + y * y)  # unlike `norm`, the compiler can compute it once for all directions
    return size, (x / size) * d_x + (y / size) * d_y if size > 0.0 else 0.0


@rule(exponential)
@inlined
def _d_exponential(x, d_x):
    value = exponential(x)
    return value, value * d_x


@rule(sine_cosine)
@inlined
def _d_sine_cosine(x, d_x):
    sin, cos = sine_cosine(x)
    return (sin, cos), (cos * d_x, -sin * d_x)


@rule(arccosine)
@inlined
def _d_arccosine(x, d_x):
    square = 1.0 - x * x
    return arccosine(x), -d_x * (1.0 / math.sqrt(square)) if square > 0.0 else 0.0


@rule(known_end)
@inlined
def _d_known_end(end, *others):
    return end, 0.0  # the motion after the impact does not depend on this time in first order


@rule(room)
@expanded
def _d_room():
    return room(), room()


rule(step_length)(None)  # the solution does not depend on the steps
for _iteration in (bracketed_root, bracketed_rate):
    rule(_iteration)(None)  # a step of Newton's method follows, and has the derivative
for _constant in ((), ("numbers",)):
    rule(friction_coefficient, constant=_constant)(tangent_of(falling_friction, constant=_constant))
for _constant in (("sign",), ("sign", "tilt")):
    rule(rub, constant=_constant)(tangent_of(rubbed, constant=_constant))
