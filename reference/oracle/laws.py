"""The laws of motion and of impact, in mpmath arithmetic. Vectors are tuples; SI units."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import mpmath

from billiards_env.scene import Scene
from reference.oracle.roots import Real

Vector = tuple[Real, ...]

ROUNDS = 10_000
"""The number of joint impulses at one instant that counts as an inelastic collapse."""


class TooManyRoundsError(RuntimeError):
    """The contacts of one instant still approach after `ROUNDS` joint impulses."""


@dataclasses.dataclass(frozen=True)
class World:
    """The constants of a scene, converted exactly. Attributes that are not listed are those of `Scene`.

    Attributes:
        radius: (n,) m.
        inverse_mass: (n,) 1/kg; 0 for a ball of infinite mass.
        room: The largest (|x|, |y|) of each ball's centre, m.
        pockets: (x, y, radius) of each pocket, m.
        tiny: The relative size below which a difference counts as rounding.
    """

    motion: str
    cushion: str
    g: Real
    mu_slide: Real
    mu_roll: Real
    spin_decay: Real
    e_ball: Real
    e_cushion: Real
    mu_cushion: Real
    cushion_height: Real
    radius: Vector
    inverse_mass: Vector
    room: tuple[Vector, ...]
    pockets: tuple[Vector, ...]
    tiny: Real

    @classmethod
    def of(cls, scene: Scene, digits: int) -> World:
        """Returns the constants of a scene in the working precision of the caller."""
        mpf, table, balls, physics = mpmath.mpf, scene.table, scene.balls, scene.physics
        names = ("g", "mu_slide", "mu_roll", "spin_decay", "e_ball", "e_cushion", "mu_cushion")
        half = mpf(table.length) / 2, mpf(table.width) / 2
        return cls(
            motion=physics.motion,
            cushion=physics.cushion,
            **{name: mpf(getattr(physics, name)) for name in names},
            cushion_height=mpf(table.cushion_height),
            radius=tuple(mpf(r) for r in balls.radius),
            inverse_mass=tuple(mpf(0) if math.isinf(m) else 1 / mpf(m) for m in balls.mass),
            room=tuple((half[0] - mpf(r), half[1] - mpf(r)) for r in balls.radius),
            pockets=tuple((mpf(p.x), mpf(p.y), mpf(p.radius)) for p in table.pockets),
            tiny=mpf(10) ** -(3 * digits // 5),
        )


@dataclasses.dataclass(frozen=True)
class Segment:
    """The motion of a ball between two events.

    The position is quadratic in the time since `start`; velocity and horizontal spin are linear.

    Attributes:
        phase: "rest", "spinning", "rolling", "sliding", "free" or "potted".
        start, end: s; the end is None if the phase has no end without a contact.
        position, velocity, acceleration: (2,) m, m/s, m/s^2 at the start.
        spin: (3,) rad/s at the start.
        spin_rate: (3,) rad/s^2; the third component is the decay of the spin about z, which ends at zero.
        noise: m/s; a speed of at most this size is a rounding error of a larger speed.
    """

    phase: str
    start: Real
    end: Real | None
    position: Vector
    velocity: Vector
    acceleration: Vector
    spin: Vector
    spin_rate: Vector
    noise: Real

    @property
    def moving(self) -> bool:
        """Returns whether the position changes."""
        return self.phase in ("rolling", "sliding", "free")

    def position_at(self, time: Real) -> Vector:
        """Returns the position at a time, (2,) m."""
        t = time - self.start
        return tuple(
            r + t * (v + t * a / 2) for r, v, a in zip(self.position, self.velocity, self.acceleration, strict=True)
        )

    def velocity_at(self, time: Real) -> Vector:
        """Returns the velocity at a time, (2,) m/s."""
        t = time - self.start
        return tuple(v + t * a for v, a in zip(self.velocity, self.acceleration, strict=True))

    def spin_at(self, time: Real) -> Vector:
        """Returns the spin at a time, (3,) rad/s."""
        t = time - self.start
        wx, wy, wz = (w + t * b for w, b in zip(self.spin, self.spin_rate, strict=True))
        return (wx, wy, wz if wz * self.spin[2] > 0 else mpmath.mpf(0))


def norm(v: Sequence[Real]) -> Real:
    """Returns the Euclidean norm."""
    return mpmath.sqrt(sum(x * x for x in v))


def slip(world: World, ball: int, velocity: Vector, spin: Vector) -> Vector:
    """Returns the velocity of a ball's point of contact with the cloth, u = v + R z x omega, (2,) m/s."""
    radius = world.radius[ball]
    return (velocity[0] - radius * spin[1], velocity[1] + radius * spin[0])


def segment(
    world: World, ball: int, start: Real, position: Vector, velocity: Vector, spin: Vector, noise: Real
) -> Segment:
    """Returns the motion of a ball that starts in a state; the state determines the phase. `noise`: see `Segment`."""
    zero = mpmath.mpf(0)
    still = (zero, zero)
    speed = norm(velocity)
    if speed <= noise:
        velocity, speed = still, zero

    def make(phase: str, duration: Real | None, acceleration: Vector, spin: Vector, spin_rate: Vector) -> Segment:
        end = None if duration is None else start + duration
        return Segment(phase, start, end, position, velocity, acceleration, spin, spin_rate, noise)

    if world.motion == "ideal":
        return make("free" if speed else "rest", None, still, (zero,) * 3, (zero,) * 3)
    if world.motion == "rolling":
        if not speed:
            return make("rest", None, still, (zero,) * 3, (zero,) * 3)
        deceleration = world.mu_roll * world.g
        acceleration = tuple(-deceleration * v / speed for v in velocity)
        return make("rolling", speed / deceleration, acceleration, (zero,) * 3, (zero,) * 3)

    radius = world.radius[ball]
    wz = spin[2] if radius * abs(spin[2]) > noise else zero
    wz_rate = -mpmath.sign(wz) * world.spin_decay
    u = slip(world, ball, velocity, spin)
    sliding = norm(u)
    if sliding > noise:
        # Friction acts against the slip and keeps its direction. Its torque changes R omega by 5/2 of the change of v.
        deceleration = world.mu_slide * world.g
        ax, ay = (-deceleration * x / sliding for x in u)
        turn = 5 / (2 * radius)
        return make(
            "sliding",
            2 * sliding / (7 * deceleration),
            (ax, ay),
            (spin[0], spin[1], wz),
            (turn * ay, -turn * ax, wz_rate),
        )
    if speed:
        deceleration = world.mu_roll * world.g
        ax, ay = (-deceleration * v / speed for v in velocity)
        rolling = (-velocity[1] / radius, velocity[0] / radius, wz)
        return make("rolling", speed / deceleration, (ax, ay), rolling, (-ay / radius, ax / radius, wz_rate))
    if wz:
        return make("spinning", abs(wz) / world.spin_decay, still, (zero, zero, wz), (zero, zero, wz_rate))
    return make("rest", None, still, (zero,) * 3, (zero,) * 3)


def next_phase(world: World, ball: int, old: Segment) -> tuple[str, Segment]:
    """Returns the event at the end of a segment and the segment that follows it.

    The event is "sliding_rolling", "rolling_rest" or "spinning_rest".
    """
    zero = mpmath.mpf(0)
    position, velocity, spin = (old.position_at(old.end), old.velocity_at(old.end), old.spin_at(old.end))
    noise = max(old.noise, world.tiny * norm(old.velocity))
    if old.phase == "spinning":
        spin = (zero,) * 3
    elif old.phase == "rolling":
        velocity, spin, noise = (zero, zero), (zero, zero, spin[2]), zero
    else:
        radius = world.radius[ball]
        spin = (-velocity[1] / radius, velocity[0] / radius, spin[2])
    new = segment(world, ball, old.end, position, velocity, spin, noise)
    if old.phase == "spinning":
        return "spinning_rest", new
    return ("sliding_rolling" if new.phase == "rolling" else "rolling_rest"), new


def bounce(world: World, ball: int, side: int, velocity: Vector, spin: Vector) -> tuple[Vector, Vector]:
    """Returns velocity and spin after the cushion `side` (0 is -x, 1 +x, 2 -y, 3 +y)."""
    # n points into the cushion, t = z x n; (vn, vt) and (wn, wt) are the components along them.
    sign = 1 if side % 2 else -1
    n = (sign, 0) if side < 2 else (0, sign)
    t = (-n[1], n[0])
    vn, vt = n[0] * velocity[0] + n[1] * velocity[1], t[0] * velocity[0] + t[1] * velocity[1]
    wn, wt, wz = n[0] * spin[0] + n[1] * spin[1], t[0] * spin[0] + t[1] * spin[1], spin[2]
    if world.cushion == "restitution":
        vn = -world.e_cushion * vn
    else:
        vn, vt, wn, wt, wz = _han(world, ball, vn, vt, wn, wt, wz)
    return (n[0] * vn + t[0] * vt, n[1] * vn + t[1] * vt), (n[0] * wn + t[0] * wt, n[1] * wn + t[1] * wt, wz)


def _han(world: World, ball: int, vx: Real, vy: Real, wx: Real, wy: Real, wz: Real) -> Vector:
    """Returns the state after a cushion by Han (2005), Dynamics in Carom and Three Cushion Billiards.

    The mass is 1, and x points into the cushion.
    """
    radius = world.radius[ball]
    sin = world.cushion_height / radius - 1
    cos = mpmath.sqrt(1 - sin * sin)
    sx = vx * sin + radius * wy
    sy = -vy - radius * wz * cos + radius * wx * sin
    slipping = norm((sx, sy))

    def friction(normal: Real) -> Vector:
        if 2 * slipping / 7 <= world.mu_cushion * normal:
            return 2 * sx / 7, 2 * sy / 7
        return tuple(world.mu_cushion * normal * s / slipping for s in (sx, sy))

    normal = (1 + world.e_cushion) * vx * cos
    if friction(normal)[0] * sin + normal * cos < vx:
        # The normal impulse of the restitution does not stop the ball: the cushion pushes until the ball stops.
        low, high = normal, vx / cos + slipping
        for _ in range(4 * mpmath.mp.dps):
            middle = (low + high) / 2
            stops = friction(middle)[0] * sin + middle * cos >= vx
            low, high = (low, middle) if stops else (middle, high)
        normal = high
    friction_x, friction_y = friction(normal)
    px = -friction_x * sin - normal * cos
    py = friction_y
    pz = friction_x * cos - normal * sin
    turn = 5 / (2 * radius)  # R m / I
    return (
        min(vx + px, mpmath.mpf(0)),
        vy + py,
        wx - turn * py * sin,
        wy + turn * (px * sin - pz * cos),
        wz + turn * py * cos,
    )


def collide(
    world: World,
    positions: dict[int, Vector],
    velocities: dict[int, Vector],
    contacts: Sequence[tuple[int, int]],
    noise: Real,
) -> tuple[dict[int, Vector], list[tuple[int, int]]]:
    """Returns the velocities after the impacts of one instant.

    All approaching contacts get one joint impulse, the generalised reflection of Smith, Kaufman, Vouga, Tamstorf and
    Grinspun (2012) with restitution. This is repeated until no contact approaches.

    Args:
        world: The constants.
        positions: (2,) m of each ball in contact.
        velocities: (2,) m/s of each before the impacts.
        contacts: Pairs (i, j) of touching balls.
        noise: m/s; a slower approach does not count.

    Returns:
        The velocities after the impacts, and the pairs with an impulse in their order.

    Raises:
        TooManyRoundsError: If contacts still approach after `ROUNDS` joint impulses.
    """
    velocities = dict(velocities)
    hits: list[tuple[int, int]] = []
    normals = {}
    for i, j in contacts:
        d = tuple(b - a for a, b in zip(positions[i], positions[j], strict=True))
        length = norm(d)
        normals[i, j] = tuple(x / length for x in d)

    def rate(pair: tuple[int, int]) -> Real:
        i, j = pair
        return sum(n * (b - a) for n, a, b in zip(normals[pair], velocities[i], velocities[j], strict=True))

    for _ in range(ROUNDS):
        due = [pair for pair in contacts if rate(pair) < -noise]
        if not due:
            return velocities, hits
        rates = [rate(pair) for pair in due]
        coupling = [[_coupling(world, p, q, normals) for q in due] for p in due]
        for (i, j), impulse in zip(due, plastic_impulses(coupling, rates, noise), strict=True):
            if impulse == 0:
                continue
            hits.append((i, j))
            for ball, sign in ((i, -1), (j, 1)):
                change = sign * (1 + world.e_ball) * impulse * world.inverse_mass[ball]
                velocities[ball] = tuple(v + change * n for v, n in zip(velocities[ball], normals[i, j], strict=True))
    raise TooManyRoundsError


def _coupling(world: World, p: tuple[int, int], q: tuple[int, int], normals: dict[tuple[int, int], Vector]) -> Real:
    """Returns the change of the normal velocity of contact p by a unit impulse at contact q."""
    shared = mpmath.mpf(0)
    for a, ball in enumerate(p):
        for b, other in enumerate(q):
            if ball == other:
                shared += world.inverse_mass[ball] if a == b else -world.inverse_mass[ball]
    return shared * sum(a * b for a, b in zip(normals[p], normals[q], strict=True)) if shared else shared


def plastic_impulses(coupling: Sequence[Sequence[Real]], rates: Sequence[Real], noise: Real) -> list[Real]:
    """Solves w + A x >= 0, x >= 0, x (w + A x) = 0 for x by the active sets of Lawson and Hanson (1974), ch. 23.

    This is the non-negative least-squares problem of the smallest change of velocity. A is positive semidefinite and
    may be singular: the active contacts stay independent, and the velocities are unique.
    """
    count = len(rates)
    x = [mpmath.mpf(0)] * count
    active: list[int] = []
    while True:
        after = [rates[c] + sum(coupling[c][d] * x[d] for d in active) for c in range(count)]
        waiting = [c for c in range(count) if c not in active and after[c] < -noise]
        if not waiting:
            return x
        active.append(min(waiting, key=lambda c: after[c]))
        while True:
            trial = _solve(coupling, rates, active)
            if min(trial) > 0:
                break
            # Go towards the trial until an impulse becomes zero, and remove its contact from the active set.
            fraction, blocking = min((x[c] / (x[c] - y), c) for c, y in zip(active, trial, strict=True) if y <= 0)
            for c, y in zip(active, trial, strict=True):
                x[c] += fraction * (y - x[c])
            active = [c for c in active if c != blocking]
        x = [mpmath.mpf(0)] * count
        for c, y in zip(active, trial, strict=True):
            x[c] = y


def _solve(coupling: Sequence[Sequence[Real]], rates: Sequence[Real], active: Sequence[int]) -> list[Real]:
    """Solves A y = -w on the active contacts."""
    if len(active) == 1:
        return [-rates[active[0]] / coupling[active[0]][active[0]]]
    matrix = mpmath.matrix([[coupling[c][d] for d in active] for c in active])
    return list(mpmath.lu_solve(matrix, mpmath.matrix([-rates[c] for c in active])))
