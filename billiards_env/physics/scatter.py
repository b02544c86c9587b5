"""The scatter of cushions: random differences between impacts that the law of the cushions does not explain.

Scatter changes the motion after an impact. Let v be the speed of the ball and R its radius. The speed along the normal
is multiplied by 1 + normal * z, and the speed along the cushion changes by along * z * v. The spins about the normal,
along the cushion and about the vertical axis change by spin * z * v / R. Each z is a separate random number with mean 0
and variance 1, at most 2 sqrt(3) in size. If the ball would have more energy than before the impact, one factor reduces
all speeds and spins. The ball always leaves the cushion, and a mirrored shot has mirrored scatter.

The random numbers depend only on the seed of the shot, the number of the ball and the number of its earlier cushion
contacts, and not on other balls or on the end of the shot. An impact has no scatter if it is on two cushions at one
instant, if it is weak for the contact-time rule, or if the ball is in the air.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.state import SLIDING_AND_ROLLING, UX, UY, VX, VY, WZ

# The constants of SplitMix64 (Steele, Lea and Flood 2014, Fast splittable pseudorandom number generators).
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX, _MIX_AGAIN = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_27, _30, _31, _32 = (np.uint64(bits) for bits in (27, 30, 31, 32))
_16, _PART = np.uint64(16), np.uint64(0xFFFF)
_MEAN, _SCALE = 2.0 * 65535.0, math.sqrt(3.0 / (65536.0**2 - 1.0))  # of the sum of four numbers of 16 bits


class Scatter(NamedTuple):
    """The scatter of the cushions in m shots.

    Attributes:
        deviations: (3,) float64, the standard deviations normal, along and spin.
        seeds: (m,) int64, the seed of each shot; -1 for a shot without scatter.
    """

    deviations: Any
    seeds: Any


@inlined
def _mixed(bits):
    bits = (bits ^ (bits >> _30)) * _MIX
    bits = (bits ^ (bits >> _27)) * _MIX_AGAIN
    return bits ^ (bits >> _31)


@kernel
def scatter_number(key, j):
    """Returns random number j of a key: the sum of four uniform numbers, with mean 0 and variance 1."""
    bits, total = _mixed(key + _GOLDEN * np.uint64(j + 1)), 0.0
    for _ in range(4):
        total += float(bits & _PART)
        bits >>= _16
    return (total - _MEAN) * _SCALE


@inlined
def scatter_key(scatter, k, i, contacts):
    """Returns the key of the random numbers of ball i in shot k after `contacts` cushion contacts, 0 for no scatter."""
    if scatter is None:
        return np.uint64(0)
    if scatter[1][k] < 0:
        return np.uint64(0)
    return _mixed(_mixed(np.uint64(scatter[1][k]) + _GOLDEN) + _GOLDEN * (np.uint64(contacts) << _32 | np.uint64(i)))


@inlined
def _energy(vn, vt, sn, st, rwz):
    """Returns twice the energy of a ball over its mass, m^2/s^2; `sn`, `st` and `rwz` are R times its spins."""
    return vn * vn + vt * vt + 0.4 * (sn * sn + st * st + rwz * rwz)


@inlined
def scatter_limit(scatter, i, state, scene):
    """Returns the energy of ball i, which is its limit after the impact, see `_energy`; 0 without scatter."""
    if scatter is None:
        return 0.0
    s = state.rows[i]
    if scene.numbers.motion != SLIDING_AND_ROLLING:
        return _energy(s[VX], s[VY], 0.0, 0.0, 0.0)
    return _energy(s[VX], s[VY], s[VX] - s[UX], s[VY] - s[UY], scene.radius[i] * s[WZ])


@kernel
def _scatter_motion(deviations, key, i, n, limit, state, scene):  # out: state
    """Adds random differences with these deviations to the motion of ball i after an impact on a cushion."""
    s, (nx, ny), slips, radius = state.rows[i], n, scene.numbers.motion == SLIDING_AND_ROLLING, scene.radius[i]
    normal, along, spin = deviations
    vn, vt = nx * s[VX] + ny * s[VY], nx * s[VY] - ny * s[VX]
    sn, st, rwz = 0.0, 0.0, 0.0
    if slips:
        sn, st, rwz = vn - (nx * s[UX] + ny * s[UY]), vt - (nx * s[UY] - ny * s[UX]), radius * s[WZ]
    speed = norm(vn, vt)
    aside = vt if vt != 0.0 else st if st != 0.0 else rwz  # these three change their signs in a mirror
    turned = speed if aside >= 0.0 else -speed
    vn *= 1.0 + normal * scatter_number(key, 0)
    vt += along * turned * scatter_number(key, 1)
    if slips:
        sn += spin * speed * scatter_number(key, 2)
        st += spin * turned * scatter_number(key, 3)
        rwz += spin * turned * scatter_number(key, 4)
    energy = _energy(vn, vt, sn, st, rwz)
    if energy > limit:
        scale = math.sqrt(limit / energy)
        vn, vt, sn, st, rwz = scale * vn, scale * vt, scale * sn, scale * st, scale * rwz
    s[VX], s[VY] = nx * vn - ny * vt, ny * vn + nx * vt
    if slips:
        s[UX], s[UY] = s[VX] - (nx * sn - ny * st), s[VY] - (ny * sn + nx * st)
        s[WZ] = rwz / radius


@inlined
def scatter_motion(scatter, key, i, n, limit, state, scene):  # out: state
    """Adds the scatter to the motion of a ball after its impact on a cushion.

    Args:
        scatter: `SceneArrays.scatter`: the fields of `Scatter`, or None.
        key: The `scatter_key` of the impact.
        i: The ball.
        n: (nx, ny), the unit normal into the cushion.
        limit: The `scatter_limit` before the impact.
        state: The `State`.
        scene: The `SceneArrays`.
    """
    if scatter is None:
        return
    if key != np.uint64(0):
        deviations = scatter[0]
        _scatter_motion((deviations[0], deviations[1], deviations[2]), key, i, n, limit, state, scene)
