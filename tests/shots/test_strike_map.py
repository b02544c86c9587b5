import numpy as np
import pytest

from billiards_env import Scene, simulate, strike
from billiards_env.shots.strike_map import strike_map

SCENE, PLACES, HEADING = Scene.named("real_pool", 1), [[0.0, 0.0], [0.6, 0.33]], np.arctan2(0.33, 0.6)


@pytest.fixture(scope="module")
def chances():
    grid = {"side": np.linspace(-0.6, 0.6, 13), "top": np.linspace(-0.6, 0.6, 11)}
    return strike_map(SCENE, PLACES, grid, heading=HEADING + 0.015, speed=1.6)


def test_a_map_agrees_with_single_shots(chances):
    assert chances.pocket.shape == (11, 13)
    assert chances.names == ("side", "top")
    assert 0 < chances.success.sum() < chances.success.size / 2
    pockets = np.array([(pocket.x, pocket.y) for pocket in SCENE.table.pockets])
    for (row, column), pocket in np.ndenumerate(chances.pocket):
        side, top = chances.values[0][column], chances.values[1][row]
        made = strike(SCENE, 1.6, HEADING + 0.015, side, top)
        shot = simulate(SCENE, PLACES, made)
        expected = -3 if made.miscue else -2 if shot.potted.all() else -1
        if not made.miscue and shot.potted[1] and not shot.potted[0]:
            expected = np.hypot(*(pockets - shot.positions[1]).T).argmin()
        assert pocket == expected


def test_offsets_outside_the_ball_are_slips():
    grid = {"side": [0.0, 0.9], "top": [0.0, 0.9]}
    assert strike_map(SCENE, PLACES, grid, heading=0.0).pocket[1, 1] == -3


def test_a_potted_cue_ball_is_no_success():
    """A full hit with follow: the cue ball follows into the pocket."""
    places, heading = [[0.6, 0.0], [0.935, 0.3]], np.arctan2(0.335, 0.335)
    grid = {"heading": np.linspace(0.6, 0.9, 60), "top": [0.3, 0.4]}
    chances = strike_map(Scene.named("pool", 1), places, grid, speed=2.0)
    assert heading > 0
    assert (chances.pocket == -2).any()
    assert not chances.success[chances.pocket == -2].any()


@pytest.mark.parametrize(
    ("grid", "given", "message"),
    [
        ({"side": [0.0]}, {}, "grid = .*: expected the values of two parameters"),
        ({"side": [0.0], "angle": [0.0]}, {}, "parameter of a strike = 'angle'"),
        ({"side": [0.0], "top": [0.0]}, {"top": 0.1}, "top = 0.1: expected only one of the value and the grid"),
        ({"side": [0.0], "top": [[0.0]]}, {}, r"grid\['top'\] has shape \(1, 1\): expected a row of numbers"),
        ({"side": [0.0], "top": [0.0]}, {"ball": 2}, "ball = 2: expected 1"),
    ],
)
def test_bad_arguments_are_rejected(grid, given, message):
    with pytest.raises((ValueError, TypeError), match=message):
        strike_map(SCENE, PLACES, grid, **given)
    with pytest.raises(ValueError, match="expected a table with pockets"):
        strike_map(Scene.named("carom"), PLACES, {"side": [0.0], "top": [0.0]})


def test_a_map_is_drawn_with_a_colour_for_each_outcome(chances):
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot

    axes = chances.plot()
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert len(texts) == len(np.unique(chances.pocket))
    assert sum(float(text.split()[-1].rstrip("%")) for text in texts) == pytest.approx(100.0, abs=0.2)
    assert axes.xaxis_inverted()  # the left of the ball is on the left
    assert "left" in axes.get_xlabel()
    _, own = pyplot.subplots()
    assert chances.plot(own) is own
    pyplot.close("all")
