"""Why a shot goes otherwise with a timestep than in truth: the first thing that the timestep got wrong.

A ball's fate, whether it drops and where, has a story: the contacts with balls, cushions and pockets that it hangs on,
those of balls that hit it among them. `cause` follows the story as PIT has it and stops where it first departs from
what the same balls do in the exact run of the same shot. The causes are the four failures of
`billiards_env.failures`, and what else happens on a table with cushions and pockets:

* missed_collision: two balls touch in truth and PIT never tests them while they do; on PIT's own paths they pass
  through each other.
* penetration: PIT finds the two balls so late that its line of centres is off by more than `WRONG_LINE`.
* wrong_bounce: the same, one of the two being a ball of infinite mass.
* multiple_collisions: in truth one of the two balls has a further hit between the same two tests, and PIT takes them
  for one or has but one of them.
* cushion: a ball is found more than `DEEP` of its radius beyond a cushion, and bounces from there or is captured there
  by a pocket that it would not have reached.
* pocket: in truth a pocket captures the ball; PIT never tests it while its centre is inside.
* small_errors: none of these; the paths drift apart by less at every contact, until one of them is another one.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.failures import FAILURES
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult

Floats = NDArray[np.float64]

CAUSES = (*FAILURES, "cushion", "pocket", "small_errors")

WRONG_LINE = 1.0
"""Degrees. A line of centres that is off by more is wrong; `failures.Failure.right_below` allows as much."""

DEEP = 0.1
"""How far beyond a cushion a ball may be found, as a share of its radius."""

_NEAR = 4  # steps; two runs of a shot agree if their contacts are at most this far apart


class Contact(NamedTuple):
    """A ball touches a ball or a cushion or drops.

    Attributes:
        kind: "ball_ball", "cushion" or "pocket".
        ball: The ball, of two the lower number.
        other: The other ball, the cushion or the pocket.
        time: s.
    """

    kind: str
    ball: int
    other: int
    time: float

    @property
    def balls(self) -> tuple[int, ...]:
        """The balls that take part."""
        return (self.ball, self.other) if self.kind == "ball_ball" else (self.ball,)


def contacts(shot: ShotResult) -> list[Contact]:
    """The contacts of a recorded shot in the order of time.

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


def story(all_contacts: Sequence[Contact], ball: int) -> list[Contact]:
    """The contacts that a ball's fate hangs on: its own, and those that the balls it hit had before."""
    told, involved = [], {ball}
    for contact in reversed(all_contacts):
        if involved.intersection(contact.balls):
            told.append(contact)
            involved.update(contact.balls)
    return told[::-1]


def cause(exact: ShotResult, stepped: ShotResult, dt: float, ball: int) -> str:
    """What the timestep first got wrong in the story of a ball.

    Args:
        exact: The recorded shot by "pic".
        stepped: The recorded shot by "pit" from the same start.
        dt: Its timestep, s.
        ball: The ball whose fate differs.

    Returns:
        One of `CAUSES`, see the module's docstring.

    Raises:
        ValueError: If a shot was not recorded.

    Example:
        >>> from billiards_env import failures, simulate
        >>> case = failures.named("wrong_bounce")
        >>> shot = case.scene, case.positions, case.velocities
        >>> exact = simulate(*shot, record=True)
        >>> cause(exact, simulate(*shot, mode="pit", dt=case.dt, record=True), case.dt, ball=0)
        'wrong_bounce'
    """
    truth, told = contacts(exact), story(contacts(stepped), ball)
    assert exact.scene is not None
    scene = exact.scene
    ahead = {i: deque(c for c in truth if i in c.balls) for i in range(scene.n_balls)}
    for found in told:
        due = [ahead[i][0] if ahead[i] else None for i in found.balls]
        true = due[0]
        if true is None or any(c is not true for c in due) or true[:3] != found[:3]:
            other = [c for c in due if c is not None and c[:3] != found[:3]]
            return _departure(truth, min(other, key=lambda c: c.time, default=None), found, stepped, scene, dt)
        for i in found.balls:
            ahead[i].popleft()
        if found.kind == "ball_ball" and _degrees_off(exact, true, stepped, found) > WRONG_LINE:
            if any(c.kind == "ball_ball" and c.time <= found.time for i in found.balls for c in ahead[i]):
                return "multiple_collisions"
            return "wrong_bounce" if math.inf in (scene.balls.mass[i] for i in found.balls) else "penetration"
        if found.kind == "cushion" and _beyond(stepped, found, scene) > DEEP:
            return "cushion"
    left = ahead[ball][0] if ahead[ball] else None
    return _departure(truth, left, Contact("none", ball, -1, math.inf), stepped, scene, dt)


def _departure(
    truth: list[Contact], true: Contact | None, found: Contact, stepped: ShotResult, scene: Scene, dt: float
) -> str:
    """The cause where PIT has the contact `found` and the exact run has `true` instead, or nothing."""
    if found.kind == "pocket" and _beyond(stepped, found, scene) > DEEP:
        return "cushion"
    if true is None or true.time > found.time:
        return "small_errors"
    if true.kind == "pocket":
        return "pocket"
    if true.kind == "ball_ball":
        test = math.ceil(true.time / dt)
        before = truth[: truth.index(true)]
        if any(math.ceil(c.time / dt) == test and set(c.balls) & set(true.balls) for c in before):
            return "multiple_collisions"
        times = true.time + dt * np.linspace(-_NEAR, _NEAR, 64 * _NEAR)
        way = _path(stepped, true.other, times) - _path(stepped, true.ball, times)
        reach = scene.balls.radius[true.ball] + scene.balls.radius[true.other]
        if np.hypot(way[:, 0], way[:, 1]).min() < 0.999 * reach:  # more than the fix leaves of an overlap
            return "missed_collision"
    return "small_errors"


def _degrees_off(exact: ShotResult, true: Contact, stepped: ShotResult, found: Contact) -> float:
    """The angle between the lines of centres of a contact in two runs."""
    (ax, ay), (bx, by) = (
        places[c.other] - places[c.ball] for places, c in ((exact.at(true.time), true), (stepped.at(found.time), found))
    )
    return abs(math.degrees(math.atan2(ax * by - ay * bx, ax * bx + ay * by)))


def _beyond(stepped: ShotResult, found: Contact, scene: Scene) -> float:
    """How far beyond a cushion a ball was when it was found, before anything was done about it, in radii."""
    x, y = _path(stepped, found.ball, np.array([found.time]), before=True)[0]
    radius = scene.balls.radius[found.ball]
    return max(abs(x) - scene.table.length / 2, abs(y) - scene.table.width / 2) / radius + 1.0


def _path(shot: ShotResult, ball: int, times: Floats, before: bool = False) -> Floats:
    """Returns the positions of a ball, see `Trajectory.path`."""
    assert shot.trajectory is not None
    return shot.trajectory.path(ball, times, before)
