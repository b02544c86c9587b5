"""Simultaneous impacts of several pairs of balls."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env.engine.compile import scene_arrays
from billiards_env.jit import allocating, allocating_entry_point
from billiards_env.physics.clusters.complementarity import MOST
from billiards_env.physics.clusters.impulses import empty_contacts, empty_scratch, solve_plastic, sum_impulses
from billiards_env.physics.state import VX, VY, WIDTH
from billiards_env.scene import Balls, Physics, Scene
from tests.helpers.clusters import cluster, triangle
from tests.helpers.impacts import approaching, collide


@allocating
def fill(first, second, nx, ny, closing, rebound):
    """Returns `Contacts` with these arrays."""
    contacts = empty_contacts(len(first))
    contacts.first[:], contacts.second[:] = first, second
    contacts.nx[:], contacts.ny[:], contacts.closing[:], contacts.rebound[:] = nx, ny, closing, rebound
    return contacts


@allocating_entry_point
def plastic(first, second, nx, ny, wanted, inv_mass):
    """Returns the plastic impulses (count,) and changes of velocity (n, 2)."""
    count, n = len(first), len(inv_mass)
    contacts, scratch = fill(first, second, nx, ny, wanted, 0.0 * wanted), empty_scratch(n, count, None)
    scratch.wanted[:, 0], scratch.wanted[:, 1] = wanted, 0.0
    scratch.change[:] = 0.0
    solve_plastic(count, contacts, inv_mass, scratch)
    return scratch.impulse[:, 0] + scratch.impulse[:, 1], scratch.change[:, 0::2] + scratch.change[:, 1::2]


@allocating_entry_point
def summed(first, second, nx, ny, impulse, inv_mass):
    """Returns the changes of velocity (n, 2) by these impulses, and whether each ball has one (n,)."""
    count, n = len(first), len(inv_mass)
    contacts = fill(first, second, nx, ny, np.zeros(count), np.zeros(count))
    dv, done = np.zeros((n, 2)), np.zeros(n, np.bool_)
    sum_impulses(count, contacts, impulse, np.ones(count), inv_mass, dv, done)
    return dv, done


def solve(contacts, inverse):
    """Returns `plastic` for contacts (first, second, angle of the normal, speed of approach)."""
    first, second, angle, closing = (np.array(column) for column in zip(*contacts, strict=True))
    return plastic(
        first.astype(np.int64),
        second.astype(np.int64),
        np.cos(angle),
        np.sin(angle),
        closing.astype(float),
        np.array(inverse, float),
    )


def opening(contacts, change):
    """Returns the speeds of separation of the contacts after the changes of velocity."""
    return np.array(
        [(change[j] - change[i]) @ [math.cos(angle), math.sin(angle)] - closing for i, j, angle, closing in contacts]
    )


def flower(leaves, rng):
    """Returns the contacts of a ball with neighbours around it, which touch each other."""
    contacts = [(0, k + 1, k * math.pi / 3, rng.uniform(0.01, 2)) for k in range(leaves)]
    contacts += [(k + 1, k + 2, (k + 2) * math.pi / 3, rng.uniform(0.01, 2)) for k in range(leaves - 1)]
    return contacts


@given(st.integers(0, 10**6), st.integers(2, 6), st.booleans())
def test_plastic_impulses_solve_the_complementarity_problem(seed, leaves, fixed):
    rng = np.random.default_rng(seed)
    inverse = rng.uniform(0.5, 5, leaves + 1)
    if fixed:
        inverse[leaves] = 0.0
    contacts = flower(leaves, rng)
    impulse, change = solve(contacts, inverse)
    separation = opening(contacts, change)
    assert (impulse >= 0).all()
    assert (separation >= -1e-11).all()
    assert np.abs(impulse * separation).max() <= 1e-11
    assert impulse.any()


@pytest.mark.parametrize("rows", [4, 5, 8])
@pytest.mark.parametrize("equal", [True, False])
def test_impulses_of_racks_with_redundant_contacts_solve_the_complementarity_problem(rows, equal):
    n, frozen = triangle(rows)
    within = 1e-12 if rows < 8 else 1e-11  # the accuracy of 2000 sweeps of the descent
    assert (len(frozen) <= MOST) == (rows < 8)  # a small problem is solved directly, a large one by descent
    for seed in range(20 if rows < 8 else 3):
        rng = np.random.default_rng(seed)
        contacts = [(*contact, rng.uniform(0.01, 2)) for contact in frozen]
        inverse = np.full(n, 1 / 0.17) if equal else rng.uniform(0.5, 5, n)
        impulse, change = solve(contacts, inverse)
        separation = opening(contacts, change)
        assert (impulse >= 0).all()
        assert (separation >= -within).all()
        assert np.abs(impulse * separation).max() <= within


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_one_of_two_contacts_may_open_without_an_impulse(order):
    # Ball 0 pushes ball 1 away from ball 2.
    contacts = [(0, 1, 0.0, 5.0), (1, 2, math.pi, 0.1)]
    found, _ = solve([contacts[k] for k in order], [1.0] * 3)
    assert found[list(order)] == pytest.approx([2.5, 0.0])


def test_contacts_without_a_common_ball_are_independent():
    contacts = [(0, 1, 0.3, 1.0), (2, 3, 1.0, 2.0), (4, 5, 2.0, 4.0)]
    assert solve(contacts, [1.0] * 6)[0] == pytest.approx([0.5, 1.0, 2.0], rel=1e-15)


@given(st.integers(0, 10**6))
def test_the_sum_of_impulses_is_the_same_bit_for_bit_in_any_order(seed):
    rng = np.random.default_rng(seed)
    drawn = flower(6, rng)
    count, n = len(drawn), 7
    first, second = (np.array([c[k] for c in drawn]) for k in (0, 1))
    nx, ny = np.cos([c[2] for c in drawn]), np.sin([c[2] for c in drawn])
    impulse, inverse = rng.uniform(0.2, 1, count), np.full(n, 1.0)
    results = []
    for order in (np.arange(count), rng.permutation(count)):
        dv, done = summed(first[order], second[order], nx[order], ny[order], impulse[order], inverse)
        assert done.all()
        results.append(dv)
    assert np.array_equal(*results)
    assert not results[0].sum(axis=0).any()  # momentum is exactly zero
    plain = np.zeros((n, 2))
    for i, j, x, y, p in zip(first, second, nx, ny, impulse, strict=True):
        plain[i] -= p * np.array([x, y])
        plain[j] += p * np.array([x, y])
    assert results[0] == pytest.approx(plain, abs=1e-14)


# Regressions


def collided(places, velocities, inverse, pairs, e, rebound):
    """Returns the velocities after the impacts of those pairs that approach."""
    state = np.zeros((len(places), WIDTH))
    state[:, [VX, VY]] = velocities
    chosen, impacts = approaching(places, velocities, pairs)
    if len(chosen):
        arrays = scene_arrays(Scene(Balls.uniform(1), physics=Physics(cushion="restitution", e_ball=e)))
        arrays = arrays._replace(radius=inverse, inv_mass=inverse)
        collide(impacts, rebound[chosen], state, arrays)
    return state[:, [VX, VY]]


def check_renumbering(rng, places, velocities, inverse, pairs, e, least, found):
    """Checks that `collided` returns the velocities `found` bit for bit with balls and contacts in random order."""
    names, order = rng.permutation(len(places)), rng.permutation(len(pairs))
    back = np.argsort(names)
    renamed = [tuple(sorted((int(back[pairs[k][0]]), int(back[pairs[k][1]])))) for k in order]
    again = collided(places[names], velocities[names], inverse[names], renamed, e, least[order])
    assert np.array_equal(again, found[names])


@given(st.integers(0, 2**32), st.integers(3, 30), st.floats(0, 1), st.booleans())
def test_the_order_of_balls_and_contacts_changes_no_bit(seed, n, e, rebounds):
    """The coupling of two contacts was once a product of factors whose order depended on the numbers of the balls."""
    rng = np.random.default_rng(seed)
    places, inverse, pairs = cluster(rng, n)
    velocities = rng.normal(size=(n, 2)) * (rng.random((n, 1)) < 0.6)
    least = rng.uniform(0, 0.1, len(pairs)) * rebounds
    found = collided(places, velocities, inverse, pairs, e, least)
    check_renumbering(rng, places, velocities, inverse, pairs, e, least, found)
    for mirror in ([1, -1], [-1, 1]):
        mirrored = collided(places * mirror, velocities * mirror, inverse, pairs, e, least)
        assert np.array_equal(mirrored, found * mirror)


def exact_row(masses, velocities, e):
    """Returns the exact velocities after the impact of a row of balls in contact: the best of all sets of contacts."""
    n = len(masses)
    best = None
    for closed in itertools.product(
        [False, True], repeat=n - 1
    ):  # the pairs that have equal velocities after the plastic impact
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


@pytest.mark.parametrize("ratio", [1.0, 1e2, 1e4, 1e8, 1e12, 1e16])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(
    ("heavy", "velocities"),
    [
        ([1, 0, 1], [1.0, 0.0, -0.5]),
        ([0, 1, 0], [1.0, 0.0, -0.5]),
        ([1, 0, 0, 1], [1.0, 0.5, 0.0, -0.75]),
        ([1, 0, 1, 0, 1], [1.0, 0.75, 0.5, 0.0, -0.5]),
        ([0, 1, 0, 1, 0], [1.0, 0.75, 0.5, 0.0, -0.5]),
        ([1, 1, 0, 0, 1], [1.0, 0.5, 0.25, -0.125, -1.0]),
    ],
)
def test_extreme_mass_ratios_lose_no_digits(heavy, velocities, ratio, e):
    """With a ratio of 1e16 a velocity once had the wrong sign, because 1 - a^2 was computed with cancellation."""
    mass = [math.sqrt(ratio) if h else 1 / math.sqrt(ratio) for h in heavy]
    inverse = 1.0 / np.array(mass)
    n = len(mass)
    exact_masses = [1 / Fraction(x) for x in inverse]
    want = exact_row(exact_masses, [Fraction(v) for v in velocities], Fraction(e))
    places = np.stack([np.arange(n), np.zeros(n)], 1)
    got = collided(
        places, np.stack([velocities, np.zeros(n)], 1), inverse, [(k, k + 1) for k in range(n - 1)], e, np.zeros(n - 1)
    )
    for found, exact in zip(got[:, 0], want, strict=True):
        # The second term is the rounding of the largest velocity, for balls that stop by cancellation.
        assert abs(Fraction(found) - exact) <= abs(exact) * Fraction(1e-14) + Fraction(2.0**-53)
    before, after = (
        sum(m * Fraction(v) ** 2 for m, v in zip(exact_masses, row, strict=True)) for row in (want, got[:, 0])
    )
    assert abs(after - before) <= before * Fraction(1e-14)


@given(st.integers(0, 10**6), st.integers(3, 12), st.floats(0, 1))
def test_all_contacts_separate_at_least_at_the_minimum_speed(seed, n, e):
    rng = np.random.default_rng(seed)
    places, inverse, pairs = cluster(rng, n)
    velocities = rng.normal(size=(n, 2)) * (rng.random((n, 1)) < 0.6)
    least = rng.uniform(0, 0.1, len(pairs))
    after = collided(places, velocities, inverse, pairs, e, least)
    for (i, j), rebound in zip(pairs, least, strict=True):
        normal = (places[j] - places[i]) / math.dist(places[i], places[j])
        if normal @ (velocities[j] - velocities[i]) < 0:
            assert normal @ (after[j] - after[i]) >= rebound - 1e-13 * np.abs(after).max()
    drift = ((after - velocities) / inverse[:, None]).sum(axis=0)
    assert drift == pytest.approx([0, 0], abs=1e-12 * (np.abs(after).max() / inverse.min()))


@pytest.mark.parametrize("rows", [4, 5, 8])
@pytest.mark.parametrize("equal", [True, False])
@pytest.mark.parametrize("e", [0.0, 0.95, 1.0])
def test_the_order_of_a_frozen_rack_changes_no_bit(rows, equal, e):
    """The contacts of a rack are redundant: the impulses are not unique, but the velocities are."""
    spots = np.array([(c - r / 2, r * math.sqrt(0.75)) for r in range(rows) for c in range(r + 1)])
    n, frozen = triangle(rows)
    pairs = [(i, j) for i, j, _ in frozen]
    for seed in range(20 if rows < 8 else 3):
        rng = np.random.default_rng(seed)
        velocities = rng.normal(size=(n, 2))
        inverse = np.full(n, 1 / 0.17) if equal else rng.uniform(0.5, 5, n)
        found = collided(spots, velocities, inverse, pairs, e, np.zeros(len(pairs)))
        check_renumbering(rng, spots, velocities, inverse, pairs, e, np.zeros(len(pairs)), found)
