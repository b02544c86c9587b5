"""PIT, periodic interference test: time advances by a step dt, and overlaps are resolved after each step.

The balls move by the law of motion of `engine.pic`, in closed form, and each change of phase is at its exact time. The
only difference is when contacts are detected. The engine tests for them at each multiple of dt, in this order: it
captures balls whose centre is inside a pocket; it resolves the impacts of all pairs that overlap and do not separate,
as one problem; and it reflects balls that are beyond a cushion and do not come back. A ball that is beyond two
cushions is reflected at both together. A ball that has stopped beyond a cushion is moved back to it, and a pocket
captures it if it is then inside the pocket. The engine computes impulses by the impact laws, for the positions at the
multiple of dt. It misses a contact that begins and ends within a step.

The test follows Warkari and Jamsandekar, "Evaluation of Collision Handling Techniques in 2D collisions".
`engine.overlaps` has the ways in which the overlaps are "fixed".
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.log import (
    clear_log,
    log_segment,
    phase_end,
    phase_ended,
)
from billiards_env.engine.measures import BEGIN_PHASE, record_nothing
from billiards_env.engine.overlaps import FixKernels
from billiards_env.engine.runner import INTERRUPTED, LOOK_AFTER, for_all_shots
from billiards_env.engine.shots import AT_EVENT_LIMIT, AT_MAX_TIME, AT_STEP_LIMIT, end_at, record_event
from billiards_env.jit import allocating, entry_point, inlined, kernel
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.clusters.impulses import Contacts, Scratch, empty_contacts, empty_scratch, set_normal
from billiards_env.physics.motion import begin_phase, end_phase
from billiards_env.physics.state import (
    POTTED,
    SceneKernels,
    State,
    Time,
    before,
    empty_state,
    moves,
    own_time,
    scene_of,
    since,
)

MAX_STEPS = 100_000_000
"""Number of timesteps after which the engine ends a shot with the status "step_limit": seconds with two balls."""

_LOOK_AFTER = 10_000_000  # pairs of balls tested between two calls of `interrupted`: about ten milliseconds
_PAIRS_PER_EVENT = 500  # pairs that are tested in the time of one event of `engine.pic`


class PitKernels(NamedTuple):
    """The kernels of the loop over timesteps.

    Attributes:
        scene: The `SceneKernels`.
        fix: The `FixKernels`.
        record: As in `pic.PicKernels`.
    """

    scene: SceneKernels
    fix: FixKernels
    record: Any = record_nothing


class PitWorkspace(NamedTuple):
    """The arrays in which shots of n balls are run, one after the other.

    Attributes:
        state: The `State` of the balls.
        record: `PitKernels.record`.
        contacts: The `Contacts` of one step.
        scratch: The `Scratch` arrays for their resolution.
        here: (n, 4 or, in space, 6) float64, position and velocity at the end of the step, in the columns X, Y, VX
            and VY, then those of `pit_in_space`.
        back: (n,) float64, time by which a fix moves a ball back along its path, s.
        phase_end_hi: (n,) float64, time at which a ball's phase ends, s; infinite if it does not.
        phase_end_lo: (n,) float64, its second part.
        moving: (n,) int64, the numbers of the balls that move in the step.
        moved: (n,) bool, whether a ball moves in the step.
        changed: (n,) bool, whether the motion of a ball has changed in the step.
    """

    state: State
    record: Any
    contacts: Contacts
    scratch: Scratch
    here: Any
    back: Any
    phase_end_hi: Any
    phase_end_lo: Any
    moving: Any
    moved: Any
    changed: Any


@allocating
def make_workspace(scene, record):
    """Returns the `PitWorkspace` for the balls of a scene, and measures."""
    n, axes = len(scene.radius), scene.space.axes()
    most = max(1, n * (n - 1) // 2)
    return PitWorkspace(
        state=empty_state(n, axes),
        record=record,
        contacts=empty_contacts(most, axes),
        scratch=empty_scratch(n, most, scene.laws.friction, axes),
        here=np.empty((n, 2 * axes)),
        back=np.empty(n),
        phase_end_hi=np.empty(n),
        phase_end_lo=np.empty(n),
        moving=np.empty(n, np.int64),
        moved=np.empty(n, np.bool_),
        changed=np.empty(n, np.bool_),
    )


@inlined
def _begin_phases(k, scene, work, shots, log):  # out: work, shots, log
    """Begins the next phase of the balls that have changed, and lists the balls that move. Returns their number."""
    state, count = work.state, 0
    for i in range(len(work.moved)):
        if work.changed[i]:
            scene.space.begin_phase(state, i, scene.numbers)
            work.record(BEGIN_PHASE, i, -1, k, scene, state, shots)
            log_segment(log, state, i)
            work.changed[i] = False
            scene.space.predict_phase_end(i, work)
        work.moved[i] = moves(state, i)
        if work.moved[i]:
            work.moving[count] = i
            count += 1
        else:
            scene.space.follow(i, 0.0, scene.numbers, work)
    return count


@kernel
def _next_phase_end(work):
    """Returns the earliest time at which a phase ends, s."""
    end = math.inf
    for i in range(len(work.phase_end_hi)):
        end = min(end, work.phase_end_hi[i])
    return end


@kernel
def _end_next_phase(k, scene, work, shots, log):  # out: work, shots, log
    """Ends the phase that ends first, and begins the next one of that ball."""
    state, phase = work.state, work.state.phase
    first = 0
    for i in range(1, len(phase)):
        if before(
            Time(work.phase_end_hi[i], work.phase_end_lo[i]), Time(work.phase_end_hi[first], work.phase_end_lo[first])
        ):
            first = i
    kind = phase_end(phase[first])
    time = Time(work.phase_end_hi[first], work.phase_end_lo[first])
    end_phase(state, first, time, scene.numbers)
    kind = phase_ended(kind, state.rows[first])
    begin_phase(state, first, scene.numbers)
    record_event((kind, first, -1, 0.0), time, k, state, shots, log)
    log_segment(log, state, first)
    scene.space.predict_phase_end(first, work)


@inlined
def _test_pockets(now, count, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Computes the motion of the `count` moving balls at a `Time` in `here`, and captures the balls in pockets.

    Returns whether the motion of a ball changes.
    """
    has_capture = False
    for m in range(count):
        i = work.moving[m]
        scene.space.follow(i, since(now, own_time(work.state, i)), scene.numbers, work)
        has_capture = scene.space.test_pockets(i, now, k, fix, scene, work, shots, log) or has_capture
    return has_capture


@kernel
def _find_overlaps(count, scene, work):  # out: work
    """Finds the pairs that overlap and do not separate, with at least one of the `count` moving balls.

    Returns their number.
    """
    here, phase, contacts = work.here, work.state.phase, work.contacts
    n_overlaps = 0
    for m in range(count):
        i = work.moving[m]
        if phase[i] == POTTED:
            continue
        for j in range(len(phase)):
            if j == i or (j < i and work.moved[j]) or phase[j] == POTTED:
                continue
            n, closing = scene.space.overlap(i, j, here, scene)
            if closing < 0.0:
                continue
            contacts.first[n_overlaps], contacts.second[n_overlaps], contacts.closing[n_overlaps] = i, j, closing
            set_normal(contacts, n_overlaps, n)
            n_overlaps += 1
    return n_overlaps


@inlined
def _test_cushions(now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Reflects the balls that are beyond a cushion at a `Time`. Returns whether there are balls beyond a cushion."""
    has_rebound = False
    for i in range(len(work.moved)):
        if (work.moved[i] or work.changed[i]) and work.state.phase[i] != POTTED:
            has_rebound = scene.space.hit_cushions(i, now, k, fix, scene, work, shots, log) or has_rebound
    return has_rebound


@inlined
def _end_phases(until, next_end, max_events, k, scene, work, shots, log):  # out: work, shots, log
    """Ends the phases until a time, s, the first of which ends at `next_end`; at most `max_events` events happen.

    Returns:
        The time at which the next phase ends, s, and whether any has ended.
    """
    has_ended = False
    while next_end <= until and next_end < math.inf and shots.n_events[k] < max_events:
        _end_next_phase(k, scene, work, shots, log)
        next_end, has_ended = _next_phase_end(work), True
    return next_end, has_ended


@inlined
def _is_in_motion(next_end, state):
    """Returns whether a ball moves or turns. The phase of a moving ball may have no end."""
    for i in range(len(state.phase)):
        if moves(state, i):
            return True
    return next_end < math.inf


@inlined
def _test(now, count, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Moves the `count` moving balls to a `Time` and tests for contacts. Returns whether any motion changes."""
    has_capture = _test_pockets(now, count, k, fix, scene, work, shots, log)
    overlaps = _find_overlaps(count, scene, work)
    if overlaps > 0:
        scene.space.resolve_overlaps(overlaps, now, k, fix, scene, work, shots, log)
    has_rebound = _test_cushions(now, k, fix, scene, work, shots, log)
    return has_capture or overlaps > 0 or has_rebound


@inlined
def run(k, kernels, scene, work, limit, max_events, shots, log):  # out: work, shots, log
    """Runs shot k to rest, to the time `limit` (s), to `max_events` events or to MAX_STEPS timesteps.

    Returns:
        The amount of work, in the unit of `runner.LOOK_AFTER`, or INTERRUPTED.
    """
    state, n, dt = work.state, len(scene.radius), scene.numbers.dt
    work.changed[:] = True
    clear_log(log)
    shots.time[k] = 0.0
    steps_between_looks = _LOOK_AFTER // (n * n + 8) + 1
    pause = min(limit, dt * steps_between_looks)
    step, count, next_end, changed, pending = 0, 0, math.inf, True, 0
    while True:
        if changed:
            count = _begin_phases(k, scene, work, shots, log)
            next_end = _next_phase_end(work)
            pending += n * scene.numbers.cushion_work
            if pending > LOOK_AFTER:
                pause, pending = 0.0, 0  # looks in this step
        step += 1
        now = Time(step * dt, 0.0)
        until = min(now.hi, limit) if count > 0 else limit
        next_end, changed = _end_phases(until, next_end, max_events, k, scene, work, shots, log)
        if shots.n_events[k] >= max_events and _is_in_motion(next_end, state):
            end_at(Time(shots.time[k], 0.0), k, state, scene, shots, AT_EVENT_LIMIT)
            break
        if count == 0 or now.hi > limit:
            if limit < math.inf:
                end_at(Time(limit, 0.0), k, state, scene, shots, AT_MAX_TIME)
            break
        if step > MAX_STEPS and now.hi > pause:
            end_at(now, k, state, scene, shots, AT_STEP_LIMIT)
            break
        if now.hi > pause:
            if interrupted():
                return INTERRUPTED
            pause = min(limit, dt * min(MAX_STEPS, step + steps_between_looks))
        changed = _test(now, count, k, kernels.fix, scene, work, shots, log) or changed
    return step * (n * n + 8) // _PAIRS_PER_EVENT + pending


_run_all = for_all_shots(run)


@allocating
def _run_shots(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Runs shots, see `run_shots`. Returns whether it was interrupted."""
    work = make_workspace(scene_of(kernels.scene, scene, 0), kernels.record)
    return _run_all(range(begin, end), kernels, scene, work, limit, max_events, shots, log)


@entry_point
def run_shots(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Runs shots of a batch in place, as `engine.pic.run_shots` does and with the same arguments."""
    end_call(_run_shots(kernels, begin, end, scene, limit, max_events, shots, log))
