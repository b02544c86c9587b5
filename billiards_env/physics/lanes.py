"""The columns of the lanes of `physics.derivatives`."""

# Columns of a lane. Those of the second ball follow those of the first.
DX, DY, DVX, DVY, DUX, DUY, DWZ = range(7)
BALL_WIDTH = 7
D_RADIUS = 14  # of both balls
D_INV_MASS = 16
# Numbers of the scene, named as in `Numbers`: those of flights, of impacts of balls, and of cushions. The results of an
# event follow: its time, s, and the place of its ball then, m.
D_NUMBERS = 18
(
    D_SLIDE,
    D_ROLL,
    D_SPIN_DECAY,
    D_E_BALL,
    D_MU_LIMIT,
    D_MU_DROP,
    D_MU_RATE,
    D_E_CUSHION,
    D_E_CUSHION_LOSS,
    D_E_CUSHION_ONSET,
    D_E_CUSHION_FLOOR,
    D_MU_CUSHION,
    D_CUSHION_FREQUENCY_RATIO,
    D_MU_CLOTH,
    D_TIME,
    D_PLACE_X,
    D_PLACE_Y,
    LANE_WIDTH,
) = range(D_NUMBERS, 36)
END_NUMBERS = D_TIME

FLIGHT_NUMBERS = (D_SLIDE, D_E_BALL)
"""The columns of the numbers of a flight: the first and one past the last."""
PAIR_NUMBERS = (D_E_BALL, D_E_CUSHION)
"""The same for an impact of two balls."""
CUSHION_NUMBERS = (D_E_CUSHION, END_NUMBERS)
"""The same for a cushion."""
