"""A reference for balls that stay pressed together, in floats: it integrates the constrained motion in small steps.

The 50-digit reference ends a shot when two bodies press against each other without a normal velocity. This module
continues it in two cases:

* `press_cushion`: the spin of a ball presses it against a straight cushion;
* `press_pair`: spin or friction presses two balls together.

While the contact force is compressive, it has the value that keeps the normal acceleration of the contact at zero.
These equations of motion are the limit of a sequence of impacts whose speeds and intervals tend to zero, with any
restitution. From the end of the force on, the balls move freely. The run ends at the first impact after that.

**Cloth.** As in `laws`: sliding friction of mu_slide g per mass against the slip u = v + R z x omega, rolling
resistance of mu_roll g against v where u = 0, and a spin about z that decays by spin_decay. That spin stays zero while
the cushion's friction cannot overcome the decay.

**Cushion** (the law of Han 2005 for infinitesimal impacts; n points into the cushion, t = z x n, all per mass). The
nose touches the ball at an elevation theta with sin(theta) = h / R - 1. N acts along the line from the nose to the
centre, friction mu_cushion N against the slip s of that point:

    s = (vn sin + R wt, -vt - R wz cos + R wn sin),   (fx, fy) = mu_cushion N s / |s|
    an  = cloth_n - fx sin - N cos = 0
    at  = cloth_t + fy
    R d(wn, wt, wz)/dt = 5/2 (cloth_t - fy sin, -cloth_n - fx, fy cos) - (0, 0, R spin_decay sign(wz))

Vertical forces are dropped, as in his carom model. At vn = 0 both the first component of s and -u_n are R wt, so the
cloth presses the ball exactly while R wt > 0. The nose therefore never sticks under load. The force stays compressive
until the slip on the cloth ends, and the ball then rolls along the cushion. "restitution" cushions leave spin alone;
they follow with mu_cushion = 0 and theta = 0.

**Pair.** A frictionless force F acts along the line of centres. A ball with u = 0 under a push p = F / m keeps rolling
while the cloth friction that this takes, 2/7 p, is at most mu_slide g. It then accelerates by 5/7 p, less the rolling
resistance. There are two versions of the resistance, see `press_pair`.

**Error.** Classical Runge-Kutta of fourth order; steps shrink in proportion to the slip as that ends, because its
direction then turns ever faster. Events are located by bisection. Half the steps change the end positions of the cases
in `benchmarks.pressed` by less than 1e-9 m.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.scene import Scene

Floats = NDArray[np.float64]
State = list[float]

X, Y, VX, VY, UX, UY, WZ = range(7)
"""A ball's state: position (m), velocity (m/s), slip on the cloth (m/s), spin about z (rad/s)."""
WIDTH = 7

STEP = 1e-3
"""The longest step, s."""
FREE_STEP = 2e-3
"""The step of the history in free motion, and of the search for a later impact, s."""
FRACTION = 0.1
"""The largest relative change of a slip in a step, approximately."""
SHORTEST = 1e-10
"""The shortest step, s."""
STILL = 4e-9
"""m/s. A decreasing slip or speed below this value is set to zero, which it would reach within a nanosecond."""
TOUCHING = 1e-9
"""m. Bodies at most this far apart at the start count as touching."""
DEEP = 1e-7
"""m. After the separation, an overlap of this size is a new contact of two balls."""


class Instant(NamedTuple):
    """The state of the balls at one time.

    Attributes:
        time: s.
        positions: (n, 2) m.
        velocities: (n, 2) m/s.
        spins: (n, 3) rad/s.
        force: The contact force along the contact's normal, N; 0 from the separation on.
    """

    time: float
    positions: Floats
    velocities: Floats
    spins: Floats
    force: float


@dataclasses.dataclass(frozen=True)
class PressedShot:
    """A run of `press_cushion` or `press_pair`.

    Attributes:
        time: s, the end of the run.
        positions: (n, 2) m at the end.
        velocities: (n, 2) m/s at the end.
        spins: (n, 3) rad/s at the end.
        separation_time: s, the end of the contact force, or of the run if the force has not ended.
        status: "rest", "max_time", or "impact" if a ball reaches another cushion or the balls meet again.
        history: The steps from the start to the end.
    """

    time: float
    positions: Floats
    velocities: Floats
    spins: Floats
    separation_time: float
    status: str
    history: tuple[Instant, ...]


@dataclasses.dataclass(frozen=True)
class _World:
    """The constants of a scene: accelerations in m/s^2, spin_decay in rad/s^2, lengths in m, inverse masses in 1/kg."""

    slide: float
    roll: float
    spin_decay: float
    radius: tuple[float, ...]
    reach: float  # distance of the centres of two balls that touch
    inverse_mass: tuple[float, ...]
    room: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, scene: Scene) -> _World:
        """Returns the constants of a scene."""
        physics, balls, table = scene.physics, scene.balls, scene.table
        if physics.motion != "sliding":
            raise ValueError(
                f"physics.motion = {physics.motion!r}: expected 'sliding', because only spin keeps balls pressed"
            )
        return cls(
            slide=physics.mu_slide * physics.g,
            roll=physics.mu_roll * physics.g,
            spin_decay=physics.spin_decay,
            radius=balls.radius,
            reach=float(balls.contact_distances(0)[-1]),
            inverse_mass=tuple(0.0 if math.isinf(m) else 1.0 / m for m in balls.mass),
            room=tuple((table.length / 2 - r, table.width / 2 - r) for r in balls.radius),
        )


def press_cushion(
    scene: Scene,
    positions: ArrayLike,
    velocities: ArrayLike,
    spins: ArrayLike,
    max_time: float = math.inf,
    refinement: int = 1,
) -> PressedShot:
    """Runs a shot of one ball that touches a cushion and is pressed against it by its spin.

    Args:
        scene: A scene of one ball.
        positions: (1, 2) m; the ball touches one cushion.
        velocities: (1, 2) m/s, without a component towards that cushion.
        spins: (1, 3) rad/s.
        max_time: The largest duration of the run, s.
        refinement: Divides the steps.

    Returns:
        The run. If the spin does not press the ball, the force ends at time 0.

    Raises:
        ValueError: If the ball does not touch one cushion, moves along its normal, or the cushion is so low and rough
            that its friction wedges the ball.
    """
    world, (state,) = _start(scene, positions, velocities, spins, 1)
    radius, room = world.radius[0], world.room[0]
    sides = [(axis, sign) for axis in (0, 1) for sign in (1, -1) if room[axis] - sign * state[axis] <= TOUCHING]
    if len(sides) != 1:
        raise ValueError(f"positions = {positions!r}: expected a ball that touches one cushion, not {len(sides)}")
    ((axis, sign),) = sides
    n = (sign, 0) if axis == 0 else (0, sign)
    t = (-n[1], n[0])
    along = t[0] + t[1]  # t points along an axis: its sign
    han = scene.physics.cushion == "han2005"
    mu = scene.physics.mu_cushion if han else 0.0
    sin = scene.table.cushion_height / radius - 1.0 if han else 0.0
    cos = math.sqrt(1.0 - sin * sin)
    if mu * -sin >= cos:
        raise ValueError(
            f"physics.mu_cushion = {mu!r}: expected less than {cos / -sin}, a steeper nose wedges the ball"
        )

    def dot(a: tuple[int, int], x: float, y: float) -> float:
        return a[0] * x + a[1] * y

    if abs(dot(n, state[VX], state[VY])) > STILL:
        raise ValueError(f"velocities = {velocities!r}: expected no component along the cushion's normal")
    # The state of the pressed ball: position along t, vt, un, ut, R wz; its vn is zero.
    pressed = [
        dot(t, state[X], state[Y]),
        dot(t, state[VX], state[VY]),
        dot(n, state[UX], state[UY]),
        dot(t, state[UX], state[UY]),
        radius * state[WZ],
    ]

    def load(s: Sequence[float]) -> tuple[float, float, float, float, float]:
        """Returns N, fx, fy, cloth_n and cloth_t, m/s^2."""
        _, vt, un, ut, rwz = s
        slip = math.hypot(un, ut)
        cloth_n, cloth_t = -world.slide * un / slip, -world.slide * ut / slip
        sx, sy = -un, -vt - rwz * cos + (ut - vt) * sin
        at_nose = math.hypot(sx, sy)
        normal = cloth_n / (cos + mu * sin * sx / at_nose)
        return normal, mu * normal * sx / at_nose, mu * normal * sy / at_nose, cloth_n, cloth_t

    def rate(s: State) -> State:
        _, fx, fy, cloth_n, cloth_t = load(s)
        turn, decay = 2.5 * fy * cos, radius * world.spin_decay
        decay = math.copysign(decay, s[4]) if s[4] else max(-decay, min(decay, turn))
        return [
            s[1],
            cloth_t + fy,
            2.5 * (cloth_n + fx),
            3.5 * cloth_t + fy * (1.0 - 2.5 * sin),
            turn - decay,
        ]

    def step(s: State) -> float:
        _, vt, un, ut, rwz = s
        slip = min(math.hypot(un, ut), math.hypot(un, -vt - rwz * cos + (ut - vt) * sin))
        return slip / (3.5 * world.slide * (1.0 + mu))

    def ball(s: State) -> State:
        place = room[axis] * sign
        x, y = (place, along * s[0]) if axis == 0 else (along * s[0], place)
        return [
            x,
            y,
            t[0] * s[1],
            t[1] * s[1],
            n[0] * s[2] + t[0] * s[3],
            n[1] * s[2] + t[1] * s[3],
            s[4] / radius,
        ]

    history: list[Instant] = []
    mass = scene.balls.mass[0]
    time, ends = 0.0, "separation"
    while True:
        sliding = math.hypot(pressed[2], pressed[3]) > STILL and pressed[2] < 0.0
        if not sliding:
            if math.hypot(pressed[2], pressed[3]) <= STILL:
                pressed[2] = pressed[3] = 0.0
            break
        history.append(_instant(world, time, [ball(pressed)], mass * load(pressed)[0]))
        if time >= max_time:
            ends = "max_time"
            break
        guards: list[Callable[[State], float]] = [lambda s: room[1 - axis] + TOUCHING - abs(s[0])]
        if pressed[4]:
            guards.append(lambda s, spin=pressed[4]: s[4] * spin)
        longest = min(_longest(step(pressed), refinement), max_time - time)
        took, pressed, fell = _step(rate, pressed, longest, guards)
        time = max_time if took == max_time - time else time + took
        if fell == 0:
            ends = "impact"
            break
        if fell == 1:
            pressed[4] = 0.0
    state = ball(pressed)
    if ends == "separation":
        return _continue_freely(world, time, [state], max_time, history)
    history.append(_instant(world, time, [state], mass * load(pressed)[0]))
    return _shot(time, ends, history)


def press_pair(
    scene: Scene,
    positions: ArrayLike,
    velocities: ArrayLike,
    spins: ArrayLike,
    max_time: float = math.inf,
    refinement: int = 1,
    resistance: str = "between impacts",
) -> PressedShot:
    """Runs a shot of two balls that touch and are pressed together.

    Args:
        scene: A scene of two balls.
        positions: (2, 2) m; the balls touch.
        velocities: (2, 2) m/s, without a relative component along the line of centres.
        spins: (2, 3) rad/s.
        max_time: The largest duration of the run, s.
        refinement: Divides the steps.
        resistance: The rolling resistance of a pushed ball that rolls. "between impacts" is the limit of small impacts
            under the free laws: after each impact p dt the ball slides for 2/7 p dt / (mu_slide g) without rolling
            resistance, and mu_roll g acts for the rest of the time. "always" is mu_roll g at all times.

    Returns:
        The run. If nothing presses the balls together, the force ends at time 0.

    Raises:
        ValueError: If the balls do not touch, or move along their line of centres relative to each other.
    """
    if resistance not in ("between impacts", "always"):
        raise ValueError(f"resistance = {resistance!r}: expected 'between impacts' or 'always'")
    world, states = _start(scene, positions, velocities, spins, 2)
    wi, wj = world.inverse_mass
    reach = world.reach
    pair = states[0] + states[1]
    dx, dy = pair[WIDTH + X] - pair[X], pair[WIDTH + Y] - pair[Y]
    if abs(math.hypot(dx, dy) - reach) > TOUCHING:
        raise ValueError(f"positions = {positions!r}: expected two balls {reach} m apart, not {math.hypot(dx, dy)} m")
    if abs(dx * (pair[WIDTH + VX] - pair[VX]) + dy * (pair[WIDTH + VY] - pair[VY])) > STILL * reach:
        raise ValueError(f"velocities = {velocities!r}: expected no relative velocity along the line of centres")
    share = 2.0 / (7.0 * world.slide) if resistance == "between impacts" else 0.0

    def opening(s: State, force: float) -> tuple[float, tuple[float, ...], tuple[float, ...]]:
        """Returns the second derivative of the distance under a force, m/s^2, and the accelerations of the balls."""
        dx, dy = s[WIDTH + X] - s[X], s[WIDTH + Y] - s[Y]
        distance = math.hypot(dx, dy)
        dx, dy = dx / distance, dy / distance
        wx, wy = s[WIDTH + VX] - s[VX], s[WIDTH + VY] - s[VY]
        around = dx * wy - dy * wx
        i = _pushed(world, s[:WIDTH], -force * wi * dx, -force * wi * dy, share) if wi else (0.0,) * 4
        j = _pushed(world, s[WIDTH:], force * wj * dx, force * wj * dy, share) if wj else (0.0,) * 4
        return dx * (j[0] - i[0]) + dy * (j[1] - i[1]) + around * around / distance, i, j

    def load(s: State) -> float:
        """Returns the force that keeps the distance, N; 0 if this force would pull."""
        low, below = 0.0, opening(s, 0.0)[0]
        if below >= 0.0:
            return 0.0
        small = 1e-14 * (world.slide + abs(below))
        high = -below / (wi + wj)
        above = opening(s, high)[0]
        while above < -small:
            low, below = high, above
            high *= 2.0
            above = opening(s, high)[0]
        # The opening is piecewise linear in the force, so the Illinois method (false position) converges quickly.
        for _ in range(200):
            if abs(above) <= small or high - low <= 1e-15 * high:
                break
            force = (low * above - high * below) / (above - below)
            there = opening(s, force)[0]
            if there * above <= 0.0:
                low, below = high, above
            else:
                below *= 0.5
            high, above = force, there
        return high

    def rate(s: State) -> State:
        _, i, j = opening(s, load(s))
        out: State = []
        for (ax, ay, ux, uy), b in ((i, 0), (j, WIDTH)):
            out += [s[b + VX], s[b + VY], ax, ay, ux, uy, 0.0]
        return out

    def step(s: State) -> float:
        shortest = math.inf
        for b in (0, WIDTH):
            slip, speed = math.hypot(s[b + UX], s[b + UY]), math.hypot(s[b + VX], s[b + VY])
            if slip:
                shortest = min(shortest, slip / (3.5 * world.slide))
            elif speed:
                shortest = min(shortest, speed / (world.slide + world.roll))
        return shortest

    def balls(s: State, time: float) -> list[State]:
        out = [s[:WIDTH], s[WIDTH:]]
        for ball, began in zip(out, states, strict=True):
            ball[WZ] = _decayed(began[WZ], world.spin_decay, time)
        return out

    history: list[Instant] = []
    time, ends = 0.0, "separation"
    rooms: list[Callable[[State], float]] = [
        lambda s, b=b, axis=axis: world.room[b][axis] + TOUCHING - abs(s[b * WIDTH + axis])
        for b in (0, 1)
        for axis in (0, 1)
    ]
    guards = [lambda s: -opening(s, 0.0)[0], *rooms]
    while True:
        change = rate(pair)
        for b in (0, WIDTH):
            for c in (UX, VX):  # first the slip, then the speed of a ball without slip
                x, y = pair[b + c], pair[b + c + 1]
                falls = x * change[b + c] + y * change[b + c + 1] < 0.0
                if 0.0 < math.hypot(x, y) <= STILL and falls and not (c == VX and (pair[b + UX] or pair[b + UY])):
                    pair[b + c] = pair[b + c + 1] = 0.0
        force = load(pair)
        if force * (wi + wj) <= 1e-9:
            break
        history.append(_instant(world, time, balls(pair, time), force))
        if time >= max_time:
            ends = "max_time"
            break
        longest = min(_longest(step(pair), refinement), max_time - time)
        took, pair, fell = _step(rate, pair, longest, guards)
        time = max_time if took == max_time - time else time + took
        if fell == 0:
            break
        if fell is not None:
            ends = "impact"
            break
    if ends == "separation":
        return _continue_freely(world, time, balls(pair, time), max_time, history)
    history.append(_instant(world, time, balls(pair, time), load(pair)))
    return _shot(time, ends, history)


def _start(
    scene: Scene, positions: ArrayLike, velocities: ArrayLike, spins: ArrayLike, n: int
) -> tuple[_World, list[State]]:
    """Returns the constants and the states of `n` balls."""
    world = _World.of(scene)
    if scene.n_balls != n:
        raise ValueError(f"scene.n_balls = {scene.n_balls}: expected {n}")
    states: list[State] = []
    arrays = [np.asarray(a, dtype=np.float64) for a in (positions, velocities, spins)]
    for array, name, width in zip(arrays, ("positions", "velocities", "spins"), (2, 2, 3), strict=True):
        if array.shape != (n, width):
            raise ValueError(f"{name} of shape {array.shape}: expected {(n, width)}")
    for radius, (x, y), (vx, vy), (wx, wy, wz) in zip(world.radius, *(a.tolist() for a in arrays), strict=True):
        states.append([x, y, vx, vy, vx - radius * wy, vy + radius * wx, wz])
    return world, states


def _pushed(world: _World, s: State, px: float, py: float, share: float) -> tuple[float, float, float, float]:
    """Returns the acceleration of a ball and of its slip under a push (px, py) through its centre, m/s^2."""
    slip = math.hypot(s[UX], s[UY])
    push = math.hypot(px, py)
    if slip or push > 3.5 * world.slide:
        # The push is too strong for rolling: the ball starts to slip along it.
        fx, fy = (-world.slide * s[UX] / slip, -world.slide * s[UY] / slip) if slip else (0.0, 0.0)
        if not slip:
            fx, fy = -world.slide * px / push, -world.slide * py / push
        return px + fx, py + fy, px + 3.5 * fx, py + 3.5 * fy
    resistance = world.roll * (1.0 - share * push)
    speed = math.hypot(s[VX], s[VY])
    if speed:
        dx, dy = s[VX] / speed, s[VY] / speed
    elif 5.0 * push > 7.0 * resistance:
        dx, dy = px / push, py / push
    else:
        return 0.0, 0.0, 0.0, 0.0
    return 5.0 * px / 7.0 - resistance * dx, 5.0 * py / 7.0 - resistance * dy, 0.0, 0.0


def _longest(scale: float, refinement: int) -> float:
    """Returns the step, s, if the slip ends in about `scale` seconds."""
    return max(SHORTEST, min(STEP, FRACTION * scale) / refinement)


def _runge_kutta(rate: Callable[[State], State], s: State, h: float) -> State:
    """Returns the state after one step of the classical method."""
    a = rate(s)
    b = rate([x + 0.5 * h * d for x, d in zip(s, a, strict=True)])
    c = rate([x + 0.5 * h * d for x, d in zip(s, b, strict=True)])
    d = rate([x + h * e for x, e in zip(s, c, strict=True)])
    return [x + h / 6.0 * (k + 2.0 * (m + n) + o) for x, k, m, n, o in zip(s, a, b, c, d, strict=True)]


def _step(
    rate: Callable[[State], State], s: State, h: float, guards: Sequence[Callable[[State], float]]
) -> tuple[float, State, int | None]:
    """Makes a step of h seconds, or a shorter one that ends when the first guard turns negative.

    Returns:
        The duration of the step, the state after it, and the number of the negative guard or None.
    """
    after = _runge_kutta(rate, s, h)
    if all(guard(after) >= 0.0 for guard in guards):
        return h, after, None
    low, high = 0.0, h
    for _ in range(60):
        middle = 0.5 * (low + high)
        there = _runge_kutta(rate, s, middle)
        if all(guard(there) >= 0.0 for guard in guards):
            low = middle
        else:
            high, after = middle, there
    fell = next(k for k, guard in enumerate(guards) if guard(after) < 0.0)
    return high, after, fell


def _decayed(wz: float, decay: float, time: float) -> float:
    """Returns the spin about z after some seconds of free decay, rad/s."""
    return math.copysign(max(0.0, abs(wz) - decay * time), wz)


def _free(world: _World, s: State, time: float) -> State:
    """Returns the state of a ball after some seconds of free motion."""
    x, y, vx, vy, ux, uy, _ = s
    left = time
    slip = math.hypot(ux, uy)
    if slip:
        lasts = slip / (3.5 * world.slide)
        t = min(left, lasts)
        ax, ay = -world.slide * ux / slip, -world.slide * uy / slip
        x, y = x + t * (vx + 0.5 * t * ax), y + t * (vy + 0.5 * t * ay)
        vx, vy = vx + t * ax, vy + t * ay
        ux, uy = (ux + 3.5 * t * ax, uy + 3.5 * t * ay) if left < lasts else (0.0, 0.0)
        left -= t
    speed = math.hypot(vx, vy)
    if left > 0.0 and speed:
        lasts = speed / world.roll
        t = min(left, lasts)
        ax, ay = -world.roll * vx / speed, -world.roll * vy / speed
        x, y = x + t * (vx + 0.5 * t * ax), y + t * (vy + 0.5 * t * ay)
        vx, vy = (vx + t * ax, vy + t * ay) if left < lasts else (0.0, 0.0)
    return [x, y, vx, vy, ux, uy, _decayed(s[WZ], world.spin_decay, time)]


def _lasts(world: _World, s: State) -> float:
    """Returns the time until a ball without contacts is at rest, s."""
    slide = math.hypot(s[UX], s[UY]) / (3.5 * world.slide)
    rolling = _free(world, s, slide)
    return max(slide + math.hypot(rolling[VX], rolling[VY]) / world.roll, abs(s[WZ]) / world.spin_decay)


def _continue_freely(
    world: _World, time: float, states: list[State], max_time: float, history: list[Instant]
) -> PressedShot:
    """Returns the run with the free motion of the balls after the end of the contact force."""
    for i, s in enumerate(states):
        if not world.inverse_mass[i]:
            s[VX:] = [0.0] * 5

    def clear(t: float) -> bool:
        there = [_free(world, s, t) for s in states]
        for room, s in zip(world.room, there, strict=True):
            if any(abs(s[axis]) > room[axis] + TOUCHING for axis in (0, 1)):
                return False
        if len(there) == 1:
            return True
        apart = math.hypot(there[1][X] - there[0][X], there[1][Y] - there[0][Y])
        return apart > world.reach - DEEP

    lasts = max(_lasts(world, s) for s in states)
    limit = min(lasts, max_time - time)
    end, t = "max_time" if limit < lasts else "rest", 0.0
    history.append(_instant(world, time, states, 0.0))
    while t < limit:
        low, t = t, min(t + FREE_STEP, limit)
        if not clear(t):
            for _ in range(50):
                middle = 0.5 * (low + t)
                low, t = (middle, t) if clear(middle) else (low, middle)
            end, limit = "impact", t
        history.append(_instant(world, time + t, [_free(world, s, t) for s in states], 0.0))
    return _shot(time, end, history)


def _instant(world: _World, time: float, states: Sequence[State], force: float) -> Instant:
    """Returns the states of the balls as positions, velocities and spins."""
    spins = [
        ((s[UY] - s[VY]) / radius, (s[VX] - s[UX]) / radius, s[WZ])
        for radius, s in zip(world.radius, states, strict=True)
    ]
    return Instant(
        time,
        np.array([s[X : Y + 1] for s in states]),
        np.array([s[VX : VY + 1] for s in states]),
        np.array(spins),
        force,
    )


def _shot(separation_time: float, status: str, history: list[Instant]) -> PressedShot:
    """Returns the run that ends with the last instant of `history`."""
    time, positions, velocities, spins, _ = history[-1]
    return PressedShot(time, positions, velocities, spins, separation_time, status, tuple(history))
