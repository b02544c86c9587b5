"""The event loop: one shot from event to event until every ball rests."""

from __future__ import annotations

import dataclasses
import heapq
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

import mpmath
from numpy.typing import NDArray

from billiards_env.scene import CONTACT_GAP, Scene, check_positions
from reference.oracle import contact, laws
from reference.oracle.laws import Segment, Vector, World
from reference.oracle.roots import Real

Rows: TypeAlias = "Sequence[Any] | NDArray[Any]"

GUARD_DIGITS = 20
"""Working digits beyond those asked for."""

POCKET, BALL, CUSHION_X, CUSHION_Y, PHASE, RESTING = range(6)
"""What may come next; at one instant in this order."""

_ROUNDS = 100_000  # so many events without time going on are a collapse


class Event(NamedTuple):
    """What happened when, and to which ball.

    `other` is the other ball, the cushion (0 is -x, 1 +x, 2 -y, 3 +y), the pocket, or -1. `kind` is "ball_ball",
    "cushion", "pocket", "sliding_rolling" (the ball stops sliding), "rolling_rest" (friction has stopped it) or
    "spinning_rest" (friction has stopped the spin of a ball that stands still).
    """

    time: Real
    kind: str
    ball: int
    other: int


@dataclasses.dataclass(frozen=True)
class OracleShot:
    """What became of a shot. All numbers are mpf; convert with `float`, or compute with them in `mpmath.workdps`.

    Attributes:
        events: The events in the order in which they happened.
        positions, velocities, spins: (n, 2) m, (n, 2) m/s, (n, 3) rad/s at the end. A potted ball is at its pocket.
        potted: (n,) bool.
        time: s, of the last event, or the time limit.
        status: "rest", "max_time", "event_limit", "stopped" (by `stop_after`) or "resting_contact" or "collapse", on
            the partial shot of an error.
        segments: The pieces of each ball's motion.
        digits: Decimal digits asked for.
    """

    events: list[Event]
    positions: list[Vector]
    velocities: list[Vector]
    spins: list[Vector]
    potted: list[bool]
    time: Real
    status: str
    segments: list[list[Segment]]
    digits: int

    def positions_at(self, time: Real) -> list[Vector]:
        """(n, 2) m at a time; at an event, after it, and from the shot's end on, as then."""
        return [segment.position_at(t) for segment, t in self._segments_at(time)]

    def velocities_at(self, time: Real) -> list[Vector]:
        """(n, 2) m/s at a time, as above."""
        return [segment.velocity_at(t) for segment, t in self._segments_at(time)]

    def spins_at(self, time: Real) -> list[Vector]:
        """(n, 3) rad/s at a time, as above."""
        return [segment.spin_at(t) for segment, t in self._segments_at(time)]

    def _segments_at(self, time: Real) -> Iterable[tuple[Segment, Real]]:
        with mpmath.workdps(self.digits + GUARD_DIGITS):
            if not time >= 0:
                raise ValueError(f"time = {time!r}: expected a time from 0 s on")
            t = min(mpmath.mpf(time), self.time)
            for pieces in self.segments:
                yield next(piece for piece in reversed(pieces) if piece.start <= t), t


class OracleError(RuntimeError):
    """The laws do not say how the shot goes on; `shot` holds it up to that point."""

    def __init__(self, message: str, shot: OracleShot) -> None:
        super().__init__(message)
        self.shot = shot


class RestingContactError(OracleError):
    """Two bodies in contact press against each other with no normal velocity."""


class CollapseError(OracleError):
    """Impacts follow each other without end at one instant."""


def run(
    scene: Scene,
    positions: Rows,
    velocities: Rows,
    spins: Rows | None = None,
    max_time: float | None = None,
    max_events: int | None = None,
    stop_after: int | None = None,
    digits: int = 50,
) -> OracleShot:
    """Runs a shot.

    Args:
        scene: The scene.
        positions: (n, 2) m, floats (taken exactly) or mpf numbers, as are the next two.
        velocities: (n, 2) m/s, or (2,): the cue ball's.
        spins: (n, 3) rad/s, or (3,): the cue ball's; none by default. Only "sliding" motion heeds them.
        max_time: The shot ends after so many seconds; the scene's own limit by default.
        max_events: It ends after so many events.
        stop_after: It ends after so many ball-ball impacts.
        digits: Decimal digits; `GUARD_DIGITS` more are carried. A collision multiplies an error by ten and more, so a
            long shot needs as many digits more as it has collisions one after another.

    Returns:
        The shot.

    Raises:
        ValueError: If the input does not suit the scene.
        RestingContactError: If two bodies press against each other without normal velocity.
        CollapseError: If impacts follow each other without end at one instant.
    """
    check_positions(scene, [[float(x) for x in row] for row in positions])
    with mpmath.workdps(digits + GUARD_DIGITS):
        limit = scene.physics.max_time if max_time is None else max_time
        table = _Table(
            scene,
            _rows("positions", positions, scene.n_balls, 2),
            _rows("velocities", velocities, scene.n_balls, 2),
            _rows("spins", () if spins is None else spins, scene.n_balls, 3),
            mpmath.inf if limit is None else mpmath.mpf(limit),
            digits,
        )
        return table.play(
            math.inf if max_events is None else max_events, math.inf if stop_after is None else stop_after
        )


def _rows(name: str, values: Rows, n: int, width: int) -> list[Vector]:
    """(n, width) mpf; one row alone is the cue ball's, the others are zero."""
    rows = list(values)
    if len(rows) == width and not hasattr(rows[0], "__len__"):
        rows = [rows]
    if name != "positions" and len(rows) <= 1:
        rows += [[0.0] * width] * (n - len(rows))
    if len(rows) != n or any(len(row) != width for row in rows):
        raise ValueError(f"{name} = {values!r}: expected ({n}, {width}), a row a ball")
    vectors = [tuple(x + 0 if isinstance(x, mpmath.mpf) else mpmath.mpf(float(x)) for x in row) for row in rows]
    if not all(mpmath.isfinite(x) for row in vectors for x in row):
        raise ValueError(f"{name} = {values!r}: expected finite numbers")
    return vectors


class _Prediction(NamedTuple):
    """A contact or phase change to come, void once a ball has been given another segment.

    A bound says that nothing happens before its time; it is solved for only when it comes to the top of the queue.
    """

    time: Real
    order: int  # of being made; it settles ties in the queue
    kind: int
    ball: int
    other: int
    versions: tuple[int, int | None]  # of the ball and, if there is one, of the other ball
    base: Real | None  # of a bound: where its interval starts


class _Table:
    """The state of a shot: each ball's current segment, and a queue of what may come next."""

    def __init__(
        self,
        scene: Scene,
        positions: list[Vector],
        velocities: list[Vector],
        spins: list[Vector],
        max_time: Real,
        digits: int,
    ) -> None:
        self.world = World.of(scene, digits)
        self.digits = digits
        self.max_time = max_time
        self.now = mpmath.mpf(0)
        self.events: list[Event] = []
        self.impacts = 0
        self.versions = [0] * scene.n_balls
        self.queue: list[_Prediction] = []
        self.order = itertools.count()
        self.radius = scene.balls.radius
        self.room = [tuple(map(float, room)) for room in self.world.room]
        self.pockets = [(p.x, p.y, p.radius) for p in scene.table.pockets]
        for i, inverse_mass in enumerate(self.world.inverse_mass):
            if not inverse_mass and any((*velocities[i], *spins[i])):
                raise ValueError(f"velocities[{i}] = {velocities[i]}: expected zero, ball {i} has infinite mass")
        self.segments = [
            [laws.segment(self.world, i, self.now, positions[i], velocities[i], spins[i], mpmath.mpf(0))]
            for i in range(scene.n_balls)
        ]
        self.current = [pieces[-1] for pieces in self.segments]
        self.lasts = [self.last(i) for i in range(scene.n_balls)]
        self.predict(range(scene.n_balls))

    def play(self, max_events: float, stop_after: float) -> OracleShot:
        """Goes from event to event until the shot ends."""
        standstill = 0
        while True:
            if len(self.events) >= max_events:
                return self.shot("event_limit")
            if self.impacts >= stop_after:
                return self.shot("stopped")
            event = self.next_event()
            if event is None and not any(segment.moving for segment in self.current):
                return self.shot("rest")
            if event is None or event.time > self.max_time:
                self.now = self.max_time
                return self.shot("max_time")
            standstill = 0 if event.time > self.now else standstill + 1
            self.now = max(self.now, event.time)
            if standstill > _ROUNDS:
                raise CollapseError(f"no end of impacts at {float(self.now)} s", self.shot("collapse"))
            self.process(event)

    def shot(self, status: str) -> OracleShot:
        """The result, as of now."""
        return OracleShot(
            self.events,
            [segment.position_at(self.now) for segment in self.current],
            [segment.velocity_at(self.now) for segment in self.current],
            [segment.spin_at(self.now) for segment in self.current],
            [segment.phase == "potted" for segment in self.current],
            self.now,
            status,
            self.segments,
            self.digits,
        )

    # What comes next

    def predict(self, balls: Iterable[int]) -> None:
        """Queues whatever may happen to balls that have just been given a new segment."""
        balls = list(balls)
        motions = {}
        for i, segment in enumerate(self.current):
            if segment.phase != "potted":
                motions[i] = contact.FloatMotion(segment, self.now)
        done = set()
        for i in balls:
            segment = self.current[i]
            if segment.phase == "potted":
                continue
            done.add(i)
            if segment.end is not None:
                self.push(segment.end, PHASE, i)
            for j, motion in motions.items():
                if j not in done and (segment.moving or self.current[j].moving):
                    a, b = min(i, j), max(i, j)
                    high = self.horizon(a, b)
                    reach = self.radius[i] + self.radius[j]
                    self.push_bound(BALL, a, b, contact.possible_pair_contact(motions[i], motion, reach, high))
            if segment.moving:
                high = self.horizon(i)
                for side in range(4):
                    bound = contact.possible_wall_contact(motions[i], side, self.room[i][side // 2], high)
                    self.push_bound(CUSHION_X if side < 2 else CUSHION_Y, i, side, bound)
                for k, pocket in enumerate(self.pockets):
                    self.push_bound(POCKET, i, k, contact.possible_pocket_contact(motions[i], pocket, high))

    def last(self, ball: int) -> Real:
        """When a ball's segment ends; a free ball's once it would have crossed the table."""
        segment = self.current[ball]
        if segment.phase != "free":
            return mpmath.inf if segment.end is None else segment.end
        room = self.world.room[ball]
        return segment.start + min((2 * r + 1) / abs(v) for r, v in zip(room, segment.velocity, strict=True) if v)

    def end(self, *balls: int) -> Real:
        """When the first of the balls' segments ends, or the shot."""
        return min(self.max_time, *(self.lasts[i] for i in balls))

    def horizon(self, *balls: int) -> float:
        """At least the seconds from now to `end`."""
        return float(self.end(*balls) - self.now) * (1 + 1e-9)

    def push(self, time: Real, kind: int, ball: int, other: int = -1, base: Real | None = None) -> None:
        """Queues a prediction."""
        versions = self.versions[ball], self.versions[other] if kind == BALL else None
        heapq.heappush(self.queue, _Prediction(time, next(self.order), kind, ball, other, versions, base))

    def push_bound(self, kind: int, ball: int, other: int, delay: float | None) -> None:
        """Queues what cannot happen within `delay` seconds, or at all if that is None."""
        if delay is not None:
            self.push(self.now + delay * (1 - 1e-9), kind, ball, other, self.now)

    def is_void(self, p: _Prediction) -> bool:
        """Whether a ball has been given another segment since."""
        ball, other = p.versions
        return ball != self.versions[p.ball] or (other is not None and other != self.versions[p.other])

    def next_event(self) -> _Prediction | None:
        """Takes the earliest prediction from the queue; of those at one instant the first by kind and ball."""
        due: list[_Prediction] = []
        while self.queue and (not due or self.queue[0].time <= due[0].time * (1 + self.world.tiny)):
            p = heapq.heappop(self.queue)
            if self.is_void(p):
                continue
            if p.base is None:
                due.append(p)
            else:
                self.solve(p, p.base)
        if not due:
            return None
        first = min(due, key=lambda p: (p.kind, p.ball, p.other))
        for p in due:
            if p is not first:
                heapq.heappush(self.queue, p)
        return first

    def solve(self, p: _Prediction, base: Real) -> None:
        """Replaces a bound by the event itself, if there is one."""
        world, a = self.world, self.current[p.ball]
        if p.kind == BALL:
            high = self.end(p.ball, p.other) - base
            found = contact.pair_contact(world, p.ball, a, p.other, self.current[p.other], base, high)
        elif p.kind == POCKET:
            found = contact.pocket_contact(world, p.ball, a, p.other, base, self.end(p.ball) - base)
        else:
            found = contact.wall_contact(world, p.ball, a, p.other, base, self.end(p.ball) - base)
        if found is not None:
            delay, resting = found
            kind = RESTING if resting else p.kind
            heapq.heappush(self.queue, p._replace(time=base + delay, kind=kind, base=None))

    # What happens

    def process(self, p: _Prediction) -> None:
        """Applies an event."""
        i = p.ball
        segment = self.current[i]
        if p.kind == RESTING:
            raise RestingContactError(
                f"ball {i} presses against body {p.other} at {float(self.now)} s", self.shot("resting_contact")
            )
        if p.kind == BALL:
            self.collide(i, p.other)
        elif p.kind == PHASE:
            kind, after = laws.next_phase(self.world, i, segment)
            self.log(kind, i)
            self.replace({i: after})
        elif p.kind == POCKET:
            self.log("pocket", i, p.other)
            zero = mpmath.mpf(0)
            still, center = (zero, zero), self.world.pockets[p.other][:2]
            self.replace({i: Segment("potted", self.now, None, center, still, still, (zero,) * 3, (zero,) * 3, zero)})
        else:
            self.log("cushion", i, p.other)
            position, velocity = segment.position_at(self.now), segment.velocity_at(self.now)
            spin = segment.spin_at(self.now)
            noise = max(segment.noise, self.world.tiny * self.surface_speed(i))
            velocity, spin = laws.bounce(self.world, i, p.other, velocity, spin)
            self.replace({i: laws.segment(self.world, i, self.now, position, velocity, spin, noise)})

    def log(self, kind: str, ball: int, other: int = -1) -> None:
        """Adds an event now."""
        self.events.append(Event(self.now, kind, ball, other))

    def replace(self, segments: dict[int, Segment]) -> None:
        """Gives balls a new segment each."""
        for i, segment in segments.items():
            self.versions[i] += 1
            self.segments[i].append(segment)
            self.current[i] = segment
            self.lasts[i] = self.last(i)
        self.predict(segments)

    def surface_speed(self, ball: int) -> Real:
        """A bound for the speed of every point of a ball, m/s."""
        segment = self.current[ball]
        return laws.norm(segment.velocity_at(self.now)) + self.world.radius[ball] * laws.norm(segment.spin_at(self.now))

    def collide(self, i: int, j: int) -> None:
        """The impact of two balls and of all others that they touch, directly or through each other."""
        contacts = self.touching(i, j)
        balls = sorted({ball for pair in contacts for ball in pair})
        positions = {k: self.current[k].position_at(self.now) for k in balls}
        before = {k: self.current[k].velocity_at(self.now) for k in balls}
        noise = max(
            *(self.current[k].noise for k in balls), self.world.tiny * max(self.surface_speed(k) for k in balls)
        )
        try:
            after, hits = laws.collide(self.world, positions, before, contacts, noise)
        except laws.TooManyRoundsError as error:
            raise CollapseError(
                f"no end of impacts among balls {balls} at {float(self.now)} s", self.shot("collapse")
            ) from error
        for a, b in hits:
            self.log("ball_ball", a, b)
        self.impacts += len(hits)
        # Contacts that only just approach, by less than the rounding of a faster ball, are left without an impulse;
        # their balls still get a segment with that noise, so that they are not found again.
        changed = {ball for pair in hits for ball in pair} | {i, j}
        spins = {k: self.current[k].spin_at(self.now) for k in changed}
        self.replace(
            {k: laws.segment(self.world, k, self.now, positions[k], after[k], spins[k], noise) for k in sorted(changed)}
        )

    def touching(self, i: int, j: int) -> list[tuple[int, int]]:
        """Pairs of touching balls, of which a chain leads to balls i and j."""
        motions = {
            k: contact.FloatMotion(segment, self.now)
            for k, segment in enumerate(self.current)
            if segment.phase != "potted"
        }
        pairs, seen, frontier = {(i, j)}, {i, j}, [i, j]
        while frontier:
            a = frontier.pop()
            for b, motion in motions.items():
                pair = (min(a, b), max(a, b))
                if b == a or pair in pairs:
                    continue
                reach = self.radius[a] + self.radius[b]
                if math.dist(motions[a].position, motion.position) > reach * (1 + 1e-9) + 1e-9:
                    continue
                offset = tuple(
                    q - p
                    for p, q in zip(
                        self.current[a].position_at(self.now), self.current[b].position_at(self.now), strict=True
                    )
                )
                if laws.norm(offset) - self.world.radius[a] - self.world.radius[b] <= CONTACT_GAP:
                    pairs.add(pair)
                    if b not in seen:
                        seen.add(b)
                        frontier.append(b)
        return sorted(pairs)
