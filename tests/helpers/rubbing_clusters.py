"""Impacts with friction of several pairs of balls at one instant."""

import numpy as np

from billiards_env.engine.compile import scene_arrays
from billiards_env.physics.state import UX, UY, VX, VY, WIDTH, WZ
from billiards_env.scene import Balls, Physics, Scene
from tests.helpers.clusters import cluster
from tests.helpers.impacts import approaching, collide


def arrays_of(e=0.95, mu=None, radius=None, inverse=None, spheres=False):
    physics = Physics(ball_ball="frictional", cushion="restitution", mu_ball=mu, e_ball=e)
    arrays = scene_arrays(Scene(Balls.uniform(1), physics=physics))
    return arrays._replace(radius=radius, inv_mass=inverse, spheres=radius if spheres else None)


def collided(places, rows, pairs, arrays, rebound=0.0):
    """Returns the rows after the impacts of those pairs that approach, and whether there are any."""
    chosen, impacts = approaching(places, rows[:, VX : VY + 1], pairs)
    rows = rows.copy()
    if len(chosen):
        collide(impacts, np.full(len(chosen), rebound), rows, arrays)
    return rows, len(chosen)


def energy(rows, arrays):
    """Returns the kinetic energy of translation and rotation; fixed balls have none."""
    finite = arrays.inv_mass > 0
    mass = 1 / arrays.inv_mass[finite]
    r, radius = rows[finite], arrays.radius[finite]
    rotation = (r[:, UX] - r[:, VX]) ** 2 + (r[:, UY] - r[:, VY]) ** 2 + (radius * r[:, WZ]) ** 2
    return 0.5 * float(mass @ (r[:, VX] ** 2 + r[:, VY] ** 2 + 0.4 * rotation))


def drawn(seed, n, e, mu, fixed, masses=True, spheres=False):
    rng = np.random.default_rng(seed)
    places, inverse, pairs = cluster(rng, n)
    inverse = 10.0 ** rng.uniform(-1, 1, n) if masses else np.full(n, 1 / 0.17)
    if fixed:
        inverse[0] = 0.0
    radius = rng.uniform(0.02, 0.04, n) if not spheres else 0.1 * 10.0 ** -rng.random(n)
    rows = np.zeros((n, WIDTH))
    moving = (rng.random((n, 1)) < 0.6) & (inverse[:, None] > 0)
    rows[:, VX : VY + 1] = rng.normal(size=(n, 2)) * moving
    rows[:, UX : UY + 1] = rows[:, VX : VY + 1] + rng.normal(size=(n, 2)) * moving
    rows[:, WZ] = rng.normal(size=n) * 30 * moving[:, 0]
    return rng, places, rows, pairs, arrays_of(e, mu, radius, inverse, spheres)
