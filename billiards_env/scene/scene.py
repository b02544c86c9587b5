"""Scenes: the table, the balls and the physics, which stay the same from shot to shot.

All quantities are in SI units. The origin is the table's centre, x runs along the table's length and y along its width.
Scenes are immutable and are validated on construction. `checks.RANGES` holds the range of each number.

The default values and their sources (`billiards_env.scene.table` has those of the tables; `Physics` those of its
numbers):

=====================  ==============  ===========================================================================
field                  default         source
=====================  ==============  ===========================================================================
balls.radius           0.028575 m      WPA: diameter 2.25 in
balls.mass             0.170097 kg     WPA: 5.5 to 6 oz; 6 oz
carom ball             0.03075 m,      UMB: 61 to 61.5 mm across, 205 to 220 g
                       0.21 kg
snooker ball           0.02625 m,      WPBSA: 52.5 mm across, sets of equal mass; 140 g is usual
                       0.14 kg
snooker physics        mu_slide 0.212, Mathavan, Jackson and Parkin (2010)
                       mu_cushion 0.14
                       e(v)            0.995, falling by 0.1 s/m above 2 m/s: a fit of their figure 7a, see
                                       docs/validation.md; not below 0.6, the least of Alciatore (2004)
                       mu_ball 0.05,   Mathavan, Jackson and Parkin (2014)
                       e_ball 0.89,
                       spin_decay 22
                       mu_roll 0.0127  Mathavan, Jackson and Parkin (2009): a rolling ball loses 0.124 to 0.126 m/s^2
cue.mass               0.538 kg        Alciatore (2008), TP A.30: 19 oz
cue.tip_restitution    0.73            Alciatore (2008), TP A.30: 0.71 to 0.75 for leather, 0.81 to 0.87 for phenolic
cue.end_mass           0.0084 kg       Alciatore (2007), TP A.31: 1/20.2 of a ball for an ordinary cue
cue.miscue_offset      0.5             Alciatore (2006), TP 2.1: 0.50 to 0.55 with chalk
snooker cue            0.478 kg        the simulator pooltool 0.6
UK object ball         0.0254 m,       WEPF: 2 in across, 116 g
                       0.116 kg
UK cue ball            0.0238125 m,    WEPF: 1 7/8 in across, 94 g
                       0.094 kg
=====================  ==============  ===========================================================================
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.scene.outline import extents
from billiards_env.scene.table import INCH, POOL_RADIUS, Table, six_pockets
from billiards_env.support.checks import (
    RANGES,
    Range,
    add_entry,
    check_fields,
    check_version,
    entry_of,
    fields_of,
    fits,
    flag,
    integer,
    numbers,
    one_of,
    real,
    result_of,
    sequence,
    short,
)

MOTION_NAMES = ("ideal", "rolling", "sliding")
CUSHION_NAMES = {
    "restitution": False,
    "han2005": True,
    "stronge": True,
    "mathavan2010": True,
    "han2005_variable": True,
}
"""The names of the cushions, and whether their friction acts on spin."""
BALL_BALL_NAMES = {"frictionless": False, "frictional": True}
"""The same for the laws of two balls."""
_WITH_FRICTION = tuple(name for name, rubs in CUSHION_NAMES.items() if rubs)
COLOURS = ("pool", "snooker", "uk")
SHAPES = ("disk", "sphere")

MARLOW = 9.951e-3, 0.108, 1.088
"""The friction between balls a + b exp(-c v) at the sliding speed v in m/s: Alciatore (2019), TP A.14, a fit of Marlow
(1995), Table 10."""

VERSION = 1
"""The version of the data of `Scene.to_dict`, and the only one that `Scene.from_dict` reads."""

CONTACT_GAP = 1e-12
"""m. Two surfaces touch if their distance is at most this. Placed balls may overlap each other, cushions and pockets by
at most this, so every end of a shot is a start. The value is far above the rounding of a coordinate (2e-16 m) and far
below any length that can be measured on a table."""

# m and kg; the sources are in the table above.
_POOL_MASS = 0.170097
_CAROM_RADIUS, _CAROM_MASS = 0.03075, 0.21
_SNOOKER_RADIUS, _SNOOKER_MASS = 0.0525 / 2, 0.14
_UK_RADIUS, _UK_MASS = 2 * INCH / 2, 0.116
_UK_CUE_RADIUS, _UK_CUE_MASS = 1.875 * INCH / 2, 0.094
_INFINITE = Range(math.inf, math.inf)


@dataclasses.dataclass(frozen=True, slots=True)
class Balls:
    """The balls; ball 0 is the cue ball.

    Attributes:
        radius: Radius of each ball, m.
        mass: Mass of each ball, kg. A ball of mass `math.inf` is a fixed obstacle.
        colours: The colours in pictures: "pool" (numbered balls; on a table without pockets up to three balls are
            white, red and yellow), "snooker" (the last six object balls are yellow, green, brown, blue, pink and black,
            the others red) or "uk" (seven red balls, the black ball, seven yellow balls).
        shape: "disk" (balls touch when their centres are R1 + R2 apart) or "sphere" (their centres are at different
            heights: they touch at a horizontal distance of 2 sqrt(R1 R2), and the normal is inclined). Both shapes are
            the same for balls of equal radius.
    """

    radius: tuple[float, ...]
    mass: tuple[float, ...]
    colours: str = "pool"
    shape: str = "disk"

    def __post_init__(self) -> None:
        one_of("balls.colours", self.colours, COLOURS)
        one_of("balls.shape", self.shape, SHAPES)
        for name, within in (("radius", "length"), ("mass", "mass")):
            values = getattr(self, name)
            if not isinstance(values, tuple):
                raise TypeError(f"balls.{name} = {short(values)}: expected a tuple of numbers")
            checked = (
                math.inf if name == "mass" and fits(value, _INFINITE) else real(f"balls.{name}[{i}]", value, within)
                for i, value in enumerate(values)
            )
            object.__setattr__(self, name, tuple(checked))
        if not self.radius:
            raise ValueError("balls.radius = (): expected at least one ball, the cue ball")
        integer("number of balls", len(self.radius), "balls")
        if len(self.radius) != len(self.mass):
            raise ValueError(
                f"balls.mass has {len(self.mass)} values and balls.radius has {len(self.radius)}: "
                "expected one value per ball in both"
            )
        if math.isinf(self.mass[0]):
            raise ValueError("balls.mass[0] = inf: expected a finite mass, the cue ball must be able to move")

    @classmethod
    def uniform(cls, n_balls: int, radius: float = POOL_RADIUS, mass: float = _POOL_MASS) -> Balls:
        """Returns `n_balls` equal balls of `radius` metres and `mass` kilograms."""
        n_balls = integer("n_balls", n_balls, "balls")
        return cls((radius,) * n_balls, (mass,) * n_balls)

    def __len__(self) -> int:
        return len(self.radius)

    def contact_distances(self, i: int | NDArray[Any], j: slice | NDArray[Any] = slice(None)) -> NDArray[np.float64]:
        """Returns the horizontal distance of the centres of balls i and j that touch, m; j is all balls by default.

        Example:
            >>> Balls((0.01, 0.04), (0.1, 0.1), shape="sphere").contact_distances(0).tolist()
            [0.02, 0.04]
        """
        radius = np.array(self.radius)
        return radius[i] + radius[j] if self.shape == "disk" else 2.0 * np.sqrt(radius[i] * radius[j])


class Parameter(NamedTuple):
    """The properties of a number of `Physics` besides its default value.

    Attributes:
        within: Its range, a key of `checks.RANGES`, which also has the unit.
        law: The law that reads it under its own name: "cloth", "balls", "cushion" or "flight"; "" if the laws read only
            what `law_numbers` makes of it.
        source: Where the default comes from; "" for 0 and 1.
        fitted: Whether `calibrate` fits it by default. Tracks rarely determine the numbers that it leaves out.
        only: The names of the motions, cushions or laws of two balls that read it, or "flight"; empty if all read it.
    """

    within: str
    law: str
    source: str = ""
    fitted: bool = True
    only: tuple[str, ...] = ()

    def has_effect(self, physics: Physics) -> bool:
        """Returns whether one of the laws of a `Physics` reads it."""
        flight = "flight" if physics.flight else ""
        return not self.only or not {physics.motion, physics.cushion, physics.ball_ball, flight}.isdisjoint(self.only)


def _number(
    default: float | None, within: str, law: str, source: str = "", fitted: bool = True, only: tuple[str, ...] = ()
) -> Any:
    """Returns the field of a number of `Physics`. All code takes these numbers from `PARAMETERS`."""
    return dataclasses.field(default=default, metadata={"parameter": Parameter(within, law, source, fitted, only)})


@dataclasses.dataclass(frozen=True, slots=True)
class Physics:
    """The laws of motion and collision, with their constants.

    Attributes:
        motion: "sliding" (a ball slides until it rolls, then rolls to rest), "rolling" (rolling resistance only) or
            "ideal" (constant velocity).
        cushion: "restitution" (the normal velocity is reversed and multiplied by the restitution), "han2005" (Han 2005,
            with friction and spin), "stronge" (Stronge 2000, with friction, spin and a compliant cushion),
            "mathavan2010" (Mathavan, Jackson and Parkin 2010, with friction at the cushion and at the cloth) or
            "han2005_variable" ("han2005" with a friction and a restitution that depend on the motion).
            All but "restitution" need `motion="sliding"`.
        ball_ball: "frictionless" or "frictional" (impacts of balls with friction, which throws balls and transfers
            spin; needs `motion="sliding"`).
        flight: Whether balls leave the cloth, see `physics.laws.flight`. It needs `motion="sliding"` and finite masses.
            Balls of different size must be spheres.
        g: Gravity, m/s^2.
        mu_slide: Coefficient of sliding friction between ball and cloth.
        mu_roll: Coefficient of rolling resistance between ball and cloth.
        spin_decay: Deceleration of the spin about the vertical axis, rad/s^2.
        e_ball: Restitution of a ball-ball collision, 0 to 1.
        e_cushion: Restitution of a ball-cushion collision, 0 to 1.
        mu_cushion: Coefficient of friction between ball and cushion; "restitution" cushions do not use it.
        mu_ball: Coefficient of friction between balls; None for `MARLOW`, which depends on the sliding speed.
        mu_ball_factor: Multiplier of the friction between balls: about 1.5 for dirty balls, 2.5 for balls that cling.
        mu_ball_decay: How fast the friction between balls falls with the sliding speed, s/m, if `mu_ball` is None.
        cushion_frequency_ratio: Ratio of the tangential to the normal frequency of "stronge" cushions, 1 to 2.
        e_cushion_loss: Loss of the cushions' restitution per speed above `e_cushion_onset`, s/m. The restitution at the
            normal speed v is max(e_cushion_floor, e_cushion - e_cushion_loss * max(0, v - e_cushion_onset)).
        e_cushion_onset: Normal speed above which the cushions' restitution falls, m/s.
        e_cushion_floor: Least restitution of the cushions.
        e_cushion_topspin: Gain of the restitution of "han2005_variable" cushions from a ball without topspin to a ball
            that rolls.
        e_cushion_tangent: Share of the slip along the cushion that "han2005_variable" cushions reverse if their
            friction is large enough, 0 to 1.
        e_cushion_slip: Gain of the restitution of "han2005_variable" cushions from a ball without slip at the nose to a
            ball that moves along the cushion.
        mu_roll_speed: Gain of the rolling resistance per speed, s/m, see `physics.laws.cloth`; 0.003 in "match_carom".
            None for a resistance that does not depend on the speed.
        e_slate: Restitution of a ball that lands on the slate.
        mu_slate: Coefficient of friction between a ball that lands and the cloth; None for `mu_slide`.
        least_hop: Height of the lowest hop of a ball that bounces, m. A ball that would hop lower stays on the cloth.
        max_time: Time limit of a shot, s; None for no limit. "ideal" motion needs a limit.
    """

    motion: str = "sliding"
    cushion: str = "han2005"
    ball_ball: str = "frictionless"
    g: float = _number(9.81, "g", "", "standard gravity, rounded", fitted=False)
    mu_slide: float = _number(
        0.2,
        "friction",
        "",
        "Marlow (1995), The Physics of Pocket Billiards; Alciatore (2004): 0.15 to 0.4",
        only=("sliding",),
    )
    mu_roll: float = _number(
        0.01, "friction", "", "Marlow (1995); Alciatore (2004): 0.005 to 0.015", only=("rolling", "sliding")
    )
    spin_decay: float = _number(
        10.0,
        "spin_decay",
        "cloth",
        "Alciatore (2004), The Illustrated Principles of Pool and Billiards: 5 to 15",
        only=("sliding",),
    )
    e_ball: float = _number(0.95, "restitution", "balls", "Marlow (1995); Alciatore (2004): 0.92 to 0.98")
    e_cushion: float = _number(0.85, "restitution", "cushion", "Han (2005); Alciatore (2004): 0.6 to 0.9")
    mu_cushion: float = _number(0.2, "mu_cushion", "cushion", "Han (2005): 0.14 to 0.2", only=_WITH_FRICTION)
    mu_ball: float | None = _number(
        None,
        "mu_ball",
        "",
        "Alciatore (2019), TP A.14: a fit of Marlow (1995), Table 10",
        fitted=False,
        only=("frictional",),
    )
    mu_ball_factor: float = _number(1.0, "mu_ball", "", only=("frictional",))
    mu_ball_decay: float = _number(MARLOW[2], "speed_loss", "", "as `mu_ball`", only=("frictional",))
    cushion_frequency_ratio: float = _number(
        1.8,
        "frequency_ratio",
        "cushion",
        "the default of the simulator pooltool 0.6",
        fitted=False,
        only=("stronge",),
    )
    e_cushion_loss: float = _number(0.0, "speed_loss", "cushion")
    e_cushion_onset: float = _number(0.0, "onset", "cushion", fitted=False)
    e_cushion_floor: float = _number(0.0, "restitution", "cushion", fitted=False)
    e_cushion_topspin: float = _number(0.0, "restitution", "cushion", only=("han2005_variable",))
    e_cushion_tangent: float = _number(0.0, "restitution", "cushion", only=("han2005_variable",))
    e_cushion_slip: float = _number(0.0, "restitution", "cushion", only=("han2005_variable",))
    mu_roll_speed: float | None = _number(None, "speed_loss", "", only=("rolling", "sliding"))
    flight: bool = False
    e_slate: float = _number(
        0.6, "restitution", "flight", "Alciatore, TP B.10; his range is 0.5 to 0.7", fitted=False, only=("flight",)
    )
    mu_slate: float | None = _number(None, "friction", "", "`mu_slide`, as in TP B.10", fitted=False, only=("flight",))
    least_hop: float = _number(
        1e-4, "least_hop", "flight", "far less than can be seen on a table", fitted=False, only=("flight",)
    )
    max_time: float | None = None

    def __post_init__(self) -> None:
        one_of("physics.motion", self.motion, MOTION_NAMES)
        one_of("physics.cushion", self.cushion, tuple(CUSHION_NAMES))
        one_of("physics.ball_ball", self.ball_ball, tuple(BALL_BALL_NAMES))
        optional = "mu_ball", "mu_roll_speed", "mu_slate"
        flag("physics.flight", self.flight)
        if self.flight and self.motion != "sliding":
            raise ValueError(
                f"physics.flight = True with physics.motion = {self.motion!r}: expected motion 'sliding', a ball that "
                "lands has spin"
            )
        if self.flight and self.e_slate == 1.0 and self.max_time is None:
            raise ValueError("physics.e_slate = 1.0 without a max_time: expected less, the ball would hop without end")
        names = (name for name in PARAMETERS if getattr(self, name) is not None or name not in optional)
        check_fields(self, "physics", **{name: PARAMETERS[name].within for name in names})
        if self.max_time is not None:
            check_fields(self, "physics", max_time="max_time")
        if self.motion == "ideal" and self.max_time is None:
            raise ValueError("physics.max_time = None: expected a number of seconds, ideal motion never ends")
        for name, rubs in (("cushion", CUSHION_NAMES), ("ball_ball", BALL_BALL_NAMES)):
            law = getattr(self, name)
            if rubs[law] and self.motion != "sliding":
                smooth = " or ".join(repr(other) for other in rubs if not rubs[other])
                raise ValueError(
                    f"physics.{name} = {law!r} with physics.motion = {self.motion!r}: "
                    f"expected motion 'sliding' (its friction acts on spin) or {name} {smooth}"
                )
        if self.e_cushion_floor > self.e_cushion:
            raise ValueError(
                f"physics.e_cushion_floor = {self.e_cushion_floor!r}: expected at most e_cushion = {self.e_cushion!r}"
            )
        if self.cushion == "stronge":
            name = "e_cushion_floor" if self.e_cushion_loss else "e_cushion"
            least = (math.sqrt(1.0 + 8.0 / self.cushion_frequency_ratio**2) - 1.0) / 2.0
            if getattr(self, name) < least:
                raise ValueError(
                    f"physics.{name} = {getattr(self, name)!r} with physics.cushion = 'stronge': expected at least "
                    f"{least:.4g} for cushion_frequency_ratio {self.cushion_frequency_ratio!r}, so that friction adds "
                    "no energy"
                )


PARAMETERS: dict[str, Parameter] = {
    field.name: field.metadata["parameter"] for field in dataclasses.fields(Physics) if field.metadata
}
"""The numbers of `Physics` except `max_time`. The numbers that kernels read, the inputs of the derivatives, what may
vary from shot to shot and what may be fitted come from this table."""


def law_numbers(physics: Any, cushion_height: float) -> dict[str, Any]:
    """Returns the numbers that the laws read, by name, from the fields of a `Physics` and the height of the noses, m.

    It uses only sums and products, so the derivatives evaluate it with complex numbers.
    """
    mu_limit, mu_drop, mu_rate = ball_friction(physics)
    same = {name: getattr(physics, name) for name, parameter in PARAMETERS.items() if parameter.law}
    return same | {
        "slide": physics.mu_slide * physics.g,
        "roll": physics.mu_roll * physics.g,
        "roll_gain": -1.0 if physics.mu_roll_speed is None else physics.mu_roll_speed * physics.g,
        "mu_limit": mu_limit,
        "mu_drop": mu_drop,
        "mu_rate": mu_rate,
        "mu_cloth": physics.mu_slide,
        "cushion_height": cushion_height,
        "g": physics.g,
        "mu_slate": physics.mu_slide if physics.mu_slate is None else physics.mu_slate,
    }


def law_names(law: str, *derived: str) -> tuple[str, ...]:
    """Returns the names of the numbers that a law reads; `derived` are those that only `law_numbers` has."""
    return (*derived, *(name for name, parameter in PARAMETERS.items() if parameter.law == law))


def check_ranges(physics: Physics, ranges: Mapping[str, tuple[float, float]]) -> None:
    """Checks that numbers of a `Physics` may have all values in ranges (low, high).

    Its rules are monotonic in each number, so the ends of the ranges decide.

    Raises:
        ValueError: As `Physics` does, for the first combination of ends that it rejects.
    """
    for ends in itertools.product(*ranges.values()):
        dataclasses.replace(physics, **dict(zip(ranges, ends, strict=True)))


@dataclasses.dataclass(frozen=True, slots=True)
class Cue:
    """The cue.

    Attributes:
        mass: Mass, kg.
        tip_restitution: Restitution of the tip on the ball in a central impact, 0 to 1.
        end_mass: Mass of the end of the shaft that moves sideways with the ball, kg. It pushes the ball away from the
            side on which the tip hits it (squirt).
        miscue_offset: Distance of the tip from the ball's centre above which the tip slips, in ball radii.
    """

    mass: float = 0.538
    tip_restitution: float = 0.73
    end_mass: float = 0.0084
    miscue_offset: float = 0.5

    def __post_init__(self) -> None:
        check_fields(self, "cue", mass="mass", end_mass="mass", tip_restitution="restitution")
        check_fields(self, "cue", miscue_offset="miscue_offset")


def ball_friction(physics: Physics) -> tuple[float, float, float]:
    """Returns (a, b, c) of the coefficient of friction a + b exp(-c v) between balls that slide at v m/s."""
    a, b = MARLOW[:2] if physics.mu_ball is None else (physics.mu_ball, 0.0)
    return physics.mu_ball_factor * a, physics.mu_ball_factor * b, physics.mu_ball_decay


@dataclasses.dataclass(frozen=True, slots=True)
class Scene:
    """Balls, a table, physics and a cue; the module's docstring lists the defaults.

    Attributes:
        balls: The balls.
        table: The table.
        physics: The laws and their constants.
        cue: The cue.
    """

    balls: Balls
    table: Table = Table()
    physics: Physics = Physics()
    cue: Cue = Cue()

    def __post_init__(self) -> None:
        if isinstance(self.balls, str):
            raise TypeError(f"scene.balls = {short(self.balls)}: expected a Balls; Scene.named(name) returns one")
        for name, kind in (("balls", Balls), ("table", Table), ("physics", Physics), ("cue", Cue)):
            if not isinstance(getattr(self, name), kind):
                raise TypeError(f"scene.{name} = {short(getattr(self, name))}: expected a {kind.__name__}")
        radius = max(self.balls.radius)
        widest = 2 * radius
        if widest > min(self.table.length, self.table.width) or _room(self.table, radius) is None:
            raise ValueError(
                f"scene.table of {self.table.length} x {self.table.width} m: expected room for a ball {widest} m across"
            )
        # The tip leaves the ball only if the energy that the impact loses is less than the energy of the approach.
        ratio, spin = self.balls.mass[0] / self.cue.mass, 2.5 * self.cue.miscue_offset**2
        least = math.sqrt(spin / (1.0 + ratio + spin))
        if self.cue.tip_restitution < least:
            raise ValueError(
                f"cue.tip_restitution = {self.cue.tip_restitution!r}: expected at least {least:.4g}, so that the tip "
                f"leaves the ball at the miscue_offset {self.cue.miscue_offset!r}"
            )
        if CUSHION_NAMES[self.physics.cushion]:
            for i, radius in enumerate(self.balls.radius):
                if not 0 < self.table.cushion_height < 2 * radius:
                    raise ValueError(
                        f"scene.table.cushion_height = {self.table.cushion_height!r}: expected less than the diameter "
                        f"of ball {i} ({2 * radius} m), {self.physics.cushion!r} cushions must hit a ball below its top"
                    )
        if self.physics.flight:
            self._check_flight()

    def _check_flight(self) -> None:
        """Raises a ValueError if balls cannot leave the cloth in this scene."""
        balls, table = self.balls, self.table
        if math.inf in balls.mass:
            raise ValueError("physics.flight = True with a ball of infinite mass: expected finite masses")
        if balls.shape == "disk" and len(set(balls.radius)) > 1:
            raise ValueError("balls.shape = 'disk' with physics.flight = True and several radii: expected 'sphere'")
        smallest = 2 * min(balls.radius)
        if not 0 < table.cushion_height < smallest:
            raise ValueError(
                f"scene.table.cushion_height = {table.cushion_height!r} with physics.flight = True: expected less than "
                f"the diameter of the smallest ball ({smallest} m)"
            )

    def __repr__(self) -> str:
        table, physics = self.table, self.physics
        used = [name for name in ("mu_slide", "mu_roll") if physics.motion in PARAMETERS[name].only]
        constants = (*used, "e_ball", "e_cushion", *(() if physics.max_time is None else ("max_time",)))
        return (
            f"Scene: table {table.length:g} x {table.width:g} m, {len(table.pockets)} pockets\n"
            f"  balls: {self.n_balls}, radius {_range(self.balls.radius)} m, mass {_range(self.balls.mass)} kg\n"
            f"  physics: {physics.motion} motion, {physics.cushion} cushions, "
            + ("" if physics.ball_ball == next(iter(BALL_BALL_NAMES)) else f"{physics.ball_ball} balls, ")
            + ("flight, " if physics.flight else "")
            + ", ".join(f"{name} {getattr(physics, name):g}" for name in constants)
        )

    @property
    def n_balls(self) -> int:
        """Number of balls, including the cue ball."""
        return len(self.balls)

    @property
    def half_extents(self) -> tuple[float, float]:
        """Bounds of abs(x) and abs(y) of the centre of a ball in play, m: the scale of observations.

        For a rectangle these are half its length and half its width. In the jaws of a pocket a ball can lie outside the
        playing surface, so for an outline they are the largest values that the smallest ball can have, increased by a
        millionth.
        """
        if not self.table.outline:
            return self.table.length / 2, self.table.width / 2
        room = _room(self.table, min(self.balls.radius))
        assert room is not None  # a larger ball has room
        return room[0] * (1 + 1e-6), room[1] * (1 + 1e-6)

    @classmethod
    def named(cls, name: str, n_object_balls: int | None = None) -> Scene:
        """Returns the scene of a given name.

        Args:
            name: A name in `billiards_env.scene.NAMED`, which describes the scenes.
            n_object_balls: Number of object balls; None for the usual number of the scene.

        Returns:
            The scene.

        Raises:
            ValueError: If the name is unknown or the scene does not allow this number of balls.

        Example:
            >>> scene = Scene.named("pool", n_object_balls=15)
            >>> scene.n_balls, len(scene.table.pockets), scene.physics.motion
            (16, 6, 'sliding')
        """
        entry = entry_of("scene", name, NAMED)
        n = entry.usual if n_object_balls is None else n_object_balls
        balls = integer("n_object_balls", n, Range(0, entry.most, f"for scene {name!r}")) + 1
        scene = result_of(f"scene {name!r}", Scene, entry.build, balls)
        if scene.n_balls != balls:
            raise ValueError(f"n_balls of scene {name!r} = {scene.n_balls}: expected {balls}")
        return scene

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Scene:
        """Builds a scene from plain data, as read from YAML or JSON.

        Args:
            data: A mapping with the fields of `Scene` as keys. Its values are mappings with the fields of `Balls`,
                `Table`, `Physics` and `Cue`. An infinite mass may be written "inf". The table may be a name of
                `Table.named`. With the key "base" the mapping lists changes to a named scene, and "n_object_balls" is
                its number of object balls. Without a base, a field that is left out has its default; if the mapping has
                all four fields of `Scene`, no field may be left out. "version" is the version of this form; without it,
                the data have the version `VERSION`.

        Returns:
            The scene; `Scene.from_dict(scene.to_dict()) == scene`.

        Raises:
            ValueError: If a key is unknown or missing, or a value is outside its range.
            TypeError: If a value has the wrong type.

        Example:
            >>> Scene.from_dict({"balls": {"radius": [0.03, 0.03], "mass": [0.2, "inf"]}}).balls.mass
            (0.2, inf)
            >>> Scene.from_dict({"base": "real_pool", "physics": {"mu_roll": 0.012}}).physics.ball_ball
            'frictional'
        """
        if isinstance(data, Mapping) and "base" in data:
            data = _changed_base(data)
        if isinstance(data, Mapping) and "version" in data:
            check_version("scene.version", data["version"], VERSION)
            data = {key: value for key, value in data.items() if key != "version"}
        fields = fields_of(Scene, "scene", data)
        complete = len(fields) == len(dataclasses.fields(Scene))

        def parts(kind: type, name: str) -> dict[str, Any]:
            return fields_of(kind, f"scene.{name}", fields[name], complete=complete)

        if "table" in fields:
            table = fields["table"]
            fields["table"] = (
                Table.named(table) if isinstance(table, str) else Table.from_dict(parts(Table, "table"), "scene.table")
            )
        balls = parts(Balls, "balls")
        for name in ("radius", "mass"):
            balls[name] = tuple(math.inf if v == "inf" else v for v in sequence(f"scene.balls.{name}", balls[name]))
        fields["balls"] = Balls(**balls)
        for name, kind in (("physics", Physics), ("cue", Cue)):
            if name in fields:
                fields[name] = kind(**parts(kind, name))
        return cls(**fields)

    def to_dict(self) -> dict[str, Any]:
        """Returns the scene as plain data for JSON or YAML: dicts, lists, strings and finite numbers.

        Example:
            >>> Scene.named("ideal").to_dict()["physics"]["motion"]
            'ideal'
        """
        data = dataclasses.asdict(self)
        for name in ("pockets", "outline"):
            data["table"][name] = list(data["table"][name])
        for name in ("radius", "mass"):
            data["balls"][name] = ["inf" if math.isinf(v) else v for v in data["balls"][name]]
        return {"version": VERSION, **data}


def _changed_base(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the data of the named scene `changes["base"]`, with the other changes; see `Scene.from_dict`."""
    data = Scene.named(changes["base"], changes.get("n_object_balls")).to_dict()
    for key, value in changes.items():
        if key in ("base", "n_object_balls"):
            continue
        one_of("key of scene", key, tuple(data))
        both = isinstance(value, Mapping) and isinstance(data[key], Mapping)
        data[key] = {**data[key], **value} if both else value
    return data


def _room(table: Table, radius: float) -> tuple[float, float] | None:
    """Returns the largest abs(x) and abs(y), m, of the centre of a ball in play; None if there is no room for it."""
    if not table.outline:
        return table.length / 2 - radius, table.width / 2 - radius
    return extents(table.outline, tuple(pocket.circle for pocket in table.pockets), radius)


def _range(values: tuple[float, ...]) -> str:
    least, most = min(values), max(values)
    return f"{least:g}" if least == most else f"{least:g} to {most:g}"


def _pool(n_balls: int) -> Scene:
    return Scene(Balls.uniform(n_balls), Table(pockets=six_pockets()))


def _blocked_pool(n_balls: int) -> Scene:
    scene = _pool(n_balls)
    mass = tuple(math.inf if i == 2 else m for i, m in enumerate(scene.balls.mass))
    return dataclasses.replace(scene, balls=Balls(scene.balls.radius, mass))


def _carom(n_balls: int) -> Scene:
    return Scene(Balls.uniform(n_balls, _CAROM_RADIUS, _CAROM_MASS), Table.named("carom_10ft"))


def _ideal(n_balls: int) -> Scene:
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=10.0)
    return Scene(Balls.uniform(n_balls), Table(), physics)


# The physics of the scenes with the cushions of real tables
_REAL = Physics(ball_ball="frictional", cushion="stronge")


def _real_pool(n_balls: int) -> Scene:
    return Scene(Balls.uniform(n_balls), Table.named("pool_9ft"), _REAL)


def _real_carom(n_balls: int) -> Scene:
    return dataclasses.replace(_carom(n_balls), physics=_REAL)


def _match_carom(n_balls: int) -> Scene:
    """Returns the scene fitted to 90 shots of three-cushion billiards on a match table, see docs/validation.md.

    The tracks (50 Hz) come from the repository of the simulator tailuge/billiards. The constants are within the 95%
    intervals of a later fit: mu_slide 0.178 to 0.208, mu_roll 0.0027 to 0.0042, mu_roll_speed 0.0019 to 0.0038 s/m,
    spin_decay 1.9 to 3.0 rad/s^2, e_ball 0.937 to 0.974, mu_ball_factor 1.09 to 1.30, mu_ball_decay 0.11 to 0.30 s/m,
    e_cushion 0.825 to 0.904, e_cushion_loss 0.001 to 0.031 s/m, e_cushion_topspin 0.001 to 0.058, e_cushion_tangent
    0.096 to 0.142 and mu_cushion 0.2296 to 0.2368. The command is `python -m benchmarks.real_tracks` with `--scene
    match_carom`. The fitted table is larger, by as much as the cushions yield.
    """
    physics = Physics(
        ball_ball="frictional",
        cushion="han2005_variable",
        mu_slide=0.192,
        mu_roll=0.0035,
        mu_roll_speed=0.003,
        spin_decay=2.7,
        e_ball=0.957,
        mu_ball_factor=1.2,
        mu_ball_decay=0.25,
        e_cushion=0.851,
        e_cushion_loss=0.013,
        e_cushion_topspin=0.042,
        e_cushion_tangent=0.12,
        mu_cushion=0.23,
    )
    return dataclasses.replace(_carom(n_balls), physics=physics)


def _snooker(n_balls: int) -> Scene:
    balls = Balls.uniform(n_balls, _SNOOKER_RADIUS, _SNOOKER_MASS)
    physics = Physics(
        ball_ball="frictional",
        mu_ball=0.05,
        e_ball=0.89,
        mu_roll=0.0127,
        cushion="mathavan2010",
        mu_cushion=0.14,
        e_cushion=0.995,
        e_cushion_loss=0.1,
        e_cushion_onset=2.0,
        e_cushion_floor=0.6,
        mu_slide=0.212,
        spin_decay=22.0,
    )
    return Scene(dataclasses.replace(balls, colours="snooker"), Table.named("snooker_12ft"), physics, Cue(mass=0.478))


def _uk_pool(n_balls: int) -> Scene:
    radius = (_UK_CUE_RADIUS, *(_UK_RADIUS,) * (n_balls - 1))
    mass = (_UK_CUE_MASS, *(_UK_MASS,) * (n_balls - 1))
    return Scene(Balls(radius, mass, "uk", "sphere"), Table.named("uk_7ft"), _REAL)


def _sum_to_three(n_balls: int) -> Scene:
    # pooltool's game of that name, as LightZero plays it (Niu et al. 2023; zoo/pooltool).
    spin_decay = 5 * (4 / 90 * 10 * _CAROM_RADIUS) * 9.81 / (2 * _CAROM_RADIUS)  # its coefficient is 4/9 of a radius
    physics = Physics(e_ball=1.0, mu_slide=0.5, mu_cushion=0.5, spin_decay=spin_decay)
    return Scene(Balls.uniform(n_balls, 0.03048, 0.21), Table(1.22, 0.61, 0.036576), physics)


def _jump_pool(n_balls: int) -> Scene:
    return dataclasses.replace(_pool(n_balls), physics=Physics(ball_ball="frictional", flight=True))


class NamedScene(NamedTuple):
    """A scene with a name.

    Attributes:
        build: Returns the scene from its number of balls, with the cue ball.
        usual: The default number of object balls.
        most: The largest number of object balls.
        summary: What the scene is, for the documentation.
    """

    build: Callable[[int], Scene]
    usual: int
    most: int
    summary: str = ""


NAMED: dict[str, NamedScene] = {
    "pool": NamedScene(_pool, 1, 15, "9-foot table, six pockets, 2.25 in balls"),
    "blocked_pool": NamedScene(_blocked_pool, 2, 15, "the same table; ball 2 is a fixed post and cannot be potted"),
    "carom": NamedScene(_carom, 2, 15, "2.84 x 1.42 m without pockets, 61.5 mm balls"),
    "ideal": NamedScene(_ideal, 1, 500, "the pool table without pockets and losses; a shot ends after 10 s"),
    "sum_to_three": NamedScene(_sum_to_three, 1, 15, "1.22 x 0.61 m, with the balls and friction of pooltool's game"),
    "real_pool": NamedScene(_real_pool, 1, 15, '9-foot table with the jaws of real pockets, table `"pool_9ft"`'),
    "real_carom": NamedScene(_real_carom, 2, 15, 'carom on the table `"carom_10ft"`'),
    "match_carom": NamedScene(_match_carom, 2, 15, "carom fitted to tracks of a match table"),
    "snooker": NamedScene(_snooker, 21, 21, "12-foot table, 52.5 mm balls: red, then yellow to black"),
    "uk_pool": NamedScene(_uk_pool, 15, 15, "7-foot table, 2 in balls (7 red, 1 black, 7 yellow), a smaller cue ball"),
    "jump_pool": NamedScene(
        _jump_pool, 1, 15, 'as `"pool"`, with friction between the balls and [flights](physics.md#flights)'
    ),
}
"""The named scenes by name, in the order of the documentation."""

SCENES = tuple(NAMED)


def register_scene(name: str, scene: NamedScene) -> None:
    """Adds a scene of another package to those of `Scene.named`. The errors are those of `checks.add_entry`."""
    balls = Range(0, RANGES["balls"].most)
    add_entry("scene", name, scene, NAMED, NamedScene, {"usual": balls, "most": balls}, build=1)


def check_scene(scene: Scene) -> None:
    """Raises a TypeError unless `scene` is a Scene."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene = {short(scene)}: expected a Scene, such as Scene.named('pool')")


def check_ends_on_cloth(scene: Scene) -> None:
    """Raises a ValueError if a shot may end in the air: the next one begins with all balls on the cloth."""
    if scene.physics.flight and scene.physics.max_time is not None:
        raise ValueError(
            f"physics.max_time = {scene.physics.max_time!r} with physics.flight = True: expected None in an "
            "environment and in a game, no shot may end in the air"
        )


def _first_overlap(
    balls: Balls, positions: NDArray[np.float64], in_play: NDArray[np.bool_]
) -> tuple[int, int, int, float, float] | None:
    """Returns (shot, ball, ball, distance, distance at contact) of balls in play that overlap; None if there are none.

    It compares only balls that are near each other along the longer side of the layouts, (..., n, 2) m.
    """
    places = positions.reshape(-1, len(balls), 2)
    shots = np.arange(len(places))[:, None]
    along = int(np.ptp(places[..., 1]) > np.ptp(places[..., 0])) if places.size else 0
    x = np.where(in_play.reshape(-1, len(balls)), places[..., along], np.inf)
    order = np.argsort(x, axis=1)
    x, places, overlaps = x[shots, order], places[shots, order], []
    for k in range(1, len(balls)):
        with np.errstate(invalid="ignore"):  # inf - inf, of balls that are not in play
            at, a = np.nonzero(x[:, k:] - x[:, :-k] < 2.0 * max(balls.radius))
        if not len(at):
            break
        i, j = np.sort((order[at, a], order[at, a + k]), axis=0)
        distance, reach = np.hypot(*(places[at, a + k] - places[at, a]).T), balls.contact_distances(i, j)
        bad = distance < reach - CONTACT_GAP
        overlaps += zip(i[bad], at[bad], j[bad], distance[bad], reach[bad], strict=True)
    if not overlaps:
        return None
    i, at, j, distance, reach = min(overlaps)
    return at, i, j, distance, reach


def check_positions(
    scene: Scene, positions: ArrayLike, name: str = "positions", in_play: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Checks the positions of the balls.

    Args:
        scene: The scene.
        positions: (n, 2) centres of the balls in m, or (m, n, 2) for m layouts.
        name: Name used in error messages.
        in_play: (n,) or (m, n) bool; all True by default. Balls that are not in play may be anywhere.

    Returns:
        A float64 copy of the positions.

    Raises:
        ValueError: If a coordinate is not finite, or a ball overlaps a cushion, the circle of a pocket or another
            ball by more than `CONTACT_GAP`.
    """
    array = numbers(name, positions)
    n = scene.n_balls
    if array.ndim not in (2, 3) or array.shape[-2:] != (n, 2):
        raise ValueError(f"{name} has shape {array.shape}: expected ({n}, 2) or (m, {n}, 2), one row per ball")

    in_play = np.ones(array.shape[:-1], np.bool_) if in_play is None else in_play

    def where(index: tuple[np.intp, ...]) -> str:
        shot = f"shot {index[0]}, " if array.ndim == 3 else ""
        return f"{name}: {shot}ball {index[-1]}"

    bad = np.argwhere(~np.isfinite(array).all(axis=-1))
    if len(bad):
        at = tuple(bad[0])
        raise ValueError(f"{where(at)} is at {short(array[at].tolist())}: expected finite coordinates")
    placed = np.where(in_play[..., None], array, 0.0)  # the others may be so far away that distances overflow
    radius = np.array(scene.balls.radius)
    bad = np.argwhere((scene.table.clearance(placed) < radius - CONTACT_GAP) & in_play)
    if len(bad):
        at = tuple(bad[0])
        least = scene.balls.radius[at[-1]]
        expected = f"a place inside the outline, at least {short(least)} m from the cushions"
        if not scene.table.outline:
            x, y = scene.table.length / 2 - least, scene.table.width / 2 - least
            expected = f"|x| <= {short(x)} and |y| <= {short(y)}, inside the cushions"
        raise ValueError(f"{where(at)} is at {short(array[at].tolist())}: expected {expected}")
    for k, pocket in enumerate(scene.table.pockets):
        bad = np.argwhere(pocket.contains(placed, CONTACT_GAP) & in_play)
        if len(bad):
            at = tuple(bad[0])
            raise ValueError(
                f"{where(at)} is at {short(array[at].tolist())}: expected a place outside pocket {k}, {pocket.shape}"
            )
    overlap = _first_overlap(scene.balls, placed, in_play)
    if overlap is not None:
        at, i, j, distance, reach = overlap
        shot = f"shot {at}, " if array.ndim == 3 else ""
        raise ValueError(
            f"{name}: {shot}balls {i} and {j} are {short(distance)} m apart: "
            f"expected at least {short(reach)} m, the distance at which they touch"
        )
    return array
