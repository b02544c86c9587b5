"""Comparison of the queues of PIC."""

from __future__ import annotations

import numpy as np

from billiards_env.engine import pic
from reference import plain
from reference.stress import families
from tests.helpers.engine_runs import run

# UK pool has all features of scenes that the queues use: outlines, friction between balls, and spheres.
ORDINARY = [name for name in families.FAMILIES if not name.startswith(("wild", "real", "7-foot", "snooker", "jaws"))]

CELL_GRID, PLAIN = pic.run_shots_of_many, plain.run_shots


def check(shots, engines=(CELL_GRID, PLAIN), **options):
    """Checks that these engines, and the one for two balls, have the same results and logs as `pic.run_shots`."""
    expected = run(pic.run_shots, shots, **options)
    if shots[0].n_balls <= 2:
        engines = (*engines, pic.run_shots_of_at_most_two)
    for engine in engines:
        for found, array in zip(run(engine, shots, **options), expected, strict=True):
            assert np.array_equal(found, array)
