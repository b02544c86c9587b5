"""Strikes: the velocity and spin that a cue gives the cue ball."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.physics.strike import CueNumbers, cue_numbers, many_strikes
from billiards_env.scene import Scene, check_scene
from billiards_env.support.checks import RANGES, numbers, range_text, short

Floats = NDArray[np.float64]

_PARAMETERS = {
    "speed": "speed",
    "heading": "heading",
    "side": "tip_offset",
    "top": "tip_offset",
    "elevation": "elevation",
}


class Strike(NamedTuple):
    """The state of a cue ball after a strike, if it touches no ball. For several strikes the arrays have leading axes.

    `simulate` and `simulate_batch` replace it if the cue ball touches a ball ahead of it, see `engine.frozen_strike`.

    Attributes:
        velocity: (..., 2) float64, m/s; (..., 3) in scenes with flight.
        spin: (..., 3) float64, rad/s.
        miscue: (...) bool, whether the tip slipped on the ball.
    """

    velocity: Floats
    spin: Floats
    miscue: NDArray[np.bool_]


def strike(
    scene: Scene | str,
    speed: ArrayLike,
    heading: ArrayLike,
    side: ArrayLike = 0.0,
    top: ArrayLike = 0.0,
    elevation: ArrayLike = 0.0,
) -> Strike:
    """Returns the cue ball's velocity and spin after a strike with the cue of a scene.

    The arguments are numbers, or arrays whose shapes broadcast. `side` and `top` are the distances of the tip from the
    centre of the ball, as seen along the cue.

    Args:
        scene: The scene, or a name of `Scene.named`. Its motion must be "sliding": a strike gives the ball spin.
        speed: Speed of the cue, m/s. A ball that is struck at its centre is faster than the cue.
        heading: Direction of the cue on the table, rad, counterclockwise from the x axis.
        side: Offset of the tip to the left (english), in ball radii.
        top: Offset of the tip above the centre, in ball radii. Positive is follow, negative is draw.
        elevation: Angle of the cue above the horizontal, rad. In scenes with flight a raised cue drives the ball into
            the slate, and the ball bounces. In other scenes the vertical velocity is dropped.

    Returns:
        The velocity, the spin and whether the tip slipped, see `physics.strike.struck`.

    Raises:
        ValueError: If a number is outside its range (see `checks.RANGES`), the offset is larger than 1 ball radius,
            the shapes do not broadcast, or the motion is not "sliding".

    Example:
        >>> velocity, spin, miscue = strike("pool", speed=2.0, heading=0.0, side=0.3)  # m/s, rad, ball radii
        >>> velocity.round(3).tolist(), spin[2].round(1).item(), bool(miscue)
        ([2.17, -0.066], -57.0, False)
    """
    scene = Scene.named(scene) if isinstance(scene, str) else scene
    cue, parameters = checked_strike(scene, speed, heading, side, top, elevation)
    shape = parameters.shape[:-1]
    axes = 3 if scene.physics.flight else 2
    result = Strike(np.empty((*shape, axes)), np.empty((*shape, 3)), np.empty(shape, np.bool_))
    rows = parameters.reshape(-1, 5), result.velocity.reshape(-1, axes), result.spin.reshape(-1, 3)
    many_strikes(tuple(cue), *rows, result.miscue.reshape(-1))
    return result


def strike_with(velocities: Floats, spins: Floats | None = None) -> Strike:
    """Returns the strikes that give free balls velocities (..., 2), m/s, and spins (..., 3), rad/s, by default none."""
    shape = velocities.shape[:-1]
    return Strike(velocities, np.zeros((*shape, 3)) if spins is None else spins, np.zeros(shape, np.bool_))


def level_strike(scene: Scene, velocity: ArrayLike, spin: ArrayLike) -> tuple[float, float, float, float]:
    """Returns the arguments (speed, heading, side, top) of the level `strike` that gives a velocity and a spin.

    A spin that no level cue gives with this velocity is replaced by one that has the same size about the vertical axis
    and the same size about the horizontal ones.

    Args:
        scene: The scene.
        velocity: (2,) m/s, not zero.
        spin: (3,) rad/s.

    Example:
        >>> scene = Scene.named("pool")
        >>> velocity, spin, _ = strike(scene, 2.0, 0.7, 0.3, -0.2)
        >>> [round(value, 9) for value in level_strike(scene, velocity, spin)]
        [2.0, 0.7, 0.3, -0.2]
    """
    (x, y), (wx, wy, wz) = np.asarray(velocity, float).tolist(), np.asarray(spin, float).tolist()
    speed = float(np.hypot(x, y))
    share = scene.balls.radius[0] / (2.5 * speed)  # see `physics.strike.struck`
    side, top = -share * wz, share * float(np.copysign(np.hypot(wx, wy), wy * x - wx * y))
    one = strike(scene, 1.0, 0.0, side, top).velocity[:2]
    return speed / float(np.hypot(*one)), float(np.arctan2(y, x) - np.arctan2(one[1], one[0])), side, top


def checked_strike(scene: Scene, *parameters: ArrayLike) -> tuple[CueNumbers, Floats]:
    """Returns the cue and the (..., 5) parameters of strikes, after a check. For the arguments, see `strike`."""
    check_scene(scene)
    if scene.physics.motion != "sliding":
        raise ValueError(
            f"strike with physics.motion = {scene.physics.motion!r}: expected motion 'sliding', a strike gives spin"
        )
    arrays = [numbers(name, value) for name, value in zip(_PARAMETERS, parameters, strict=True)]
    for (name, key), array in zip(_PARAMETERS.items(), arrays, strict=True):
        within = RANGES[key]
        assert within.most is not None
        bad = array[~((within.least <= array) & (array <= within.most))]
        if bad.size:
            raise ValueError(f"{name} = {short(bad.flat[0])}: expected {range_text('numbers', within)}")
    try:
        stacked = np.stack(np.broadcast_arrays(*arrays), axis=-1)
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(_PARAMETERS, arrays, strict=True))
        raise ValueError(f"shapes of {shapes}: expected shapes that broadcast") from None
    outside = np.hypot(stacked[..., 2], stacked[..., 3]) > 1.0
    if outside.any():
        raise ValueError(
            f"(side, top) = {short(stacked[outside][0, 2:4].tolist())}: expected an offset of at most 1 ball radius"
        )
    return cue_numbers(scene), stacked
