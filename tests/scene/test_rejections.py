"""Scenes, tables, balls, physics, positions and layouts that are refused."""

import math
import re
from typing import Any

import numpy as np
import pytest

from billiards_env.scene import Balls, Physics, Scene, check_positions, layouts
from billiards_env.scene.outline import Corner
from billiards_env.scene.table import Jaws, Pocket, Table, pool_table
from tests.helpers.scenes import CLEAR, HEXAGON, LARGE_AND_SMALL, SCENE, SQUARE, R, custom, ideal, outline, three_balls

INF, NAN = math.inf, math.nan
WRONG_TYPE = re.compile(
    r"expected (a (mapping|list|tuple|Pocket|Balls|Table|Physics|Corner)\b(?! apart| at )|a number, not|Corner objects)"
)


def of(kind, *arguments, **named):
    """Returns a call of a function or class."""
    return lambda: kind(*arguments, **named)


def changed(*path, to: Any = ...):
    """Returns a call of `Scene.from_dict` with the item of "pool" at `path` set, or deleted without `to`."""
    data = inner = Scene.named("pool").to_dict()
    for key in path[:-1]:
        inner = inner[key]
    if to is ...:
        del inner[path[-1]]
    else:
        inner[path[-1]] = to
    return of(Scene.from_dict, data)


def incomplete(part):
    """Returns a call of `Scene.from_dict` with a whole scene, but without the last value of a part."""
    data = Scene.named("real_pool").to_dict()
    last, _ = data[part].popitem()
    return of(Scene.from_dict, data), f"scene.{part}.{last} is missing: expected all values in a whole scene"


def layout(name, scene):
    return of(lambda: layouts.draw(name, scene, np.random.default_rng(0)))


def placed(*positions, **named):
    return of(check_positions, SCENE, list(positions), **named)


named, from_dict, physics, positions = Scene.named, Scene.from_dict, Physics, check_positions

NAMES = [
    (of(named, "pol"), "scene = 'pol': expected one of 'pool', 'blocked_pool', 'carom', 'ideal', 'sum_to_three', "),
    (of(Table.named, "pool_10ft"), "table = 'pool_10ft': expected one of 'pool_7ft', 'pool_8ft', 'pool_9ft'"),
    (of(from_dict, {"base": "pool", "physic": {}}), "key of scene = 'physic': expected one of"),
    (of(from_dict, {"n_object_balls": 3}), "key of scene = 'n_object_balls': expected one of"),
]
DATA = [
    (changed("tabel", to={}), "key of scene = 'tabel': expected one of 'balls', 'table', 'physics', 'cue'"),
    (changed("table", "pockets", 0, "z", to=0.0), "key of scene.table.pockets[0] = 'z'"),
    (changed("table", "pockets", 3, "x"), "scene.table.pockets[3].x is missing: expected a value, it has no default"),
    (changed("balls", to=[1.0]), "scene.balls = [1.0]: expected a mapping"),
    (changed("table", "pockets", to=6), "scene.table.pockets = 6: expected a list"),
    (changed("balls", "mass", to=[1.0, "infinite"]), "balls.mass[1] = 'infinite': expected a"),
    (changed("balls", "radius", to=[0.03, "inf"]), "balls.radius[1] = inf: expected a number from 0.0001 to 10000 m"),
    (of(Table.from_dict, {"outline": 4}), "table.outline = 4: expected a list"),
    (of(Table.from_dict, {"outline": [{"x": 0.0, "y": 0.0, "r": 1.0}]}), "key of table.outline[0] = 'r'"),
    (of(Table.from_dict, {"outline": [{"x": 0.0, "y": 0.0, "radius": -1.0}]}), "corner.radius = -1.0: expected"),
    *map(incomplete, ("balls", "table", "physics", "cue")),
]
FLOOR = {"cushion": "stronge", "e_cushion_loss": 0.1}
ROUGH = {"motion": "rolling", "cushion": "restitution", "ball_ball": "frictional"}
PARTS = [
    (of(physics, motion="ideal", cushion="restitution"), "physics.max_time = None: expected a number of seconds"),
    (of(physics, motion="rolling"), "physics.cushion = 'han2005' with physics.motion = 'rolling': expected motion"),
    (of(physics, cushion="stronge", e_cushion=0.3), "physics.e_cushion = 0.3 with physics.cushion = 'stronge'"),
    (of(physics, **FLOOR), "physics.e_cushion_floor = 0.0 with"),
    (of(physics, e_cushion_floor=0.9), "physics.e_cushion_floor = 0.9: expected at most e_cushion = 0.85"),
    (of(physics, **ROUGH), "physics.ball_ball = 'frictional'"),
    (of(Table, pockets=[Pocket(1.0, 0.5, 0.05)]), "table.pockets = [Pocket(x=1.0, y=0.5, radius=0.05)]: expected"),
    (of(Table, pockets=(Pocket(1.27, 0.0, 0.1), Pocket(1.4, 0.0, 0.1))), "table.pockets[1] = Pocket(x=1.4"),
    (of(Table, pockets=(Pocket(0, -0.75, 0.1),)), "... expected a circle that reaches the table (2.54 x 1.27 m"),
    (of(Table, 2.0, 1.0, head_string=-1.0), "table.head_string = -1.0: expected a number between -1.0 and 1.0"),
    (
        of(Table, 2.0, 1.0, head_string=-0.8, d_radius=0.25),
        "table.d_radius = 0.25: expected 0 or a number below 0.2, inside",
    ),
    (of(Balls, (), ()), "balls.radius = (): expected at least one ball, the cue ball"),
    (of(Balls, (R, R), (1.0,)), "balls.mass has 1 values and balls.radius has 2: expected one value per ball"),
    (of(Balls, (R, R), (INF, 1.0)), "balls.mass[0] = inf: expected a finite mass, the cue ball must be able to move"),
    (of(Balls, (R,), (1.0,), shape="cube"), "balls.shape = 'cube': expected one of 'disk', 'sphere'"),
    (of(Scene, Balls((R,), (1.0,)), Table(width=0.05)), "scene.table of 2.54 x 0.05 m: expected room for a ball"),
    (
        of(Scene, Balls((2 * R, R), (1.0, 1.0)), Table(cushion_height=2.5 * R)),
        f"scene.table.cushion_height = {2.5 * R}: expected less than the diameter of ball 1 ({2 * R} m)",
    ),
]
JAWS = Jaws(0.118, 5.3, 0.02, 0.062, 0.0417)
CORRIDOR = custom((*SQUARE, (-1, 0.35), (0.85, 0.35), (0.85, -0.35), (-1, -0.35)))
# The tip of corner 2 bulges inwards; the cushion at corner 7 ends in it.
WEDGE = ((-1, -0.5), (-0.3, -0.5), (0, 0.1), (0.3, -0.5), (1, -0.5), (1, 0.5), (0.2, 0.5), (0, -0.05), (-0.2, 0.5))
WALL = ((-1, -0.5), (-0.4, -0.5), (-0.4, 0), (-0.2, 0), (-0.2, -0.5), (1, -0.5), (1, 0.5), (-1, 0.5))  # 0.2 m thick
MEET = "table.outline[0] and table.outline[2]: expected cushions that do not meet"
OUTLINES = [
    (of(custom, SQUARE[:2]), "table.outline has 2 corners: expected at least 3"),
    (of(custom, SQUARE[::-1]), "table.outline has the area -2 m^2: expected counter-clockwise corners"),
    (of(custom, (*SQUARE[:2], *SQUARE[1:])), "... expected a corner apart from the one before it"),
    (of(custom, SQUARE, r1=0.1), "... expected radius 0, only a corner that points into the table can be rounded"),
    (
        of(custom, ((-1, -0.5), (-0.1, -0.5), (0, -0.4), (0.1, -0.5), (1, -0.5), (1, 0.5), (-1, 0.5)), r2=0.5),
        "... expected smaller radii",
    ),
    (of(custom, ((-1, -0.5), (1, -0.5), (1, 0.5), (0.5, -0.7), (-1, 0.5))), MEET),  # two cushions cross
    (of(custom, ((-1, -0.5), (1, -0.5), (1, 0.5), (0, -0.5), (-1, 0.5))), MEET),  # a corner touches a cushion
    (  # a cushion lies on another one
        of(custom, ((-1, -0.5), (1, -0.5), (1, 0.5), (0.5, 0.5), (0.5, -0.5), (0, -0.5), (0, 0.5), (-1, 0.5))),
        "... expected cushions that do not meet",
    ),
    (of(custom, (*SQUARE, (-1, 0.7))), "... expected a corner at which the outline"),
    (of(custom, ((-1, -0.5), (1, 0.5), (1, -0.5), (-1, 0.5))), "table.outline has the area 0 m^2"),  # a figure eight
    (of(custom, (*WEDGE, (-1, 0.5)), r2=0.05, r7=0.02), "... expected cushions that do not meet"),
    (
        of(custom, WALL, r2=0.15),
        "table.outline[2] = Corner(x=-0.4, y=0.0, radius=0.15): expected a smaller radius, the circle of the",
    ),
    (of(custom, SQUARE, 2.1), "table.length = 2.1: expected corners of the outline at x = -1.05 and 1.05"),
    (of(custom, SQUARE, 2.0, 0.9), "table.width = 0.9: expected corners of the outline at y = -0.45 and 0.45"),
    (of(custom, [(x + 0.1, y) for x, y in SQUARE]), "table.length = 2.0: expected corners of the outline at x = -1.0"),
    *((of(Table, 2.0, 1.0, outline=value), "table.outline") for value in ([Corner(0.0, 0.0)], ((0.0, 0.0),) * 3)),
    (
        of(Table, 2.0, 1.5, outline=outline(HEXAGON), pockets=(Pocket(1.0, 0.7, 0.1),)),
        "table.pockets[0] = Pocket(x=1.0, y=0.7, radius=0.1): expected a circle that reaches the table",
    ),
    *(
        (of(pool_table, 2.0, 1.0, 0.036, 0.05, *jaws), "table.outline[")
        for jaws in (
            (JAWS._replace(angle=40.0), JAWS),  # the facings meet
            (JAWS._replace(tip_radius=0.3), JAWS),  # the tips are larger than the facings
            (JAWS, JAWS._replace(mouth=1.9)),  # no cushion is left between corner and side
        )
    ),
    (of(Scene, Balls((0.02, 0.09), (0.2, 0.2)), CORRIDOR), "... expected room for a ball 0.18 m across"),
]
POSITIONS = [
    (placed([0, 0]), "positions has shape (1, 2): expected (2, 2) or (m, 2, 2), one row per ball"),
    (placed([[[0, 0]] * 2]), "positions has shape (1, 1, 2, 2): expected (2, 2)"),
    (placed([0.97, 0], [0, 0]), "positions: ball 0 is at [0.97, 0.0]: expected |x| <= 0.96875 and |y| <= 0.46875"),
    (
        placed([0.95, 0.45], [0, 0]),
        "positions: ball 0 is at [0.95, 0.45]: expected a place outside pocket 0, a circle of radius 0.1 m",
    ),
    (placed([0, 0], [0, 0.06]), "positions: balls 0 and 1 are 0.06 m apart: expected at least 0.0625 m"),
    (placed(CLEAR, CLEAR, [[0, 0], [9, 0]]), "positions: shot 2, ball 1 is at [9.0, 0.0]: expected |x|"),
    (placed(*[[[0, 0]] * 2] * 2, in_play=np.array([[True, True], [True, False]])), "positions: shot 0, balls 0 and 1"),
    *(
        (of(positions, named(name), [[0, 0], [1e308, -1.7e308]]), "positions: ball 1 is at ")
        for name in ("pool", "real_pool")
    ),
]
NARROW = {"balls": {"radius": [0.1], "mass": [0.2]}, "table": {"width": 0.2}, "physics": {"cushion": "restitution"}}
LAYOUTS = [
    *(
        (layout(name, named(scene, n)), f"layout = '{name}' with {n} object ball{'s' * (n != 1)}: expected {most}")
        for name, scene, n, most in (
            ("snookered", "pool", 1, "2"),
            ("carom_opening", "pool", 3, "1 to 2"),
            ("snooker", "snooker", 5, "6 to 21"),
        )
    ),
    (layout("snookered", three_balls(0.03, 0.03, 0.02)), "... balls 1 and 2 of radii 0.03 and 0.02 m: expected"),
    (layout("snookered", ideal(Balls.uniform(3, 0.45))), "layout = 'snookered': found no room for ball "),
    (layout("random", ideal(Balls.uniform(8, 0.3))), "... 10000 tries"),
    (layout("random", from_dict(NARROW)), "... found no room for ball 0"),
    (layout("rak", named("pool", 1)), "... (did you mean 'rack'?)"),
    (layout("tight_rack", LARGE_AND_SMALL), "... radii [0.01, 0.05, 0.2] m: expected one radius"),
    (layout("rack", named("ideal", 200)), "layout 'rack': ball "),
    (layout("snooker", named("pool", 15)), "layout = 'snooker' with table.d_radius = 0: expected a table with a D"),
]


POCKET = named("pool").table.pockets[0]
POINTS = [
    (of(POCKET.contains, None), "points = None: expected finite numbers in an array"),
    (of(POCKET.contains, "abc"), "points = 'abc': expected finite numbers in an array"),
    (of(POCKET.contains, [1j, 0.0]), "points = [1j, 0.0]: expected finite numbers in an array"),
    (of(POCKET.contains, [[0, 0], [1]]), "points = [[0, 0], [1]]: expected finite numbers in an array"),
    (of(POCKET.contains, [NAN, 0.0]), "points = [nan, 0.0]: expected finite numbers"),
    (of(POCKET.contains, [1, 2, 3]), "points has shape (3,): expected (..., 2)"),
    (of(POCKET.contains, [0, 0], "a"), "by = 'a': expected a number, not str"),
    (of(POCKET.distance, 0.0), "points has shape (): expected (..., 2)"),
    (of(named("pool").table.clearance, ["a", "b"]), "points = ['a', 'b']: expected finite numbers in an array"),
    (of(named("real_pool").table.clearance, [1, 2, 3]), "points has shape (3,): expected (..., 2)"),
]


WRONG = [*NAMES, *DATA, *PARTS, *OUTLINES, *POSITIONS, *LAYOUTS, *POINTS]


@pytest.mark.parametrize(("call", "message"), WRONG, ids=[message for _, message in WRONG])
def test_a_wrong_scene_is_refused(call, message):
    """The message begins as given, or contains what follows the dots."""
    with pytest.raises((TypeError, ValueError)) as error:
        call()
    text = str(error.value)
    assert message[4:] in text if message.startswith("... ") else text.startswith(message)
    assert (error.type is TypeError) == bool(WRONG_TYPE.search(text))


def test_a_tip_that_fits_is_accepted():
    custom((*WEDGE[:7], (0.0, 0.2), *WEDGE[8:], (-1, 0.5)), r2=0.05, r7=0.02)
    custom(WALL, r2=0.09)
    pool_table(2.0, 1.0, 0.036, 0.05, JAWS, JAWS)
    Scene(Balls((0.02, 0.085), (0.2, 0.2)), CORRIDOR)  # the larger ball fits in the corners only
    Scene(Balls((2 * R, R), (1.0, 1.0)), Table(cushion_height=2.5 * R), Physics(cushion="restitution"))
