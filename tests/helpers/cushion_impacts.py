"""Impacts on "mathavan2010" cushions, integrated by extrapolation: a second implementation of `physics.laws.mathavan`.

Gragg's method with extrapolation to order 14 (Hairer, Norsett and Wanner 1993, section II.9), for arrays of impacts, is
accurate to about 1e-13. The motion is that of `laws.mathavan_tangent`. A slip at the cushion may stop, and one on the
cloth may begin. Impacts in which a slip on the cloth stops, or one at the cushion begins, are refused.
"""

import numpy as np

SUBSTEPS = (2, 4, 6, 8, 10, 12, 14)


def friction_rates(z, sin, mu, mu_cloth, slips):
    """Returns the rates (6, m) of motions (6, m) per normal impulse."""
    cos, d, g, h = np.sqrt(1.0 - sin * sin), 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    at_nose, at_cloth = (np.where(on, np.hypot(*z[k : k + 2]), 1.0) for k, on in ((0, slips[0]), (2, slips[1])))
    ex, ey = (np.where(slips[1], x / at_cloth, 0.0) for x in z[2:4])
    held_y = np.minimum(-(sin * cos - g * mu_cloth * ey * sin) / (h + g * mu_cloth * ey * cos), sin / cos)
    held_x = mu_cloth * (sin - held_y * cos) * ex * d / 3.5
    ax, ay = np.where(slips[0], -mu * z[:2] / at_nose, (held_x, held_y))
    assert (np.hypot(ax, ay) <= mu * (1.0 + 1e-12)).all(), "a slip at the cushion begins"
    press = mu_cloth * np.maximum(0.0, sin - ay * cos)
    to_x, to_y = np.where(slips[1], (-ex, -ey), (-ax * d / 3.5, (cos - g * ay) / 3.5))
    bx, by = press * to_x / np.hypot(to_x, to_y), press * to_y / np.hypot(to_x, to_y)
    slip_rates = 3.5 * ax + d * bx, h * ay + g * by + sin * cos, d * ax + 3.5 * bx, g * ay + 3.5 * by - cos
    return np.stack((*slip_rates, ax + bx, (z[3] - z[1]) / (1.0 + sin) * cos))


def step(z, h, *constants):
    """Returns the motions after steps h (m,), and their errors (m,)."""
    first, table = friction_rates(z, *constants), []
    for n in SUBSTEPS:
        dt = h / n
        last, now = z, z + dt * first
        for _ in range(n - 1):
            last, now = now, last + 2.0 * dt * friction_rates(now, *constants)
        row = [0.5 * (last + now + dt * friction_rates(now, *constants))]
        for before, m in zip(table, SUBSTEPS[len(table) - 1 :: -1], strict=False):
            row.append(row[-1] + (row[-1] - before) / ((n / m) ** 2 - 1.0))
        table = row
    return table[-1], np.abs(table[-1] - table[-2]).max(axis=0)


def after_impact(before, sin, mu, mu_cloth, e):
    """Returns (vx, vy, rwx, rwy, rwz) after impacts with these motions (5, m), as `mathavan.integrate_impact`."""
    vx, vy, rwx, rwy, rwz = before
    cos = np.sqrt(1.0 - sin * sin)
    z = np.stack((vx + rwy * sin - rwz * cos, rwx - vy * sin, vx - rwy, vy + rwx, vx, 0.0 * vx))
    slips = np.stack((np.full(vx.shape, True), np.hypot(z[2], z[3]) > 0.0))
    compresses, done, goal, h = np.full(vx.shape, True), np.full(vx.shape, False), 0.0 * vx, 0.05 * vy
    for _ in range(3000):
        rate = friction_rates(z, sin, mu, mu_cloth, slips)
        for k, on in ((0, slips[0]), (2, slips[1])):
            size, change = np.hypot(z[k], z[k + 1]), np.hypot(rate[k], rate[k + 1])
            h = np.where(on, np.minimum(h, 0.3 * size / np.where(on, change, 1.0)), h)
        after, error = step(z, h, sin, mu, mu_cloth, slips)
        left, left_after = (np.where(compresses, (x[3] - x[1]) / (1.0 + sin), x[5] - goal) for x in (z, after))
        close = 1e-14 * np.where(compresses, vy, vy * vy)
        at_nose, at_cloth = np.hypot(after[0], after[1]), np.hypot(after[2], after[3])
        imprecise = (error > 2e-14 * vy) | (~slips[1] & (at_cloth > 2e-9 * vy))
        late = ~imprecise & (left_after < -close)
        accepted = ~(done | imprecise | late)
        shorter = left / np.where(late, left - left_after, 1.0)
        z, h = np.where(accepted, after, z), h * np.select((done, imprecise, late), (0.0, 0.5, shorter), 1.6)
        slips[1] |= accepted & (at_cloth > 1e-9 * vy)
        stops = accepted & slips[0] & (at_nose < 1e-15 * vy)
        slips[0] &= ~stops
        z[:2, stops] = 0.0
        assert not (accepted & slips[1] & (at_cloth < 1e-9 * vy)).any(), "the slip on the cloth stops"
        ends = accepted & (left_after <= close)
        done |= ends & ~compresses
        goal = np.where(ends & compresses, (1.0 - e * e) * z[5], goal)
        compresses &= ~ends
        if done.all():
            vy, rwy = (z[3] - z[1]) / (1.0 + sin), z[4] - z[2]
            return np.stack((z[4], vy, z[3] - vy, rwy, (z[4] + rwy * sin - z[0]) / cos))
    raise AssertionError("the impact does not end")


def law(values, height):
    """Returns the motions (5, m) after impacts with `cushion.CushionMotion`, radius, e, mu and mu_cloth: (9, m)."""
    vn, vt, un, ut, rwz, radius, e, mu, mu_cloth = values
    before = np.stack((-vt, vn, un - vn, ut - vt, rwz))
    vx, vy, rwx, rwy, rwz = after_impact(before, height / radius - 1.0, mu, mu_cloth, e)
    return np.stack((vy, -vx, vy + rwx, rwy - vx, rwz))


def law_jacobians(values, height):
    """Returns the derivatives (5, 9, m) of `law` by central differences of order 6; 0 for velocities that are 0."""
    moved = np.repeat(values[:, None, None], 9, 1) * np.ones((9, 6, 1))
    sizes = np.where(values == 0.0, 0.0, np.concatenate((np.maximum(1e-4, 2e-4 * abs(values[:5])), 5e-4 * values[5:])))
    for c in range(9):
        moved[c, c] += np.array([1, -1, 2, -2, 3, -3])[:, None] * sizes[c]
    after = law(moved.reshape(9, -1), height).reshape(5, 9, 6, -1)
    weights = np.array([45.0, -45.0, -9.0, 9.0, 1.0, -1.0]) / 60.0
    return np.einsum("k,rckm->rcm", weights, after) / np.where(sizes > 0.0, sizes, 1.0)
