"""Direct pots by geometry: the ghost-ball aim, its obstacles and its speed.

It does not consider shots off a cushion or off another ball, the cue ball's path after it meets a cushion, and what a
third ball does to either.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.scene import Scene

Floats = NDArray[np.float64]

_RIM = 128  # points on a pocket's rim
_PATH = 32  # points on the cue ball's path after the hit
_ARRIVAL = 0.3  # m/s; speed of the object ball at the pocket, if that is possible
_THINNEST = 0.05  # cosine of the thinnest cut
_LEEWAY = 0.02  # radians by which a ball on a cushion may miss a pocket's open mouth: the cushion guides it
_CLEAR = 1e-6  # m; clearance between ghost balls and cushions
_SPEEDS = (0.0, 0.25, 0.5, 1.0)  # shares of the way from the least possible speed to the largest


class Pots(NamedTuple):
    """k direct pots, best first: those without a scratch before the others, then by tolerance.

    Attributes:
        ball: (k,) the object ball.
        pocket: (k,) the pocket.
        direction: (k, 2) the cue ball's direction.
        speed: (k,) the cue ball's speed, m/s.
        tolerance: (k,) the largest error of the direction that still pots the ball, to first order, radians.
        scratch: (k,) bool, whether the cue ball is expected to enter a pocket.
    """

    ball: NDArray[np.intp]
    pocket: NDArray[np.intp]
    direction: Floats
    speed: Floats
    tolerance: Floats
    scratch: NDArray[np.bool_]


class _Aim(NamedTuple):
    """How the cue ball sends an object ball into a pocket.

    Attributes:
        ghost: (2,) the cue ball's centre at the hit, m.
        line: (2,) the direction of the object ball.
        direction: (2,) the direction of the cue ball.
        cosine: The cosine of the angle between the two.
        approach: The distance of the cue ball to the hit, m.
        run: The distance of the object ball to the pocket, m.
        mouth: Half the angle under which the object ball sees the open mouth, less the error of `line`, radians.
    """

    ghost: Floats
    line: Floats
    direction: Floats
    cosine: float
    approach: float
    run: float
    mouth: float


def direct_pots(
    scene: Scene,
    targets: NDArray[np.bool_],
    positions: Floats,
    potted: NDArray[np.bool_],
    max_speed: float,
    cue: int = 0,
) -> Pots:
    """Returns the shots that send an object ball straight into a pocket without an obstacle.

    The ghost ball is the cue ball at the hit, on the line from the middle of the pocket's open mouth through the object
    ball. The tolerance of the cue ball's direction is half the angle under which the object ball sees the mouth, times
    (sum of radii) cos(cut) / (distance of the cue ball to the ghost ball), to first order (Alciatore, TP 3.4: Margin of
    error based on distance and cut angle).

    Args:
        scene: The scene.
        targets: (n,) bool, the balls to pot.
        positions: (n, 2) m.
        potted: (n,) bool, the balls off the table.
        max_speed: Speed of the fastest shot, m/s.
        cue: The number of the cue ball.

    Returns:
        The shots, each at several speeds.
    """
    e_ball, mass, reach = scene.physics.e_ball, scene.balls.mass, np.array(scene.balls.radius) + scene.balls.radius[cue]
    found = []
    for i in np.flatnonzero(targets & ~potted).tolist():
        for p, aim in _aims(scene, positions, potted, cue, i):
            gain = mass[cue] / (mass[cue] + mass[i]) * (1 + e_ball) * aim.cosine
            for arrival in (_ARRIVAL, 0.0):
                least = _launch(scene, aim.approach, _launch(scene, aim.run, arrival) / gain)
                if least <= max_speed:
                    break
            else:
                continue
            tolerance = aim.mouth * reach[i] * aim.cosine / max(aim.approach, reach[i])
            for share in _SPEEDS:
                speed = least + share * (max_speed - least)
                found.append((i, p, *aim.direction, speed, tolerance, _scratches(scene, aim, speed, cue, i)))
    table = np.array(sorted(found, key=lambda shot: (shot[6], -shot[5]))).reshape(-1, 7)
    return Pots(
        table[:, 0].astype(np.intp),
        table[:, 1].astype(np.intp),
        table[:, 2:4],
        table[:, 4],
        table[:, 5],
        table[:, 6].astype(np.bool_),
    )


def _aims(scene: Scene, positions: Floats, potted: NDArray[np.bool_], cue: int, i: int) -> Iterator[tuple[int, _Aim]]:
    """Yields the pockets into which the cue ball can send ball i, with the aim for each."""
    radius, half = np.array(scene.balls.radius), _half(scene)
    pockets = np.array([(p.x, p.y, p.radius) for p in scene.table.pockets]).reshape(-1, 3)
    others = ~potted
    others[[cue, i]] = False
    start, ball, reach = positions[cue], positions[i], radius[cue] + radius[i]
    for p, (x, y, r) in enumerate(pockets.tolist()):
        straight, low, high = _mouth(ball, np.array([x, y]), r, half - radius[i])
        if low == high:
            continue
        line = _rotated(straight, (low + high) / 2)
        ghost = _inside(ball, ball - reach * line, half - radius[cue])
        line = (ball - ghost) / reach
        off = abs(float(np.arctan2(straight[0] * line[1] - straight[1] * line[0], straight @ line)) - (low + high) / 2)
        run = float(np.hypot(*(np.clip([x, y], radius[i] - half, half - radius[i]) - ball)))
        approach = float(np.hypot(*(ghost - start)))
        direction = (ghost - start) / approach if approach > 1e-9 else line
        cosine = float(direction @ line)
        if (
            cosine < _THINNEST
            or off > (high - low) / 2 + _LEEWAY
            or (np.abs(ghost) > half - radius[cue]).any()
            or (_distances(start, ghost, positions[others]) < (radius[cue] + radius)[others]).any()
            or (_distances(ball, ball + run * line, positions[others]) < (radius[i] + radius)[others]).any()
            or (_distances(start, ghost, pockets[:, :2]) < pockets[:, 2]).any()
        ):
            continue
        yield p, _Aim(ghost, line, direction, cosine, approach, run, max((high - low) / 2 - off, (high - low) / 20))


def _mouth(ball: Floats, pocket: Floats, radius: float, room: Floats) -> tuple[Floats, float, float]:
    """Returns the directions from a ball to a pocket's open mouth: one (2,), and the least and largest angle from it.

    The open mouth is the part of the pocket that the ball's centre, which stays within +-`room`, can reach.
    """
    angles = np.linspace(0.0, 2 * np.pi, _RIM, endpoint=False)
    rim = pocket + radius * np.column_stack((np.cos(angles), np.sin(angles)))
    lines = rim[(np.abs(rim) <= room).all(axis=1)] - ball
    straight = np.clip(pocket, -room, room) - ball
    straight /= np.hypot(*straight)
    if not len(lines):
        return straight, 0.0, 0.0
    bearings = np.arctan2(straight[0] * lines[:, 1] - straight[1] * lines[:, 0], lines @ straight)
    return straight, float(bearings.min()), float(bearings.max())


def _rotated(vector: Floats, angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _inside(ball: Floats, ghost: Floats, room: Floats) -> Floats:
    """Returns the ghost ball, moved along the object ball's surface off the cushions if that is possible."""
    room = room - _CLEAR
    for k in (0, 1):
        if abs(ghost[k]) > room[k]:
            limit = np.copysign(room[k], ghost[k])
            square = (ghost - ball) @ (ghost - ball) - (limit - ball[k]) ** 2
            if square < 0:
                return ghost
            other = ball[1 - k] + np.copysign(np.sqrt(square), ghost[1 - k] - ball[1 - k])
            ghost = np.array([limit, other] if k == 0 else [other, limit])
    return ghost


def _distances(start: Floats, end: Floats, points: Floats) -> Floats:
    """Returns the distances (k,) of points (k, 2) from the segment from `start` to `end`, m."""
    segment, to_points = end - start, points - start
    along = np.clip(to_points @ segment / max(segment @ segment, 1e-300), 0.0, 1.0)
    return np.hypot(*(to_points - along[:, None] * segment).T)


def _launch(scene: Scene, distance: float, speed: float) -> float:
    """Returns the initial speed of a ball without spin that has `speed` after `distance`, m/s."""
    p = scene.physics
    if p.motion == "ideal":
        return speed
    if p.motion == "rolling":
        return float(np.sqrt(speed**2 + 2 * p.mu_roll * p.g * distance))
    # The ball slides to 5/7 of its speed, over 12/49 v^2 / (mu_s g), and then rolls.
    sliding = float(np.sqrt(speed**2 + 2 * p.mu_slide * p.g * distance))
    if speed >= 5 / 7 * sliding:
        return sliding
    return float(np.sqrt((speed**2 + 2 * p.mu_roll * p.g * distance) / (25 / 49 + 24 / 49 * p.mu_roll / p.mu_slide)))


def _arrival(scene: Scene, distance: float, speed: float) -> tuple[float, float]:
    """Returns the speed and slip, m/s, after `distance` of a ball that starts at `speed` without spin."""
    p = scene.physics
    if p.motion == "ideal":
        return speed, 0.0
    if p.motion == "rolling":
        return float(np.sqrt(max(speed**2 - 2 * p.mu_roll * p.g * distance, 0.0))), 0.0
    square = speed**2 - 2 * p.mu_slide * p.g * distance
    if square > (5 / 7 * speed) ** 2:
        left = float(np.sqrt(square))
        return left, 3.5 * left - 2.5 * speed
    rolled = distance - 12 / 49 * speed**2 / (p.mu_slide * p.g)
    return float(np.sqrt(max((5 / 7 * speed) ** 2 - 2 * p.mu_roll * p.g * rolled, 0.0))), 0.0


def _scratches(scene: Scene, aim: _Aim, speed: float, cue: int, i: int) -> bool:
    """Returns whether the cue ball, after it hits ball i, enters a pocket before it meets a cushion.

    It slides along a parabola and then rolls straight on. Third balls are ignored.
    """
    p, mass = scene.physics, scene.balls.mass
    left, slip = _arrival(scene, aim.approach, speed)
    impulse = (1 + p.e_ball) * mass[i] / (mass[cue] + mass[i]) * left * float(aim.direction @ aim.line)
    velocity, sliding = left * aim.direction - impulse * aim.line, slip * aim.direction - impulse * aim.line
    path = [aim.ghost[None]]
    slips = float(np.hypot(*sliding)) if p.motion == "sliding" else 0.0
    if slips > 0:
        t = np.linspace(0.0, 2 / 7 * slips / (p.mu_slide * p.g), _PATH)[:, None]
        path.append(aim.ghost + t * velocity - t * t / 2 * p.mu_slide * p.g * sliding / slips)
        velocity = velocity - 2 / 7 * sliding
    rolling = float(np.hypot(*velocity))
    if rolling > 0:
        far = scene.table.length + scene.table.width
        rolls = far if p.motion == "ideal" else min(rolling**2 / (2 * p.mu_roll * p.g), far)
        path.append(path[-1][-1] + np.linspace(0.0, rolls, 8 * _PATH)[:, None] * velocity / rolling)
    points = np.concatenate(path)
    outside = (np.abs(points) > _half(scene) - scene.balls.radius[cue]).any(axis=1)
    if outside.any():
        points = points[: np.argmax(outside)]
    return any((np.hypot(points[:, 0] - q.x, points[:, 1] - q.y) < q.radius).any() for q in scene.table.pockets)


def _half(scene: Scene) -> Floats:
    """Returns half the table's length and width, (2,) m."""
    return np.array([scene.table.length, scene.table.width]) / 2
