"""Tables with outlines, and the room that balls have on them, for tests."""

import dataclasses

import numpy as np
from hypothesis import strategies as st

from benchmarks.reference.stress.draw import outline_table as table
from benchmarks.reference.stress.draw import star
from billiards_env.scene import Balls, Scene, Table
from billiards_env.scene.outline import Corner, clearance, pieces


def with_corners(rectangle):
    """Returns a rectangular table as an outline of four corners."""
    x, y = rectangle.length / 2, rectangle.width / 2
    corners = tuple(Corner(sx * x, sy * y) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return dataclasses.replace(rectangle, outline=corners)


MARBLES = Scene(  # has the laws of "uk_pool", whose engines other tests compile too
    Balls((0.022, 0.03, 0.026, 0.028), (0.05, 0.3, 0.1, 0.2), shape="sphere"),
    with_corners(Table(1.0, 0.8, 0.034)),
    Scene.named("uk_pool").physics,
)
"""Four spheres of different size."""

# A throat of 5 cm between two tips, with a chamber behind it
LOW, HIGH = [(1, 0.475, 0.02), (1.2, 0.475, 0.02)], [(1.2, 0.525, 0.02), (1, 0.525, 0.02)]
THROAT = table([(0, 0), (1, 0), *LOW, (1.2, 0.3), (1.5, 0.3), (1.5, 0.7), (1.2, 0.7), *HIGH, (1, 1), (0, 1)])
BENT = [(2, 0.7), (1.4, 0.65, 0.01), (0.9, 0.7), (0.9, 0.71), (1.4, 0.68), (2, 0.72)]
TABLES = {
    "rectangle": table([(0, 0), (2, 0), (2, 1), (0, 1)]),
    "split": table([(0, 0), (0.7, 0), (2, 0), (2, 0.3), (2, 1), (1.1, 1), (0.3, 1), (0, 1)]),
    "octagon": table([(0.5, 0), (1.5, 0), (2, 0.5), (2, 1), (1.5, 1.5), (0.5, 1.5), (0, 1), (0, 0.5)]),
    "L": table([(0, 0), (2, 0), (2, 0.8), (0.8, 0.8, 0.05), (0.8, 2), (0, 2)]),
    "sharp L": table([(0, 0), (2, 0), (2, 0.8), (0.8, 0.8), (0.8, 2), (0, 2)]),
    "wedge": table([(0, 0), (1, -0.25), (1, 0.25)]),
    "bent wall": table([(0, 0), (2, 0), *BENT, (2, 1.4), (0, 1.4)]),
    "throat": THROAT,
    "pool_7ft": Table.named("pool_7ft"),
    "snooker_12ft": Table.named("snooker_12ft"),
}

ANY_TABLE = st.sampled_from(sorted(TABLES)).map(TABLES.__getitem__) | st.integers(0, 10**4).map(star)
"""A strategy of hypothesis: one of `TABLES`, or a random outline."""


def mirrored(a_table, mirror):
    """Returns a table mirrored by the factors (x, y), each 1 or -1, and the new number of each cushion."""
    x, y = mirror
    outline = [Corner(x * c.x, y * c.y, c.radius) for c in a_table.outline]
    pockets = tuple(dataclasses.replace(p, x=x * p.x, y=y * p.y) for p in a_table.pockets)
    if x * y < 0:  # counter-clockwise again
        outline.reverse()
    return dataclasses.replace(a_table, outline=tuple(outline), pockets=pockets)


def free_places(a_table, radius, rng, count):
    """Returns random places (count, 2), m, at which one ball fits, also in the mouths of the pockets."""
    chosen = np.zeros((0, 2))
    corners = np.array([(c.x, c.y) for c in a_table.outline])
    while len(chosen) < count:
        places = rng.uniform(corners.min(0), corners.max(0), (4 * count, 2))
        free = clearance(a_table.outline, places) >= radius
        for p in a_table.pockets:
            free &= np.hypot(*(places - (p.x, p.y)).T) > p.radius
        chosen = np.vstack([chosen, places[free]])
    return chosen[:count]


def apart_places(a_table, radius, rng, count):
    """Returns places as `free_places` does, for balls that do not overlap."""
    while True:
        places = free_places(a_table, radius, rng, count)
        if (np.linalg.norm(places[:, None] - places, axis=-1) + np.eye(count)).min() > 2 * radius:
            return places


def beyond(scene, shot, count=2000):
    """Returns the largest distance by which a ball in play of a recorded shot overlaps the outline, m."""
    corners, radius = scene.table.outline, np.array(scene.balls.radius)
    gone = np.full(scene.n_balls, np.inf)
    for event in shot.events[shot.events["kind"] == "pocket"]:
        gone[event["ball"]] = event["time"]
    times = np.unique(np.r_[0.0, shot.events["time"], np.linspace(0.0, shot.time, count)])
    places = np.array([shot.at(float(t)) for t in times])
    return float((radius - clearance(corners, places))[times[:, None] < gone].max())


def joint_of(a_table, tip=0):
    """Returns the beginning of the arc of a tip, m, and the tip."""
    piece = pieces(a_table.outline)[1][tip]
    return np.array([piece.x0, piece.y0]), piece
