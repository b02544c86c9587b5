"""Runs any of the engines at the lowest level, for comparisons bit for bit."""

from __future__ import annotations

import numpy as np

from billiards_env.engine.inputs import check_shot
from billiards_env.engine.log import EVENT_WIDTH, SEGMENT_WIDTH, Log
from billiards_env.engine.modes import scene_arrays
from billiards_env.engine.shots import Shots, empty_shots

ROOM = 2_000  # events of a log
MOST = 20_000  # events of a shot: where plain takes too long


def run(run_shots, shots, record=False, max_time=None, max_events=MOST):
    """Returns the outcome of all shots, and the log of the last one."""
    scene, places, velocities, spins = shots
    given = check_shot(scene, places, velocities, spins, None, max_time)
    m, n = given.positions.shape[:2]
    rows = ROOM if record else 0
    shots = Shots(*given[:4], *empty_shots(m, n)[4:])
    log = Log(np.zeros((rows, EVENT_WIDTH)), np.zeros((4 * rows, SEGMENT_WIDTH)), np.zeros(2, np.int64))
    run_shots(0, m, tuple(scene_arrays(scene)), given.limit, max_events, tuple(shots), tuple(log))
    return [*shots, *log]
