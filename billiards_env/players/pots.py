"""Direct pots by geometry: the ghost-ball aim, what stands in its way, and how fast it has to be.

Three things are left out: shots off a cushion or another ball, what the cue ball does once it has met a cushion, and
what a third ball may do to either.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.scene import Scene

Floats = NDArray[np.float64]

_RIM = 128  # points by which a pocket's rim is known
_WAY = 32  # points by which the cue ball's way after the hit is known
_ARRIVAL = 0.3  # m/s; how fast an object ball should reach the pocket, if that is possible
_THINNEST = 0.05  # cosine of the thinnest cut that is tried
_LEEWAY = 0.02  # radians by which a ball on a cushion may miss a pocket's open mouth: the cushion guides it
_CLEAR = 1e-6  # m; ghost balls keep so far from the cushions
_SPEEDS = (0.0, 0.25, 0.5, 1.0)  # of the way from the least speed that will do to the largest


class Pots(NamedTuple):
    """k ways to pot a ball directly, the best first: those that lead to no scratch, and of these the easiest.

    Attributes:
        ball: (k,) the object ball.
        pocket: (k,) the pocket it is played to.
        direction: (k, 2) the cue ball's direction.
        speed: (k,) its speed, m/s.
        tolerance: (k,) by how much the direction may be off for the ball still to drop, to first order, radians.
        scratch: (k,) bool, whether the cue ball is foreseen to follow into a pocket.
    """

    ball: NDArray[np.intp]
    pocket: NDArray[np.intp]
    direction: Floats
    speed: Floats
    tolerance: Floats
    scratch: NDArray[np.bool_]


def direct_pots(
    scene: Scene, targets: NDArray[np.bool_], positions: Floats, potted: NDArray[np.bool_], max_speed: float
) -> Pots:
    """The shots that send an object ball straight into a pocket, neither ball's way being blocked.

    The ghost ball is where the cue ball touches the object ball on the line from the middle of the pocket's open mouth.
    The easiest shot is the one whose direction may be off the most: by half the angle under which the object ball sees
    the mouth, times (sum of radii) cos(cut) / (way of the cue ball), to first order (Alciatore, TP 3.4: Margin of error
    based on distance and cut angle).

    Args:
        scene: The scene.
        targets: (n,) bool, the balls to pot.
        positions: (n, 2) where the balls are, m.
        potted: (n,) bool, the balls off the table.
        max_speed: The fastest shot, m/s.

    Returns:
        The shots, each at several speeds; none if there is no such shot.
    """
    radius, mass = np.array(scene.balls.radius), np.array(scene.balls.mass)
    half = _half(scene)
    pockets = np.array([(p.x, p.y, p.radius) for p in scene.table.pockets]).reshape(-1, 3)
    cue, found = positions[0], []
    for i in np.flatnonzero(targets & ~potted).tolist():
        others = ~potted
        others[[0, i]] = False
        ball, reach = positions[i], radius[0] + radius[i]
        for p, (x, y, r) in enumerate(pockets.tolist()):
            straight, low, high = _mouth(ball, np.array([x, y]), r, half - radius[i])
            if low == high:
                continue
            line = _turned(straight, (low + high) / 2)
            ghost = _within(ball, ball - reach * line, half - radius[0])
            line = (ball - ghost) / reach
            off = abs(
                float(np.arctan2(straight[0] * line[1] - straight[1] * line[0], straight @ line)) - (low + high) / 2
            )
            run = float(np.hypot(*(np.clip([x, y], radius[i] - half, half - radius[i]) - ball)))
            approach = float(np.hypot(*(ghost - cue)))
            direction = (ghost - cue) / approach if approach > 1e-9 else line
            cosine = float(direction @ line)
            if (
                cosine < _THINNEST
                or off > (high - low) / 2 + _LEEWAY
                or (np.abs(ghost) > half - radius[0]).any()
                or (_distances(cue, ghost, positions[others]) < (radius[0] + radius)[others]).any()
                or (_distances(ball, ball + run * line, positions[others]) < (radius[i] + radius)[others]).any()
                or (_distances(cue, ghost, pockets[:, :2]) < pockets[:, 2]).any()
            ):
                continue
            mouth = max((high - low) / 2 - off, (high - low) / 20)
            gain = mass[0] / (mass[0] + mass[i]) * (1 + scene.physics.e_ball) * cosine
            for arrival in (_ARRIVAL, 0.0):
                least = _launch(scene, approach, _launch(scene, run, arrival) / gain)
                if least <= max_speed:
                    break
            else:
                continue
            tolerance = mouth * reach * cosine / max(approach, reach)
            for part in _SPEEDS:
                speed = least + part * (max_speed - least)
                scratch = _follows(scene, ghost, direction, line, speed, approach, scene.balls.mass[i])
                found.append((i, p, *direction, speed, tolerance, scratch))
    table = np.array(sorted(found, key=lambda shot: (shot[6], -shot[5]))).reshape(-1, 7)
    return Pots(
        table[:, 0].astype(np.intp),
        table[:, 1].astype(np.intp),
        table[:, 2:4],
        table[:, 4],
        table[:, 5],
        table[:, 6].astype(np.bool_),
    )


def _mouth(ball: Floats, pocket: Floats, radius: float, room: Floats) -> tuple[Floats, float, float]:
    """How a ball sees a pocket's open mouth: a direction (2,), and the mouth's least and largest angle from that.

    Open is what the ball's centre, which stays within +-`room`, can reach without touching a cushion.
    """
    angles = np.linspace(0.0, 2 * np.pi, _RIM, endpoint=False)
    rim = pocket + radius * np.column_stack((np.cos(angles), np.sin(angles)))
    ways = rim[(np.abs(rim) <= room).all(axis=1)] - ball
    straight = np.clip(pocket, -room, room) - ball
    straight /= np.hypot(*straight)
    if not len(ways):
        return straight, 0.0, 0.0
    bearings = np.arctan2(straight[0] * ways[:, 1] - straight[1] * ways[:, 0], ways @ straight)
    return straight, float(bearings.min()), float(bearings.max())


def _turned(vector: Floats, angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _within(ball: Floats, ghost: Floats, room: Floats) -> Floats:
    """The ghost ball, moved along the object ball's surface until no cushion is in its place, if it can be."""
    room = room - _CLEAR
    for k in (0, 1):
        if abs(ghost[k]) > room[k]:
            place = np.copysign(room[k], ghost[k])
            square = (ghost - ball) @ (ghost - ball) - (place - ball[k]) ** 2
            if square < 0:
                return ghost
            other = ball[1 - k] + np.copysign(np.sqrt(square), ghost[1 - k] - ball[1 - k])
            ghost = np.array([place, other] if k == 0 else [other, place])
    return ghost


def _distances(start: Floats, end: Floats, points: Floats) -> Floats:
    """(k,) distances of points from the segment from `start` to `end`, m."""
    way, to = end - start, points - start
    along = np.clip(to @ way / max(way @ way, 1e-300), 0.0, 1.0)
    return np.hypot(*(to - along[:, None] * way).T)


def _launch(scene: Scene, distance: float, speed: float) -> float:
    """The speed with which a ball without spin has to set out to do `distance` and then still have `speed`, m/s."""
    p = scene.physics
    if p.motion == "ideal":
        return speed
    if p.motion == "rolling":
        return float(np.sqrt(speed**2 + 2 * p.mu_roll * p.g * distance))
    # It slides until it has 5/7 of its speed, for 12/49 v^2 / (mu_s g), and then rolls.
    slid = float(np.sqrt(speed**2 + 2 * p.mu_slide * p.g * distance))
    if speed >= 5 / 7 * slid:
        return slid
    return float(np.sqrt((speed**2 + 2 * p.mu_roll * p.g * distance) / (25 / 49 + 24 / 49 * p.mu_roll / p.mu_slide)))


def _arrival(scene: Scene, distance: float, speed: float) -> tuple[float, float]:
    """Speed and slip, m/s, of a ball that set out at `speed` without spin and has done `distance`."""
    p = scene.physics
    if p.motion == "ideal":
        return speed, 0.0
    if p.motion == "rolling":
        return float(np.sqrt(max(speed**2 - 2 * p.mu_roll * p.g * distance, 0.0))), 0.0
    slid = speed**2 - 2 * p.mu_slide * p.g * distance
    if slid > (5 / 7 * speed) ** 2:
        left = float(np.sqrt(slid))
        return left, 3.5 * left - 2.5 * speed
    rolled = distance - 12 / 49 * speed**2 / (p.mu_slide * p.g)
    return float(np.sqrt(max((5 / 7 * speed) ** 2 - 2 * p.mu_roll * p.g * rolled, 0.0))), 0.0


def _follows(
    scene: Scene, ghost: Floats, direction: Floats, line: Floats, speed: float, approach: float, mass: float
) -> bool:
    """Whether the cue ball, once it has hit a ball of `mass`, enters a pocket before it meets a cushion.

    It slides in a parabola, then rolls straight on; no third ball is thought of.
    """
    p, own = scene.physics, scene.balls.mass[0]
    left, slip = _arrival(scene, approach, speed)
    impulse = (1 + p.e_ball) * mass / (own + mass) * left * float(direction @ line)
    velocity, sliding = left * direction - impulse * line, slip * direction - impulse * line
    path = [ghost[None]]
    slips = float(np.hypot(*sliding)) if p.motion == "sliding" else 0.0
    if slips > 0:
        t = np.linspace(0.0, 2 / 7 * slips / (p.mu_slide * p.g), _WAY)[:, None]
        path.append(ghost + t * velocity - t * t / 2 * p.mu_slide * p.g * sliding / slips)
        velocity = velocity - 2 / 7 * sliding
    rolling = float(np.hypot(*velocity))
    if rolling > 0:
        far = scene.table.length + scene.table.width
        rolls = far if p.motion == "ideal" else min(rolling**2 / (2 * p.mu_roll * p.g), far)
        path.append(path[-1][-1] + np.linspace(0.0, rolls, 8 * _WAY)[:, None] * velocity / rolling)
    way = np.concatenate(path)
    outside = (np.abs(way) > _half(scene) - scene.balls.radius[0]).any(axis=1)
    if outside.any():
        way = way[: np.argmax(outside)]
    return any((np.hypot(way[:, 0] - q.x, way[:, 1] - q.y) < q.radius).any() for q in scene.table.pockets)


def _half(scene: Scene) -> Floats:
    """(2,) half the table's length and width, m."""
    return np.array([scene.table.length, scene.table.width]) / 2
