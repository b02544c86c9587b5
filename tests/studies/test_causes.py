"""What a timestep gets wrong first, on scenes made for it."""

import math

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.scene import Balls, Physics, layouts
from billiards_env.scene.table import Pocket, Table
from studies.causes import CAUSES, cause, contacts, history
from studies.failures import FAILURES


def ideal(*pockets, balls=1, mass=0.2, max_time=1.0):
    """Frictionless disks of 3 cm on a table of 2 x 1 m; the last one of `mass` kg."""
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=max_time)
    masses = (0.2,) * (balls - 1) + (mass if balls > 1 else 0.2,)
    return Scene(Balls((0.03,) * balls, masses), Table(2.0, 1.0, pockets=pockets), physics)


def found(scene, positions, velocities, dt, ball=0, fix=None):
    """The cause for a shot of which `ball` has another fate with the timestep."""
    exact = simulate(scene, positions, velocities, record=True)
    stepped = simulate(scene, positions, velocities, mode="pit", dt=dt, fix=fix, record=True)
    return cause(exact, stepped, dt, ball)


@pytest.mark.parametrize("name", FAILURES)
@pytest.mark.parametrize("fix", ["push_apart", "none"])
@pytest.mark.parametrize("ball", [0, 1])
def test_each_of_the_four_failures_is_its_own_cause(name, fix, ball):
    case = FAILURES[name]
    if name == "wrong_bounce" and ball == 1:
        return  # nothing moves it
    assert found(case.scene, case.positions, case.velocities, case.dt, ball, fix) == name


def test_with_the_right_line_of_centres_a_late_hit_is_a_small_error():
    case = FAILURES["penetration"]
    assert found(case.scene, case.positions, case.velocities, case.dt, fix="move_back") == "small_errors"


@pytest.mark.parametrize("name", FAILURES)
def test_a_fine_timestep_has_small_errors_only(name):
    case = FAILURES[name]
    assert found(case.scene, case.positions, case.velocities, 2e-5) == "small_errors"


def test_a_missed_collision_is_told_from_a_ball_that_goes_by():
    # A bounce 0.9 ms late, 1.8 mm deep, shifts the path by 0.8 mm, away from a ball that it grazes by 0.1 mm in truth.
    along, across = np.array([-2.0, 1.0]) / math.sqrt(5), np.array([1.0, 2.0]) / math.sqrt(5)
    bounce = np.array([0.97, 0.035])
    start = bounce - 0.2351 * np.array([2.0, 1.0]), bounce + 0.5 * along - (0.06 - 1e-4) * across
    exact, stepped = (
        simulate(ideal(balls=2), start, [2.0, 1.0], record=True, **world) for world in ({}, {"mode": "pit", "dt": 1e-3})
    )
    assert (exact.first_hit, stepped.first_hit) == (1, -1)
    assert cause(exact, stepped, 1e-3, 0) == "small_errors"


def test_a_ball_caught_behind_a_cushion_is_a_cause():
    # In truth the ball's centre comes to 0.97 m, and the pocket begins at 0.99 m.
    scene = ideal(Pocket(1.03, 0.0, 0.04))
    shot = scene, [[0.05, 0.0]], [4.0, 0.0]
    assert not simulate(*shot).potted[0]
    assert simulate(*shot, mode="pit", dt=0.04).potted[0]  # at 1.01 m
    assert found(*shot, 0.04) == "cushion"


def test_a_late_bounce_is_a_cause_before_what_follows_from_it():
    shot = ideal(balls=2), [[0.5, -0.2], [0.5, 0.25]], [4.0, 2.0]
    assert simulate(*shot).first_hit == 1
    assert simulate(*shot, mode="pit", dt=0.04).first_hit == -1
    assert found(*shot, 0.04) == "cushion"


def test_a_pocket_that_is_passed_over_is_a_cause():
    # The pocket is 8 cm across, a step 16 cm long.
    shot = ideal(Pocket(0.4, 0.0, 0.04), max_time=0.15), [[0.0, 0.0]], [4.0, 0.0]
    assert simulate(*shot).potted[0]
    assert not simulate(*shot, mode="pit", dt=0.04).potted[0]
    assert found(*shot, 0.04) == "pocket"


def test_a_history_goes_back_to_what_hit_the_ball_and_no_further():
    scene = Scene.named("ideal", 3)
    shot = simulate(scene, [[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0], [0.0, 0.4]], [2.0, 0.0], record=True, max_time=0.6)
    told = [c[:3] for c in contacts(shot)]
    assert told == [("ball_ball", 0, 1), ("ball_ball", 1, 2)]
    assert [c[:3] for c in history(contacts(shot), 2)] == told
    assert [c[:3] for c in history(contacts(shot), 0)] == told[:1]
    assert history(contacts(shot), 3) == []


def test_shots_have_to_be_recorded():
    shot = simulate(Scene.named("pool"), [[-0.5, 0.0], [0.5, 0.0]], [1.0, 0.0])
    with pytest.raises(ValueError, match="the shot was not recorded"):
        contacts(shot)


def test_every_cause_occurs_in_play():
    scene, rng, seen = Scene.named("blocked_pool", 4), np.random.default_rng(0), set()
    for _ in range(400):
        start = layouts.draw(str(rng.choice(["random", "rack"])), scene, rng)
        angle, dt = rng.uniform(-np.pi, np.pi), 1 / float(rng.choice([15, 60, 240]))
        velocity = rng.uniform(1, 8) * np.array([np.cos(angle), np.sin(angle)])
        seen.update(found(scene, start, velocity, dt, ball) for ball in (0, 1, 3, 4))
    assert seen == set(CAUSES)
