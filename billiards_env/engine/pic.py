"""PIC, predicted instant of collision: the event-driven engine.

The engine goes from event to event, each at its exact time. It predicts the next event of each ball alone (cushion,
pocket, end of a phase) and the next meeting of each pair. A prediction is valid until an event changes the motion of
one of its balls. The engine takes the earliest prediction, advances only the balls that it concerns, changes their
motion, and predicts their next events. At one instant it resolves pockets first, then all impacts between balls as one
problem, then cushions, then the ends of phases.

A queue stores the predictions: `engine.one_pair` for at most two balls, `engine.all_pairs` for few, `engine.cell_grid`
for many. All lead to the same bits. Two balls have only one impact with each other at an instant, so their engine is
compiled without the code for several impacts.
"""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine import all_pairs, cell_grid, one_pair
from billiards_env.engine.contact_rule import Memory, empty_memory, reset_memory
from billiards_env.engine.log import clear_log, log_segment
from billiards_env.engine.pic_events import resolve_impacts, resolve_singles
from billiards_env.engine.predictions import PAIR_RANK
from billiards_env.engine.runner import INTERRUPTED, LOOK_AFTER, for_all_shots
from billiards_env.engine.shots import AT_EVENT_LIMIT, AT_MAX_TIME, end_at
from billiards_env.jit import allocating, allocating_entry_point, inlined
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.clusters.impulses import Contacts, Scratch, empty_contacts, empty_scratch
from billiards_env.physics.motion import begin_phase
from billiards_env.physics.state import State, Time, empty_state, scene_of

CLUSTER_WORK = 100
"""Largest amount of work for each two of the impacts at one instant, in the unit of `LOOK_AFTER`."""


class PicWorkspace(NamedTuple):
    """The arrays in which shots are run, one after the other.

    Attributes:
        state: The `State` of the balls.
        queue: The queue of predictions.
        contacts: The `Contacts` at one instant.
        scratch: The `Scratch` of their resolution; None for at most two balls.
        memory: The `Memory` of the contact-time rule.
        due: (n,) int64, balls with an event alone at this instant.
        changed: (2 most + 2 n,) int64, balls whose motion the last event has changed, once for each impact.
    """

    state: State
    queue: Any
    contacts: Contacts
    scratch: Scratch | None
    memory: Memory
    due: Any
    changed: Any


@allocating
def make_workspace(scene, queue, most, scratch):
    """Returns the `PicWorkspace` for the balls of a scene, with up to `most` contacts at one instant."""
    n = len(scene.radius)
    due, changed = np.empty(n, np.int64), np.empty(2 * (most + n), np.int64)
    return PicWorkspace(
        state=empty_state(n, scene.flight),
        queue=queue,
        contacts=empty_contacts(most, scene.flight),
        scratch=scratch,
        memory=empty_memory(n),
        due=due,
        changed=changed,
    )


@inlined
def begin_shot(state, memory, changed, log):  # out: memory, changed, log
    """Resets the log and the memory, and lists all balls in `changed`. Returns their number."""
    clear_log(log)
    reset_memory(memory)
    for i in range(len(state.phase)):
        changed[i] = i
    return len(state.phase)


@inlined
def begin_phases(count, changed, state, scene, log):  # out: state, log
    """Begins and records the next phase of the first `count` balls of `changed`."""
    for c in range(count):
        begin_phase(state, changed[c], scene.numbers)
        log_segment(log, state, changed[c])


def event_loop(queue: ModuleType) -> Any:
    """Returns the kernel that runs one shot with the predictions in a queue.

    Args:
        queue: The module `one_pair`, `all_pairs` or `cell_grid`.
    """
    clear, predict, earliest, due, gather = queue.clear, queue.predict, queue.earliest, queue.due, queue.gather

    @inlined
    def run(k, scene, work, limit, max_events, shots, log):  # out: work, shots, log
        """Runs shot k to rest, to the time `limit` (s) or to `max_events` events.

        Returns:
            The amount of work, in the unit of `LOOK_AFTER`, or INTERRUPTED.
        """
        state, changed, now = work.state, work.changed, Time(0.0, 0.0)
        n_changed = begin_shot(state, work.memory, changed, log)
        clear(state, scene, work.queue)
        total = pending = 0
        while True:
            begin_phases(n_changed, changed, state, scene, log)
            spent = predict(changed, n_changed, now, state, scene, work.queue)
            event = earliest(state, scene, work.queue, limit)
            if event.time.hi > limit or event.time.hi == math.inf:
                break
            if shots.n_events[k] >= max_events:
                end_at(now, k, state, scene, shots, AT_EVENT_LIMIT)
                shots.time[k] = now.hi
                return total + pending
            pending += spent
            if pending > LOOK_AFTER or spent < 0:
                if spent < 0 or interrupted():
                    return INTERRUPTED
                total, pending = total + pending, 0
            now = event.time
            if event.rank == PAIR_RANK:
                n_contacts = gather(now, state, scene, work.queue, work.contacts)  # advances their balls
                n_changed = resolve_impacts(n_contacts, now, k, scene, work, shots, log)
                pending += CLUSTER_WORK * n_contacts * (n_contacts - 1)
            else:
                n_due = due(event, work.queue, work.due)
                n_changed = resolve_singles(n_due, now, k, scene, work, shots, log)  # advances the balls
                pending += scene.numbers.cushion_work * n_changed
        if limit < math.inf:
            end_at(Time(limit, 0.0), k, state, scene, shots, AT_MAX_TIME)
        shots.time[k] = limit if shots.status[k] == AT_MAX_TIME else now.hi
        return total + pending

    return run


_run_one_pair = for_all_shots(event_loop(one_pair))
_run_all_pairs = for_all_shots(event_loop(all_pairs))
_run_cell_grid = for_all_shots(event_loop(cell_grid))


@allocating_entry_point
def run_shots(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Runs shots `begin` to `end` - 1 of a batch in place. An interrupted shot keeps its start.

    Args:
        kernels: The `SceneKernels`.
        begin: First shot.
        end: One past the last.
        scene: The other `SceneArrays`, as a plain tuple, like `shots` and `log`: numba unpacks it in half the time.
        limit: Time at which a shot ends, s; finite if the motion is ideal.
        max_events: Number of events after which a shot ends.
        shots: The `Shots`.
        log: The `Log`; it holds the last shot.
    """
    arrays = scene_of(kernels, scene, 0)
    n, most = len(arrays.radius), all_pairs.most_contacts(arrays)
    scratch = empty_scratch(n, most, arrays.laws.friction, arrays.flight)
    queue = all_pairs.empty_queue(arrays)
    work = make_workspace(arrays, queue, most, scratch)
    end_call(_run_all_pairs(range(begin, end), kernels, scene, work, limit, max_events, shots, log))


@allocating_entry_point
def run_shots_of_at_most_two(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Computes the same bits as `run_shots` for at most two balls, and compiles in less time.

    With more balls it would write outside the arrays.
    """
    arrays = scene_of(kernels, scene, 0)
    work = make_workspace(arrays, one_pair.empty_queue(arrays), 1, None)
    end_call(_run_one_pair(range(begin, end), kernels, scene, work, limit, max_events, shots, log))


@allocating_entry_point
def run_shots_of_many(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Computes the same bits as `run_shots`, faster for many balls."""
    arrays = scene_of(kernels, scene, 0)
    most = cell_grid.most_contacts(arrays)
    scratch = empty_scratch(len(arrays.radius), most, arrays.laws.friction, arrays.flight)
    work = make_workspace(arrays, cell_grid.empty_queue(arrays), most, scratch)
    end_call(_run_cell_grid(range(begin, end), kernels, scene, work, limit, max_events, shots, log))
