"""Finite differences of shots of the 50-digit simulator."""

import mpmath
import numpy as np

from billiards_env import layouts
from reference.oracle import run

STEP = mpmath.mpf(10) ** -25


def differences(scene, places, velocities, max_time):
    """Returns one-sided finite differences (n, 2, n, 4) with a step of 1e-25, and the final positions (n, 2)."""
    n = scene.n_balls
    jacobian = np.zeros((n, 2, n, 4))
    with mpmath.workdps(60):
        start = [
            [mpmath.mpf(x) for x in (*place, *velocity)] for place, velocity in zip(places, velocities, strict=True)
        ]

        def end(values):
            return run(scene, [v[:2] for v in values], [v[2:] for v in values], max_time=max_time).positions

        base = end(start)
        for j in range(n):
            for c in range(4):
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
