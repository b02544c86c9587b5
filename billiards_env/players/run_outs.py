"""The probability that a player runs out from the position after a shot, by a small network.

The inputs of the network are the two easiest pots, the numbers of balls to pot and of legal balls, the place of the cue
ball, the size of the noise, and whether english is allowed. It was trained on racks that the planner played. Commit
88643de1 is the last one with the program that trained it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from billiards_env.pots.finder import APPROACH, CUT_COS, RUN, TOLERANCE
from billiards_env.support.files import read_arrays

Floats = NDArray[np.float64]
Weights = Mapping[str, NDArray[np.float32]]
"""A network: "mean" and "scale" of its k inputs (k,), "w0" (k, h), "b0" (h,), "w1" (h, 1) and "b1" (1,)."""

WEIGHTS = Path(__file__).with_name("run_outs.npz")
"""The file of the weights. Loading it runs no code from the file."""

POTS = 2
"""The number of pots among the inputs."""

FLOOR = math.radians(0.03)
"""Noise of the direction of the next pot in addition to the noise of the stroke, rad."""

_LEAST = 1e-4  # rad; smaller tolerances count as this one


def inputs(pots: Floats, cue: Floats, left: Floats, legal: Floats, noise: tuple[float, float], english: bool) -> Floats:
    """Returns the inputs (m, 16) of the network for m positions. A mirrored table has the same inputs.

    The columns are: the logarithms of the tolerances of the pots; the cosine of the cut and the distances of the cue
    ball and of the object ball, for each pot; balls to pot; whether it is one; legal balls; place of the cue ball (two
    columns); logarithm of the noise of the direction; noise of the speed; english.

    Args:
        pots: (m, `POTS`, w) the easiest pots, as in `Pots.rows`; zero for none.
        cue: (m, 2) the places of the cue ball, from -1 at one cushion to 1 at the other.
        left: (m,) the numbers of balls that the player has to pot.
        legal: (m,) the numbers of legal balls.
        noise: Standard deviations of the direction, rad, and of the speed, m/s.
        english: Whether the player may play with offsets of the tip.
    """
    tolerances = np.log(np.maximum(pots[..., TOLERANCE], _LEAST) / _LEAST)
    others = pots[..., [CUT_COS, APPROACH, RUN]].reshape(len(left), -1)
    same = np.broadcast_to((math.log(math.hypot(noise[0], FLOOR)), noise[1], float(english)), (len(left), 3))
    return np.column_stack((tolerances, others, left, left == 1.0, legal, np.abs(cue), same))


def chances(weights: Weights, rows: Floats) -> Floats:
    """Returns the probability of a run-out (m,) for the inputs (m, k) of positions."""
    hidden = np.tanh((rows - weights["mean"]) / weights["scale"] @ weights["w0"] + weights["b0"])
    return 1.0 / (1.0 + np.exp(-(hidden @ weights["w1"] + weights["b1"])[:, 0]))


@functools.cache
def trained() -> Weights:
    """Returns the weights in `WEIGHTS`.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it does not hold arrays of numbers.
    """
    return read_arrays(WEIGHTS, "weights")
