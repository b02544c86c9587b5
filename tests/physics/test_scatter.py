"""The scatter of cushions. `tests/envs` plays environments with it: single, vector, copies and states."""

import dataclasses
from typing import Any, cast

import numpy as np
import pytest

from billiards_env import Engine, Scene, derivatives, simulate, simulate_batch
from billiards_env.envs import make_env
from billiards_env.physics.scatter import scatter_number
from billiards_env.shots.noise import SCATTER

SCENE = Scene.named("carom", 2)  # as in tests/helpers/environments.py, so that its engine is compiled only once
ENGINES = {"pic": Engine(), "pit": Engine("pit", dt=1 / 240)}
ZERO = dict.fromkeys(SCATTER, 0.0)
MODES = pytest.mark.parametrize("mode", ENGINES)


def play(m, mode="pic", scatter=None, mirrored=False, e_cushion=None, **options):
    """Plays m shots of one ball in all directions. The other balls are far away from their paths, and out of play."""
    scene, angles = SCENE, np.linspace(0.1, 6.0, m)
    if e_cushion is not None:
        scene = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, e_cushion=e_cushion))
    places = np.tile([[0.2, 0.1], [-0.5, 0.3], [-0.9, -0.2]], (m, 1, 1))
    moving = 2.0 * np.column_stack((np.cos(angles), np.sin(angles)))
    turning = np.tile([10.0, -20.0, 30.0], (m, 1))
    if mirrored:
        places, moving, turning = places * (1.0, -1.0), moving * (1.0, -1.0), turning * (-1.0, 1.0, -1.0)
    in_play = np.arange(scene.n_balls) < 1
    scatter = SCATTER if scatter is None else scatter
    options = {"seed": 3, "engine": ENGINES[mode], **options}
    return simulate_batch(scene, places, moving, spins=turning, in_play=in_play, scatter=scatter, **options)


def test_the_random_numbers_are_bounded_and_have_mean_0_and_variance_1():
    number = cast(Any, scatter_number)
    z = np.array([[number(np.uint64(key << 40 | 1), j) for j in range(5)] for key in range(4000)])
    assert np.abs(z).max() < 3.4642
    assert np.abs(z.mean(axis=0)).max() < 0.06
    assert np.abs(np.cov(z.T) - np.eye(5)).max() < 0.08
    assert len(np.unique(z, axis=0)) == len(z)


def test_each_contact_has_its_own_scatter_of_the_given_size():
    scene, sizes = SCENE, {"normal_std": 0.02, "along_std": 0.01, "spin_std": 0.0}
    near = scene.table.length / 2 - scene.balls.radius[0] - 0.01, 0.0
    start = np.tile([near, (-0.5, 0.3), (-0.9, -0.2)], (400, 1, 1)), np.tile([2.0, 1.0], (400, 1))
    plain, scattered = (simulate_batch(scene, *start, scatter=s, seed=1, max_time=0.02) for s in (ZERO, sizes))
    exact = simulate_batch(scene, *start, max_time=0.02)
    assert (exact.cushions[:, 0] == 1).all()
    assert np.allclose(plain.velocities, exact.velocities, atol=1e-15)
    after = exact.velocities[:, 0]
    share = (scattered.velocities[:, 0] - after) / np.column_stack((after[:, 0], np.hypot(*after.T)))
    assert np.allclose(share.std(axis=0), (0.02, 0.01), rtol=0.15)
    assert np.allclose(share.mean(axis=0), 0.0, atol=0.004)
    assert abs(np.corrcoef(share.T)[0, 1]) < 0.15


@MODES
def test_the_energy_does_not_rise_and_every_ball_leaves_the_cushion(mode):
    batch = play(60, mode, scatter=dict.fromkeys(SCATTER, 0.25), e_cushion=1.0)
    assert set(batch.status) == {"rest"}
    table, radius = SCENE.table, SCENE.balls.radius[0]
    half = np.array((table.length, table.width)) / 2 - radius + (0.02 if mode == "pit" else 1e-12)
    for shot in (batch[k] for k in range(0, 60, 6)):
        assert (np.abs(shot.at(np.linspace(0.0, shot.time, 200))[:, 0]) <= half).all()
        events: Any = shot.events
        velocities, spins = shot.motion_at(np.append(0.0, events["time"]))
        energies = np.square(velocities[:, 0]).sum(axis=1) + 0.4 * radius**2 * np.square(spins[:, 0]).sum(axis=1)
        assert (np.diff(energies) <= 1e-12).all()


@MODES
def test_a_shot_has_the_same_bits_alone_in_a_batch_cut_and_mirrored(mode):
    batch, cut, mirror = play(20, mode), play(20, mode, max_time=1.0), play(20, mode, mirrored=True)
    assert (play(20, mode, threads=2).positions == batch.positions).all()
    assert (mirror.positions == batch.positions * (1.0, -1.0)).all()
    assert (play(20, mode, seed=4).positions[:, 0] != batch.positions[:, 0]).all()
    shot = batch[7]
    assert (shot.positions == batch.positions[7]).all()
    assert (shot.at(1.0)[0] == cut.positions[7, 0]).all() or mode == "pit"
    seeds = np.arange(20)
    some = play(20, mode, seed=seeds.astype(np.uint32))
    assert (some[4].positions == some.positions[4]).all()


def test_shots_with_scatter_have_no_derivatives_and_no_files():
    batch = play(2, record=True)
    with pytest.raises(ValueError, match=r"scatter = \[.*\] with derivatives: expected None"):
        derivatives.jvp(batch, {"velocities": np.zeros((2, 2))})
    with pytest.raises(ValueError, match=r"scatter = \[.*\] with derivatives: expected None"):
        derivatives.jvp(batch[0], {"velocities": np.zeros((2, 2))})
    with pytest.raises(ValueError, match=r"scatter = \[.*\] with shot\.to_record: expected None"):
        batch[0].to_record()


@pytest.mark.parametrize(
    ("options", "message", "kind"),
    [
        ({"scatter": {"normal": 0.1}, "seed": 1}, "key of scatter = 'normal': expected one of", ValueError),
        ({"scatter": {"normal_std": 0.3}, "seed": 1}, "normal_std = 0.3: expected a number from 0 to 0.25", ValueError),
        ({"scatter": 0.1, "seed": 1}, "scatter = 0.1: expected a mapping from normal_std", TypeError),
        ({"scatter": {}}, "seed = None: expected a whole number, for the scatter", ValueError),
        ({"seed": 1}, "seed = 1: expected None without scatter", ValueError),
        ({"scatter": {}, "seed": -1}, "seed = -1: expected", ValueError),
        ({"scatter": {}, "seed": [1, 2]}, "seed = [1, 2]: expected a whole number", (ValueError, TypeError)),
    ],
)
def test_wrong_arguments_are_refused(options, message, kind):
    for run, start in ((simulate, [[0.2, 0.1]]), (simulate_batch, [[[0.2, 0.1]]])):
        with pytest.raises(kind) as error:
            run(Scene.named("carom", 0), start, np.ones(np.shape(start)), **options)
        assert str(error.value).startswith(message)


def test_tried_actions_have_the_scatter_only_with_a_generator():
    arguments = {"scene": "carom", "task": "carom"}
    env, plain = (make_env(**arguments, scatter=scatter) for scatter in ({}, None))
    for each in (env, plain):
        each.reset(seed=1)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2))
    exact = plain.try_actions(actions).states["positions"]
    noisy = env.try_actions(actions, noise=np.random.default_rng(1)).states["positions"]
    assert (env.try_actions(actions).states["positions"] == exact).all()
    assert (noisy != exact).any()
    state = env.get_state()
    first = env.step(actions[0])[0]
    env.set_state(state)
    assert (env.step(actions[0])[0] == first).all()
