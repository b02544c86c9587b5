"""Shots with results in closed form. The engine has them up to rounding, the 50-digit reference to 40 digits."""

import functools
import itertools
import math
import sys
from typing import Any, NamedTuple

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from benchmarks.reference import oracle
from benchmarks.reference.stress import scenes
from billiards_env.scene.table import Pocket, Table
from tests.helpers.shots import FREE, MOTIONS, ROLLING, SLIDING, R, simulate, world

DIGITS = 70
SQUARE = Table(2.0, 2.0)
ORIGIN, TOUCHING, APART = [[0.0, 0.0]], [[0.0, 0.0], [2 * R, 0.0]], [[-1.0, 0.0], [0.0, 0.0]]
HIT, STOPS = [("ball_ball", 0, 1)], [("sliding_rolling", 0, -1), ("rolling_rest", 0, -1)]
PHASES = {"sliding_rolling", "rolling_rest", "rolling_slower", "spinning_rest"}


class Case(NamedTuple):
    """A shot and its results. All numbers are floats or `mpf`.

    Attributes:
        start: Scene, positions, velocities and, if there are any, spins.
        events: (kind, ball, other) of all events, or of the contacts if no end of a phase is listed; None for any.
        limits: The arguments `max_time` and `max_events`.
        results: Fields of the result; "times" are those of the first events, s.
    """

    start: tuple
    events: list[tuple[str, int, int]] | None
    limits: dict[str, Any]
    results: dict[str, Any]


CASES: dict[str, Case] = {}


def case(sentence, start, events, max_time=None, max_events=None, **results):
    """Adds a case. The sentence describes the shot."""
    assert sentence not in CASES
    limits = {"max_time": max_time, "max_events": max_events}
    CASES[sentence] = Case(start, events, {k: v for k, v in limits.items() if v is not None}, results)


def deceleration(mu):
    return mpf(mu) * mpf(9.81)


def rolled(v, mu=0.01):
    """Returns the distance in which a ball rolls to rest, m."""
    return v * (mpf(v) / (2 * deceleration(mu)))


def slid(v, mu=0.01):
    """Returns the distance in which a ball slides and then rolls, from 5/7 of its speed, to rest, m."""
    return v * (mpf(v) * 12 / (49 * deceleration(0.2))) + rolled(5 * mpf(v) / 7, mu)


def add_motions():
    """Adds shots of one ball without contacts."""
    slide, roll = deceleration(0.2), deceleration(0.01)
    way, v = np.array([mpf(3) / 5, -mpf(4) / 5]), mpf(3)
    end, later = 2 * v / (7 * slide), 5 * v / 7
    start = world(1, SLIDING), ORIGIN, (v * way).tolist()
    times = [end, end + later / roll]
    case("a ball slides, rolls and stops", start, STOPS, times=times, positions=[way * slid(v)], status="rest")
    place, spin = way * 12 * v**2 / (49 * slide), [-way[1] * later / R, way[0] * later / R, 0]
    case("it rolls when it has slid", start, None, end, positions=[place], velocities=[way * later], spins=[spin])

    start = world(1, SLIDING), ORIGIN, [1.0, 0.0], [0.0, 1 / R, 0.0]
    case("a ball with natural roll does not slide", start, STOPS[1:], times=[1 / roll], positions=[[rolled(1), 0]])
    for spin, u, after in ((-4, mpf(5), mpf(-3) / 7), (-2.5, mpf(3.5), mpf(0)), (3, mpf(-2), mpf(11) / 7)):
        # The slip u = v - R wy is zero at the velocity v - 2 u / 7.
        t, name = 2 * abs(u) / (7 * slide), f"spin of {spin} times the natural roll changes the velocity after sliding"
        end = t - mpmath.sign(u) * slide * t * t / 2 + mpmath.sign(after) * rolled(after)
        case(name, (world(1, SLIDING), ORIGIN, [1.0, 0.0], [0.0, spin / R, 0.0]), None, times=[t], positions=[[end, 0]])

    slow, spin = (world(1, SLIDING, spin_decay=2.0), ORIGIN, [0.1, 0.0]), [0.0, 0.0, -40.0]
    spins = [*STOPS, ("spinning_rest", 0, -1)]
    case("a stopped ball spins until its spin is zero", (*slow, spin), spins, time=20, status="rest")
    case("a ball rolls longer than it spins", (*slow, [0.0, 0.0, 0.5]), STOPS, status="rest")
    case("a stopped ball spins at the limit of time", (*slow, spin), STOPS, 5, spins=[[0, 0, -30]], status="max_time")
    start = world(1, ROLLING, max_time=2.0), ORIGIN, [1.0, 0.0]
    parts = [(mpf(0.01) + mpf(0.004) * middle) * mpf(9.81) for middle in (mpf(1.25), mpf(0.75), mpf(0.25))]
    speeds, times, way = [mpf(1.2), mpf(1), mpf(0.5), mpf(0)], [mpf(0)], mpf(0)
    for slows, fast, low in zip(parts, speeds, speeds[1:], strict=False):
        times.append(times[-1] + (fast - low) / slows)
        way += (fast**2 - low**2) / (2 * slows)
    slower = world(1, ROLLING, mu_roll_speed=0.004), ORIGIN, [1.2, 0.0]
    slows = [("rolling_slower", 0, -1), ("rolling_slower", 0, -1), ("rolling_rest", 0, -1)]
    case("rolling resistance grows with the speed", slower, slows, times=times[1:], positions=[[way, 0]], status="rest")
    for limit in (2, 1):
        place, speed = [limit - roll * limit**2 / 2, 0], [1 - roll * limit, 0]
        end = {"time": limit, "positions": [place], "velocities": [speed], "status": "max_time"}
        case(f"a ball rolls at the limit of {limit} s", start, [], None if limit == 2 else limit, **end)
    for (name, way), exponent in itertools.product(
        {"rolling": rolled, "sliding": slid}.items(), (-300, -150, -30, -9, -3, 0, 2)
    ):
        start = world(1, {**MOTIONS[name], "mu_roll": 0.2}, Table(1e4, 2.0)), ORIGIN, [10.0**exponent, 0.0]
        place = [way(mpf(10.0**exponent), 0.2), 0]
        case(f"a {name} ball at 1e{exponent} m/s stops", start, None, positions=[place], status="rest")
    case("a shot without motion ends at once", (world(2, SLIDING), TOUCHING, [0.0, 0.0]), [], time=0, status="rest")
    start, same = (world(1, SLIDING), ORIGIN, [1.0, 2.0]), {"positions": ORIGIN, "velocities": [[1.0, 2.0]]}
    case("a limit of time of 0 changes nothing", start, [], 0, **same, time=0, status="max_time")


def add_pairs():
    """Adds shots of two balls."""
    for masses, e, after in (
        ((1.0, 1.0), 1.0, (0.0, 2.0)),
        ((3.0, 1.0), 1.0, (1.0, 3.0)),
        ((1.0, 3.0), 1.0, (-1.0, 1.0)),
        ((1.0, math.inf), 1.0, (-2.0, 0.0)),
        ((1.0, math.inf), 0.5, (-1.0, 0.0)),
        ((1.0, 1.0), 0.5, (0.5, 1.5)),
        ((1.0, 1.0), 0.0, (1.0, 1.0)),
    ):
        start, t = (world(2, FREE, mass=masses, e_ball=e), APART, [2.0, 0.0]), (1 - 2 * R) / 2
        end = {"velocities": [[v, 0] for v in after]}
        end["positions"] = [[-2 * R + after[0] * (1 - t), 0], [after[1] * (1 - t), 0]]
        case(f"balls of {masses} kg with restitution {e} meet head on", start, HIT, 1.0, times=[t], **end)
    for e, small in itertools.product((0.0, 1.0), (0.1, 0.02, 0.002)):
        scene = scenes.ideal(1.0, 1.0, e_ball=e, radius=(0.1, small), max_time=0.5)
        t, after = mpf(0.5) - mpf(0.1) - mpf(small), [[(1 - e) / 2, 0], [(1 + e) / 2, 0]]
        start = scene, [[0.0, 0.0], [0.5, 0.0]], [1.0, 0.0]
        case(f"radii of 0.1 and {small} m, restitution {e}", start, HIT, times=[t], velocities=after)
    for short in (0.5, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 0.0, -1e-15):
        offset = 2 * R * (1 - short)
        sine = mpf(offset) / (2 * R)
        cosine = mpmath.sqrt(1 - sine**2) if short > 0 else mpf(0)
        start = world(2, FREE), [[-1.0, offset], [0.0, 0.0]], [1.0, 0.0]
        after = [[1 - cosine**2, cosine * sine], [cosine**2, -cosine * sine]]
        hit = (HIT, [1 - 2 * R * cosine]) if short > 0 else ([], [])
        case(f"a graze at {short} of the reach", start, hit[0], 2.0, times=hit[1], velocities=after)
    for spin, way in ((0, mpf(0)), (1, mpf(2) / 7), (-1, -mpf(2) / 7)):
        # The cue ball gives its velocity to the other ball and keeps its spin.
        end = mpmath.sign(way) * (way**2 / (2 * deceleration(0.2)) + rolled(way))
        start = world(2, SLIDING), [[-2 * R, 0.0], [0.0, 0.0]], [1.0, 0.0], [0.0, spin / R, 0.0]
        places = [[end - 2 * R, 0], [slid(1), 0]]
        case(f"a cue ball with {spin} times the natural roll hits another", start, None, positions=places)
    for gap in (0.0, 1e-13, -1e-13, 1e-17):
        scene, places = world(2, FREE), [[-2 * mpf(R) - mpf(gap), 0.0], [0.0, 0.0]]
        end = {"velocities": [[0, 0], [1, 0]], **({"times": [0]} if gap <= 0 else {})}
        case(f"balls {gap} m apart approach", (scene, places, [1.0, 0.0]), HIT, 1.0, **end)
        for way in ([-1.0, 0.0], [0.0, 1.0], [-1.0, 1e-9]):
            what = f"balls {gap} m apart do not approach with {way}"
            case(what, (scene, places, way), [], 1.0, velocities=[way, [0, 0]])
    for speed in (1e-300, 1e-9, 1.0, 100.0):
        start = world(2, FREE), TOUCHING, [speed, 0.0]
        case(f"balls in contact exchange {speed} m/s", start, HIT, 1e-3, velocities=[[0, 0], [speed, 0]])
    # The root at 0 is none.
    start = world(2, SLIDING, mass=(0.2, math.inf)), [[-2 * R, 0.0], [0.0, 0.0]], [-0.5, 0.0], [0.0, 100.0, 0.0]
    case("top spin brings a ball back", start, HIT, max_events=1, times=[1 / deceleration(0.2)])
    for (name, law), gap, turn in itertools.product(MOTIONS.items(), (0.0, 1e-9, 0.5), ((1, 0), (0, 1))):
        for x, y in ((mpf(1), mpf(0)), (mpf(3) / 5, mpf(4) / 5)):
            line = turn[0] * x - turn[1] * y, turn[0] * y + turn[1] * x
            start = world(2, law), [[0.0, 0.0], [(2 * mpf(R) + gap) * c for c in line]], [[x, y], [x, y]]
            where = "one behind the other" if turn[0] else "side by side"
            case(f"{name} balls {where}, {gap} m apart, at ({x}, {y}) m/s", start, [], 3.0)


def add_limits():
    """Adds shots in which balls just meet or just do not."""
    slide, roll, small = deceleration(0.2), deceleration(0.01), mpf(10) ** -12
    for more, events, what in ((small, HIT, "meets"), (-small, [], "does not meet")):
        start = world(2, ROLLING), APART, [mpmath.sqrt(2 * roll * (1 - 2 * R)) * (1 + more), 0.0]
        case(f"a rolling ball just {what} another", start, events, status="rest")
        # The distance is smallest when the speeds are equal.
        places = [[0.0, 0.0], [2 * R + mpf(1) / 4 / (2 * (slide - roll)) - more, 0.0]]
        start = world(2, SLIDING), places, [[2.0, 0.0], [1.5, 0.0]], [[0.0, 0.0, 0.0], [0.0, 1.5 / R, 0.0]]
        case(f"a sliding ball just {what} a rolling ball", start, events, 0.5)
        for name, law in MOTIONS.items():
            start = world(2, law), [[-1.0, 2 * R * (1 - more / 10)], [0.0, 0.0]], [2.5, 0.0]
            case(f"a {name} ball that grazes another just {what} it", start, events, 1.0)


def add_cushions():
    """Adds shots with cushions and pockets."""
    t = (1 - R) / 2
    start, end = (world(1, FREE, Table(2.0, 4.0), e_cushion=0.5), ORIGIN, [2.0, 1.0]), [[1 - R - (1 - t), 1]]
    case("a ball bounces", start, [("cushion", 0, 1)], 1.0, times=[t], velocities=[[-1, 1]], positions=end)
    for side, way in enumerate([(-1.0, 0.5), (1.0, 0.5), (0.5, -1.0), (0.5, 1.0)]):
        start = world(1, FREE, SQUARE), ORIGIN, way
        case(f"the cushion along {way} has number {side}", start, [("cushion", 0, side)], 1.0)
    frozen = world(1, FREE, SQUARE), [[1 - R, 0.0]]
    start, after = (*frozen, [1.0, 0.5]), [[-1, 0.5]]
    case("a frozen ball bounces at once", start, [("cushion", 0, 1)], 0.5, times=[0], velocities=after)
    case("a frozen ball leaves the cushion", (*frozen, [-0.5, 0.0]), [], 1.0, velocities=[[-0.5, 0.0]])
    slide, roll, limit = deceleration(0.2), deceleration(0.01), mpf(0.9)
    rolls = limit - 2 / (7 * slide)
    ways = {
        "ideal": limit,
        "rolling": limit - roll * limit**2 / 2,
        "sliding": 12 / (49 * slide) + 5 * rolls / 7 - roll * rolls**2 / 2,
    }
    for (name, law), side, (x, y) in itertools.product(MOTIONS.items(), (1, -1), ((1, 0), (0, 1))):
        start = world(1, law, SQUARE), [[side * x * (1 - R), side * y * (1 - R)]], [y, x]
        end = [[side * x * (1 - R) + y * ways[name], side * y * (1 - R) + x * ways[name]]]
        what = f"a {name} ball moves along the cushion at ({side * x}, {side * y})"
        case(what, start, [], 0.9, positions=end)
    for gap, e, (x, y) in itertools.product((0.0, 0.5), (0.0, 0.5, 1.0), itertools.product((-1.0, 1.0), repeat=2)):
        start = world(1, FREE, SQUARE, e_cushion=e), [[x * (1 - R - gap), y * (1 - R - gap)]], [x, y]
        both = [("cushion", 0, int(x > 0)), ("cushion", 0, 2 + int(y > 0))]
        end = {"times": [gap, gap], "velocities": [[-e * x, -e * y]]}
        case(f"the corner ({x}, {y}) with restitution {e}, {gap} m away", start, both, 1.0, **end)
    for divisor in range(3, 12):
        place = mpf(1) / 7, mpf(1) / 11
        v = [7 * (half - R - x) / divisor for half, x in zip((1, mpf(0.5)), place, strict=True)]
        start, both = (world(1, FREE, Table(2.0, 1.0)), [place], v), [("cushion", 0, 1), ("cushion", 0, 3)]
        limit, after = divisor / 7 + 0.1, [[-x for x in v]]
        case(f"a corner is hit at one instant up to rounding, {divisor}/7 s", start, both, limit, velocities=after)
    start = world(2, FREE, SQUARE, mass=(1.0, 1.0)), [[0.0, 0.0], [1 - R, 0.0]], [1.0, 0.0]
    thrice, end = [*HIT, ("cushion", 1, 1), *HIT], {"times": [1 - 3 * R] * 3, "velocities": [[-1, 0], [0, 0]]}
    case("a hit on a ball at a cushion returns to the striking ball", start, thrice, 1.0, **end)
    start = world(2, FREE, Table(4.0, 2.0)), [[0.0, 0.75 - R], [0.25 + 2 * R, 1 - R]], [[1.0, 1.0], [0.0, 0.0]]
    both, end = [*HIT, ("cushion", 0, 3)], {"times": [0.25, 0.25], "velocities": [[0, -1], [1, 0]]}
    case("a ball reaches a cushion and a ball at one instant", start, both, 0.5, **end)
    start = world(2, FREE, SQUARE), [[0.75 - R, 0.25 + R], [0.75 - R, -0.25 - R]], [[1.0, -1.0], [1.0, 1.0]]
    thrice, end = [*HIT, ("cushion", 0, 1), ("cushion", 1, 1)], {"times": [0.25] * 3, "velocities": [[-1, 1], [-1, -1]]}
    case("balls that meet at a cushion hit each other and then the cushion", start, thrice, 0.5, **end)

    table = Table(2.0, 2.0, pockets=(Pocket(1.0, 1.0, 0.1), Pocket(0.25, 0.5, 0.125)))
    for name, a in (("ideal", mpf(0)), ("rolling", deceleration(0.01))):
        t = 2 * mpf(0.625) / (2 + mpmath.sqrt(4 - 2 * a * mpf(0.625)))
        start = world(1, MOTIONS[name], table), [[-0.5, 0.5]], [2.0, 0.0]
        end = {"times": [t], "positions": [[0.25, 0.5]], "potted": [True], "status": "rest"}
        case(f"the centre of a {name} ball enters the circle of a pocket", start, [("pocket", 0, 1)], **end)
    rim, fall = world(1, SLIDING, Table(2.0, 2.0, 0.04, (Pocket(0.0, 0.0, 0.125),))), [("pocket", 0, 0)]
    for way, events in (([1.0, 0.0], fall), ([0.0, 0.3], []), ([-0.3, 0.0], [])):
        start = rim, [[-0.125, 0.0]], way
        case(f"a ball moves on the rim of a pocket with {way}", start, events, potted=[bool(events)], status="rest")
    case("spin drives a ball from the rim", (rim, [[-0.125, 0.0]], [0.0, 0.0], [0.0, 9.0, 0.0]), fall, time=0)
    table = Table(2.0, 2.0, pockets=(Pocket(1 - R + 0.125, 0.0, 0.125),))
    for n, places in ((1, ORIGIN), (2, [[0.0, 0.0], [1 - R, 2 * R]])):
        what = ("a cushion", "an impact")[n - 1]
        case(f"a pocket precedes {what} at one instant", (world(n, FREE, table), places, [1.0, 0.0]), fall)
    # The second ball would hit the first in the centre of the pocket before it falls.
    scene = world(2, FREE, Table(2.0, 2.0, pockets=(Pocket(0.75, 0.0, 1.5 * R),)))
    start, events = (scene, [[0.5, 0.0], [-0.5, 0.0]], [[1.0, 0.0], [-1.0, 0.0]]), [*fall, ("cushion", 1, 0)]
    case("a potted ball is out of play", start, [*events, ("pocket", 1, 0)])


def add_simultaneous():
    """Adds impacts of several balls at one instant."""
    for n, moving in itertools.product((5, 6), (1, 2, 3)):
        velocities = [[1.0 if k < moving else 0.0, 0.0] for k in range(n)]
        places = [[2 * R * k - (0.5 if k < moving else 0.0), 0.0] for k in range(n)]
        start, after = (world(n, FREE, mass=(1.0,) * n), places, velocities), velocities[::-1]
        case(f"a cradle of {n} balls, {moving} of which move", start, None, 1.0, times=[0.5], velocities=after)
    # Both contacts are at 30 degrees to the path. The plastic impulse along each normal is m v cos(30) / 2.5.
    root, zero = mpmath.sqrt(3), mpf(0)
    places = np.array([(-root * R - 1, zero), (zero, mpf(R)), (zero, mpf(-R))])
    for e, angle in itertools.product((0.0, 0.5, 1.0), (0, 180, 20, 60, 230)):
        c, s = mpmath.cos(mpmath.radians(angle)), mpmath.sin(mpmath.radians(angle))
        turn = np.array([[c, s], [-s, c]])
        side, start = (1 + e) * root / 5, np.array([(mpf(2), zero), (zero, zero), (zero, zero)])
        after = np.array([(2 - 6 * (1 + mpf(e)) / 5, zero), (side * root, side), (side * root, -side)])
        for order in itertools.permutations(range(3)) if angle in (0, 180) else [(0, 1, 2)]:
            rows = [(array @ turn)[list(order)].tolist() for array in (places, start, after)]
            name = f"ball {order.index(0)} of {order} hits two balls in contact at {angle} degrees, restitution {e}"
            cue = order.index(0)
            hits = [("ball_ball", min(cue, k), max(cue, k)) for k in range(3) if k != cue]
            case(name, (world(3, FREE, e_ball=e), *rows[:2]), hits, 0.75, velocities=rows[2])


with mpmath.workdps(DIGITS):
    for add in (add_motions, add_pairs, add_limits, add_cushions, add_simultaneous):
        add()


def floats(numbers):
    return np.array(numbers, float)


def of_engine(start, **limits):
    """Returns the shot of the engine, its events and their times. A shot to its end keeps all rules at every event."""
    scene, positions, velocities, *spins = start[0], *map(floats, start[1:])
    ends = scene.physics.motion == "ideal" or not (limits or scene.physics.max_time)
    run = scenes.checked_shot if ends else functools.partial(simulate, record=True)
    options = {key: float(value) if key == "max_time" else value for key, value in limits.items()}
    shot: Any = run(scene, positions, velocities, spins=spins[0] if spins else None, **options)
    return shot, scenes.kinds(shot), shot.events["time"]


def of_simulator(start, **limits):
    """Returns the shot of the 50-digit reference, its events and their times."""
    shot = oracle.reference_shot(*start, **limits)
    return shot, [(e.kind, e.ball, e.other) for e in shot.events], [e.time for e in shot.events]


def check_close(actual, expected, digits):
    """Checks that numbers agree to some digits of the largest one; zeros have that absolute error."""
    actual, expected = (np.array(x, object).ravel() for x in (actual, expected))
    largest = max((abs(x) for x in expected), default=0)
    largest = 1 if largest < sys.float_info.min else largest
    assert len(actual) == len(expected)
    assert all(abs(a - b) <= largest * mpf(10) ** -digits for a, b in zip(actual, expected, strict=True)), (
        actual,
        expected,
    )


@pytest.mark.parametrize(("play", "digits"), [(of_engine, 14), (of_simulator, 40)], ids=["engine", "simulator"])
@pytest.mark.parametrize("name", CASES)
def test_a_shot_follows_the_closed_form(name, play, digits):
    start, events, limits, results = CASES[name]
    with mpmath.workdps(DIGITS):
        shot, actual, times = play(start, **limits)
        if events is not None:
            with_phases = any(kind in PHASES for kind, *_ in events)
            assert [event for event in actual if with_phases or event[0] not in PHASES] == events
        for field, expected in results.items():
            if field in ("status", "potted"):
                assert getattr(shot, field) == expected
            elif field == "times":
                check_close(times[: len(expected)], expected, digits)
            else:
                check_close(getattr(shot, field), expected, digits)
        if shot.status == "rest":
            assert not np.any(shot.velocities)
            assert shot.time == (times[-1] if len(times) else 0)
