"""The impact on a cushion by Mathavan, Jackson and Parkin (2010), by collocation.

Gauss's collocation method (Hairer, Norsett and Wanner 1993, section II.7) with `STAGES` stages solves the equation of
the slips: Newton's method has its residuals in the working precision and its derivatives in floats. A slip that begins
is a solution with the slip zero at the start of a step, so no formula of its series is used. The direction in which
Newton's method starts is found by a search over all directions. The variable is the normal impulse, or, if all
contacts without stick slip, one in which a slip that stops decays exponentially. Events end a step: its length is
the root of a function of the state after it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np

from benchmarks.reference.oracle.roots import Real

STAGES = 14
TAIL = 1e-13, 1e-24  # the last coefficient of the rates in a step, and in one in which a slip begins
STOPPED = 1e-24  # slip over the normal velocity below which a slip has stopped


class Nose(NamedTuple):
    """The nose: sine and cosine of its angle above the ball's centre, and the friction at the cushion and the cloth."""

    sin: Any
    cos: Any
    mu: Any
    mu_cloth: Any


@functools.cache
def _gauss(digits: int) -> tuple[list[list[Real]], list[Real], list[Real], list[list[Real]]]:
    """Returns the matrix, the weights and the nodes, and the weights of the last two coefficients of the rates."""
    n = STAGES
    with mpmath.workdps(3 * digits):
        guesses = [0.5 * (1 + float(x)) for x in np.polynomial.legendre.leggauss(n)[0]]
        nodes = [mpmath.findroot(lambda c: mpmath.legendre(n, 2 * c - 1), c) for c in guesses]
        powers = mpmath.matrix(n, n)
        for i in range(n):
            for k in range(n):
                powers[k, i] = nodes[i] ** k
        inverse = powers**-1

        def weights(c: Real) -> list[Real]:
            moments = [c ** (k + 1) / (k + 1) for k in range(n)]
            return [sum(inverse[j, k] * moments[k] for k in range(n)) for j in range(n)]

        whole = weights(mpmath.mpf(1))
        last = [[w * mpmath.legendre(k, 2 * c - 1) for w, c in zip(whole, nodes, strict=True)] for k in (n - 2, n - 1)]
        return [weights(c) for c in nodes], whole, nodes, last


def _friction(z: Sequence[Any], nose: Nose, slips: tuple[bool, bool], lifted: bool, sqrt: Any) -> tuple[Any, ...]:
    """Returns the friction (ax, ay, bx, by) per normal impulse, the press on the cloth, and (rho, sigma)."""
    (x, y, u, v), (sin, cos, mu, mu_cloth) = z, nose
    mu_cloth = 0 * mu_cloth if lifted else mu_cloth
    rho, sigma, g = sqrt(x * x + y * y), sqrt(u * u + v * v), (5 - 2 * sin) / 2
    d, h = (2 - 5 * sin) / 2, (5 + 2 * sin * sin) / 2
    if slips[0]:
        ax, ay = -mu * x / rho, -mu * y / rho
    else:  # 0 = 7/2 ax + d bx, 0 = h ay + g by + sin cos, with (bx, by) = -mu_cloth (sin - cos ay) (u, v) / sigma
        fx, fy = mu_cloth * u / sigma, mu_cloth * v / sigma
        ay = (g * fy * sin - sin * cos) / (h + g * fy * cos)
        ax = 2 * d * fx * (sin - cos * ay) / 7
    press = mu_cloth * (sin - cos * ay)
    if slips[1]:
        return ax, ay, -press * u / sigma, -press * v / sigma, press, rho, sigma
    return ax, ay, -2 * d * ax / 7, 2 * (cos - g * ay) / 7, press, rho, sigma


def _pace(slips: tuple[bool, bool], rho: Any, sigma: Any, plain: bool) -> Any:
    """Returns the rate of the normal impulse."""
    if plain:
        return 1
    return rho * sigma / (rho + sigma) if all(slips) else (rho if slips[0] else sigma)


def _rates(z: Sequence[Any], nose: Nose, how: tuple[tuple[bool, bool], bool, bool], sqrt: Any) -> list[Any]:
    """Returns the rates of (x, y, u, v, vx, work)."""
    (slips, lifted, plain), (sin, cos, *_) = how, nose
    ax, ay, bx, by, _, rho, sigma = _friction(z, nose, slips, lifted, sqrt)
    d, g, h = (2 - 5 * sin) / 2, (5 - 2 * sin) / 2, (5 + 2 * sin * sin) / 2
    pace, none = _pace(slips, rho, sigma, plain), 0 * ax
    nose_rates = (3.5 * ax + d * bx, h * ay + g * by + sin * cos) if slips[0] else (none, none)
    cloth_rates = (d * ax + 3.5 * bx, g * ay + 3.5 * by - cos) if slips[1] else (none, none)
    return [pace * r for r in (*nose_rates, *cloth_rates, ax + bx, cos * (z[3] - z[1]) / (1 + sin))]


def _step(z: list[Real], t: Real, nose: Nose, how: Any, guess: Any) -> tuple[list[Real], float]:
    """Returns (x, y, u, v, vx, work) after a step t, and the last coefficient of the rates.

    `guess` has the slips (4,) at a share of the step, in floats.
    """
    matrix, weights, nodes, last = _gauss(mpmath.mp.dps)
    a, n, dt = np.array(matrix, float), STAGES, float(t)
    stages = [[mpmath.mpf(float(s)) for s in guess(float(c))] for c in nodes]
    numbers = Nose(*map(float, nose))
    for _ in range(60):
        try:
            rates = [_rates(s, nose, how, mpmath.sqrt) for s in stages]
        except ZeroDivisionError:  # the guess of a slip that begins is zero
            break
        off = [
            [z[i] + t * mpmath.fdot(row, [r[i] for r in rates]) - s[i] for i in range(4)]
            for row, s in zip(matrix, stages, strict=True)
        ]
        at, slopes = np.array(stages, float).T, np.empty((n, 4, 4))
        for i in range(4):
            moved = at.astype(complex)
            moved[i] += 1e-100j
            for j, rate in enumerate(_rates(moved, numbers, how, np.sqrt)[:4]):
                slopes[:, j, i] = np.imag(rate) * 1e100
        jacobian = np.eye(4 * n) - dt * np.einsum("ij,jkl->ikjl", a, slopes).reshape(4 * n, 4 * n)
        size = max(abs(x) for row in off for x in row)
        scale = float(size) or 1.0
        residual = np.array([[float(x / scale) for x in row] for row in off]).ravel()
        change = np.linalg.solve(jacobian, residual).reshape(n, 4)
        stages = [
            [s + mpmath.mpf(c) * scale for s, c in zip(*rows, strict=True)] for rows in zip(stages, change, strict=True)
        ]
        if not np.isfinite(change).all():
            break
        if size < mpmath.mpf(10) ** (12 - mpmath.mp.dps):
            after = [z[i] + t * mpmath.fdot(weights, [r[i] for r in rates]) for i in range(6)]
            tails = (mpmath.fdot(row, [r[i] for r in rates]) for row in last for i in range(4))
            return after, 2 * n * dt * float(max(map(abs, tails)))
    return z, np.inf


def _beginning(z: Any, nose: Nose, slips: tuple[bool, bool], lifted: bool) -> tuple[float, float, float]:
    """Returns (x, y), the direction of a slip that begins, and its rate: the rate has the direction of the slip."""
    at, numbers = np.array(z[:4], float), Nose(*map(float, nose))
    contact = 0 if not slips[0] else 2

    def rate(angle: Any) -> Any:
        e = np.cos(angle), np.sin(angle)
        s = list(np.broadcast_to(at[:, None], (4, len(angle))))
        s[contact : contact + 2] = e
        rates = _rates(s, numbers, ((True, True), lifted, True), np.sqrt)[contact : contact + 2]
        return e[0] * rates[1] - e[1] * rates[0], e[0] * rates[0] + e[1] * rates[1]

    low, high = np.linspace(0.0, 2 * np.pi, 721)[:-1] + 0.1, np.linspace(0.0, 2 * np.pi, 721)[1:] + 0.1
    across, along = rate(low), rate(high)
    turns = (across[0] * along[0] <= 0.0) & (np.maximum(across[1], along[1]) > 0.0)
    low, high = low[turns], high[turns]
    for _ in range(60):
        middle = 0.5 * (low + high)
        left = rate(low)[0] * rate(middle)[0] <= 0.0
        low, high = np.where(left, low, middle), np.where(left, middle, high)
    if not len(low):
        return 0.0, 0.0, 0.0
    best = np.argmax(rate(low)[1])
    return float(np.cos(low[best])), float(np.sin(low[best])), float(rate(low)[1][best])


def impact(before: Sequence[Real], nose: Nose, e: Real) -> tuple[Real, ...]:
    """Returns (vx, vy, R wx, R wy, R wz) after an impact, for those before it: x along the cushion and y into it.

    Raises:
        ValueError: If both contacts have no slip at one instant before the end of the impact.
    """
    vx, unit, wx, wy, wz = before
    if not unit > 0:
        return tuple(before)
    sin, cos = nose.sin, nose.cos
    slip_velocities = vx + wy * sin - wz * cos, wx - unit * sin, vx - wy, unit + wx
    z = [s / unit for s in (*slip_velocities, vx, mpmath.mpf(0))]
    tiny = mpmath.mpf(10) ** (8 - mpmath.mp.dps) * (1 + max(map(abs, z)))
    slips = [norm(z[0:2]) > tiny, norm(z[2:4]) > tiny]
    begins, released, compresses, goal, t = [not slips[0], not slips[1]], False, True, mpmath.mpf(0), mpmath.mpf("0.1")
    lifted = None
    while True:
        if not any(slips):
            raise ValueError("before: expected slips that do not stop at one instant")
        lifted, slips, begins, start = _contacts(z, nose, slips, begins, released, lifted)
        plain = any(begins) or released
        how = tuple(slips), lifted, plain
        if plain:  # the variable is the impulse
            t = mpmath.mpf("0.02") * max(norm(z[0:2]), norm(z[2:4]))
        while True:
            after, tail = _step(z, t, nose, how, start(float(t)) if plain else _forward(z, nose, how, float(t)))
            if tail <= TAIL[plain] * float(1 + max(map(abs, z[:4]))):
                break
            t *= mpmath.mpf("0.5") if tail > 1 else mpmath.mpf(max(0.3, 0.8 * (TAIL[plain] / tail) ** (1 / STAGES)))
        longer = min(2.0, 0.8 * (TAIL[plain] / max(tail, 1e-60)) ** (1 / STAGES))
        event, length = None, t
        for name, gap in _gaps(nose, how, begins, compresses, goal):
            if gap(z) >= 0 and gap(after) < 0:
                length, after = _root(gap, z, length, after, nose, how, start if plain else None)
                event = name
        z, begins, released = after, [False, False], False
        t = mpmath.mpf(max(float(t) * longer, 1e-12)) if event is None else max(length, t / 4)
        if plain:
            t = mpmath.mpf("0.3")
        for k in (0, 1):
            if slips[k] and norm(z[2 * k : 2 * k + 2]) < STOPPED:
                slips[k], begins[k], z[2 * k], z[2 * k + 1] = False, True, mpmath.mpf(0), mpmath.mpf(0)
        if event == "lift":
            lifted = not lifted
        elif event in (0, 1):
            slips[event] = True
            begins[event] = released = True
        elif event == "compression":
            compresses, goal = False, (1 - e * e) * z[5]
            if e == 0:
                break
        elif event == "restitution":
            break
    vy, wy = (z[3] - z[1]) / (1 + sin), z[4] - z[2]
    return tuple(unit * w for w in (z[4], vy, z[3] - vy, wy, (z[4] + wy * sin - z[0]) / cos))


def norm(s: Sequence[Real]) -> Real:
    """Returns the size of a vector."""
    return mpmath.sqrt(sum(x * x for x in s))


def _forward(z: Sequence[Real], nose: Nose, how: Any, t: float) -> Callable[[float], Any]:
    """Returns a first guess of the slips in a step: constant rates, which end a falling slip at most by half."""
    at, numbers = np.array(z[:4], float), Nose(*map(float, nose))
    rates = np.array(_rates(list(at), numbers, how, np.sqrt)[:4])
    return lambda c: (
        at
        + rates
        * min(
            c * t,
            *(
                0.5 * np.hypot(*at[k : k + 2]) / max(1e-300, np.hypot(*rates[k : k + 2])) if how[0][k // 2] else np.inf
                for k in (0, 2)
            ),
        )
    )


def _contacts(z: Any, nose: Nose, slips: list[bool], begins: list[bool], released: bool, lifted: Any) -> Any:
    """Finds what the contacts do in the next step.

    Returns:
        (lifted, slips, begins, start): whether the ball leaves the cloth, whether each contact slips, whether each
        contact begins to slip, and a function that returns the first guess of the slips in a step of a given length.
    """
    slips, begins, where = list(slips), list(begins), None
    numbers = Nose(*map(float, nose))
    if slips[0] and lifted is None:
        lifted = bool(nose.sin + nose.mu * nose.cos * z[1] / norm(z[0:2]) < 0)
    if (begins[0] and not released) or (not slips[0] and lifted is None):
        lifted = bool(nose.sin < 0)
        ax, ay, *_ = _friction(z[:4], nose, (False, True), lifted, mpmath.sqrt)
        begins[0] = slips[0] = bool(norm((ax, ay)) > nose.mu)
        if begins[0] and not lifted:
            where = _beginning(z, nose, (False, True), lifted)
            lifted = bool(numbers.sin + numbers.mu * numbers.cos * where[1] < 0)
    if begins[1] and not released:
        _, _, bx, by, press, *_ = _friction(z[:4], nose, (True, False), lifted, mpmath.sqrt)
        begins[1] = slips[1] = bool(norm((bx, by)) > press)
    contact = 0 if begins[0] else 1
    known = (contact != 0, contact != 1)

    def start(t: float) -> Callable[[float], Any]:
        at = np.array(z[:4], float)
        others = [k != contact and slips[k] for k in (0, 1)]
        rates = np.array(_rates(list(at), numbers, ((others[0], others[1]), lifted, True), np.sqrt)[:4])
        rates[2 * contact : 2 * contact + 2] = 0.0
        end = at + t * rates
        first = np.array(_beginning(at, nose, known, lifted))
        last = np.array(_beginning(end, nose, known, lifted))
        if released:
            first = np.array([*last[:2], 0.0])

        def guess(c: float) -> Any:
            s = at + c * t * rates
            speed = t * c * (first[2] + 0.5 * c * (last[2] - first[2]))
            s[2 * contact : 2 * contact + 2] = speed * ((1 - c) * first[:2] + c * last[:2])
            return s

        return guess

    return lifted, slips, begins, start


def _gaps(nose: Nose, how: Any, begins: list[bool], compresses: bool, goal: Real) -> list[tuple[Any, Any]]:
    """Returns the events that may end a step, each with a function of the state that falls below zero there."""
    slips, lifted, _ = how
    gaps: list[tuple[Any, Any]] = []
    if not slips[0]:
        gaps.append((0, lambda z: nose.mu - norm(_friction(z[:4], nose, slips, lifted, mpmath.sqrt)[:2])))
    if not slips[1]:

        def spare(z: Sequence[Real]) -> Real:
            _, _, bx, by, press, *_ = _friction(z[:4], nose, slips, lifted, mpmath.sqrt)
            return press - norm((bx, by))

        gaps.append((1, spare))
    if slips[0] and not begins[0]:
        sign = -1 if lifted else 1
        gaps.append(("lift", lambda z: sign * (nose.sin + nose.mu * nose.cos * z[1] / norm(z[0:2]))))
    if compresses:
        gaps.append(("compression", lambda z: z[3] - z[1]))
    else:
        gaps.append(("restitution", lambda z: z[5] - goal))
    return gaps


def _root(gap: Any, z: Any, t: Real, after: Any, nose: Nose, how: Any, start: Any) -> tuple[Real, Any]:
    """Returns the length of the step, at most t, after which `gap` is zero, and the state then."""
    low, high, last, at, left, right = mpmath.mpf(0), t, mpmath.mpf(0), t, gap(z), gap(after)
    for _ in range(100):
        secant = at - right * (at - last) / (right - left) if right != left else low
        last, at = at, secant if low < secant < high else (low + high) / 2
        after, _ = _step(z, at, nose, how, (start or functools.partial(_forward, z, nose, how))(float(at)))
        left, right = right, gap(after)
        low, high = (at, high) if right > 0 else (low, at)
        if abs(right) < mpmath.mpf(10) ** (16 - mpmath.mp.dps):
            break
    return at, after
