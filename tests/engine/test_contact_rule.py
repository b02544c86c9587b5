"""The contact-time rule acts on balls that friction presses together, and on no other sequence of impacts."""

import math

import numpy as np
import pytest

from benchmarks.reference.stress.scenes import R, ideal, rough
from billiards_env.engine.contact_rule import longest_run
from billiards_env.jit import kernel
from billiards_env.scene import Balls, Physics, Scene, Table
from tests.helpers.shots import simulate

INF = math.inf


@kernel
def recurrence(ratio, e):
    """Returns the final velocity, m/s, of a heavy ball that drives a light ball against a wall.

    The heavy ball arrives at -1 m/s. The light ball, of 1/ratio the mass, is at rest at first. It then hits the heavy
    ball and the wall in turn until it cannot catch up.
    """
    heavy, light = -1.0, 0.0
    while max(abs(heavy), abs(light)) > 1e-12:
        if heavy < light:
            impulse = (1 + e) * (light - heavy) / (1 + 1 / ratio)
            heavy, light = heavy + impulse / ratio, light - impulse
        elif light < 0:
            light = -e * light
        else:
            break
    return heavy


@pytest.mark.parametrize("ratio", [1.0, 3.0, 100.0, 700.0, 2000.0, 1e4, 1e6])
@pytest.mark.parametrize("e", [0.5, 0.9, 0.95, 0.99, 0.9999, 1.0])
@pytest.mark.parametrize("gap", [0.3, 1e-6, 0.0])
def test_a_heavy_ball_against_a_light_one_at_a_cushion_follows_the_recurrence(ratio, e, gap):
    """Impacts were once elastic after 100 in quick succession, and the balls stopped after 2,000."""
    want = recurrence(ratio, e)
    places = [[R - 400.0 + 2 * R + gap + (0.1 if gap else 0.0), 0.0], [R - 400.0 + gap, 0.0]]
    scene = ideal(ratio, 1.0, e_ball=e, e_cushion=e, max_time=100.0 if gap else 1e-3, length=800.0)
    shot = simulate(scene, places, [-1.0, 0.0])
    if want < 1e-9:  # the balls come to rest at the cushion after infinitely many impacts
        assert np.abs(shot.velocities).max() < 1e-9
    else:
        assert shot.velocities[0, 0] == pytest.approx(want, rel=1e-9)
        assert shot.n_contact_rule == 0


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6])
def test_the_longest_run_exceeds_the_largest_number_of_impacts_of_three_bodies(ratio):
    assert longest_run((1.0, ratio, INF)) > math.pi * math.sqrt(ratio) + 1


def test_an_elastic_ball_between_a_fixed_ball_and_a_cushion_comes_to_rest():
    shot = simulate(ideal(1.0, INF, length=2.0), [[1.0 - R, 0.0], [1.0 - 3 * R, 0.0]], [1.0, 0.0])
    assert (shot.status, shot.n_contact_rule) == ("rest", 1)
    assert shot.n_events < 1.1 * longest_run((1.0, INF))


@pytest.mark.parametrize("ratio", [1.0, 30.0, 1e3, 1e5])
@pytest.mark.parametrize("e", [0.0, 0.5, 0.95, 1.0])
def test_a_spinning_ball_against_a_light_one_at_a_cushion_comes_to_rest(ratio, e):
    """The number of impacts before the heavy ball moves away is about the ratio of the masses."""
    radius = 0.03
    scene = Scene(Balls((radius, radius), (ratio, 1.0)), Table(2.0, 1.0), Physics(e_ball=e))
    places = [[1.0 - 3 * radius, 0.0], [1.0 - radius, 0.0]]
    shot = simulate(scene, places, [0.0, 0.0], spins=[0.0, 100.0, 0.0])
    assert shot.status == "rest"
    assert shot.n_events < 400_000
    assert np.abs(shot.positions - places).max() < 1e-3


@pytest.mark.parametrize("e", [0.5, 0.85, 1.0])
def test_only_impacts_that_the_rule_changes_are_counted(e):
    """The rule changes an impact only if restitution alone would separate the bodies more slowly."""
    scene = rough(1.0, e_cushion=e, length=2.0)
    free = simulate(scene, [[0.0, 0.0]], [1.0, 0.2], record=True)
    assert free.n_contact_rule == 0
    pressed = simulate(scene, [[1.0 - R, 0.0]], [0.0, 0.0], spins=[0.0, 50.0, 0.0], record=True)
    hits = pressed.events[pressed.events["kind"] == "cushion"]
    assert pressed.n_contact_rule == hits["rule"].sum() > 0


def test_a_plastic_full_hit_is_not_repeated():
    # The rounding of the velocities after it is no approach. The rounding of the gap may cause a second contact.
    scene = ideal(0.2, 0.3, e_ball=0.0)
    for angle in np.random.default_rng(0).uniform(0.0, 2 * math.pi, 20):
        along = np.array([math.cos(angle), math.sin(angle)])
        shot = simulate(scene, np.stack((-0.3 * along, 0.0 * along)), 2 * along, max_time=1.0)
        assert shot.n_events <= 2


def test_inelastic_balls_in_contact_come_to_rest():
    # Impacts weaker than the rounding of the velocities must not repeat without end.
    scene = Scene(Balls.uniform(3), physics=Physics(motion="rolling", cushion="restitution", e_ball=0.0))
    places = [
        [0.7546465550499861, 0.18634748698850304],
        [0.2722874709803904, -0.29334855696128165],
        [-0.9428818522660272, -0.5643652584341258],
    ]
    velocities = [
        [1.0536954305407527, 1.174844680144182],
        [-2.4301633276908885, 1.8900956367117439],
        [-1.747814538299288, -2.473654305026787],
    ]
    shot = simulate(scene, places, velocities, max_events=2000)
    assert shot.status == "rest"


# Balls that their spin presses against a cushion or another ball move as with a contact that stays closed. The final
# positions were integrated with a closed contact, independently of the engine. They do not depend on the restitution.

POOL_R = Balls.uniform(1).radius[0]
ROOM = 0.635 - POOL_R  # m, from the centre of the table to a ball at a long cushion


PRESSED_BY_SPIN = [
    ((-100.0, 0.0, -80.0), "han2005", -0.1583546093),
    ((-150.0, 0.0, 100.0), "han2005", 0.3084820493),
    ((-60.0, 30.0, 60.0), "han2005", 0.6454237320),
    ((-60.0, 30.0, 60.0), "restitution", 0.3582176894),
    ((-100.0, 0.0, 30.0), "restitution", 0.0),
]


@pytest.mark.parametrize("e", [0.0, 0.5, 0.85, 1.0])
@pytest.mark.parametrize(("spin", "cushion", "end"), PRESSED_BY_SPIN)
def test_a_ball_pressed_against_a_cushion(spin, cushion, end, e):
    scene = Scene(Balls.uniform(1), physics=Physics(cushion=cushion, e_cushion=e))
    for side in (1.0, -1.0):
        shot = simulate(scene, [[0.0, side * ROOM]], [0.0, 0.0], spins=[side * spin[0], side * spin[1], spin[2]])
        assert shot.positions[0] == pytest.approx([side * end, side * ROOM], abs=1e-4)


PRESSED_TOGETHER = [
    (((0, 150, 0), (0, 0, 0)), 0.0, 0.17, ((0.9443434818, 0.0), (1.0014934818, 0.0))),
    (((0, 100, 50), (0, 0, 0)), 0.0, 0.17, ((-0.1358473420, 0.0), (-0.0786973420, 0.0))),
    (((-5, 60, 0), (0, 0, 0)), 0.0, 0.17, ((-0.6701475358, 0.0729656496), (-0.6433481565, -0.0140658770))),
    (((-60, 60, 30), (0, 0, 0)), math.pi / 4, 0.17, ((-0.5600452931, 0.1571119944), (-0.5196341406, 0.1975231469))),
    (((0, 100, 0), (0, -60, 0)), 0.0, 0.17, ((-0.8617355743, 0.0), (-0.8045855743, 0.0))),
    (((0, 120, 0), (0, 0, 0)), 0.0, 0.34, ((-0.4807942513, 0.0), (-0.4236442513, 0.0))),
    (((0, 100, 0), (0, 0, 0)), 0.0, 0.085, ((0.5718430967, 0.0), (0.6289930967, 0.0))),
    (((20, 60, 0), (0, 0, 0)), 0.0, math.inf, ((-0.7664492790, -0.3220069319), (-0.94285, 0.0))),
]


@pytest.mark.parametrize("e", [0.0, 0.5, 0.95, 1.0])
@pytest.mark.parametrize(("spins", "angle", "mass", "ends"), PRESSED_TOGETHER)
def test_a_ball_pressed_against_another(spins, angle, mass, ends, e):
    scene = Scene(Balls((POOL_R, POOL_R), (0.17, mass)), physics=Physics(e_ball=e))
    along = np.array([math.cos(angle), math.sin(angle)])
    cue = np.array([-1.0, -0.4 * along[1]])
    shot = simulate(scene, [cue, cue + 2 * POOL_R * along], [0.0, 0.0], spins=np.array(spins, float))
    assert np.abs(shot.positions - ends).max() < 1e-3
