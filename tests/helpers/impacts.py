"""Impacts of balls."""

import math

import numpy as np

from billiards_env.engine.compile import scene_arrays
from billiards_env.jit import allocating_entry_point
from billiards_env.physics.ball_ball import exchange
from billiards_env.physics.clusters.impulses import empty_contacts, empty_scratch
from billiards_env.physics.state import UX, UY, VX, VY, WIDTH, WZ, State


@allocating_entry_point
def collide(impacts, rebound, rows, scene):
    """Runs `exchange` on balls with these rows; `impacts` are the arrays first, second, nx, ny and closing."""
    first, second, nx, ny, closing = impacts
    contacts = empty_contacts(len(first))
    contacts.first[:], contacts.second[:] = first, second
    contacts.nx[:], contacts.ny[:], contacts.closing[:], contacts.rebound[:] = nx, ny, closing, rebound
    state = State(rows, np.zeros(len(rows), np.int8))
    return exchange(len(first), contacts, state, scene, empty_scratch(len(rows), len(first), scene.ball_friction))


def approaching(places, velocities, pairs):
    """Returns the numbers in `pairs` of the pairs that approach, and the `impacts` of `collide` for them."""
    found = []
    for k, (i, j) in enumerate(pairs):
        d, w = places[j] - places[i], velocities[j] - velocities[i]
        n = d / math.sqrt(d[0] * d[0] + d[1] * d[1])
        closing = -(n[0] * w[0] + n[1] * w[1])
        if closing > 0:
            found.append((k, i, j, n[0], n[1], closing))
    chosen, *impacts = (np.array(column) for column in zip(*found, strict=True)) if found else ([], [])
    return chosen, tuple(impacts)


def rows_of(velocities, spins, radius):
    """Returns state rows of balls with velocities (n, 2), m/s, and spins (n, 3), rad/s."""
    rows = np.zeros((len(velocities), WIDTH))
    rows[:, [VX, VY]] = velocities
    rows[:, UX] = rows[:, VX] - radius * spins[:, 1]
    rows[:, UY] = rows[:, VY] + radius * spins[:, 0]
    rows[:, WZ] = spins[:, 2]
    return rows


def motion_of(rows, radius):
    """Returns the velocities (n, 2) and the spins (n, 3) of state rows."""
    spins = np.stack([(rows[:, UY] - rows[:, VY]) / radius, (rows[:, VX] - rows[:, UX]) / radius, rows[:, WZ]], 1)
    return rows[:, [VX, VY]], spins


def impact(velocities, spins, angle, scene):
    """Returns velocities and spins after the impact of two balls whose normal has this angle in degrees."""
    radius = np.array(scene.balls.radius)
    velocities, spins = np.array(velocities, float), np.array(spins, float)
    rows = rows_of(velocities, spins, radius)
    n = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
    closing = np.array([(velocities[0] - velocities[1]) @ n])
    assert closing >= 0
    collide((np.array([0]), np.array([1]), n[:1], n[1:], closing), np.zeros(1), rows, scene_arrays(scene))
    return motion_of(rows, radius)


def energy(velocities, spins, scene):
    mass, radius = np.array(scene.balls.mass), np.array(scene.balls.radius)
    finite = np.isfinite(mass)
    total = (velocities**2).sum(1) + 0.4 * radius**2 * (spins**2).sum(1)
    return 0.5 * (mass[finite] * total[finite]).sum()


def three_dimensional(velocities, spins, angle, scene):
    """Computes the impact with vectors in three dimensions, and drops the vertical velocity.

    Returns the velocities (2, 2) and the spins (2, 3) after it.
    """
    physics, radius, mass = scene.physics, scene.balls.radius, np.array(scene.balls.mass)
    rise = radius[1] - radius[0] if scene.balls.shape == "sphere" else 0.0
    apart = math.sqrt(sum(radius) ** 2 - rise**2)
    n = np.array([apart * math.cos(math.radians(angle)), apart * math.sin(math.radians(angle)), rise]) / sum(radius)
    h = np.array([*n[:2], 0.0]) / math.hypot(*n[:2])
    v, w = np.pad(np.array(velocities, float), ((0, 0), (0, 1))), np.array(spins, float)
    horizontal = (1 + physics.e_ball) * ((v[0] - v[1]) @ h) / (1 / mass).sum()
    v[0] -= horizontal / mass[0] * h  # the slate takes the vertical part
    v[1] += horizontal / mass[1] * h
    surface = v[0] + np.cross(w[0], radius[0] * n) - v[1] - np.cross(w[1], -radius[1] * n)
    slip = surface - (surface @ n) * n
    speed, normal = np.linalg.norm(slip), horizontal / (n @ h)
    falling = 0.009951 + 0.108 * math.exp(-physics.mu_ball_decay * speed)
    mu = falling if physics.mu_ball is None else physics.mu_ball
    size = min(mu * physics.mu_ball_factor * normal, speed / (3.5 * (1 / mass).sum()))
    force = -size * slip / speed if speed > 0 else np.zeros(3)
    v += np.stack([force, -force]) / mass[:, None]
    for k in range(2):
        w[k] += np.cross(radius[k] * n, force) / (0.4 * mass[k] * radius[k] ** 2)
    return v[:, :2], w
