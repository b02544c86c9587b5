"""Margins: their sign agrees with the outcome, and their derivatives with differences."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env import Scene, derivatives, simulate, simulate_batch
from billiards_env.derivatives.shot_derivatives import MARGINS
from billiards_env.engine.compile import scene_fields
from billiards_env.physics.geometry.walls import TIP_RADIUS, faces
from tests.helpers.derivatives import SCENES, aimed, recorded, start_of, tangent_of

ALL = {**SCENES, "pool": Scene.named("pool", 2), "uk_pool": Scene.named("uk_pool", 2)}
KINDS = dict(zip(MARGINS, ("ball_ball", "pocket", "cushion"), strict=True))


def margins_of(shot, t=None) -> Any:
    return dict(zip(MARGINS, derivatives.margins(shot, t), strict=False))


@pytest.mark.parametrize("name", ["pool", "uk_pool", "ideal", "rolling"])
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_margin_is_positive_if_the_bodies_touch(name, seed):
    shot = recorded(ALL[name], start_of(ALL[name], seed), max_time=4.0)
    margins = margins_of(shot)
    for output, kind in KINDS.items():
        touched = np.zeros(margins[output].shape, bool)
        for event in shot.events[shot.events["kind"] == kind]:
            touched[event["ball"], event["other"]] = True
        if kind == "ball_ball":
            touched |= touched.T
            np.testing.assert_array_equal(margins[output], margins[output].T)
        np.testing.assert_array_equal(margins[output] > 0, touched)


@pytest.mark.parametrize("name", ["pool", "uk_pool", "ideal", "rolling", "sliding"])
@pytest.mark.parametrize("seed", [3, 5])
def test_the_derivatives_are_those_of_differences(name, seed):
    scene = ALL[name]
    start, rng, late = start_of(scene, seed), np.random.default_rng(seed), 2.0
    shot = recorded(scene, start, max_time=late)
    assert not derivatives.nonsmooth(shot).reason
    for key in ("positions", "velocities", "radius", "mu_roll"):
        tangent, step = tangent_of(key, scene, rng), 1e-7

        def margins(h, key=key, tangent=tangent):
            changed, of = [array.copy() for array in start], scene
            if key in ("positions", "velocities"):
                changed[("positions", "velocities").index(key)] += h * tangent
            elif key == "radius":
                radius = tuple(r + h * x for r, x in zip(scene.balls.radius, np.array(tangent), strict=True))
                of = dataclasses.replace(scene, balls=dataclasses.replace(scene.balls, radius=radius))
            else:
                physics = dataclasses.replace(scene.physics, mu_roll=scene.physics.mu_roll + h * tangent)
                of = dataclasses.replace(scene, physics=physics)
            return margins_of(recorded(of, changed, max_time=late))

        change, after, before = derivatives.jvp(shot, {key: tangent}, MARGINS), margins(step), margins(-step)
        for output in MARGINS:
            known = np.isfinite(after[output]) & np.isfinite(before[output])
            expected = (after[output][known] - before[output][known]) / (2.0 * step)
            np.testing.assert_allclose(change[output][known], expected, rtol=1e-4, atol=1e-5, err_msg=f"{key} {output}")


@pytest.mark.parametrize("body", ["ball", "pocket", "cushion"])
def test_a_margin_passes_smoothly_through_zero(body):
    """Two shots on both sides of the change of outcome have margins of both signs and the same slope."""
    scene = Scene.named("pool", 1)
    x, y = scene.table.pockets[0].x, scene.table.pockets[0].y
    positions, heading, speed, index = {
        "ball": ([[-0.5, 0.0], [0.3, 0.0]], 0.0, 2.0, (0, 1)),
        "pocket": ([[-0.3, 0.1], [0.5, 0.0]], np.arctan2(y - 0.1, x + 0.3), 2.0, (0, 0)),
        "cushion": ([[0.0, 0.0], [-0.5, 0.3]], 0.0, 0.4, (0, 1)),
    }[body]
    of = f"{body}_margins"
    along, across = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    way = along if body == "cushion" else across  # a slower ball stops before the cushion

    def margin(offset):
        velocity = speed * along + offset * way
        shot = simulate(scene, positions, velocity, record=True)
        return margins_of(shot)[of][index], derivatives.jacobian(shot, of)[index][0] @ way

    low, high = 0.0, 1.0
    hits = margin(low)[0] > 0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (margin(middle)[0] > 0) == hits else (low, middle)
    (inside, slope), (outside, other) = margin(low), margin(high)
    assert inside * outside <= 0
    assert max(abs(inside), abs(outside)) < 1e-9
    assert slope == pytest.approx(other, rel=1e-4)


def test_a_margin_turns_a_miss_into_a_pot():
    scene = Scene.named("uk_pool", 1)
    pocket = scene.table.pockets[3]
    ball = np.array([0.4, 0.2])
    line = np.array([pocket.x, pocket.y]) - ball
    line /= np.hypot(*line)
    ghost = ball - 2 * scene.balls.radius[0] * line
    cue = ghost - 0.6 * np.array([np.cos(0.3), np.sin(0.3)]) @ np.array([line, [-line[1], line[0]]])
    velocity = 3.0 * (ghost - cue) / np.hypot(*(ghost - cue))
    velocity = velocity + 0.06 * np.array([-velocity[1], velocity[0]]) / 3.0
    shot = simulate(scene, [cue, ball], velocity, record=True)
    margin = derivatives.margins(shot).pockets[1, 3]
    assert not shot.potted[1]
    assert margin < 0
    slope = derivatives.jacobian(shot, "pocket_margins")[1, 3, 0]
    aim = velocity + (0.01 - margin) * slope / (slope @ slope)  # one step to a margin of 1 cm
    assert simulate(scene, [cue, ball], aim).potted[1]


def test_the_vjp_of_margins_is_that_of_their_jacobian():
    scene, rng = Scene.named("pool", 2), np.random.default_rng(2)
    starts = [aimed(scene, seed) for seed in range(5)]
    batch = simulate_batch(scene, *map(np.array, zip(*starts, strict=True)), record=True)
    jacobian = derivatives.jacobian(batch, "pocket_margins", t=1.0)
    cotangent = rng.normal(size=(5, 3, 6))
    by = derivatives.vjp(batch, {"pocket_margins": cotangent, "positions": np.ones((5, 3, 2))}, t=1.0)
    at_positions = derivatives.vjp(batch, {"positions": np.ones((5, 3, 2))}, t=1.0)
    np.testing.assert_allclose(by - at_positions, np.einsum("mip,mipjk->mjk", cotangent, jacobian), atol=1e-9)


def test_balls_that_are_not_in_play_have_no_margin():
    shot = simulate(
        Scene.named("pool", 2), [[0, 0], [0.3, 0], [0.5, 0.2]], [1.0, 0.0], in_play=[True, True, False], record=True
    )
    assert (derivatives.margins(shot).pockets[2] == -np.inf).all()
    assert (derivatives.margins(shot).balls[2] == -np.inf).all()
    assert (derivatives.margins(shot).balls.diagonal() == -np.inf).all()


def test_the_margin_of_a_jaw_that_a_ball_passes_is_the_gap():
    scene, compared = Scene.named("uk_pool", 1), 0
    lines, tips, *_ = scene_fields(scene)[4]
    for seed in range(30):
        shot = recorded(scene, start_of(scene, seed), max_time=0.8)
        grid = np.linspace(0.0, 0.8, 1601)
        places = shot.at(grid)[:, 0]
        margins = derivatives.margins(shot)
        for k, tip in enumerate(tips, len(lines)):
            gaps = np.hypot(*(places - tip[:2]).T) - tip[TIP_RADIUS] - scene.balls.radius[0]
            nearest = int(gaps.argmin())
            if faces(tip, *places[nearest]) and 0 < nearest < 1600 and gaps[nearest] > 1e-3:
                assert margins.cushions[0, k] == pytest.approx(-gaps[nearest], abs=1e-3)  # the grid
                compared += 1
    assert compared > 3
