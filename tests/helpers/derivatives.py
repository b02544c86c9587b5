"""Finite differences of shots of the 50-digit simulator."""

import dataclasses
from unittest import mock

import mpmath
import numpy as np

from billiards_env.scene import layouts
from reference.oracle import run
from reference.oracle.laws import World

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


def changed_world(change):
    """Lets the 50-digit simulator use `change(world)` in place of each world."""
    plain = World.of
    return mock.patch.object(World, "of", lambda scene, digits: change(plain(scene, digits)))


def changed_constant(name, tangent, scene):
    """Returns the function that changes a radius, a mass or a number of physics of a world by STEP times a tangent."""

    def change(world):
        if name == "radius":
            return dataclasses.replace(
                world, radius=tuple(r + STEP * x for r, x in zip(world.radius, tangent, strict=True))
            )
        if name == "mass":
            inverse = tuple(
                1 / (1 / i + STEP * x) if i else i for i, x in zip(world.inverse_mass, tangent, strict=True)
            )
            return dataclasses.replace(world, inverse_mass=inverse)
        if name in ("mu_ball", "mu_ball_factor"):
            a, b, c = world.ball_friction
            factor = mpmath.mpf(scene.physics.mu_ball_factor)
            if name == "mu_ball":
                return dataclasses.replace(world, ball_friction=(a + factor * STEP * tangent, b, c))
            share = STEP * tangent / factor
            return dataclasses.replace(world, ball_friction=(a + a * share, b + b * share, c))
        return dataclasses.replace(world, **{name: getattr(world, name) + STEP * tangent})

    return change


def directional_differences(scene, start, name, tangent, max_time):
    """Returns one-sided differences of all outputs of `shots.gradients` along a tangent of one input.

    The events are in the order of their balls.

    Args:
        scene: The scene.
        start: Positions (n, 2), velocities (n, 2) and spins (n, 3).
        name: The input.
        tangent: Its change.
        max_time: The time of the outputs, s; None for the end of the shot.
    """
    with mpmath.workdps(60):

        def outputs(step):
            values = {
                key: [[mpmath.mpf(x) for x in row] for row in rows]
                for key, rows in zip(("positions", "velocities", "spins"), start, strict=True)
            }
            if name in values:
                for row, change in zip(values[name], tangent, strict=True):
                    row[:] = [x + step * d for x, d in zip(row, change, strict=True)]
                return found(run(scene, *values.values(), max_time=max_time))
            with changed_world(changed_constant(name, tangent, scene) if step else lambda world: world):
                return found(run(scene, *values.values(), max_time=max_time))

        def found(shot):
            events = sorted(shot.events, key=lambda e: e.ball)  # those of one ball keep their order
            pieces = [min(shot.segments[e.ball], key=lambda piece, e=e: abs(piece.start - e.time)) for e in events]
            places, times = [piece.position for piece in pieces], [e.time for e in events]
            return {
                "positions": shot.positions,
                "velocities": shot.velocities,
                "spins": shot.spins,
                "event_times": times,
                "event_positions": places,
            }

        base, moved = outputs(0), outputs(STEP)

        def difference(a, b):
            return (
                float((b - a) / STEP) if isinstance(a, mpmath.mpf) else [difference(*p) for p in zip(a, b, strict=True)]
            )

        return {key: np.array(difference(base[key], moved[key])) for key in base}
