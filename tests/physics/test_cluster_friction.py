"""The friction of several pairs of balls that collide at one instant."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env.physics.state import UX, UY, VX, VY, WIDTH, WZ
from tests.helpers.clusters import triangle
from tests.helpers.impacts import collide
from tests.helpers.rubbing_clusters import arrays_of, collided, drawn, energy

CASES = {
    "seed": st.integers(0, 2**32),
    "n": st.integers(3, 30),
    "e": st.floats(0, 1),
    "mu": st.sampled_from([None, 0.06, 0.5, 5.0]),
    "fixed": st.booleans(),
    "spheres": st.booleans(),
}


@given(**CASES)
def test_joint_impacts_with_friction_lose_energy_and_keep_momentum(seed, n, e, mu, fixed, spheres):
    _, places, rows, pairs, arrays = drawn(seed, n, e, mu, fixed, spheres=spheres)
    found, _ = collided(places, rows, pairs, arrays)
    assert energy(found, arrays) <= energy(rows, arrays) * (1 + 1e-12)
    assert np.array_equal(found[arrays.inv_mass == 0], rows[arrays.inv_mass == 0])
    if not fixed:
        mass = 1 / arrays.inv_mass
        change = mass @ (found - rows)[:, VX : VY + 1]
        assert np.abs(change).max() <= 1e-14 * mass.max() * (1 + np.abs(rows[:, VX : VY + 1]).max()) * n


@given(**CASES, rebound=st.sampled_from([0.0, 0.1]))
def test_joint_impacts_with_friction_have_no_preferred_order_or_side(seed, n, e, mu, fixed, spheres, rebound):
    rng, places, rows, pairs, arrays = drawn(seed, n, e, mu, fixed, spheres=spheres)
    found, _ = collided(places, rows, pairs, arrays, rebound)
    names, order = rng.permutation(n), rng.permutation(len(pairs))
    back = np.argsort(names)
    renamed = [tuple(sorted((int(back[pairs[k][0]]), int(back[pairs[k][1]])))) for k in order]
    radius = arrays.radius[names]
    other = arrays._replace(radius=radius, inv_mass=arrays.inv_mass[names], spheres=radius if spheres else None)
    assert np.array_equal(collided(places[names], rows[names], renamed, other, rebound)[0], found[names])
    for columns, mirror in (([VX, UX, WZ], [-1, 1]), ([VY, UY, WZ], [1, -1])):
        signs = np.ones(WIDTH)
        signs[columns] = -1
        assert np.array_equal(collided(places * mirror, rows * signs, pairs, arrays, rebound)[0], found * signs)


@pytest.mark.parametrize("rows_of_rack", [4, 5])
def test_a_frozen_rack_with_redundant_contacts_has_no_preferred_order(rows_of_rack):
    """Normal impulses of redundant contacts are not unique; the friction depends on the smallest ones."""
    n, contacts = triangle(rows_of_rack)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        closing = rng.uniform(0.01, 2, len(contacts))
        start = np.zeros((n, WIDTH))
        start[:, VX : UY + 1] = rng.normal(size=(n, UY + 1 - VX))
        start[:, WZ] = rng.normal(size=n) * 30
        arrays = arrays_of(radius=np.full(n, 0.03), inverse=np.full(n, 1 / 0.17))
        first, second, angle = (np.array(column) for column in zip(*contacts, strict=True))
        nx, ny = np.cos(angle), np.sin(angle)
        results = []
        for order, names in (
            (np.arange(len(contacts)), np.arange(n)),
            (rng.permutation(len(contacts)), rng.permutation(n)),
        ):
            rows = np.empty_like(start)
            rows[names] = start
            pick = names[first[order]], names[second[order]], nx[order], ny[order], closing[order]
            collide(pick, np.zeros(len(order)), rows, arrays)
            results.append(rows[names])
        assert np.array_equal(*results)


@given(st.integers(0, 2**32), st.booleans(), st.booleans())
def test_separate_impacts_at_one_instant_are_those_of_single_impacts(seed, fixed, spheres):
    places = np.array([[0.0, 0.0], [0.8, 0.6], [9.0, 0.0], [9.0, 1.0]])
    _, _, rows, _, arrays = drawn(seed, 4, 0.9, None, fixed, spheres=spheres)
    both, _ = collided(places, rows, [(0, 1), (2, 3)], arrays)
    single, _ = collided(places, rows, [(0, 1)], arrays)
    single, _ = collided(places, single, [(2, 3)], arrays)
    assert both == pytest.approx(single, abs=1e-12)


@given(**{**CASES, "fixed": st.just(False)})
def test_friction_dissipates_as_much_as_it_can(seed, n, e, mu, fixed, spheres):
    """The slips and impulses satisfy the conditions of the minimum: no small change of an impulse lowers the energy."""
    _, places, rows, pairs, arrays = drawn(seed, n, e, mu, fixed, masses=False, spheres=spheres)
    found, count = collided(places, rows, pairs, arrays)
    if not count:
        return
    smooth = collided(places, rows, pairs, arrays_of(e, 0.0, arrays.radius, arrays.inv_mass, spheres))[0]
    assert energy(found, arrays) <= energy(smooth, arrays) * (1 + 1e-12)
    if mu == 5.0 and count <= n:  # friction stops the slip unless a normal impulse is zero
        assert energy(found, arrays) < energy(smooth, arrays)
