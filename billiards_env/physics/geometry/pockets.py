"""The geometry of a pocket: the circle whose rim a ball's centre crosses when the ball drops.

The argument `pocket` is a row of `SceneArrays.pockets`. The shape of a pocket is in this module, in
`scene.table.Pocket`, in `noses` (for flights) and in the 50-digit reference.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import misses_circle, sweep
from billiards_env.physics.motion import relative_to

_X, _Y, _RADIUS = 0, 1, 2  # columns of `SceneArrays.pockets`, m


@inlined
def centre_of(pocket):
    """Returns the place (x, y) at which a potted ball stays, m."""
    return pocket[_X], pocket[_Y]


@inlined
def bounding_circle(pocket):
    """Returns x, y and the radius of a circle that contains the pocket, m."""
    return pocket[_X], pocket[_Y], pocket[_RADIUS]


@inlined
def path_to(path, pocket):
    """Returns a ball's `Path` in the frame of a pocket, and the distance from the origin at which the ball drops, m."""
    return relative_to(path, pocket[_X], pocket[_Y]), pocket[_RADIUS]


@inlined
def pockets_near(path, end, pockets):
    """Returns the first and the last pocket that a ball's `Path` may reach until `end`, s; (n, -1) if it reaches none.

    Other pockets are out of its reach. All n pockets are tested without branches, because these are hard to predict.
    """
    swept, first, last = sweep(path, end), len(pockets), -1
    for k in range(len(pockets)):
        from_pocket, reach = path_to(path, pockets[k])
        near = not misses_circle(from_pocket, swept, reach)
        first, last = min(first, k if near else first), k if near else last
    return first, last


@inlined
def pocket_at(pockets, x, y, larger):
    """Returns the first pocket that contains a point, or -1. The area of a pocket is multiplied by `larger`."""
    for p in range(len(pockets)):
        dx, dy, reach = x - pockets[p, _X], y - pockets[p, _Y], pockets[p, _RADIUS]
        if dx * dx + dy * dy < larger * (reach * reach):
            return p
    return -1


@inlined
def pocket_exit(path, pocket):
    """Returns the time after which a straight `Path` leaves a pocket, s, or infinity."""
    (x, y, vx, vy, _, _), reach = path_to(path, pocket)
    vv, dw = vx * vx + vy * vy, x * vx + y * vy
    square = dw * dw + vv * (reach * reach - (x * x + y * y))
    t = (math.sqrt(square) - dw) / vv if square > 0.0 else -1.0
    return t if t > 0.0 else math.inf


@inlined
def distance_from(pocket, x, y):
    """Returns the distance of a point from the rim, m; negative inside."""
    return norm(x - pocket[_X], y - pocket[_Y]) - pocket[_RADIUS]


@inlined
def outwards_at(pocket, x, y):
    """Returns the normal (x, y) of the rim, away from the pocket, at a point of the rim. Its length is arbitrary."""
    return x - pocket[_X], y - pocket[_Y]
