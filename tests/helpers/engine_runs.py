"""Runs any of the engines without the checks and conversions of `simulate`, for comparisons bit for bit."""

from __future__ import annotations

from billiards_env.engine.compile import PIC, Engine, scene_fields
from billiards_env.engine.log import empty_log
from billiards_env.engine.shot_input import check_shot
from billiards_env.engine.shots import Shots, empty_shots

LOG_EVENTS = 2_000
MAX_EVENTS = 20_000  # of a shot; `reference.plain` needs too long for more


def run(run_shots, shots, record=False, max_time=None, max_events=MAX_EVENTS, dt=None, fix=None):
    """Returns the arrays of all shots and the arrays of the log of the last shot."""
    scene, positions, velocities, spins = shots
    given = check_shot(scene, positions, velocities, spins, None, max_time)
    m, n = given.positions.shape[:2]
    shots = Shots(*given[:4], *empty_shots(m, n)[4:])
    log = empty_log(LOG_EVENTS, 4 * LOG_EVENTS) if record else empty_log()
    log.events[:], log.segments[:] = 0.0, 0.0
    run_shots(
        0,
        m,
        scene_fields(scene, PIC if dt is None else Engine("pit", dt, fix)),
        given.limit,
        max_events,
        tuple(shots),
        tuple(log),
    )
    return [*shots, *log]
