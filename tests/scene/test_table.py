import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from billiards_env.scene import CONTACT_GAP, SCENES, TABLES, Balls, Pocket, Scene, Table, check_positions
from billiards_env.scene.outline import clearance, pieces, polygon
from tests.helpers.errors import rejected
from tests.helpers.scenes import HEXAGON, SQUARE, custom, outline

DATA = Path(__file__).parents[1] / "data"
JAWS = [name for name in TABLES if Table.named(name).outline]
# Presets


SIZES = [
    ("pool_7ft", 1.9812, 0.9906),
    ("pool_8ft", 92 * 0.0254, 46 * 0.0254),
    ("pool_9ft", 2.54, 1.27),
    ("snooker_12ft", 3.569, 1.778),
    ("uk_7ft", 1.8288, 0.9144),
    ("carom_10ft", 2.84, 1.42),
]


@pytest.mark.parametrize(("name", "length", "width"), SIZES)
def test_presets_have_the_size_of_real_tables(name, length, width):
    table = Table.named(name)
    assert (table.length, table.width) == (length, width)
    assert table.is_rectangular
    assert len(table.pockets) == (0 if name == "carom_10ft" else 6)
    assert Table.from_dict(json.loads(json.dumps(dataclasses.asdict(table)))) == table


def gap(one, other):
    """Returns the largest difference of two sequences of numbers."""
    return max(abs(a - b) for a, b in zip(one, other, strict=True))


def test_pool_7ft_has_the_geometry_of_pooltool():
    with open(DATA / "pooltool_real_shots.json") as file:
        data = json.load(file)["tables"]["pool"]
    table = Table.named("pool_7ft")
    lines, tips = pieces(table.outline)
    assert abs(clearance(table.outline, data["lines"])).max() < 1e-7
    for tip in data["tips"]:
        assert min(gap(t[:3], (*tip["center"], tip["radius"])) for t in tips) < 1e-15
    for pocket in data["pockets"]:
        assert min(gap((p.x, p.y, p.radius), (*pocket["center"], pocket["radius"])) for p in table.pockets) < 1e-15
    assert (table.length, table.width, table.cushion_height) == (1.9812, 0.9906, 0.036576)
    assert len(lines) == len(data["lines"]) + 6  # a line behind each pocket


@pytest.mark.parametrize("name", ["pool_8ft", "pool_9ft"])
def test_wpa_tables_have_the_cut_angles_and_mouths_of_the_rules(name):
    table = Table.named(name)
    corner = [c for c in table.outline if c.radius > 0.01 and c.x > 0 and c.y > 0]
    side = [c for c in table.outline if 0 < c.radius < 0.01 and c.y > 0]
    assert math.dist(*[(c.x, c.y) for c in corner]) == pytest.approx(4.5625 * 0.0254)
    assert math.dist(*[(c.x, c.y) for c in side]) == pytest.approx(5.0625 * 0.0254)
    lines, _ = pieces(table.outline)
    angles = []  # between the facings and the long cushions, inside the rubber
    for line in lines:
        along, depth = abs(line.x1 - line.x0), abs(line.y1 - line.y0)
        if table.width / 2 in (abs(line.y0), abs(line.y1)) or depth < 1e-9 or along > depth * 2:
            continue
        angles.append(round(180 - math.degrees(math.atan2(depth, along)), 9))
    assert {142.0, 104.0} <= set(angles)


@pytest.mark.parametrize("name", JAWS)
def test_presets_are_mirrored_bit_for_bit(name):
    table = Table.named(name)
    lines, tips = pieces(table.outline)
    ends = {frozenset({(line.x0, line.y0), (line.x1, line.y1)}) for line in lines}
    arcs = {tip[:3] for tip in tips}
    holes = {(p.x, p.y, p.radius) for p in table.pockets}
    for sx, sy in ((-1, 1), (1, -1)):
        assert {frozenset((sx * x, sy * y) for x, y in pair) for pair in ends} == ends
        assert {(sx * x, sy * y, r) for x, y, r in arcs} == arcs
        assert {(sx * x, sy * y, r) for x, y, r in holes} == holes


@pytest.mark.parametrize("name", [name for name in SCENES if Scene.named(name).table.outline])
def test_a_ball_falls_into_a_pocket_before_it_reaches_the_line_behind_it(name):
    scene = Scene.named(name, 3)
    table, radius = scene.table, scene.balls.radius[0]
    lines, _ = pieces(table.outline)
    sharp = {(corner.x, corner.y) for corner in table.outline if corner.radius == 0}
    behind = [line for line in lines if line[:2] in sharp and line[2:] in sharp]
    assert len(behind) == 6
    for line in behind:
        start, way = np.array(line[:2]), np.array(line[2:]) - line[:2]
        touching = start + np.linspace(0, 1, 101)[:, None] * way + radius * np.array([-way[1], way[0]]) / np.hypot(*way)
        touching = touching[clearance(table.outline, touching) >= radius - 1e-9]
        assert all(
            min(math.hypot(x - p.x, y - p.y) - p.radius for p in table.pockets) < -1e-3 for x, y in touching.tolist()
        )


def test_real_scenes_have_the_balls_of_their_game():
    uk, snooker = Scene.named("uk_pool"), Scene.named("snooker")
    assert uk.balls.radius == (0.0238125, *(0.0254,) * 15)
    assert uk.balls.mass == (0.094, *(0.116,) * 15)
    assert snooker.balls == dataclasses.replace(Balls.uniform(22, 0.02625, 0.14), colours="snooker")
    assert Scene.named("real_pool").balls == Scene.named("pool").balls
    assert Scene.named("real_pool").table == Table.named("pool_9ft")
    assert Scene.named("real_carom").table == Scene.named("carom").table == Table.named("carom_10ft")


@pytest.mark.parametrize(
    ("name", "table"), [("benchmarks:pooltool_pool", "pool"), ("benchmarks:pooltool_real_carom", "carom")]
)
def test_pooltool_scenes_have_the_balls_of_the_reference_shots(name, table):
    with open(DATA / "pooltool_real_shots.json") as file:
        ball = json.load(file)["tables"][table]["ball"]
    scene = Scene.named(name)
    physics = scene.physics
    assert scene.balls == Balls.uniform(len(scene.balls), ball["radius"], ball["mass"])
    assert (physics.mu_slide, physics.mu_roll, physics.g) == (ball["mu_slide"], ball["mu_roll"], ball["g"])
    assert (physics.e_ball, physics.e_cushion, physics.mu_cushion) == (1.0, ball["e_cushion"], ball["mu_cushion"])
    assert physics.spin_decay == pytest.approx(5 * ball["mu_spin"] * ball["g"] / (2 * ball["radius"]))


# Outlines


def test_outlines_of_several_shapes_are_accepted():
    Table(2.0, 1.5, outline=outline(HEXAGON), pockets=(Pocket(1.05, 0.0, 0.1),))
    assert not custom(HEXAGON, width=1.5).is_rectangular
    assert custom(SQUARE).is_rectangular
    bay = ((-1.0, -0.5), (0.2, -0.5), (0.5, -0.8), (0.8, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5))
    assert custom(bay, r1=0.1, r3=0.1).is_rectangular
    corner_cut_out = ((-1.0, -0.5), (1.0, -0.5), (1.0, 0.0), (0.0, 0.0), (0.0, 0.5), (-1.0, 0.5))
    assert not custom(corner_cut_out, r3=0.2).is_rectangular


# Distances from the outline


def test_the_clearance_of_a_rectangle_is_the_distance_from_its_sides():
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.99, -0.49], [0.99, 0.49], (200, 2))
    expected = np.minimum(1.0 - abs(points[:, 0]), 0.5 - abs(points[:, 1]))
    assert clearance(outline(SQUARE), points) == pytest.approx(expected, abs=1e-15)
    assert clearance(outline(SQUARE), [[1.3, 0.9], [0.0, -0.7], [1.0, 0.2]]) == pytest.approx([-0.5, -0.2, 0.0])


@pytest.mark.parametrize("name", JAWS)
def test_the_clearance_agrees_with_a_fine_polygon(name):
    corners = Table.named(name).outline
    points = polygon(corners)
    edges = np.roll(points, -1, axis=0) - points
    rng = np.random.default_rng(1)
    half = abs(points).max(0) + 0.05
    at = rng.uniform(-half, half, (500, 2))
    near = points[rng.integers(len(points), size=500)] + rng.uniform(-0.03, 0.03, (500, 2))
    at = np.vstack((at, near))
    ways = at[:, None] - points
    share = np.clip((ways * edges).sum(-1) / (edges**2).sum(-1), 0, 1)
    distance = np.sqrt(((ways - share[..., None] * edges) ** 2).sum(-1)).min(1)
    clear = clearance(corners, at)
    assert abs(clear) == pytest.approx(distance, abs=4e-5)  # an arc deviates from its chords by r (1 - cos 1.5 deg)
    # The winding number of the polygon is 1 inside it and 0 outside.
    turns = np.angle((np.roll(ways, -1, axis=1) @ [1, 1j]) / (ways @ [1, 1j])).sum(1) / (2 * np.pi)
    sure = abs(clear) > 1e-4
    assert np.array_equal(clear[sure] > 0, np.round(turns[sure]) == 1)


def test_the_area_between_a_tip_and_its_chord_belongs_to_the_cushion():
    bump = ((-1, -0.5), (-0.6, -0.5), (0.0, 0.1), (0.6, -0.5), (1, -0.5), (1, 0.5), (-1, 0.5))
    corners = outline(bump, r2=0.2)
    _, (tip, *_) = (pieces(corners)[0], [t for t in pieces(corners)[1] if t.radius])
    top = tip.y + 0.2
    assert clearance(corners, [[0.0, top + 0.1], [0.0, top], [0.0, top - 0.01], [0.0, top - 0.3]]) == pytest.approx(
        [0.1, 0.0, -0.01, -0.3], abs=0.06
    )
    assert clearance(corners, [0.0, top - 0.01]) == pytest.approx(-0.01)


# Positions on outlines

SCENE = Scene.named("real_pool", 1)
R = SCENE.balls.radius[0]


def test_a_ball_may_touch_a_rail_a_facing_and_a_tip():
    lines, tips = pieces(SCENE.table.outline)
    for line in lines:
        way = np.array([line.x1 - line.x0, line.y1 - line.y0])
        at = np.array([line.x0, line.y0]) + way / 2 + R * np.array([-way[1], way[0]]) / np.hypot(*way)
        if min(math.hypot(at[0] - p.x, at[1] - p.y) - p.radius for p in SCENE.table.pockets) > 0:
            check_positions(SCENE, [at, [0.0, 0.0]])
            outwards = np.array([way[1], -way[0]]) / np.hypot(*way)
            with rejected("ball 0 is at"):
                check_positions(SCENE, [at + 2 * CONTACT_GAP * outwards, [0.0, 0.0]])
    for tip in tips[:3]:
        middle = np.array([tip.x0 + tip.x1, tip.y0 + tip.y1]) / 2 - tip[:2]
        if tip.radius > 0:
            at = np.array(tip[:2]) + (tip.radius + R) * middle / np.hypot(*middle)
            check_positions(SCENE, [at, [0.0, 0.0]])
            with rejected("ball 0 is at"):
                check_positions(SCENE, [at - 2 * CONTACT_GAP * middle / np.hypot(*middle), [0.0, 0.0]])


def test_a_ball_may_lie_in_the_jaws_but_not_in_the_pocket():
    x, y = 1.27 - 0.002, 0.635 - 0.02
    assert x > 1.27 - R
    with rejected("expected a place inside the outline, at least 0.028575 m from the cushions"):
        check_positions(SCENE, [[x, 0.3], [0.0, 0.0]])
    check_positions(SCENE, [[1.25, 0.61], [0.0, 0.0]])
    with rejected("expected a place outside pocket"):
        check_positions(SCENE, [[x, y + 0.01], [0.0, 0.0]])


@pytest.mark.parametrize("name", SCENES)
def test_half_extents_bound_all_valid_positions_and_the_pockets_lie_beyond_them(name):
    scene = Scene.named(name, 2)
    table, half = scene.table, np.array(scene.half_extents)
    if not table.outline:
        assert scene.half_extents == (table.length / 2, table.width / 2)
        return
    smallest = min(scene.balls.radius)
    rng = np.random.default_rng(2)
    at = rng.uniform(0.9, 1.1, (20_000, 2)) * half * rng.choice([-1, 1], (20_000, 2))
    at[10_000:, 0] = rng.uniform(-0.1, 0.1, 10_000) * half[0]
    free = clearance(table.outline, at) >= smallest - CONTACT_GAP
    for p in table.pockets:
        free &= np.hypot(at[:, 0] - p.x, at[:, 1] - p.y) >= p.radius
    assert free.sum() > 20
    assert (abs(at[free]) < half).all()
    assert all(abs(p.x) > half[0] or abs(p.y) > half[1] for p in table.pockets)
