import numpy as np
import pytest

from billiards_env import Scene, strike
from billiards_env.drawing.recording import recording_of
from billiards_env.scene import layouts
from tests.helpers.shots import simulate

pytest.importorskip("matplotlib")

from matplotlib import colors, pyplot
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Circle

from billiards_env.drawing.style import looks


@pytest.fixture(autouse=True)
def closed():
    yield
    pyplot.close("all")


def circles(axes, colour, filled):
    """Returns (x, y, radius) of the circles of a colour."""
    patches = [patch for patch in axes.patches if isinstance(patch, Circle)]
    rgb = colors.to_rgb(colour)
    shown = [p for p in patches if colors.to_rgb(p.get_facecolor() if filled else p.get_edgecolor()) == rgb]
    return np.array([(*p.center, p.radius) for p in shown if p.get_fill() == filled]).reshape(-1, 3)


def paths(axes, style):
    return [line for line in axes.lines if line.get_linestyle() == style and len(line.get_xdata()) > 2]


def test_a_plot_uses_a_new_figure_or_given_axes(shot):
    axes = shot.plot()
    assert isinstance(axes, Axes)
    _, own = pyplot.subplots()
    assert shot.plot(own) is own
    assert shot.plot(ax=own).figure is own.figure
    with pytest.raises(TypeError, match=r"^ax = 'shot[.]png': expected Axes; "):
        shot.plot("shot.png")


@pytest.mark.parametrize(("side", "entries"), [(0.0, []), (0.4, ["side spin"])])
def test_the_legend_has_side_spin_only_if_a_path_shows_it(side, entries):
    scene = Scene.named("pool", n_object_balls=1)  # a cushion adds a little side spin
    hit = strike(scene, 2.0, 0.22, side=side)
    axes = simulate(scene, [[-0.635, 0.0], [0.635, 0.3]], hit, record=True).plot()
    (legend,) = axes.figure.legends
    assert [text.get_text() for text in legend.get_texts()][:-6] == entries


def test_text_outside_the_table_is_readable_on_white_and_on_dark(shot):
    axes = shot.plot()
    (scale,) = axes.child_axes
    (legend,) = axes.figure.legends
    texts = [text for text in axes.texts if text.get_text() == "potted"]
    texts += [*legend.get_texts(), scale.title, *scale.get_xticklabels()]
    assert len(texts) > 9

    def contrast(first, second):
        low, high = sorted(luminance(colour) + 0.05 for colour in (first, second))
        return high / low

    def luminance(colour):  # of WCAG 2
        linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in colors.to_rgb(colour)]
        return np.dot([0.2126, 0.7152, 0.0722], linear)

    for page in ("#ffffff", "#1e2129", "#111111"):
        assert min(contrast(text.get_color(), page) for text in texts) > 3.9


def test_balls_are_drawn_at_their_initial_and_final_positions(shot):
    axes = shot.plot()
    radius = shot.scene.balls.radius[0]
    for ball, look in enumerate(looks(shot.scene)):
        centres = circles(axes, look.fill, True).tolist()
        ends = [] if shot.potted[ball] else [[*shot.positions[ball], radius]]
        if shot.potted[ball]:  # in the tray under the table
            (tray,) = [place for place in centres if place[1] < -0.5 * 1.27 - 0.1016]
            centres.remove(tray)
        starts = [[*shot.at(0)[ball], radius]] if ball in (0, 2, 3) else []
        assert sorted(centres) == sorted(starts + ends)


def test_paths_agree_with_the_shot(shot):
    drawn = {line.get_color(): np.column_stack(line.get_data()) for line in paths(shot.plot(), "-")}
    look = looks(shot.scene)
    assert set(drawn) == {look[i].path for i in (0, 2, 3)}
    assert drawn[look[0].path][-1] == pytest.approx(shot.positions[0], abs=1e-9)
    corners = [(e["x"], e["y"]) for e in shot.events if e["ball"] == 0 and e["kind"] == "cushion"]
    assert corners
    for corner in corners:
        assert np.abs(drawn[look[0].path] - corner).max(1).min() < 1e-12


def test_moving_balls_have_a_ring_at_a_contact(shot):
    hits = shot.events[shot.events["kind"] == "ball_ball"]
    rings = circles(shot.plot(), looks(shot.scene)[0].path, False)
    assert len(hits) == 2
    assert rings[0, :2] == pytest.approx(shot.at(hits["time"][0])[0], abs=1e-12)


def test_events_are_labelled_with_their_times(shot):
    texts = {text.get_text() for text in shot.plot().texts}
    assert {"0.04 s", "0.28 s", "0.57 s", "0.85 s"} <= texts
    assert {"1", "2", "3", "4"} <= texts  # the balls' numbers


def test_a_break_does_not_hide_its_rack_with_marks():
    scene, rng = Scene.named("pool", 15), np.random.default_rng(0)
    axes = simulate(scene, layouts.draw("rack", scene, rng), [7.5, 0.1], record=True).plot()
    marks = np.array([line.get_xydata()[0] for line in axes.lines if line.get_marker() == "*"])
    gaps = np.hypot(*(marks[:, None] - marks).T) + np.eye(len(marks))
    assert len(marks) > 0
    assert gaps.min() >= 2 * scene.balls.radius[0]


def test_the_colours_of_snooker_have_their_names_where_they_cover_nothing():
    scene = Scene.named("snooker", 21)
    positions = layouts.draw("snooker", scene, np.random.default_rng(0))
    for velocity, names in (
        ([0.1, 0.3], {"yellow", "green", "brown", "blue", "pink", "black"}),
        ([4.0, 0.33], {"pink"}),
    ):
        axes = simulate(scene, positions, velocity, record=True).plot()
        axes.figure.canvas.draw()
        texts = {text.get_text(): text for text in axes.texts}
        assert names <= texts.keys()
        assert not {"1", "16", "red"} & texts.keys()
        boxes = {name: axes.transData.inverted().transform_bbox(texts[name].get_window_extent()) for name in names}
        points = np.vstack(
            [
                *(line.get_xydata() for line in paths(axes, "-")),
                *(p.center for p in axes.patches if isinstance(p, Circle)),
            ]
        )
        assert not any(box.count_contains(points) for box in boxes.values())


def test_another_run_has_dashed_paths_and_rings(shot, pit):
    axes = shot.plot(compare=pit)
    assert len(paths(axes, "--")) == 3
    rings = circles(axes, looks(shot.scene)[2].path, False)
    assert np.abs(rings[:, :2] - pit.positions[2]).max(1).min() < 1e-12


def test_weak_contacts_have_no_mark():
    scene = Scene.named("pool", 1)
    gap = 2 * scene.balls.radius[0] + 1e-4
    for speed, marks in ((0.5, 1), (0.01, 0)):
        axes = simulate(scene, [[0.0, 0.0], [gap, 0.0]], [speed, 0.0], record=True).plot()
        assert len([line for line in axes.lines if line.get_marker() == "*"]) == marks


def test_carom_tables_and_striped_balls_can_be_drawn(elsewhere):
    assert len(elsewhere.plot().lines) > 0
    stripes = simulate(Scene.named("pool", 9), [[0.1 * k, 0.0] for k in range(10)], [0.0, 1.0], record=True)
    assert [text.get_text() for text in stripes.plot().texts if text.get_text() == "9"] == ["9"]


def test_the_times_of_hits_in_the_jaws_are_on_the_nearest_rail():
    scene = Scene.named("benchmarks:pooltool_pool")
    shot = simulate(scene, [[0.85, 0.42], [-0.5, 0.0]], [1.0, 0.75], record=True)
    hits = shot.events[shot.events["kind"] == "cushion"]
    assert hits["other"].max() > 3
    labels = [text for text in shot.plot().texts if text.get_text() == f"{hits['time'][0]:.2f} s"]
    (x, y), sides = labels[0].get_position(), abs(np.array([hits["x"][0], hits["y"][0]])) - [0.9906, 0.4953]
    assert (x == 0.0) == (sides[0] < sides[1])
    assert (abs(x), abs(y)) in ((20, 0), (0, 20))


def test_the_colour_of_a_path_is_the_speed(shot):
    steps = [c for c in shot.plot().collections if isinstance(c, LineCollection) and c.get_array() is not None]
    assert len(steps) == 3  # a collection for each moving ball
    recording = recording_of(shot)
    fastest = max(recording.speeds(i, recording.corners(i)).max() for i in range(5))
    assert all(c.get_clim() == (0.0, fastest) for c in steps)
    assert fastest == pytest.approx(2.8, rel=1e-3)
    assert max(np.asarray(c.get_array(), float).max() for c in steps) == fastest


def test_ticks_show_the_side_spin():
    def ticks(wz):
        shot = simulate(Scene.named("pool", 0), [[-0.6, 0.1]], [1.0, 0.0], spins=[0.0, 0.0, wz], record=True)
        drawn = [c for c in shot.plot().collections if isinstance(c, LineCollection) and c.get_array() is None]
        return np.array([segment for c in drawn for segment in c.get_segments()])[:6]  # before the cushion

    assert len(ticks(0.0)) == 0
    left, right = ticks(60.0), ticks(-60.0)
    assert len(left) == len(right) == 6
    assert (left[:, 1, 1] > left[:, 0, 1]).all()  # to the left of a path along x
    assert (right[:, 1, 1] < right[:, 0, 1]).all()
    lengths = np.hypot(*(left[:, 1] - left[:, 0]).T)
    assert (np.diff(lengths) < 0).all()  # the spin decays
    shot = simulate(Scene.named("pool", 0), [[-0.45, 0.56]], [1.5, 0.0], spins=[0.0, 0.0, 60.0], record=True)
    drawn = [c for c in shot.plot().collections if isinstance(c, LineCollection) and c.get_zorder() == 4.1]
    ends = np.array([one for c in drawn for one in c.get_segments()])[:, 1]
    pockets = Scene.named("pool", 0).table.pockets
    assert min(np.hypot(*(ends - (p.x, p.y)).T).min() / p.radius for p in pockets) > 1  # on the cloth


def test_balls_that_fly_have_a_side_view_to_scale(jump, shot):
    axes, height = jump.plot(), recording_of(jump).hops()[0][2]
    assert f"{100 * height:.1f} cm" in [text.get_text() for text in axes.texts]
    radius = jump.scene.balls.radius[0]
    (cloth,) = {round(y - radius, 9) for _, y, _ in circles(axes, looks(jump.scene)[1].fill, True) if y > 0.66}
    (ring,) = [place for place in circles(axes, looks(jump.scene)[0].path, False) if place[1] > cloth]
    place = recording_of(jump).path(0, [recording_of(jump).gone[0]])[0]
    assert ring == pytest.approx([place[0], cloth + radius + height, radius])
    (legend,) = axes.figure.legends
    assert {"in the air", "is driven off"} <= {text.get_text() for text in legend.get_texts()}
    assert shot.plot().get_ylim()[1] < 0.8 < axes.get_ylim()[1]
    across = simulate("jump_pool", [[0.0, -0.3], [0.1, -0.1]], [0.1, 2.0, -2.0], record=True).plot()
    assert across.get_xlim()[0] < -1.5


def test_the_path_of_a_ball_in_the_air_is_dashed(jump, shot):
    def gaps(drawn):
        lines = [line.get_xdata() for line in drawn.plot().lines if line.get_linewidth() == 3.4]
        return sum(int(np.isnan(x[1:-1]).any()) for x in lines)

    assert gaps(shot) == 0
    assert gaps(jump) == 1
