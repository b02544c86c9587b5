"""What PIT does to the positions of bodies that overlap: the table `TREATMENTS`.

The paper of Warkari and Jamsandekar leaves open how an overlap is "fixed". An entry of `TREATMENTS` describes and
contains one way. With time_of_impact (Hu et al. 2020, DiffTaichi, section 4.2) a ball goes back in the phase that it
has at the timestep, and a phase that ends in the rest of the step ends at the timestep.

A ball that has stopped beyond a cushion has no path along which it can go back. All fixes that move balls put it at the
nearest position at which it touches the cushion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.clusters.impulses import set_normal, sum_impulses
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.walls import overlap_time
from billiards_env.physics.motion import Path, begin_phase, move
from billiards_env.physics.state import LASTS, VX, VY, X, Y
from billiards_env.scene import CONTACT_GAP

_PUSHES = 1000
"""Largest number of moves of a ball at rest; in an acute corner it goes to one cushion and the other in turn."""


class Bounce(NamedTuple):
    """The impact of a ball that is beyond a cushion.

    Attributes:
        nx: The unit normal into the cushion along x.
        ny: The same along y.
        speed: Speed of approach, m/s; 0 if the ball is only moved, -1 if nothing happens.
    """

    nx: float
    ny: float
    speed: float


@kernel
def _keep_contacts(count, scene, work):
    return count


@kernel
def _keep_positions(count, scene, work):
    return False


@kernel
def _keep_motion(i, scene, work):
    pass


@kernel
def _keep_in_corner(i, wall, n, m, scene, work):
    pass


@kernel
def _keep_place(i, wall, beyond, bounce, scene, work):
    return bounce if bounce.speed > 0.0 else Bounce(bounce.nx, bounce.ny, -1.0)


@kernel
def _keep_at_nose(row, dx, dy, touch):
    pass


class FixKernels(NamedTuple):
    """The kernels of a treatment of overlaps. They move balls in `pit.PitWorkspace.here` and in `State.rows`.

    By default, a kernel changes nothing.

    Attributes:
        before: (count, scene, work) before the impacts of `count` overlapping pairs. Returns how many of them are left.
        after: (count, scene, work) after these impacts. Returns whether it moves balls.
        at_cushion: (i, wall, beyond, bounce, scene, work) before the `Bounce` of ball i, which is beyond a cushion by
            `beyond` m and does not come back. Returns the `Bounce` at the new position.
        at_nose: (row, dx, dy, touch) before the impact of a ball in the air, with this row of `State.rows`, on a nose
            that it overlaps. (dx, dy) is the horizontal way to the nose, m. They touch at the distance `touch`.
        in_corner: (i, wall, n, m, scene, work) before the impact of ball i on two cushions at once, with the normals n
            and m. It touches the first and may overlap the second, `wall`.
        after_cushion: (i, scene, work) after this `Bounce`.
        at_rest: (i, scene, work) if ball i is at rest after its bounces. Returns whether it moves the ball.
    """

    before: Any = _keep_contacts
    after: Any = _keep_positions
    at_cushion: Any = _keep_place
    at_nose: Any = _keep_at_nose
    in_corner: Any = _keep_in_corner
    after_cushion: Any = _keep_motion
    at_rest: Any = _keep_positions


class Fix(NamedTuple):
    """A treatment of overlaps.

    Attributes:
        summary: What happens to an overlap, for the documentation.
        goes_back: Whether balls go back along their paths. A scene with flight has no such fix.
        kernels: The kernels.
    """

    summary: str
    goes_back: bool
    kernels: FixKernels


@inlined
def place(i, x, y, work):  # out: work
    """Moves ball i to a position at the end of the step, m."""
    work.here[i, X], work.here[i, Y] = x, y
    work.state.rows[i, X], work.state.rows[i, Y] = x, y


@kernel
def _find_times(count, scene, work):  # out: work
    """Sets `back` of the balls of `count` contacts to the time since they touched, by one step at most.

    The paths are straight. Of several contacts of a ball the earliest counts. `back` of all other balls is 0.
    """
    contacts, here, back = work.contacts, work.here, work.back
    back[:] = 0.0
    for c in range(count):
        i, j = contacts.first[c], contacts.second[c]
        dx, dy = here[j, X] - here[i, X], here[j, Y] - here[i, Y]
        wx, wy = here[j, VX] - here[i, VX], here[j, VY] - here[i, VY]
        reach = scene.space.contact_distance(i, j, scene)
        ww, dw = wx * wx + wy * wy, dx * wx + dy * wy
        if ww > 0.0:  # |d - w t| = reach
            t = (dw + math.sqrt(max(0.0, dw * dw + ww * (reach * reach - (dx * dx + dy * dy))))) / ww
            t = min(t, scene.numbers.dt)
            back[i], back[j] = max(back[i], t), max(back[j], t)


@inlined
def _step_back(i, scene, work):  # out: work
    """Moves ball i back along its straight path by its `back`."""
    here, t = work.here, work.back[i]
    place(i, here[i, X] - t * here[i, VX], here[i, Y] - t * here[i, VY], work)


@kernel
def _touching(count, scene, work):  # out: work
    """Keeps those of `count` contacts whose balls touch and do not separate. Returns their number."""
    contacts, here = work.contacts, work.here
    left = 0
    for c in range(count):
        i, j = contacts.first[c], contacts.second[c]
        dx, dy = here[j, X] - here[i, X], here[j, Y] - here[i, Y]
        distance = norm(dx, dy)
        if distance > scene.space.contact_distance(i, j, scene) + CONTACT_GAP:
            continue
        nx, ny = contacts.normal[c, X], contacts.normal[c, Y]
        if distance > 0.0:
            nx, ny = dx / distance, dy / distance
        closing = -(nx * (here[j, VX] - here[i, VX]) + ny * (here[j, VY] - here[i, VY]))
        if closing >= 0.0:
            contacts.first[left], contacts.second[left], contacts.closing[left] = i, j, closing
            set_normal(contacts, left, (nx, ny))
            left += 1
    return left


@inlined
def _find_cushion_time(i, wall, beyond, speed, scene, work):  # out: work
    """Sets `back` of ball i to the time since it touched the cushion, by one step at most."""
    here = work.here
    path = Path(here[i, X], here[i, Y], here[i, VX], here[i, VY], 0.0, 0.0)
    t = overlap_time(path, scene.radius[i], wall, beyond, speed, scene.outline)
    work.back[i] = min(t, scene.numbers.dt)


@inlined
def _bounce_of(i, wall, scene, work):
    """Returns the `Bounce` of ball i at its position; the normal of a tip depends on the position."""
    nx, ny = scene.walls.normal(work.state.rows[i, X], work.state.rows[i, Y], wall, scene)
    return Bounce(nx, ny, max(0.0, nx * work.here[i, VX] + ny * work.here[i, VY]))


@kernel
def _rewind(i, scene, work):  # out: work
    """Sets ball i to its motion at the time of impact, its `back` ago, at the position at which it touches exactly."""
    here, row = work.here, work.state.rows[i]
    move(work.state, i, -work.back[i], scene.numbers)
    _step_back(i, scene, work)
    here[i, VX], here[i, VY] = row[VX], row[VY]


@kernel
def _finish_step(i, scene, work):  # out: work
    """Moves ball i with its new velocity for the rest of the step, which is its `back`."""
    here, row = work.here, work.state.rows[i]
    begin_phase(work.state, i, scene.numbers)
    move(work.state, i, min(work.back[i], row[LASTS]), scene.numbers)
    here[i, X], here[i, Y], here[i, VX], here[i, VY] = row[X], row[Y], row[VX], row[VY]
    work.back[i] = 0.0


@kernel
def _finish_steps(count, scene, work):  # out: work
    """Moves the balls of `_rewind` for the rest of the step."""
    for i in range(len(work.back)):
        if work.back[i] > 0.0:
            _finish_step(i, scene, work)
    return True


def _going_back(go_back: Callable[..., None]) -> tuple[Any, Any]:
    """Returns the kernels `before` and `at_cushion` of a `Fix` by which balls go back to where they touched.

    Args:
        go_back: (i, scene, work) moves ball i back by its `back`.
    """

    @kernel
    def to_balls(count, scene, work):  # out: work
        """Moves the balls of `count` contacts back along their paths. Returns the number of contacts that are left.

        A ball with several contacts is moved back to the earliest. At that position the others may not exist.
        """
        _find_times(count, scene, work)
        for i in range(len(work.back)):
            if work.back[i] > 0.0:
                go_back(i, scene, work)
        return _touching(count, scene, work)

    @kernel
    def to_cushion(i, wall, beyond, bounce, scene, work):  # out: work
        """Moves ball i back along its path to the cushion, by one step at most."""
        work.back[i] = 0.0
        if bounce.speed == 0.0:
            return Bounce(bounce.nx, bounce.ny, -1.0)
        _find_cushion_time(i, wall, beyond, bounce.speed, scene, work)
        go_back(i, scene, work)
        return _bounce_of(i, wall, scene, work)

    return to_balls, to_cushion


@kernel
def _push_apart(count, scene, work):  # out: work
    """Moves the balls of `count` contacts apart along their lines of centres until each pair touches."""
    contacts, here, scratch, inv_mass = work.contacts, work.here, work.scratch, scene.inv_mass
    shift, done, overlap, scale = scratch.dv, scratch.done, scratch.descent[0], scratch.descent[1]
    for c in range(count):
        i, j = contacts.first[c], contacts.second[c]
        overlap[c] = scene.space.depth(i, j, here, scene)
        scale[c] = 1.0 / (inv_mass[i] + inv_mass[j])
    sum_impulses(count, contacts, overlap, scale, inv_mass, shift, done)
    for c in range(count):
        for i in (contacts.first[c], contacts.second[c]):
            if done[i]:
                scene.space.shift(i, shift[i], work)
                done[i] = False
    return True


@kernel
def _push_inside(i, wall, beyond, bounce, scene, work):  # out: work
    """Moves ball i to the nearest position at which it touches the cushion."""
    x, y = scene.walls.back_to(work.here[i, X], work.here[i, Y], scene.radius[i], wall, scene)
    place(i, x, y, work)
    return bounce


@kernel
def _bring_back(i, scene, work):  # out: work
    """Moves ball i to the cushion that it overlaps most, until it overlaps none. Returns whether it moves the ball."""
    here, radius = work.here, scene.radius[i]
    for push in range(_PUSHES):
        wall = scene.walls.deepest_overlap(here[i, X], here[i, Y], radius, scene)
        if wall < 0:
            return push > 0
        x, y = scene.walls.back_to(here[i, X], here[i, Y], radius, wall, scene)
        place(i, x, y, work)
    return True


@kernel
def _push_from_nose(row, dx, dy, touch):  # out: row
    """Moves a ball away from a nose horizontally until they touch."""
    if dx != 0.0 or dy != 0.0:
        share = 1.0 - touch / norm(dx, dy)
        row[X], row[Y] = row[X] + share * dx, row[Y] + share * dy


@kernel
def _push_along(i, wall, n, m, scene, work):  # out: work
    """Moves ball i along the cushion with the normal n, which it touches, to touch the cushion with the normal m."""
    x, y = work.here[i, X], work.here[i, Y]
    beyond, _, _ = scene.walls.overlap(x, y, scene.radius[i], wall, scene)
    way = max(0.0, beyond) / (n[0] * m[1] - n[1] * m[0])
    place(i, x + way * n[1], y - way * n[0], work)


_touch_balls, _touch_cushion = _going_back(_step_back)
_hit_balls, _hit_cushion = _going_back(_rewind)

TREATMENTS = {
    "push_apart": Fix(
        "The impulse acts along the line of centres of the overlapping balls. Then they are moved apart along this "
        "line until they touch, the lighter ball further. A ball beyond a cushion is moved back to it",
        False,
        FixKernels(
            after=_push_apart,
            at_cushion=_push_inside,
            at_nose=_push_from_nose,
            in_corner=_push_along,
            at_rest=_bring_back,
        ),
    ),
    "move_back": Fix(
        "Before the impulse the balls go back along their paths, by one step at most, to the positions at which they "
        "touched. The line of centres is then right, but the balls lag by the time of the backward motion",
        True,
        FixKernels(before=_touch_balls, at_cushion=_touch_cushion, at_rest=_bring_back),
    ),
    "none": Fix(
        "The positions do not change. A ball that stops beyond a cushion stays there",
        False,
        FixKernels(),
    ),
    "time_of_impact": Fix(
        "The balls go back as with `move_back`. After the impulse they move with the new velocities for the rest of "
        "the step",
        True,
        FixKernels(
            before=_hit_balls,
            after=_finish_steps,
            at_cushion=_hit_cushion,
            after_cushion=_finish_step,
            at_rest=_bring_back,
        ),
    ),
}
"""The treatments by name."""

FIXES = tuple(TREATMENTS)
"""The names of the treatments; the first is the default."""
