"""How a shot's state is laid out in arrays.

`state` is (n, WIDTH) float64, a row a ball: position, velocity, acceleration, slip and spin *at the ball's own time*
T0, that is when its motion last changed. Between changes nothing is written: a ball's place at any later instant
follows from its row in closed form, so nothing is rounded twice and a ball at rest costs nothing.

Times are unevaluated sums of two doubles, (hi, lo) with abs(lo) <= ulp(hi)/2 (Dekker 1971): ten seconds into a shot a
single double would only resolve 2e-15 s.
"""

from __future__ import annotations

from billiards_env.physics.double_double import two_sum
from billiards_env.physics.jit import kernel

# Columns of `state`.
X, Y = 0, 1  # m
VX, VY = 2, 3  # m/s
AX, AY = 4, 5  # m/s^2
UX, UY = 6, 7  # slip: velocity of the point that touches the cloth, m/s
WZ = 8  # spin about the vertical axis, rad/s
T0, T0_LO = 9, 10  # s
LASTS = 11  # s from T0 until the motion changes by itself
WIDTH = 12

# Phases of a ball's motion.
REST, SPINNING, ROLLING, SLIDING, FREE, POTTED = 0, 1, 2, 3, 4, 5

# Laws of motion, in the order of scene.MOTIONS, and cushion models, in the order of scene.CUSHIONS.
IDEAL, ROLLING_ONLY, SLIDING_AND_ROLLING = 0, 1, 2
RESTITUTION, HAN2005 = 0, 1

# Entries of `params`, the scene's constants.
MOTION, CUSHION = 0, 1
SLIDE, ROLL = 2, 3  # decelerations mu g, m/s^2
SPIN_DECAY = 4  # rad/s^2
E_BALL, E_CUSHION, MU_CUSHION = 5, 6, 7
HALF_LENGTH, HALF_WIDTH, CUSHION_HEIGHT = 8, 9, 10  # m
DT, FIX = 11, 12  # of PIT: its timestep, s, and what it does about overlaps
CONTACT_TIME, WEAK_SPEED, LONGEST_RUN = 13, 14, 15  # s, m/s and a number, of the contact-time rule
N_PARAMS = 16

# m; scene.CONTACT_GAP, which says why. Repeated, as the cache of compiled kernels notices only edits among the kernels.
CONTACT_GAP = 1e-12

# What PIT does about overlaps.
FIXES = ("push_apart", "move_back", "none")
PUSH_APART, MOVE_BACK, NO_FIX = 0, 1, 2


@kernel
def later(hi: float, lo: float, dt: float) -> tuple[float, float]:
    """The time (hi, lo) + dt."""
    s, e = two_sum(hi, dt)
    return two_sum(s, e + lo)


@kernel
def since(hi: float, lo: float, hi0: float, lo0: float) -> float:
    """(hi, lo) - (hi0, lo0) in s, rounded once."""
    s, e = two_sum(hi, -hi0)
    return s + (e + (lo - lo0))
