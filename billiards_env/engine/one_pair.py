"""The event queue for at most two balls: the next event of each ball alone, and the meeting of the two.

Its functions are those of `engine.all_pairs`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine import all_pairs
from billiards_env.engine.pic_events import add_contact
from billiards_env.engine.predictions import Singles, empty_singles, next_event, predict_pair, predict_single
from billiards_env.jit import allocating, inlined
from billiards_env.physics.state import Time

clear, due = all_pairs.clear, all_pairs.due


class Queue(NamedTuple):
    """The predictions for one or two balls.

    Attributes:
        singles: The `Singles`.
        meeting: (2,) float64, the two parts of the time at which the balls next meet, s; infinite if they do not.
    """

    singles: Singles
    meeting: Any


@allocating
def empty_queue(scene):
    """Returns the `Queue` for the balls of a scene, with undefined predictions."""
    return Queue(empty_singles(len(scene.radius)), np.array((math.inf, 0.0)))


@inlined
def most_contacts(scene):
    """Returns the largest number of contacts at one instant."""
    return 1


@inlined
def empty_scratch(scene, most):
    """Returns None: one contact needs no `Scratch`."""
    return None


@inlined
def predict(changed, count, now, state, scene, queue):  # out: queue
    """Predicts the next events of the first `count` balls of `changed`; see `all_pairs.predict`."""
    for c in range(count):
        predict_single(changed[c], state, scene, queue.singles)
    if len(scene.radius) == 2:
        time = predict_pair(0, 1, state, scene, queue.singles)
        queue.meeting[0], queue.meeting[1] = time.hi, time.lo
    return 1


@inlined
def earliest(state, scene, queue, limit):
    """Returns the next `NextEvent`."""
    return next_event(Time(queue.meeting[0], queue.meeting[1]), queue.singles)


@inlined
def gather(now, state, scene, queue, contacts):  # out: state, contacts
    """Finds the contact of the balls at a `Time` and advances them to it. Returns the number of contacts."""
    return 1 if add_contact(0, 1, Time(queue.meeting[0], queue.meeting[1]), now, state, scene, contacts, 0) else 0
