import math

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.drawing.recording import recording_of
from billiards_env.scene import Balls, Table

pytest.importorskip("pygame")

from billiards_env.drawing.canvas import Canvas, Motion, pixels
from billiards_env.drawing.raster import rgb
from billiards_env.drawing.style import CHALK, CLOTH, LIFT, LIGHT, PAPER, POCKET, POTTED, looks, rail_width


def near(frame, where, colour, tolerance=6, dx=0.0, dy=0.0):
    x, y = np.floor(where + np.array([dx, dy])).astype(int)
    return np.abs(frame[y, x].astype(int) - rgb(colour)).max() <= tolerance


def film(canvas, shot, fps=30, *args, **kwargs):
    """Returns the frames of a film."""
    return [pixels(frame) for frame in canvas.film(recording_of(shot), fps, *args, **kwargs)]


def still(scene, positions, **kwargs):
    shot = simulate(scene, positions, [0.0, 0.0], max_time=0.0, record=True)
    canvas = Canvas(scene, **kwargs)
    (frame,) = film(canvas, shot)
    return canvas, frame


def test_frames_are_the_same_every_time(shot, pit):
    canvas, other = Canvas(shot.scene, width=400), Canvas(shot.scene, width=400)
    arguments = shot, 20, "one", "two", recording_of(pit)
    frames = film(canvas, *arguments)
    assert np.array_equal(frames, film(canvas, *arguments))
    assert np.array_equal(frames, film(other, *arguments))
    assert np.array_equal(frames[-1:], film(canvas, *arguments, only_last=True))


@pytest.mark.parametrize("width", [640, 801, 1920])
def test_balls_are_drawn_at_their_positions_to_scale(width):
    scene = Scene.named("pool", 15)
    rng = np.random.default_rng(0)
    positions = np.column_stack((np.linspace(-1.1, 1.1, 16), rng.uniform(-0.5, 0.5, 16)))
    canvas, frame = still(scene, positions, width=width)
    assert frame.shape == (canvas.size[1], canvas.size[0], 3)
    assert canvas.size[0] % 2 == canvas.size[1] % 2 == 0
    radius = scene.balls.radius[0] * canvas.scale
    for place, look in zip(positions, looks(scene), strict=True):
        centre = canvas.pixels_of(place)
        # Next to the number; the band of a striped ball is coloured there too.
        assert near(frame, centre, look.fill, 40, dx=-0.72 * radius)
        assert near(frame, centre, CLOTH, dy=1.6 * radius)
        assert near(frame, centre, CLOTH, dy=-1.6 * radius)
    assert near(frame, canvas.pixels_of(positions[0]), "#ffffff")


def test_balls_are_drawn_with_their_radius():
    scene = Scene(Balls((0.05,), (0.2,)))
    canvas, frame = still(scene, [[0.3, -0.2]], width=960)
    x, y = np.floor(canvas.pixels_of([0.3, -0.2])).astype(int)
    window = frame[y - 30 : y + 31, x - 30 : x + 31, 0] > rgb(CLOTH)[0] + 16  # brighter than the cloth and the shadow
    assert window.sum() == pytest.approx(math.pi * (0.05 * canvas.scale) ** 2, rel=0.06)
    across = np.flatnonzero(window.any(0))
    assert across[-1] - across[0] + 1 == pytest.approx(2 * 0.05 * canvas.scale, abs=2)


def test_slow_balls_move_by_less_than_a_pixel():
    scene = Scene.named("pool", 0)
    (_, one), (_, two) = (still(scene, [[x, 0.0]]) for x in (0.1, 0.1 + 0.4 / Canvas(scene).scale))
    assert (one != two).any()


def test_potted_balls_move_from_the_table_to_the_bar(shot):
    canvas = Canvas(shot.scene)
    (last,) = film(canvas, shot, only_last=True)
    look = looks(shot.scene)
    bar = last[canvas.size[1] - 30 :].astype(int)
    for ball in range(1, 5):
        seen = (np.abs(bar - rgb(look[ball].fill)).max(-1) <= 6).sum() > 20  # the lit side
        assert seen == (ball in (2, 3))
    for ball in (1, 4):
        assert near(last, canvas.pixels_of(shot.positions[ball]), look[ball].fill, 30, dx=-6)
    for pocket in shot.scene.table.pockets:
        assert near(last, canvas.pixels_of((pocket.x, pocket.y)), POCKET)


def test_paths_grow_behind_the_balls(shot):
    canvas = Canvas(shot.scene)
    frames = film(canvas, shot)
    path = looks(shot.scene)[2].path
    where = canvas.pixels_of(shot.at(0.2)[2])
    assert not near(frames[3], where, path, 40)
    assert near(frames[-1], where, path, 40)


def arrow(canvas, place, velocity):
    """Returns the rows and the columns of the pixels of an arrow."""
    frame = canvas.table.copy()
    canvas.draw_arrow(frame, 0, np.array(place), np.array(velocity))
    return np.nonzero((pixels(frame) != pixels(canvas.table)).any(-1))


def test_the_arrow_points_along_the_velocity_of_the_cue_ball(shot):
    canvas = Canvas(Scene.named("pool", 0))
    rows, columns = arrow(canvas, [0.0, 0.0], [0.0, 2.0])
    middle = canvas.pixels_of([0.0, 0.0])
    assert np.abs(columns - middle[0]).max() < 12
    assert rows.max() < middle[1] - 8  # upwards
    assert middle[1] - rows.min() == pytest.approx(0.09 * 2 * canvas.scale + 12, abs=4)


def test_a_film_shows_the_velocity_of_the_cue_ball(elsewhere):
    scene, places = elsewhere.scene, elsewhere.at(0.0)
    canvas, struck = Canvas(scene), simulate(scene, places, [[0.0, 0.0], [0.0, 0.0], [2.0, 0.0]], record=True)
    for recording, ball in ((recording_of(elsewhere), 0), (recording_of(struck)._replace(cue=2), 2)):
        frame = pixels(next(canvas.film(recording, 30)))
        along = 2.2 * canvas.scale * scene.balls.radius[ball]  # most of the velocity is along x
        assert near(frame, canvas.pixels_of(places[ball]), CHALK, 60, dx=along, dy=-along * (ball == 0) / 10)


def test_the_arrow_of_a_fast_shot_ends_at_the_cushion():
    canvas = Canvas(Scene.named("pool", 0))
    _, columns = arrow(canvas, [0.9, 0.0], [9.0, 0.0])
    assert columns.max() == pytest.approx(canvas.pixels_of([1.27, 0.0])[0], abs=2)


@pytest.mark.parametrize("velocity", [(9.0, 4.0), (0.0, 9.0), (-9.0, 0.1), (0.0, -9.0)])
def test_arrows_stay_in_the_frame(velocity):
    scene = Scene.named("pool", 0)
    canvas = Canvas(scene)
    for place in ([1.2, 0.58], [-1.2, -0.58]):
        rows, columns = arrow(canvas, place, velocity)
        assert len(rows) > 20
        frame_half = np.array([1.27, 0.635]) + rail_width(scene.table)
        (left, bottom), (right, top) = canvas.pixels_of(-frame_half), canvas.pixels_of(frame_half)
        assert left - 2 <= columns.min() <= columns.max() <= right + 2
        assert top - 2 <= rows.min() <= rows.max() <= bottom + 2
        ends = canvas.pixels_of(place) + np.sign(velocity) * (1, -1)
        assert np.hypot(columns - ends[0], rows - ends[1]).max() > 20


@pytest.mark.parametrize("label", [POTTED, ""])  # the window has no label
@pytest.mark.parametrize(("name", "balls"), [("pool", 15), ("snooker", 21), ("carom", 2)])
def test_long_texts_do_not_overlap(name, balls, label):
    canvas, frames = Canvas(Scene.named(name, balls)), []
    for texts in (("", ""), (200 * "l", ""), ("", 200 * "l")):
        frame = canvas.table.copy()
        canvas.draw_bar(frame, *texts, [], label)
        frames.append(pixels(frame))
    left, right = ((frame != frames[0]).any(-1).any(0) for frame in frames[1:])  # by column
    assert left.sum() > 100
    assert right.sum() > 100
    labelled = (np.abs(frames[0][-17:].astype(int) - rgb(PAPER)).max(-1) > 20).any(0)
    assert not (left & right | left & labelled | right & labelled).any()


def test_the_other_run_is_drawn_as_rings(shot, pit):
    canvas = Canvas(shot.scene)
    (alone,) = film(canvas, shot, only_last=True)
    (both,) = film(canvas, shot, compare=recording_of(pit), only_last=True)
    radius = shot.scene.balls.radius[2] * canvas.scale
    centre = canvas.pixels_of(pit.positions[2])  # this ball is not potted in this run
    path = looks(shot.scene)[2].path
    assert any(near(both, centre, path, 60, dx=radius - back) for back in (0, 0.5, 1, 1.5))
    assert near(both, centre, CLOTH, dx=radius / 2)
    assert near(alone, centre, CLOTH, dx=radius - 1)


def test_texts_are_drawn_in_the_bar(shot):
    canvas = Canvas(shot.scene)
    plain, left, right = (film(canvas, shot, 10, *text) for text in ((), ("a task",), ("", "a reward")))
    assert all((a != b).any() for a, b in zip(plain, left, strict=True))
    shown = [(a != b).any() for a, b in zip(plain, right, strict=True)]
    assert shown == [t >= shot.time - 1.0 for t in [*(np.arange(len(plain) - 1) / 10), shot.time]]


def test_tables_of_unusual_shape_fit():
    for length, width in ((1.0, 1.0), (0.5, 2.0), (5.0, 0.2)):
        scene = Scene(Balls((0.03,), (0.2,)), Table(length, width))
        canvas, frame = still(scene, [[0.0, 0.0]])
        assert near(frame, canvas.pixels_of([0.0, 0.0]), "#ffffff")
        for corner in ((length / 2, width / 2), (-length / 2, -width / 2)):
            x, y = canvas.pixels_of(corner)
            assert 0 < x < canvas.size[0]
            assert 0 < y < canvas.size[1]


def test_the_shadow_of_a_ball_in_the_air_is_beside_it(jump):
    canvas, time = Canvas(jump.scene, 1000), 0.1
    frame = canvas.table.copy()
    Motion(canvas, recording_of(jump), None, 1 / 60).draw(frame, time)
    ground, height = canvas.pixels_of(jump.at(time)[0]), jump.heights_at(time)[0]
    away = canvas.scale * height * np.array([-LIGHT[0], LIGHT[1]]) / LIGHT[2]
    shown, empty = pixels(frame).astype(int), pixels(canvas.table).astype(int)
    x, y = np.round(ground + away).astype(int)
    assert (shown[y, x] < empty[y, x]).all()
    assert np.hypot(*away) > 2 * canvas.scale * jump.scene.balls.radius[0]
    edge = 1.1 * canvas.scale * jump.scene.balls.radius[0]  # beyond the ball if it were on the cloth
    assert near(pixels(frame), ground, "#ffffff", 90, dx=-edge)
    assert not Motion(canvas, recording_of(jump), None, 1 / 60).potted(jump.time).size
    still = simulate(jump.scene, jump.at(0.0), [0.0, 0.0], record=True)
    Motion(canvas, recording_of(still), recording_of(jump), 1 / 60).draw(frame, time)
    ring = canvas.scale * jump.scene.balls.radius[0] * (1.0 + LIFT * height)
    assert near(pixels(frame), ground, looks(jump.scene)[0].path, 90, dy=1.0 - ring)


def test_the_path_of_a_ball_in_the_air_is_dashed(jump):
    canvas, frame, step = Canvas(jump.scene, 1000), Canvas(jump.scene, 1000).table.copy(), 1 / 60
    Motion(canvas, recording_of(jump), None, step).draw(frame, jump.time)
    middles = (np.arange(8, 13) + 0.5) * step
    seen = [near(pixels(frame), canvas.pixels_of(jump.at(t)[0]), looks(jump.scene)[0].path, 90) for t in middles]
    assert seen == [True, False, True, False, True]
