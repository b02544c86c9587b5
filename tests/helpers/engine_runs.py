"""Runs any of the engines without the checks and conversions of `simulate`, for comparisons bit for bit."""

import numpy as np

from benchmarks.reference import plain
from benchmarks.reference.stress import families
from billiards_env.engine import PIC, Engine, empty_shots, pic, pit, scene_fields, scene_kernels
from billiards_env.engine.log import empty_log
from billiards_env.engine.predictions import queue_of
from billiards_env.engine.shot_input import check_shot

LOG_EVENTS = 2_000
MAX_EVENTS = 20_000  # of a shot; `benchmarks.reference.plain` needs too long for more


def run(queue, shots, record=False, max_time=None, max_events=MAX_EVENTS, dt=None, fix=None):
    """Returns the arrays of all shots and of the log of the last shot, by PIC with a queue or by PIT with `dt`."""
    scene, positions, velocities, spins = shots
    flight = scene.physics.flight
    shots = empty_shots(*np.shape(positions)[:2], flight=flight)
    limit = check_shot(scene, positions, velocities, spins, None, max_time, into=shots).limit
    log = empty_log(LOG_EVENTS, 4 * LOG_EVENTS, flight=flight) if record else empty_log(flight=flight)
    log.events[:], log.segments[:] = 0.0, 0.0
    engine = PIC if dt is None else Engine("pit", dt, fix)
    kernels, fields = scene_kernels(scene), scene_fields(scene, engine)
    if queue is PLAIN:
        kernels = plain.with_plain_walls(kernels)
    run_shots, kernels = (
        (pic.run_shots, pic.PicKernels(kernels, queue))
        if dt is None
        else (pit.run_shots, pit.PitKernels(kernels, engine.treatment.kernels))
    )
    run_shots(kernels, 0, len(shots.time), fields, limit, max_events, tuple(shots), tuple(log))
    return [*shots, *log]


# UK pool has all features of scenes that the queues use: outlines, friction between balls, and spheres.
ORDINARY = [
    name
    for name in families.FAMILIES
    if not name.startswith(("wild", "real", "7-foot", "snooker", "jaws", "jump", "rain", "stacks", "wedges"))
]

CELL_GRID, PLAIN = pic.CELL_GRID, queue_of(plain)


def check(shots, queues=(CELL_GRID, PLAIN), **options):
    """Checks that PIC with these queues, and the one for two balls, has the same results and logs as with all pairs."""
    expected = run(pic.ALL_PAIRS, shots, **options)
    if shots[0].n_balls <= 2:
        queues = (*queues, pic.ONE_PAIR)
    for queue in queues:
        for actual, array in zip(run(queue, shots, **options), expected, strict=True):
            assert np.array_equal(actual, array)
