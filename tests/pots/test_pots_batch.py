"""Pots on many tables: symmetries, unusual scenes, and the same shots in the exact engine."""

import numpy as np
import pytest

from billiards_env import Scene, simulate, simulate_batch
from billiards_env.pots import finder as pots
from billiards_env.pots.finder import find_pots, pot_shots
from billiards_env.scene import layouts
from billiards_env.shots.tables import Tables

MAX_SPEED = 4.0


def tables(scene, m, seed=0):
    """Returns m random layouts, and no potted balls."""
    rng = np.random.default_rng(seed)
    drawn = np.array([layouts.draw("random", scene, rng) for _ in range(m)])
    return drawn, np.zeros((m, scene.n_balls), np.bool_)


def pots_of(scene, positions, potted, **kwargs):
    legal = np.broadcast_to(np.arange(scene.n_balls) > 0, potted.shape)
    return find_pots(Tables(scene, positions, ~potted, legal, MAX_SPEED), **kwargs)


def changed(scene, **kwargs):
    """Returns a scene with other entries of some sections."""
    data = scene.to_dict()
    for section, entries in kwargs.items():
        data[section] = {**data[section], **entries}
    return Scene.from_dict(data)


@pytest.fixture(scope="module")
def three():
    """A scene with three object balls, layouts with one, two or three of them on the table, and their pots."""
    scene = Scene.named("pool", 3)
    positions, potted = tables(scene, 400)
    potted[::2, 3] = potted[::4, 2] = True
    return scene, positions, potted, pots_of(scene, positions, potted)


def test_a_batch_gives_the_same_pots_as_one_table_at_a_time(three):
    scene, positions, potted, listed = three
    assert (listed.rows[..., pots.WALL] > 0).any()  # banks too
    for t in range(len(positions)):
        alone = pots_of(scene, positions[t : t + 1], potted[t : t + 1])
        for one, many in zip(alone, listed, strict=True):
            assert one[0].tobytes() == many[t].tobytes()


def test_without_speeds_the_pots_have_the_same_geometry(three):
    scene, positions, potted, listed = three
    faster = pots_of(scene, positions, potted, speeds=False)
    assert faster.shots.shape == (*listed.shots.shape[:2], 0, pots.SHOT_WIDTH)
    possible = listed.ball > 0
    same = (listed.rows[:, :, None] == faster.rows[:, None]).all(axis=-1).any(axis=-1)
    assert same[possible & (listed.rows[..., pots.WALL] < 0)].all()
    assert (faster.count >= listed.count)[(listed.rows[:, 0, pots.WALL] < 0) & (listed.count > 0)].all()


def test_the_order_of_the_balls_does_not_matter(three):
    scene, positions, potted, listed = three
    order = np.array([0, 2, 3, 1])
    other = pots_of(scene, np.ascontiguousarray(positions[:, order]), np.ascontiguousarray(potted[:, order]))
    for name in ("count", "pocket", "rows", "shots"):
        assert getattr(other, name).tobytes() == getattr(listed, name).tobytes()
    exists = np.arange(listed.ball.shape[1]) < listed.count[:, None]
    assert (order[other.ball] == listed.ball)[exists].all()


@pytest.mark.parametrize("signs", [(-1, 1), (1, -1), (-1, -1)])
def test_mirror_images_give_mirrored_pots(three, signs):
    scene, positions, potted, listed = three
    mirrored = pots_of(scene, positions * signs, potted)
    rows, shots = listed.rows.copy(), listed.shots.copy()
    exists = np.arange(listed.ball.shape[1]) < listed.count[:, None]
    for c, sign in enumerate(signs):
        rows[..., pots.GHOST_X + c] *= sign
        shots[..., pots.DX + c] *= sign
        shots[..., pots.END_X + c] *= sign
        bank = rows[..., pots.WALL] // 2 == c
        rows[..., pots.WALL] += np.where(bank & exists & (sign < 0), 1 - 2 * (rows[..., pots.WALL] % 2), 0)
    rows[..., pots.CUT_SIN] *= signs[0] * signs[1]
    assert (mirrored.count == listed.count).all()
    assert (mirrored.ball == listed.ball).all()
    np.testing.assert_allclose(mirrored.rows, rows, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mirrored.shots, shots, rtol=1e-6, atol=1e-7)
    there = np.array([(q.x, q.y) for q in scene.table.pockets])
    assert (there[mirrored.pocket] == there[listed.pocket] * signs)[exists].all()


OFFSETS = {"pool": [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4)], "real_pool": [(-0.2, -0.3), (0.2, 0.4)]}


@pytest.mark.parametrize(("name", "offset"), [(name, offset) for name in OFFSETS for offset in OFFSETS[name]])
def test_the_cue_ball_comes_to_rest_where_its_path_ends(name, offset):
    scene, rng = Scene.named(name), np.random.default_rng(3)
    positions = np.array([layouts.draw("random", scene, rng) for _ in range(100)])
    potted = np.zeros((100, 2), np.bool_)
    listed = pots_of(scene, positions, potted, most=1, offset=offset)
    shots = listed.shots[:, 0, 0]
    played = shots[:, pots.SPEED] > 0
    velocities = shots[:, [pots.SPEED]] * shots[:, pots.DX : pots.DY + 1]
    spins = np.zeros((100, 2, 3))
    side, top = 2.5 / scene.balls.radius[0] * np.array(offset)
    spins[:, 0] = np.column_stack((-top * velocities[:, 1], top * velocities[:, 0], -side * shots[:, pots.SPEED]))
    batch = simulate_batch(scene, positions[played], velocities[played], spins=spins[played])
    assert batch.potted[:, 1].mean() > 0.98
    alone = batch.potted[:, 1] & ~batch.potted[:, 0] & (batch.cushions_before_hit[:, 1] == 0)
    alone &= batch.cushions[:, 0] < pots.N_GAPS
    assert alone.sum() > 60
    ends = shots[played][:, pots.END_X : pots.END_Y + 1]
    # The path begins at the instant of the hit, which is exact; the two balls do not meet again.
    np.testing.assert_allclose(ends[alone], batch.positions[alone, 0], atol=1e-6)


def test_the_easiest_pots_are_kept(three):
    scene, positions, potted, listed = three
    tolerance = np.where(np.arange(listed.ball.shape[1]) < listed.count[:, None], listed.rows[..., pots.TOLERANCE], 0)
    assert (np.diff(tolerance) <= 0).all()
    easiest = pots_of(scene, positions, potted, most=2)
    assert (easiest.count == np.minimum(listed.count, 2)).mean() > 0.99  # one of the two may be impossible at any speed
    same = easiest.count == np.minimum(listed.count, 2)
    assert easiest.rows[same].tobytes() == np.ascontiguousarray(listed.rows[same, :2]).tobytes()
    assert easiest.shots[same].tobytes() == np.ascontiguousarray(listed.shots[same, :2]).tobytes()


def test_the_position_of_a_potted_ball_does_not_change_the_pots(three):
    scene, positions, potted, listed = three
    moved = positions.copy()
    moved[potted] = positions[potted][::-1] * 0.5
    other = pots_of(scene, moved, potted)
    for one, two in zip(listed, other, strict=True):
        assert one.tobytes() == two.tobytes()
    exists = np.arange(listed.ball.shape[1]) < listed.count[:, None]
    assert not np.take_along_axis(potted, listed.ball, axis=1)[exists].any()


@pytest.fixture(scope="module")
def played():
    """All pots of one ball on 1500 layouts, and their results in the engine."""
    scene = Scene.named("pool")
    positions, potted = tables(scene, 1500)
    listed = pots_of(scene, positions, potted)
    return positions, listed, *play(scene, positions, listed)


def play(scene, positions, listed):
    """Returns the table, pot and speed of each shot, and whether its ball drops in its pocket."""
    t, k, s = listed.shots[..., pots.SPEED].nonzero()
    shots = listed.shots[t, k, s]
    result = simulate_batch(scene, positions[t], shots[:, pots.SPEED, None] * shots[:, : pots.DY + 1])
    there = np.array([(q.x, q.y) for q in scene.table.pockets])[listed.pocket[t, k]]
    ball = listed.ball[t, k]
    at = np.arange(len(t))
    return t, k, s, result.potted[at, ball] & (result.positions[at, ball] == there).all(1)


def test_direct_pots_drop_at_every_cut_and_speed(played):
    _, listed, t, k, s, drops = played
    direct, cosine = listed.rows[t, k, pots.WALL] < 0, listed.rows[t, k, pots.CUT_COS]
    for speed in range(len(pots.SPEEDS)):
        for low, high in ((0.0, 0.5), (0.5, 0.8), (0.8, 1.01)):
            chosen = direct & (s == speed) & (cosine >= low) & (cosine < high)
            assert chosen.sum() > 100
            assert drops[chosen].mean() > 0.99


def test_banks_drop(played):
    _, listed, t, k, _, drops = played
    bank = listed.rows[t, k, pots.WALL] >= 0
    assert len(set(t[bank])) > 20
    assert drops[bank].mean() > 0.95
    assert drops[bank & (k == 0)].mean() > 0.95


def test_banks_are_found_only_without_a_direct_pot(played):
    _, listed, *_ = played
    bank = listed.rows[..., pots.WALL] >= 0
    exists = np.arange(listed.ball.shape[1]) < listed.count[:, None]
    assert ((bank & exists).any(1) == ((bank | ~exists).all(1) & (listed.count > 0))).all()
    assert (listed.count > 0).mean() > 0.99


def test_banks_on_request_are_added_to_the_direct_pots(played):
    positions, listed, *_ = played
    scene = Scene.named("pool")
    more = pots_of(scene, positions, np.zeros(positions.shape[:2], np.bool_), banks=True)
    bank = more.rows[..., pots.WALL] >= 0
    exists = np.arange(more.ball.shape[1]) < more.count[:, None]
    direct = (listed.rows[..., pots.WALL] < 0) & (np.arange(listed.ball.shape[1]) < listed.count[:, None])
    assert more.rows[exists & ~bank].tobytes() == listed.rows[direct].tobytes()
    assert more.shots[exists & ~bank].tobytes() == listed.shots[direct].tobytes()
    assert ((bank & exists).any(1) & direct.any(1)).mean() > 0.3
    tolerance = np.where(exists, more.rows[..., pots.TOLERANCE], 0.0)
    assert (np.diff(tolerance, axis=1) <= 0.0).all()
    t, k, _, drops = play(scene, positions, more)
    assert drops[bank[t, k]].mean() > 0.95


def test_an_ideal_bank_is_that_of_a_mirror():
    # One small pocket near the middle of the cushion +y; the cue ball is on that side of the object ball.
    pocket_y, ball_y = 0.56, -0.1
    ideal = changed(
        Scene.named("pool"),
        table={"pockets": [{"x": 0.0, "y": pocket_y, "radius": 0.035}]},
        physics={"motion": "ideal", "cushion": "restitution", "e_cushion": 1.0, "max_time": 10.0},
    )
    room = ideal.table.width / 2 - ideal.balls.radius[1]
    before, after = room + ball_y, room + pocket_y  # distances from the cushion -y
    for x in (-0.5, 0.5):
        positions = np.array([[1.4 * x, 0.2], [x, ball_y]])
        listed = pots_of(ideal, positions[None], np.zeros((1, 2), np.bool_))
        k = listed.rows[0, : listed.count[0], pots.WALL].tolist().index(2)
        line = positions[1] - listed.rows[0, k, : pots.GHOST_Y + 1]
        bounce = positions[1] - line * before / line[1]
        assert bounce == pytest.approx([x * after / (before + after), -room], abs=1e-9)
        assert simulate(ideal, positions, MAX_SPEED * listed.shots[0, k, -1, : pots.DY + 1]).potted[1]


def test_scratches_before_the_first_cushion_are_predicted(played):
    positions, listed, t, k, s, _ = played
    scene, agree, scratches = Scene.named("pool"), [], 0
    for n in range(0, len(t), 8):
        row = listed.shots[t[n], k[n], s[n]]
        events = simulate(scene, positions[t[n]], row[pots.SPEED] * row[: pots.DY + 1], record=True).events
        assert events is not None
        after = events[np.flatnonzero(events["kind"] == "ball_ball")[0] + 1 :]
        own = after[(after["ball"] == 0) & np.isin(after["kind"], ("cushion", "pocket", "ball_ball"))]
        scratch = len(own) > 0 and own["kind"][0] == "pocket"
        scratches += scratch
        agree.append(scratch == (row[pots.GAPS] < 0))
    assert scratches > 20
    assert np.mean(agree) > 0.97


CUT, RAIL, JAWS = [[0.0, 0.0], [0.9, 0.3]], 0.635 - 0.028575, 1.27 - 0.0579
IDEAL = {"motion": "ideal", "cushion": "restitution", "max_time": 10.0}
ODD = {
    "no pockets": ({"table": {"pockets": []}}, [[0.0, 0.0], [0.5, 0.1]], 0),
    "ideal": ({"physics": IDEAL}, CUT, 1),
    "rolling": ({"physics": {"motion": "rolling", "cushion": "restitution"}}, CUT, 1),
    "small ball": ({"balls": {"radius": [0.03, 0.02]}}, CUT, 1),
    "large ball": ({"balls": {"radius": [0.02, 0.04]}}, CUT, 1),
    "light cue ball": ({"balls": {"mass": [0.1, 0.3]}}, CUT, 1),
    "fixed object ball": ({"balls": {"mass": [0.17, float("inf")]}}, CUT, 0),
    "balls in contact": ({}, [[0.0, 0.0], [0.05715, 0.0]], None),
    "ball on the cushion": ({}, [[0.2, 0.3], [0.7, RAIL]], 1),
    "ball in the corner's jaws": ({}, [[0.2, 0.3], [JAWS, RAIL]], 1),
    "cue ball on the cushion": ({}, [[0.2, RAIL], [0.9, 0.3]], 1),
    "cue ball in the jaws": ({}, [[-JAWS, -RAIL], [0.9, 0.3]], 1),
}


@pytest.mark.parametrize(("changes", "positions", "least"), ODD.values(), ids=ODD)
def test_pots_in_unusual_scenes(changes, positions, least):
    scene = changed(Scene.named("pool"), **changes)
    table = np.array([positions])
    listed = pots_of(scene, table, np.zeros((1, 2), np.bool_))
    assert np.isfinite(listed.rows).all()
    assert np.isfinite(listed.shots).all()
    if least is not None:
        assert (listed.count[0] > 0) == least
    if least:
        assert play(scene, table, listed)[-1].all()
    nothing = pots_of(scene, table, np.array([[False, True]]))
    assert nothing.count[0] == 0
    assert not len(pot_shots(Tables(scene, table, np.ones((1, 2), np.bool_), np.zeros((1, 2), np.bool_), 4.0)).speed)
