# Simultaneous impacts


def solve(n_balls, contacts, inverse):
    """Impulses of contacts (first, second, angle of the normal, speed of approach)."""
    first, second, angle, closing = (np.array(column) for column in zip(*contacts, strict=True))
    count = len(contacts)
    impulse = np.empty(count)
    joint_impulses(
        count,
        first.astype(np.int64),
        second.astype(np.int64),
        np.cos(angle),
        np.sin(angle),
        closing.astype(float),
        np.array(inverse, float),
        impulse,
        np.empty((4, count)),
        np.empty((MOST, WIDTH)),
        np.empty((n_balls, 2)),
        np.zeros(n_balls, np.bool_),
    )
    return impulse


def opening(n_balls, contacts, inverse, impulse):
    """The contacts' speeds of separation after the impulses."""
    dv = np.zeros((n_balls, 2))
    for (i, j, angle, _), p in zip(contacts, impulse, strict=True):
        n = np.array([math.cos(angle), math.sin(angle)])
        dv[i] -= p * inverse[i] * n
        dv[j] += p * inverse[j] * n
    return np.array(
        [(dv[j] - dv[i]) @ [math.cos(angle), math.sin(angle)] - closing for i, j, angle, closing in contacts]
    )


def flower(leaves, rng):
    """Contacts of a ball with neighbours around it that touch each other, as in a rack of seven."""
    contacts = [(0, k + 1, k * math.pi / 3, rng.uniform(0.01, 2)) for k in range(leaves)]
    contacts += [(k + 1, k + 2, (k + 2) * math.pi / 3, rng.uniform(0.01, 2)) for k in range(leaves - 1)]
    return contacts


@given(st.integers(0, 10**6), st.integers(2, 6), st.booleans())
def test_joint_impulses_solve_the_complementarity_problem(seed, leaves, fixed):
    rng = np.random.default_rng(seed)
    inverse = rng.uniform(0.5, 5, leaves + 1)
    if fixed:
        inverse[leaves] = 0.0
    contacts = flower(leaves, rng)
    impulse = solve(leaves + 1, contacts, inverse)
    separation = opening(leaves + 1, contacts, inverse, impulse)
    assert (impulse >= 0).all()
    assert (separation >= -1e-11).all()
    assert np.abs(impulse * separation).max() <= 1e-11
    assert impulse.any()


@given(st.integers(0, 10**6), st.integers(2, 6))
def test_joint_impulses_do_not_depend_on_the_order_and_mirror_bit_for_bit(seed, leaves):
    rng = np.random.default_rng(seed)
    contacts = flower(leaves, rng)
    inverse = np.full(leaves + 1, 1 / 0.17)
    impulse = solve(leaves + 1, contacts, inverse)
    order = rng.permutation(len(contacts))
    names = rng.permutation(leaves + 1)
    other = [(int(names[i]), int(names[j]), a, c) for i, j, a, c in (contacts[k] for k in order)]
    assert np.array_equal(solve(leaves + 1, other, inverse), impulse[order])


def triangle(rows):
    """Number of balls and contacts (first, second, angle) of a frozen rack; from four rows on more than it needs."""
    places = [(c - r / 2, r * math.sqrt(0.75)) for r in range(rows) for c in range(r + 1)]
    angles = {
        (i, j): math.atan2(places[j][1] - places[i][1], places[j][0] - places[i][0])
        for i in range(len(places))
        for j in range(i + 1, len(places))
        if math.dist(places[i], places[j]) < 1.01
    }
    return len(places), [(i, j, angle) for (i, j), angle in angles.items()]


@pytest.mark.parametrize("rows", [4, 5, 8])
@pytest.mark.parametrize("alike", [True, False])
def test_racks_with_more_contacts_than_they_need_are_solved_alike_in_any_order(rows, alike):
    n, frozen = triangle(rows)
    within = 1e-12 if rows < 8 else 1e-11  # what 2000 sweeps of the descent reach
    assert (len(frozen) <= MOST) == (rows < 8)  # few are solved directly, many by descent
    for seed in range(20 if rows < 8 else 3):
        rng = np.random.default_rng(seed)
        contacts = [(*contact, rng.uniform(0.01, 2)) for contact in frozen]
        inverse = np.full(n, 1 / 0.17) if alike else rng.uniform(0.5, 5, n)
        impulse = solve(n, contacts, inverse)
        separation = opening(n, contacts, inverse, impulse)
        assert (impulse >= 0).all()
        assert (separation >= -within).all()
        assert np.abs(impulse * separation).max() <= within
        order, names = rng.permutation(len(contacts)), rng.permutation(n)
        other = [(int(names[i]), int(names[j]), a, c) for i, j, a, c in (contacts[k] for k in order)]
        renamed = np.empty(n)
        renamed[names] = inverse
        assert np.array_equal(solve(n, other, renamed), impulse[order])


def test_two_contacts_have_a_closed_form():
    # A ball strikes two that touch, symmetrically: p = m v cos(30) / 2.5, see the plastic solution
    contacts = [(0, 1, math.pi / 6, math.cos(math.pi / 6)), (0, 2, -math.pi / 6, math.cos(math.pi / 6))]
    assert solve(3, contacts, [1.0] * 3) == pytest.approx([math.cos(math.pi / 6) / 2.5] * 2, rel=1e-15)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_of_two_contacts_one_may_open_by_itself(order):
    # Ball 1 is pushed out from between by ball 0 so fast that it leaves ball 2 behind
    contacts = [(0, 1, 0.0, 5.0), (1, 2, math.pi, 0.1)]
    found = solve(3, [contacts[k] for k in order], [1.0] * 3)
    assert found[list(order)] == pytest.approx([2.5, 0.0])


def test_contacts_without_a_ball_in_common_do_not_mix():
    contacts = [(0, 1, 0.3, 1.0), (2, 3, 1.0, 2.0), (4, 5, 2.0, 4.0)]
    assert solve(6, contacts, [1.0] * 6) == pytest.approx([0.5, 1.0, 2.0], rel=1e-15)


@given(st.integers(0, 10**6))
def test_impulses_are_added_up_exactly_in_any_order(seed):
    rng = np.random.default_rng(seed)
    contacts = flower(6, rng)
    count, n = len(contacts), 7
    first, second = (np.array([c[k] for c in contacts]) for k in (0, 1))
    nx, ny = np.cos([c[2] for c in contacts]), np.sin([c[2] for c in contacts])
    impulse, inverse = rng.uniform(0, 1, count), np.full(n, 1.0)
    results = []
    for order in (np.arange(count), rng.permutation(count)):
        dv, done = np.zeros((n, 2)), np.zeros(n, np.bool_)
        apply_impulses(
            count, first[order], second[order], nx[order], ny[order], impulse[order], np.ones(count), inverse, dv, done
        )
        assert done.all()
        results.append(dv)
    assert np.array_equal(*results)
    assert not results[0].sum(axis=0).any()  # momentum, to the last bit
    assume(impulse.max() > 0.1)
    plain = np.zeros((n, 2))
    for i, j, x, y, p in zip(first, second, nx, ny, impulse, strict=True):
        plain[i] -= p * np.array([x, y])
        plain[j] += p * np.array([x, y])
    assert results[0] == pytest.approx(plain, abs=1e-14)
