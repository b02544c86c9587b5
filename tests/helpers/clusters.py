"""Clusters of balls in contact."""

import math

import numpy as np


def position_in_contact(rng, a, b, reach_a, reach_b):
    """Returns one of the two points at `reach_a` from a and at `reach_b` from b, (2,) m; None if there is none."""
    line = b - a
    distance = math.hypot(*line)
    if not abs(reach_a - reach_b) < distance < reach_a + reach_b:
        return None
    along = (distance**2 + reach_a**2 - reach_b**2) / (2 * distance)
    across = math.sqrt(max(0.0, reach_a**2 - along**2)) * rng.choice([-1, 1])
    return a + (along * line + across * np.array([-line[1], line[0]])) / distance


def triangle(rows):
    """Returns the number of balls and the contacts (first, second, angle) of a frozen rack.

    From four rows on there are more contacts than degrees of freedom.
    """
    places = [(c - r / 2, r * math.sqrt(0.75)) for r in range(rows) for c in range(r + 1)]
    angles = {
        (i, j): math.atan2(places[j][1] - places[i][1], places[j][0] - places[i][0])
        for i in range(len(places))
        for j in range(i + 1, len(places))
        if math.dist(places[i], places[j]) < 1.01
    }
    return len(places), [(i, j, angle) for (i, j), angle in angles.items()]


def cluster(rng, n):
    """Returns positions and inverse masses of n balls, each in contact with others, and the pairs in contact."""
    radius, inverse = rng.uniform(0.01, 0.04, n), 10.0 ** rng.uniform(-2, 2, n)
    places = [np.zeros(2)]
    while len(places) < n:
        k = len(places)
        a, b = rng.integers(k), rng.integers(k)
        reach, other = radius[a] + radius[k], radius[b] + radius[k]
        angle = rng.uniform(0, 2 * math.pi)
        place = places[a] + reach * np.array([math.cos(angle), math.sin(angle)])
        if a != b and rng.random() < 0.9:
            both = position_in_contact(rng, places[a], places[b], reach, other)
            place = place if both is None else both
        if all(math.dist(place, q) > radius[k] + radius[m] - 1e-12 for m, q in enumerate(places)):
            places.append(place)
    places = np.array(places)
    gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) - radius[:, None] - radius
    return places, inverse, [(i, j) for i in range(n) for j in range(i + 1, n) if gaps[i, j] < 1e-12]
