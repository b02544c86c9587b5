import math

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.drawing.orientation import ERROR, VISIBLE, matrices, product
from billiards_env.drawing.recording import recording_of
from tests.helpers.shots import simulate


def distance(one, other):
    """Returns the angles between orientations, rad; a quaternion and its negative are the same orientation."""
    one, other = np.asarray(one), np.asarray(other)
    nearest = np.minimum(np.linalg.norm(one - other, axis=-1), np.linalg.norm(one + other, axis=-1))
    return 4.0 * np.arcsin(nearest / 2.0)


def reference(spin, change, lasts, steps=8000):
    """Returns the rotations of dq/dt = w q / 2 by Runge and Kutta's method of fourth order."""

    def slope(t, q):
        w = np.column_stack((np.zeros(len(spin)), spin + t * change))
        return 0.5 * product(w, q)

    q, h = np.tile([1.0, 0.0, 0.0, 0.0], (len(spin), 1)), lasts / steps
    for k in range(steps):
        t = k * h
        a = slope(t, q)
        b = slope(t + h / 2, q + h / 2 * a)
        c = slope(t + h / 2, q + h / 2 * b)
        q = q + h / 6 * (a + 2 * b + 2 * c + slope(t + h, q + h * c))
    return q / np.linalg.norm(q, axis=1)[:, None]


def test_a_ball_that_rolls_straight_turns_by_its_path_over_its_radius():
    scene = Scene.named("pool", 0)
    radius = scene.balls.radius[0]
    direction = np.array([0.6, 0.8])
    spin = np.array([-0.8, 0.6, 0.0]) / radius
    shot = simulate(scene, [[-0.8, -0.5]], 0.4 * direction, spins=0.4 * spin, record=True)
    turns = recording_of(shot).turning()
    assert (turns.lasts > 1e-9).sum() == 1  # one step for the roll
    for t in np.linspace(0.0, shot.time, 30):
        angle = np.hypot(*(shot.at(t)[0] - shot.at(0.0)[0])) / radius
        expected = np.append(math.cos(angle / 2), math.sin(angle / 2) * np.array([-0.8, 0.6, 0.0]))
        assert distance(turns.at(t)[0], expected) < 1e-12


def test_a_spin_about_the_vertical_axis_turns_by_its_integral():
    scene = Scene.named("pool", 0)
    shot = simulate(scene, [[0.0, 0.0]], [0.0, 0.0], spins=[0.0, 0.0, 50.0], record=True)
    recording = recording_of(shot)
    turns = recording.turning()
    for t in np.linspace(0.0, shot.time, 20):
        angle = 50.0 * t - 5.0 * t * t
        assert distance(turns.at(t)[0], [math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)]) < 1e-11
    spins = recording.spins(0, [0.0, 1.0, 6.0])
    assert spins == pytest.approx(np.array([[0, 0, 50], [0, 0, 40], [0, 0, 0]]), abs=1e-9)


def test_the_angular_velocity_agrees_with_the_slip():
    """While a ball slides, its lowest point moves at v + R z x w; at the end of the slide it rests."""
    scene = Scene.named("pool", 0)
    shot = simulate(scene, [[-0.8, 0.0]], [2.0, 0.0], spins=[30.0, -40.0, 20.0], record=True)
    (end,) = shot.events["time"][shot.events["kind"] == "sliding_rolling"][:1]
    recording, radius = recording_of(shot), scene.balls.radius[0]
    assert recording.spins(0, [0.0])[0] == pytest.approx([30.0, -40.0, 20.0])
    paths = recording.trajectory
    velocity = paths.velocity[0] + end * paths.acceleration[0]
    wx, wy, wz = recording.spins(0, [end])[0]
    assert (wx, wy) == pytest.approx((-velocity[1] / radius, velocity[0] / radius))
    assert wz == pytest.approx(20.0 - 10.0 * end)


def test_the_error_of_an_orientation_is_below_the_limit():
    """English, draw and a masse: the axis of the ball turns."""
    scene = Scene.named("pool", 0)
    turns, ends = [], []
    for *velocity, spins in ((0.9, 0, (0, -60, 80)), (1.2, 0.3, (-120, -30, 60)), (0.5, 0, (3, 17, -15))):
        shot = simulate(scene, [[-0.5, 0.0]], velocity, spins=spins, record=True)
        recording = recording_of(shot)
        turns.append(recording.turning())
        ends.append(min(recording.trajectory.duration[0], abs(spins[2]) / 10))
        rough = recording.turning(error=VISIBLE)
        assert len(rough.start) < len(turns[-1].start) / 3
        times = np.linspace(0.0, shot.time, 50)
        assert distance(rough.faces(0, times), turns[-1].faces(0, times)).max() < 5 * VISIBLE
    spin, change = (np.array([getattr(one, name)[0] for one in turns]) for name in ("spin", "change"))
    exact = reference(spin, change, np.array(ends)[:, None])
    reached = np.vstack([one.faces(0, [np.nextafter(end, 0.0)]) for one, end in zip(turns, ends, strict=True)])
    assert distance(reached, exact).max() < ERROR


def test_steps_do_not_change_the_orientations_of_a_break():
    scene = Scene.named("pool", 15)
    rng = np.random.default_rng(1)
    places = np.column_stack((np.linspace(-1.1, 1.1, 16), rng.uniform(-0.5, 0.5, 16)))
    shot = simulate(scene, places, rng.normal(size=(16, 2)) * 2, spins=rng.normal(size=(16, 3)) * 30, record=True)
    recording = recording_of(shot)
    fine, finest = recording.turning(), recording.turning(error=1e-11)
    assert len(finest.start) > 1.5 * len(fine.start)
    pieces = np.bincount(recording.trajectory.ball).max()
    for t in np.linspace(0.0, shot.time, 25):
        assert distance(fine.at(t), finest.at(t)).max() < pieces * ERROR
        assert np.linalg.norm(fine.at(t), axis=1) == pytest.approx(1.0, abs=1e-12)


def test_orientations_continue_from_given_ones():
    scene = Scene.named("pool", 1)
    shot = simulate(scene, [[-0.5, 0.0], [0.5, 0.3]], [0.5, 0.1], record=True)
    start = np.array([[0.5, 0.5, 0.5, 0.5], [0.0, 0.0, 1.0, 0.0]])
    one, two = (recording_of(shot).turning(faces).at(0.7) for faces in (start, None))
    assert distance(one, product(two, start)).max() < 1e-9
    assert one[1].tolist() == start[1].tolist()


def test_matrices_of_quaternions():
    turned = matrices(np.array([[math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0]]))[0] @ [0.0, 0.0, 1.0]
    assert turned == pytest.approx([1.0, 0.0, 0.0])  # the top of a ball that rolls along x moves along x
