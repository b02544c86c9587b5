import dataclasses
import json
import math
import re
from typing import Any

import numpy as np
import pytest

from billiards_env.scene import CONTACT_GAP, SCENES, Balls, Physics, Scene, check_positions
from billiards_env.scene.table import Table, six_pockets
from tests.helpers.errors import rejected
from tests.helpers.scenes import CLEAR, SCENE, R

# Defaults and named scenes


def test_the_defaults_are_a_nine_foot_table_and_pool_balls():  # those of `Physics` are in a table of docs/scenes.md
    scene = Scene(Balls.uniform(2))
    assert (scene.table.length, scene.table.width, scene.table.pockets) == (2.54, 1.27, ())
    assert scene.table.cushion_height == pytest.approx(0.635 * 0.05715)
    assert scene.balls == Balls((0.028575,) * 2, (0.170097,) * 2)
    assert scene.physics == Physics()


def test_blocked_pool_is_pool_with_ball_2_fixed():
    blocked, pool = Scene.named("blocked_pool", 3), Scene.named("pool", 3)
    assert (blocked.table, blocked.physics, blocked.balls.radius) == (pool.table, pool.physics, pool.balls.radius)
    assert blocked.balls.mass == (0.170097, 0.170097, math.inf, 0.170097)


def test_pool_has_six_pockets_on_the_cushion_line():
    pockets = Scene.named("pool").table.pockets
    assert pockets == six_pockets()
    assert {(p.x, p.y) for p in six_pockets(2.0, 1.0)} == {(x, y) for x in (-1.0, 0.0, 1.0) for y in (-0.5, 0.5)}
    assert {(p.x, p.y) for p in pockets} == {(x, y) for x in (-1.27, 0.0, 1.27) for y in (-0.635, 0.635)}
    assert {(p.x == 0, round(p.radius, 6)) for p in pockets} == {(False, 0.057944), (True, 0.064294)}


def test_carom_scenes_have_a_match_table_without_pockets():
    carom, pooltool = Scene.named("carom"), Scene.named("benchmarks:pooltool_carom")
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


# Plain data


@pytest.mark.parametrize("name", SCENES)
def test_named_scenes_survive_strict_json(name):
    scene = Scene.named(name, 3)
    assert Scene.from_dict(json.loads(json.dumps(scene.to_dict(), allow_nan=False))) == scene


def test_to_dict_returns_only_plain_types():
    g: Any = np.float32(9.75)
    for scene in (
        Scene.named("pool", 2),
        Scene(Balls((R,), (0.2,)), Table(length=np.float64(2), width=3), Physics(g=g)),
    ):
        data = scene.to_dict()
        assert repr(data) == repr(json.loads(json.dumps(data)))
    assert Scene.named("blocked_pool").to_dict()["balls"]["mass"] == [0.170097, 0.170097, "inf"]


def test_fields_with_a_default_are_optional():
    assert Scene.from_dict({"balls": {"radius": [0.03], "mass": [1]}}) == Scene(Balls((0.03,), (1.0,)))
    scene = Scene.from_dict({"balls": {"radius": [0.03], "mass": [1]}, "table": {"width": 1}, "physics": {"g": 5}})
    assert scene == Scene(Balls((0.03,), (1.0,)), Table(width=1.0), Physics(g=5.0))


@pytest.mark.parametrize("version", [2, 0, 1.0, True, "1", None])
def test_a_scene_of_another_version_is_refused(version):
    data = Scene.named("pool").to_dict()
    assert data["version"] == 1
    for changed in (data, {"base": "pool"}, {"balls": data["balls"]}):
        with pytest.raises(
            ValueError, match=re.escape(f"scene.version = {version!r}: expected 1; another version of ")
        ):
            Scene.from_dict({**changed, "version": version})
        assert Scene.from_dict({**changed, "version": 1}) == Scene.from_dict(changed)
    del data["version"]
    assert Scene.from_dict(data) == Scene.named("pool")


def test_from_dict_does_not_change_its_argument():
    data = Scene.named("pool").to_dict()
    before = json.dumps(data)
    Scene.from_dict(data)
    assert json.dumps(data) == before


# Construction


def test_scenes_are_immutable_and_hashable():
    scene = Scene.named("pool")
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.table = Table()  # pyright: ignore[reportAttributeAccessIssue]
    assert len({scene, Scene.named("pool"), Scene.named("carom")}) == 2


def test_whole_numbers_become_floats():
    balls = Balls((1, 2), (3, 4))
    assert all(type(v) is float for v in (*balls.radius, *balls.mass, Table(length=3).length, Physics(g=9).g))


# Positions


def test_check_positions_returns_a_new_float_array():
    positions = np.array(CLEAR)
    placed = check_positions(SCENE, positions)
    assert placed.dtype == np.float64
    assert np.array_equal(placed, positions)
    assert not np.shares_memory(placed, positions)
    assert check_positions(SCENE, [[[0, 0], [-0.5, 0]]] * 3).shape == (3, 2, 2)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["pool", "real_pool"])
def test_places_far_away_are_checked_without_an_overflow(name):
    far = [[0.0, 0.0], [1e308, -1.7e308]]
    assert check_positions(Scene.named(name), far, in_play=np.array([True, False])).tolist() == far


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
    faster = dataclasses.replace(base.physics, mu_roll=0.012)
    assert Scene.from_dict(changes) == dataclasses.replace(base, physics=faster)
    assert Scene.from_dict({"base": "real_pool", "n_object_balls": 9}) == base
    for start in ({"base": "pool"}, {"balls": {"radius": [0.03], "mass": [0.2]}}):
        assert Scene.from_dict({**start, "table": "pool_7ft"}).table == Table.named("pool_7ft")
    heavy = Scene.from_dict({"base": "pool", "balls": {"mass": [0.1, 0.2]}})
    assert (heavy.balls.mass, heavy.balls.radius) == ((0.1, 0.2), Scene.named("pool").balls.radius)
