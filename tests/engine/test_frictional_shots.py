"""Shots with friction between balls and compliant cushions agree with the high-precision simulator."""

import mpmath
import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.physics.state import UX, UY, VX, VY, WZ
from billiards_env.scene import Balls, Physics
from billiards_env.shots.gradients import UNIT_ROUNDOFF
from billiards_env.shots.simulation import simulate
from reference.oracle import laws, run
from reference.oracle.laws import World
from tests.helpers import rubbing_clusters as clusters
from tests.helpers.outlines import MARBLES
from tests.helpers.shots import aimed_shot, kinds, real

FALLING = {"e_cushion": 0.93, "e_cushion_loss": 0.1, "e_cushion_onset": 0.5, "e_cushion_floor": 0.6}


@pytest.mark.parametrize(
    "scene",
    [
        real("pool", 2),
        real("pool", 5),
        real("carom", 2, mu_ball_factor=2.5),
        real("carom", 2, **FALLING),
        Scene.named("uk_pool", 4),
        MARBLES,
    ],
    ids=["pool", "pool of six", "carom with cling", "carom with falling restitution", "UK pool", "marbles"],
)
def test_random_shots_have_the_error_of_their_condition(scene):
    ratios = []
    for seed in range(15):
        places, start, spins = aimed_shot(scene, seed)
        shot = simulate(scene, places, start, spins=spins, record=True)
        condition = shot.sensitivity().condition
        if condition > 1e6:
            continue
        exact = run(scene, places, start, spins, digits=40)
        assert kinds(shot) == [(e.kind, e.ball, e.other) for e in exact.events]
        ratios.append(np.abs(shot.positions - np.array(exact.positions, float)).max() / (UNIT_ROUNDOFF * condition))
        assert shot.spins == pytest.approx(np.array(exact.spins, float), abs=1e-9)
    assert len(ratios) >= 8
    assert np.median(ratios) <= 1.0
    assert max(ratios) <= 20.0


@pytest.mark.parametrize("shape", ["disk", "sphere"])
def test_joint_impacts_agree_with_the_high_precision_simulator(shape):
    """The engine minimises the energy by gradients, the simulator contact by contact."""
    compared = 0
    for seed in range(80):
        mu = (None, 0.05, 0.5)[seed % 3]
        spheres = shape == "sphere"
        _, places, rows, pairs, arrays = clusters.drawn(seed, 3 + seed % 5, 0.9, mu, fixed=False, spheres=spheres)
        found, count = clusters.collided(places, rows, pairs, arrays)
        if not 2 <= count <= 5:
            continue
        for _ in range(20):
            if count == 0:
                break
            found, count = clusters.collided(places, found, pairs, arrays)
        physics = Physics(ball_ball="frictional", cushion="restitution", mu_ball=mu, e_ball=0.9)
        radius, mass = tuple(arrays.radius.tolist()), tuple((1 / arrays.inv_mass).tolist())
        scene = Scene(Balls(radius, mass, shape=shape), physics=physics)
        with mpmath.workdps(40):
            world = World.of(scene, 20)
            v = {k: tuple(map(mpmath.mpf, row[[VX, VY]])) for k, row in enumerate(rows)}
            w = {
                k: tuple(map(mpmath.mpf, ((row[UY] - row[VY]) / r, (row[VX] - row[UX]) / r, row[WZ])))
                for k, (row, r) in enumerate(zip(rows, arrays.radius, strict=True))
            }
            where = {k: tuple(map(mpmath.mpf, place)) for k, place in enumerate(places)}
            v, w, hits = laws.collide(world, where, v, w, pairs, mpmath.mpf(10) ** -14)
        if len(hits) > 20:
            continue
        compared += 1
        assert found[:, [VX, VY]] == pytest.approx(np.array([v[k] for k in sorted(v)], float), abs=1e-11)
        assert found[:, WZ] == pytest.approx(np.array([w[k][2] for k in sorted(w)], float), abs=1e-9)
        roll = np.array([[-w[k][1], w[k][0]] for k in sorted(w)], float) * arrays.radius[:, None]
        assert found[:, [UX, UY]] - found[:, [VX, VY]] == pytest.approx(roll, abs=1e-11)
    assert compared >= 15
