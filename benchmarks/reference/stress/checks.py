"""Runs shots and checks every event of each: overlap, energy, momentum, positions, heights.

The checks use only the log of the shot, which does not depend on how the engine finds the events.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.compile import MAX_EVENTS, scene_arrays, scene_fields, scene_kernels
from billiards_env.engine.in_space import limits_at
from billiards_env.engine.log import (
    BALL_BALL,
    KIND,
    LANDING,
    N_EVENTS_LOGGED,
    N_SEGMENTS_LOGGED,
    SEGMENT_BALL,
    SEGMENT_PHASE,
    SEGMENT_ROW,
    TIME,
    TIME_LO,
    Log,
    empty_log,
)
from billiards_env.engine.pic import ALL_PAIRS, PicKernels, run_shots
from billiards_env.engine.shot_input import check_shot
from billiards_env.engine.shots import Shots, empty_shots, start_fields
from billiards_env.jit import allocating, entry_point, inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.pockets import distance_from, pocket_at
from billiards_env.physics.geometry.walls import (
    BEGIN_TX,
    BEGIN_TY,
    END_TX,
    END_TY,
    HALF_LINE,
    LINE_X,
    LINE_Y,
    NX,
    NY,
    TIP_RADIUS,
    TIP_X,
    TIP_Y,
    TX,
    TY,
)
from billiards_env.physics.laws.cloth import spin_after
from billiards_env.physics.motion import motion_after, slip_after
from billiards_env.physics.state import (
    AIRBORNE,
    POTTED,
    SLIDING_AND_ROLLING,
    UX,
    UY,
    VX,
    VY,
    VZ,
    WZ,
    Time,
    X,
    Y,
    Z,
    empty_state,
    own_time,
    scene_of,
    since,
)
from billiards_env.scene import Scene

OVERLAP, OUTSIDE, RISE, RISE_SUM, MOMENTUM, BROKEN, FULL, IMPACTS, DRIFT_X, DRIFT_Y = range(10)
"""Columns of the findings: the deepest overlap, the largest distance beyond a cushion, into a pocket or under the cloth
(m), the largest rise of the energy relative to the energy before it, the sum of the rises above `ENERGY_RISE` (J), the
largest change of momentum in an impact relative to the sum of the balls' momenta, whether a number is not finite or a
time is out of order (0 or 1), whether the log was too short (0 or 1), the number of ball-ball impacts, the sum of their
changes of the momentum (kg m/s)."""
N_FINDINGS = 10

HEIGHT = 2  # the column of z, in arrays of places and of momenta

ENERGY_RISE = 1e-12  # relative; larger rises must be acts of the contact-time rule
DEPTH = 1e-12  # m; the largest overlap, and the largest distance beyond a cushion


@inlined
def _motion(noses, i, now, state, numbers):
    """Returns the position of ball i, m, and its velocity, m/s, both (x, y, z), at a `Time` during its phase."""
    t, s = since(now, own_time(state, i)), state.rows[i]
    x, y, vx, vy = motion_after(state, i, t)
    if noses is None:
        return (x, y, 0.0), (vx, vy, 0.0)
    if state.phase[i] != AIRBORNE:
        return (x, y, s[Z]), (vx, vy, s[VZ])
    return (x, y, s[Z] + t * (s[VZ] - 0.5 * t * numbers.g)), (vx, vy, s[VZ] - t * numbers.g)


@kernel
def _energy(now, state, mass, scene, scale):
    """Returns the kinetic energy of all balls, and that of their heights, with velocities in units of `scale`, J."""
    radius, numbers = scene.radius, scene.numbers
    total = 0.0
    for i in range(len(radius)):
        if state.phase[i] == POTTED or math.isinf(mass[i]):
            continue
        (_, _, z), (vx, vy, vz) = _motion(scene.noses, i, now, state, numbers)
        vx, vy, vz = vx / scale, vy / scale, vz / scale
        twice = vx * vx + vy * vy + (vz * vz + 2.0 * numbers.g * z / scale / scale)
        if numbers.motion == SLIDING_AND_ROLLING:
            t = since(now, own_time(state, i))
            ux, uy = slip_after(state, i, t)
            ux, uy = ux / scale, uy / scale
            falls = state.phase[i] == AIRBORNE
            wz = radius[i] * spin_after(state.rows[i, WZ], 0.0 if falls else t, numbers) / scale
            twice += 0.4 * ((vx - ux) * (vx - ux) + (vy - uy) * (vy - uy) + wz * wz)
        total += 0.5 * mass[i] * twice
    return total


@kernel
def beyond_outline(x, y, radius, outline):
    """Returns the distance by which a ball at (x, y) overlaps the nearest cushion, m; negative if it overlaps none."""
    ends, inside, nearest = outline.ends, False, math.inf
    x0, y0 = ends[-1, X], ends[-1, Y]
    for k in range(len(ends)):
        x1, y1 = ends[k, X], ends[k, Y]
        if (y0 > y) != (y1 > y) and x < x0 + (x1 - x0) * ((y - y0) / (y1 - y0)):
            inside = not inside
        dx, dy = x1 - x0, y1 - y0
        square = dx * dx + dy * dy
        if k % 2 == 1 and square > 0.0:  # a straight cushion, not the chord of an arc
            share = min(max(((x - x0) * dx + (y - y0) * dy) / square, 0.0), 1.0)
            px, py = x - (x0 + share * dx), y - (y0 + share * dy)
            nearest = min(nearest, math.sqrt(px * px + py * py))
        x0, y0 = x1, y1
    for k in range(len(outline.tips)):
        tip = outline.tips[k]
        dx, dy = x - tip[TIP_X], y - tip[TIP_Y]
        if dx * tip[BEGIN_TX] + dy * tip[BEGIN_TY] >= 0.0 and dx * tip[END_TX] + dy * tip[END_TY] <= 0.0:
            distance = math.sqrt(dx * dx + dy * dy) - tip[TIP_RADIUS]
            nearest = min(nearest, abs(distance))
            inside = inside and distance >= 0.0  # the table does not reach into the circle of a tip
    return radius - nearest if inside else radius + nearest


@kernel
def _distance_to(px, py, x, y, above, pockets):
    """Returns the distance of a ball from a point of a nose, m; infinite in a pocket, where there is no nose."""
    for k in range(len(pockets)):
        if distance_from(pockets[k], px, py) < 0.0:
            return math.inf
    return norm(norm(x - px, y - py), above)


@kernel
def _nose_distance(x, y, above, inset, outline, pockets):
    """Returns the distance of a ball from the nearest nose, m; `above` is its height above the noses.

    The ends of the noses at pockets and the noses behind the ball do not count.
    """
    nearest = math.inf
    for line in outline.lines:
        dx, dy = x - line[LINE_X], y - line[LINE_Y]
        gap = -(line[NX] * dx + line[NY] * dy) - inset
        if gap >= 0.0 and abs(line[TX] * dx + line[TY] * dy) <= line[HALF_LINE]:
            px, py = x + gap * line[NX], y + gap * line[NY]
            nearest = min(nearest, _distance_to(px, py, x, y, above, pockets))
    for tip in outline.tips:
        dx, dy = x - tip[TIP_X], y - tip[TIP_Y]
        if dx * tip[BEGIN_TX] + dy * tip[BEGIN_TY] >= 0.0 and dx * tip[END_TX] + dy * tip[END_TY] <= 0.0:
            share = (tip[TIP_RADIUS] + inset) / norm(dx, dy)
            px, py = tip[TIP_X] + share * dx, tip[TIP_Y] + share * dy
            nearest = min(nearest, _distance_to(px, py, x, y, above, pockets))
    return nearest


@inlined
def _beyond_noses(noses, x, y, z, radius, scene):
    """Returns how far a ball in the air overlaps a nose or is beyond the noses, m; negative if neither is true."""
    if noses is None:
        return -math.inf
    height = scene.numbers.cushion_height - radius
    inset, beyond = radius - math.sqrt(radius * radius - height * height), -math.inf
    if pocket_at(scene.pockets, x, y, 1.0) < 0:
        beyond = beyond_outline(x, y, inset, scene.outline)
    apart = _nose_distance(x, y, z - height, inset, scene.outline, scene.pockets)
    return max(beyond, radius - apart)


@inlined
def _touch(noses, i, j, higher, scene):
    """Returns the height of the centre of ball i above the centre of ball j, and the distance at which they touch, m.

    `higher` is the difference between their heights above the cloth, m. Without flight only horizontal distances count.
    """
    radius = scene.radius
    if noses is None:
        return 0.0, scene.space.contact_distance(i, j, scene)
    return higher + radius[i] - radius[j], radius[i] + radius[j]


@kernel
def _check_positions(now, state, scene, places, findings):
    """Compares the positions of the balls at a `Time` with each other, the cushions, the pockets and the cloth."""
    numbers, radius, pockets = scene.numbers, scene.radius, scene.pockets
    for i in range(len(radius)):
        if state.phase[i] == POTTED:
            continue
        (x, y, z), (vx, vy, vz) = _motion(scene.noses, i, now, state, numbers)
        if not math.isfinite(x + y + vx + vy + z + vz):
            findings[BROKEN] = 1.0
        places[i, X], places[i, Y], places[i, HEIGHT] = x, y, z
        if state.phase[i] == AIRBORNE:
            out = max(-z, _beyond_noses(scene.noses, x, y, z, radius[i], scene))
        else:
            if z != 0.0 or vz != 0.0:
                findings[BROKEN] = 1.0
            out = beyond_outline(x, y, radius[i], scene.outline)
            for k in range(len(pockets)):
                out = max(out, -distance_from(pockets[k], x, y))
        findings[OUTSIDE] = max(findings[OUTSIDE], out)
        for j in range(i):
            if state.phase[j] != POTTED:
                dx, dy = x - places[j, X], y - places[j, Y]
                dz, reach = _touch(scene.noses, i, j, z - places[j, HEIGHT], scene)
                if dx * dx + dy * dy + dz * dz < reach * reach:
                    findings[OVERLAP] = max(findings[OVERLAP], reach - norm(norm(dx, dy), dz))


@allocating
def _check(log, scene, acts, findings):
    """Checks the log of one shot."""
    events, n_events, segments = log.events, log.used[N_EVENTS_LOGGED], log.segments
    n, radius, mass = len(scene.radius), scene.radius, 1.0 / scene.inv_mass
    state = empty_state(n, scene.space.axes())
    rows, phases = state.rows, state.phase
    momenta, places = np.empty((n, 3)), np.empty((n, 3))
    findings[:] = 0.0
    findings[OUTSIDE] = findings[OVERLAP] = -math.inf
    now, scale = Time(0.0, 0.0), 0.0
    for i in range(n):
        rows[i] = segments[i, SEGMENT_ROW:]
        phases[i] = int(segments[i, SEGMENT_PHASE])
        scale = max(scale, norm(rows[i, VX], rows[i, VY]), norm(rows[i, UX], rows[i, UY]), radius[i] * abs(rows[i, WZ]))
        (_, _, z), (_, _, vz) = _motion(scene.noses, i, now, state, scene.numbers)
        scale = max(scale, abs(vz), math.sqrt(2.0 * scene.numbers.g * z))
    _check_positions(now, state, scene, places, findings)
    if scale == 0.0:
        return
    if acts > 0:
        scale = max(scale, 1e-100)  # what the rule gives to slower balls would overflow in units of their speed
    energy = _energy(now, state, mass, scene, scale)
    least = 1e-30 * energy  # velocities near zero carry the rounding of what they were before
    k, row = 0, n
    while k < n_events:
        previous = now.hi
        now = Time(events[k, TIME], events[k, TIME_LO])
        if not now.hi >= previous:
            findings[BROKEN] = 1.0
        if now.hi > previous:
            _check_positions(Time(0.5 * (now.hi + previous), 0.0), state, scene, places, findings)
        before = _energy(now, state, mass, scene, scale)
        for i in range(n):
            _, (momenta[i, X], momenta[i, Y], momenta[i, HEIGHT]) = _motion(scene.noses, i, now, state, scene.numbers)
        impacts_only, fixed = True, False
        while k < n_events and events[k, TIME] == now.hi and events[k, TIME_LO] == now.lo:
            impact = events[k, KIND] == BALL_BALL
            impacts_only = impacts_only and impact
            findings[IMPACTS] += impact
            if events[k, KIND] == LANDING:
                i = int(segments[row, SEGMENT_BALL])
                (_, _, z), _ = _motion(scene.noses, i, now, state, scene.numbers)
                findings[OUTSIDE] = max(findings[OUTSIDE], abs(z))
            for _ in range(2 if impact else 1):
                i = int(segments[row, SEGMENT_BALL])
                fixed = fixed or math.isinf(mass[i])
                rows[i] = segments[row, SEGMENT_ROW:]
                phases[i] = int(segments[row, SEGMENT_PHASE])
                row += 1
            k += 1
        after = _energy(now, state, mass, scene, scale)
        for rise, base in ((before - energy, energy), (after - before, before)):
            if rise > least:
                if rise > ENERGY_RISE * base:
                    findings[RISE_SUM] += rise * scale * scale
                findings[RISE] = max(findings[RISE], rise / base if base > 0.0 else math.inf)
        energy = after
        if impacts_only and not fixed:
            px = py = pz = total = 0.0
            for i in range(n):
                if phases[i] == POTTED or math.isinf(mass[i]):
                    continue
                _, (vx, vy, vz) = _motion(scene.noses, i, now, state, scene.numbers)
                px += mass[i] * ((vx - momenta[i, X]) / scale)
                py += mass[i] * ((vy - momenta[i, Y]) / scale)
                pz += mass[i] * ((vz - momenta[i, HEIGHT]) / scale)
                total += mass[i] * (norm(vx / scale, vy / scale) + norm(momenta[i, X] / scale, momenta[i, Y] / scale))
                total += mass[i] * (abs(vz) + abs(momenta[i, HEIGHT])) / scale
            findings[DRIFT_X] += px * scale
            findings[DRIFT_Y] += py * scale
            if total > 0.0:
                findings[MOMENTUM] = max(findings[MOMENTUM], norm(norm(px, py), pz) / total)
        _check_positions(now, state, scene, places, findings)
    if not math.isfinite(energy):
        findings[BROKEN] = 1.0


@entry_point
def _run_checked(kernels, scene, limit, max_events, shots, log, findings):
    arrays, record = scene_of(kernels.scene, scene, 0), Log(*log)
    used = record.used
    for k in range(len(findings)):
        run_shots(kernels, k, k + 1, scene, limit, max_events, shots, log)
        if used[N_EVENTS_LOGGED] > len(record.events) or used[N_SEGMENTS_LOGGED] > len(record.segments):
            findings[k, FULL] = 1.0
        else:
            _check(record, arrays, Shots(*shots).n_contact_rule[k], findings[k])


class Checked(NamedTuple):
    """The results of m shots.

    Attributes:
        shots: The `Shots` after their ends; a ball that is not in play is potted.
        findings: (m, N_FINDINGS) float64; the columns are named above.
        rise_bound: The largest energy that one act of the contact-time rule may add, J.
    """

    shots: Shots
    findings: NDArray[np.float64]
    rise_bound: float

    def bad(self, may_time_out: bool = False) -> NDArray[np.bool_]:
        """Returns (m,) bool: the shots that did not end or violate a rule."""
        f, shots = self.findings, self.shots
        aloft = np.zeros(len(f), np.bool_) if shots.heights is None else shots.heights.any(axis=(1, 2))
        return (
            (shots.status > (1 if may_time_out else 0))
            | ~np.isfinite(shots.positions).all(axis=(1, 2))
            | (aloft & (shots.status == 0))
            | (f[:, [BROKEN, FULL]] != 0).any(axis=1)
            | ~(f[:, OVERLAP] <= DEPTH)
            | ~(f[:, OUTSIDE] <= DEPTH)
            | ((shots.n_contact_rule == 0) & ~(f[:, MOMENTUM] <= 1e-14))
            | ~(f[:, RISE_SUM] <= shots.n_contact_rule * self.rise_bound * (1 + 1e-6))
        )


def check_shots(
    scene: Scene,
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    spins: NDArray[np.float64] | None = None,
    max_time: float | None = None,
    max_events: int = MAX_EVENTS,
    log_rows: int = 16_384,
) -> Checked:
    """Runs m shots and checks every event of each.

    Args:
        scene: The scene.
        positions: (m, n, 2) m. In scenes with flight these and the velocities may have a third component.
        velocities: (m, n, 2) or (m, 2) m/s.
        spins: (m, n, 3) or (m, 3) rad/s.
        max_time: Time at which a shot ends, s; None for the limit of the scene.
        max_events: Number of events after which the engine ends the shot with the status "event_limit". "pit" also ends
            it after `pit.MAX_STEPS` timesteps, with the status "step_limit".
        log_rows: The number of events that the log holds; a shot with more is run again with a larger log.
    """
    m, n = positions.shape[:2]
    flight = scene.physics.flight
    shots = empty_shots(m, n, flight)
    limit = check_shot(scene, positions, velocities, spins, None, max_time, into=shots).limit
    findings = np.zeros((m, N_FINDINGS))
    kernels, arrays = PicKernels(scene_kernels(scene), ALL_PAIRS), scene_fields(scene)
    log = empty_log(log_rows, 2 * log_rows + n, flight=flight)
    start = [None if array is None else array.copy() for array in start_fields(shots)]
    _run_checked(kernels, arrays, limit, max_events, tuple(shots), tuple(log), findings)
    for k in np.flatnonzero(findings[:, FULL]):
        rows = int(shots.n_events[k])
        log = empty_log(rows, 2 * rows + n, flight=flight)
        findings[k] = 0.0
        one = slice(k, k + 1)
        again = tuple(None if array is None else array[one] for array in (*start, *shots[len(start) :]))
        _run_checked(kernels, arrays, limit, max_events, again, tuple(log), findings[one])
    heaviest = max(m for m in scene.balls.mass if math.isfinite(m))
    numbers = scene_arrays(scene).numbers
    weak = limits_at(1.0, numbers).speed if flight else numbers.weak_speed
    return Checked(shots, findings, 0.5 * heaviest * (1.5 * weak) ** 2)
