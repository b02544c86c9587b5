"""Actions: converts the numbers of an action to the velocity and spin of the cue ball.

`ACTIONS` is the table of the kinds of actions. A shot is played as a "velocity" or as a "strike"; the other kinds are
converted to one of these by modules that are imported with their first use, such as `envs.action_frames`.

The action "velocity" is the velocity of the cue ball along x and y, divided by `max_speed`. The action "strike" has
five numbers that describe the motion of the cue:

* The first two numbers are the heading and the speed of the cue: the velocity, divided by `max_speed`, that the ball
  gets if a level cue hits its centre. An action whose other numbers are 0 is therefore the same shot as the action
  "velocity", bit for bit, unless the cue ball touches a ball ahead of it, see `engine.frozen_strike`.
* `side` and `top` are the offsets of the tip to the left of the ball's centre and above it, divided by the offset at
  which the tip slips (`Cue.miscue_offset`).
* `elevation` is the elevation of the cue divided by 90 degrees. Negative numbers count as 0.

The kernels use only `+ - * /` and `sqrt`, as the engine does, so IEEE 754 defines the bits of the shot.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.doors import Entries, offered
from billiards_env.engine.shots import RISING
from billiards_env.engine.strikes import Strike
from billiards_env.jit import entry_point, inlined, kernel, streams
from billiards_env.physics.elementary import cos_sin, norm, sine_cosine
from billiards_env.physics.state import CUE_BALL, SPIN_X, SPIN_Y, SPIN_Z, X, Y
from billiards_env.physics.strike import CueNumbers, cue_numbers, speed_gain, squirt, struck
from billiards_env.scene import Scene
from billiards_env.support.checks import (
    Range,
    add_entry,
    check_call,
    entry_of,
    finite,
    integer,
    numbers,
    result_of,
    shaped,
    short,
)


class Action(NamedTuple):
    """A kind of action.

    Attributes:
        summary: What the numbers are, for the documentation.
        size: Number of numbers of the velocity (2) or of the strike (5) that is played.
        converter: A function of a scene and the largest speed, m/s. It returns an object whose method `strokes`
            converts actions (k, 2) and `Tables` to actions "velocity" (k, 2): velocities divided by the largest speed.
            If the object has the attribute `choices` > 0, actions (k,) are whole numbers below it, and its method
            `mask` returns which are possible, (k, choices) int8. None for an action that is played as it is.
        has_cue: Whether a cue strikes the cue ball, which gives it spin and drives balls that touch it.
        is_choice: Whether an action is a whole number.
    """

    summary: str
    size: int
    converter: Callable[[Scene, float], Any] | None = None
    has_cue: bool = False
    is_choice: bool = False


def _frame(name: str) -> Callable[[Scene, float], Any]:
    def converter(scene: Scene, max_speed: float) -> Any:
        from billiards_env.envs.action_frames import ActionFrame

        return ActionFrame(name, scene, max_speed)

    return converter


ACTIONS: Entries[Action] = {
    "velocity": Action("velocity of the cue ball along x and along y, divided by `max_speed`", 2),
    "strike": Action("motion of the cue, 5 numbers", 5, has_cue=True),
    "cut": Action(
        "sine of the cut angle at the nearest ball (0: full hit; 1 and -1: the thinnest hits), and speed from 0.4 m/s "
        "to `max_speed`",
        2,
        _frame("cut"),
    ),
    "sum_to_three": Action(
        "speed of the cue from 0.3 to 3 m/s, and cut angle from -70 to 70 degrees, as in LightZero's game",
        2,
        _frame("sum_to_three"),
    ),
} | offered("action")
"""The kinds of actions by name. An attachment adds "plan", in which an action is a whole number."""


def register_action(name: str, action: Action) -> None:
    """Adds a kind of action of another package to `ACTIONS`.

    Raises:
        TypeError, ValueError: As in `checks.add_entry`, or the size is not that of a velocity or of a strike.
    """
    if isinstance(action, Action) and action.size != (5 if action.has_cue and action.converter is None else 2):
        raise ValueError(f"size of action {name!r} = {short(action.size)}: expected 2, or 5 with has_cue = True")
    add_entry("action", name, action, ACTIONS, Action, converter=2)


def action_named(name: str) -> Action:
    """Returns the kind of action of a name."""
    return entry_of("action", name, ACTIONS)


def converter_of(name: str, scene: Scene, max_speed: float) -> Any:
    """Returns the object that converts actions, see `Action`; None for an action that is played as it is.

    Raises:
        TypeError: If it has no such method as `Action` describes.
        ValueError: If its attribute `choices` does not suit the action.
    """
    entry, what = action_named(name), f"converter of action {name!r}"
    if entry.converter is None:
        return None
    converter = result_of(what, object, entry.converter, scene, max_speed)
    for method, count in (("strokes", 2), ("mask", 1))[: 1 + entry.is_choice]:
        check_call(
            f"{what} = {short(converter)}",
            getattr(converter, method, None),
            count,
            f"a method {method!r}, see `Action`",
        )
    choices = Range(1, None) if entry.is_choice else Range(0, 0)
    integer(f"choices of {what}", getattr(converter, "choices", 0), choices)
    return converter


def converted(name: str, converter: Any, actions: NDArray[Any], tables: Any) -> NDArray[np.float64]:
    """Returns the strokes (k, 2) of actions after a check. The arguments are as in `Action`."""
    what = f"strokes of action {name!r}"
    return finite(what, result_of(what, object, converter.strokes, actions, tables), (len(actions), 2))


def possible(name: str, converter: Any, tables: Any) -> NDArray[np.float64]:
    """Returns the mask (k, choices) of a converter after a check: 1 for the choices that are possible, else 0."""
    what = f"mask of action {name!r}"
    mask = shaped(what, result_of(what, object, converter.mask, tables), (len(tables.positions), converter.choices))
    if not ((mask == 0.0) | (mask == 1.0)).all():
        raise ValueError(f"{what} = {short(mask.tolist())}: expected zeros and ones")
    return mask


PLAYED = "velocity", "strike"
"""The actions that are played as they are."""

ONE_CUE_BALL = np.full(1, CUE_BALL, np.int64)

# Columns of an action, after X and Y.
SIDE, TOP, ELEVATION = 2, 3, 4
# The first two columns of the noise of `perturb`; the others belong to the numbers of the action.
TURN, SPEED = 0, 1


def check_action(action: str, scene: Scene) -> None:
    """Raises a ValueError unless a scene allows a kind of action."""
    if action_named(action).has_cue and scene.physics.motion != "sliding":
        raise ValueError(
            f"action = {action!r} with physics.motion = {scene.physics.motion!r}: expected motion 'sliding', "
            f"a {action} gives spin"
        )


def cue_strike(action: ArrayLike, scene: Scene, max_speed: float) -> Strike:
    """Returns the velocity and spin of the cue ball for an action.

    Args:
        action: (2,) or (5,), see the module. The first two numbers are scaled to length 1 if they are longer. The
            others are clipped to [-1, 1], and the elevation to [0, 1].
        scene: The scene.
        max_speed: m/s.

    Returns:
        The strike. Its spin is zero for two numbers. In scenes with flight its velocity has a vertical component.

    Raises:
        ValueError: If the action is not two or five finite numbers.

    Example:
        >>> pool = Scene.named("pool")
        >>> cue_strike([0.0, -0.5], pool, 4.0).velocity.tolist(), cue_strike([3.0, 4.0], pool, 1.0).velocity.tolist()
        ([0.0, -2.0], [0.6, 0.8])
    """
    size = ACTIONS["strike" if np.shape(action) == (5,) else "velocity"].size
    array = finite("action", action, (size,))
    velocity, spin, miscue = np.zeros((1, 1, 2)), np.zeros((1, 1, 3)), np.zeros(1, np.bool_)
    velocity[0, 0] = shorten(array.item(X), array.item(Y), float(max_speed))
    heights = np.zeros((1, 1, 2)) if scene.physics.flight else None
    if size > 2:
        starts = velocity, spin, ONE_CUE_BALL, heights, miscue
        strike_balls(0, 1, np.zeros(1, np.bool_), array[None], tuple(cue_numbers(scene)), starts)
    rising = () if heights is None else heights[0, 0, RISING:]
    return Strike(np.append(velocity[0, 0], rising), spin[0, 0], miscue[0])


def aimed_strikes(scene: Scene, actions: ArrayLike, offsets: ArrayLike) -> NDArray[np.float64]:
    """Returns level strikes that give the ball the velocities of actions, with spin.

    The heading is turned against the squirt. The speed is increased, because an offset tip gives the ball less speed.
    It is at most 1, so the ball is slower than its action if the action is fast and the offset is large.

    Args:
        scene: The scene.
        actions: (m, 2) velocities, divided by `max_speed`.
        offsets: (m, 2) side and top of the strikes, see the module.

    Returns:
        (m, 5) actions.

    Example:
        >>> pool = Scene.named("pool")
        >>> (action,) = aimed_strikes(pool, [[0.5, 0.0]], [[0.6, 0.2]])
        >>> cue_strike(action, pool, 4.0).velocity.round(12).tolist()
        [2.0, 0.0]
    """
    tips = numbers("offsets", offsets)
    velocities, out = shaped("actions", actions, tips.shape), np.zeros((len(tips), 5))
    _aimed(tuple(cue_numbers(scene)), velocities, tips, out)
    return out


def perturb(actions: ArrayLike, noise: ArrayLike) -> NDArray[np.float64]:
    """Adds noise to shots. Actions that are clipped to the same shot get the same result.

    Args:
        actions: (..., 2) or (..., 5), clipped as by `cue_strike` before the noise is added.
        noise: Of the same shape: what is added to the direction, in half turns, to the speed, divided by the largest
            speed, and to the other numbers. The speed stays between 0 and the largest speed. A speed of zero
            stays zero.

    Returns:
        The actions with the noise. An action that is not finite stays as it is; an environment raises an error for it.

    Raises:
        ValueError: If the shapes differ.

    Example:
        >>> perturb([0.0, 0.5], [0.5, 0.25]).tolist()
        [-0.75, 0.0]
    """
    noise = numbers("noise", noise)
    array = shaped("action", actions, noise.shape)
    out = np.empty(noise.shape)
    size = noise.shape[-1]
    _perturbed(array.reshape(-1, size), noise.reshape(-1, size), out.reshape(-1, size))
    return out


@kernel
def shorten(x, y, max_speed):
    """Returns the velocity of an action (x, y), scaled to length 1 if it is longer, times `max_speed`."""
    # First into the box [-1, 1], so that the squares do not overflow.
    largest = max(abs(x), abs(y), 1.0)
    x, y = x / largest, y / largest
    # Not hypot: its last bit depends on the C library.
    speed = max_speed / max(math.sqrt(x * x + y * y), 1.0)
    return x * speed, y * speed


@kernel
def clipped(actions, k, column):
    """Returns the side, the top or the elevation of action k, clipped."""
    least = 0.0 if column == ELEVATION else -1.0
    return min(max(actions[k, column], least), 1.0)


@inlined
def _drive_down(heights, k, i, vz):  # out: heights
    """Sets the vertical velocity of ball i in scenes with flight, m/s; `heights` is `Shots.heights`."""
    if heights is None:
        return
    heights[k, i, RISING] = vz


@entry_point
def strike_balls(begin, end, skip, actions, cue, starts):
    """Replaces the velocities of cue balls after level, central strikes by those of actions, and sets their spins.

    Args:
        begin: First shot.
        end: Last shot plus 1.
        skip: (m,) bool, shots that are left out.
        actions: (m, 5) float64.
        cue: `CueNumbers`, as a plain tuple.
        starts: Velocities (m, n, 2), m/s, and spins (m, n, 3), rad/s, which change, the struck balls (m,) int64,
            `Shots.heights`, which change, and (m,) bool out, whether the tip slipped.
    """
    cue = CueNumbers(*cue)
    velocities, spins, balls, heights, miscues = starts
    for k in range(begin, end):
        if skip[k]:
            continue
        side, top = cue.miscue * clipped(actions, k, SIDE), cue.miscue * clipped(actions, k, TOP)
        sin_elevation, cos_elevation = sine_cosine(0.5 * math.pi * clipped(actions, k, ELEVATION))
        i = balls[k]
        ux, uy = velocities[k, i, X], velocities[k, i, Y]
        vx, vy, wx, wy, wz, miscue, vz = struck(cue, ux, uy, side, top, sin_elevation, cos_elevation)
        velocities[k, i, X], velocities[k, i, Y] = vx, vy
        spins[k, i, SPIN_X], spins[k, i, SPIN_Y], spins[k, i, SPIN_Z] = wx, wy, wz
        miscues[k] = miscue
        _drive_down(heights, k, i, vz)


@entry_point
def _aimed(cue, actions, offsets, out):
    cue = CueNumbers(*cue)
    full = speed_gain(cue, 0.0)
    for k in range(len(actions)):
        side, top = cue.miscue * offsets[k, 0], cue.miscue * offsets[k, 1]
        s, c = squirt(cue, side)
        slower = speed_gain(cue, norm(side, top)) / full
        x, y = shorten(
            (c * actions[k, X] - s * actions[k, Y]) / slower, (s * actions[k, X] + c * actions[k, Y]) / slower, 1.0
        )
        out[k, X], out[k, Y], out[k, SIDE], out[k, TOP] = x, y, offsets[k, 0], offsets[k, 1]


@inlined
def turned(x, y, turn, speed):
    """Returns an action (x, y) turned by `turn` half turns, with `speed` added to its length."""
    x, y = shorten(x, y, 1.0)
    share = norm(x, y)
    if share == 0.0:
        return 0.0, 0.0
    scale = min(max(min(share, 1.0) + speed, 0.0), 1.0) / share
    c, s = cos_sin(turn)
    return scale * (c * x - s * y), scale * (s * x + c * y)


@entry_point
def _perturbed(actions, noise, out):
    for k in range(len(actions)):
        finite = True
        for column in range(actions.shape[1]):
            out[k, column] = actions[k, column]
            finite = finite and math.isfinite(actions[k, column])
        if not finite:
            continue
        for column in range(SIDE, actions.shape[1]):
            out[k, column] = clipped(actions, k, column) + noise[k, column]
        out[k, X], out[k, Y] = turned(actions[k, X], actions[k, Y], noise[k, TURN], noise[k, SPEED])


@entry_point
def add_noise(begin, end, skip, actions, deviations, noise_streams):
    """Adds noise to the actions `begin` to `end` - 1 as `perturb` does, each from its own stream.

    Args:
        begin: First action.
        end: Last action plus 1.
        skip: (m,) bool, actions that are left out.
        actions: (m, 2) or (m, 5) float64, finite, which change.
        deviations: (2,) or (5,), the standard deviations of the noise of `perturb`.
        noise_streams: (m, 4), see `jit.streams`, which advance.
    """
    for k in range(begin, end):
        if skip[k]:
            continue
        turn = streams.next_normal(noise_streams[k]) * deviations[TURN]
        speed = streams.next_normal(noise_streams[k]) * deviations[SPEED]
        actions[k, X], actions[k, Y] = turned(actions[k, X], actions[k, Y], turn, speed)
        for column in range(SIDE, actions.shape[1]):
            added = streams.next_normal(noise_streams[k]) * deviations[column]
            actions[k, column] = clipped(actions, k, column) + added
