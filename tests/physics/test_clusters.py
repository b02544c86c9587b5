"""Impacts of several pairs of balls at one instant, with and without friction."""

import itertools
import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.reference.oracle import laws
from benchmarks.reference.oracle.laws import World
from billiards_env.jit import allocating, entry_point
from billiards_env.physics.clusters.complementarity import MOST
from billiards_env.physics.clusters.impulses import empty_contacts, empty_scratch, solve_plastic
from billiards_env.physics.state import VX, VY, WIDTH
from billiards_env.scene import Balls, Physics, Scene
from tests.helpers.impacts import KINDS, RACKS, arrays_of, check_order_and_side, collided, drawn, energy, motion_of

SEEDS = st.integers(0, 2**32)
FRICTION = st.sampled_from([None, 0.06, 0.5, 5.0])
kinds = pytest.mark.parametrize("kind", KINDS)


def plastic(first, second, nx, ny, increase, inv_mass):
    """Returns the plastic impulses (count,) and changes of velocity (n, 2)."""
    impulse, change = np.empty(len(first)), np.empty((len(inv_mass), 2))
    write_plastic(first, second, nx, ny, increase, inv_mass, impulse, change)
    return impulse, change


@entry_point
def write_plastic(first, second, nx, ny, increase, inv_mass, impulse, change):
    _write_plastic(first, second, nx, ny, increase, inv_mass, impulse, change)


@allocating
def _write_plastic(first, second, nx, ny, increase, inv_mass, impulse, change):
    count, n = len(first), len(inv_mass)
    contacts, scratch = empty_contacts(count, 2), empty_scratch(n, count, None, 2)
    contacts.first[:], contacts.second[:] = first, second
    contacts.normal[:, 0], contacts.normal[:, 1] = nx, ny
    contacts.closing[:], contacts.rebound[:] = increase, 0.0
    scratch.increase[:, 0], scratch.increase[:, 1] = increase, 0.0
    scratch.change[:] = 0.0
    solve_plastic(count, contacts, inv_mass, scratch)
    impulse[:] = scratch.impulse[:, 0] + scratch.impulse[:, 1]
    change[:] = scratch.change[:, :, 0] + scratch.change[:, :, 1]


def check_plastic(contacts, inverse, within):
    """Checks that the impulses of contacts (first, second, angle of the normal, speed of approach) are a solution.

    No contact approaches, and those with an impulse do not separate. Returns the impulses.
    """
    first, second, angle, closing = (np.array(column) for column in zip(*contacts, strict=True))
    nx, ny = np.cos(angle), np.sin(angle)
    impulse, change = plastic(first, second, nx, ny, closing, inverse)
    apart = change[second] - change[first]
    separation = nx * apart[:, 0] + ny * apart[:, 1] - closing
    assert (impulse >= 0).all()
    assert (separation >= -within).all()
    assert np.abs(impulse * separation).max() <= within
    return impulse


@given(st.integers(0, 10**6), st.integers(2, 6), st.booleans())
def test_plastic_impulses_on_a_ball_with_neighbours_around_it_are_a_solution(seed, leaves, fixed):
    rng = np.random.default_rng(seed)
    inverse = rng.uniform(0.5, 5, leaves + 1)
    if fixed:
        inverse[leaves] = 0.0
    contacts = [(0, k + 1, k * math.pi / 3, rng.uniform(0.01, 2)) for k in range(leaves)]
    contacts += [(k + 1, k + 2, (k + 2) * math.pi / 3, rng.uniform(0.01, 2)) for k in range(leaves - 1)]
    assert check_plastic(contacts, inverse, 1e-11).any()


@pytest.mark.parametrize("rack", RACKS)
@pytest.mark.parametrize("equal", [True, False])
def test_plastic_impulses_of_racks_with_redundant_contacts_are_a_solution(rack, equal):
    places, pairs = RACKS[rack]
    direct = len(pairs) <= MOST  # a large problem is solved by descent
    within = 1e-12 if direct else 1e-11  # the accuracy of 2000 sweeps of the descent
    for seed in range(20 if direct else 3):
        rng = np.random.default_rng(seed)
        contacts = [(i, j, math.atan2(*(places[j] - places[i])[::-1]), rng.uniform(0.01, 2)) for i, j in pairs]
        check_plastic(contacts, np.full(len(places), 1 / 0.17) if equal else rng.uniform(0.5, 5, len(places)), within)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_one_of_two_contacts_may_open_without_an_impulse(order):
    contacts = [(0, 1, 0.0, 5.0), (1, 2, math.pi, 0.1)]  # ball 0 pushes ball 1 away from ball 2
    impulses = check_plastic([contacts[k] for k in order], np.ones(3), 1e-12)
    assert impulses[list(order)] == pytest.approx([2.5, 0.0])


def exact_row(masses, velocities, e):
    """Returns the exact velocities after the impact of a row of balls in contact: the best of all sets of contacts."""
    n = len(masses)
    best = None
    # The pairs that have equal velocities after the plastic impact
    for closed in itertools.product([False, True], repeat=n - 1):
        after, k = list(velocities), 0
        while k < n:
            m = k
            while m < n - 1 and closed[m]:
                m += 1
            group = range(k, m + 1)
            mean = sum(masses[i] * velocities[i] for i in group) / sum(masses[i] for i in group)
            for i in group:
                after[i] = mean
            k = m + 1
        if any(after[i] > after[i + 1] for i in range(n - 1)):
            continue
        cost = sum(m * (a - v) ** 2 for m, a, v in zip(masses, after, velocities, strict=True))
        if best is None or cost < best[0]:
            best = cost, after
    assert best is not None
    return [v + (1 + e) * (a - v) for v, a in zip(velocities, best[1], strict=True)]


ROWS_OF_BALLS = [
    ([1, 0, 1], [1.0, 0.0, -0.5]),
    ([0, 1, 0], [1.0, 0.0, -0.5]),
    ([1, 0, 0, 1], [1.0, 0.5, 0.0, -0.75]),
    ([1, 0, 1, 0, 1], [1.0, 0.75, 0.5, 0.0, -0.5]),
    ([0, 1, 0, 1, 0], [1.0, 0.75, 0.5, 0.0, -0.5]),
    ([1, 1, 0, 0, 1], [1.0, 0.5, 0.25, -0.125, -1.0]),
]


@pytest.mark.parametrize("ratio", [1.0, 1e2, 1e4, 1e8, 1e12, 1e16])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(("heavy", "velocities"), ROWS_OF_BALLS)
def test_extreme_mass_ratios_lose_no_digits(heavy, velocities, ratio, e):
    """With a ratio of 1e16 a velocity once had the wrong sign, because 1 - a^2 was computed with cancellation."""
    mass = [math.sqrt(ratio) if h else 1 / math.sqrt(ratio) for h in heavy]
    inverse = 1.0 / np.array(mass)
    n = len(mass)
    exact_masses = [1 / Fraction(x) for x in inverse]
    want = exact_row(exact_masses, [Fraction(v) for v in velocities], Fraction(e))
    places, rows = np.stack([np.arange(n), np.zeros(n)], 1), np.zeros((n, WIDTH))
    rows[:, VX] = velocities
    arrays = arrays_of("smooth", e, None, inverse, inverse)
    got = collided(places, rows, list(itertools.pairwise(range(n))), arrays)[0][:, VX]
    for actual, exact in zip(got, want, strict=True):
        # The second term is the rounding of the largest velocity, for balls that stop by cancellation.
        assert abs(Fraction(actual) - exact) <= abs(exact) * Fraction(1e-14) + Fraction(2.0**-53)
    before, after = (sum(m * Fraction(v) ** 2 for m, v in zip(exact_masses, row, strict=True)) for row in (want, got))
    assert abs(after - before) <= before * Fraction(1e-14)


@given(SEEDS, st.integers(3, 12), st.floats(0, 1))
def test_smooth_balls_separate_at_least_at_the_minimum_speed(seed, n, e):
    rng, places, rows, pairs, arrays = drawn(seed, "smooth", n, e)
    least = rng.uniform(0, 0.1, len(pairs))
    after = collided(places, rows, pairs, arrays, least)[0][:, [VX, VY]]
    for (i, j), rebound in zip(pairs, least, strict=True):
        normal = (places[j] - places[i]) / math.dist(places[i], places[j])
        if normal @ (rows[j, [VX, VY]] - rows[i, [VX, VY]]) < 0:
            assert normal @ (after[j] - after[i]) >= rebound - 1e-13 * np.abs(after).max()


@kinds
@given(SEEDS, st.integers(2, 30), st.floats(0, 1), FRICTION, st.booleans(), st.booleans())
def test_impacts_have_no_preferred_order_or_side(kind, seed, n, e, mu, fixed, rebounds):
    """The impulses do not depend on the numbers of the balls and contacts, nor on mirrors."""
    rng, places, rows, pairs, arrays = drawn(seed, kind, n, e, mu, fixed)
    check_order_and_side(rng, places, rows, pairs, arrays, rng.uniform(0, 0.1, len(pairs)) * rebounds)


@pytest.mark.parametrize("rack", RACKS)
@pytest.mark.parametrize("inverse_mass", [None, 1 / 0.17, 1.0])
@pytest.mark.parametrize("e", [0.0, 0.95, 1.0])
def test_a_frozen_rack_has_no_preferred_order_or_side(rack, inverse_mass, e):
    """The contacts are redundant: the impulses are not unique, but the velocities and the friction are.

    In the rack of 45 balls more than `MOST` pairs approach, so the impulses are found by descent. With equal masses
    many velocities and impulses are halfway between two doubles. Once the order of the contacts decided how these were
    rounded.
    """
    places, pairs = RACKS[rack]
    n = len(places)
    for seed in range(60 if n < 40 else 3):
        rng = np.random.default_rng(seed)
        inverse = rng.uniform(0.5, 5, n) if inverse_mass is None else np.full(n, inverse_mass)
        arrays = arrays_of(KINDS[seed % 2], e, None, np.full(n, 0.03), inverse)
        check_order_and_side(rng, places, rng.normal(size=(n, WIDTH)), pairs, arrays, np.zeros(len(pairs)))


@kinds
@given(SEEDS, st.integers(2, 30), st.floats(0, 1), FRICTION, st.booleans())
def test_impacts_lose_energy_and_keep_momentum(kind, seed, n, e, mu, fixed):
    _, places, rows, pairs, arrays = drawn(seed, kind, n, e, mu, fixed)
    after, _ = collided(places, rows, pairs, arrays)
    assert energy(after, arrays) <= energy(rows, arrays) * (1 + 1e-12)
    assert np.array_equal(after[arrays.inv_mass == 0], rows[arrays.inv_mass == 0])
    if not fixed:
        mass = 1 / arrays.inv_mass
        change = mass @ (after - rows)[:, VX : VY + 1]
        assert np.abs(change).max() <= 1e-14 * mass.max() * (1 + np.abs(rows[:, VX : VY + 1]).max()) * n


@kinds
@given(SEEDS, st.booleans())
def test_separate_impacts_at_one_instant_are_those_of_single_impacts(kind, seed, fixed):
    places = np.array([[0.0, 0.0], [0.8, 0.6], [9.0, 0.0], [9.0, 1.0]])
    _, _, rows, _, arrays = drawn(seed, kind, 4, 0.9, None, fixed)
    both, _ = collided(places, rows, [(0, 1), (2, 3)], arrays)
    single, _ = collided(places, rows, [(0, 1)], arrays)
    single, _ = collided(places, single, [(2, 3)], arrays)
    assert both == pytest.approx(single, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS[1:])
@given(SEEDS, st.integers(3, 30), st.floats(0, 1), FRICTION)
def test_friction_dissipates_energy(kind, seed, n, e, mu):
    _, places, rows, pairs, arrays = drawn(seed, kind, n, e, mu, equal=True)
    after, count = collided(places, rows, pairs, arrays)
    if not count:
        return
    smooth, _ = collided(places, rows, pairs, arrays_of(kind, e, 0.0, arrays.radius, arrays.inv_mass))
    assert energy(after, arrays) <= energy(smooth, arrays) * (1 + 1e-12)
    if mu == 5.0 and count <= n:  # friction stops the slip unless a normal impulse is zero
        assert energy(after, arrays) < energy(smooth, arrays)


@pytest.mark.parametrize(("shape", "kind"), [("disk", "rubbing"), ("sphere", "spheres")])
def test_joint_impacts_agree_with_the_high_precision_simulator(shape, kind):
    """The engine minimises the energy by gradients, the simulator contact by contact."""
    compared = 0
    for seed in range(80):
        mu = (None, 0.05, 0.5)[seed % 3]
        _, places, rows, pairs, arrays = drawn(seed, kind, 3 + seed % 5, 0.9, mu)
        after, count = collided(places, rows, pairs, arrays)
        if not 2 <= count <= 5:
            continue
        for _ in range(20):
            if count == 0:
                break
            after, count = collided(places, after, pairs, arrays)
        physics = Physics(ball_ball="frictional", cushion="restitution", mu_ball=mu, e_ball=0.9)
        radius, mass = tuple(arrays.radius.tolist()), tuple((1 / arrays.inv_mass).tolist())
        scene = Scene(Balls(radius, mass, shape=shape), physics=physics)
        with mpmath.workdps(40):
            world = World.of(scene, 20)
            v, w, where = (
                {k: tuple(map(mpmath.mpf, row)) for k, row in enumerate(array)}
                for array in (*motion_of(rows, arrays.radius), places)
            )
            v, w, hits = laws.collide(world, where, v, w, pairs, mpmath.mpf(10) ** -14)
        if len(hits) > 20:
            continue
        compared += 1
        velocities, spins = motion_of(after, arrays.radius)
        assert velocities == pytest.approx(np.array([v[k] for k in sorted(v)], float), abs=1e-11)
        assert spins == pytest.approx(np.array([w[k] for k in sorted(w)], float), abs=1e-9)
    assert compared >= 15
