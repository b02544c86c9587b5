"""Balls that leave the cloth, with the values of Alciatore's TP B.5 and TP B.10."""

import dataclasses
import math
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, simulate, simulate_batch
from billiards_env.drawing.rendering import drawn_layout
from billiards_env.engine import PIC, Engine, scene_fields
from billiards_env.engine.overlaps import FIXES, TREATMENTS
from billiards_env.engine.strikes import strike
from billiards_env.envs import make_env
from billiards_env.envs.actions import cue_strike
from billiards_env.games import records
from billiards_env.games.facts import cue_off, facts_of
from billiards_env.games.playing import History
from billiards_env.games.playing import play as play_stroke
from billiards_env.physics.state import AIRBORNE, SLIDING, UX, UY, VX, VY, VZ, WZ, Z
from billiards_env.physics.strike import cue_numbers, speed_gain
from billiards_env.scene import Balls, Physics, Pocket, Table
from billiards_env.scene.outline import pieces as pieces_of
from billiards_env.shots.records import from_json, to_json
from billiards_env.shots.simulation import replay
from tests.helpers.shots import run_both

R, G = 0.028575, 9.81
MPH, FOOT, INCH = 0.44704, 0.3048, 0.0254
FAR = [[0.0, 15.0], [0.0, -15.0]]  # places of balls 1 and 2, which take no part


def scene(length=40.0, pockets=(), n=3, **physics):
    """Returns a scene of three balls on a large table. All scenes here compile one engine."""
    laws = Physics(flight=True, ball_ball="frictional", **physics)
    return Scene(Balls.uniform(n, R), Table(length, 40.0, pockets=pockets), laws)


def jaws_scene(**physics):
    """Returns a scene of three balls on a table with jaws. All scenes here compile one engine."""
    return Scene.from_dict({"base": "real_pool", "n_object_balls": 2, "physics": {"flight": True, **physics}})


def play(where, velocity, spin: Any = (0.0, 0.0, 0.0), others=FAR, **options) -> Any:
    """Plays a shot of ball 0 from (x, y[, z]) with the velocity (vx, vy[, vz])."""
    place = [*where, *[0.0] * (3 - len(where))]
    places = [place, *([*other, *[0.0] * (3 - len(other))] for other in others)]
    options = {"scene": scene(), "record": True, **options}
    return simulate(options.pop("scene"), places, velocity, spins=spin, **options)


def pieces(shot, ball=0, phases=(AIRBORNE,)):
    """Returns the rows of the pieces of a ball's trajectory in some phases."""
    paths = shot.trajectory
    return paths.rows[(paths.ball == ball) & np.isin(paths.phase, phases)]


def kinds(shot, ball=0):
    return [event["kind"] for event in shot.events if ball in (event["ball"], event["other"])]


def energy(shot, time):
    """Returns the energy at a time, per mass, J/kg."""
    velocities, spins = shot.motion_at(time)
    return (velocities**2).sum() / 2 + 0.2 * R**2 * (spins**2).sum() + G * shot.heights_at(time).sum()


# Elevation of the cue: after each landing the speed (mph), the spin (rev/s), the angle (degrees) and the hop (ft)
TP_B10 = {
    5.0: [
        (10.855, 32.897, 3.091, 0.848),
        (10.658, None, 1.889, 0.500),
        (10.542, None, 1.145, 0.297),
        (10.473, None, 0.692, 0.177),
        (10.432, 30.360, 0.417, 0.106),
    ],
    12.0: [(10.300, None, None, 1.906), (9.794, None, None, 1.093)],
}


@pytest.mark.parametrize("elevation", TP_B10)
def test_the_hops_after_a_draw_shot_are_those_of_tp_b10(elevation):
    angle, speed, turn = math.radians(elevation), 11.194 * MPH, 34.841 * 2 * math.pi
    velocity = [speed * math.cos(angle), 0.0, -speed * math.sin(angle)]
    shot = play([-8, 0], velocity, (0.0, -turn, 0.0), scene=scene(least_hop=1e-6))
    hops = pieces(shot)[1:]  # the first piece lands at once
    for row, (speed, spin, degrees, length) in zip(hops, TP_B10[elevation], strict=False):
        duration = 2 * row[VZ] / G
        assert math.hypot(row[VX], row[VZ]) / MPH == pytest.approx(speed, abs=6e-4)
        assert row[VX] * duration / FOOT == pytest.approx(length, abs=1.2e-3)
        if spin:
            assert (row[UX] - row[VX]) / R / 2 / math.pi == pytest.approx(spin, abs=1.2e-3)
        if degrees:
            assert math.degrees(math.atan2(row[VZ], row[VX])) == pytest.approx(degrees, abs=6e-4)
    assert shot.heights_at(shot.time).tolist() == [0.0] * 3


def test_a_smooth_elastic_ball_hops_without_end():
    smooth = scene(e_slate=1.0, mu_slate=1e-12, max_time=5.0)
    shot = play([-8, 0, 0.3], [1.5, 0.2, 0.0], (3.0, 4.0, 5.0), scene=smooth)
    fall = math.sqrt(2 * 0.3 / G)
    landings = shot.events["time"][shot.events["kind"] == "landing"]
    assert landings == pytest.approx(fall * np.arange(1, 2 * len(landings), 2), abs=1e-13)
    assert shot.heights_at(4 * fall)[0] == pytest.approx(0.3, abs=1e-13)
    velocity, spins = shot.motion_at(4.9)
    rises = G * (fall * (2 * len(landings)) - 4.9)  # the ball is at the top of a hop at multiples of 2 * fall
    assert velocity[0] == pytest.approx([1.5, 0.2, rises], abs=1e-10)
    assert spins[0] == pytest.approx([3.0, 4.0, 5.0], abs=1e-8)
    with pytest.raises(ValueError, match=r"e_slate = 1\.0 without a max_time"):
        scene(e_slate=1.0)


@pytest.mark.parametrize("seed", range(4))
def test_flights_and_landings_keep_what_a_force_below_the_centre_keeps(seed):
    rng = np.random.default_rng(seed)
    velocity, spin = rng.normal(0, [1.0, 0.3, 2.0]), rng.normal(0, 60, 3)
    shot = play([0, 0, rng.uniform(0, 0.2)], velocity, spin, scene=scene(least_hop=1e-5))
    rows = pieces(shot, phases=(AIRBORNE, SLIDING))
    assert len(rows) > 3
    kept = rows[:, [VX, VY]] - 2 / 7 * rows[:, [UX, UY]]  # 5/7 v - 2/7 R z x omega
    assert kept == pytest.approx(np.tile(kept[0], (len(rows), 1)), abs=1e-13)
    assert np.unique(pieces(shot)[:, WZ]).size == 1
    turns = np.sum((rows[:, [UX, UY]] - rows[:, [VX, VY]]) ** 2, axis=1) + (R * rows[:, WZ]) ** 2
    energy = np.sum(rows[:, [VX, VY, VZ]] ** 2, axis=1) / 2 + turns / 5 + G * rows[:, Z]
    assert (np.diff(energy) < 1e-14).all()


def test_a_ball_that_rolls_hops_without_friction():
    shot = play([-8, 0], [2.0, 0.0, 1.0], (0.0, 2.0 / R, 0.0))
    assert (pieces(shot)[:, VX] == 2.0).all()
    assert "sliding_rolling" not in kinds(shot)


def test_the_end_of_the_hops_has_the_friction_of_all_hops():
    shots = [play([-8, 0], [3.0, 0.0, 1.0], scene=scene(least_hop=least)) for least in (1e-4, 1e-12)]
    early, late = (shot.at(0.45)[0, 0] for shot in shots)  # both slide
    assert len(shots[0].events) < len(shots[1].events)
    assert early == pytest.approx(late, abs=2e-11)


def test_a_shot_that_ends_in_the_air_is_the_begin_of_the_whole_and_may_go_on():
    whole = play([-8, 0], [3.0, 0.5, -1.0], (10.0, -20.0, 30.0))
    cut = play([-8, 0], [3.0, 0.5, -1.0], (10.0, -20.0, 30.0), max_time=0.05)
    assert cut.heights[0, 0] == whole.heights_at(0.05)[0] > 0
    assert np.array_equal(cut.events, whole.events[: len(cut.events)])
    state = [np.column_stack((part, cut.heights[:, k])) for k, part in enumerate((cut.positions, cut.velocities))]
    assert np.array_equal(replay(from_json(to_json(cut.to_record()))).positions, cut.positions)
    rest = simulate(scene(), *state, spins=cut.spins)
    assert rest.positions == pytest.approx(whole.positions, abs=1e-12)


@pytest.mark.parametrize(("speed", "inches"), [(7, 0.067), (12, 0.196), (20, 0.544)])
def test_a_rolling_ball_hops_after_a_straight_hit_as_in_tp_b5(speed, inches):
    speed *= MPH
    laws = scene(mu_ball=0.06, e_ball=0.94)
    shot = play([-1, 0], [speed, 0.0], (0.0, speed / R, 0.0), [[0.0, 0.0], FAR[1]], scene=laws, max_time=1.0)
    rising, at = pieces(shot)[0, VZ], shot.first_hit_time
    hit = shot.events[shot.events["kind"] == "ball_ball"]["speed"][0]
    assert rising**2 / (2 * G) == pytest.approx((0.06 * 1.94 * hit) ** 2 / (8 * G), rel=1e-12)
    assert (0.06 * 1.94 * speed) ** 2 / (8 * G) / INCH == pytest.approx(inches, abs=1.2e-3)
    lands = shot.events[(shot.events["kind"] == "landing") & (shot.events["ball"] == 1)][0]
    assert (lands["time"], lands["speed"]) == (at, pytest.approx(rising, rel=1e-12))  # pressed into the slate


def test_a_ball_that_falls_on_two_others_hits_both_at_once():
    """The result is mirrored bit for bit, also with other numbers of the balls."""
    others = [[0.0, 1.01 * R], [0.0, -1.01 * R]]
    shot = play([-0.1, 0.0, 0.05], [1.0, 0.0, 0.1], (0.0, 20.0, 0.0), others, max_time=0.5)
    hits = shot.events[shot.events["kind"] == "ball_ball"]
    assert hits["time"][0] == hits["time"][1]
    assert shot.touched_first.tolist() == [False, True, True]
    assert np.array_equal(shot.positions[1], shot.positions[2] * [1, -1])
    assert shot.positions[0, 1] == 0.0
    other = play([0.1, 0.0, 0.05], [-1.0, 0.0, 0.1], (0.0, -20.0, 0.0), others[::-1], max_time=0.5)
    assert np.array_equal(other.positions[[0, 2, 1]], shot.positions * [-1, 1])
    speeds = pieces(shot, 0)[1, [VX, VZ]], [pieces(shot, ball)[0, [VX, VZ]] for ball in (1, 2)]
    t = hits["time"][0]
    assert speeds[0] + sum(speeds[1]) == pytest.approx([1.0, 0.1 - G * t], abs=1e-13)


RACK = [[math.sqrt(3) * R * row, R * (2 * k - row)] for row in range(5) for k in range(row + 1)]
HEAPS = {  # the places of the balls, of which the first falls
    "exactly above another": [[0.3, 0.2, 0.2], [0.3, 0.2], FAR[0]],
    "above another in the middle": [[0.0, 0.0, 2 * R], [0.0, 0.0], FAR[0]],
    "nearly above another": [[0.3 + 1e-12, 0.2, 0.2], [0.3, 0.2], FAR[0]],
    "a stack of three": [[0.3, 0.2, 4 * R + 0.02], [0.3, 0.2, 2 * R + 0.01], [0.3, 0.2]],
    "into a groove": [[0.0, 0.0, 0.2], [0.0, R], [0.0, -R]],
    "on the middle of a rack": [[RACK[4][0], RACK[4][1], 0.2], *RACK],
    "between three balls of a rack": [[RACK[4][0] + 2 * R / math.sqrt(3), RACK[4][1], 0.2], *RACK],
}


@pytest.mark.parametrize("name", HEAPS)
def test_a_ball_that_falls_on_others_comes_down_to_the_cloth(name):
    places = [[*place, *[0.0] * (3 - len(place))] for place in HEAPS[name]]
    s = scene(n=len(places))
    shot: Any = simulate(s, places, [0.0, 0.0], record=True)
    assert (shot.status, shot.heights.any()) == ("rest", False)
    assert shot.n_events < 12_000
    mirrored: Any = simulate(s, np.array(places) * [1, -1, 1], [0.0, 0.0])
    assert np.array_equal(mirrored.positions, shot.positions * [1, -1])
    energies = [energy(shot, time) for time in np.linspace(0.0, shot.time, 200)]
    assert max(np.diff(energies)) < 1e-4


def test_shots_at_balls_exactly_above_one_another_end_by_physics():
    """The impacts at one instant end, and the struck ball, which is below the others, moves on."""
    rng, m = np.random.default_rng(0), 100
    velocities = np.column_stack((rng.uniform(1.5, 5.0, m), np.zeros(m), rng.uniform(0.8, 1.8, m)))
    velocities[:2] = [[2.0, 0.0, 1.4574], [4.0, 0.0, 1.4574]]
    places = np.array([[[0.3, 0.2, 2 * R * k] for k in range(3)]] * m)
    batch: Any = simulate_batch(scene(), places, velocities, max_events=50_000)
    assert set(batch.status) == {"rest"}
    assert not batch.heights.any()
    assert (np.hypot(*(batch.positions[:, 0] - [0.3, 0.2]).T) > 0.1).all()


@pytest.mark.parametrize(("speed", "expected"), [(2.6, True), (1.6, False)])
def test_a_jump_shot_passes_over_a_ball_or_hits_it(speed, expected):
    struck = strike(scene(), speed, 0.0, elevation=math.radians(45))
    assert struck.velocity[2] == pytest.approx(-struck.velocity[0], rel=1e-12)
    shot = play([-8, 0], struck, None, [[-7.8, 0.0], FAR[1]])
    assert (shot.first_hit < 0) == expected
    if expected:
        assert shot.positions[0, 0] > -7.0


def test_a_hop_at_31_degrees_meets_a_ball_0_40_m_ahead():  # pooltool, pull request 384
    struck = strike(scene(), 2.8, 0.0, elevation=math.radians(31))
    shot = play([-8, 0], struck, None, [[-7.6, 0.0], FAR[1]], max_time=1.0)
    assert kinds(shot)[:2] == ["landing", "ball_ball"]
    z = shot.heights_at(shot.first_hit_time)[0]
    x = shot.at(shot.first_hit_time)[0, 0]
    assert 0.01 < z < 2 * R
    assert math.hypot(-7.6 - x, z) == pytest.approx(2 * R, abs=1e-14)


def test_a_ball_in_the_air_meets_the_nose_of_a_cushion_or_flies_over_it():
    s = scene(length=2.0)
    sine = s.table.cushion_height / R - 1
    nose = np.array([1.0 - R * (1 - math.sqrt(1 - sine**2)), R * sine])
    low = play([0.8, 0, 0.02], [2.0, 0.1, 0.3], (5.0, 9.0, 7.0), scene=s, max_time=0.2)
    assert kinds(low)[0] == "cushion"
    hit = low.events[0]
    z = low.heights_at(hit["time"])[0]
    assert math.hypot(nose[0] - hit["x"], nose[1] - z) == pytest.approx(R, abs=1e-14)
    n = np.array([nose[0] - hit["x"], 0.0, nose[1] - z]) / R
    before, after = pieces(low)[:2]
    velocity = before[[VX, VY, VZ]] - [0, 0, G * hit["time"]]
    assert after[[VX, VY, VZ]] @ n == pytest.approx(-0.85 * velocity @ n, rel=1e-12)
    assert low.cushions[0] == 1
    high = play([0.8, 0.5, 0.05], [2.0, 0.1, 1.0], scene=s)
    assert kinds(high) == ["off_table"]
    assert high.potted.tolist() == [True, False, False]
    assert (high.pockets[0], high.pot_order[0]) == (-1, 0)
    assert high.positions[0, 0] == 1.0 + s.balls.radius[0]
    assert facts_of((cue_off,), high)["cue_off"]


def test_a_smooth_elastic_tip_mirrors_the_velocity_of_a_ball_in_the_air():
    pool = smooth = jaws_scene(e_cushion=1.0, mu_cushion=0.0)
    shot = play([1.15, 0.585, 0.02], [2.0, -0.7, 0.3], (1.0, 2.0, 3.0), [[0, 0], [0.5, 0]], scene=smooth, max_time=0.1)
    hit = shot.events[0]
    (tip,) = (tip for tip in pieces_of(pool.table.outline)[1] if math.hypot(tip.x - hit["x"], tip.y - hit["y"]) < 0.06)
    way = np.array([tip.x - hit["x"], tip.y - hit["y"]])
    sine = pool.table.cushion_height / R - 1
    across = np.hypot(*way) - tip.radius - R * (1 - math.sqrt(1 - sine**2))  # to the nose
    up = R * sine - shot.heights_at(hit["time"])[0]
    assert math.hypot(across, up) == pytest.approx(R, abs=1e-14)
    n = np.array([*(across * way / np.hypot(*way)), up]) / R
    before, after = pieces(shot)[:2]
    velocity = before[[VX, VY, VZ]] - [0, 0, G * hit["time"]]
    assert up < -0.01
    assert after[[VX, VY, VZ]] == pytest.approx(velocity - 2 * (velocity @ n) * n, abs=1e-13)
    assert after[WZ] == before[WZ]


POCKET = Pocket(1.0, 0.0, 0.08)


@pytest.mark.parametrize(
    ("velocity", "kind"),
    [([1.0, 0.0, 0.9], "pocket"), ([2.0, 0.0, 0.76], "pocket"), ([2.0, 0.0, 1.5], "off_table")],
    ids=["lands in it", "hits the back", "flies over it"],
)
@pytest.mark.parametrize("engine", [PIC, Engine("pit", 1 / 60), Engine("pit", 1 / 6000)])
def test_a_ball_falls_into_a_pocket_from_the_air_or_flies_over_it(velocity, kind, engine):
    shot = play([0.8, 0.0], velocity, scene=scene(length=2.0, pockets=(POCKET,)), engine=engine)
    assert kinds(shot) == [kind]
    assert (shot.potted[0], shot.pockets[0]) == (True, 0 if kind == "pocket" else -1)


def test_a_batch_has_the_bits_of_single_shots():
    s, rng = scene(length=2.0, pockets=(POCKET,)), np.random.default_rng(1)
    places = np.tile([[-0.7, 0.3], [0.2, 0.0], [0.5, 1.0]], (8, 1, 1))
    struck = strike(s, rng.uniform(1, 4, 8), rng.uniform(-0.5, 0.5, 8), elevation=rng.uniform(0.1, 1, 8))
    batch, singles = run_both(s, places, struck.velocity, struck.spin)
    assert not any(shot.heights.any() for shot in singles)
    assert batch.first_hit.max() > 0
    assert np.array_equal(batch[0].positions, batch.positions[0])


def test_an_environment_plays_strikes_that_make_the_ball_hop():
    places = np.array([[-0.6, 0.0], [0.6, 0.3], [0.6, -0.4]])
    env: Any = make_env(scene="jump_pool", n_object_balls=2, action="strike")
    env.reset(seed=0, options={"positions": places})
    layout: Any = drawn_layout(env._episodes, 0).shot
    assert layout.heights.tolist() == [[0.0, 0.0]] * 3
    action = np.array([0.5, 0.1, 0.0, 0.0, 0.5])
    observation, *_ = env.step(action)
    speed = env.model.max_speed * math.hypot(0.5, 0.1) / speed_gain(cue_numbers(env.model.scene), 0.0)
    struck = strike(env.model.scene, speed, math.atan2(0.1, 0.5), elevation=math.pi / 4)
    assert cue_strike(action, env.model.scene, env.model.max_speed).velocity == pytest.approx(struck.velocity)
    shot: Any = simulate("jump_pool", places, struck, record=True)
    assert (shot.events["kind"] == "landing").sum() > 3
    seen = env.decode(observation)["positions"] * env.model.scene.half_extents
    assert seen == pytest.approx(shot.positions, abs=1e-6)


def test_a_game_repeats_a_stroke_that_makes_the_ball_hop():
    env: Any = make_env(scene=Scene.named("jump_pool", 9), task="nine_ball", n_players=2, action="strike")
    env.reset(seed=1)
    before = env.game
    env.step(np.array([0.9, 0.02, 0.0, 0.0, 0.3, 0.0, 0.0]))
    played = play_stroke(env.model.setup, before, env.stroke)
    assert "landing" in kinds(played.shot, int(before.state.cue_balls[0]))
    assert np.array_equal(played.game.positions[1:], env.game.positions[1:])
    record = records.record_game(History(env.model.setup, before, (env.stroke,)))
    read: Any = records.from_json(records.to_json(record))
    assert read.strokes == (env.stroke,)


def test_the_cue_does_not_drive_a_ball_above_the_cue_ball():
    struck = strike(scene(), 2.0, 0.0)
    shot: Any = simulate(scene(), [[0, 0, 0], [0.03, 0, 0.5], [*FAR[0], 0]], struck, max_time=0.01)
    assert shot.velocities[1].tolist() == [0.0, 0.0]


MASSES = dataclasses.replace(scene(), balls=Balls((R,) * 3, (0.1, 0.4, 0.17)))


def test_the_push_of_a_ball_off_another_one_exchanges_momentum():
    shot = play([0, 0, 0.5], [0, 0, 1e-6], others=[[0, 0, 0.5 + 2 * R], FAR[1]], scene=MASSES, max_time=1e-3)
    (vx, _), (wx, _), _ = shot.velocities
    assert shot.n_contact_rule > 0
    assert 0.1 * vx + 0.4 * wx == pytest.approx(0.0, abs=1e-16)
    assert vx < 0.0 < wx


SIZES = dataclasses.replace(scene(), balls=Balls((0.024, 0.036, R), (0.09, 0.3, 0.17), shape="sphere"))
REACH, TOUCH = 0.024 + 0.036, 2 * math.sqrt(0.024 * 0.036)  # balls 0 and 1 in contact: in space, on the cloth


@pytest.mark.parametrize(("ball", "other"), [(0, 1), (1, 0)])
def test_an_impact_on_the_cloth_presses_the_smaller_ball_down_and_lifts_the_larger_one(ball, other):
    smooth = dataclasses.replace(SIZES, physics=Physics(flight=True, ball_ball="frictional", mu_ball=0.0))
    places, velocities, spins = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    places[:, 0], velocities[ball, 0], spins[ball, 1] = -5.0, 3.0, 3.0 / smooth.balls.radius[ball]
    places[ball, 0], places[other, 0] = -0.3, 0.0
    shot: Any = simulate(smooth, places, velocities, spins=spins, record=True, max_time=1.0)
    hit = shot.events[0]
    assert np.ptp(shot.at(hit["time"])[:2, 0]) == pytest.approx(TOUCH, abs=1e-14)
    cosine, sine = TOUCH / REACH, (0.036 - 0.024) / REACH
    mass = np.array(smooth.balls.mass)
    push = 1.95 * hit["speed"] / (1 / mass[:2]).sum()
    ahead = 1 if ball == 0 else -1  # 1 if the larger ball is in front of the smaller one
    speeds = np.array([[-ahead * cosine, -sine], [ahead * cosine, sine]]) * push / mass[:2, None]
    speeds[ball, 0] += hit["speed"] / cosine
    small, large = pieces(shot, 0), pieces(shot, 1)
    assert small[0, [VX, VZ]] == pytest.approx(speeds[0], rel=1e-12)
    assert large[0, [VX, VZ]] == pytest.approx(speeds[1], rel=1e-12)
    landing = shot.events[(shot.events["kind"] == "landing") & (shot.events["ball"] == 0)][0]
    assert (landing["time"], landing["speed"]) == (hit["time"], pytest.approx(-speeds[0, 1], rel=1e-12))
    assert small[1, VZ] == pytest.approx(-0.6 * speeds[0, 1], rel=1e-12)


def test_balls_of_two_sizes_meet_in_the_air_at_the_sum_of_their_radii():
    shot = play([-0.2, 0.0, 0.2], [1.5, 0.1, 1.0], others=[[0.0, 0.05, 0.3], FAR[1]], scene=SIZES, max_time=1.0)
    time = float(shot.events[0]["time"])
    places = np.column_stack((shot.at(time), shot.heights_at(time) + SIZES.balls.radius))
    assert shot.events[0]["kind"] == "ball_ball"
    assert math.dist(places[0], places[1]) == pytest.approx(REACH, abs=1e-14)


@pytest.mark.parametrize("ball", [0, 1])
def test_a_nose_has_the_height_above_the_cloth_that_is_given(ball):
    s = dataclasses.replace(SIZES, table=scene(length=2.0).table)
    places, velocities = np.array([[0.8, 0.0, 0.02], [0.8, 0.3, 0.02], [-0.5, 0.0, 0.0]]), np.zeros((3, 3))
    velocities[ball] = [3.0, 0.0, 0.1]
    shot: Any = simulate(s, places, velocities, record=True, max_time=0.3)
    hit = shot.events[shot.events["kind"] == "cushion"][0]
    radius, h = s.balls.radius[ball], s.table.cushion_height
    across = 1.0 - radius + math.sqrt(radius**2 - (h - radius) ** 2) - hit["x"]
    assert hit["ball"] == ball
    up = h - radius - shot.heights_at(float(hit["time"]))[ball]
    assert math.hypot(across, up) == pytest.approx(radius, abs=1e-14)


def test_balls_of_two_sizes_may_touch_at_the_start_but_not_overlap():
    above = REACH + 0.024 - 0.036 - 1e-13  # the height of ball 1 on top of ball 0
    for ball, height in ((1, above), (0, REACH + 0.036 - 0.024 - 1e-13)):
        places = np.zeros((3, 3))
        places[2, 0], places[ball, 2] = 1.0, height
        simulate(SIZES, places, [0.0, 0.0], max_time=0.01)
        places[ball, 2] -= 1e-9
        with pytest.raises(ValueError, match=r"balls \d and \d are 0\.0599\d* m apart: expected at least"):
            simulate(SIZES, places, [0.0, 0.0])
    play([0, 0], [0.0, 0.0], others=[[TOUCH, 0.0], FAR[1]], scene=SIZES, max_time=0.01)
    small = dataclasses.replace(SIZES, table=scene(length=2.0).table)
    nose = 1.0 - R + 1e-3  # too near for the ball of radius R, but not for the smaller one
    play([nose, 0.0, 0.01], [0.0, 0.0], others=[[0.0, 0.5], [0.0, -0.5]], scene=small, max_time=0.01)
    with pytest.raises(ValueError, match="expected balls in the air between the noses"):
        play([0.0, 0.0], [0.0, 0.0], others=[[0.0, 0.5], [nose, 0.0, 0.01]], scene=small)


def test_balls_of_two_sizes_that_friction_presses_together_on_the_cloth_stay_close():
    """Gravity does not press the balls together. With the contact time of gravity, hops would be 100 times as long."""
    shot = play([-TOUCH, 0], [0.0, 0.0], (0.0, 60.0, 0.0), [[0.0, 0.0], FAR[1]], scene=SIZES, max_time=0.1)
    times = np.linspace(0.0, 0.1, 2001)
    assert shot.n_contact_rule > 100
    assert shot.velocities[0, 0] > 0.02
    assert np.ptp(shot.at(times)[:, :2, 0], axis=1) == pytest.approx(TOUCH, abs=1e-7)


def test_what_has_no_flight_is_refused():
    s = scene()
    for fix in FIXES:
        refused = pytest.raises(ValueError, match=rf"fix = '{fix}' with physics\.flight = True")
        with refused if TREATMENTS[fix].goes_back else nullcontext():
            scene_fields(s, Engine("pit", 1 / 60, fix))
    with pytest.raises(ValueError, match="with a ball of infinite mass: expected finite masses"):
        dataclasses.replace(s, balls=Balls(s.balls.radius, (0.17, 0.17, math.inf)))
    with pytest.raises(ValueError, match="and several radii: expected 'sphere'"):
        dataclasses.replace(s, balls=Balls((R, R, 0.03), s.balls.mass))
    with pytest.raises(ValueError, match=r"less than the diameter of the smallest ball \(0\.03 m\)"):
        dataclasses.replace(scene(cushion="restitution"), balls=Balls((R, R, 0.015), s.balls.mass, shape="sphere"))
    with pytest.raises(ValueError, match="motion 'sliding'"):
        Physics(flight=True, motion="rolling", cushion="restitution")
    with pytest.raises(ValueError, match="velocities has shape"):
        simulate("carom", [[0, 0], [0.5, 0], [0.5, 0.5]], [1.0, 0.0, -1.0])
    with pytest.raises(ValueError, match=r"positions\[0\]\[2\] = -0\.1"):
        play([0, 0, -0.1], [1.0, 0.0])
    with pytest.raises(ValueError, match=r"balls 0 and 1 are 0\.05"):
        play([0, 0, 0.05], [1.0, 0.0], others=[[0.0, 0.0], FAR[1]])


def test_scenes_with_and_without_flight_have_data():
    for one in (Scene.named("pool"), scene()):
        assert Scene.from_dict(one.to_dict()) == one


HERE, STILL, SHORT, JAWS = [[0.0, 0.5], [0.0, -0.5]], (0.0, 0.0, 0.0), scene(length=2.0), jaws_scene()
FALLING = {  # where the cue ball is, its velocity and spin, the other balls, the scene, and the end, s
    "jumps over a ball": ((-8, 0), (2.1, 0.0, -2.1), STILL, [[-7.8, 0.0], FAR[1]], scene(), None),
    "hops": ((-8, 0), (5.0, 0.0, -1.0), (0.0, -200.0, 0.0), FAR, scene(), None),
    "hits a ball in the air": ((-8, 0, 0.3), (1.0, 0.2, 0.0), (3.0, 4.0, 5.0), [[-7.8, 0.06], FAR[1]], scene(), 0.5),
    "hits a heavy ball": ((-8, 0, 0.3), (1.0, 0.2, 0.0), (3.0, 4.0, 5.0), [[-7.8, 0.06], FAR[1]], MASSES, 0.5),
    "hits a nose": ((0.8, 0, 0.02), (2.0, 0.1, 0.3), (5.0, 9.0, 7.0), HERE, SHORT, 0.5),
    "hits a nose fast": ((0.8, 0.5, 0.01), (9.0, 0.0, 0.0), STILL, HERE, SHORT, 0.1),
    "hits a larger ball": ((-8, 0, 0.3), (1.0, 0.2, 0.0), (3.0, 4.0, 5.0), [[-7.8, 0.06], FAR[1]], SIZES, 0.5),
    "rolls into a larger ball": ((-8, 0), (2.0, 0.1, 0.0), STILL, [[-7.8, 0.02], FAR[1]], SIZES, 0.5),
    "falls on a ball": ((0.3, 0.2, 0.2), STILL, STILL, [[0.3, 0.2], HERE[1]], SHORT, None),
    "hits a rail with jaws": ((1.0, 0.2, 0.02), (3.0, 1.0, 0.1), (5.0, 9.0, 7.0), HERE, JAWS, 0.12),
    "hits a tip": ((1.15, 0.585, 0.02), (2.0, -0.7, 0.3), (1.0, 2.0, 3.0), HERE, JAWS, 0.12),
    "hits a jaw": ((1.2, 0.585, 0.01), (1.0, 0.1, 0.2), STILL, HERE, JAWS, 0.12),
    "flies into a pocket with jaws": ((1.15, 0.515, 0.02), (1.0, 1.0, 0.3), STILL, HERE, JAWS, 0.5),
    "flies over a rail with jaws": ((1.1, 0.3, 0.05), (2.0, 0.5, 1.5), STILL, HERE, JAWS, 0.5),
}


def test_pit_moves_balls_of_two_sizes_apart_along_the_cloth():
    shot = play([-0.5, 0], [2.0, 0.1], others=[[0.0, 0.02], FAR[1]], scene=SIZES, engine=Engine("pit", 0.02))
    time = float(shot.events[shot.events["kind"] == "ball_ball"][0]["time"])
    places = shot.at(time)
    assert math.dist(places[0], places[1]) == pytest.approx(TOUCH, abs=1e-14)
    assert not shot.heights_at(time).any()


@pytest.mark.parametrize("name", FALLING)
def test_pit_approaches_pic_in_flights(name):
    *shot, s, end = FALLING[name]
    exact, errors = play(*shot, scene=s, max_time=end), []
    for steps in (60, 600, 6000):
        pit = play(*shot, scene=s, max_time=end, engine=Engine("pit", 1 / steps))
        assert (pit.status, pit.potted.tolist()) == (exact.status, exact.potted.tolist())
        errors.append(np.abs(pit.positions - exact.positions).max())
    assert errors[2] < min(0.01, 0.2 * errors[0] + 1e-9)


def test_a_ball_of_pit_above_a_corner_pocket_hits_no_nose_that_ends_before_it():
    s = scene(length=2.0, pockets=(Pocket(0.91, 20.0, 0.08),))
    shot = play([0.966, 19.94, 0.02], [0.088, 1.47, 0.583], scene=s, engine=Engine("pit", 1 / 600), max_events=9)
    assert (shot.status, kinds(shot)) == ("rest", ["off_table"])
