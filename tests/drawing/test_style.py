import dataclasses
import itertools

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.drawing import style
from billiards_env.drawing.raster import rgb
from billiards_env.scene import Balls
from billiards_env.scene.outline import Corner, polygon
from billiards_env.scene.table import Pocket, Table, six_pockets
from tests.helpers.pages import page_data
from tests.helpers.shots import simulate

BIG = tuple(Pocket(pocket.x, pocket.y, 0.12) for pocket in six_pockets())
TABLES = {
    "pool": Table(pockets=six_pockets()),
    "big pockets": Table(pockets=BIG),
    "tall": Table(0.6, 1.6, pockets=six_pockets(0.6, 1.6)),
    "small": Table(0.6, 0.3, pockets=six_pockets(0.6, 0.3)),
    "long": Table(5.0, 0.5, pockets=six_pockets(5.0, 0.5)),
    "outside": Table(2.0, 1.0, pockets=(Pocket(1.05, 0.2, 0.06), Pocket(0.0, 0.0, 0.08))),
}


def of_colour(table, colour):
    return [shape.corners for shape in style.draw_table(table) if shape.colour == colour]


JAWS = ("pool_7ft", "pool_8ft", "pool_9ft", "snooker_12ft", "uk_7ft")
HEXAGON = ((-1.0, 0.0), (-0.5, -0.75), (0.5, -0.75), (1.0, 0.0), (0.5, 0.75), (-0.5, 0.75))


def luminance(colour):
    channels = np.array(rgb(colour)) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_holes_are_in_the_rail(table):
    holes = of_colour(table, style.POCKET)
    assert len(holes) == len(table.pockets)
    half = np.array([table.length, table.width]) / 2
    (rail,) = of_colour(table, style.RAIL_EDGE)
    assert rail.max(0) == pytest.approx(half + style.rail_width(table), rel=0.01)
    for hole, pocket in zip(holes, table.pockets, strict=True):
        assert (np.abs(hole) < half + style.rail_width(table)).all()
        middle, place = hole.mean(0), np.array([pocket.x, pocket.y])
        at_edge = np.abs(place) + pocket.radius > half
        assert (np.abs(middle - place) > 0.2 * pocket.radius).tolist() == at_edge.tolist()
        assert (np.abs(middle) >= np.abs(place) - 1e-12).all()
        assert np.hypot(*(middle - place)) < np.hypot(*(hole[0] - middle))  # the pocket's centre is in the hole


def test_the_mouth_of_a_pocket_has_the_radius_of_the_physics():
    pocket = six_pockets()[4]
    (mouth,) = [s.corners for s in style.draw_table(TABLES["pool"]) if abs(s.corners - [0, pocket.y]).max() < 0.15][1:2]
    inside = mouth[np.abs(mouth[:, 1]) < abs(pocket.y)]
    assert np.hypot(*(inside - [pocket.x, pocket.y]).T) == pytest.approx(pocket.radius)


def test_a_table_without_pockets_has_no_holes():
    assert not of_colour(Table(), style.POCKET)
    assert style.rail_width(Table()) == pytest.approx(0.1016)


@pytest.mark.parametrize("name", JAWS)
def test_an_outline_is_drawn_to_scale(name):
    table = Table.named(name)
    (cloth,) = of_colour(table, style.CLOTH)
    assert np.array_equal(cloth, polygon(table.outline))
    cushions = of_colour(table, style.CUSHION_EDGE)
    assert len(cushions) == len(of_colour(table, style.CUSHION)) == 6
    points = {tuple(point) for cushion in cushions for point in cushion}
    assert len(points) == len(cloth)  # facings, tips and rails; a line behind a pocket has no other point
    inset = np.vstack(of_colour(table, style.CUSHION))
    assert (table.clearance(inset) < 0).all()  # the rubber is outside the cloth
    half = np.array([table.length, table.width]) / 2 + style.rail_width(table)
    assert all((np.abs(shape.corners) <= half + 1e-12).all() for shape in style.draw_table(table))


@pytest.mark.parametrize("name", JAWS)
def test_the_hole_between_jaws_has_the_radius_of_the_physics(name):
    table = Table.named(name)
    shapes = of_colour(table, style.POCKET)
    falls = shapes[len(table.pockets) :]
    assert len(falls) == len(table.pockets)
    for fall, hole, pocket in zip(falls, shapes, table.pockets, strict=False):
        edge = fall[4:]
        assert len(edge) > 20
        assert np.hypot(*(edge - [pocket.x, pocket.y]).T) == pytest.approx(pocket.radius)
        assert (table.clearance(edge) > 0).all()
        assert np.hypot(*np.diff(edge, axis=0).T).max() < 0.06 * pocket.radius  # one arc
        assert abs(table.clearance(fall[[0, 3]])).max() < 1e-12
        assert np.hypot(*(hole.mean(0) - [pocket.x, pocket.y])) < pocket.radius


def test_an_outline_without_jaws_has_strips_of_rubber():
    table = Table(2.0, 1.5, outline=tuple(Corner(x, y) for x, y in HEXAGON))
    strips = of_colour(table, style.CUSHION)
    assert len(strips) == 6
    for strip in strips:
        assert (table.clearance(strip) <= 1e-12).all()
    assert [shape.colour for shape in style.draw_table(table)].index(style.CLOTH) > 2


def test_a_baulk_line_and_a_d_replace_the_diamonds():
    line, d = of_colour(Table.named("snooker_12ft"), style.MARKING)
    assert line.mean(0) == pytest.approx([0.737 - 3.569 / 2, 0.0])
    assert np.hypot(*(d - [line[:, 0].mean(), 0.0]).T) == pytest.approx(0.292, rel=0.015)
    assert not of_colour(Table.named("snooker_12ft"), style.CHALK)
    assert len(of_colour(Table.named("pool_9ft"), style.CHALK)) == len(of_colour(TABLES["pool"], style.CHALK))


def test_cushions_have_the_names_of_their_numbers_in_events():
    assert style.cushion_names(Table())[3] == "the upper cushion"
    scene = Scene.named("real_pool")
    names = style.cushion_names(scene.table)
    assert len(names) == 24 + 12
    shot = simulate(scene, [[0.3, 0.2], [-0.5, 0.0]], [0.0, 2.0], record=True)
    hits = shot.events[shot.events["kind"] == "cushion"]
    assert [names[k] for k in hits["other"][:2]] == ["the upper cushion", "the lower cushion"]
    into_jaw = simulate(scene, [[1.0, 0.52], [-0.5, 0.0]], [2.0, 1.4], record=True)
    hits = into_jaw.events[into_jaw.events["kind"] == "cushion"]
    assert [names[k] for k in hits["other"]] == ["the upper cushion", "the right cushion", "a facing"]


def test_a_cushion_between_two_tips_that_meet_has_a_name():
    corners = [(-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (0.1, 0.5), (0.1, 0.3), (-0.1, 0.3), (-0.1, 0.5), (-1.0, 0.5)]
    outline = tuple(Corner(x, y, 0.1 if y == 0.3 else 0.0) for x, y in corners)
    assert len(style.cushion_names(Table(2.0, 1.0, outline=outline))) == 8 + 2


def test_balls_have_the_colours_of_their_game():
    pool, carom = style.looks(Scene.named("pool", 15)), style.looks(Scene.named("carom"))
    assert [look.number for look in pool] == ["", *map(str, range(1, 16))]
    assert [look.striped for look in pool] == [False] * 9 + [True] * 7
    assert [look.fill for look in pool[1:8]] == [look.fill for look in pool[9:]]
    assert [look.fill for look in carom[1:]] == ["#c0281c", "#f0e442"]  # ball 1 is red
    fixed = dataclasses.replace(Scene.named("pool"), balls=Balls((0.03, 0.03), (0.2, float("inf"))))
    assert style.looks(fixed)[1].fill == "#6b6b6b"
    fills = [look.fill for look in style.looks(Scene.named("snooker"))]
    assert len(set(fills[1:16])) == 1
    assert len(set(fills[15:])) == 7
    assert [look.fill for look in style.looks(Scene.named("snooker", 6))][1:] == fills[16:]
    uk = [look.fill for look in style.looks(Scene.named("uk_pool"))]
    assert len(set(uk[1:8])) == len(set(uk[9:])) == 1
    assert len(set(uk)) == 4
    assert not any(look.striped for look in style.looks(Scene.named("snooker")) + style.looks(Scene.named("uk_pool")))


def test_the_colours_of_a_palette_differ():
    for palette in style.PALETTES:
        for scene, n in (("pool", 8), ("snooker", None), ("carom", None)):
            fills = [look.fill for look in style.looks(Scene.named(scene, n), palette)]
            assert len(set(fills)) == {"pool": 9, "snooker": 8, "carom": 3}[scene]
    realistic = style.looks(Scene.named("pool", 7), "realistic")
    red, green, blue = rgb(realistic[3].fill)
    assert red > 3 * max(green, blue)  # the 3 is red
    with pytest.raises(ValueError, match="palette = 'real': expected one of"):
        style.looks(Scene.named("pool"), "real")


@pytest.mark.parametrize("palette", style.PALETTES)
def test_paths_contrast_with_the_cloth(palette):
    for look in (
        look
        for name, n in (("pool", 15), ("carom", 2), ("snooker", 21))
        for look in style.looks(Scene.named(name, n), palette)
    ):
        assert (luminance(look.path) + 0.05) / (luminance(style.CLOTH) + 0.05) > 3


@pytest.mark.parametrize("n", [1, 2, 16, 40])
def test_the_tray_has_room_for_all_balls(n):
    radius, half, x = style.tray(n, 800.0, 33.0)
    assert len(x) == n
    assert half < 0.2 * 800
    assert -half + radius <= x[0]
    assert x[-1] <= half - radius
    assert all(b - a > 2 * radius for a, b in itertools.pairwise(x))


def test_the_page_has_the_same_table():
    scene = Scene(Balls((0.03,), (0.2,)), TABLES["big pockets"])
    shot = simulate(scene, [[0.0, 0.0]], [1.0, 0.0], record=True)
    data = page_data(shot)
    assert data["cushions"] == style.cushion_names(scene.table)
    for (colour, corners), shape in zip(data["shapes"], style.draw_table(scene.table), strict=True):
        assert colour == shape.colour
        assert np.reshape(corners, (-1, 2)) == pytest.approx(shape.corners, abs=1e-4)
