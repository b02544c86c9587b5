"""The 50-digit reference: its roots, conservation laws and refusals. `test_closed_forms.py` has its closed forms."""

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mpf

from benchmarks.reference.oracle import OracleShot, RestingContactError, contact, laws, reference_shot
from benchmarks.reference.oracle.outline import Arc, walls_of
from benchmarks.reference.oracle.roots import Real, first_entry, first_possible_entry, real_roots
from benchmarks.reference.stress.scenes import R, ideal
from billiards_env.scene import Balls, Physics, Scene, Table, layouts
from tests.helpers.polynomials import expand

DIGITS = 50


@pytest.fixture(autouse=True)
def _working_digits():
    with mpmath.workdps(DIGITS + 20):
        yield


def kinds(shot: OracleShot, *selected: str) -> list[tuple]:
    return [(e.kind, e.ball, e.other) for e in shot.events if not selected or e.kind in selected]


def close(a, b, digits=40, scale=1.0) -> bool:
    """Returns whether numbers, or nested sequences of numbers, agree to some digits."""
    if hasattr(a, "__len__"):
        return len(a) == len(b) and all(close(x, y, digits, scale) for x, y in zip(a, b, strict=True))
    return abs(a - b) <= scale * mpf(10) ** -digits


def energy(scene: Scene, shot: OracleShot, time) -> Real:
    total = mpf(0)
    states = zip(shot.velocities_at(time), shot.spins_at(time), strict=True)
    for m, r, (v, w) in zip(scene.balls.mass, scene.balls.radius, states, strict=True):
        if math.isfinite(m):
            total += m * (sum(x * x for x in v) + 2 * mpf(r) ** 2 / 5 * sum(x * x for x in w)) / 2
    return total


# Root isolation

fractions = st.fractions(-3, 3, max_denominator=50)
quadratics = st.tuples(fractions, st.fractions(Fraction(1, 50), 4, max_denominator=50))
factors = st.tuples(
    st.lists(fractions, max_size=4),
    st.lists(quadratics, max_size=1),
    st.sampled_from([s * Fraction(10) ** k for s in (-1, 1) for k in (-40, 0, 9)]),
).filter(lambda f: 1 <= len(f[0]) + 2 * len(f[1]) <= 4)


def exact(x: Fraction) -> Real:
    return mpf(x.numerator) / x.denominator


def coefficients_of(roots, pairs, leading) -> list[Real]:
    """Returns the rounded coefficients of a polynomial; b > 0 of a pair has complex roots."""
    return [exact(c) for c in expand(leading, roots, pairs)]


@settings(deadline=None)
@given(factors, st.integers(0, 2))
def test_real_roots_of_any_multiplicity_are_found(factor, vanishing):
    coefficients = coefficients_of(*factor) + [mpf(0)] * vanishing
    roots = real_roots(coefficients, mpf(-2), mpf(2))
    expected = sorted({exact(r) for r in factor[0] if -2 <= r <= 2})
    assert close(roots, expected, 45)


@settings(deadline=None)
@given(factors)
def test_first_entry_is_the_first_root_from_plus_to_minus(factor):
    roots, _, leading = factor
    high = Fraction(2)
    inside = sorted(r for r in set(roots) if 0 < r < high and roots.count(r) % 2)
    if 0 in roots or high in roots:
        return
    positive = (leading > 0) == (sum(r > 0 for r in roots) % 2 == 0)
    entries = inside[0 if positive else 1 :: 2]
    entry = first_entry(coefficients_of(*factor), exact(high))
    assert (entry is None) == (not entries)
    assert entry is None or close(entry, exact(entries[0]), 45)


@pytest.mark.parametrize("leading", [1, -1, mpf("1e-60"), 0])
def test_a_vanishing_leading_coefficient_adds_no_root(leading):
    assert close(real_roots([mpf(-1), mpf(2), mpf(0), mpf(0), leading * mpf("1e-70")], mpf(0), mpf(1)), [mpf("0.5")])


def test_the_zero_polynomial_has_no_roots():
    assert real_roots([mpf(0)] * 3, mpf(0), mpf(1)) == []
    assert real_roots([], mpf(0), mpf(1)) == []


def test_a_root_at_the_end_of_the_interval_counts_if_the_polynomial_falls_there():
    assert first_entry([mpf(1), mpf(-1)], mpf(1)) == 1
    assert first_entry([mpf(1), mpf(-2), mpf(1)], mpf(1)) is None


@settings(deadline=None)
@given(st.lists(st.floats(-10, 10), min_size=5, max_size=5))
def test_the_float_bound_is_never_after_an_entry(coefficients):
    bound = first_possible_entry(coefficients, 1e-9)
    entry = first_entry([mpf(c) for c in coefficients], mpf(1))
    assert entry is None or (bound is not None and bound <= entry)


# Motion


def test_a_ball_that_slides_to_a_halt_stops_without_rolling():
    scene = Scene(Balls((R,), (0.17,)), Table(64, 64))
    # u = 7/2 v is used up when v is, up to rounding
    vx, vy = mpf(1) / 3, mpf(2) / 7
    shot = reference_shot(scene, [[0.0, 0.0]], [vx, vy], [vy * 5 / (2 * R), -vx * 5 / (2 * R), mpf(0)])
    assert kinds(shot) == [("rolling_rest", 0, -1)]


# Two balls


def test_a_ball_stopped_by_an_impact_rests_for_every_direction():
    vx, vy = mpf(1) / 3, mpf(2) / 7
    shot = reference_shot(ideal(1.0, 1.0), [[-vx, -vy], [mpf(0), mpf(0)]], [vx, vy], max_time=2.0)
    assert kinds(shot) == [("ball_ball", 0, 1)]
    assert shot.velocities[0] == (0, 0)
    assert shot.segments[0][-1].phase == "rest"


def test_balls_with_an_overlap_of_rounding_size_meet_again():
    # They part by 2.5e-17 m before the top spin brings the ball back.
    scene = Scene(Balls((R, R), (0.17, math.inf)), Table(64, 64))
    shot = reference_shot(scene, [[1e-13 - 2 * R, 0.0], [0.0, 0.0]], [-1e-8, 0.0], [0.0, 100.0, 0.0], max_events=1)
    assert kinds(shot) == [("ball_ball", 0, 1)]
    assert close(shot.time, 2 * mpf(1e-8) / (mpf(0.2) * mpf(9.81)))


# Cushions and pockets


def test_a_dead_han_cushion_leaves_no_speed_into_it():
    physics = Physics(mu_slide=1e-9, e_cushion=0.0)
    scene = Scene(Balls((R,), (0.17,)), Table(4.0, 4.0, cushion_height=0.04), physics)
    shot = reference_shot(scene, [[0.0, 0.0]], [2.0, 1.0], [0.0, -200.0, 0.0], max_events=1)
    assert kinds(shot) == [("cushion", 0, 1)]
    assert shot.velocities[0][0] == 0


# Several balls at one instant


def test_plastic_impulses_solve_the_complementarity_problem():
    rng = np.random.default_rng(0)
    noise = mpf(10) ** -30
    for count, rank in ((3, 3), (6, 6), (6, 4), (9, 5)):
        for _ in range(10):
            directions = mpmath.matrix(rng.normal(size=(count, rank)).tolist())
            coupling = (directions * directions.T).tolist()
            rates = list(directions * mpmath.matrix(rng.normal(size=rank).tolist()))
            x = laws.plastic_impulses(coupling, rates, noise)
            after = [
                w + sum(a * y for a, y in zip(row, x, strict=True)) for w, row in zip(rates, coupling, strict=True)
            ]
            assert min(x) >= 0
            assert min(after) >= -noise
            assert close([a * y for a, y in zip(after, x, strict=True)], [0] * count)


def test_a_frozen_rack_is_mirrored_exactly_and_keeps_momentum_and_energy():
    rows = [(r, c - r / mpf(2)) for r in range(5) for c in range(r + 1)]
    rack = [(mpmath.sqrt(3) * R * r, 2 * R * c) for r, c in rows]
    scene = ideal(*[1.0] * 16, length=64.0, width=64.0)
    shot = reference_shot(scene, [(mpf(-1), mpf(0)), *rack], [1.0, 0.0], max_time=1.5)
    mirror = [0, *(1 + rows.index((r, -c)) for r, c in rows)]
    assert close(shot.velocities, [(shot.velocities[k][0], -shot.velocities[k][1]) for k in mirror])
    assert close([sum(axis) for axis in zip(*shot.velocities, strict=True)], (1, 0))
    assert close(energy(scene, shot, shot.time), mpf("0.5"))


# Whole shots


def test_a_gas_conserves_momentum_and_energy_and_is_reversible():
    rng = np.random.default_rng(1)
    scene = ideal(1.0, 2.0, 0.5, 1.0, 3.0, length=0.5, width=0.5, max_time=4.0)
    places, velocities = layouts.draw("random", scene, rng), rng.normal(size=(5, 2))
    shot = reference_shot(scene, places, velocities)
    assert len(kinds(shot, "ball_ball")) > 20
    start = energy(scene, shot, 0)
    for event in shot.events:
        assert close(energy(scene, shot, event.time), start)
        if event.kind == "ball_ball":
            for axis in (0, 1):
                change = mpf(0)
                for i in (event.ball, event.other):
                    after = next(s for s in shot.segments[i] if s.start == event.time)
                    before = shot.segments[i][shot.segments[i].index(after) - 1]
                    change += mpf(scene.balls.mass[i]) * (after.velocity[axis] - before.velocity[axis])
                assert close(change, 0)
    back = reference_shot(scene, shot.positions, [(-x, -y) for x, y in shot.velocities])
    assert close(back.positions, [[mpf(float(x)) for x in row] for row in places], 20)


def test_the_float_filter_does_not_change_a_shot(monkeypatch):
    rng = np.random.default_rng(3)
    scene = Scene.named("pool", 5)
    places, velocity = layouts.draw("random", scene, rng), [2.5, 1.5]
    filtered = reference_shot(scene, places, velocity, [0.0, 0.0, 30.0])
    for name in ("possible_pair_contact", "possible_wall_contact", "possible_pocket_contact"):
        monkeypatch.setattr(contact, name, lambda *_: 0.0)
    plain = reference_shot(scene, places, velocity, [0.0, 0.0, 30.0])
    assert kinds(filtered) == kinds(plain)
    assert close([e.time for e in filtered.events], [e.time for e in plain.events])
    assert close(filtered.positions, plain.positions)


def test_more_digits_change_only_the_last_ones():
    rng = np.random.default_rng(4)
    scene = Scene.named("pool", 15)
    places = layouts.draw("random", scene, rng)
    coarse, fine = (reference_shot(scene, places, [-9.0, 3.0], digits=digits) for digits in (50, 100))
    assert kinds(coarse) == kinds(fine)
    assert len(kinds(coarse, "ball_ball")) > 5
    assert close(coarse.positions, fine.positions, 40)


# Ends, limits and errors


def test_limits_on_events_and_impacts():
    scene = ideal(1.0, 1.0, length=2.0)
    arguments = scene, [[0.0, 0.0], [0.5, 0.0]], [1.0, 0.0]
    assert reference_shot(*arguments, max_events=2).status == "event_limit"
    assert len(reference_shot(*arguments, max_events=2).events) == 2
    stopped = reference_shot(*arguments, stop_after=2)
    assert stopped.status == "stopped"
    assert kinds(stopped) == [("ball_ball", 0, 1), ("cushion", 1, 1), ("ball_ball", 0, 1)]
    assert stopped.time == stopped.events[-1].time
    short = reference_shot(*arguments, max_time=0.25)
    assert (short.status, short.time, short.events) == ("max_time", mpf("0.25"), [])
    assert close(short.positions[0], (0.25, 0))


def test_positions_at_any_time():
    shot = reference_shot(ideal(1.0, 1.0), [[-1.0, 0.0], [0.0, 0.0]], [2.0, 0.0], max_time=2.0)
    assert shot.positions_at(0.25)[0] == (mpf("-0.5"), 0)
    assert shot.positions_at(2.0) == shot.positions_at(5.0) == shot.positions
    with pytest.raises(ValueError, match="time"):
        shot.positions_at(-1.0)


@pytest.mark.parametrize(("e_ball", "gap"), [(0.0, 1.0), (0.9, 0.0)])
def test_resting_contact_is_refused(e_ball, gap):
    # With the top spin left to it the cue ball presses on against a ball that cannot give way.
    scene = Scene(Balls((R, R), (0.17, math.inf)), Table(64, 64), Physics(e_ball=e_ball))
    speed = 1.0 if gap else 0.0
    with pytest.raises(RestingContactError, match="ball 0 presses against body 1") as error:
        reference_shot(scene, [[-2 * R - gap, 0.0], [0.0, 0.0]], [speed, 0.0], [0.0, 200.0, 0.0])
    assert error.value.shot.status == "resting_contact"
    assert len(kinds(error.value.shot, "ball_ball")) == (1 if gap else 0)


def test_pressing_against_a_cushion_is_refused():
    scene = Scene(Balls((R,), (0.17,)), Table(2.0, 2.0), Physics(cushion="restitution"))
    with pytest.raises(RestingContactError, match="presses"):
        reference_shot(scene, [[1 - R, 0.0]], [0.0, 0.0], [0.0, 50.0, 0.0])


def test_accumulating_bounces_end_in_resting_contact():
    scene = Scene(Balls((R,), (0.17,)), Table(2.0, 2.0), Physics(cushion="restitution", e_cushion=0.5))
    with pytest.raises(RestingContactError, match="presses") as error:
        reference_shot(scene, [[0.5, 0.0]], [0.5, 0.0], [0.0, 900.0, 0.0])
    assert 50 < len(kinds(error.value.shot, "cushion")) < 200


FIXED = ideal(1.0, math.inf)
PLACES = [[0.0, 0.0], [0.5, 0.0]]


WRONG = [
    ((FIXED, PLACES, [[0.0, 0.0]] * 3), "velocities"),
    ((FIXED, PLACES, [math.nan, 0.0]), "velocities"),
    ((FIXED, PLACES, [1.0, 0.0], [[0.0, 0.0]]), "spins"),
    ((FIXED, PLACES, [[0.0, 0.0], [1.0, 0.0]]), "infinite mass"),
    ((ideal(1.0, 1.0), [[0.0, 0.0], [R, 0.0]], [1.0, 0.0]), "balls 0 and 1"),
]


@pytest.mark.parametrize(("start", "message"), WRONG)
def test_bad_input_is_refused(start, message):
    with pytest.raises(ValueError, match=message):
        reference_shot(*start)


def test_a_ball_in_the_air_touches_the_nose_of_a_tip():
    scene = Scene(Balls.uniform(1), Table.named("pool_9ft"), Physics(flight=True))
    radius, height = scene.balls.radius[0], scene.table.cushion_height - scene.balls.radius[0]
    tip = next(wall for wall in walls_of(scene.table) if isinstance(wall, Arc) and wall.center[0] > 1)
    x, y = (float(c) for c in tip.center)
    shot = reference_shot(scene, [[x - 0.142, y + 0.049, 0.02]], [[2.0, -0.7, 0.3]], [1.0, 2.0, 3.0], max_events=1)
    ((kind, _, number),) = kinds(shot)
    ((x, y, z),) = shot.positions_at(shot.time)
    assert (kind, walls_of(scene.table)[number]) == ("cushion", tip)
    inset = radius - mpmath.sqrt(mpf(radius) ** 2 - mpf(height) ** 2)
    aside = mpmath.hypot(x - tip.center[0], y - tip.center[1]) - tip.radius - inset
    assert close(mpmath.hypot(aside, z - height), mpf(radius))
    assert z > height
    assert shot.velocities[0][2] > shot.segments[0][0].velocity_at(shot.time)[2]
    assert energy(scene, shot, shot.time) < energy(scene, shot, 0) + scene.balls.mass[0] * mpf(9.81) * (mpf(0.02) - z)
