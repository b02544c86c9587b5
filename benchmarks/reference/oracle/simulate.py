"""The event loop: runs one shot from event to event until every ball rests."""

from __future__ import annotations

import dataclasses
import heapq
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

import mpmath
import numpy as np
from numpy.typing import NDArray

from benchmarks.reference.oracle import contact, laws
from benchmarks.reference.oracle.laws import Segment, Vector, World
from benchmarks.reference.oracle.outline import Arc, dot, in_floats, minus, normal_at
from benchmarks.reference.oracle.roots import Real
from billiards_env.scene import CONTACT_GAP, Scene, check_positions

Rows: TypeAlias = "Sequence[Any] | NDArray[Any]"

GUARD_DIGITS = 20
"""Working digits in addition to the requested ones."""

POCKET, BALL, CUSHION, PHASE, RESTING, EDGE = range(6)
"""The kinds of predictions, in their order at one instant."""

JOINT = 1e-10
"""m. Pieces of an outline that touch a ball at points which are nearer to each other count as one cushion."""

_ROUNDS = 100_000  # the number of events at one instant that counts as a collapse


class Event(NamedTuple):
    """An event of a shot.

    `other` is the other ball, the cushion (see `oracle.outline`), the pocket, or -1. `kind` is "ball_ball",
    "cushion", "pocket", "sliding_rolling" (the ball stops sliding), "rolling_rest" (friction has stopped it),
    "spinning_rest" (friction has stopped the spin of a ball that stands still), "landing" or "off_table".
    """

    time: Real
    kind: str
    ball: int
    other: int


@dataclasses.dataclass(frozen=True)
class OracleShot:
    """The result of a shot. All numbers are mpf; convert them with `float`, or compute in `mpmath.workdps`.

    Attributes:
        events: The events in the order of time.
        positions, velocities, spins: (n, 2) m, (n, 2) m/s, (n, 3) rad/s at the end; the first two are (n, 3) in scenes
            with flight. A potted ball is at its pocket.
        potted: (n,) bool.
        time: The time of the last event, or the time limit, s.
        status: "rest", "max_time", "event_limit", "stopped" (by `stop_after`), or "resting_contact" or "collapse" for
            the incomplete shot of an error.
        segments: The segments of each ball's motion.
        digits: The requested decimal digits.
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
        """Returns the positions after the events at a time, (n, 2) m; after the shot they are constant."""
        return [segment.position_at(t) for segment, t in self._segments_at(time)]

    def velocities_at(self, time: Real) -> list[Vector]:
        """Returns the velocities at a time, (n, 2) m/s."""
        return [segment.velocity_at(t) for segment, t in self._segments_at(time)]

    def spins_at(self, time: Real) -> list[Vector]:
        """Returns the spins at a time, (n, 3) rad/s."""
        return [segment.spin_at(t) for segment, t in self._segments_at(time)]

    def _segments_at(self, time: Real) -> Iterable[tuple[Segment, Real]]:
        with mpmath.workdps(self.digits + GUARD_DIGITS):
            if not time >= 0:
                raise ValueError(f"time = {time!r}: expected a time >= 0 s")
            t = min(mpmath.mpf(time), self.time)
            for pieces in self.segments:
                yield next(piece for piece in reversed(pieces) if piece.start <= t), t


class OracleError(RuntimeError):
    """The laws do not determine the rest of the shot; `shot` is the shot up to this time."""

    def __init__(self, message: str, shot: OracleShot) -> None:
        super().__init__(message)
        self.shot = shot


class RestingContactError(OracleError):
    """Two bodies in contact press against each other with no normal velocity."""


class CollapseError(OracleError):
    """The impacts at one instant have no end."""


def reference_shot(
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
        positions: (n, 2) m. These and the next two are floats, which are converted exactly, or mpf numbers.
        velocities: (n, 2) m/s, or (2,) for the cue ball. In scenes with flight, rows of these two may have a height.
        spins: (n, 3) rad/s, or (3,) for the cue ball; zero by default. Only "sliding" motion uses them.
        max_time: The largest duration of the shot, s; the limit of the scene by default.
        max_events: The largest number of events.
        stop_after: The number of ball-ball impacts after which the shot stops.
        digits: Decimal digits; the computation uses `GUARD_DIGITS` more. A collision multiplies an error by ten or
            more, so a long shot needs one more digit for each collision of a sequence.

    Returns:
        The shot.

    Raises:
        ValueError: If the input does not fit the scene.
        RestingContactError: If two bodies press against each other without normal velocity.
        CollapseError: If the impacts at one instant have no end.
    """
    on_cloth = np.array([not any(row[2:]) for row in positions])  # the engine checks the others
    check_positions(scene, [[float(x) for x in row[:2]] for row in positions], in_play=on_cloth)
    widths = (2, 3) if scene.physics.flight else (2,)
    with mpmath.workdps(digits + GUARD_DIGITS):
        limit = scene.physics.max_time if max_time is None else max_time
        table = _Table(
            scene,
            _rows("positions", positions, scene.n_balls, *widths),
            _rows("velocities", velocities, scene.n_balls, *widths),
            _rows("spins", () if spins is None else spins, scene.n_balls, 3),
            mpmath.inf if limit is None else mpmath.mpf(limit),
            digits,
        )
        return table.run(math.inf if max_events is None else max_events, math.inf if stop_after is None else stop_after)


def _rows(name: str, values: Rows, n: int, *widths: int) -> list[Vector]:
    """Returns (n, max(widths)) mpf; a single row is the row of the cue ball, and what is missing is zero."""
    rows, width = list(values), max(widths)
    if len(rows) in widths and not hasattr(rows[0], "__len__"):
        rows = [rows]
    if name != "positions" and len(rows) <= 1:
        rows += [[0.0] * width] * (n - len(rows))
    if len(rows) != n or any(len(row) not in widths for row in rows):
        raise ValueError(f"{name} = {values!r}: expected ({n}, {width}), a row for each ball")
    rows = [[*row, *[0.0] * (width - len(row))] for row in rows]
    vectors = [tuple(x + 0 if isinstance(x, mpmath.mpf) else mpmath.mpf(float(x)) for x in row) for row in rows]
    if not all(mpmath.isfinite(x) for row in vectors for x in row):
        raise ValueError(f"{name} = {values!r}: expected finite numbers")
    return vectors


class _Prediction(NamedTuple):
    """A future contact or phase change. It is void if one of its balls has a newer segment.

    A bound is a time before which the contact cannot occur. The contact is computed when the bound is first in the
    queue.
    """

    time: Real
    order: int  # of creation; it decides ties in the queue
    kind: int
    ball: int
    other: int
    versions: tuple[int, int | None]  # of the ball and of the other ball, if there is one
    base: Real | None  # the start of the interval of a bound


class _Table:
    """The state of a shot: the current segment of each ball, and a queue of predictions."""

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
        n = scene.n_balls
        self.reach = [[float(self.world.reach(i, j)) for j in range(n)] for i in range(n)]
        self.walls = [in_floats(wall) for wall in self.world.walls]
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

    def run(self, max_events: float, stop_after: float) -> OracleShot:
        """Runs from event to event until the shot ends."""
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
                raise CollapseError(f"endless impacts at {float(self.now)} s", self.shot("collapse"))
            self.process(event)

    def shot(self, status: str) -> OracleShot:
        """Returns the result at the current time."""
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

    # Predictions

    def predict(self, balls: Iterable[int]) -> None:
        """Queues the predictions of balls with new segments."""
        motions, done = self.motions(), set()
        for i in balls:
            segment = self.current[i]
            if i not in motions:
                continue
            done.add(i)
            if segment.end is not None:
                self.push(segment.end, PHASE, i)
            for j, motion in motions.items():
                if j not in done and (segment.moving or self.current[j].moving):
                    a, b = min(i, j), max(i, j)
                    high = self.horizon(a, b)
                    reach = self.reach[i][j]
                    self.push_bound(BALL, a, b, contact.possible_pair_contact(motions[i], motion, reach, high))
            if segment.moving:
                high, flies = self.horizon(i), segment.phase == "airborne"
                reach = self.radius[i] + (float(self.world.nose(i)[0]) if flies else 0.0)
                for k, wall in enumerate(self.walls):
                    bound = contact.possible_wall_contact(motions[i], wall, reach, high)
                    self.push_bound(CUSHION, i, k, bound)
                    if flies:
                        self.push_bound(EDGE, i, k, bound)
                for k, pocket in enumerate(self.pockets):
                    bound = contact.possible_pocket_contact(motions[i], pocket, high)
                    self.push_bound(EDGE if flies else POCKET, i, k + flies * len(self.walls), bound)

    def motions(self) -> dict[int, contact.FloatMotion]:
        """Returns the motion of each ball in play after now, in floats."""
        return {
            k: contact.FloatMotion(segment, self.now, self.radius[k])
            for k, segment in enumerate(self.current)
            if segment.phase != "potted"
        }

    def last(self, ball: int) -> Real:
        """Returns the end of a ball's segment; for a free ball a time at which it would be beyond the table."""
        segment = self.current[ball]
        if segment.phase != "free":
            return mpmath.inf if segment.end is None else segment.end
        extent = self.world.extent
        return segment.start + min((2 * x + 1) / abs(v) for x, v in zip(extent, segment.velocity, strict=True) if v)

    def end(self, *balls: int) -> Real:
        """Returns the earliest end of the balls' segments and of the shot."""
        return min(self.max_time, *(self.lasts[i] for i in balls))

    def horizon(self, *balls: int) -> float:
        """Returns an upper bound for the time from now to `end`, s."""
        return float(self.end(*balls) - self.now) * (1 + 1e-9)

    def push(self, time: Real, kind: int, ball: int, other: int = -1, base: Real | None = None) -> None:
        """Queues a prediction."""
        versions = self.versions[ball], self.versions[other] if kind == BALL else None
        heapq.heappush(self.queue, _Prediction(time, next(self.order), kind, ball, other, versions, base))

    def push_bound(self, kind: int, ball: int, other: int, delay: float | None) -> None:
        """Queues a bound: the contact cannot occur within `delay` seconds. If `delay` is None, it cannot occur."""
        if delay is not None:
            self.push(self.now + delay * (1 - 1e-9), kind, ball, other, self.now)

    def is_void(self, p: _Prediction) -> bool:
        """Returns whether a ball of the prediction has a newer segment."""
        ball, other = p.versions
        return ball != self.versions[p.ball] or (other is not None and other != self.versions[p.other])

    def next_event(self) -> _Prediction | None:
        """Removes the earliest prediction from the queue; at one instant, kind and ball decide."""
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
        """Replaces a bound by its contact, if there is one."""
        world, a = self.world, self.current[p.ball]
        if p.kind == BALL:
            high = self.end(p.ball, p.other) - base
            prediction = contact.pair_contact(world, p.ball, a, p.other, self.current[p.other], base, high)
        else:
            kinds = {POCKET: contact.pocket_contact, CUSHION: contact.wall_contact, EDGE: contact.edge_contact}
            prediction = kinds[p.kind](world, p.ball, a, p.other, base, self.end(p.ball) - base)
        if prediction is not None:
            delay, resting = prediction
            kind = RESTING if resting else p.kind
            heapq.heappush(self.queue, p._replace(time=base + delay, kind=kind, base=None))

    # Events

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
            pocket = contact.pocket_below(self.world, i, after.position) if kind == "landing" else None
            if pocket is None:
                self.log(kind, i)
                self.replace({i: after})
            else:
                self.remove(i, pocket)
        elif p.kind == POCKET:
            self.remove(i, p.other)
        elif p.kind == EDGE:
            pocket = p.other - len(self.walls)
            low = segment.position_at(self.now)[2] < 2 * self.world.radius[i] / 5
            self.remove(i, pocket if low and pocket >= 0 else -1)
        else:
            position, velocity = segment.position_at(self.now), segment.velocity_at(self.now)
            spin = segment.spin_at(self.now)
            noise = max(segment.noise, self.world.tiny * self.surface_speed(i))
            walls = self.walls_met(i, p.other, noise)
            normals = [normal_at(self.world.walls[wall], position) for wall in walls]
            for wall in walls:
                self.log("cushion", i, wall)
            if segment.phase == "airborne":
                n = contact.nose_normal(self.world, i, self.world.walls[p.other], position)
                velocity, spin = laws.hit_nose(self.world, i, n, velocity, spin)
            elif len(walls) == 1:
                velocity, spin = laws.bounce(self.world, i, normals[0], velocity, spin)
            else:
                level, spin = laws.bounce_both(self.world, i, (normals[0], normals[1]), velocity[:2], spin, noise)
                velocity = (*level, *velocity[2:])
            self.replace({i: laws.segment(self.world, i, self.now, position, velocity, spin, noise)})

    def remove(self, ball: int, pocket: int) -> None:
        """Ends the motion of a ball in a pocket, or of one driven off the table if `pocket` is -1."""
        self.log("off_table" if pocket < 0 else "pocket", ball, pocket)
        zero, segment = mpmath.mpf(0), self.current[ball]
        still = (zero,) * len(segment.velocity)
        place = self.place_beside(ball, segment.position_at(self.now)) if pocket < 0 else self.world.pockets[pocket]
        place = (*place[:2], *still[2:])
        self.replace({ball: Segment("potted", self.now, None, place, still, still, (zero,) * 3, (zero,) * 3, zero)})

    def place_beside(self, ball: int, position: Vector) -> Vector:
        """Returns the place of a ball driven off the table at a position: beside the nearest edge."""
        half = self.world.half_size
        place = [max(-most, min(x, most)) for x, most in zip(position, half, strict=False)]
        axis = min((0, 1), key=lambda k: half[k] - abs(place[k]))
        place[axis] = (half[axis] + self.world.radius[ball]) * mpmath.sign(place[axis])
        return tuple(place)

    def walls_met(self, ball: int, wall: int, noise: Real) -> tuple[int, ...]:
        """Returns the cushions that act on a ball that touches `wall` now, one or two, as the engine logs them.

        A cushion whose normal is along the velocity acts alone. Otherwise the two cushions act whose normals are the
        closest to the velocity on either side of it. If there are no such two, the one that the ball approaches fastest
        acts.
        """
        segment, radius = self.current[ball], self.world.radius[ball]
        if segment.phase == "airborne":
            return (wall,)
        position, velocity = segment.position_at(self.now), segment.velocity_at(self.now)
        normals: dict[int, Vector] = {}
        for k in (wall, *(k for k in range(len(self.walls)) if k != wall)):
            piece = self.world.walls[k]
            normal = normal_at(piece, position)
            gap = dot(normal, minus(piece.center if isinstance(piece, Arc) else piece.middle, position)) - radius
            gap -= piece.radius if isinstance(piece, Arc) else 0
            touches = k == wall or (abs(gap) <= CONTACT_GAP and piece.holds(position, self.world.tiny))
            same = any(laws.norm(minus(normal, other)) * radius <= JOINT for other in normals.values())
            if touches and not same and dot(normal, velocity) > noise:
                normals[k] = normal
        if wall not in normals:
            return (wall,)
        speed = {k: dot(n, velocity) for k, n in normals.items()}
        fastest = max(normals, key=lambda k: speed[k])
        if abs(normals[fastest][0] * velocity[1] - normals[fastest][1] * velocity[0]) <= noise:
            return (fastest,)
        pairs = [
            pair
            for pair in itertools.combinations(normals, 2)
            if min(laws.shares(velocity, normals[pair[0]], normals[pair[1]])) > 0
        ]
        if not pairs:
            return (fastest,)
        closest = max(pairs, key=lambda pair: dot(normals[pair[0]], normals[pair[1]]))
        return tuple(sorted(closest, key=lambda k: (-abs(normals[k][0]), -speed[k], k)))

    def log(self, kind: str, ball: int, other: int = -1) -> None:
        """Adds an event at the current time."""
        self.events.append(Event(self.now, kind, ball, other))

    def replace(self, segments: dict[int, Segment]) -> None:
        """Starts new segments of balls."""
        for i, segment in segments.items():
            self.versions[i] += 1
            self.segments[i].append(segment)
            self.current[i] = segment
            self.lasts[i] = self.last(i)
        self.predict(segments)

    def surface_speed(self, ball: int) -> Real:
        """Returns an upper bound for the speed of every point of a ball, m/s."""
        segment = self.current[ball]
        return laws.norm(segment.velocity_at(self.now)) + self.world.radius[ball] * laws.norm(segment.spin_at(self.now))

    def collide(self, i: int, j: int) -> None:
        """Resolves the impact of two balls and of all balls in contact with them, directly or through others."""
        contacts = self.touching(i, j)
        balls = sorted({ball for pair in contacts for ball in pair})
        positions = {k: self.current[k].position_at(self.now) for k in balls}
        before = {k: self.current[k].velocity_at(self.now) for k in balls}
        spins = {k: self.current[k].spin_at(self.now) for k in balls}
        noise = max(
            *(self.current[k].noise for k in balls), self.world.tiny * max(self.surface_speed(k) for k in balls)
        )
        try:
            after, spins, hits = laws.collide(self.world, positions, before, spins, contacts, noise)
        except laws.TooManyRoundsError as error:
            raise CollapseError(
                f"endless impacts among balls {balls} at {float(self.now)} s", self.shot("collapse")
            ) from error
        for a, b in hits:
            self.log("ball_ball", a, b)
        self.impacts += len(hits)
        # Contacts that approach more slowly than the rounding of a faster ball get no impulse. Their balls get a
        # segment with that noise, so that the contact is not found again.
        changed = {ball for pair in hits for ball in pair} | {i, j}
        self.replace(
            {k: laws.segment(self.world, k, self.now, positions[k], after[k], spins[k], noise) for k in sorted(changed)}
        )

    def touching(self, i: int, j: int) -> list[tuple[int, int]]:
        """Returns the pairs of touching balls that are connected with balls i and j by contacts."""
        motions, pairs, reached, frontier = self.motions(), {(i, j)}, {i, j}, [i, j]
        while frontier:
            a = frontier.pop()
            for b, motion in motions.items():
                pair = (min(a, b), max(a, b))
                if b == a or pair in pairs:
                    continue
                reach = self.reach[a][b]
                if math.dist(motions[a].position, motion.position) > reach * (1 + 1e-9) + 1e-9:
                    continue
                offset = self.world.offset(a, b, *(self.current[k].position_at(self.now) for k in (a, b)))
                if laws.norm(offset) - self.world.reach(a, b) <= CONTACT_GAP:
                    pairs.add(pair)
                    if b not in reached:
                        reached.add(b)
                        frontier.append(b)
        return sorted(pairs)
