"""The data of the compiled functions: a scene as arrays, and the motion of its balls.

A ball's motion is stored as a row of numbers at the ball's own time, which is the time at which its motion last
changed. The row stays the same until the next change: the position at any time between follows from it in closed form.
So rounding errors do not accumulate between changes, and a ball at rest costs nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.jit import allocating, inlined, kernel
from billiards_env.physics.double_double import two_sum

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

# Phases of a ball's motion.
REST, SPINNING, ROLLING, SLIDING, FREE, POTTED = 0, 1, 2, 3, 4, 5

# The laws of `engine.modes.MOTIONS` and `engine.modes.CUSHIONS`.
IDEAL, ROLLING_ONLY, SLIDING_AND_ROLLING = 0, 1, 2
RESTITUTION, HAN2005, STRONGE, MATHAVAN2010 = 0, 1, 2, 3

# Treatments of overlaps in PIT.
FIXES = ("push_apart", "move_back", "none")
PUSH_APART, MOVE_BACK, NO_FIX = 0, 1, 2

# Entries of `SceneArrays.params`.
MOTION, CUSHION = 0, 1  # laws, see above
SLIDE, ROLL = 2, 3  # decelerations mu g, m/s^2
SPIN_DECAY = 4  # rad/s^2
E_BALL, E_CUSHION, MU_CUSHION = 5, 6, 7
HALF_LENGTH, HALF_WIDTH, CUSHION_HEIGHT = 8, 9, 10  # m
DT, FIX = 11, 12  # of PIT: timestep, s, and index into FIXES
TAU, WEAK_SPEED, LONGEST_RUN = 13, 14, 15  # of the contact-time rule: s, m/s and a number of impacts
E_LOSS, E_ONSET, E_FLOOR = 16, 17, 18  # of a restitution that falls with the speed: s/m, m/s and the least value
N_PARAMS = 19

# Entries of `SceneArrays.ball_friction`: the coefficient is limit + drop exp(-rate speed).
MU_LIMIT, MU_DROP, MU_RATE = 0, 1, 2  # the rate in s/m

# Columns of angular velocities.
SPIN_X, SPIN_Y, SPIN_Z = 0, 1, 2  # rad/s

# Columns of `SceneArrays.pockets`.
POCKET_X, POCKET_Y, POCKET_RADIUS = 0, 1, 2  # m

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
        rows: (n, WIDTH) float64, see the columns above.
        phase: (n,) int8.
    """

    rows: Any
    phase: Any


class SceneArrays(NamedTuple):
    """A scene of n balls.

    Attributes:
        params: (N_PARAMS,) float64, see the entries above.
        radius: (n,) float64, m.
        inv_mass: (n,) float64, 1/kg; 0 for a fixed ball.
        pockets: (k, 3) float64, see the columns above.
        outline: The `walls.Outline`; None for a rectangle.
        ball_friction: (3,) float64, see the entries above; None for balls without friction.
        stronge: (1,) float64, the frequency ratio of "stronge" cushions; None for others.
        mathavan: (1,) float64, friction on the cloth with "mathavan2010" cushions; None for others.
        spheres: (n,) float64, the radii of spheres of different size, m; None for disks and for equal balls.

    Numba compiles the code of a feature only for scenes in which its field is not None: a function with the field as an
    argument begins with `if field is None`.
    """

    params: Floats
    radius: Floats
    inv_mass: Floats
    pockets: Floats
    outline: Any = None
    ball_friction: Any = None
    stronge: Any = None
    mathavan: Any = None
    spheres: Any = None


@allocating
def empty_state(n):
    """Returns the `State` of n balls, with undefined content."""
    return State(np.empty((n, WIDTH)), np.empty(n, np.int8))


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
def own_time(state, i):
    """Returns the `Time` of ball i's row."""
    return Time(state.rows[i, T0], state.rows[i, T0_LO])


@inlined
def moves(state, i):
    """Returns whether ball i's centre moves."""
    return state.phase[i] >= ROLLING and state.phase[i] != POTTED
