"""Elementary functions from `+ - * /` and `sqrt` only, so that IEEE 754 defines the bits of the results.

The reductions of the argument and the polynomials come from the library fdlibm (Sun Microsystems 1993). The errors
are below 2 ulp, and those of `sine_cosine` below 1e-16 near a zero.
"""

from __future__ import annotations

import math

import numpy as np

from billiards_env.jit import kernel

_LOG2_HI, _LOG2_LO = 6.93147180369123816490e-01, 1.90821492927058770002e-10  # ln 2; the first part has 33 bits
_HALF_PI_HI, _HALF_PI_LO = 1.57079632673412561417e00, 6.07710050650619224932e-11  # pi/2, in the same way
_HALF_PI, _HALF_PI_REST = 1.57079632679489655800e00, 6.12323399573676603587e-17  # pi/2 as a double-double number
_SPLITTER = 134217729.0  # 2^27 + 1


@kernel
def norm(x: float, y: float) -> float:
    """Returns the length of (x, y). It is correct even if the squares underflow."""
    big = max(abs(x), abs(y))
    if big > 1e-140:
        return math.sqrt(x * x + y * y)
    if big == 0.0:
        return 0.0
    return big * math.sqrt((x / big) * (x / big) + (y / big) * (y / big))


@kernel
def exponential(x: float) -> float:
    """Returns e^x for x <= 0; zero below -700."""
    if x < -700.0:
        return 0.0
    k = math.floor(x / (_LOG2_HI + _LOG2_LO) + 0.5)
    hi, lo = x - k * _LOG2_HI, k * _LOG2_LO
    r = hi - lo
    z = r * r
    c = r - z * (
        1.66666666666666019037e-01
        + z
        * (
            -2.77777777770155933842e-03
            + z * (6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08))
        )
    )
    return math.ldexp(1.0 - ((lo - r * c / (2.0 - c)) - hi), int(k))


@kernel
def sine_cosine(x: float) -> tuple[float, float]:
    """Returns the sine and the cosine of x, for abs(x) <= 10."""
    k = math.floor(x / (_HALF_PI_HI + _HALF_PI_LO) + 0.5)
    hi, lo = x - k * _HALF_PI_HI, k * _HALF_PI_LO
    r = hi - lo
    tail = (hi - r) - lo
    z = r * r
    p = 8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04
        + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
    )
    s = r - ((z * (0.5 * tail - z * r * p) - tail) - z * r * -1.66666666666666324348e-01)
    p = z * (
        4.16666666666666019037e-02
        + z
        * (
            -1.38888888888741095749e-03
            + z
            * (
                2.48015872894767294178e-05
                + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
            )
        )
    )
    half = 0.5 * z
    w = 1.0 - half
    c = w + (((1.0 - w) - half) + (z * p - r * tail))
    quarter = int(k) & 3
    if quarter == 0:
        return s, c
    if quarter == 1:
        return c, -s
    if quarter == 2:
        return -s, -c
    return -c, s


@kernel
def _arc_ratio(z: float) -> float:
    """Returns (arcsin(y) - y) / y for z = y^2 <= 1/4."""
    p = z * (
        1.66666666666666657415e-01
        + z
        * (
            -3.25565818622400915405e-01
            + z
            * (
                2.01212532134862925881e-01
                + z * (-4.00555345006794114027e-02 + z * (7.91534994289814532176e-04 + z * 3.47933107596021167570e-05))
            )
        )
    )
    q = 1.0 + z * (
        -2.40339491173441421878e00
        + z * (2.02094576023350569471e00 + z * (-6.88283971605453293030e-01 + z * 7.70381505559019352791e-02))
    )
    return p / q


@kernel
def arccosine(x: float) -> float:
    """Returns the angle in [0, pi] with cosine x, for abs(x) <= 1."""
    if abs(x) < 0.5:
        return _HALF_PI - (x - (_HALF_PI_REST - x * _arc_ratio(x * x)))
    z = 0.5 * (1.0 - abs(x))
    s = math.sqrt(z)
    if x < 0.0:
        return 2.0 * _HALF_PI - 2.0 * (s + (_arc_ratio(z) * s - _HALF_PI_REST))
    t = _SPLITTER * s
    high = t - (t - s)
    rest = (z - high * high) / (s + high) if s > 0.0 else 0.0
    return 2.0 * (high + (_arc_ratio(z) * s + rest))


@kernel
def cos_sin(turns):
    """Returns the cosine (exactly even) and sine (exactly odd) of `turns` half turns, with errors of at most 2e-16."""
    quarters = np.rint(2.0 * turns)
    x = math.pi * (turns - 0.5 * quarters)
    xx = x * x
    c = s = 0.0
    for k in range(9, 0, -1):  # Taylor series for abs(x) <= pi / 4
        c = (1.0 + c) * (-xx / ((2 * k - 1) * (2 * k)))
        s = (1.0 + s) * (-xx / ((2 * k) * (2 * k + 1)))
    c, s = 1.0 + c, x + x * s
    quarter = int(quarters) & 3
    if quarter == 0:
        return c, s
    if quarter == 1:
        return -s, c
    if quarter == 2:
        return -c, -s
    return s, -c
