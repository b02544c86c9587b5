"""Shots on tables with outlines: both engines, all queues, and cases that are difficult near jaws."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env.engine import PIC, Engine
from billiards_env.engine.overlaps import FIXES
from billiards_env.scene import Balls, Physics, Pocket, Scene, Table
from billiards_env.scene.outline import clearance, pieces
from tests.helpers.engine_runs import CELL_GRID, check
from tests.helpers.outlines import ANY_TABLE, TABLES, beyond, table, with_corners
from tests.helpers.shots import FREE, ROLLING, SLIDING, kinds, outline_shot, simulate
from tests.helpers.shots import OUTLINE_LAWS as LAWS

R = 0.028575
seeds = st.integers(0, 2**32)


def scene_of(a_table, n=1, physics=SLIDING, radius=R, **changes):
    return Scene(Balls.uniform(n, radius), a_table, Physics(**{**physics, **changes}))


def play(scene, places, velocities, spins=None, record=True, **options):
    horizon = 2.0 if scene.physics.motion == "ideal" else None
    return simulate(scene, places, velocities, spins=spins, max_time=horizon, record=record, **options)


# The rectangle


def test_a_ball_frozen_in_a_corner_hits_the_cushion_that_it_moves_to_at_once():
    # The spin accelerates the ball into the other cushion. The rounding of that gap is 5 ns of acceleration from rest.
    scene = Scene(Balls((0.02,), (0.05,)), with_corners(Table(1.0, 0.8, 0.028)), Scene.named("uk_pool").physics)
    shot = simulate(scene, [[0.48, 0.38]], [0.0, 1.0], spins=[[0.0, 50.0, 0.0]], record=True)
    assert shot.events["other"][0] == 2
    assert shot.events["time"][0] < 1e-15


@pytest.mark.parametrize("physics", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("pit", [False, True])
def test_a_rectangle_as_an_outline_is_the_plain_rectangle(physics, pit):
    pockets = (Pocket(0.5, 0.25, 0.06), Pocket(0.0, -0.25, 0.06))
    rectangle = Table(1.0, 0.5, 0.036, pockets)
    outline = with_corners(rectangle)
    numbers = [3, 1, 0, 2]  # the cushions of the rectangle along -x, +x, -y, +y
    engine = Engine("pit", 1 / 120) if pit else PIC
    for seed in range(30):
        scene, places, velocities, spins = outline_shot(outline, np.random.default_rng(seed), 2, physics)
        shot = play(scene, places, velocities, spins, engine=engine)
        same = play(dataclasses.replace(scene, table=rectangle), places, velocities, spins, engine=engine)
        expected = [(k, b, numbers[o] if k == "cushion" else o) for k, b, o in kinds(same)]
        # After several impacts a difference of rounding may be large.
        until = next((k for k, hits in enumerate(np.cumsum(same.events["kind"] == "ball_ball")) if hits > 2), None)
        assert kinds(shot)[:until] == expected[:until]
        assert shot.events["time"][:until] == pytest.approx(same.events["time"][:until], abs=1e-9)
        if until is None:
            assert shot.positions == pytest.approx(same.positions, abs=1e-9)


# Tips


@pytest.mark.parametrize("radius", [0.0, 0.004, 0.05])
def test_a_tip_is_like_a_fixed_ball(radius):
    a_table = table([(0, 0), (2, 0), (2, 0.8), (0.8, 0.8, radius), (0.8, 2), (0, 2)])
    tip = pieces(a_table.outline)[1][0]
    rng = np.random.default_rng(0)
    fixed = max(radius, 1e-3)
    hits = 0
    for _ in range(200):
        angle = rng.uniform(math.pi, 1.5 * math.pi)
        start = np.array([tip.x, tip.y]) + 0.3 * np.array([math.cos(angle), math.sin(angle)])
        aim = np.array([tip.x, tip.y]) - start + rng.uniform(-0.04, 0.04, 2)
        physics = Physics(motion="rolling", cushion="restitution", e_ball=0.8, e_cushion=0.8)
        shot = simulate(Scene(Balls.uniform(1, R), a_table, physics), [start], aim, record=True)
        if kinds(shot)[0] != ("cushion", 0, 6):
            continue
        hits += 1
        # A fixed ball of the same reach
        balls = Balls((R - fixed + radius, fixed), (0.17, math.inf))
        same = simulate(Scene(balls, Table(8.0, 8.0), physics), [start, [tip.x, tip.y]], aim, record=True)
        assert kinds(same)[0] == ("ball_ball", 0, 1)
        assert shot.events["time"][0] == pytest.approx(same.events["time"][0], abs=1e-14)
        assert shot.events["speed"][0] == pytest.approx(same.events["speed"][0], abs=1e-13)
        t = shot.events["time"][0] + 0.01
        assert shot.at(t)[0] == pytest.approx(same.at(t)[0], abs=1e-14)
    assert hits > 50


# All shots


@settings(max_examples=40)
@given(ANY_TABLE, seeds, st.sampled_from(sorted(LAWS)), st.integers(1, 2))
def test_no_ball_overlaps_the_outline(a_table, seed, law, n):
    scene, places, velocities, spins = outline_shot(a_table, np.random.default_rng(seed), n, LAWS[law])
    shot = play(scene, places, velocities, spins)
    assert shot.status == ("max_time" if law == "ideal" and not shot.potted.all() else "rest")
    assert beyond(scene, shot, 300) < 1e-12


@pytest.mark.parametrize("name", TABLES)
def test_all_queues_have_the_same_bits(name):
    """The scene has the laws of UK pool, whose engines other tests compile too."""
    rng = np.random.default_rng(3)
    for n in (3, 4):
        scene, places, velocities, spins = outline_shot(TABLES[name], rng, n)
        assert spins is not None
        balls = Balls((0.9 * R, *(R,) * (n - 1)), scene.balls.mass, shape="sphere")
        scene = dataclasses.replace(scene, balls=balls, physics=Scene.named("uk_pool").physics)
        check((scene, places[None], velocities[None], np.array([spins])), [CELL_GRID], record=True)


# PIT


FIXES_BY_TABLE = [
    ("octagon", "none"),
    ("L", "push_apart"),
    ("pool_7ft", "move_back"),
    ("throat", "push_apart"),
    ("pool_7ft", "time_of_impact"),
]


@pytest.mark.parametrize(("name", "fix"), FIXES_BY_TABLE)
def test_pit_approaches_pic_as_the_timestep_falls(name, fix):
    rng = np.random.default_rng(0)
    errors = {1e-3: [], 1e-5: []}
    for _ in range(12):
        scene, places, velocities, spins = outline_shot(TABLES[name], rng)
        exact = simulate(scene, places, velocities, spins=spins, max_time=1.5)
        for dt, distances in errors.items():
            shot = simulate(scene, places, velocities, spins=spins, max_time=1.5, engine=Engine("pit", dt, fix))
            distances.append(np.hypot(*(shot.positions - exact.positions)[0]))
    coarse, fine = (np.median(distances) for distances in errors.values())
    assert fine < 0.05 * coarse + 1e-12
    assert fine < 1e-4


@pytest.mark.parametrize("fix", FIXES)
@settings(max_examples=20)
@given(ANY_TABLE, seeds, st.sampled_from([1 / 240, 1 / 60, 1 / 15, 1.0]), st.sampled_from([0.3, 3.0, 30.0]))
def test_pit_loses_no_ball_outside_the_outline(fix, a_table, seed, dt, speed):
    scene, places, velocities, spins = outline_shot(a_table, np.random.default_rng(seed), 2)
    velocities *= speed / np.linalg.norm(velocities)
    spins *= 0.1 * speed
    shot = simulate(scene, places, velocities, spins=spins, engine=Engine("pit", dt, fix), max_time=max(20.0, 100 * dt))
    room = clearance(a_table.outline, shot.positions)[~shot.potted]
    if shot.status == "rest" and fix != "none":
        assert (room > (0.05 - R if a_table is TABLES["throat"] else R) - 1e-12).all()  # the throat is 50 mm wide
    assert (room > -(R + 2 * speed * dt)).all()


@pytest.mark.parametrize("fix", ["push_apart", "move_back", "time_of_impact"])
def test_a_ball_that_has_passed_a_facing_returns_to_the_table(fix):
    """In one step it leaves the throat through the side wall, into the cushion."""
    scene = scene_of(TABLES["throat"], 1, FREE)
    shot = simulate(scene, [[0.5, 0.0]], [0.0, 3.0], engine=Engine("pit", 0.1, fix), max_time=0.1)
    assert clearance(scene.table.outline, shot.positions)[0] >= -1e-12
    assert shot.velocities[0] == pytest.approx([0.0, -3.0])


@pytest.mark.parametrize("fix", ["move_back", "time_of_impact"])
def test_a_ball_that_goes_back_has_the_exact_velocity_after_a_tip(fix):
    scene = scene_of(TABLES["L"], 1, FREE)
    tip = pieces(scene.table.outline)[1][0]
    start = [[tip.x - 0.3, tip.y - 0.35]]
    exact = simulate(scene, start, [1.2, 1.25], max_time=0.35, record=True)
    shot = simulate(scene, start, [1.2, 1.25], max_time=0.35, record=True, engine=Engine("pit", 0.01, fix))
    assert kinds(exact) == kinds(shot) == [("cushion", 0, 6)]
    assert shot.velocities == pytest.approx(exact.velocities, abs=1e-12)
    if fix == "time_of_impact":
        assert shot.positions == pytest.approx(exact.positions, abs=1e-13)


# Named cases


@pytest.mark.parametrize("physics", LAWS.values(), ids=LAWS)
def test_a_ball_wedged_in_a_throat_narrower_than_itself_stays_out_and_ends(physics):
    """The throat is 50 mm wide between the tips, the ball 57 mm."""
    scene = scene_of(TABLES["throat"], 1, physics)
    rng = np.random.default_rng(0)
    for seed in range(40):
        offset = 0.0 if seed == 0 else rng.normal() * 10.0 ** rng.uniform(-16, -2)
        aim = np.array([1.0, rng.normal() * 10.0 ** rng.uniform(-16, -1) if seed else 0.0])
        spins = rng.normal(size=3) * 50 if physics is SLIDING else None
        shot = play(scene, [[0.0, offset]], rng.uniform(0.05, 3.0) * aim, spins)
        assert shot.n_events < 3000
        assert shot.positions[0, 0] < 0.252  # where it touches both tips
        assert beyond(scene, shot, 200) < 1e-12


@pytest.mark.parametrize(("degrees", "stops"), [(1.0, False), (0.2, False), (0.15, True), (0.01, True)])
def test_the_contact_rule_stops_an_elastic_ball_only_in_a_sharp_wedge(degrees, stops):
    """A ball that goes into a wedge along its bisector, nearly, has pi / angle impacts on its way in and out."""
    half = math.radians(degrees) / 2
    place, end = R / math.sin(half), R / math.sin(half) + 3.0  # of a ball that touches both sides, from the corner
    wedge = table([(0, 0), (end, -end * math.tan(half)), (end, end * math.tan(half))])
    corner = min(wedge.outline, key=lambda c: c.x)
    scene = scene_of(wedge, 1, FREE)
    shot = simulate(scene, [[corner.x + place + 1.0, corner.y + 1e-7]], [-1.0, 0.0], max_time=2.0)
    assert shot.n_contact_rule == int(stops)
    if stops:
        assert (shot.status, shot.velocities.tolist()) == ("rest", [[0.0, 0.0]])
        assert shot.n_events < 1100
    else:
        assert shot.n_events == round(math.pi / (2 * half))
        assert shot.velocities[0] == pytest.approx([1.0, 0.0], abs=1e-12)


def test_a_ball_that_friction_presses_into_a_wedge_comes_to_rest():
    """Backspin or side friction drives the ball into the acute corner; the contact-time rule ends the hops."""
    scene = scene_of(TABLES["wedge"], 1, SLIDING, cushion="restitution")
    acute = -0.5 + R / math.sin(math.atan(0.25))  # the ball touches both cushions
    for spin in ([0.0, -100.0, 0.0], [10.0, -100.0, 0.0], [-3.0, -30.0, 20.0]):
        shot = simulate(scene, [[acute + 1e-9, 0.0]], [0.0, 0.0], spins=spin, record=True)
        assert shot.status == "rest"
        assert shot.n_contact_rule > 0
        assert beyond(scene, shot, 300) < 1e-12
        assert shot.n_events < 20_000


@pytest.mark.parametrize("spin", [20.0, 100.0])
def test_a_ball_pressed_against_a_tip_separates_by_the_contact_time_rule(spin):
    """The spin accelerates a resting ball towards the tip that it touches."""
    scene = scene_of(TABLES["L"], 1, SLIDING, cushion="restitution")
    tip = pieces(scene.table.outline)[1][0]
    direction = np.array([1.0, 1.0]) / math.sqrt(2)
    place = np.array([tip.x, tip.y]) - (tip.radius + R) * direction
    shot = simulate(scene, [place], [0.0, 0.0], spins=[-spin * direction[1], spin * direction[0], 0.0], record=True)
    hits = shot.events[shot.events["kind"] == "cushion"]
    assert shot.status == "rest"
    assert len(hits) > 10
    assert shot.n_contact_rule == hits["rule"].sum() > 0
    assert set(hits["other"].tolist()) == {6}
    assert beyond(scene, shot, 300) < 1e-12
    # A ball that moves around the tip fast enough leaves it, so the rule does not act.
    along = np.array([direction[1], -direction[0]])
    free = simulate(scene, [place], 2.0 * along, record=True)
    assert kinds(free)[0][0] != "cushion"


@pytest.mark.parametrize("speed", [0.5, 2.0, 6.0])
def test_a_ball_that_rolls_along_the_rail_into_a_facing(speed):
    """It passes the first tip of the side pocket, hits the facing or the tip beyond the mouth, or rolls past it."""
    scene = scene_of(dataclasses.replace(Table.named("pool_7ft"), pockets=()))
    y = scene.table.width / 2 - R
    shot = play(scene, [[-0.5, y]], [speed, 0.0], [0.0, speed / R, 0.0])  # spin of rolling
    assert beyond(scene, shot) < 1e-12
    hits = shot.events[shot.events["kind"] == "cushion"]
    # Where the rail begins again behind the mouth of the side pocket, it may graze the tip at the rounding.
    hits = hits[hits["speed"] > 1e-5]
    if speed == 0.5:  # it stops before the corner
        assert len(hits) == 0
        return
    first = hits[0]
    assert first["other"] < len(scene.table.outline)
    assert first["x"] > 0.9
    assert first["y"] == pytest.approx(y, abs=1e-6)


def test_two_balls_in_the_mouth_of_one_pocket():
    """One ball rests between the tips of a corner pocket; another one drives into it."""
    for law, name in ((SLIDING, "pool_7ft"), (ROLLING, "pool_9ft"), (SLIDING, "snooker_12ft")):
        a_table = Table.named(name)
        for pockets in (a_table.pockets, ()):
            scene = scene_of(dataclasses.replace(a_table, pockets=pockets), 2, law)
            x, y = a_table.length / 2, a_table.width / 2
            place = np.array([x, y]) - 0.035
            while clearance(a_table.outline, place) < R:
                place -= 0.001
            for angle in np.linspace(-0.4, 0.4, 9):
                away = np.array([math.cos(math.pi / 4 + angle), math.sin(math.pi / 4 + angle)])
                start = np.array([x, y]) - 0.4 * away
                shot = simulate(scene, [start, place], 3.0 * away, record=True)
                assert shot.status == "rest"
                assert beyond(scene, shot, 300) < 1e-12
                assert shot.first_hit == 1 or shot.cushions[0] > 0
