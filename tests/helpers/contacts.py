"""Geometry of balls in contact."""

from __future__ import annotations

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
