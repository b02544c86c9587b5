"""Finds the failure of a timestep that changes the fate of a ball.

A shot is run twice from the same start: exactly, and with a timestep. The contacts of the two runs are compared along
the history of one ball. The first difference is the cause, one of `CAUSES`. The first four causes are the failures of
`studies.failures`; the others occur on a table with cushions and pockets:

* missed_collision: two balls touch, and PIT does not test them during the contact. On PIT's paths they pass through
  each other.
* penetration: PIT finds a collision so late that the line of centres is off by more than `WRONG_LINE`.
* wrong_bounce: the same, and one of the two balls has infinite mass.
* multiple_collisions: one of two colliding balls has another collision between the same two tests, and PIT resolves
  both as one or only one of them.
* cushion: PIT finds a ball more than `DEEP` of its radius beyond a cushion. It bounces from there, or a pocket that it
  would not reach captures it there.
* pocket: a pocket captures the ball, and PIT does not test the ball while its centre is inside.
* small_errors: none of these. The paths drift apart a little at every contact, until a contact differs.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult
from studies.failures import FAILURES

CAUSES = (*FAILURES, "cushion", "pocket", "small_errors")

WRONG_LINE = 1.0
"""Degrees. A line of centres that is off by more is wrong."""

DEEP = 0.1
"""The largest depth of a ball beyond a cushion that counts as small, as a share of its radius."""

_NEAR = 4  # steps; contacts of the two runs that are at most this far apart are the same


class Contact(NamedTuple):
    """A "ball_ball", "cushion" or "pocket" contact of a ball, the one with the lower number of two, and its time, s.

    `other` is the other ball, the cushion or the pocket.
    """

    kind: str
    ball: int
    other: int
    time: float

    @property
    def balls(self) -> tuple[int, ...]:
        """The balls of the contact."""
        return (self.ball, self.other) if self.kind == "ball_ball" else (self.ball,)


def contacts(shot: ShotResult) -> list[Contact]:
    """Returns the contacts of a recorded shot in the order of time.

    Raises:
        ValueError: If the shot was not recorded.
    """
    if shot.events is None:
        raise ValueError("contacts: the shot was not recorded, expected simulate(..., record=True)")
    found = []
    for kind, i, j, t in zip(*(shot.events[name].tolist() for name in ("kind", "ball", "other", "time")), strict=True):
        if kind == "ball_ball":
            i, j = min(i, j), max(i, j)
        if kind in ("ball_ball", "cushion", "pocket"):
            found.append(Contact(kind, i, j, t))
    return found


def history(all_contacts: Sequence[Contact], ball: int) -> list[Contact]:
    """Returns the contacts that affect a ball: its own, and earlier ones of the balls in contact with it."""
    found, involved = [], {ball}
    for contact in reversed(all_contacts):
        if involved.intersection(contact.balls):
            found.append(contact)
            involved.update(contact.balls)
    return found[::-1]


def cause(exact: ShotResult, stepped: ShotResult, dt: float, ball: int) -> str:
    """Returns the first failure of the timestep in the history of a ball, one of `CAUSES`.

    The recorded shots are `exact` by "pic" and `stepped` by "pit" with the timestep dt, s, from the same start.

    Raises:
        ValueError: If a shot was not recorded.

    Example:
        >>> from billiards_env import simulate
        >>> from studies.failures import FAILURES
        >>> case = FAILURES["wrong_bounce"]
        >>> shot = case.scene, case.positions, case.velocities
        >>> exact = simulate(*shot, record=True)
        >>> cause(exact, simulate(*shot, mode="pit", dt=case.dt, record=True), case.dt, ball=0)
        'wrong_bounce'
    """
    expected, actual = contacts(exact), history(contacts(stepped), ball)
    assert exact.scene is not None
    scene = exact.scene
    queues = {i: deque(c for c in expected if i in c.balls) for i in range(scene.n_balls)}
    for found in actual:
        due = [queues[i][0] if queues[i] else None for i in found.balls]
        true = due[0]
        if true is None or any(c is not true for c in due) or true[:3] != found[:3]:
            other = [c for c in due if c is not None and c[:3] != found[:3]]
            first = min(other, key=lambda c: c.time, default=None)
            return _cause_of_difference(expected, first, found, stepped, scene, dt)
        for i in found.balls:
            queues[i].popleft()
        if found.kind == "ball_ball" and _degrees_off(exact, true, stepped, found) > WRONG_LINE:
            if any(c.kind == "ball_ball" and c.time <= found.time for i in found.balls for c in queues[i]):
                return "multiple_collisions"
            return "wrong_bounce" if math.inf in (scene.balls.mass[i] for i in found.balls) else "penetration"
        if found.kind == "cushion" and _depth(stepped, found, scene) > DEEP:
            return "cushion"
    left = queues[ball][0] if queues[ball] else None
    return _cause_of_difference(expected, left, Contact("none", ball, -1, math.inf), stepped, scene, dt)


def _cause_of_difference(
    expected: list[Contact], true: Contact | None, found: Contact, stepped: ShotResult, scene: Scene, dt: float
) -> str:
    """Returns the cause if PIT has the contact `found`, and the exact run has `true` or no contact instead."""
    if found.kind == "pocket" and _depth(stepped, found, scene) > DEEP:
        return "cushion"
    if true is None or true.time > found.time:
        return "small_errors"
    if true.kind == "pocket":
        return "pocket"
    if true.kind == "ball_ball":
        test = math.ceil(true.time / dt)
        before = expected[: expected.index(true)]
        if any(math.ceil(c.time / dt) == test and set(c.balls) & set(true.balls) for c in before):
            return "multiple_collisions"
        times = true.time + dt * np.linspace(-_NEAR, _NEAR, 64 * _NEAR)
        assert stepped.trajectory is not None
        apart = stepped.trajectory.path(true.other, times) - stepped.trajectory.path(true.ball, times)
        reach = scene.balls.contact_distances(true.ball)[true.other]
        if np.hypot(apart[:, 0], apart[:, 1]).min() < 0.999 * reach:  # deeper than the rest of a resolved overlap
            return "missed_collision"
    return "small_errors"


def _degrees_off(exact: ShotResult, true: Contact, stepped: ShotResult, found: Contact) -> float:
    """Returns the angle between the lines of centres of a contact in two runs."""
    (ax, ay), (bx, by) = (
        at[c.other] - at[c.ball] for at, c in ((exact.at(true.time), true), (stepped.at(found.time), found))
    )
    return abs(math.degrees(math.atan2(ax * by - ay * bx, ax * bx + ay * by)))


def _depth(stepped: ShotResult, found: Contact, scene: Scene) -> float:
    """Returns the depth of a ball beyond a cushion when PIT finds it, before PIT moves it, in radii."""
    assert stepped.trajectory is not None
    position = stepped.trajectory.path(found.ball, [found.time], before=True)[0]
    return 1.0 - float(scene.table.clearance(position)) / scene.balls.radius[found.ball]
