import itertools
import math

import pytest

from billiards_env.play.controls import height_of, on_face, place


@pytest.mark.parametrize(("width", "height"), [(1280, 900), (320, 240), (401, 777), (900, 300)])
def test_controls_do_not_overlap(width, height):
    row = height_of((width, height))
    controls = place(5, 400, width - 10, row)
    for box in controls:
        assert box.x >= 5
        assert box.x + box.width <= width - 5
        assert box.y >= 400
        assert box.y + box.height <= 400 + row
    for one, two in itertools.combinations(controls, 2):
        assert one.x + one.width <= two.x


def test_pixels_belong_to_controls():
    controls = place(0, 100, 1000, 100)
    for name, box in controls._asdict().items():
        assert controls.at((box.x + 1, box.y + box.height - 1)) == name
        assert controls.at((box.x + 1, 90)) is None
    ball = controls.ball
    assert controls.tip((ball.x + ball.width / 2, ball.y + ball.height / 2)) == (0.0, 0.0)
    assert controls.tip((ball.x, ball.y)) == (1.0, 1.0)  # left and up
    assert controls.speed.share((controls.speed.x + 0.25 * controls.speed.width, 0)) == (0.25, 1.0)
    assert controls.speed.share((-9, 999)) == (0.0, 0.0)


def test_the_tip_stays_where_it_does_not_slip():
    assert on_face(0.1, -0.2, 0.5) == (0.1, -0.2)
    side, top = on_face(3.0, -4.0, 0.5)
    assert math.hypot(side, top) == pytest.approx(0.5)
    assert side / top == pytest.approx(-0.75)
