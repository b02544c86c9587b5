"""A quick look at the input of many shots, that spares good input the slow one that finds words for what is wrong."""

from __future__ import annotations

import math

from billiards_env.checks import MAX_SPEED, MAX_SPIN
from billiards_env.physics.interrupt import end_call, interrupted
from billiards_env.physics.jit import entry_point
from billiards_env.physics.state import CONTACT_GAP, HALF_LENGTH, HALF_WIDTH

_CLOSE = 1.0 + 1e-12  # closer calls are left to the slow check, which rounds otherwise
_LOOK_AFTER = 10_000_000  # pairs of balls: some ten milliseconds


@entry_point
def plainly_right(begin, end, scene, shots):
    """Whether the shots `begin` to `end` are certainly as `simulate` wants them; if not, they may be or not.

    Args:
        begin: First shot.
        end: One past the last.
        scene: The `SceneArrays`, as a tuple.
        shots: The first four of `Shots`.

    Returns:
        True if all numbers are within their ranges, balls of infinite mass rest, and balls in play lie inside the
        cushions, outside the pockets and apart.
    """
    params, radius, inv_mass, pockets = scene
    positions, velocities, spins, in_play = shots
    n = len(radius)
    pairs = 0
    for shot in range(begin, end):
        pairs += n * (n + 8)
        if pairs > _LOOK_AFTER:
            end_call(interrupted())
            pairs = 0
        for i in range(n):
            x, y = positions[shot, i, 0], positions[shot, i, 1]
            vx, vy = velocities[shot, i, 0], velocities[shot, i, 1]
            wx, wy, wz = spins[shot, i, 0], spins[shot, i, 1], spins[shot, i, 2]
            speed, spin = max(abs(vx), abs(vy)), max(max(abs(wx), abs(wy)), abs(wz))
            if inv_mass[i] == 0.0 and max(speed, spin) > 0.0:
                return False
            # A NaN makes the sum one, which no comparison is true of
            total = vx + vy + wx + wy + wz
            if not (speed <= MAX_SPEED and spin <= MAX_SPIN and total == total and abs(x) + abs(y) < math.inf):
                return False
            if not in_play[shot, i]:
                continue
            if abs(x) > params[HALF_LENGTH] - radius[i] or abs(y) > params[HALF_WIDTH] - radius[i]:
                return False
            for k in range(len(pockets)):
                dx, dy, reach = x - pockets[k, 0], y - pockets[k, 1], pockets[k, 2]
                if dx * dx + dy * dy < _CLOSE * (reach * reach):
                    return False
            for j in range(i):
                dx, dy = x - positions[shot, j, 0], y - positions[shot, j, 1]
                reach = radius[i] + radius[j] - CONTACT_GAP
                if dx * dx + dy * dy < _CLOSE * (reach * reach) and in_play[shot, j]:
                    return False
    return True
