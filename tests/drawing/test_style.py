import itertools
import json
import re

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.drawing.page import make_page
from billiards_env.drawing.style import CLOTH, POCKET, RAIL_EDGE, draw_table, looks, rail_width, tray
from billiards_env.scene import Balls
from billiards_env.simulation import simulate
from billiards_env.table import Pocket, Table, six_pockets

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
    return [shape.corners for shape in draw_table(table) if shape.colour == colour]


def luminance(colour):
    channels = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_holes_are_in_the_rail(table):
    holes = of_colour(table, POCKET)
    assert len(holes) == len(table.pockets)
    half = np.array([table.length, table.width]) / 2
    (rail,) = of_colour(table, RAIL_EDGE)
    assert rail.max(0) == pytest.approx(half + rail_width(table), rel=0.01)
    for hole, pocket in zip(holes, table.pockets, strict=True):
        assert (np.abs(hole) < half + rail_width(table)).all()
        middle, place = hole.mean(0), np.array([pocket.x, pocket.y])
        at_edge = np.abs(place) + pocket.radius > half
        assert (np.abs(middle - place) > 0.2 * pocket.radius).tolist() == at_edge.tolist()
        assert (np.abs(middle) >= np.abs(place) - 1e-12).all()
        assert np.hypot(*(middle - place)) < np.hypot(*(hole[0] - middle))  # the pocket's centre is in the hole


def test_the_mouth_of_a_pocket_has_the_radius_of_the_physics():
    pocket = six_pockets()[4]
    (mouth,) = [s.corners for s in draw_table(TABLES["pool"]) if abs(s.corners - [0, pocket.y]).max() < 0.15][1:2]
    inside = mouth[np.abs(mouth[:, 1]) < abs(pocket.y)]
    assert np.hypot(*(inside - [pocket.x, pocket.y]).T) == pytest.approx(pocket.radius)


def test_a_table_without_pockets_has_no_holes():
    assert not of_colour(Table(), POCKET)
    assert rail_width(Table()) == pytest.approx(0.1016)


def test_paths_contrast_with_the_cloth():
    for look in looks(Scene.named("pool", 15)) + looks(Scene.named("carom")):
        assert (luminance(look.path) + 0.05) / (luminance(CLOTH) + 0.05) > 3


@pytest.mark.parametrize("n", [1, 2, 16, 40])
def test_the_tray_has_room_for_all_balls(n):
    radius, half, x = tray(n, 800.0, 33.0)
    assert len(x) == n
    assert half < 0.2 * 800
    assert -half + radius <= x[0]
    assert x[-1] <= half - radius
    assert all(b - a > 2 * radius for a, b in itertools.pairwise(x))


def test_the_page_has_the_same_table():
    scene = Scene(Balls((0.03,), (0.2,)), TABLES["big pockets"])
    shot = simulate(scene, [[0.0, 0.0]], [1.0, 0.0], record=True)
    (text,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', make_page(shot.recording()))
    shapes = json.loads(text)["shapes"]
    for (colour, corners), shape in zip(shapes, draw_table(scene.table), strict=True):
        assert colour == shape.colour
        assert np.reshape(corners, (-1, 2)) == pytest.approx(shape.corners, abs=1e-4)
