"""How velocities change at a contact."""

from __future__ import annotations

import math

import numpy as np

from billiards_env.physics.complementarity import MOST, WIDTH, solve_complementarity
from billiards_env.physics.jit import allocating, kernel, merged
from billiards_env.physics.state import (
    CUSHION,
    CUSHION_HEIGHT,
    E_CUSHION,
    HAN2005,
    MOTION,
    MU_CUSHION,
    SLIDING_AND_ROLLING,
    UX,
    UY,
    VX,
    VY,
    WZ,
)

DIRECT = True  # the saving of `joint_impulses`, for benchmarks.ablation to compile without
_SWEEPS = 2000


@kernel
def pair_impulse(closing, inv_mass_i, inv_mass_j, e):
    """Impulse along the line of centres of two smooth balls that close in at speed `closing`, kg m/s.

    The relative normal velocity is reversed and multiplied by e; e = 1 and like masses exchange the normal velocities.
    """
    return (1.0 + e) * closing / (inv_mass_i + inv_mass_j)


@kernel
def han2005(vn, vt, un, ut, rwz, radius, params):
    """Ball against cushion with friction and spin, after Han (2005), Dynamics in Carom and Three Cushion Billiards.

    The cushion's nose touches the ball at height h, an angle theta above its centre with sin(theta) = h/R - 1. At the
    point of contact friction either stops the slip or acts against it throughout (his equations 14 to 23). The ball
    stays on the table: its vertical velocity is dropped, as his carom model does.

    Args:
        vn: Velocity into the cushion, > 0, m/s.
        vt: Velocity along the tangent t = z x n, m/s.
        un: Slip on the cloth along n and t, m/s.
        ut: See un.
        rwz: Spin about the vertical axis times the radius, m/s.
        radius: m.
        params: (N_PARAMS,) float64.

    Returns:
        (vn, vt, un, ut, rwz) after the impact; vn <= 0.
    """
    e, mu = params[E_CUSHION], params[MU_CUSHION]
    sin = params[CUSHION_HEIGHT] / radius - 1.0
    cos = math.sqrt(1.0 - sin * sin)
    # Spin in terms of slip: R omega_t = vn - un, R omega_n = ut - vt.
    rwt, rwn = vn - un, ut - vt
    sx = vn * sin + rwt
    sy = -vt - rwz * cos + rwn * sin
    pze = (1.0 + e) * vn * cos  # impulses per mass
    slip = math.sqrt(sx * sx + sy * sy)
    if slip * (2.0 / 7.0) <= mu * pze:
        pxe, pye = sx * (2.0 / 7.0), sy * (2.0 / 7.0)
    else:
        pxe, pye = mu * pze * (sx / slip), mu * pze * (sy / slip)
    px = -pxe * sin - pze * cos
    pz = pxe * cos - pze * sin
    vn_after = min(0.0, vn + px)  # a high, dead, rough cushion would have the ball climb it
    vt += pye
    rwn -= 2.5 * pye * sin
    rwt += 2.5 * (px * sin - pz * cos)
    rwz += 2.5 * pye * cos
    return vn_after, vt, vn_after - rwt, vt + rwn, rwz


@kernel
def reflect(state, i, side, elastic, radius, params):
    """Changes ball i's velocity, slip and spin as cushion `side` (0 to 3: -x, +x, -y, +y) does.

    Where `elastic`, its normal velocity is just turned round.
    """
    s = state[i]
    n, t = (VX, VY) if side < 2 else (VY, VX)
    un, ut = n + UX - VX, t + UX - VX  # the columns of the slip
    sign = 1.0 if side % 2 else -1.0
    turn = sign if side < 2 else -sign  # the tangent z x n of side +x is +y, that of +y is -x
    if params[CUSHION] == HAN2005 and not elastic:
        speed = max(0.0, sign * s[n])
        after = han2005(speed, turn * s[t], sign * s[un], turn * s[ut], radius[i] * s[WZ], radius[i], params)
        s[n], s[t], s[un], s[ut] = sign * after[0], turn * after[1], sign * after[2], turn * after[3]
        s[WZ] = after[4] / radius[i]
    else:
        normal = -(1.0 if elastic else params[E_CUSHION]) * s[n]
        if params[MOTION] == SLIDING_AND_ROLLING:
            s[un] += normal - s[n]
        s[n] = normal


@kernel
def _quantum(largest, n_terms):
    """A number that, added and subtracted, rounds values up to `largest` to multiples of which n_terms sum exactly."""
    _, exponent = math.frexp(largest)
    _, spare = math.frexp(float(n_terms))
    return math.ldexp(1.5, exponent + max(2, spare - 1))


@allocating
def impulse_scratch(n, most):
    """Scratch space for up to `most` simultaneous impacts of n balls.

    (impulse, slipping, ones, work, direct, dv, done), of which `ones` (most,) stays 1.0 and `done` (n,) False between
    calls; `slipping` (most,) is for the contact-time rule, the others for `joint_impulses`.
    """
    return (
        np.empty(most),
        np.empty(most),
        np.ones(most),
        np.empty((4, most)),
        np.empty((min(most, MOST), WIDTH)),
        np.empty((n, 2)),
        np.zeros(n, np.bool_),
    )


@kernel
def joint_impulses(n_contacts, first, second, nx, ny, closing, inv_mass, impulse, work, direct, dv, dv_done):
    """Plastic impulses of several contacts at one instant: the least that leave no contact approaching.

    They solve the linear complementarity problem 0 <= p, 0 <= N^T (v + M^-1 N p), p . N^T (v + M^-1 N p) = 0.
    Multiplied by 1 + e they are the generalised reflection of Smith, Kaufman, Vouga, Tamstorf and Grinspun (2012),
    Reflections on Simultaneous Impact, which keeps momentum and, for e = 1, energy, and treats all contacts alike.

    Few contacts are solved directly, see `complementarity`; many by an accelerated projected gradient (Nesterov 1983,
    with the restart of O'Donoghue and Candes 2015), scaled to a unit diagonal, in which every sum over a ball's
    contacts is formed from terms rounded to a common multiple (Demmel and Nguyen 2013, Fast Reproducible Floating-Point
    Summation), hence exactly. Either way the result does not depend on how balls and contacts are numbered, and mirrors
    bit for bit.

    Args:
        n_contacts: Number of contacts, > 1.
        first: Ball of each contact, (>= n_contacts,) int64; second is the other.
        second: See first.
        nx: Unit normals from first to second.
        ny: See nx.
        closing: Speeds of approach, > 0, m/s.
        inv_mass: (n,) float64, 1/kg.
        impulse: (>= n_contacts,) out, kg m/s.
        work: (4, >= n_contacts) float64 scratch.
        direct: (>= min(n_contacts, MOST), WIDTH) float64 scratch of `complementarity`.
        dv: (n, 2) float64 scratch: velocity changes, m/s.
        dv_done: (n,) bool scratch.
    """
    # work: 0 the scale of a contact, 1 the extrapolated point, 2 the last iterate, 3 its last step
    for c in range(n_contacts):
        work[0, c] = 1.0 / math.sqrt(inv_mass[first[c]] + inv_mass[second[c]])
        work[1, c] = work[2, c] = 0.0
    if n_contacts == 2:
        b0, b1 = closing[0] * work[0, 0], closing[1] * work[0, 1]
        a = _coupling(0, 1, first, second, nx, ny, inv_mass) * work[0, 0] * work[0, 1]
        if a * a < 1.0:  # else one ball lies in two fixed ones, in a row
            p0, p1 = (b0 - a * b1) / (1.0 - a * a), (b1 - a * b0) / (1.0 - a * a)
            if p0 <= 0.0:
                p0, p1 = 0.0, b1
            elif p1 <= 0.0:
                p0, p1 = b0, 0.0
            impulse[0], impulse[1] = p0 * work[0, 0], p1 * work[0, 1]
            return
    if (
        DIRECT
        and n_contacts <= MOST
        and _solve_directly(n_contacts, first, second, nx, ny, closing, inv_mass, work, direct, impulse)
    ):
        return
    bound = 1.0  # of the largest eigenvalue: the largest absolute row sum
    largest = 0.0
    for c in range(n_contacts):
        row = 1.0
        for k in range(n_contacts):
            if k != c:
                term = abs(_coupling(c, k, first, second, nx, ny, inv_mass)) * work[0, c] * work[0, k]
                row += math.ldexp(math.ceil(math.ldexp(term, 20)), -20)  # a sum of such is exact in any order
        bound = max(bound, row)
        largest = max(largest, closing[c] * work[0, c])
    theta = 1.0
    for _ in range(_SWEEPS):
        apply_impulses(n_contacts, first, second, nx, ny, work[1], work[0], inv_mass, dv, dv_done)
        change = 0.0
        for c in range(n_contacts):
            i, j = first[c], second[c]
            opening = nx[c] * (dv[j, 0] - dv[i, 0]) + ny[c] * (dv[j, 1] - dv[i, 1]) - closing[c]
            new = max(0.0, work[1, c] - opening * work[0, c] / bound)
            work[3, c] = new - work[2, c]
            work[2, c] = new
            change = max(change, abs(work[3, c]))
        if change <= 2e-16 * largest:
            break
        uphill = False
        for c in range(n_contacts):
            back = (work[1, c] - work[2, c]) * work[3, c] > 0.0
            uphill = uphill or (back and abs(work[3, c]) > 0.5 * change)
        theta_next = 1.0 if uphill else 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * theta * theta))
        momentum = 0.0 if uphill else (theta - 1.0) / theta_next
        theta = theta_next
        for c in range(n_contacts):
            work[1, c] = work[2, c] + momentum * work[3, c]
    for c in range(n_contacts):
        impulse[c] = work[2, c] * work[0, c]


@merged
def _solve_directly(n_contacts, first, second, nx, ny, closing, inv_mass, work, direct, impulse):
    """The impulses by `solve_complementarity`, scaled by work[0]; returns whether it found them."""
    for c in range(n_contacts):
        direct[c, c], direct[c, 2 * MOST] = 1.0, closing[c] * work[0, c]
        for k in range(c):
            coupling = _coupling(c, k, first, second, nx, ny, inv_mass) * (work[0, c] * work[0, k])
            direct[c, k] = direct[k, c] = coupling
    found = solve_complementarity(n_contacts, impulse, direct)
    for c in range(n_contacts):
        impulse[c] *= work[0, c]
    return found


@kernel
def _coupling(c, k, first, second, nx, ny, inv_mass):
    """How much a unit impulse at contact k opens contact c, 1/kg; the two differ and share a ball at most."""
    nn = nx[c] * nx[k] + ny[c] * ny[k]
    if first[c] == first[k]:
        return nn * inv_mass[first[c]]
    if second[c] == second[k]:
        return nn * inv_mass[second[c]]
    if first[c] == second[k]:
        return -nn * inv_mass[first[c]]
    if second[c] == first[k]:
        return -nn * inv_mass[second[c]]
    return 0.0


@kernel
def apply_impulses(n_contacts, first, second, nx, ny, impulse, scale, inv_mass, dv, dv_done):
    """Velocity changes `dv` (n, 2) that follow from impulses times scale along the contacts' normals, order-free."""
    largest = 0.0
    for c in range(n_contacts):
        for k in (first[c], second[c]):
            dv[k, 0] = dv[k, 1] = 0.0
            dv_done[k] = False
        largest = max(largest, abs(impulse[c] * scale[c]))
    if largest == 0.0:
        return
    # Two terms have the same sum in either order; more are made to by rounding them to a common multiple.
    quantum = _quantum(largest, n_contacts) if n_contacts > 2 else 0.0
    for c in range(n_contacts):
        p = impulse[c] * scale[c]
        px, py = (p * nx[c] + quantum) - quantum, (p * ny[c] + quantum) - quantum
        i, j = first[c], second[c]
        dv[i, 0] -= px
        dv[i, 1] -= py
        dv[j, 0] += px
        dv[j, 1] += py
    for c in range(n_contacts):
        for k in (first[c], second[c]):
            if not dv_done[k]:
                dv[k, 0] *= inv_mass[k]
                dv[k, 1] *= inv_mass[k]
                dv_done[k] = True


@kernel
def kick(state, i, dvx, dvy, params):
    """Changes ball i's velocity; its spin stays, so the slip changes as much."""
    s = state[i]
    s[VX] += dvx
    s[VY] += dvy
    if params[MOTION] == SLIDING_AND_ROLLING:
        s[UX] += dvx
        s[UY] += dvy


@merged
def exchange(count, e, state, params, inv_mass, first, second, nx, ny, closing, scratch):
    """Changes the balls' velocities as `count` impacts at one instant do.

    Args:
        count: Number of contacts in first, second, nx, ny, closing.
        e: Restitution.
        state: (n, WIDTH) float64.
        params: (N_PARAMS,) float64.
        inv_mass: (n,) float64, 1/kg.
        first: (>= count,) int64, a ball of each contact; second the other.
        second: See first.
        nx: (>= count,) unit normals from first to second.
        ny: See nx.
        closing: (>= count,) speeds of approach, m/s.
        scratch: An `impulse_scratch`.
    """
    impulse, _, ones, work, direct, dv, done = scratch
    if count == 1:
        i, j = first[0], second[0]
        p = pair_impulse(closing[0], inv_mass[i], inv_mass[j], e)
        kick(state, i, -p * inv_mass[i] * nx[0], -p * inv_mass[i] * ny[0], params)
        kick(state, j, p * inv_mass[j] * nx[0], p * inv_mass[j] * ny[0], params)
        return
    joint_impulses(count, first, second, nx, ny, closing, inv_mass, impulse, work, direct, dv, done)
    for c in range(count):
        impulse[c] *= 1.0 + e
    apply_impulses(count, first, second, nx, ny, impulse, ones, inv_mass, dv, done)
    for c in range(count):
        for k in (first[c], second[c]):
            if done[k]:
                kick(state, k, dv[k, 0], dv[k, 1], params)
                done[k] = False
