"""The data of the compiled functions: a scene as arrays, and the motion of its balls.

A ball's motion is stored as a row of numbers at the ball's own time, which is the time at which its motion last
changed. The row stays the same until the next change: the position at any time between follows from it in closed form.
So rounding errors do not accumulate between changes, and a ball at rest costs nothing.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from billiards_env.jit import allocating, expanded, inlined, kernel
from billiards_env.physics.double_double import two_sum
from billiards_env.scene.scene import law_names

CUE_BALL = 0
"""The number of the cue ball."""

# Columns of `State.rows`.
X, Y = 0, 1  # m; also columns of arrays of vectors
VX, VY = 2, 3  # m/s
AX, AY = 4, 5  # m/s^2
UX, UY = 6, 7  # slip: velocity of the point that touches the cloth, m/s
WZ = 8  # spin about the vertical axis, rad/s
T0, T0_LO = 9, 10  # the ball's own time, s
LASTS = 11  # time from T0 to the end of the phase, s
WIDTH = 12
Z, VZ = 12, 13  # only in space: the height of the centre above its height on the cloth, m; its velocity, m/s
FLIGHT_WIDTH = 14
_MORE = FLIGHT_WIDTH - WIDTH
VELOCITY, SLIP = (VX, VY, VZ), (UX, UY)  # the columns of each axis

# Phases of a ball's motion.
REST, SPINNING, ROLLING, SLIDING, FREE, POTTED, AIRBORNE = 0, 1, 2, 3, 4, 5, 6

# The laws of `engine.compile.MOTIONS`.
IDEAL, ROLLING_ONLY, SLIDING_AND_ROLLING = 0, 1, 2

# Columns of angular velocities.
SPIN_X, SPIN_Y, SPIN_Z = 0, 1, 2  # rad/s

Floats = NDArray[np.float64]


class Time(NamedTuple):
    """A time as an unevaluated sum of two doubles, s, with abs(lo) <= ulp(hi) / 2 (Dekker 1971).

    Ten seconds into a shot a single double resolves only 2e-15 s.
    """

    hi: float
    lo: float


class State(NamedTuple):
    """The motion of n balls.

    Attributes:
        rows: (n, WIDTH) or, in space, (n, FLIGHT_WIDTH) float64, see the columns above.
        phase: (n,) int8.
    """

    rows: Any
    phase: Any


class BallState(NamedTuple):
    """The state of a ball at a time. Its time derivative and its change have the same form.

    Attributes:
        x: Position, m.
        y: The same along y.
        vx: Velocity, m/s.
        vy: The same along y.
        ux: Slip, m/s.
        uy: The same along y.
        wz: Spin about the vertical axis, rad/s.
    """

    x: Any
    y: Any
    vx: Any
    vy: Any
    ux: Any
    uy: Any
    wz: Any


CLOTH_NUMBERS = law_names("cloth", "slide", "roll", "roll_gain")
"""The numbers of the laws of the cloth: the decelerations of a sliding and of a rolling ball, m/s^2, the gain of the
rolling deceleration per speed, 1/s, which is negative if there is none, and others."""
BALL_NUMBERS = law_names("balls", "mu_limit", "mu_drop", "mu_rate")
"""Those of an impact of balls, whose friction is mu_limit + mu_drop exp(-mu_rate speed), and others."""
CUSHION_NUMBERS = law_names("cushion", "mu_cloth", "cushion_height")
"""Those of cushions: the friction of the cloth with "mathavan2010" cushions, the height of the noses, m, and others."""

LAW_NUMBERS = CLOTH_NUMBERS + BALL_NUMBERS + CUSHION_NUMBERS
FLIGHT_NUMBERS = law_names("flight", "g", "mu_slate")
"""The numbers of flights, which have no derivatives: gravity, m/s^2, the friction of a ball that lands, and others."""


class EngineNumbers(NamedTuple):
    """The numbers of a scene and an engine that have no derivative.

    Attributes:
        motion: The law of motion, see above.
        cushion_rubs: 1 if cushions have friction, otherwise 0.
        cushion_work: Work of an impact on a cushion, in the unit of `runner.LOOK_AFTER`.
        half_length: Half the length of the table, m.
        half_width: m.
        tau: Contact time of the contact-time rule, s.
        weak_speed: Largest speed of approach of an impact on which this rule acts, m/s.
        longest_run: Number of impacts at one place and instant after which a ball comes to rest.
        dt: Timestep of PIT, s.
    """

    motion: int
    cushion_rubs: int
    cushion_work: int
    half_length: float
    half_width: float
    tau: float
    weak_speed: float
    longest_run: float
    dt: float


_NUMBERS = LAW_NUMBERS + FLIGHT_NUMBERS
NUMBERS = np.dtype((np.record, [(name, float) for name in _NUMBERS] + list(get_type_hints(EngineNumbers).items())))
"""The type of `Numbers` as a record, which compiled functions pass as one pointer."""

Numbers: Any = namedtuple("Numbers", (*_NUMBERS, *EngineNumbers._fields))
"""The numbers of a scene and an engine: `LAW_NUMBERS` and `FLIGHT_NUMBERS`, which `scene.law_numbers` computes, and
`EngineNumbers`."""


class SceneKernels(NamedTuple):
    """The kernels of a scene: the first argument of the entry points. Numba compiles only these kernels.

    Attributes:
        laws: The `laws.tables.Laws` of impacts.
        walls: The `geometry.walls.Walls` of the table.
        space: The `engine.space.Space` of the balls.
    """

    laws: Any
    walls: Any
    space: Any


class SceneArrays(NamedTuple):
    """A scene of n balls: its numbers, its arrays, and its `SceneKernels`.

    Attributes:
        numbers: The `Numbers`.
        radius: (n,) float64, m.
        inv_mass: (n,) float64, 1/kg; 0 for a fixed ball.
        pockets: (k, 3) float64, a row of `Table.pocket_rows` for each pocket, see `geometry.pockets`.
        outline: The `geometry.walls.Outline`: the cushions.
        noses: The `noses.NosesOfBalls` if balls leave the cloth, otherwise None.
        scatter: The fields of `scatter.Scatter` of all shots; None for cushions without scatter.
        laws, walls, space: The fields of `SceneKernels`.

    Numba compiles the code of a feature only for scenes in which its field is not None: a function with the field as an
    argument begins with `if field is None`.

    The argument `scene` of an entry point has the fields without the kernels, as a plain tuple, which numba unpacks in
    half the time. Its first field is an array of records of `NUMBERS`, one for all shots or one for each shot; see
    `scene_of`.
    """

    numbers: Any
    radius: Floats
    inv_mass: Floats
    pockets: Floats
    outline: Any
    noses: Any = None
    scatter: Any = None
    laws: Any = None
    walls: Any = None
    space: Any = None


@expanded
def scene_of(kernels, scene, k):
    """Returns the `SceneArrays` of shot k from the arguments `kernels` and `scene` of an entry point."""
    return SceneArrays(
        scene[0][min(k, len(scene[0]) - 1)], *scene[1:], *kernels[:]
    )  # numba does not append a NamedTuple


@allocating
def empty_state(n, axes):
    """Returns the `State` of n balls, with undefined content; `axes` is the result of `Space.axes`."""
    return State(np.empty((n, WIDTH + _MORE * (axes - 2))), np.empty(n, np.int8))


@inlined
def axes_of(state):
    """Returns the number of components of a velocity in a `State`, 2 or 3."""
    return 2 + (state.rows.shape[1] - WIDTH) // _MORE


@kernel
def later(time: Time, dt: float) -> Time:
    """Returns `time` + dt."""
    s, e = two_sum(time.hi, dt)
    hi, lo = two_sum(s, e + time.lo)
    return Time(hi, lo)


@kernel
def since(time: Time, start: Time) -> float:
    """Returns `time` - `start`, s, rounded once."""
    s, e = two_sum(time.hi, -start.hi)
    return s + (e + (time.lo - start.lo))


@inlined
def before(a: Time, b: Time) -> bool:
    """Returns whether time a is earlier than time b."""
    return a.hi < b.hi or (a.hi == b.hi and a.lo < b.lo)


@inlined
def same(a: Time, b: Time) -> bool:
    """Returns whether two times are equal."""
    return a.hi == b.hi and a.lo == b.lo


@inlined
def ball_of(row):
    """Returns the `BallState` of a row of `State.rows` at the ball's own time."""
    return BallState(x=row[X], y=row[Y], vx=row[VX], vy=row[VY], ux=row[UX], uy=row[UY], wz=row[WZ])


@inlined
def set_motion(row, ball):  # out: row
    """Writes velocity, slip and spin of a `BallState` to a row of `State.rows`."""
    row[VX], row[VY], row[UX], row[UY], row[WZ] = ball.vx, ball.vy, ball.ux, ball.uy, ball.wz


@inlined
def own_time(state, i):
    """Returns the `Time` of ball i's row."""
    return Time(state.rows[i, T0], state.rows[i, T0_LO])


@inlined
def moves(state, i):
    """Returns whether ball i's centre moves."""
    return state.phase[i] >= ROLLING and state.phase[i] != POTTED
