"""Impacts of two balls, and clusters of balls in contact with impacts of several pairs at one instant."""

import itertools
import math
from typing import Any

import numpy as np

from billiards_env.engine.compile import scene_arrays
from billiards_env.engine.space import ON_CLOTH, UNEQUAL_SPHERES
from billiards_env.jit import allocating, entry_point
from billiards_env.physics.ball_ball import exchange, restitution_at
from billiards_env.physics.clusters.impulses import empty_contacts, empty_scratch
from billiards_env.physics.state import UX, UY, VX, VY, WIDTH, WZ, State
from billiards_env.scene import Balls, Physics, Scene


@entry_point
def collide(impacts, rebound, rows, scene):
    """Runs `exchange` on balls with these rows; `impacts` are the arrays first, second, nx, ny and closing."""
    return _collide(impacts, rebound, rows, scene)


@allocating
def _collide(impacts, rebound, rows, scene):
    first, second, nx, ny, closing = impacts
    contacts = empty_contacts(len(first), scene.space.axes())
    contacts.first[:], contacts.second[:] = first, second
    contacts.normal[:, 0], contacts.normal[:, 1] = nx, ny
    contacts.closing[:], contacts.rebound[:] = closing, rebound
    state = State(rows, np.zeros(len(rows), np.int8))
    e = restitution_at(len(first), contacts, scene)
    scratch = empty_scratch(len(rows), len(first), scene.laws.friction, scene.space.axes())
    return exchange(e, len(first), contacts, state, scene, scratch)


def approaching(places, velocities, pairs):
    """Returns the numbers in `pairs` of the pairs that approach, and the `impacts` of `collide` for them."""
    rows = []
    for k, (i, j) in enumerate(pairs):
        d, w = places[j] - places[i], velocities[j] - velocities[i]
        n = d / math.sqrt(d[0] * d[0] + d[1] * d[1])
        closing = -(n[0] * w[0] + n[1] * w[1])
        if closing > 0:
            rows.append((k, i, j, n[0], n[1], closing))
    chosen, *impacts = (np.array(column) for column in zip(*rows, strict=True)) if rows else ([], [])
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


KINDS = ("smooth", "rubbing", "spheres")
"""Balls without friction, balls with it, and spheres of different size with it."""


def triangle(rows):
    """Returns the places (n, 2) of a frozen rack, in diameters."""
    return np.array([(c - r / 2, r * math.sqrt(0.75)) for r in range(rows) for c in range(r + 1)])


SQUARE = np.stack(np.divmod(np.arange(16.0), 4), axis=1)
RACKS = {
    f"{len(places)} balls": (
        places,
        [(i, j) for i, j in itertools.combinations(range(len(places)), 2) if math.dist(places[i], places[j]) < 1.01],
    )
    for places in (triangle(4), triangle(5), SQUARE, triangle(9))
}
"""Racks of balls with a diameter of 1: the places (n, 2), and the pairs in contact. The contacts are redundant."""


def cluster(rng, n):
    """Returns the radii (n,) and places (n, 2) of balls, each in contact with others, and the pairs in contact, m."""
    radius = rng.uniform(0.01, 0.04, n)
    places = [np.zeros(2)]
    while len(places) < n:
        k = len(places)
        a, b = rng.integers(k), rng.integers(k)
        reach, other = radius[a] + radius[k], radius[b] + radius[k]
        angle = rng.uniform(0, 2 * math.pi)
        place = places[a] + reach * np.array([math.cos(angle), math.sin(angle)])
        if a != b and rng.random() < 0.9:
            line = places[b] - places[a]
            distance = math.hypot(*line)
            if abs(reach - other) < distance < reach + other:  # one of the two places in contact with both
                along = (distance**2 + reach**2 - other**2) / (2 * distance)
                across = math.sqrt(max(0.0, reach**2 - along**2)) * rng.choice([-1, 1])
                place = places[a] + (along * line + across * np.array([-line[1], line[0]])) / distance
        if all(math.dist(place, q) > radius[k] + radius[m] - 1e-12 for m, q in enumerate(places)):
            places.append(place)
    places = np.array(places)
    gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) - radius[:, None] - radius
    return radius, places, [(i, j) for i, j in itertools.combinations(range(n), 2) if gaps[i, j] < 1e-12]


def arrays_of(kind, e, mu, radius, inverse):
    """Returns the `SceneArrays` of balls of a kind with these radii and inverse masses (n,)."""
    rubs = "frictionless" if kind == "smooth" else "frictional"
    physics = Physics(ball_ball=rubs, cushion="restitution", mu_ball=mu, e_ball=e)
    arrays = scene_arrays(Scene(Balls.uniform(1), physics=physics))
    return arrays._replace(radius=radius, inv_mass=inverse, space=UNEQUAL_SPHERES if kind == "spheres" else ON_CLOTH)


def drawn(seed, kind, n, e=0.95, mu=None, fixed=False, equal=False):
    """Returns a generator, places, random rows, the pairs in contact and the arrays of a cluster.

    Some of the balls move. Ball 0 may have an infinite mass; balls of equal mass have 170 g.
    """
    rng = np.random.default_rng(seed)
    _, places, pairs = cluster(rng, n)
    spread = 2 if kind == "smooth" else 1  # friction between very different masses converges slowly in 50 digits
    inverse = np.full(n, 1 / 0.17) if equal else 10.0 ** rng.uniform(-spread, spread, n)
    if fixed:
        inverse[0] = 0.0
    radius = 0.1 * 10.0 ** -rng.random(n) if kind == "spheres" else rng.uniform(0.02, 0.04, n)
    rows = np.zeros((n, WIDTH))
    moving = (rng.random((n, 1)) < 0.6) & (inverse[:, None] > 0)
    rows[:, VX : VY + 1] = rng.normal(size=(n, 2)) * moving
    rows[:, UX : UY + 1] = rows[:, VX : VY + 1] + rng.normal(size=(n, 2)) * moving
    rows[:, WZ] = rng.normal(size=n) * 30 * moving[:, 0]
    return rng, places, rows, pairs, arrays_of(kind, e, mu, radius, inverse)


def collided(places, rows, pairs, arrays, rebound: Any = 0.0):
    """Returns the rows after the impacts of those pairs that approach, and the number of these pairs.

    `rebound` is the least speed of separation, m/s, of all pairs or of each.
    """
    chosen, impacts = approaching(places, rows[:, VX : VY + 1], pairs)
    rows = rows.copy()
    if len(chosen):
        collide(impacts, np.broadcast_to(rebound, len(pairs))[chosen], rows, arrays)
    return rows, len(chosen)


def check_order_and_side(rng, places, rows, pairs, arrays, rebound):
    """Checks that new numbers of the balls and of the contacts, or a mirror, change no bit of `collided`."""
    after, _ = collided(places, rows, pairs, arrays, rebound)
    names, order = rng.permutation(len(places)), rng.permutation(len(pairs))
    back = np.argsort(names)
    renamed = [tuple(sorted((int(back[pairs[k][0]]), int(back[pairs[k][1]])))) for k in order]
    other = arrays._replace(radius=arrays.radius[names], inv_mass=arrays.inv_mass[names])
    assert np.array_equal(collided(places[names], rows[names], renamed, other, rebound[order])[0], after[names])
    for columns, mirror in (([VX, UX, WZ], [-1, 1]), ([VY, UY, WZ], [1, -1])):
        signs = np.ones(WIDTH)
        signs[columns] = -1
        assert np.array_equal(collided(places * mirror, rows * signs, pairs, arrays, rebound)[0], after * signs)


def energy(rows, arrays):
    """Returns the kinetic energy of translation and rotation; fixed balls have none."""
    finite = arrays.inv_mass > 0
    mass = 1 / arrays.inv_mass[finite]
    r, radius = rows[finite], arrays.radius[finite]
    rotation = (r[:, UX] - r[:, VX]) ** 2 + (r[:, UY] - r[:, VY]) ** 2 + (radius * r[:, WZ]) ** 2
    return 0.5 * float(mass @ (r[:, VX] ** 2 + r[:, VY] ** 2 + 0.4 * rotation))
