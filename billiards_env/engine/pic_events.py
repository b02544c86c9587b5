"""The events of PIC: impacts of balls at one instant, and events of a ball alone."""

from __future__ import annotations

from billiards_env.engine.contact_rule import collide
from billiards_env.engine.log import BALL_BALL, log_event
from billiards_env.engine.measures import AFTER_IMPACT, BEFORE_IMPACT
from billiards_env.engine.shots import count_hit
from billiards_env.jit import inlined
from billiards_env.physics.clusters.impulses import set_normal
from billiards_env.physics.state import same
from billiards_env.scene import CONTACT_GAP


@inlined
def add_contact(i, j, meeting, now, state, scene, contacts, count):  # out: state, contacts
    """Adds balls i < j to the contacts and advances them, if they meet at a `Time` or touch and approach then.

    The contacts stay in the order of their balls.

    Args:
        i: A ball.
        j: The other ball.
        meeting: The predicted time of their meeting.
        now: The time.
        state: The `State`.
        scene: The `SceneArrays`.
        contacts: The `Contacts`.
        count: Number of contacts found so far.

    Returns:
        Whether the balls were added.
    """
    gap, n, closing = scene.space.approach(i, j, now, state, scene)
    if same(meeting, now):
        closing = max(closing, 0.0)
    elif gap > CONTACT_GAP or closing <= 0.0:
        return False
    scene.space.advance(state, i, now, scene.numbers)
    scene.space.advance(state, j, now, scene.numbers)
    first, second = contacts.first, contacts.second
    k = count
    while k > 0 and (first[k - 1] > i or (first[k - 1] == i and second[k - 1] > j)):
        first[k], second[k], contacts.closing[k] = first[k - 1], second[k - 1], contacts.closing[k - 1]
        set_normal(contacts, k, contacts.normal[k - 1])
        k -= 1
    first[k], second[k], contacts.closing[k] = i, j, closing
    set_normal(contacts, k, n)
    return True


@inlined
def resolve_impacts(count, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records the impacts of the first `count` contacts, and lists their balls in `work.changed`.

    Args:
        count: Number of contacts, > 0.
        now: The `Time`; the balls are advanced to it already.
        k: The shot.
        scene: The `SceneArrays`.
        work: The `pic.PicWorkspace`.
        shots: The `Shots`.
        log: The `Log`.

    Returns:
        The number of balls listed. A ball may occur more than once.
    """
    contacts, changed = work.contacts, work.changed
    for c in range(count):
        work.record(BEFORE_IMPACT, contacts.first[c], contacts.second[c], k, scene, work.state, shots)
    acts = collide(count, now.hi, contacts, work.state, scene, work.scratch, work.memory)
    for c in range(count):
        i, j = contacts.first[c], contacts.second[c]
        work.record(AFTER_IMPACT, i, j, k, scene, work.state, shots)
        count_hit(k, i, j, now, shots)
        log_event(log, now, BALL_BALL, i, j, work.state, contacts.closing[c], acts > 0)
        changed[2 * c], changed[2 * c + 1] = i, j
    shots.n_contact_rule[k] += acts
    shots.n_events[k] += count
    return 2 * count


@inlined
def record_single(event, acts, now, k, state, shots, log):  # out: shots, log
    """Counts and logs an event of a ball alone, as `record_event` does, with the acts of the contact-time rule."""
    kind, i, other, speed = event
    shots.n_contact_rule[k] += acts
    shots.n_events[k] += 1
    log_event(log, now, kind, i, other, state, speed, acts > 0)


@inlined
def resolve_singles(count, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records the next single-ball event of each of the first `count` balls of `work.due`.

    Args:
        count: Number of balls.
        now: The `Time` of these events.
        k: The shot.
        scene: The `SceneArrays`.
        work: The `pic.PicWorkspace`.
        shots: The `Shots`.
        log: The `Log`.

    Returns:
        The number of balls listed in `work.changed`, once for each event.
    """
    n_changed = 0
    for c in range(count):
        for _ in range(scene.space.resolve_single(work.due[c], now, k, scene, work, shots, log)):
            work.changed[n_changed] = work.due[c]
            n_changed += 1
    return n_changed
