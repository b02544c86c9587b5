"""Contact times of balls in the air and noses: none is missed, and none is found where there is none."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env.engine.compile import scene_arrays
from billiards_env.physics.geometry.contact import IMPULSE_ROUNDING
from billiards_env.physics.geometry.noses import WALL, edge_time, nose_arrays, nose_time
from billiards_env.physics.geometry.noses import noses_of as noses_of_ball
from billiards_env.physics.geometry.outline_walls import outline_arrays
from billiards_env.physics.motion import Path
from billiards_env.scene import Scene, Table
from billiards_env.scene.outline import clearance
from tests.helpers.outlines import ANY_TABLE, TABLES, free_places

R, G = 0.03, 9.81
NUMBERS = scene_arrays(Scene.named("pool", 0)).numbers
INF, H = math.inf, NUMBERS.cushion_height


def noses_of(a_table, pockets=(), radii=(R,), ball=0):
    outline = outline_arrays(a_table.outline, a_table.length / 2, a_table.width / 2, ())
    kernel: Any = noses_of_ball
    return kernel.py_func(ball, SimpleNamespace(noses=nose_arrays(outline, radii, NUMBERS, pockets)))


def position(start, velocity, t):
    t = np.asarray(t)[..., None]
    return start + t * velocity - t * t * [0.0, 0.0, G / 2]


def gap(places, a_table, noses):
    """Returns the distance (...) of balls at `places` (..., 3), between the noses, from the nearest nose, m."""
    across = clearance(a_table.outline, places[..., :2]) - noses.inset
    return np.hypot(across, places[..., 2] - noses.height) - R


def times(start, velocity, noses, end):
    """Returns the time of the contact, the cushion, and the time at which the centre passes over a nose."""
    x, y, z, vx, vy, vz = map(float, (*start, *velocity))
    path = Path(x, y, vx, vy, 0.0, 0.0)
    off, noise = min(edge_time(path, end, noses)[0], end), IMPULSE_ROUNDING * math.hypot(vx, vy, vz)
    t, wall = nose_time(path, (z, vz), R, off, noise, noses, G)
    return t, wall, off


def check(start, velocity, a_table, noses, end):
    """Checks that a ball overlaps no nose until the time of contact, and touches a nose and approaches it then."""
    t, wall, off = times(start, velocity, noses, end)
    until = np.linspace(0.0, min(t, off), 1500)
    assert gap(position(start, velocity, until), a_table, noses).min() > -1e-12
    if t == INF:
        return t, wall
    assert 0.0 <= t <= off
    moments = t + np.array([-1e-7, 0.0, 1e-7])
    before, now, after = gap(position(start, velocity, moments), a_table, noses)
    assert abs(now) < 1e-12
    assert after < 1e-13 or before > after
    return t, wall


def thrown(a_table, noses, rng):
    """Returns the place and the velocity of a ball in the air, and the time until it lands."""
    while True:
        start = np.array([*free_places(a_table, 0.003, rng, 1)[0], rng.uniform(0.0, 0.1)])
        if gap(start, a_table, noses) > 0.0:
            break
    velocity = rng.normal(0, [1, 1, 0.7]) * 10.0 ** rng.uniform(-2, 0.7)
    return start, velocity, (velocity[2] + math.sqrt(velocity[2] ** 2 + 2 * G * start[2])) / G


@settings(max_examples=150)
@given(ANY_TABLE, st.integers(0, 2**32))
def test_a_ball_in_the_air_overlaps_no_nose_until_the_contact_that_is_found(a_table, seed):
    noses, rng = noses_of(a_table), np.random.default_rng(seed)
    start, velocity, end = thrown(a_table, noses, rng)
    for _ in range(5):  # after the reflection the contact at time 0 is not found again
        t, _ = check(start, velocity, a_table, noses, end)
        if t == INF:
            break
        start, velocity = position(start, velocity, t), velocity - [0.0, 0.0, G * t]
        e = 1e-7 * np.eye(3)
        n = (gap(start + e, a_table, noses) - gap(start - e, a_table, noses)) / 2e-7
        velocity = velocity - 1.9 * min(velocity @ n, 0.0) * n
        end = (velocity[2] + math.sqrt(velocity[2] ** 2 + 2 * G * max(start[2], 0.0))) / G


def beside_tip(noses, rng, angles, spread):
    """Returns a point of the nose of a random tip, a unit vector from it to the centre of a ball, and its cushion.

    `angles` are the limits of the inclination of the vector, `spread` is the deviation of its direction.
    """
    x, y, q, begin_x, begin_y, end_x, end_y, wall = noses.tips[rng.integers(len(noses.tips))]
    out = np.array([-begin_y - end_y, begin_x + end_x, 0.0]) + rng.normal(0, spread, 3) * [1, 1, 0]
    out /= np.linalg.norm(out)
    angle = rng.uniform(*angles)
    return [x, y, noses.height] + q * out, math.cos(angle) * out + [0.0, 0.0, math.sin(angle)], wall


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9, -1e-9, -1e-6, -1e-3])
def test_a_ball_that_grazes_a_tip_touches_it_and_one_that_passes_it_does_not(depth):
    a_table, rng, grazed = TABLES["pool_7ft"], np.random.default_rng(0), 0
    noses = noses_of(a_table)
    while grazed < 100:
        nose, n, wall = beside_tip(noses, rng, (-1.2, 1.2), 0.2)
        velocity = np.cross(n, rng.normal(size=3))
        velocity *= rng.uniform(0.3, 3.0) / np.linalg.norm(velocity)
        place = nose + (R - depth) * n
        back = rng.uniform(0.02, 0.1)
        start, velocity = place - back * velocity - [0, 0, G / 2 * back * back], velocity + np.array([0, 0, G * back])
        path = position(start, velocity, np.linspace(0.0, 2 * back, 4001))
        apart = gap(path, a_table, noses)
        if apart[0] < 1e-4 or abs(apart.argmin() - 2000) > 100:  # it overlaps at the start, or touches elsewhere
            continue
        grazed += 1
        t, number = check(start, velocity, a_table, noses, 2 * back)
        assert (t < INF) == (depth > 0)
        assert t == INF or number == wall


def test_a_ball_that_touches_a_tip_and_hardly_approaches_it_hits_it_at_once():
    a_table, rng = TABLES["pool_7ft"], np.random.default_rng(0)
    noses, hits = noses_of(a_table), 0
    for _ in range(300):
        nose, n, _ = beside_tip(noses, rng, (-1.2, 0.0), 0.0)
        velocity = np.cross(n, rng.normal(size=3))
        velocity *= -np.copysign(1.0, velocity[2])
        start = nose + (R + 10.0 ** rng.uniform(-17, -15)) * n
        velocity -= 10.0 ** rng.uniform(-15, -10) * n
        t, _, _ = times(start, velocity, noses, 0.05)
        if t < INF:
            hits += 1
            assert abs(gap(position(start, velocity, t), a_table, noses)) < 1e-14
    assert hits > 30


def test_noses_end_at_the_circles_of_pockets():
    for name, ends in (("pool_9ft", 12), ("uk_7ft", 12)):
        a_table = Table.named(name)
        noses = noses_of(a_table, a_table.pocket_rows.tolist())
        whole = noses_of(a_table)
        assert len(noses.ends) == ends
        assert len(noses.lines) == 18 if name == "pool_9ft" else 6
        assert len(noses.tips) == len(whole.tips) == 12
        for x, y, wall in noses.ends:
            assert min(abs(p.distance((x, y))) for p in a_table.pockets) < 1e-15
            assert wall in [*noses.lines[:, WALL], *noses.tips[:, WALL]]
            assert clearance(a_table.outline, (x, y)) == pytest.approx(noses.inset, abs=1e-15)


def test_each_ball_has_the_noses_of_its_radius():
    """The pocket reaches the noses of large balls, but not the noses of small balls, which are farther away."""
    a_table, radii = TABLES["octagon"], (0.03, 0.02, 0.036, 0.02)
    half, depths = a_table.width / 2, [radius - math.sqrt(radius**2 - (H - radius) ** 2) for radius in radii]
    pockets = [(0.0, half + 0.05, 0.054)]
    each = [noses_of(a_table, pockets, radii, ball) for ball in range(len(radii))]
    assert len({len(noses.lines) for noses in each}) == 2
    for radius, depth, noses in zip(radii, depths, each, strict=True):
        (alone,) = [noses_of(a_table, pockets, (radius,))]
        assert all(np.array_equal(*parts) for parts in zip(noses, alone, strict=True))
        assert (noses.inset, noses.height) == pytest.approx((depth, H - radius))
