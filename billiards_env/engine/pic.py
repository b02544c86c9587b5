"""PIC, predicted instant of collision: from event to event, each at the instant it happens.

What happens next to each ball alone (phase change, cushion, pocket) and to each pair is predicted once and stays true
until one of the balls concerned is touched by an event. The loop takes the earliest prediction, brings only the balls
it concerns to that instant, changes their motion and predicts anew for them. At one instant pockets come first, then
impacts between balls, all of them as one problem, then cushions, then phase changes.
"""

from __future__ import annotations

import math

import numpy as np

from billiards_env.engine.log import (
    AT_EVENT_LIMIT,
    AT_MAX_TIME,
    AT_REST,
    BALL_BALL,
    CUSHION_HIT,
    CUSHIONS,
    CUSHIONS_BEFORE_HIT,
    ENDED,
    FIRST_HIT,
    N_CONTACT_RULE,
    N_EVENTS,
    POCKETED,
    ROLLS,
    SPIN_STOPS,
    STOPS,
    load,
    log_event,
    log_segment,
    store,
)
from billiards_env.physics.contact import circle_time, line_time
from billiards_env.physics.impulse import apply_impulses, exchange, reflect
from billiards_env.physics.jit import entry_point, kernel
from billiards_env.physics.motion import capture, finish, move, norm, place, start
from billiards_env.physics.state import (
    AX,
    AY,
    CONTACT_GAP,
    E_BALL,
    E_CUSHION,
    HALF_LENGTH,
    HALF_WIDTH,
    IDEAL,
    LASTS,
    MOTION,
    POTTED,
    REST,
    ROLL,
    ROLLING,
    SLIDE,
    SLIDING,
    SLIDING_AND_ROLLING,
    T0,
    T0_LO,
    UX,
    UY,
    VX,
    VY,
    WIDTH,
    X,
    Y,
    later,
    since,
)

# The contact-time rule, after the TC model of Luding and McNamara (1998), How to handle the inelastic collapse of a
# dissipative hard-sphere gas: balls touch for about so long, so nothing that comes back sooner is a separate impact.
CONTACT_TIME = 2e-4  # s; 200 to 300 microseconds for billiard balls (Marlow 1995)
PRESSED = 3  # after so many impacts of a ball in a row that are quick or weak, it is pressed
PATIENCE = 1_000  # after so many, a pressed pair has its speed from its spin, or as it came in, and not for nothing
MANY_CONTACTS = 100  # after so many quick impacts of a ball they are elastic
# A quick impact comes within half of CONTACT_TIME after the ball's last one; a weak one is no faster than what
# friction, pressing with 2 mu g at most, can bring about within CONTACT_TIME.
QUICK, QUICK_OR_WEAK, AT_ONCE = 0, 1, 2
# A ball that is wedged between bodies that do not give way would bounce for ever. After so many impacts at one instant,
# or so many quick ones where impacts or the cloth take energy, it and what it touches next come to rest.
WEDGED_AT_ONCE, WEDGED = 1_000, 2_000

# The rounding of a velocity that several impulses have made, relative to it. Plastic impacts leave a normal velocity of
# about so much, of either sign; taken for an approach, it would have them repeat without end.
NOISE = 2.0**-48

_SOON = 1e-6  # s; pairs predicted to meet within it of an impact are looked at for being part of it


@kernel
def predict_ball(i, state, phase, params, radius, pockets, own, own_kind):
    """The next event of ball i alone, counted from its own time: own[i] = (hi, lo), own_kind[i] = (kind, other)."""
    own[i, 0], own[i, 1] = math.inf, 0.0
    p = phase[i]
    if p in (REST, POTTED):
        return
    s = state[i]
    end = s[LASTS]
    kind, other = SPIN_STOPS, -1
    if p == SLIDING:
        kind = ROLLS
    elif p == ROLLING:
        kind = STOPS
    if p >= ROLLING:
        room_x, room_y = params[HALF_LENGTH] - radius[i], params[HALF_WIDTH] - radius[i]
        for k in range(4):
            sign = 1.0 if k % 2 else -1.0
            if k < 2:
                t = line_time(room_x - sign * s[X], sign * s[VX], sign * s[AX], end)
            else:
                t = line_time(room_y - sign * s[Y], sign * s[VY], sign * s[AY], end)
            if t < end or (t == end and kind != CUSHION_HIT and t < math.inf):
                end, kind, other = t, CUSHION_HIT, k
        for k in range(len(pockets)):
            dx, dy = pockets[k, 0] - s[X], pockets[k, 1] - s[Y]
            t = circle_time(dx, dy, -s[VX], -s[VY], -s[AX], -s[AY], pockets[k, 2], end, 0.0)
            if t < end or (t == end and kind != POCKETED and t < math.inf):
                end, kind, other = t, POCKETED, k
    if end < math.inf:
        own[i, 0], own[i, 1] = later(s[T0], s[T0_LO], end)
        own_kind[i, 0], own_kind[i, 1] = kind, other


@kernel
def predict_pair(i, j, hi, lo, state, phase, radius, own, own_kind, limit, pair, pair_lo):
    """When balls i < j next meet, looking from the time (hi, lo): pair[i, j], pair_lo[i, j]."""
    pair[i, j] = math.inf
    if (phase[i] < ROLLING or phase[i] == POTTED) and (phase[j] < ROLLING or phase[j] == POTTED):
        return
    if phase[i] == POTTED or phase[j] == POTTED:
        return
    # Whatever ends either ball's motion has the pair predicted anew; a change of phase that is due now does so at once.
    for k in (i, j):
        if own[k, 0] <= hi and own_kind[k, 0] in (ROLLS, STOPS):
            return
    end = min(min(own[i, 0], own[j, 0]), limit) - hi
    ti = since(hi, lo, state[i, T0], state[i, T0_LO])
    tj = since(hi, lo, state[j, T0], state[j, T0_LO])
    xi, yi, vxi, vyi = place(state, phase, i, ti)
    xj, yj, vxj, vyj = place(state, phase, j, tj)
    t = circle_time(
        xj - xi,
        yj - yi,
        vxj - vxi,
        vyj - vyi,
        state[j, AX] - state[i, AX],
        state[j, AY] - state[i, AY],
        radius[i] + radius[j],
        end,
        NOISE * (norm(vxi, vyi) + norm(vxj, vyj)),
    )
    if t < math.inf:
        pair[i, j], pair_lo[i, j] = later(hi, lo, t)


@kernel
def predict(i, hi, lo, state, phase, params, radius, pockets, limit, own, own_kind, pair, pair_lo):
    """Predicts anew for ball i, whose own time is (hi, lo), with every other ball."""
    predict_ball(i, state, phase, params, radius, pockets, own, own_kind)
    for j in range(len(phase)):
        if j < i:
            predict_pair(j, i, hi, lo, state, phase, radius, own, own_kind, limit, pair, pair_lo)
        elif j > i:
            predict_pair(i, j, hi, lo, state, phase, radius, own, own_kind, limit, pair, pair_lo)


@kernel
def spread(count, first, second, dv, done, state, column):
    """Adds the changes `dv` (n, 2), m/s, of the balls in `count` contacts to two columns of their rows, once each."""
    for c in range(count):
        for k in (first[c], second[c]):
            if done[k]:
                state[k, column] += dv[k, 0]
                state[k, column + 1] += dv[k, 1]
                done[k] = False


@kernel
def press(params):
    """What friction can accelerate two balls towards each other with, at most, m/s^2."""
    if params[MOTION] == IDEAL:
        return 0.0
    return 2.0 * (params[SLIDE] if params[MOTION] == SLIDING_AND_ROLLING else params[ROLL])


@kernel
def count_impact(i, hi, speed, params, last_hit, quick):
    """Counts an impact of ball i at time hi and a speed of approach: how many in a row were quick, weak or at once."""
    if (hi - last_hit[i]) * speed > CONTACT_GAP:
        quick[i, AT_ONCE] = 0
    quick[i, AT_ONCE] += 1
    if hi - last_hit[i] > 0.5 * CONTACT_TIME:
        quick[i, QUICK] = 0
        if speed > CONTACT_TIME * press(params):
            quick[i, QUICK_OR_WEAK] = 0
    last_hit[i] = hi
    quick[i, QUICK] += 1
    quick[i, QUICK_OR_WEAK] += 1


@kernel
def is_wedged(i, params, quick):
    """Whether the contact-time rule brings ball i to rest at its next impact."""
    if quick[i, AT_ONCE] > WEDGED_AT_ONCE:
        return True
    lossy = params[MOTION] != IDEAL or params[E_BALL] < 1.0 or params[E_CUSHION] < 1.0
    return lossy and quick[i, QUICK] > WEDGED


@kernel
def halt(state, phase, i, params):
    """Brings ball i to rest; its spin about the vertical axis stays."""
    for c in (VX, VY, UX, UY):
        state[i, c] = 0.0
    start(state, phase, i, params)


@kernel
def hit_cushion(i, side, hi, state, phase, params, radius, last_hit, quick, counts):
    """Ball i, touching cushion `side` (0 to 3: -x, +x, -y, +y), bounces off it. Returns its speed of approach, m/s.

    Where the contact-time rule has the ball's impacts elastic, its normal velocity is just reversed.
    """
    s = state[i]
    n = VX if side < 2 else VY
    un = n + UX - VX  # the column of the slip
    sign = 1.0 if side % 2 else -1.0
    speed = sign * s[n]
    count_impact(i, hi, speed, params, last_hit, quick)
    if is_wedged(i, params, quick):
        counts[N_CONTACT_RULE] += 1
        halt(state, phase, i, params)
        return speed
    elastic = quick[i, QUICK] > MANY_CONTACTS
    counts[N_CONTACT_RULE] += elastic
    reflect(state, i, side, elastic, radius, params)
    start(state, phase, i, params)
    # Contact-time rule: a ball that its spin presses against the cushion leaves it for CONTACT_TIME at least. It is the
    # spin that gives the speed; as no more is taken than 2/5 of it, energy does not rise (it does not, for d <= 2/5 w,
    # if 1/2 (d^2 - v^2) + 1/5 ((w - d + v)^2 - w^2) <= 0, where v <= d is the speed before and w the spin's).
    least = min(0.5 * CONTACT_TIME * sign * s[n + AX - VX], 0.4 * sign * (s[n] - s[un]))
    if quick[i, QUICK_OR_WEAK] > PRESSED and phase[i] == SLIDING and -sign * s[n] < least:
        counts[N_CONTACT_RULE] += 1
        s[n] = -sign * least
        start(state, phase, i, params)
    return speed


@kernel
def gather(hi, lo, state, phase, params, radius, pair, pair_lo, first, second, nx, ny, closing):
    """Pairs whose impact is due at (hi, lo), or that touch and approach then. Returns their number.

    Balls that take part are brought to that instant.
    """
    count = 0
    n = len(phase)
    for i in range(n):
        for j in range(i + 1, n):
            if pair[i, j] - hi > _SOON:
                continue
            due = pair[i, j] == hi and pair_lo[i, j] == lo
            ti = since(hi, lo, state[i, T0], state[i, T0_LO])
            tj = since(hi, lo, state[j, T0], state[j, T0_LO])
            xi, yi, vxi, vyi = place(state, phase, i, ti)
            xj, yj, vxj, vyj = place(state, phase, j, tj)
            dx, dy = xj - xi, yj - yi
            distance = norm(dx, dy)
            ex, ey = dx / distance, dy / distance
            speed = -(ex * (vxj - vxi) + ey * (vyj - vyi))
            if due:
                speed = max(speed, 0.0)
            elif distance - (radius[i] + radius[j]) > CONTACT_GAP or speed <= 0.0:
                continue
            move(state, phase, i, hi, lo, params)
            move(state, phase, j, hi, lo, params)
            first[count], second[count] = i, j
            nx[count], ny[count], closing[count] = ex, ey, speed
            count += 1
    return count


@kernel
def collide(
    count, hi, state, phase, params, inv_mass, first, second, nx, ny, closing, scratch, last_hit, quick, counts
):
    """Resolves `count` simultaneous impacts and settles the phases of the balls in them.

    Args:
        count: Number of contacts in first, second, nx, ny, closing.
        hi: Time, s.
        state: (n, WIDTH) float64.
        phase: (n,) int8.
        params: (N_PARAMS,) float64.
        inv_mass: (n,) float64, 1/kg.
        first: (>= count,) int64, a ball of each contact; second the other.
        second: See first.
        nx: (>= count,) unit normals from first to second.
        ny: See nx.
        closing: (>= count,) speeds of approach, m/s.
        scratch: (impulse, slipping, ones, work, dv, done), see `impulse.joint_impulses`.
        last_hit: (n,) time of each ball's last impact, s.
        quick: (n, 3) int64, how many impacts in a row were quick, quick or weak, and at one instant.
        counts: (N_COUNTS,) int64.
    """
    impulse, slipping, ones, _, dv, done = scratch
    e = params[E_BALL]
    for c in range(count):
        for k in (first[c], second[c]):
            count_impact(k, hi, closing[c], params, last_hit, quick)
            if quick[k, QUICK] > MANY_CONTACTS and e < 1.0:
                e = 1.0
                counts[N_CONTACT_RULE] += 1
    wedged = False
    for c in range(count):
        wedged = wedged or is_wedged(first[c], params, quick) or is_wedged(second[c], params, quick)
    if wedged:
        counts[N_CONTACT_RULE] += 1
        for c in range(count):
            halt(state, phase, first[c], params)
            halt(state, phase, second[c], params)
        return
    exchange(count, e, state, params, inv_mass, first, second, nx, ny, closing, scratch)
    for c in range(count):
        start(state, phase, first[c], params)
        start(state, phase, second[c], params)
    # Contact-time rule: a pair that is pressed together separates for CONTACT_TIME at least.
    # All of it follows from the state right after the impact, so that the numbering of the contacts does not matter.
    weak = 0.5 * CONTACT_TIME * press(params)
    acts = False
    for c in range(count):
        impulse[c] = slipping[c] = 0.0
        i, j = first[c], second[c]
        if quick[i, QUICK_OR_WEAK] <= PRESSED or quick[j, QUICK_OR_WEAK] <= PRESSED:
            continue
        wx, wy = state[j, VX] - state[i, VX], state[j, VY] - state[i, VY]
        leaving = nx[c] * wx + ny[c] * wy
        noise = NOISE * (norm(state[i, VX], state[i, VY]) + norm(state[j, VX], state[j, VY]))
        if leaving >= weak or leaving < -noise:
            continue
        around = ny[c] * wx - nx[c] * wy
        ax, ay = state[j, AX] - state[i, AX], state[j, AY] - state[i, AY]
        distance = norm(state[j, X] - state[i, X], state[j, Y] - state[i, Y])
        least = -0.5 * CONTACT_TIME * (nx[c] * ax + ny[c] * ay + around * around / distance)
        slips = False
        if least > 0.0:
            # It is given the speed for so long; then, as at a cushion, the spin gives it, or what came in goes out.
            patient = max(quick[i, QUICK_OR_WEAK], quick[j, QUICK_OR_WEAK]) <= PATIENCE
            spin_x = (state[i, VX] - state[i, UX]) - (state[j, VX] - state[j, UX])
            spin_y = (state[i, VY] - state[i, UY]) - (state[j, VY] - state[j, UY])
            lent = 0.4 * (nx[c] * spin_x + ny[c] * spin_y)
            given = least if patient else max(CONTACT_TIME * params[ROLL], 2.0 * noise, closing[c])
            least = min(max(least, 2.0 * noise), max(given, lent))
            slips = params[MOTION] == SLIDING_AND_ROLLING and lent <= given
        if leaving < least:
            counts[N_CONTACT_RULE] += 1
            acts = True
            impulse[c] = (least - leaving) / (inv_mass[i] + inv_mass[j])
            if slips:
                slipping[c] = impulse[c]
    if not acts:
        return
    apply_impulses(count, first, second, nx, ny, impulse, ones, inv_mass, dv, done)
    spread(count, first, second, dv, done, state, VX)
    apply_impulses(count, first, second, nx, ny, slipping, ones, inv_mass, dv, done)
    spread(count, first, second, dv, done, state, UX)
    for c in range(count):
        start(state, phase, first[c], params)
        start(state, phase, second[c], params)


@kernel
def run(state, phase, params, radius, inv_mass, pockets, limit, max_events, hits, counts, events, segments, used):
    """Runs one shot to rest, to the time `limit` or to `max_events` events.

    Args:
        state: (n, WIDTH) float64 at time 0, see `physics.state`; at the shot's end on return.
        phase: (n,) int8; POTTED balls are out of play.
        params: (N_PARAMS,) float64.
        radius: (n,) float64, m.
        inv_mass: (n,) float64, 1/kg.
        pockets: (k, 3) float64: x, y, radius, m.
        limit: s; may be infinite unless motion is ideal.
        max_events: The shot is given up after so many.
        hits: (n, 2) int32 out, see `engine.log`.
        counts: (N_COUNTS,) int64 out, see `engine.log`.
        events: (rows, EVENT_WIDTH) float64 out; no rows where the shot is not recorded.
        segments: (rows, SEGMENT_WIDTH) float64 out, likewise.
        used: (2,) int64 out: rows of events and segments in use.

    Returns:
        The time at which the shot ended, s.
    """
    n = len(phase)
    own, own_kind = np.empty((n, 2)), np.empty((n, 2), np.int64)
    pair, pair_lo = np.full((n, n), math.inf), np.zeros((n, n))
    most = max(1, n * (n - 1) // 2)
    first, second = np.empty(most, np.int64), np.empty(most, np.int64)
    nx, ny, closing = np.empty(most), np.empty(most), np.empty(most)
    scratch = (
        np.empty(most),
        np.empty(most),
        np.ones(most),
        np.empty((most, 4)),
        np.empty((n, 2)),
        np.zeros(n, np.bool_),
    )
    last_hit, quick = np.full(n, -math.inf), np.zeros((n, 3), np.int64)

    hits[:, CUSHIONS], hits[:, CUSHIONS_BEFORE_HIT] = 0, -1
    counts[N_EVENTS], counts[ENDED], counts[FIRST_HIT], counts[N_CONTACT_RULE] = 0, AT_REST, -1, 0
    used[0] = used[1] = 0
    for i in range(n):
        start(state, phase, i, params)
        log_segment(segments, used, state, phase, i)
        predict_ball(i, state, phase, params, radius, pockets, own, own_kind)
    for i in range(n):
        for j in range(i + 1, n):
            predict_pair(i, j, 0.0, 0.0, state, phase, radius, own, own_kind, limit, pair, pair_lo)

    hi = lo = 0.0
    while True:
        next_hi, next_lo, a, b = math.inf, 0.0, -1, -1
        for i in range(n):
            for j in range(i + 1, n):
                if pair[i, j] < next_hi or (pair[i, j] == next_hi and pair_lo[i, j] < next_lo):
                    next_hi, next_lo, a, b = pair[i, j], pair_lo[i, j], i, j
        rank = 1  # of kinds at one instant: pocket 0, ball-ball 1, cushion 2, phase change 3
        for i in range(n):
            t, t_lo = own[i, 0], own[i, 1]
            if t > next_hi or t == math.inf:
                continue
            r = 0 if own_kind[i, 0] == POCKETED else (2 if own_kind[i, 0] == CUSHION_HIT else 3)
            if t < next_hi or t_lo < next_lo or (t_lo == next_lo and r < rank):
                next_hi, next_lo, a, b, rank = t, t_lo, i, -1, r
        if next_hi > limit:
            if limit < math.inf:
                for i in range(n):
                    if phase[i] != POTTED and phase[i] != REST:
                        counts[ENDED] = AT_MAX_TIME
                        move(state, phase, i, limit, 0.0, params)
                if counts[ENDED] == AT_MAX_TIME:
                    hi = limit
            break
        if next_hi == math.inf:
            break
        if counts[N_EVENTS] >= max_events:
            counts[ENDED] = AT_EVENT_LIMIT
            for i in range(n):
                move(state, phase, i, hi, lo, params)
            break
        hi, lo = next_hi, next_lo
        acts = counts[N_CONTACT_RULE]
        if b >= 0:
            count = gather(hi, lo, state, phase, params, radius, pair, pair_lo, first, second, nx, ny, closing)
            collide(
                count,
                hi,
                state,
                phase,
                params,
                inv_mass,
                first,
                second,
                nx,
                ny,
                closing,
                scratch,
                last_hit,
                quick,
                counts,
            )
            for c in range(count):
                i, j = first[c], second[c]
                if i == 0:
                    if counts[FIRST_HIT] < 0:
                        counts[FIRST_HIT] = j
                    if hits[j, CUSHIONS_BEFORE_HIT] < 0:
                        hits[j, CUSHIONS_BEFORE_HIT] = hits[0, CUSHIONS]
                log_event(events, used, hi, lo, BALL_BALL, i, j, state, closing[c], counts[N_CONTACT_RULE] > acts)
                log_segment(segments, used, state, phase, i)
                log_segment(segments, used, state, phase, j)
                predict_ball(i, state, phase, params, radius, pockets, own, own_kind)
                predict_ball(j, state, phase, params, radius, pockets, own, own_kind)
            counts[N_EVENTS] += count
            for c in range(count):
                predict(first[c], hi, lo, state, phase, params, radius, pockets, limit, own, own_kind, pair, pair_lo)
                predict(second[c], hi, lo, state, phase, params, radius, pockets, limit, own, own_kind, pair, pair_lo)
            continue
        kind, other = own_kind[a, 0], own_kind[a, 1]
        speed = 0.0
        if kind == POCKETED:
            move(state, phase, a, hi, lo, params)
            speed = norm(state[a, VX], state[a, VY])
            capture(state, phase, a, pockets[other, 0], pockets[other, 1])
        elif kind == CUSHION_HIT:
            move(state, phase, a, hi, lo, params)
            speed = hit_cushion(a, other, hi, state, phase, params, radius, last_hit, quick, counts)
            hits[a, CUSHIONS] += 1
        else:
            finish(state, phase, a, hi, lo, params)
        counts[N_EVENTS] += 1
        log_event(events, used, hi, lo, kind, a, other, state, speed, counts[N_CONTACT_RULE] > acts)
        log_segment(segments, used, state, phase, a)
        predict(a, hi, lo, state, phase, params, radius, pockets, limit, own, own_kind, pair, pair_lo)
    return hi


@entry_point
def run_shots(
    begin,
    end,
    params,
    radius,
    inv_mass,
    pockets,
    limit,
    max_events,
    positions,
    velocities,
    spins,
    in_play,
    times,
    hits,
    counts,
    events,
    segments,
    used,
):
    """Runs shots `begin` to `end` of a batch, in place.

    Args:
        begin: First shot.
        end: One past the last.
        params: (N_PARAMS,) float64.
        radius: (n,) float64, m.
        inv_mass: (n,) float64, 1/kg.
        pockets: (k, 3) float64: x, y, radius, m.
        limit: s; may be infinite unless motion is ideal.
        max_events: A shot is given up after so many.
        positions: (m, n, 2) float64, m; the final ones on return.
        velocities: (m, n, 2) float64, m/s; likewise.
        spins: (m, n, 3) float64, rad/s; likewise.
        in_play: (m, n) bool: balls that are not in a pocket; likewise.
        times: (m,) float64 out, s.
        hits: (m, n, 2) int32 out, see `engine.log`.
        counts: (m, N_COUNTS) int64 out, see `engine.log`.
        events: (rows, EVENT_WIDTH) float64 out: the log of the last shot; no rows to record nothing.
        segments: (rows, SEGMENT_WIDTH) float64 out, likewise.
        used: (2,) int64 out: rows of events and segments in use, of the last shot.
    """
    n = len(radius)
    state, phase = np.empty((n, WIDTH)), np.empty(n, np.int8)
    for shot in range(begin, end):
        load(positions[shot], velocities[shot], spins[shot], in_play[shot], radius, params, state, phase)
        times[shot] = run(
            state,
            phase,
            params,
            radius,
            inv_mass,
            pockets,
            limit,
            max_events,
            hits[shot],
            counts[shot],
            events,
            segments,
            used,
        )
        store(positions[shot], velocities[shot], spins[shot], in_play[shot], radius, params, state, phase)
