"""The laws of motion and of impact, in mpmath arithmetic. Vectors are tuples; SI units.

In scenes with flight positions and velocities have a third component, upwards. The height of the centre is
measured from its height on the cloth.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import mpmath

from benchmarks.reference.oracle.mathavan import Nose, impact
from benchmarks.reference.oracle.outline import Arc, Line, dot, minus, walls_of
from benchmarks.reference.oracle.roots import Real
from billiards_env.scene import PARAMETERS, Scene, Table, ball_friction

Vector = tuple[Real, ...]

TURNS = 4
"""The largest number of impacts on each of two cushions at one instant in `bounce_both`."""

ROUNDS = 10_000
"""The number of joint impulses at one instant that counts as an inelastic collapse."""


class TooManyRoundsError(RuntimeError):
    """The contacts of one instant still approach after `ROUNDS` joint impulses."""


@dataclasses.dataclass(frozen=True)
class World:
    """The constants of a scene, converted exactly. Attributes that are not listed are as in `Scene`.

    Attributes:
        radius: (n,) m.
        spheres: Whether the centres of touching balls differ in height by the difference of their radii.
        inverse_mass: (n,) 1/kg; 0 for a ball of infinite mass.
        table, walls: The table and its cushions.
        extent: Half the table's length and width with the jaws, m.
        half_size: The same without the jaws, m.
        pockets: (x, y, radius) of each pocket, m.
        mu_slate: As in `Physics`, with its default.
        ball_friction: (a, b, c) of the friction a + b exp(-c v) between balls, if `ball_ball` has friction.
        tiny: The relative size below which a difference counts as rounding.
    """

    motion: str
    flight: bool
    cushion: str
    ball_ball: str
    g: Real
    mu_slide: Real
    mu_roll: Real
    mu_roll_speed: Real | None
    spin_decay: Real
    e_ball: Real
    e_cushion: Real
    e_cushion_loss: Real
    e_cushion_onset: Real
    e_cushion_floor: Real
    e_cushion_topspin: Real
    e_cushion_tangent: Real
    e_cushion_slip: Real
    mu_cushion: Real
    cushion_frequency_ratio: Real
    e_slate: Real
    mu_slate: Real
    least_hop: Real
    ball_friction: Vector
    cushion_height: Real
    radius: Vector
    spheres: bool
    inverse_mass: Vector
    table: Table
    walls: tuple[Line | Arc, ...]
    extent: Vector
    half_size: Vector
    pockets: tuple[Vector, ...]
    tiny: Real

    @classmethod
    def of(cls, scene: Scene, digits: int) -> World:
        """Returns the constants of a scene in the working precision of the caller.

        Raises:
            ValueError: If this simulator does not have the law of the cushions or of two balls.
        """
        for name, laws in (("cushion", CUSHIONS), ("ball_ball", BALL_LAWS)):
            if getattr(scene.physics, name) not in laws:
                raise ValueError(f"physics.{name} = {getattr(scene.physics, name)!r}: expected one of {list(laws)}")
        mpf, table, balls, physics = mpmath.mpf, scene.table, scene.balls, scene.physics
        numbers = {name: getattr(physics, name) for name in PARAMETERS if name in cls.__dataclass_fields__}
        if numbers["mu_slate"] is None:
            numbers["mu_slate"] = physics.mu_slide
        corners = [(c.x, c.y) for c in table.outline] or [(table.length / 2, table.width / 2)]
        extent = tuple(max(abs(mpf(place[axis])) for place in corners) for axis in (0, 1))
        return cls(
            motion=physics.motion,
            flight=physics.flight,
            cushion=physics.cushion,
            ball_ball=physics.ball_ball,
            **{name: value if value is None else mpf(value) for name, value in numbers.items()},
            ball_friction=tuple(map(mpf, ball_friction(physics))),
            cushion_height=mpf(table.cushion_height),
            radius=tuple(mpf(r) for r in balls.radius),
            spheres=balls.shape == "sphere",
            inverse_mass=tuple(mpf(0) if math.isinf(m) else 1 / mpf(m) for m in balls.mass),
            table=table,
            walls=walls_of(table),
            extent=extent,
            half_size=(mpf(table.length) / 2, mpf(table.width) / 2),
            pockets=tuple((mpf(p.x), mpf(p.y), mpf(p.radius)) for p in table.pockets),
            tiny=mpf(10) ** -(3 * digits // 5),
        )

    def rise(self, i: int, j: int) -> Real:
        """Returns the height of ball j's centre above ball i's, m; zero for disks."""
        return self.radius[j] - self.radius[i] if self.spheres else mpmath.mpf(0)

    def reach(self, i: int, j: int) -> Real:
        """Returns the distance between the centres of balls i and j when they touch, m.

        In scenes without flight it is the horizontal distance, by the Pythagorean theorem.
        """
        rise = 0 if self.flight else self.rise(i, j)
        return mpmath.sqrt((self.radius[i] + self.radius[j]) ** 2 - rise**2)

    def offset(self, i: int, j: int, at: Vector, other: Vector) -> Vector:
        """Returns the vector from the centre of ball i, at `at`, to the centre of ball j, at `other`, m."""
        x, y, *heights = minus(other, at)
        return (x, y, *(z + self.rise(i, j) for z in heights))

    def pocket_at(self, position: Vector) -> int | None:
        """Returns the pocket whose circle contains a position."""
        for k, (x, y, radius) in enumerate(self.pockets):
            if norm(minus(position, (x, y))) < radius:
                return k
        return None

    def is_between_noses(self, ball: int, position: Vector) -> bool:
        """Returns whether a position is inside the lines of the noses, also in the pockets; computed with floats."""
        return bool(self.table.clearance([float(x) for x in position[:2]]) >= float(self.nose(ball)[0]))

    def nose(self, ball: int) -> tuple[Real, Real]:
        """Returns where a ball on the cloth touches the nose of a cushion.

        The first number is the distance of the nose from the vertical plane that the ball touches, towards the ball, m.
        The second is the height of the nose above the ball's centre, m.
        """
        height = self.cushion_height - self.radius[ball]
        return self.radius[ball] - mpmath.sqrt(self.radius[ball] ** 2 - height**2), height


@dataclasses.dataclass(frozen=True)
class Segment:
    """The motion of a ball between two events.

    The position is quadratic in the time since `start`; velocity and horizontal spin are linear.

    Attributes:
        phase: "rest", "spinning", "rolling", "sliding", "free", "airborne" or "potted".
        start, end: s; the end is None if the phase has no end without a contact.
        position, velocity, acceleration: (2,) m, m/s, m/s^2 at the start; (3,) in scenes with flight.
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
        return self.phase in ("rolling", "sliding", "free", "airborne")

    def position_at(self, time: Real) -> Vector:
        """Returns the position at a time, m."""
        t = time - self.start
        return tuple(
            r + t * (v + t * a / 2) for r, v, a in zip(self.position, self.velocity, self.acceleration, strict=True)
        )

    def velocity_at(self, time: Real) -> Vector:
        """Returns the velocity at a time, m/s."""
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


def rolling_resistance(world: World, speed: Real) -> tuple[Real, Real]:
    """Returns the deceleration of a ball that rolls, m/s^2, and the speed at which this deceleration ends, m/s."""
    if world.mu_roll_speed is None:
        return world.mu_roll * world.g, mpmath.mpf(0)
    steps = (mpmath.mpf(k) / 2 for k in range(9))
    least = max(step for step in steps if step == 0 or speed > step * (1 + world.tiny))
    return (world.mu_roll + world.mu_roll_speed * (least + mpmath.mpf(1) / 4)) * world.g, least


def segment(
    world: World, ball: int, start: Real, position: Vector, velocity: Vector, spin: Vector, noise: Real
) -> Segment:
    """Returns the motion of a ball that starts in a state; the state determines the phase. `noise`: see `Segment`."""
    zero = mpmath.mpf(0)
    still = (zero,) * len(velocity)
    airborne = world.flight and (position[2] > 0 or abs(velocity[2]) > noise)
    if not airborne:
        velocity = (*velocity[:2], *still[2:])
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
        deceleration, least = rolling_resistance(world, speed)
        acceleration = tuple(-deceleration * v / speed for v in velocity)
        return make("rolling", (speed - least) / deceleration, acceleration, (zero,) * 3, (zero,) * 3)

    if airborne:
        duration = (velocity[2] + mpmath.sqrt(velocity[2] ** 2 + 2 * world.g * position[2])) / world.g
        return make("airborne", duration, (zero, zero, -world.g), spin, (zero,) * 3)
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
            (ax, ay, *still[2:]),
            (spin[0], spin[1], wz),
            (turn * ay, -turn * ax, wz_rate),
        )
    if speed:
        deceleration, least = rolling_resistance(world, speed)
        a = tuple(-deceleration * v / speed for v in velocity)
        rolling = (-velocity[1] / radius, velocity[0] / radius, wz)
        return make("rolling", (speed - least) / deceleration, a, rolling, (-a[1] / radius, a[0] / radius, wz_rate))
    if wz:
        return make("spinning", abs(wz) / world.spin_decay, still, (zero, zero, wz), (zero, zero, wz_rate))
    return make("rest", None, still, (zero,) * 3, (zero,) * 3)


def next_phase(world: World, ball: int, old: Segment) -> tuple[str, Segment]:
    """Returns the event at the end of a segment and the segment that follows it.

    The event is "sliding_rolling", "rolling_rest", "rolling_slower", "spinning_rest" or "landing".
    """
    zero = mpmath.mpf(0)
    position, velocity, spin = (old.position_at(old.end), old.velocity_at(old.end), old.spin_at(old.end))
    noise = max(old.noise, world.tiny * norm(old.velocity))
    if old.phase == "airborne":
        noise = max(noise, world.tiny * world.radius[ball] * norm(spin))
        velocity, spin = land(world, ball, velocity, spin)
        return "landing", segment(world, ball, old.end, (*position[:2], zero), velocity, spin, noise)
    if old.phase == "spinning":
        spin = (zero,) * 3
    elif old.phase == "rolling" and rolling_resistance(world, norm(old.velocity))[1]:
        scale = rolling_resistance(world, norm(old.velocity))[1] / norm(velocity)
        velocity, spin = _scale(scale, velocity), (scale * spin[0], scale * spin[1], spin[2])
        return "rolling_slower", segment(world, ball, old.end, position, velocity, spin, noise)
    elif old.phase == "rolling":
        velocity, spin, noise = (zero,) * len(velocity), (zero, zero, spin[2]), zero
    else:
        radius = world.radius[ball]
        spin = (-velocity[1] / radius, velocity[0] / radius, spin[2])
    new = segment(world, ball, old.end, position, velocity, spin, noise)
    if old.phase == "spinning":
        return "spinning_rest", new
    return ("sliding_rolling" if new.phase == "rolling" else "rolling_rest"), new


def hit_fixed(
    world: World, ball: int, n: Vector, push: Real, mu: Real, velocity: Vector, spin: Vector
) -> tuple[Vector, Vector]:
    """Returns velocity and spin, (3,), after a fixed body with Coulomb friction.

    The mass is 1, the unit normal n, (3,), points into the body, and `push` is the normal impulse.
    """
    radius = world.radius[ball]
    surface = _sum(velocity, _scale(radius, _cross(spin, n)))
    slipping = _sum(surface, _scale(-dot(surface, n), n))
    impulse, speed = _scale(-push, n), norm(slipping)
    if speed:
        impulse = _sum(impulse, _scale(-min(mu * push / speed, mpmath.mpf(2) / 7), slipping))
    return _sum(velocity, impulse), _sum(spin, _scale(5 / (2 * radius), _cross(n, impulse)))


def land(world: World, ball: int, velocity: Vector, spin: Vector) -> tuple[Vector, Vector]:
    """Returns velocity and spin after the slate; the ball stays on it if its next hop would be lower than the least."""
    down, e = -velocity[2], world.e_slate
    push = down if (e * down) ** 2 < 2 * world.g * world.least_hop else (1 + e) * down
    return hit_fixed(world, ball, (mpmath.mpf(0), mpmath.mpf(0), mpmath.mpf(-1)), push, world.mu_slate, velocity, spin)


def hit_nose(world: World, ball: int, n: Vector, velocity: Vector, spin: Vector) -> tuple[Vector, Vector]:
    """Returns velocity and spin of a ball in the air after the nose of a cushion in the direction n, (3,)."""
    speed = dot(n, velocity)
    push = (1 + _restitution(world, speed)) * speed
    return hit_fixed(world, ball, n, push, world.mu_cushion, velocity, spin)


def bounce(world: World, ball: int, n: Vector, velocity: Vector, spin: Vector) -> tuple[Vector, Vector]:
    """Returns velocity and spin after a cushion with the normal n, (2,), which points into the cushion."""
    # (vn, vt) and (wn, wt) are the components along n and t = z x n.
    t = (-n[1], n[0])
    vn, vt = n[0] * velocity[0] + n[1] * velocity[1], t[0] * velocity[0] + t[1] * velocity[1]
    wn, wt, wz = n[0] * spin[0] + n[1] * spin[1], t[0] * spin[0] + t[1] * spin[1], spin[2]
    vn, vt, wn, wt, wz = CUSHIONS[world.cushion](world, ball, vn, vt, wn, wt, wz)
    level = n[0] * vn + t[0] * vt, n[1] * vn + t[1] * vt
    return (*level, *velocity[2:]), (n[0] * wn + t[0] * wt, n[1] * wn + t[1] * wt, wz)


def shares(v: Vector, n: Vector, m: Vector) -> Vector:
    """Returns the coefficients p and q of v = p n + q m, by Cramer's rule."""
    area = n[0] * m[1] - n[1] * m[0]
    return (v[0] * m[1] - v[1] * m[0]) / area, (n[0] * v[1] - n[1] * v[0]) / area


def bounce_both(
    world: World, ball: int, normals: tuple[Vector, Vector], velocity: Vector, spin: Vector, noise: Real
) -> tuple[Vector, Vector]:
    """Returns velocity and spin after two cushions at one instant, whose normals have the velocity between them.

    `bounce` acts on the share of the velocity along one normal and the rest is kept. It acts at the two cushions in
    turn, until neither has a share. The result is the mean over both orders. If it has more energy than before, it
    is the point with the same energy between the mean and a ball that stops and keeps its spin.
    """
    ends = []
    for order in (normals, normals[::-1]):
        v, w = velocity, spin
        for turn in range(2 * TURNS):
            n, share = order[turn % 2], shares(v, *order)[turn % 2]
            if share > noise:
                rest = _scale(dot(v, n) - share, n)
                v, w = bounce(world, ball, n, _sum(v, _scale(-1, rest)), w)
                v = _sum(v, rest)
        ends.append((*v, *_scale(world.radius[ball] * mpmath.sqrt(mpmath.mpf("0.4")), w)))  # energy: half the square
    mean = _scale(mpmath.mpf("0.5"), _sum(*ends))
    turning = _scale(world.radius[ball] * mpmath.sqrt(mpmath.mpf("0.4")), spin)
    stopped = (mpmath.mpf(0), mpmath.mpf(0), *turning)
    way, excess = _sum(mean, _scale(-1, stopped)), dot(mean, mean) - dot((*velocity, *turning), (*velocity, *turning))
    if excess > noise * noise:
        # The larger root x of |stopped + x way|^2 = |before|^2
        slope, square = dot(stopped, way), dot(way, way)
        mean = _sum(stopped, _scale((mpmath.sqrt(slope**2 + square * dot(velocity, velocity)) - slope) / square, way))
    return mean[:2], _scale(1 / (world.radius[ball] * mpmath.sqrt(mpmath.mpf("0.4"))), mean[2:])


def _restitution(world: World, speed: Real) -> Real:
    """Returns the restitution of a cushion at a normal speed."""
    loss = world.e_cushion_loss * max(mpmath.mpf(0), speed - world.e_cushion_onset)
    return max(world.e_cushion_floor, world.e_cushion - loss)


def _smooth(world: World, ball: int, vx: Real, vy: Real, wx: Real, wy: Real, wz: Real) -> Vector:
    """Returns the state after a cushion without friction."""
    return (-_restitution(world, vx) * vx, vy, wx, wy, wz)


def _han(world: World, ball: int, vx: Real, vy: Real, wx: Real, wy: Real, wz: Real, reversed_share: Real = 0) -> Vector:
    """Returns the state after a cushion by Han (2005), Dynamics in Carom and Three Cushion Billiards.

    The mass is 1, and x points into the cushion. Friction that is large enough stops the slip up or
    down the nose and reverses `reversed_share` of the slip along the cushion.
    """
    radius = world.radius[ball]
    sin = world.cushion_height / radius - 1
    cos = mpmath.sqrt(1 - sin * sin)
    sx = vx * sin + radius * wy
    sy = (1 + reversed_share) * (-vy - radius * wz * cos + radius * wx * sin)
    slipping = norm((sx, sy))

    def friction(normal: Real) -> Vector:
        stops = 2 / mpmath.mpf(7)
        if stops * slipping <= world.mu_cushion * normal:
            return stops * sx, stops * sy
        return tuple(world.mu_cushion * normal * s / slipping for s in (sx, sy))

    normal = (1 + _restitution(world, vx)) * vx * cos
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


def _han_variable(world: World, ball: int, vx: Real, vy: Real, wx: Real, wy: Real, wz: Real) -> Vector:
    """Returns the state after a cushion as `_han`, whose restitution depends on the motion before."""
    zero, one = mpmath.mpf(0), mpmath.mpf(1)
    radius, sin = world.radius[ball], world.cushion_height / world.radius[ball] - 1
    cos = mpmath.sqrt(1 - sin * sin)
    square = (vx * sin + radius * wy) ** 2 + (vy + radius * (wz * cos - wx * sin)) ** 2
    gain = world.e_cushion_topspin * sorted((zero, radius * wy / vx, one))[1]
    gain += world.e_cushion_slip * square / (square + vx**2)
    e = min(one, _restitution(world, vx) + gain)
    same = dataclasses.replace(world, e_cushion=e, e_cushion_loss=zero, e_cushion_floor=zero)
    return _han(same, ball, vx, vy, wx, wy, wz, world.e_cushion_tangent)


def _stronge(world: World, ball: int, vx: Real, vy: Real, wx: Real, wy: Real, wz: Real) -> Vector:
    """Returns the state after a compliant cushion by Stronge (2000), Impact Mechanics, chapter 5.

    The mass is 1, x points into the cushion, and z up.
    """
    radius, mu, e = world.radius[ball], world.mu_cushion, _restitution(world, vx)
    sin = world.cushion_height / radius - 1
    cos = mpmath.sqrt(1 - sin * sin)
    toward, up, side = (cos, mpmath.mpf(0), sin), (-sin, mpmath.mpf(0), cos), (0, 1, 0)  # of the point of contact
    velocity, spin = (vx, vy, mpmath.mpf(0)), (wx, wy, wz)
    surface = _sum(velocity, _scale(radius, _cross(spin, toward)))
    slip = dot(surface, up), dot(surface, side)
    speed, normal = norm(slip), dot(surface, toward)
    impulse = _scale(-(1 + e) * normal, toward)
    if speed > 0:
        friction = (_compliant(speed / (mu * normal), e, world) * mu * normal + speed) / mpmath.mpf("3.5") if mu else 0
        for size, tangent in zip(slip, (up, side), strict=True):
            impulse = _sum(impulse, _scale(-friction * size / speed, tangent))
    spin = _sum(spin, _scale(5 / (2 * radius), _cross(toward, impulse)))
    return (min(vx + impulse[0], mpmath.mpf(0)), vy + impulse[1], *spin)


def _compliant(x: Real, e: Real, world: World) -> Real:
    """Returns the tangential velocity after a compliant impact with the tangential velocity -x, in units of mu v_n.

    The duration of the compression is pi / 2, and beta, the ratio of the inverse masses, is 7/2.
    """
    pi, omega, beta = mpmath.pi, world.cushion_frequency_ratio, mpmath.mpf("3.5")
    eta = beta / omega**2
    if x > (1 + e) * beta - eta / e:
        return beta * (1 + e) - x

    def psi(t: Real) -> Real:
        return t / e + pi / 2 * (1 - 1 / e)

    start, stretch, velocity = mpmath.mpf(0), mpmath.mpf(0), -x
    if x > beta:
        phase = mpmath.acos((x - beta) / (eta / e - e * beta))
        start = e * (phase - pi / 2 * (1 - 1 / e))
        stretch, velocity = eta * mpmath.sin(phase), -x + beta * (1 - e * mpmath.cos(phase))
    elif x > eta:
        start = mpmath.acos((x - beta) / (eta - beta))
        stretch, velocity = eta * mpmath.sin(start), -x + beta * (1 - mpmath.cos(start))

    def excess(t: Real) -> Real:
        angle = omega * (t - start)
        return abs(stretch * mpmath.cos(angle) - velocity / omega * mpmath.sin(angle)) - eta * mpmath.sin(psi(t))

    low, high = max(pi / 2, start), (1 + e) * pi / 2
    for _ in range(4 * mpmath.mp.dps):  # at the start of a stick the excess is zero, and then negative
        middle = (low + high) / 2
        low, high = (low, middle) if excess(middle) > 0 else (middle, high)
    angle = omega * (high - start)
    held = omega * stretch * mpmath.sin(angle) + velocity * mpmath.cos(angle)
    return held - beta * e * (1 + mpmath.cos(psi(high)))


def _mathavan(world: World, ball: int, vx: Real, vy: Real, wx: Real, wy: Real, wz: Real) -> Vector:
    """Returns the state after a cushion by Mathavan, Jackson and Parkin (2010); see `oracle.mathavan`."""
    radius = world.radius[ball]
    sin = world.cushion_height / radius - 1
    nose = Nose(sin, mpmath.sqrt(1 - sin * sin), world.mu_cushion, world.mu_slide)
    before = -vy, vx, -radius * wy, radius * wx, radius * wz
    along, into, wt, wn, wz = impact(before, nose, _restitution(world, vx))
    return into, -along, wn / radius, -wt / radius, wz / radius


CUSHIONS = {
    "restitution": _smooth,
    "han2005": _han,
    "han2005_variable": _han_variable,
    "stronge": _stronge,
    "mathavan2010": _mathavan,
}
"""The laws of cushions: functions of the world, the ball, (vx, vy) and (wx, wy, wz); x points into the cushion."""


def _constant(world: World, speed: Real) -> Real:
    """Returns a restitution that does not depend on the speed of approach."""
    return world.e_ball


def _falling(world: World, speed: Real) -> Real:
    """Returns a friction that falls exponentially with the sliding speed."""
    a, b, c = world.ball_friction
    return a + b * mpmath.exp(-c * speed)


BALL_LAWS = {"frictionless": (_constant, None), "frictional": (_constant, _falling)}
"""The laws of two balls: the restitution by the speed of approach, and the friction by the sliding speed or None."""


def _sum(a: Vector, b: Vector) -> Vector:
    return tuple(x + y for x, y in zip(a, b, strict=True))


def _scale(factor: Real, a: Vector) -> Vector:
    return tuple(factor * x for x in a)


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def collide(
    world: World,
    positions: dict[int, Vector],
    velocities: dict[int, Vector],
    spins: dict[int, Vector],
    contacts: Sequence[tuple[int, int]],
    noise: Real,
) -> tuple[dict[int, Vector], dict[int, Vector], list[tuple[int, int]]]:
    """Returns the velocities and spins after the impacts of one instant.

    All approaching contacts get one joint impulse, the generalised reflection of Smith, Kaufman, Vouga, Tamstorf and
    Grinspun (2012) with restitution, and then their friction. This is repeated until no contact approaches. All have
    the restitution at the largest speed of approach.

    Args:
        world: The constants.
        positions: m, of each ball in contact.
        velocities: m/s, of each before the impacts.
        spins: (3,) rad/s of each before the impacts.
        contacts: Pairs (i, j) of touching balls.
        noise: m/s; a slower approach does not count.

    Returns:
        The velocities and spins after the impacts, and the pairs with an impulse in their order.

    Raises:
        TooManyRoundsError: If contacts still approach after `ROUNDS` joint impulses.
    """
    velocities, spins = dict(velocities), dict(spins)
    restitution, friction = BALL_LAWS[world.ball_ball]
    hits: list[tuple[int, int]] = []
    normals = {}
    for i, j in contacts:
        d = world.offset(i, j, positions[i], positions[j])
        normals[i, j] = tuple(x / norm(d) for x in d)

    def rate(pair: tuple[int, int]) -> Real:
        i, j = pair
        return dot(normals[pair], minus(velocities[j], velocities[i]))

    for _ in range(ROUNDS):
        due = [pair for pair in contacts if rate(pair) < -noise]
        if not due:
            return velocities, spins, hits
        rates = [rate(pair) for pair in due]
        coupling = [[_coupling(world, p, q, normals) for q in due] for p in due]
        impulses, e = plastic_impulses(coupling, rates, noise), restitution(world, -min(rates))
        for (i, j), impulse in zip(due, impulses, strict=True):
            if impulse == 0:
                continue
            hits.append((i, j))
            for ball, sign in ((i, -1), (j, 1)):
                change = sign * (1 + e) * impulse * world.inverse_mass[ball]
                velocities[ball] = _sum(velocities[ball], _scale(change, normals[i, j]))
        if friction:
            pressing = {pair: (1 + e) * p for pair, p in zip(due, impulses, strict=True) if p > 0}
            _rub(world, friction, pressing, normals, velocities, spins)
    raise TooManyRoundsError


def _rub(
    world: World,
    friction: Callable[[World, Real], Real],
    pressing: dict[tuple[int, int], Real],
    normals: dict[tuple[int, int], Vector],
    velocities: dict[int, Vector],
    spins: dict[int, Vector],
) -> None:
    """Applies the friction of contacts with given normal impulses, in place: horizontal ones without flight.

    The impulses minimise the kinetic energy. They are found one after the other, again and again: that of one contact,
    for given others, is the one that stops its slip or the limit of Coulomb friction in the same direction.
    """
    zero = mpmath.mpf(0)
    balls = {ball for pair in pressing for ball in pair}
    v, w = {k: (*velocities[k], zero)[:3] for k in balls}, {k: spins[k] for k in balls}
    push = dict.fromkeys(pressing, (zero,) * 3)
    normal = {}
    for pair in pressing:  # from centre to centre, in three dimensions
        line = (*_scale(world.reach(*pair), normals[pair]), world.rise(*pair))[:3]
        normal[pair] = _scale(1 / norm(line), line)

    def slip_at(pair: tuple[int, int]) -> Vector:
        i, j = pair
        turning = _sum(_scale(world.radius[i], w[i]), _scale(world.radius[j], w[j]))
        u = _sum(_sum(v[i], _scale(-1, v[j])), _cross(turning, normal[pair]))
        return _sum(u, _scale(-dot(u, normal[pair]), normal[pair]))

    speeds = {pair: norm(slip_at(pair)) for pair in pressing}
    limit = {}
    for pair, push_along in pressing.items():
        limit[pair] = friction(world, speeds[pair]) * push_along / norm(normal[pair][: len(normals[pair])])
    done = mpmath.mpf(10) ** (10 - mpmath.mp.dps) * max(speeds.values())
    for _ in range(ROUNDS):
        largest = zero
        for pair in pressing:
            mobility = mpmath.mpf("3.5") * sum(world.inverse_mass[k] for k in pair)
            new = _sum(push[pair], _scale(-1 / mobility, slip_at(pair)))
            if norm(new) > limit[pair]:
                new = _scale(limit[pair] / norm(new), new)
            change = _sum(new, _scale(-1, push[pair]))
            push[pair] = new
            largest = max(largest, norm(change) * mobility)
            for k, sign in zip(pair, (1, -1), strict=True):
                v[k] = _sum(v[k], _scale(sign * world.inverse_mass[k], change))
                turn = 5 * world.inverse_mass[k] / (2 * world.radius[k])
                w[k] = _sum(w[k], _scale(turn, _cross(normal[pair], change)))
        if largest <= done:
            break
    else:
        raise TooManyRoundsError
    for k in balls:
        velocities[k], spins[k] = v[k][: len(velocities[k])], w[k]


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
