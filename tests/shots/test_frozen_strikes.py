"""Strikes of a cue ball that touches other balls."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env import Scene, derivatives, simulate, simulate_batch, strike
from billiards_env.engine import frozen_strike
from billiards_env.engine.frozen_strike import LEFT
from billiards_env.envs import make_env, make_vector_env, step
from billiards_env.games import Setup, Stroke, custom_opening, play
from billiards_env.players.batch import play_batch
from billiards_env.shots import simulation

POOL = Scene.named("pool", 2)
REAL = Scene.named("real_pool", 2)
R = POOL.balls.radius[0]
PAIR = np.array([[0.0, 0.0], [2 * R, 0.0], [0.5, 0.4]])
INSTANT = 1e-9  # s


def after(scene, positions, *parameters, **options):
    """Returns the recorded shot of a strike, up to the first instant."""
    return simulate(scene, positions, strike(scene, *parameters), max_time=INSTANT, record=True, **options)


def energy(scene, shot):
    """Returns the kinetic energy of the balls, J."""
    spin = 0.4 * np.square(R * shot.spins).sum()
    return 0.5 * scene.balls.mass[0] * (np.square(shot.velocities).sum() + spin)


@pytest.mark.parametrize("scene", [POOL, REAL])
def test_a_full_hit_drives_both_balls_at_the_measured_ratio(scene):
    shot = after(scene, PAIR, 1.0, 0.0)
    cue_ball, object_ball = shot.velocities[:2, 0]
    assert cue_ball / object_ball == pytest.approx(0.987, abs=5e-4)
    assert cue_ball / object_ball == pytest.approx((1 - 0.95 * LEFT) / (1 + 0.95 * LEFT), abs=1e-9)
    # A central impact of the cue on twice the mass of the ball, with the restitution of the tip
    mass, cue = scene.balls.mass[0], scene.cue
    impulse = (1 + cue.tip_restitution) / (1 / cue.mass + 1 / (2 * mass))
    assert mass * (cue_ball + object_ball) == pytest.approx(impulse, rel=1e-4)
    assert shot.events is not None
    assert (shot.first_hit, shot.events["kind"].tolist(), shot.events["time"].tolist()) == (1, ["ball_ball"], [0.0])


@pytest.mark.parametrize("angle", [0.3, 1.0, 1.5])
def test_without_friction_the_balls_share_the_normal_velocity(angle):
    free = strike(POOL, 2.0, angle, 0.2, 0.1).velocity
    v = after(POOL, PAIR, 2.0, angle, 0.2, 0.1).velocities
    assert v[0, 1] / free[1] > 1.0  # the cue pushes a larger mass, so its impulse is larger
    assert v[1, 1] == 0.0
    assert v[0, 0] / v[1, 0] == pytest.approx(0.987, abs=5e-4)
    assert v[:, 0].sum() / v[0, 1] == pytest.approx(free[0] / free[1], rel=1e-8)


def test_a_chain_moves_as_one():
    v = after(POOL, [[0.0, 0.0], [2 * R, 0.0], [4 * R, 0.0]], 1.0, 0.0).velocities[:, 0]
    assert v / v.mean() == pytest.approx(np.ones(3), abs=0.015)
    assert (np.diff(v) > 0.0).all()
    cue = POOL.cue
    impulse = (1 + cue.tip_restitution) / (1 / cue.mass + 1 / (3 * POOL.balls.mass[0]))
    assert POOL.balls.mass[0] * v.sum() == pytest.approx(impulse, rel=1e-4)


@pytest.mark.parametrize(("scene", "ratio"), [(POOL, 0.985), (REAL, 0.936)])  # friction turns the object balls
def test_two_balls_ahead_are_driven_alike(scene, ratio):
    half = math.radians(35)
    places = [[0.0, 0.0], *([2 * R * math.cos(a), 2 * R * math.sin(a)] for a in (half, -half))]
    v = after(scene, places, 1.0, 0.0).velocities
    assert v[1].tolist() == [v[2, 0], -v[2, 1]]
    assert v[0, 1] == 0.0
    assert v[0] @ places[1] / (v[1] @ places[1]) == pytest.approx(ratio, abs=5e-4)


@settings(max_examples=60)
@given(st.floats(-1.5, 1.5), st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(0.0, 1.5), st.booleans())
def test_a_strike_adds_no_energy_and_mirrors(angle, side, top, elevation, friction):
    scene = dataclasses.replace(REAL if friction else POOL, cue=dataclasses.replace(POOL.cue, tip_restitution=1.0))
    shot = after(scene, PAIR, 2.0, angle, side, top, elevation)
    assert energy(scene, shot) <= 0.5 * scene.cue.mass * 4.0
    if elevation == 0.0 and math.hypot(side, top) <= 0.5:  # the impulse of the tip is that on all balls
        impulse = scene.balls.mass[0] * math.hypot(*shot.velocities.sum(axis=0))
        assert energy(scene, shot) + 0.5 * scene.cue.mass * (2.0 - impulse / scene.cue.mass) ** 2 <= 2.0 * (
            scene.cue.mass * (1 + 1e-12)
        )
    mirrored = after(scene, PAIR * [1, -1], 2.0, -angle, -side, top, elevation)
    assert mirrored.velocities.tolist() == (shot.velocities * [1, -1]).tolist()
    assert mirrored.spins.tolist() == (shot.spins * [-1, 1, -1]).tolist()


@pytest.mark.parametrize("positions", [PAIR, PAIR * [[1, 1], [1 + 1e-8, 1], [1, 1]]])
@pytest.mark.parametrize("heading", [2.0, 0.4])
def test_a_ball_that_is_apart_or_behind_is_not_driven(positions, heading):
    driven = heading == 0.4 and positions is PAIR
    made = strike(POOL, 1.0, heading, 0.1)
    shot, free = (simulate(POOL, positions, made), simulate(POOL, positions, made.velocity, spins=made.spin))
    assert (shot.positions.tolist() == free.positions.tolist()) is not driven


@pytest.mark.parametrize("speed", [5e-324, 1e-300, 1e-60, 1e-9])
def test_a_ball_that_only_spins_is_not_driven(speed):
    setup = Setup("straight", POOL)
    played = play(setup, custom_opening(setup, PAIR), Stroke((speed, 0.0), spin=(0.0, 0.0, 600.0)))
    assert np.abs(played.shot_input.velocities).max() <= speed
    assert played.shot_input.spins[0, 2] == pytest.approx(600.0, rel=1e-12)


def test_a_batch_repeats_single_shots_and_its_records():
    headings = np.array([0.0, 0.5, 2.0, -1.0])
    places, made = np.repeat(PAIR[None], 4, axis=0), strike(REAL, 1.5, headings, 0.2, -0.1, 0.1)
    factors = {"mu_ball_factor": np.array([1.0, 2.0, 1.0, 0.5])}
    batch = simulate_batch(REAL, places, made, physics=factors, record=True)
    for k, heading in enumerate(headings):
        physics = dataclasses.replace(REAL.physics, mu_ball_factor=factors["mu_ball_factor"][k].item())
        scene = dataclasses.replace(REAL, physics=physics)
        single = simulate(scene, PAIR, strike(REAL, 1.5, heading, 0.2, -0.1, 0.1))
        assert single.positions.tolist() == batch.positions[k].tolist() == batch[k].positions.tolist()
        assert single.first_hit == batch.first_hit[k]


def test_the_derivative_by_the_strike_is_refused():
    shot = simulate(POOL, PAIR, strike(POOL, 1.0, 0.2), record=True)
    with pytest.raises(ValueError, match="expected the strike of the shot"):
        derivatives.jacobian(shot, by="strike", strike=[1.0, 0.2, 0.0, 0.0, 0.0])


def test_the_environments_play_the_strike():
    arguments = {"scene": "pool", "n_object_balls": 2, "action": "strike", "max_shots": 2}
    action = np.array([0.4, 0.1, 0.3, -0.2, 0.05], np.float32)
    env, envs = make_env(**arguments), make_vector_env(3, **arguments)
    env.reset(seed=1, options={"positions": PAIR})
    _, reward, *_, info = env.step(action)
    envs.reset(seed=1, options={"positions": [PAIR] * 3})
    _, rewards, *_ = envs.step(np.repeat(action[None], 3, axis=0))
    assert envs.positions.tolist() == [env.positions.tolist()] * 3
    assert rewards.tolist() == [reward] * 3
    assert info["first_hit"] == 1
    apart = make_env(**{**arguments, "action": "velocity"})
    apart.reset(seed=1, options={"positions": PAIR})
    apart.step(action[:2])
    env.reset(options={"positions": PAIR})
    env.step(action * [1, 1, 0, 0, 0])
    assert math.dist(env.positions[0], apart.positions[0]) > 0.1  # a velocity has no cue


def test_games_play_the_strike_with_either_cue_ball():
    setup = Setup("straight", POOL)
    game, made = custom_opening(setup, PAIR), strike(POOL, 1.0, 0.3, 0.1, 0.2)
    stroke = Stroke(tuple(made.velocity.tolist()), spin=tuple(made.spin.tolist()))
    played, batch = play(setup, game, stroke), play_batch(setup, game, made.velocity[None], made.spin[None])
    assert played.shot.positions.tolist() == simulate(POOL, PAIR, made).positions.tolist()
    assert batch.positions[0].tolist() == played.shot.positions.tolist()
    carom = Setup("carom", Scene.named("carom"))
    places = np.array([[0.5, 0.0], [0.0, 0.0], [2 * 0.03075, 0.0]])
    second = custom_opening(carom, places, {"cue_balls": [2, 0], "player": 1})
    v = play(carom, second, Stroke((-1.0, 0.0))).shot_input.velocities
    assert v[0].tolist() == [0.0, 0.0]
    assert 0.0 < v[1, 0] - v[2, 0] < 0.02 * abs(v[1, 0])  # the approach that is left


def test_a_shot_without_a_frozen_ball_does_not_drive(monkeypatch):
    def fail(*_, **__):
        raise AssertionError

    monkeypatch.setattr(frozen_strike, "_drive", fail)
    assert simulate(POOL, PAIR * [2, 1], strike(POOL, 1.0, 0.0)).status == "rest"
    for module in (step, simulation):
        monkeypatch.setattr(module, "strike_frozen", fail)
    assert simulate(POOL, PAIR, [1.0, 0.0]).first_hit == 1
    env = make_env(scene="pool", n_object_balls=2)
    env.reset(seed=1, options={"positions": PAIR})
    assert env.step(np.array([0.4, 0.1], np.float32))[-1]["first_hit"] == 1
