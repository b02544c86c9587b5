import math

import numpy as np
import pytest

pytest.importorskip("pygame")

import pygame

from billiards_env import Scene
from billiards_env.drawing.spheres import Painter, face, shadow
from billiards_env.drawing.style import DOTS, looks

UPRIGHT = [1.0, 0.0, 0.0, 0.0]


def paint(scene, ball, q, radius=40.0, fraction=(0.0, 0.0)):
    """Returns the image of a ball, (height, width, 4) int, and its middle."""
    painter = Painter(looks(scene), [radius] * scene.n_balls)
    (image,) = painter.paint(np.array([ball]), np.array([fraction]), np.array([q]))
    colours = np.dstack((pygame.surfarray.array3d(image), pygame.surfarray.array_alpha(image)))
    return colours.transpose(1, 0, 2).astype(int), image.get_width() // 2


def test_a_ball_is_round_and_at_its_fraction_of_a_pixel():
    scene = Scene.named("pool", 1)
    for fraction in ((0.0, 0.0), (0.7, 0.2)):
        image, middle = paint(scene, 0, UPRIGHT, 12.0, fraction)
        alpha = image[..., 3] / 255
        assert alpha.sum() == pytest.approx(math.pi * 12**2, rel=0.02)
        places = np.arange(len(alpha)) + 0.5 - middle
        assert (alpha.sum(0) @ places) / alpha.sum() == pytest.approx(fraction[0], abs=0.05)
        assert (alpha.sum(1) @ places) / alpha.sum() == pytest.approx(fraction[1], abs=0.05)


def test_the_number_turns_with_the_ball():
    """A ball that rolls by a quarter turn along x shows its number at its right edge."""
    scene = Scene.named("pool", 3)
    upright, m = paint(scene, 3, UPRIGHT)
    quarter, _ = paint(scene, 3, [math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0])
    white = [image[..., :3].min(-1) > 120 for image in (upright, quarter)]
    assert white[0][m - 10 : m + 10, m - 10 : m + 10].mean() > 0.5
    assert white[1][m - 10 : m + 10, m - 20 : m + 10].mean() < 0.05
    eighth, _ = paint(scene, 3, [math.cos(math.pi / 8), 0.0, math.sin(math.pi / 8), 0.0])
    columns = np.flatnonzero((eighth[..., :3].min(-1) > 120).any(0)) - m
    assert columns.max() > 30  # moves to the right
    spun, _ = paint(scene, 3, [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    dark = [image[m - 14 : m + 14, m - 14 : m + 14, :3].max(-1) < 90 for image in (upright, spun)]
    assert dark[0].sum() == pytest.approx(dark[1].sum(), rel=0.2)
    assert (dark[0] & dark[1]).sum() < 0.8 * dark[0].sum()  # the same digit, turned by a quarter


def test_both_sides_of_a_ball_have_its_number():
    scene = Scene.named("pool", 12)
    halves = face(looks(scene)[12], 128)
    assert halves.shape == (2, 128, 128, 3)
    assert (halves[0] == halves[1][:, ::-1]).mean() > 0.99  # seen from below


def test_cue_balls_have_dots_and_snooker_balls_have_spots():
    cue = face(looks(Scene.named("pool"))[0], 128)
    places = (np.arange(128) + 0.5) / 64 - 1
    disc = np.hypot(*np.meshgrid(places, places)) < 1
    red = (cue[:, disc, 0] - cue[:, disc, 1] > 100).mean()
    assert red == pytest.approx(len(DOTS) * (1 - math.cos(0.2)) / 2, rel=0.1)  # equal areas
    snooker = looks(Scene.named("snooker"))
    assert all(look.dots for look in snooker)
    assert snooker[1].dot < snooker[0].dot
    carom = looks(Scene.named("carom"))
    assert all(look.dots not in ("", look.fill) for look in carom)


def test_a_shadow_fades_away_from_the_light():
    alpha = pygame.surfarray.array_alpha(shadow(10.0, 0.0, 0.0)).T.astype(float)
    middle = len(alpha) / 2
    places = np.arange(len(alpha)) + 0.5 - middle
    assert (alpha.sum(0) @ places) / alpha.sum() > 1  # to the right
    assert (alpha.sum(1) @ places) / alpha.sum() > 1  # and down
    assert alpha[0].max() == alpha[:, 0].max() == 0


def test_a_ball_in_the_air_is_larger_and_its_shadow_wider_and_fainter():
    painter = Painter(looks(Scene.named("pool", 1)), [12.0, 12.0])
    images = painter.paint(np.array([0, 1]), np.zeros((2, 2)), np.tile(UPRIGHT, (2, 1)), [1.0, 1.5])
    areas = [pygame.surfarray.array_alpha(image).sum() / 255 for image in images]
    assert areas == pytest.approx([math.pi * 12**2, math.pi * 18**2], rel=0.03)
    near, far = (pygame.surfarray.array_alpha(shadow(10.0, 0.0, 0.0, wide)).astype(float) for wide in (1.0, 2.0))
    assert far.max() < 0.3 * near.max()
    assert (far > 0).sum() > 3 * (near > 0).sum()
