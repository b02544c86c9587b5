import itertools

import pytest

from billiards_env.play.controls import height_of, place


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
