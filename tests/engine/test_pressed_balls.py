"""Balls that their spin presses against a cushion or another ball move as with a contact that stays closed.

The final positions were integrated with a closed contact, independently of the engine. They do not depend on the
restitution.
"""

import math

import numpy as np
import pytest

from billiards_env.scene import Balls, Physics, Scene
from billiards_env.shots.simulation import simulate

R = Balls.uniform(1).radius[0]
ROOM = 0.635 - R  # m, from the centre of the table to a ball at a long cushion


@pytest.mark.parametrize("e", [0.0, 0.5, 0.85, 1.0])
@pytest.mark.parametrize(
    ("spin", "cushion", "end"),
    [
        ((-100.0, 0.0, -80.0), "han2005", -0.1583546093),
        ((-150.0, 0.0, 100.0), "han2005", 0.3084820493),
        ((-60.0, 30.0, 60.0), "han2005", 0.6454237320),
        ((-60.0, 30.0, 60.0), "restitution", 0.3582176894),
        ((-100.0, 0.0, 30.0), "restitution", 0.0),
    ],
)
def test_a_ball_pressed_against_a_cushion(spin, cushion, end, e):
    scene = Scene(Balls.uniform(1), physics=Physics(cushion=cushion, e_cushion=e))
    for side in (1.0, -1.0):
        shot = simulate(scene, [[0.0, side * ROOM]], [0.0, 0.0], spins=[side * spin[0], side * spin[1], spin[2]])
        assert shot.positions[0] == pytest.approx([side * end, side * ROOM], abs=1e-4)


@pytest.mark.parametrize("e", [0.0, 0.5, 0.95, 1.0])
@pytest.mark.parametrize(
    ("spins", "angle", "mass", "ends"),
    [
        (((0, 150, 0), (0, 0, 0)), 0.0, 0.17, ((0.9443434818, 0.0), (1.0014934818, 0.0))),
        (((0, 100, 50), (0, 0, 0)), 0.0, 0.17, ((-0.1358473420, 0.0), (-0.0786973420, 0.0))),
        (((-5, 60, 0), (0, 0, 0)), 0.0, 0.17, ((-0.6701475358, 0.0729656496), (-0.6433481565, -0.0140658770))),
        (
            ((-60, 60, 30), (0, 0, 0)),
            math.pi / 4,
            0.17,
            ((-0.5600452931, 0.1571119944), (-0.5196341406, 0.1975231469)),
        ),
        (((0, 100, 0), (0, -60, 0)), 0.0, 0.17, ((-0.8617355743, 0.0), (-0.8045855743, 0.0))),
        (((0, 120, 0), (0, 0, 0)), 0.0, 0.34, ((-0.4807942513, 0.0), (-0.4236442513, 0.0))),
        (((0, 100, 0), (0, 0, 0)), 0.0, 0.085, ((0.5718430967, 0.0), (0.6289930967, 0.0))),
        (((20, 60, 0), (0, 0, 0)), 0.0, math.inf, ((-0.7664492790, -0.3220069319), (-0.94285, 0.0))),
    ],
)
def test_a_ball_pressed_against_another(spins, angle, mass, ends, e):
    scene = Scene(Balls((R, R), (0.17, mass)), physics=Physics(e_ball=e))
    along = np.array([math.cos(angle), math.sin(angle)])
    cue = np.array([-1.0, -0.4 * along[1]])
    shot = simulate(scene, [cue, cue + 2 * R * along], [0.0, 0.0], spins=np.array(spins, float))
    assert np.abs(shot.positions - ends).max() < 1e-3
