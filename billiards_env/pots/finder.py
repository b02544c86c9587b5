"""Finds pots by geometry, on many tables in one call: the aims, the speeds, and the cue ball's path after the hit.

A pot is a way to send one object ball into one pocket: directly, or off one cushion (a bank). By default banks are
found only on tables without a direct pot. Shots in which the cue ball meets a cushion before the object ball are not
considered. The path of the cue ball after the hit ignores third balls.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import scene_fields, scene_kernels
from billiards_env.jit import allocating, entry_point, inlined, kernel
from billiards_env.physics.laws.cloth import launch
from billiards_env.physics.state import X, Y, empty_state, scene_of
from billiards_env.pots.banks import bank_pot
from billiards_env.pots.direct import direct_pot
from billiards_env.pots.hits import TableArrays, against_throw, cut_cosine, gain, hit_at, meet_before, play_hit
from billiards_env.pots.paths import FAR as FAR
from billiards_env.pots.paths import follow_path
from billiards_env.pots.rims import cross
from billiards_env.shots.tables import Tables

Floats = NDArray[np.float64]

SPEEDS = np.array([0.0, 0.1, 0.25, 0.5, 1.0])
"""The speeds of a pot, as shares of the way from the least possible speed to the largest."""

# Columns of `Pots.rows`.
GHOST_X, GHOST_Y = 0, 1  # m: the cue ball's centre at the hit
CUT_COS, CUT_SIN = 2, 3  # of the angle between the directions of the balls; the sine is positive to the left
APPROACH, RUN = 4, 5  # m: distances of the cue ball to the hit, and of the object ball to the pocket
MOUTH = 6  # rad: half the angle of the open mouth as seen from the object ball, minus the error of its direction
TOLERANCE = 7  # rad: the largest error of the cue ball's direction that pots the ball, to first order
BALL_GAP = 8  # m: the smallest gap between a moving ball and a third ball on its way; at most `FAR`
LEAST_SPEED = 9  # m/s
WALL = 10  # the cushion of a bank, 0 to 3 for -x, +x, -y, +y; -1 for a direct pot
WIDTH = 11

# Columns of `Pots.shots`.
DX, DY = 0, 1  # direction of the cue ball
SPEED = 2  # m/s; 0 if the pot is not possible at this speed
END_X, END_Y = 3, 4  # m: where the cue ball comes to rest, if it does so before `N_GAPS` cushions
GAPS = 5  # m: least distances of the cue ball from a pocket's rim, before each of its first cushions; < 0 if it drops
N_GAPS = 5
SHOT_WIDTH = GAPS + N_GAPS

_ARRIVAL = 0.3  # m/s; least speed of the object ball at the pocket
_LEAST_ARRIVAL = 0.05  # m/s; the same if `_ARRIVAL` is not possible
_BANK_SPEED, _LEAST_BANK_SPEED = 0.7, 0.4  # speed to find a bank and its least speed, over the largest speed


class Pots(NamedTuple):
    """At most k pots on each of m tables, those with the largest tolerance first.

    Attributes:
        count: (m,) the number of pots; the rows after them are 0.
        ball: (m, k) the object ball.
        pocket: (m, k) the pocket.
        rows: (m, k, WIDTH) float64, see the columns above.
        shots: (m, k, s, SHOT_WIDTH) float64, the pots at the s speeds of `SPEEDS`, see the columns above; 0 at a speed
            that is not possible.
    """

    count: Any
    ball: Any
    pocket: Any
    rows: Any
    shots: Any


class PotShots(NamedTuple):
    """k shots at pots, best first: shots without a scratch come first, then those with a larger tolerance.

    Attributes:
        ball: (k,) the object ball.
        pocket: (k,) the pocket.
        direction: (k, 2) the cue ball's direction.
        speed: (k,) the cue ball's speed, m/s.
        tolerance: (k,) the largest error of the direction that still pots the ball, to first order, radians.
        scratch: (k,) bool, whether the cue ball is expected to enter a pocket before it meets a cushion.
    """

    ball: NDArray[np.intp]
    pocket: NDArray[np.intp]
    direction: Floats
    speed: Floats
    tolerance: Floats
    scratch: NDArray[np.bool_]


def find_pots(
    tables: Tables,
    *,
    most: int | None = None,
    offset: tuple[float, float] = (0.0, 0.0),
    banks: bool | None = False,
    speeds: bool = True,
    direct: bool = True,
) -> Pots:
    """Returns the pots on m tables whose paths have no obstacle.

    By default the pots include banks on tables without a direct pot.

    The ghost ball is the cue ball at the hit, on the line from the middle of the pocket's open mouth through the object
    ball. The tolerance of the cue ball's direction is half the angle of the mouth as seen from the object ball, times
    (distance of the centres at contact) cos(cut) / (distance of the cue ball to the ghost ball), to first order
    (Alciatore, TP 3.4: Margin of error based on distance and cut angle). A speed at which the two balls meet again
    before the pot is left out.

    Args:
        tables: The tables.
        most: The largest number of pots on a table; the easiest are kept. None for the largest number of legal balls
            of a table times the number of pockets, with `banks` five times as many.
        offset: Offset of the tip of a level cue: to the left of the ball's centre and above it, in ball radii. With
            both, the squirt turns the velocity away from the spin, and the ball swerves slightly. The pots ignore
            this swerve.
        banks: True to find banks also on tables with a direct pot, which takes about three times as long. None to find
            no banks.
            A bank that is not possible at any speed can take the place of another pot if there are more than `most`.
        speeds: False to leave out the shots (s is 0), which take most of the time. Then a pot that is not possible at
            any speed is kept, and a direct one prevents the search for banks.
        direct: False to find banks only.
    """
    scene, m, k = tables.scene, len(tables.positions), most
    if k is None:  # a direct pot and a bank off each cushion
        legal = int(tables.legal.sum(axis=1).max(initial=0))
        k = legal * len(scene.table.pockets) * (5 if banks else 1)
    pots = Pots(
        np.empty(m, np.int64),
        np.zeros((m, k), np.int64),
        np.zeros((m, k), np.int64),
        np.zeros((m, k, WIDTH)),
        np.zeros((m, k, len(SPEEDS) if speeds else 0, SHOT_WIDTH)),
    )
    slip_ratio, spin_ratio = 1.0 - 2.5 * offset[1], -2.5 * offset[0]  # see `physics.strike.struck`
    in_play = tables.in_play.copy()  # numba compiles a second time for a read-only array
    fields = tables.cue, tables.positions, in_play, tables.targets, float(tables.max_speed), slip_ratio, spin_ratio
    flags = banks is not None, banks is True, speeds, direct
    write_pots(scene_kernels(scene), scene_fields(scene), fields, flags, tuple(pots))
    return pots


def pot_shots(table: Tables, direct: bool = True) -> PotShots:
    """Returns the pots of one table at several speeds, see `find_pots`."""
    pots = find_pots(table, direct=direct)
    count, s = int(pots.count[0]), len(SPEEDS)
    rows, shots = pots.rows[0, :count].repeat(s, axis=0), pots.shots[0, :count].reshape(-1, SHOT_WIDTH)
    scratch = shots[:, GAPS] < 0
    order = np.argsort(scratch, kind="stable")
    order = order[shots[order, SPEED] > 0]
    return PotShots(
        pots.ball[0, :count].repeat(s)[order],
        pots.pocket[0, :count].repeat(s)[order],
        shots[order, DX : DY + 1],
        shots[order, SPEED],
        rows[order, TOLERANCE],
        scratch[order],
    )


@entry_point
def write_pots(kernels, scene, tables, flags, pots):
    """Writes the pots of all tables to `pots`; see `find_pots`.

    `tables` holds the other fields of `TableArrays`. `flags`: find banks on tables without a direct pot, find all
    banks, write the shots, find direct pots.
    """
    _write_pots(kernels, scene, tables, flags, pots)


@allocating
def _write_pots(kernels, scene, tables, flags, pots):
    """Writes the pots, see `write_pots`."""
    scene, pots = scene_of(kernels, scene, 0), Pots(*pots)
    cue, positions, in_play, targets, max_speed, slip_ratio, spin_ratio = tables
    state = empty_state(positions.shape[1], 2)
    for t in range(len(positions)):
        table = TableArrays(scene, cue, positions[t], in_play[t], targets[t], max_speed, slip_ratio, spin_ratio)
        own = Pots(pots.count[t : t + 1], pots.ball[t], pots.pocket[t], pots.rows[t], pots.shots[t])
        own.count[0] = 0
        any_banks, all_banks, speeds, direct = flags
        if direct:
            _add_direct(table, own)
        if speeds and not all_banks:
            _add_speeds(table, own, state)
        if all_banks or (any_banks and own.count[0] == 0):
            _add_banks(table, own, state)
            if speeds:
                _add_speeds(table, own, state)


@inlined
def _add_direct(table, pots):
    """Adds the direct pots of a table to the `Pots` of this table alone."""
    for i in range(len(table.targets)):
        if table.targets[i]:
            for p in range(len(table.scene.pockets)):
                aim = direct_pot(table, i, p)
                if aim.gap >= 0.0:
                    least = _least_speed(table, aim)
                    if least <= table.max_speed:
                        _insert(table, aim, least, pots)


@inlined
def _add_banks(table, pots, state):
    """Adds the banks of a table to the `Pots` of this table alone."""
    for i in range(len(table.targets)):
        if table.targets[i]:
            for p in range(len(table.scene.pockets)):
                for wall in range(4):
                    aim = bank_pot(table, i, p, wall, _BANK_SPEED * table.max_speed, state)
                    if aim.gap >= 0.0:
                        _insert(table, aim, _LEAST_BANK_SPEED * table.max_speed, pots)


@kernel
def _least_speed(table, aim):
    """Returns the least speed of the cue ball with which the object ball reaches the pocket, m/s.

    The object ball then has the speed `_ARRIVAL` at the pocket, or `_LEAST_ARRIVAL` if `_ARRIVAL` needs more than the
    largest speed.
    """
    numbers, approach, gained = table.scene.numbers, aim.hit.approach, gain(table, aim.ball, aim.hit)
    least = launch(numbers, approach, launch(numbers, aim.run, _ARRIVAL, 1.0) / gained, table.slip_ratio)
    if least > table.max_speed:
        least = launch(numbers, approach, launch(numbers, aim.run, _LEAST_ARRIVAL, 1.0) / gained, table.slip_ratio)
    return least


@kernel
def _insert(table, aim, least, pots):
    """Inserts a pot with its least speed, m/s, into the `Pots` of one table, in the order of their tolerances."""
    hit, scene = aim.hit, table.scene
    reach = scene.space.contact_distance(table.cue, aim.ball, scene)
    cosine = cut_cosine(hit)
    tolerance = aim.mouth * reach * cosine / max(hit.approach, reach)
    k = pots.count[0]
    while k > 0 and pots.rows[k - 1, TOLERANCE] < tolerance:
        k -= 1
    most = len(pots.ball)
    if k == most:
        return
    pots.count[0] = min(pots.count[0] + 1, most)
    for j in range(pots.count[0] - 1, k, -1):
        _copy(pots, j - 1, j)
    pots.ball[k], pots.pocket[k] = aim.ball, aim.pocket
    row = pots.rows[k]
    row[GHOST_X], row[GHOST_Y], row[WALL] = hit.x, hit.y, aim.wall
    row[CUT_COS], row[CUT_SIN] = cosine, cross(hit.dx, hit.dy, hit.line_x, hit.line_y)
    row[APPROACH], row[RUN], row[MOUTH], row[TOLERANCE] = hit.approach, aim.run, aim.mouth, tolerance
    row[BALL_GAP], row[LEAST_SPEED] = aim.gap, least


@inlined
def _copy(pots, k, to):
    """Copies pot k, without its shots, to the row `to`."""
    pots.ball[to], pots.pocket[to] = pots.ball[k], pots.pocket[k]
    for column in range(WIDTH):
        pots.rows[to, column] = pots.rows[k, column]


@kernel
def _add_speeds(table, pots, state):
    """Writes the shots of the `Pots` of one table, and removes the pots that are not possible at any speed."""
    count, kept = pots.count[0], 0
    for k in range(count):
        _copy(pots, k, kept)
        if _add_shots(table, pots, kept, state):
            kept += 1
    for k in range(kept, count):
        pots.ball[k] = pots.pocket[k] = 0
        pots.rows[k] = 0.0
    pots.count[0] = kept


@inlined
def _add_shots(table, pots, k, state):
    """Writes the shots of pot k in the `Pots` of one table, and returns whether any speed is possible."""
    i, row, possible = pots.ball[k], pots.rows[k], False
    straight, wall = hit_at(table, i, row[GHOST_X], row[GHOST_Y]), int(row[WALL])
    for s in range(len(SPEEDS)):
        speed = row[LEAST_SPEED] + SPEEDS[s] * (table.max_speed - row[LEAST_SPEED])
        if wall >= 0:
            aim = bank_pot(table, i, pots.pocket[k], wall, speed, state)
            if aim.gap < 0.0:
                continue
            hit = aim.hit
        else:
            hit = against_throw(table.scene.laws.friction, table, i, straight, speed, state)
            if cut_cosine(hit) <= 0.0 or meet_before(table, i, hit, speed, row[RUN], state):
                continue
        shot, possible = pots.shots[k, s], True
        shot[DX], shot[DY], shot[SPEED] = hit.dx, hit.dy, speed
        play_hit(table, i, hit, speed, state)
        follow_path(table.scene, state, table.cue, shot[GAPS:])
        shot[END_X], shot[END_Y] = state.rows[table.cue, X], state.rows[table.cue, Y]
    return possible
