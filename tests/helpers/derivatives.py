"""Finite differences of shots of the 50-digit simulator."""

import mpmath
import numpy as np

from billiards_env.scene import layouts
from reference.oracle import run

STEP = mpmath.mpf(10) ** -25


def differences(scene, places, velocities, max_time, spins=None):
    """Returns one-sided finite differences (n, 2, n, 7) with a step of 1e-25, and the final positions (n, 2).

    The derivatives with respect to spins are zero without `spins`, (n, 3).
    """
    n = scene.n_balls
    jacobian = np.zeros((n, 2, n, 7))
    turns = [[0.0] * 3] * n if spins is None else spins
    with mpmath.workdps(60):
        start = [
            [mpmath.mpf(x) for x in (*place, *velocity, *spin)]
            for place, velocity, spin in zip(places, velocities, turns, strict=True)
        ]

        def end(values):
            given = None if spins is None else [v[4:] for v in values]
            start = [v[:2] for v in values], [v[2:4] for v in values]
            return run(scene, *start, given, max_time=max_time).positions

        base = end(start)
        for j in range(n):
            for c in range(4 if spins is None else 7):
                moved = [row[:] for row in start]
                moved[j][c] += STEP
                if c > 1 and not any(velocities[j]):
                    continue  # the positions are not differentiable at zero velocity
                after = end(moved)
                for i in range(n):
                    jacobian[i, :, j, c] = [float((after[i][k] - base[i][k]) / STEP) for k in range(2)]
    return jacobian, base


def aimed(scene, seed):
    """Returns random positions, and velocities with the cue ball aimed at ball 1."""
    rng = np.random.default_rng(seed)
    places = layouts.draw("random", scene, rng)
    velocities = np.zeros_like(places)
    to = places[1] - places[0]
    velocities[0] = 2.0 * to / np.hypot(*to) + rng.normal(0.0, 0.05, 2)
    return places, velocities
