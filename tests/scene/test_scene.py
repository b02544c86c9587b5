import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from billiards_env.scene import CONTACT_GAP, SCENES, Balls, Physics, Scene, check_positions
from billiards_env.scene.table import Pocket, Table, six_pockets
from tests.helpers.errors import rejected

R = 0.03125


# Defaults and named scenes


def test_defaults_are_a_nine_foot_table_and_measured_constants():
    scene = Scene(Balls.uniform(2))
    assert (scene.table.length, scene.table.width) == (2.54, 1.27)
    assert scene.table.cushion_height == pytest.approx(0.635 * 0.05715)
    assert scene.table.pockets == ()
    assert scene.balls == Balls((0.028575,) * 2, (0.170097,) * 2)
    assert scene.physics == Physics(
        motion="sliding",
        cushion="han2005",
        g=9.81,
        mu_slide=0.2,
        mu_roll=0.01,
        spin_decay=10.0,
        e_ball=0.95,
        e_cushion=0.85,
        mu_cushion=0.2,
        max_time=None,
    )


@pytest.mark.parametrize(
    ("name", "usual"),
    [("pool", 1), ("blocked_pool", 2), ("carom", 2), ("ideal", 1), ("pooltool_carom", 2), ("sum_to_three", 1)],
)
def test_named_scenes_have_their_default_number_of_balls(name, usual):
    assert Scene.named(name).n_balls == len(Scene.named(name).balls) == usual + 1
    assert Scene.named(name, 0).n_balls == 1
    assert Scene.named(name, n_object_balls=15).n_balls == 16


def test_blocked_pool_is_pool_with_ball_2_fixed():
    blocked, pool = Scene.named("blocked_pool", 3), Scene.named("pool", 3)
    assert (blocked.table, blocked.physics, blocked.balls.radius) == (pool.table, pool.physics, pool.balls.radius)
    assert blocked.balls.mass == (0.170097, 0.170097, math.inf, 0.170097)


def test_pool_has_six_pockets_on_the_cushion_line():
    pockets = Scene.named("pool").table.pockets
    assert pockets == six_pockets()
    assert {(p.x, p.y) for p in pockets} == {(x, y) for x in (-1.27, 0.0, 1.27) for y in (-0.635, 0.635)}
    assert {(p.x == 0, round(p.radius, 6)) for p in pockets} == {(False, 0.057944), (True, 0.064294)}


def test_six_pockets_of_another_table_lie_on_its_cushions():
    assert {(p.x, p.y) for p in six_pockets(2.0, 1.0)} == {(x, y) for x in (-1.0, 0.0, 1.0) for y in (-0.5, 0.5)}


def test_carom_scenes_have_a_match_table_without_pockets():
    carom, pooltool = Scene.named("carom"), Scene.named("pooltool_carom")
    assert carom.table == pooltool.table == Table(2.84, 1.42, 0.037)
    assert carom.balls == pooltool.balls == Balls.uniform(3, 0.03075, 0.21)
    assert carom.physics == Physics()
    assert (pooltool.physics.e_ball, pooltool.physics.mu_cushion) == (1.0, 0.15)
    assert pooltool.physics.spin_decay == pytest.approx(5 * 0.013666666666666666 * 9.81 / (2 * 0.03075))


def test_sum_to_three_has_the_small_table_of_pooltool():
    scene = Scene.named("sum_to_three")
    assert scene.table == Table(1.22, 0.61, 0.036576)
    assert scene.balls == Balls.uniform(2, 0.03048, 0.21)
    p = scene.physics
    assert (p.motion, p.cushion, p.g) == ("sliding", "han2005", 9.81)
    assert (p.mu_slide, p.mu_roll, p.e_ball, p.e_cushion, p.mu_cushion) == (0.5, 0.01, 1.0, 0.85, 0.5)
    assert p.spin_decay == pytest.approx(5 * (4 / 9) * 9.81 / 2)


def test_ideal_scene_loses_no_energy_and_has_a_time_limit():
    physics = Scene.named("ideal").physics
    assert (physics.motion, physics.cushion, physics.e_ball, physics.e_cushion) == ("ideal", "restitution", 1.0, 1.0)
    assert physics.max_time == 10.0


@pytest.mark.parametrize(
    ("name", "count", "message"),
    [
        ("pol", None, "scene = 'pol': expected one of 'pool', 'blocked_pool', 'carom', 'ideal', 'pooltool_carom', "),
        ("pol", None, "'pooltool_real_carom' (did you mean 'pool'?)"),
        ("billiards", None, "scene = 'billiards': expected one of"),
        ("pool", 16, "n_object_balls = 16: expected a whole number from 0 to 15 for scene 'pool'"),
        ("pool", -1, "n_object_balls = -1: expected a whole number"),
        ("pool", True, "n_object_balls = True: expected a whole number"),
        ("pool", 1.0, "n_object_balls = 1.0: expected a whole number"),
    ],
)
def test_named_rejects_bad_arguments(name, count, message):
    with rejected(message):
        Scene.named(name, count)


# Plain data


@pytest.mark.parametrize("name", SCENES)
def test_named_scenes_survive_strict_json(name):
    scene = Scene.named(name, 3)
    assert Scene.from_dict(json.loads(json.dumps(scene.to_dict(), allow_nan=False))) == scene


def test_an_infinite_mass_survives_strict_json():
    scene = Scene(Balls((R, 0.75 * R), (0.2, math.inf)))
    data = json.loads(json.dumps(scene.to_dict(), allow_nan=False))
    assert data["balls"]["mass"] == [0.2, "inf"]
    assert Scene.from_dict(data) == scene


def test_to_dict_returns_only_plain_types():
    def check(value):
        if isinstance(value, dict):
            assert all(type(key) is str for key in value)
            value = list(value.values())
        if isinstance(value, list):
            for item in value:
                check(item)
        else:
            assert value is None or type(value) in (str, float)

    g: Any = np.float32(9.75)
    check(Scene.named("pool", 2).to_dict())
    check(Scene(Balls((R,), (0.2,)), Table(length=np.float64(2), width=3), Physics(g=g)).to_dict())


def test_fields_with_a_default_are_optional():
    assert Scene.from_dict({"balls": {"radius": [0.03], "mass": [1]}}) == Scene(Balls((0.03,), (1.0,)))
    given = Scene.from_dict({"balls": {"radius": [0.03], "mass": [1]}, "table": {"width": 1}, "physics": {"g": 5}})
    assert given == Scene(Balls((0.03,), (1.0,)), Table(width=1.0), Physics(g=5.0))


def test_from_dict_does_not_change_its_argument():
    data = Scene.named("pool").to_dict()
    before = json.dumps(data)
    Scene.from_dict(data)
    assert json.dumps(data) == before


def changed(path, value):
    """Returns the data of the "pool" scene with the item at `path` set, or deleted if the value is `...`."""
    data = Scene.named("pool").to_dict()
    inner = data
    for key in path[:-1]:
        inner = inner[key]
    if value is ...:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return data


@pytest.mark.parametrize(
    ("path", "value", "message", "kind"),
    [
        (
            ["tabel"],
            {},
            "key of scene = 'tabel': expected one of 'balls', 'table', 'physics', 'cue' (did you mean 'table'?)",
            0,
        ),
        (["physics", "mu_rol"], 0.1, "key of scene.physics = 'mu_rol': expected one of", 0),
        (["physics", "mu_rol"], 0.1, "(did you mean 'mu_roll'?)", 0),
        (["table", "widht"], 1.0, "key of scene.table = 'widht'", 0),
        (["balls", "color"], [1.0], "key of scene.balls = 'color'", 0),
        (["table", "pockets", 0, "z"], 0.0, "key of scene.table.pockets[0] = 'z'", 0),
        (
            ["table", "pockets", 3, "x"],
            ...,
            "scene.table.pockets[3].x is missing: expected a value, it has no default",
            0,
        ),
        (["balls"], ..., "scene.balls is missing", 0),
        (["balls", "mass"], ..., "scene.balls.mass is missing", 0),
        (["balls"], [1.0], "scene.balls = [1.0]: expected a mapping", TypeError),
        (["physics"], None, "scene.physics = None: expected a mapping", TypeError),
        (["table", "pockets"], 6, "scene.table.pockets = 6: expected a list", TypeError),
        (["balls", "radius"], 0.03, "scene.balls.radius = 0.03: expected a list", TypeError),
        (["balls", "mass"], [1.0, "infinite"], "balls.mass[1] = 'infinite': expected a", TypeError),
        (["physics", "g"], "9.81", "physics.g = '9.81': expected a number, not str", TypeError),
        (["physics", "max_time"], True, "physics.max_time = True: expected a number, not bool", TypeError),
        (["balls", "radius"], [0.03, "inf"], "balls.radius[1] = inf: expected a number from 0.0001 to 10000 m", 0),
    ],
)
def test_from_dict_rejects_bad_data(path, value, message, kind):
    with rejected(message, kind or ValueError):
        Scene.from_dict(changed(path, value))


@pytest.mark.parametrize("data", [None, [], "pool"])
def test_from_dict_rejects_data_that_is_not_a_mapping(data):
    with rejected("expected a mapping", TypeError):
        Scene.from_dict(data)


# Construction


def test_scenes_are_immutable_and_hashable():
    scene = Scene.named("pool")
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.table = Table()  # pyright: ignore[reportAttributeAccessIssue]
    assert len({scene, Scene.named("pool"), Scene.named("carom")}) == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"motion": "slide"},
            "physics.motion = 'slide': expected one of 'ideal', 'rolling', 'sliding' (did you mean '",
        ),
        (
            {"cushion": "han"},
            "physics.cushion = 'han': expected one of 'restitution', 'han2005', 'stronge', 'mathavan2010' "
            "(did you mean 'han2005'",
        ),
        ({"motion": "ideal", "cushion": "restitution"}, "physics.max_time = None: expected a number of seconds"),
        (
            {"motion": "rolling"},
            "physics.cushion = 'han2005' with physics.motion = 'rolling': expected motion 'sliding'",
        ),
        ({"motion": "ideal", "max_time": 1.0}, "physics.cushion = 'han2005' with physics.motion = 'ideal'"),
    ],
)
def test_physics_rejects_unknown_and_incompatible_laws(arguments, message):
    with rejected(message):
        Physics(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message", "kind"),
    [
        ({"pockets": [Pocket(1.0, 0.5, 0.05)]}, "expected a tuple of Pocket objects", TypeError),
        ({"pockets": ((1.0, 0.5, 0.05),)}, "table.pockets[0] = (1.0, 0.5, 0.05): expected a Pocket", TypeError),
        ({"pockets": (Pocket(1.27, 0.0, 0.1), Pocket(1.4, 0.0, 0.1))}, "table.pockets[1] = Pocket(x=1.4", 0),
        ({"pockets": (Pocket(0.0, -0.75, 0.1),)}, "expected a circle that reaches the table (2.54 x 1.27 m", 0),
    ],
)
def test_table_rejects_bad_arguments(arguments, message, kind):
    with rejected(message, kind or ValueError):
        Table(**arguments)


@pytest.mark.parametrize(
    ("radius", "mass", "message", "kind"),
    [
        ((), (), "balls.radius = (): expected at least one ball, the cue ball", 0),
        ((R, R), (1.0,), "balls.mass has 1 values and balls.radius has 2: expected one value per ball", 0),
        ((R, R), (math.inf, 1.0), "balls.mass[0] = inf: expected a finite mass, the cue ball must be able to move", 0),
        ([R, R], (1.0, 1.0), "expected a tuple of numbers", TypeError),
    ],
)
def test_balls_rejects_bad_arguments(radius, mass, message, kind):
    with rejected(message, kind or ValueError):
        Balls(radius, mass)


@pytest.mark.parametrize("count", [0, -1, True, 1.0, "2"])
def test_uniform_needs_a_whole_number_of_balls(count):
    with rejected(f"n_balls = {count!r}: expected a whole number from 1 to 100000"):
        Balls.uniform(count)


def test_whole_numbers_become_floats():
    balls = Balls((1, 2), (3, 4))
    assert all(type(v) is float for v in (*balls.radius, *balls.mass, Table(length=3).length, Physics(g=9).g))


def test_scene_rejects_a_ball_wider_than_the_table():
    with rejected("scene.table of 2.54 x 0.05 m: expected room for a ball 0.0625 m across"):
        Scene(Balls((R,), (1.0,)), Table(width=0.05))


def test_han2005_needs_cushions_lower_than_the_balls():
    table = Table(cushion_height=2.5 * R)
    with rejected(f"scene.table.cushion_height = {2.5 * R}: expected less than the diameter of ball 1 ({2 * R} m)"):
        Scene(Balls((2 * R, R), (1.0, 1.0)), table)
    Scene(Balls((2 * R, R), (1.0, 1.0)), table, Physics(cushion="restitution"))


@pytest.mark.parametrize(("name", "value"), [("balls", None), ("table", {}), ("physics", "sliding")])
def test_scene_rejects_parts_of_the_wrong_type(name, value):
    with rejected(f"scene.{name} = {value!r}: expected a {name.capitalize()}", TypeError):
        Scene(**{"balls": Balls.uniform(1), name: value})


# Positions

SCENE = Scene(Balls((R, R), (1.0, 1.0)), Table(2.0, 1.0, 0.03, (Pocket(1.0, 0.5, 0.1),)), Physics(max_time=1.0))
CLEAR = [[-0.5, 0.0], [0.5, 0.0]]


def test_check_positions_returns_a_new_float_array():
    given = np.array(CLEAR)
    placed = check_positions(SCENE, given)
    assert placed.dtype == np.float64
    assert np.array_equal(placed, given)
    assert not np.shares_memory(placed, given)
    assert check_positions(SCENE, [[[0, 0], [-0.5, 0]]] * 3).shape == (3, 2, 2)


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        ([[0.0, 0.0]], "positions has shape (1, 2): expected (2, 2) or (m, 2, 2), one row per ball"),
        ([0.0, 0.0], "positions has shape (2,): expected (2, 2)"),
        ([[0.0] * 3] * 2, "positions has shape (2, 3): expected (2, 2)"),
        ([[[[0.0, 0.0]] * 2]], "positions has shape (1, 1, 2, 2): expected (2, 2)"),
        ([[0.0, 0.0], [math.nan, 0.1]], "positions: ball 1 is at [nan, 0.1]: expected finite coordinates"),
        ([[math.inf, 0.0], [0.0, 0.1]], "positions: ball 0 is at [inf, 0.0]: expected finite coordinates"),
        ([[0.97, 0.0], [0.0, 0.0]], "positions: ball 0 is at [0.97, 0.0]: expected |x| <= 0.96875 and |y| <= 0.46875"),
        ([[0.0, 0.0], [0.5, -0.47]], "positions: ball 1 is at [0.5, -0.47]: expected |x| <= 0.96875"),
        (
            [[0.95, 0.45], [0.0, 0.0]],
            "ball 0 is at [0.95, 0.45]: expected a place outside pocket 0, a circle of radius 0.1 m",
        ),
        ([[0.0, 0.0], [0.0, 0.06]], "positions: balls 0 and 1 are 0.06 m apart: expected at least 0.0625 m"),
        ([[0.0, 0.0], [0.0, 0.0]], "positions: balls 0 and 1 are 0.0 m apart"),
        ([CLEAR, [[0.0, 0.0], [0.0, 0.06]]], "positions: shot 1, balls 0 and 1 are 0.06 m apart"),
        ([CLEAR, CLEAR, [[0.0, 0.0], [9.0, 0.0]]], "positions: shot 2, ball 1 is at [9.0, 0.0]: expected |x|"),
        ([CLEAR, [[math.nan, 0.0], [0.0, 0.0]]], "positions: shot 1, ball 0 is at [nan, 0.0]: expected finite"),
        ([CLEAR, [[0.0, 0.0], [0.95, 0.45]]], "positions: shot 1, ball 1 is at [0.95, 0.45]: expected a place outside"),
    ],
)
def test_bad_positions_are_rejected(positions, message):
    with rejected(message):
        check_positions(SCENE, positions)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["pool", "real_pool"])
def test_places_far_away_are_checked_without_an_overflow(name):
    scene, far = Scene.named(name), [[0.0, 0.0], [1e308, -1.7e308]]
    with pytest.raises(ValueError, match="ball 1 is at "):
        check_positions(scene, far)
    assert check_positions(scene, far, in_play=np.array([True, False])).tolist() == far


def test_position_errors_use_the_given_name():
    with rejected("spots: ball 0 is at"):
        check_positions(SCENE, [[9.0, 0.0], [0.0, 0.0]], "spots")


def test_balls_may_touch_each_other_a_cushion_and_the_edge_of_a_pocket():
    check_positions(SCENE, [[0.0, 0.0], [2 * R, 0.0]])
    check_positions(SCENE, [[0.0, 0.0], [2 * R - CONTACT_GAP / 2, 0.0]])
    check_positions(SCENE, [[1.0 - R, 0.0], [-(1.0 - R) - CONTACT_GAP / 2, 0.0]])
    check_positions(SCENE, [[0.9 - R, 0.5 - R], [0.0, 0.0]])
    lip = 1.0 - 0.08, 0.5 - 0.06  # 0.1 m from the centre of the pocket
    check_positions(SCENE, [[lip[0] + 0.5 * CONTACT_GAP, lip[1]], [0.0, 0.0]])
    with rejected("apart"):
        check_positions(SCENE, [[0.0, 0.0], [2 * R - 2 * CONTACT_GAP, 0.0]])
    with rejected("inside the cushions"):
        check_positions(SCENE, [[0.0, 0.0], [1.0 - R + 2 * CONTACT_GAP, 0.0]])
    with rejected("outside pocket 0"):
        check_positions(SCENE, [[lip[0] + 2 * CONTACT_GAP, lip[1]], [0.0, 0.0]])


def test_balls_not_in_play_may_be_anywhere():
    for place in ([0.0, 0.0], [1.0, 0.5], [9.0, 9.0]):
        check_positions(SCENE, [[0.0, 0.0], place], in_play=np.array([True, False]))
    with rejected("shot 0, balls 0 and 1"):
        check_positions(SCENE, [[[0.0, 0.0]] * 2] * 2, in_play=np.array([[True, True], [True, False]]))
    with rejected("expected finite coordinates"):
        check_positions(SCENE, [[0.0, 0.0], [math.nan, 0.0]], in_play=np.array([True, False]))


def test_a_scene_prints_its_table_balls_and_physics():
    assert repr(Scene.named("blocked_pool")).splitlines() == [
        "Scene: table 2.54 x 1.27 m, 6 pockets",
        "  balls: 3, radius 0.028575 m, mass 0.170097 to inf kg",
        "  physics: sliding motion, han2005 cushions, mu_slide 0.2, mu_roll 0.01, e_ball 0.95, e_cushion 0.85",
    ]
    assert repr(Scene.named("ideal")).endswith("ideal motion, restitution cushions, e_ball 1, e_cushion 1, max_time 10")


def test_a_mapping_with_a_base_lists_the_changes_of_a_named_scene():
    base = Scene.named("real_pool", 9)
    changes = {"base": "real_pool", "n_object_balls": 9, "physics": {"mu_roll": 0.012}}
    assert Scene.from_dict(changes) == dataclasses.replace(
        base, physics=dataclasses.replace(base.physics, mu_roll=0.012)
    )
    assert Scene.from_dict({"base": "real_pool", "n_object_balls": 9}) == base
    assert Scene.from_dict({"base": "pool", "table": "pool_7ft"}).table == Table.named("pool_7ft")
    heavy = Scene.from_dict({"base": "pool", "balls": {"mass": [0.1, 0.2]}})
    assert (heavy.balls.mass, heavy.balls.radius) == ((0.1, 0.2), Scene.named("pool").balls.radius)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"base": "pol"}, "scene = 'pol': expected one of"),
        ({"base": "pool", "n_object_balls": 99}, "n_object_balls = 99: expected"),
        ({"base": "pool", "physic": {}}, "key of scene = 'physic': expected one of"),
        ({"base": "pool", "physics": {"mu_rol": 0.1}}, "key of scene.physics = 'mu_rol': expected one of"),
        ({"n_object_balls": 3}, "key of scene = 'n_object_balls': expected one of"),
    ],
)
def test_wrong_changes_of_a_named_scene_are_rejected(changes, message):
    with rejected(message):
        Scene.from_dict(changes)


@pytest.mark.parametrize("part", ["balls", "table", "physics", "cue"])
def test_a_whole_scene_may_not_leave_out_a_value(part):
    data = Scene.named("real_pool").to_dict()
    *_, last = data[part]
    del data[part][last]
    with rejected(f"scene.{part}.{last} is missing: expected all values in a whole scene"):
        Scene.from_dict(data)
