"""Strikes: the cue ball's velocity and spin, their derivatives, and the paths that follow from them."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env import Scene, derivatives, simulate, simulate_batch, strike
from billiards_env.physics.strike import CueNumbers, cue_numbers, speed_gain, squirt
from billiards_env.scene import Balls, Cue, Physics

POOL = Scene.named("pool")
R = POOL.balls.radius[0]
SHOTS = json.loads((Path(__file__).parents[1] / "data" / "pooltool_real_shots.json").read_text())["shots"]
SCENES = {"carom": "benchmarks:pooltool_real_carom", "pool": "benchmarks:pooltool_pool"}


@pytest.mark.parametrize("table", SCENES)
def test_strikes_of_pooltool(table):
    shots = [shot for shot in SHOTS if shot["table"] == table]
    scene = Scene.named(SCENES[table])
    keys = ("V0", "phi_deg", "a", "b", "elevation_deg")
    speed, heading, side, top, elevation = np.array([[shot["strike"][key] for key in keys] for shot in shots]).T
    struck = strike(scene, speed, np.radians(heading), side, top, np.radians(elevation))
    assert len(shots) == 60
    np.testing.assert_allclose(struck.velocity, [shot["velocity"] for shot in shots], rtol=0, atol=1e-12)
    np.testing.assert_allclose(struck.spin, [shot["spin"] for shot in shots], rtol=0, atol=1e-12)
    assert not struck.miscue.any()


# Alciatore (2008), TP A.30, for a ball of 0.3 times the mass of the cue: speed of the ball over that of the cue at the
# offsets 0, 0.1, ... 0.5, by the efficiency of a central impact.
GAINS = [
    (1.0, [1.5385, 1.5094, 1.4286, 1.3115, 1.1765, 1.0390]),
    (0.95, [1.4500, 1.4209, 1.3397, 1.2220, 1.0862, 0.9476]),
    (0.888, [1.3211, 1.2912, 1.2078, 1.0861, 0.9438, 0.7950]),
    (0.87, [1.2775, 1.2472, 1.1623, 1.0376, 0.8901, 0.7310]),
]


@pytest.mark.parametrize(("efficiency", "gains"), GAINS)
def test_speed_of_the_ball_by_offset(efficiency, gains):
    restitution = math.sqrt((1.3 * efficiency - 1) / 0.3)
    cue = CueNumbers(mass_ratio=0.3, end_ratio=20.2, restitution=restitution, miscue=0.6, radius=R)
    assert [speed_gain(cue, 0.1 * i) for i in range(6)] == pytest.approx(gains, abs=5.1e-5)


# Alciatore (2007), TP A.31: degrees at the offsets 0.1 to 0.5, by the mass of the ball over that of the end.
SQUIRTS = [
    (12, [0.92, 1.82, 2.68, 3.47, 4.16]),
    (20.2, [0.602, 1.189, 1.746, 2.253, 2.686]),
    (40, [0.328, 0.647, 0.947, 1.218, 1.446]),
]


@pytest.mark.parametrize(("end_ratio", "angles"), SQUIRTS)
def test_squirt_by_offset(end_ratio, angles):
    cue = CueNumbers(0.3, end_ratio, 0.73, 0.6, R)
    degrees = [math.degrees(math.atan2(*squirt(cue, 0.1 * i))) for i in range(1, 6)]
    assert degrees == pytest.approx(angles, abs=6e-3)
    assert squirt(cue, -0.3) == (-squirt(cue, 0.3)[0], squirt(cue, 0.3)[1])


def test_the_default_cue_is_that_of_its_sources():
    cue = cue_numbers(POOL)
    assert cue.end_ratio == pytest.approx(20.2, rel=3e-3)
    assert (1 + cue.mass_ratio * cue.restitution**2) / (1 + cue.mass_ratio) == pytest.approx(0.888, abs=2e-3)


@pytest.mark.parametrize("top", [0.4, -0.4])
def test_a_hit_at_two_fifths_of_the_radius_rolls_at_once(top):
    velocity, spin, _ = strike(POOL, 2.0, 0.0, top=top)
    # (5/2)(offset/R): Alciatore (2006), TP A.12
    assert spin[1] * R == pytest.approx(math.copysign(velocity[0], top), rel=1e-14)
    assert spin[0] == spin[2] == 0.0


@given(st.floats(0.1, 9.0), st.floats(-3.1, 3.1), st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(0.0, 1.57))
def test_mirrored_strikes_have_mirrored_results(speed, heading, side, top, elevation):
    v, w, miscue = strike(POOL, speed, heading, side, top, elevation)
    mirrored = strike("pool", speed, -heading, -side, top, elevation)
    assert mirrored.velocity.tolist() == [v[0], -v[1]]
    assert mirrored.spin.tolist() == [-w[0], w[1], -w[2]]
    assert mirrored.miscue == miscue


@given(st.floats(0.0, 1.0), st.floats(-3.1, 3.1), st.floats(0.0, 1.57))
def test_a_strike_does_not_add_energy(offset, angle, elevation):
    v, w, miscue = strike(POOL, 2.0, 0.3, offset * math.cos(angle), offset * math.sin(angle), elevation)
    mass = POOL.balls.mass[0]
    energy = 0.5 * mass * (v @ v + 0.4 * R * R * (w @ w))
    assert energy <= 0.5 * POOL.cue.mass * 4.0
    assert miscue == (math.hypot(offset * math.cos(angle), offset * math.sin(angle)) > 0.5)


def test_a_miscue_is_continuous_deflects_the_ball_and_gives_less_spin():
    edge = 0.5 * np.array([0.6, 0.8])
    just_below, just_above = (strike(POOL, 2.0, 0.3, k * edge[0], k * edge[1], 0.4) for k in (1 - 1e-12, 1 + 1e-12))
    assert not just_below.miscue
    assert just_above.miscue
    np.testing.assert_allclose(just_below.velocity, just_above.velocity, atol=1e-10)
    np.testing.assert_allclose(just_below.spin, just_above.spin, atol=1e-8)
    edge, beyond = strike(POOL, 2.0, 0.0, side=0.5), strike(POOL, 2.0, 0.0, side=0.7)
    assert beyond.miscue
    assert beyond.velocity[1] < edge.velocity[1] < 0  # to the right
    # The impulse is on the edge of the cone of friction: its angle to the radius is asin(0.5) (Alciatore 2006, TP 2.1).
    turned = math.asin(0.7) - math.asin(0.5)
    squirted = math.atan2(*edge.velocity[::-1])
    assert math.atan2(*beyond.velocity[::-1]) - squirted == pytest.approx(-turned, abs=1e-12)
    assert abs(beyond.spin[2]) == pytest.approx(abs(edge.spin[2]) * math.cos(turned), rel=1e-12)


@pytest.mark.parametrize("cue_of", ["pool", "uk_pool", "benchmarks:pooltool_pool"])
@pytest.mark.parametrize("seed", range(3))
def test_derivative_of_the_strike(cue_of, seed):
    rng, of = np.random.default_rng(seed), Scene.named(cue_of)
    balls = Balls(of.balls.radius[:1], of.balls.mass[:1])
    scene = dataclasses.replace(POOL, balls=balls, cue=of.cue)
    at = rng.uniform((0.5, -3, -0.35, -0.35, 0.0), (4, 3, 0.35, 0.35, 1.4))
    step = 1e-6
    expected = [
        (np.concatenate(strike(scene, *(at + h))[:2]) - np.concatenate(strike(scene, *(at - h))[:2])) / (2 * step)
        for h in step * np.eye(5)
    ]
    begun = simulate(scene, [[0.0, 0.0]], strike(scene, *at), record=True)
    jacobians = [derivatives.jacobian(begun, name, "strike", t=0.0, strike=at)[0] for name in ("velocities", "spins")]
    np.testing.assert_allclose(np.concatenate(jacobians), np.transpose(expected), atol=1e-6)


# Coriolis (1835), in the form of Alciatore (2005), TP A.19: the ball leaves the slide in the direction of the line from
# its resting point to the point at which the axis of the cue meets the cloth.
@pytest.mark.parametrize("elevation", [20.0, 45.0, 70.0])
@pytest.mark.parametrize("side", [0.2, -0.3])
@pytest.mark.parametrize("top", [0.0, -0.2])
def test_masse_ends_in_the_direction_of_coriolis(elevation, side, top):
    physics = Physics()
    scene = Scene(Balls.uniform(1), dataclasses.replace(POOL.table, length=20.0, width=20.0, pockets=()), physics)
    scene = dataclasses.replace(scene, cue=Cue(end_mass=1e-8))  # the construction has no squirt
    theta = math.radians(elevation)
    shot = simulate(scene, [[0.0, 0.0]], strike(scene, 2.0, 0.0, side, top, theta), record=True)
    assert shot.events is not None
    rolling = shot.events[shot.events["kind"] == "sliding_rolling"]["time"][0]
    x, y = (shot.at(rolling + 0.1) - shot.at(rolling))[0]
    # The axis passes the centre at the offset (side, top) R and meets the cloth, R below the centre.
    d = np.array([math.cos(theta), 0.0, -math.sin(theta)])
    point = R * (side * np.array([0.0, 1.0, 0.0]) + top * np.array([math.sin(theta), 0.0, math.cos(theta)]))
    aim = point + d * (point[2] + R) / math.sin(theta)
    assert math.atan2(y, x) == pytest.approx(math.atan2(aim[1], aim[0]), abs=1e-6)


def test_simulate_takes_strikes():
    positions = [[-0.5, 0.1], [0.2, 0.15]]
    hit = strike(POOL, 1.5, 0.07, 0.2, -0.1, 0.1)
    expected = simulate(POOL, positions, hit.velocity, spins=hit.spin)
    assert simulate(POOL, positions, hit).positions.tolist() == expected.positions.tolist()
    hits = strike(POOL, [1.5, 0.7], 0.07, 0.2, -0.1, 0.1)
    batch = simulate_batch(POOL, [positions] * 2, hits)
    assert batch.positions[0].tolist() == expected.positions.tolist()
