"""What an impact does to a shot's balls, and the contact-time rule for impacts that would go on without end.

The rule is after the TC model of Luding and McNamara (1998), How to handle the inelastic collapse of a dissipative
hard-sphere gas: balls touch for about so long, so nothing that comes back sooner is a separate impact.

The kernels change velocities, slip and spin; which phase a ball is in then, its caller settles with `motion.start`.
"""

from __future__ import annotations

from billiards_env.engine.log import N_CONTACT_RULE
from billiards_env.physics.impulse import apply_impulses, exchange, reflect
from billiards_env.physics.jit import inlined, kernel, merged
from billiards_env.physics.motion import norm, start
from billiards_env.physics.state import (
    AX,
    AY,
    CONTACT_GAP,
    E_BALL,
    E_CUSHION,
    IDEAL,
    MOTION,
    ROLL,
    SLIDE,
    SLIDING,
    SLIDING_AND_ROLLING,
    UX,
    UY,
    VX,
    VY,
    X,
    Y,
)

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


@kernel
def spread(count, first, second, dv, done, state, column):
    """Adds the changes `dv` (n, 2), m/s, of the balls in `count` contacts to two columns of their rows, once each."""
    for c in range(count):
        for k in (first[c], second[c]):
            if done[k]:
                state[k, column] += dv[k, 0]
                state[k, column + 1] += dv[k, 1]
                done[k] = False


@inlined
def press(params):
    """What friction can accelerate two balls towards each other with, at most, m/s^2."""
    if params[MOTION] == IDEAL:
        return 0.0
    return 2.0 * (params[SLIDE] if params[MOTION] == SLIDING_AND_ROLLING else params[ROLL])


@inlined
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


@inlined
def is_wedged(i, params, quick):
    """Whether the contact-time rule brings ball i to rest at its next impact."""
    if quick[i, AT_ONCE] > WEDGED_AT_ONCE:
        return True
    lossy = params[MOTION] != IDEAL or params[E_BALL] < 1.0 or params[E_CUSHION] < 1.0
    return lossy and quick[i, QUICK] > WEDGED


@kernel
def halt(state, i):
    """Brings ball i to rest; its spin about the vertical axis stays."""
    for c in (VX, VY, UX, UY):
        state[i, c] = 0.0


@inlined
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
        halt(state, i)
        return speed
    elastic = quick[i, QUICK] > MANY_CONTACTS
    counts[N_CONTACT_RULE] += elastic
    reflect(state, i, side, elastic, radius, params)
    if quick[i, QUICK_OR_WEAK] <= PRESSED:
        return speed
    # Contact-time rule: a ball that its spin presses against the cushion leaves it for CONTACT_TIME at least. It is the
    # spin that gives the speed; as no more is taken than 2/5 of it, energy does not rise (it does not, for d <= 2/5 w,
    # if 1/2 (d^2 - v^2) + 1/5 ((w - d + v)^2 - w^2) <= 0, where v <= d is the speed before and w the spin's).
    start(state, phase, i, params)
    least = min(0.5 * CONTACT_TIME * sign * s[n + AX - VX], 0.4 * sign * (s[n] - s[un]))
    if phase[i] == SLIDING and -sign * s[n] < least:
        counts[N_CONTACT_RULE] += 1
        s[n] = -sign * least
    return speed


@kernel
def part_pressed(count, state, phase, params, inv_mass, first, second, nx, ny, closing, scratch, quick, counts):
    """The contact-time rule for pairs: one that is pressed together separates for CONTACT_TIME at least.

    All of it follows from the state right after the impact, so that the numbering of the contacts does not matter. The
    arguments are those of `collide`.
    """
    impulse, slipping, ones, _, _, dv, done = scratch
    for c in range(count):
        start(state, phase, first[c], params)
        start(state, phase, second[c], params)
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


@merged
def collide(
    count, hi, state, phase, params, inv_mass, first, second, nx, ny, closing, scratch, last_hit, quick, counts
):
    """Changes the velocities of the balls in `count` simultaneous impacts.

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
        scratch: An `impulse.impulse_scratch`.
        last_hit: (n,) time of each ball's last impact, s.
        quick: (n, 3) int64, how many impacts in a row were quick, quick or weak, and at one instant.
        counts: (N_COUNTS,) int64.
    """
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
            halt(state, first[c])
            halt(state, second[c])
        return
    exchange(count, e, state, params, inv_mass, first, second, nx, ny, closing, scratch)
    for c in range(count):
        if quick[first[c], QUICK_OR_WEAK] > PRESSED and quick[second[c], QUICK_OR_WEAK] > PRESSED:
            part_pressed(count, state, phase, params, inv_mass, first, second, nx, ny, closing, scratch, quick, counts)
            break
