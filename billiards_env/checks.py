"""Checks of numbers and names, with one style of message: `name = value: expected ...`.

`RANGES` holds the range of each number of a scene, a shot, an environment or a picture, and of seeds. The ranges
contain everything that happens on a table, with room to spare. Within them the engines' arithmetic does not overflow,
and every shot ends: one of PIC after at most `max_events` events, one of PIT also after at most `pit.MAX_STEPS`
timesteps.
"""

from __future__ import annotations

import difflib
import sys
from typing import Any, NamedTuple

import numpy as np

MAX_SPEED, MAX_SPIN = 1e3, 1e6
"""m/s and rad/s. Of each component of a velocity and of a spin."""


class Range(NamedTuple):
    """What a number may be.

    Attributes:
        least: The smallest value.
        most: The largest value; None for none, of a whole number.
        unit: Its unit, or what to say behind the numbers.
        reason: Why these bounds.
    """

    least: float
    most: float | None
    unit: str = ""
    reason: str = ""


RANGES: dict[str, Range] = {
    # A scene
    "length": Range(1e-4, 1e4, "m", "radii and tables; on 10 km coordinates are rounded by less than CONTACT_GAP"),
    "cushion_height": Range(1e-6, 1e4, "m", "as a length; below the centre of the smallest ball, too"),
    "coordinate": Range(-1e6, 1e6, "m", "of a pocket, or of a place that a player asks for; far beyond any table"),
    "mass": Range(1e-8, 1e8, "kg, or inf", "the ratio of two masses is at most 1e16, the resolution of a double"),
    "g": Range(1e-3, 1e3, "m/s^2", "a small asteroid has 1e-3, the Sun 274"),
    "friction": Range(1e-12, 100.0, "", "of the cloth: from almost none to more than rubber has (about 1)"),
    "mu_cushion": Range(0.0, 100.0, "", "as friction, but a cushion may be smooth"),
    "spin_decay": Range(1e-6, 1e6, "rad/s^2", "on a cloth it is 5 to 15"),
    "restitution": Range(0.0, 1.0, "", "an impact gives no energy"),
    "max_time": Range(1e-9, 1e12, "s", "30,000 years; more than 0, so that time goes by"),
    "balls": Range(1, 100_000, "", "the check of the positions compares all pairs"),
    # A shot
    "speed": Range(-MAX_SPEED, MAX_SPEED, "m/s", "each component; the hardest breaks reach 16 m/s"),
    "spin": Range(-MAX_SPIN, MAX_SPIN, "rad/s", "each component; a ball that rolls at 16 m/s has 600 rad/s"),
    "limit": Range(0.0, 1e12, "s", "as max_time, but a shot may end where it begins"),
    "dt": Range(1e-9, 1e6, "s", "a micrometre at 1000 m/s; no shot takes 1e6 s"),
    "max_events": Range(0, 1_000_000_000, "", "minutes with two balls; a break has hundreds of events"),
    "threads": Range(1, 1024, "", "more than machines have cores"),
    # An environment
    "max_speed": Range(1e-6, MAX_SPEED, "m/s", "as speed"),
    "max_shots": Range(1, 1_000_000_000, "", "fits the counters"),
    "num_envs": Range(1, 10_000_000, "", "gigabytes of memory"),
    "scratch_penalty": Range(0.0, 1e6, "", "it is subtracted from the few points that a shot earns"),
    "angle_std": Range(0.0, 360.0, "degrees", "up to a whole turn"),
    "speed_std": Range(0.0, MAX_SPEED, "m/s", "as speed"),
    # A picture
    "frame_width": Range(160, 7680, "pixels", "from the smallest that can be read to 8K"),
    "fps": Range(1e-3, 1e3, "frames a second", "up to more than a screen shows"),
    # Anything random
    "seed": Range(0, None, "", "what numpy.random.SeedSequence takes"),
}
"""What numbers may be, each with the reason for its bounds."""


def short(value: Any) -> str:
    """The value's text, cut where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a number of thousands of digits, a list in lists without end
        text = f"a {type(value).__name__}"
    return text if len(text) <= 200 else text[:200] + "..."


def fits(value: Any, within: str | Range) -> bool:
    """Whether `value` is a real number in a range.

    Args:
        value: Anything.
        within: The range, or its key in `RANGES`.
    """
    if not isinstance(value, (int, float)):
        if not isinstance(value, (np.integer, np.floating)):
            return False
        value = value.item()  # of few bits, it could not be compared with a large number
    elif isinstance(value, bool):
        return False
    least, most, _, _ = RANGES[within] if isinstance(within, str) else within
    return least <= value and (most is None or value <= most)  # False for a NaN


def real(name: str, value: Any, within: str | Range | None = None) -> float:
    """A real number, checked.

    Args:
        name: What to call it in an error.
        value: The number; neither a bool nor a string is one.
        within: Its range or the key of that in `RANGES`; None for any finite number.

    Returns:
        The number as a float.

    Raises:
        TypeError: If it is no number.
        ValueError: If it is outside the range or not finite.

    Example:
        >>> real("table.length", 2)
        2.0
        >>> real("table.length", -2, "length")
        Traceback (most recent call last):
        ValueError: table.length = -2: expected a number from 0.0001 to 10000 m
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{name} = {short(value)}: expected a number, not {type(value).__name__}")
    if not fits(value, _FINITE if within is None else within):
        wanted = "finite number" if within is None else f"number {_bounds(within)}"
        raise ValueError(f"{name} = {short(value)}: expected a {wanted}")
    return float(value)


def whole(name: str, value: Any, within: str | Range) -> int:
    """A whole number, checked.

    Args:
        name: What to call it in an error.
        value: The number.
        within: Its range or the key of that in `RANGES`.

    Returns:
        The number as an int.

    Raises:
        ValueError: If it is no whole number or outside the range.

    Example:
        >>> whole("max_shots", 0, "max_shots")
        Traceback (most recent call last):
        ValueError: max_shots = 0: expected a whole number from 1 to 1000000000
    """
    least, most, _, _ = RANGES[within] if isinstance(within, str) else within
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not is_whole or value < least or (most is not None and value > most):
        raise ValueError(f"{name} = {short(value)}: expected a whole number {_bounds(within)}")
    return int(value)


def choose(name: str, value: Any, choices: tuple[str, ...]) -> None:
    """Raises a ValueError that suggests the nearest of `choices` unless `value` is one of them."""
    if value not in choices:
        near = difflib.get_close_matches(str(value), choices, 1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        raise ValueError(f"{name} = {short(value)}: expected one of {', '.join(map(repr, choices))}{hint}")


_FINITE = Range(-sys.float_info.max, sys.float_info.max)


def _bounds(within: str | Range) -> str:
    """A range in words."""
    least, most, unit, _ = RANGES[within] if isinstance(within, str) else within
    text = f">= {_text(least)}" if most is None else f"from {_text(least)} to {_text(most)}"
    return text + (unit if unit.startswith(",") or not unit else f" {unit}")


def _text(bound: float) -> str:
    return str(bound) if isinstance(bound, int) else f"{bound:g}"
