"""Impacts of balls."""

import math

import numpy as np

from billiards_env.engine.modes import scene_arrays
from billiards_env.jit import allocating_entry_point
from billiards_env.physics.ball_ball import exchange
from billiards_env.physics.clusters import empty_contacts, empty_scratch
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


def collide_pair(rows, normal, closing, scene):
    """Runs `collide` on balls 0 and 1, which approach each other at a speed along a normal (2,)."""
    first, second, (nx, ny) = np.array([0]), np.array([1]), np.reshape(normal, (2, 1))
    collide((first, second, nx, ny, np.array([closing])), np.zeros(1), rows, scene)


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
    closing = (velocities[0] - velocities[1]) @ n
    assert closing >= 0
    collide_pair(rows, n, closing, scene_arrays(scene))
    return motion_of(rows, radius)


def energy(velocities, spins, scene):
    mass, radius = np.array(scene.balls.mass), np.array(scene.balls.radius)
    finite = np.isfinite(mass)
    total = (velocities**2).sum(1) + 0.4 * radius**2 * (spins**2).sum(1)
    return 0.5 * (mass[finite] * total[finite]).sum()
