"""Shots for tests of derivatives, and finite differences of shots of the 50-digit reference."""

import dataclasses
import math
from typing import Any
from unittest import mock

import mpmath
import numpy as np

from benchmarks.reference.oracle import reference_shot
from benchmarks.reference.oracle.laws import World
from billiards_env import Scene, simulate
from billiards_env.scene import Balls, Physics, Table, ball_friction, layouts
from tests.helpers.outlines import MARBLES
from tests.helpers.shots import real

STEP = mpmath.mpf(10) ** -25
FALLING: dict[str, Any] = {"e_cushion": 0.93, "e_cushion_loss": 0.1, "e_cushion_onset": 0.2, "e_cushion_floor": 0.6}
VARIABLE: dict[str, Any] = {"e_cushion_topspin": 0.04, "e_cushion_tangent": 0.07, "e_cushion_slip": 0.05}
SCENES = {
    "ideal": Scene.named("ideal", 2),
    "rolling": Scene(Balls((0.03, 0.03, 0.04), (0.17, 0.3, 0.2)), Table(2.0, 1.0), Physics("rolling", "restitution")),
    "sliding": Scene(Balls.uniform(3), Table(2.0, 1.0), Physics(cushion="restitution")),
    "han2005": dataclasses.replace(Scene.named("carom", 2), physics=Physics(**FALLING)),
    "stronge": real("carom", 2, **FALLING),
    "variable": dataclasses.replace(  # the engines of "match_carom"
        Scene.named("match_carom", 2),
        physics=Physics(ball_ball="frictional", cushion="han2005_variable", **VARIABLE, mu_roll_speed=0.004),
    ),
    "grip": real("carom", 2, mu_ball=0.05, mu_cushion=0.5),
    "floor": real("carom", 2, **{**FALLING, "e_cushion_floor": 0.9, "mu_cushion": 0.05}),
    "jaws": Scene.named("real_pool", 2),
    "spheres": dataclasses.replace(
        MARBLES, balls=Balls((0.022, 0.03, 0.026), (0.05, 0.3, 0.1), shape="sphere"), table=MARBLES.table
    ),
    "obstacle": Scene(Balls((0.03, 0.03, 0.04), (0.17, 0.3, math.inf)), Table(2.0, 1.0), Physics(e_ball=0.9)),
}


def aimed(scene, seed):
    """Returns random positions, and velocities with the cue ball aimed at ball 1."""
    rng = np.random.default_rng(seed)
    places = layouts.draw("random", scene, rng)
    velocities = np.zeros_like(places)
    to = places[1] - places[0]
    velocities[0] = 2.0 * to / np.hypot(*to) + rng.normal(0.0, 0.05, 2)
    return places, velocities


def start_of(scene, seed):
    """Returns positions, velocities and spins with a moving and turning cue ball that is aimed at ball 1."""
    places, velocities = aimed(scene, seed)
    spins = np.zeros((scene.n_balls, 3))
    if scene.physics.motion == "sliding":
        spins[0] = np.random.default_rng(seed).normal(0.0, (4.0, 4.0, 20.0))
    return places, velocities, spins


def recorded(scene, start, **options) -> Any:
    """Returns the recorded shot of a start."""
    spins = start[2] if scene.physics.motion == "sliding" else None
    shot = simulate(scene, start[0], start[1], spins=spins, record=True, **options)
    assert shot.events is not None
    return shot


def tangent_of(name, scene, rng):
    """Returns a random tangent of an input; that of a velocity or a spin is zero for balls at rest."""
    n = scene.n_balls
    shape = {"positions": (n, 2), "velocities": (n, 2), "spins": (n, 3), "radius": (n,), "mass": (n,)}.get(name, ())
    tangent = rng.uniform(0.5, 1.0, shape)
    if name in ("velocities", "spins"):
        tangent[1:] = 0.0
    if name == "mass":
        tangent[np.isinf(scene.balls.mass)] = 0.0
    return tangent if shape else float(tangent)


def changed_world(change):
    """Lets the 50-digit reference use `change(world)` in place of each world."""
    plain = World.of
    return mock.patch.object(World, "of", lambda scene, digits: change(plain(scene, digits)))


def changed_constant(name, tangent, scene):
    """Returns the function that changes a radius, a mass or a number of physics of a world by STEP times a tangent."""

    def change(world):
        if name == "radius":
            radius = tuple(r + STEP * x for r, x in zip(world.radius, tangent, strict=True))
            return dataclasses.replace(world, radius=radius)
        if name == "mass":
            inverse = tuple(i / (1 + i * STEP * x) for i, x in zip(world.inverse_mass, tangent, strict=True))
            return dataclasses.replace(world, inverse_mass=inverse)
        if name in ("mu_ball", "mu_ball_factor", "mu_ball_decay"):
            a, b, c = world.ball_friction
            if name == "mu_ball_decay":
                return dataclasses.replace(world, ball_friction=(a, b, c + STEP * tangent))
            clean = dataclasses.replace(scene.physics, mu_ball_factor=1.0)
            by_a, by_b, _ = (scene.physics.mu_ball_factor, 0.0, 0.0) if name == "mu_ball" else ball_friction(clean)
            return dataclasses.replace(world, ball_friction=(a + by_a * STEP * tangent, b + by_b * STEP * tangent, c))
        return dataclasses.replace(world, **{name: getattr(world, name) + STEP * tangent})

    return change


def directional_differences(scene, start, name, tangent, max_time):
    """Returns one-sided differences of all outputs of `derivatives.shot_derivatives` along a tangent of one input.

    The events are in the order of their balls.

    Args:
        scene: The scene.
        start: Positions (n, 2), velocities (n, 2) and spins (n, 3).
        name: The input.
        tangent: Its change.
        max_time: The time of the outputs, s; None for the end of the shot.
    """
    exact = np.vectorize(mpmath.mpf, otypes=[object])
    with mpmath.workdps(60):

        def outputs(step):
            values = dict(zip(("positions", "velocities", "spins"), map(exact, start), strict=True))
            change = changed_constant(name, tangent, scene) if step and name not in values else lambda world: world
            if name in values:
                values[name] = values[name] + exact(tangent) * step
            with changed_world(change):
                shot = reference_shot(scene, *values.values(), max_time=max_time)
            events = sorted(shot.events, key=lambda e: e.ball)  # those of one ball keep their order
            pieces = [min(shot.segments[e.ball], key=lambda piece, e=e: abs(piece.start - e.time)) for e in events]
            differences = {
                "positions": shot.positions,
                "velocities": shot.velocities,
                "spins": shot.spins,
                "event_times": [e.time for e in events],
                "event_positions": [piece.position for piece in pieces],
            }
            return {key: np.array(rows, object) for key, rows in differences.items()}

        base, moved = outputs(mpmath.mpf(0)), outputs(STEP)
        return {key: ((moved[key] - base[key]) / STEP).astype(float) for key in base}
