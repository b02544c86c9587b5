"""Shots with spheres of different size."""

import math

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.engine import Engine
from billiards_env.envs.action_frames import ActionFrame
from billiards_env.envs.actions import Before
from billiards_env.players.pots import Tables, pot_shots
from billiards_env.scene import check_positions
from tests.helpers.shots import kinds, simulate

UK = Scene.named("uk_pool", 4)
APART = 2 * math.sqrt(UK.balls.radius[0] * UK.balls.radius[1])
"""m. The distance of the cue ball and an object ball that touch."""


@pytest.mark.parametrize("fix", ["push_apart", "move_back"])
def test_pit_moves_balls_to_the_distance_of_spheres(fix):
    places = np.array([[-0.5, 0.01], [0.0, 0.0], [0.5, 0.3], [0.5, -0.3], [0.7, 0.0]])
    shot = simulate(UK, places, [1.0, 0.0], engine=Engine("pit", 0.02, fix), record=True, max_time=1.0)
    hit = shot.events[shot.events["kind"] == "ball_ball"][0]
    where = shot.at(float(hit["time"]))
    tolerance = 1e-14 if fix == "push_apart" else 1e-5  # the paths are curved, and balls are moved back on tangents
    assert math.dist(where[0], where[1]) == pytest.approx(APART, abs=tolerance)


def test_no_fix_of_pit_acts_on_spheres_that_do_not_overlap():
    gap = 0.5 * (APART + UK.balls.radius[0] + UK.balls.radius[1])
    places = np.array([[0.0, 0.0], [gap, 0.0], [0.5, 0.3], [0.5, -0.3], [0.7, 0.0]])
    shot = simulate(UK, places, [0.0, 0.5], engine=Engine("pit", 1e-3), max_time=0.1, record=True)
    assert "ball_ball" not in shot.events["kind"]


def test_spheres_may_be_nearer_than_the_sum_of_their_radii():
    places = np.array([[0.0, 0.0], [APART, 0.0], [0.5, 0.3], [0.5, -0.3], [0.7, 0.0]])
    assert np.array_equal(check_positions(UK, places), places)
    simulate(UK, places, [1.0, 0.0])
    places[1, 0] = APART - 1e-9
    for function in (lambda: check_positions(UK, places), lambda: simulate(UK, places, [1.0, 0.0])):
        with pytest.raises(ValueError, match=r"balls 0 and 1 are .* m apart: expected at least .* at which they touch"):
            function()


def test_a_cut_is_the_sine_of_the_cut_angle():
    scene = Scene.named("uk_pool", 2)
    frame, playable = ActionFrame("cut", scene, 4.0), np.array([[False, True, False]])
    places = np.array([[-0.3, 0.1], [0.1, -0.05], [0.5, 0.3]])
    for cut in (-0.9, 0.3, 0.999):
        (velocity,) = frame.velocities([[cut, 0.0]], Before(places[None], playable, playable, 4.0))
        shot = simulate(scene, places, velocity, record=True)
        assert ("ball_ball", 0, 1) in kinds(shot)[:2]
        hit = shot.events[shot.events["kind"] == "ball_ball"][0]
        where = shot.at(float(hit["time"]))
        way, line = velocity / np.linalg.norm(velocity), where[1] - where[0]
        assert (line[1] * way[0] - line[0] * way[1]) / APART == pytest.approx(cut, abs=1e-9)


@pytest.mark.slow  # compiles the search for this scene
def test_the_geometric_player_pots_with_a_smaller_cue_ball():
    scene = Scene.named("uk_pool", 2)
    places = np.array([[0.0, 0.0], [0.6, 0.2], [-0.6, 0.2]])
    pots = pot_shots(Tables(scene, np.array([False, True, False]), places, np.zeros(3, bool), 5.0))
    assert len(pots.direction) > 0
    for direction, speed in zip(pots.direction, pots.speed, strict=True):
        shot = simulate(scene, places, speed * direction)
        assert shot.potted[1]
