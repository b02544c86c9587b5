import html
import json
import os
import re
import time

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.drawing.orientation import turning
from billiards_env.drawing.page import make_page
from billiards_env.drawing.style import CLOTH, POCKET, looks
from billiards_env.simulation import simulate
from tests.helpers.browser import browser, find_browser

CHROMIUM = find_browser()
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on the PATH")


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    assert CHROMIUM is not None
    with browser(CHROMIUM, tmp_path_factory.mktemp("profile")) as page:
        yield page
        assert page.errors == []
        assert all(url.startswith("file:") for url in page.requests)


@pytest.fixture
def player(tab, shot, pit, tmp_path):
    """The page of a shot and of its PIT run, opened from a file."""
    shot.to_html(tmp_path / "shot.html", compare=pit)
    tab.open(tmp_path / "shot.html")
    return tab


def at(tab, run, t):
    return np.array(tab.run(f"billiards.at({run}, {t!r})"))


def rgb(colour):
    return [int(colour[k : k + 2], 16) for k in (1, 3, 5)]


def text(tab, selector):
    return tab.run(f"document.querySelector({selector!r}).textContent")


def pixel(tab, x, y):
    """Returns the colour of the canvas at a point of the table, m."""
    return tab.run(
        f"(() => {{ const c = document.querySelector('#table'), p = c.getContext('2d'), m = p.getTransform();"
        f" const q = m.transformPoint(new DOMPoint({x}, {y}));"
        " return [...p.getImageData(Math.floor(q.x), Math.floor(q.y), 1, 1).data].slice(0, 3); })()"
    )


@needs_browser
def test_positions_agree_with_the_shot(player, shot, pit):
    for run, one in enumerate((shot, pit)):
        times = [0.0, *np.linspace(0.003, one.time, 40).tolist(), *one.events["time"].tolist()[:40], one.time + 1]
        for t in times:
            assert np.abs(at(player, run, t) - one.at(t)).max() < 1e-9


@needs_browser
def test_positions_agree_with_a_break(tab, tmp_path):
    scene = Scene.named("pool", 15)
    rng = np.random.default_rng(1)
    places = np.column_stack((np.linspace(-1.1, 1.1, 16), rng.uniform(-0.5, 0.5, 16)))
    shot = simulate(scene, places, rng.normal(size=(16, 2)) * 3, record=True)
    shot.to_html(tmp_path / "break.html")
    tab.open(tmp_path / "break.html")
    for t in np.linspace(0, shot.time, 100).tolist():
        assert np.abs(at(tab, 0, t) - shot.at(t)).max() < 1e-9
    assert tab.run("document.querySelector('#other').getClientRects().length") == 0  # no other run


@needs_browser
def test_balls_are_drawn_at_their_positions(player, shot):
    player.run("billiards.seek(1.0)")
    for ball, colour in ((1, (240, 228, 66)), (2, (0, 114, 178)), (4, (204, 121, 167))):
        x, y = shot.at(1.0)[ball]
        assert pixel(player, x - 0.7 * 0.028, y) == pytest.approx(colour, abs=3)
    assert pixel(player, *shot.at(1.0)[0]) == [255, 255, 255]
    assert pixel(player, 0.0, 0.0) == pytest.approx(rgb(CLOTH), abs=6)  # with the threads of the cloth
    assert pixel(player, -1.27, 0.635) == pytest.approx(rgb(POCKET), abs=1)


@needs_browser
def test_play_runs_and_stops_at_the_end(player, shot, pit):
    assert not player.run("billiards.playing")
    player.click("#play")
    assert player.run("new Promise(done => setTimeout(() => done(billiards.playing && billiards.time > 0.05), 500))")
    assert text(player, "#play") == "Pause"
    player.click("#play")
    stopped = player.run("billiards.time")
    assert player.run("new Promise(done => setTimeout(() => done(billiards.time), 100))") == stopped
    end = max(shot.time, pit.time)
    assert player.run("billiards.duration") == end
    player.run(f"billiards.seek({end - 0.02}); billiards.play()")
    assert player.run("new Promise(done => setTimeout(() => done([billiards.playing, billiards.time]), 1000))") == [
        False,
        end,
    ]
    player.click("#table")  # starts again
    assert player.run("billiards.playing && billiards.time < 1")
    player.run("billiards.pause()")


@needs_browser
def test_the_playback_speed(player):
    player.run("document.querySelector('#speed').value = '0.05'; billiards.play()")
    slow = player.run("new Promise(done => setTimeout(() => done(billiards.time), 600))")
    assert 0 < slow < 0.2
    player.run("billiards.pause()")


@needs_browser
def test_the_time_slider(player):
    player.run("const s = document.querySelector('#scrub'); s.value = 2.5; s.dispatchEvent(new Event('input'))")
    assert player.run("billiards.time") == pytest.approx(2.5, abs=1e-6)
    assert "2.500" in text(player, "#clock")
    player.run("document.querySelector('#scrub').focus()")
    player.press("ArrowRight", 39)
    assert player.run("billiards.time") == pytest.approx(2.5 + 1 / 30, abs=1e-6)


@needs_browser
def test_events_are_listed_and_can_be_selected(player, shot):
    listed = player.run("[...document.querySelectorAll('#events button')].map(b => b.textContent)")
    strong = shot.events[np.isin(shot.events["kind"], ["ball_ball", "cushion", "pocket"])]
    assert len(listed) == len(strong) == 7
    assert listed[0].startswith("0.043 s")
    assert "Cue ball hits ball 2, 2.38 m/s" in listed[0]
    assert any("Ball 3 is potted" in line for line in listed)
    player.click("#events li:nth-child(3) button")
    assert player.run("billiards.time") == strong["time"][2]
    assert "Ball 3 is potted" in text(player, "#events [aria-current]")
    player.click("#next")
    assert player.run("billiards.time") == strong["time"][3]
    player.click("#back")
    player.click("#back")
    assert player.run("billiards.time") == strong["time"][1]
    player.click("#all")
    assert player.run("document.querySelectorAll('#events button').length") == len(shot.events)


@needs_browser
def test_the_keyboard_controls_everything(player, shot, pit):
    player.run("document.activeElement.blur()")
    times = shot.events["time"][np.isin(shot.events["kind"], ["ball_ball", "cushion", "pocket"])]
    steps = [
        (".", 190, times[0]),
        (".", 190, times[1]),
        (",", 188, times[0]),
        ("End", 35, max(shot.time, pit.time)),
        ("Home", 36, 0.0),
        ("ArrowRight", 39, 1 / 30),
        ("ArrowLeft", 37, 0.0),
    ]
    for key, code, seconds in steps:
        player.press(key, code)
        assert player.run("billiards.time") == seconds
    player.press("+", 187)
    assert player.run("document.querySelector('#speed').value") == "2"
    player.press("-", 189)
    player.press("-", 189)
    assert player.run("document.querySelector('#speed').value") == "0.5"
    player.press(" ", 32)
    assert player.run("billiards.playing")
    player.press(" ", 32)
    assert not player.run("billiards.playing")
    seen = set()
    for _ in range(12):  # every control can be reached
        player.press("Tab", 9)
        seen.add(player.run("document.activeElement.id"))
    assert {"table", "scrub", "play", "back", "next", "speed", "paths", "rings"} <= seen


@needs_browser
def test_the_other_run_can_be_hidden(player, pit):
    player.run("billiards.seek(4.0)")
    x, y = pit.at(4.0)[2]
    ring = pixel(player, x + 0.0283, y)
    assert ring == pytest.approx(rgb(looks(pit.scene)[2].path), abs=30)
    assert "Rings: PIT, dt = 16.67 ms" in text(player, "#other")
    player.click("#rings")
    assert pixel(player, x + 0.0283, y) == pytest.approx(rgb(CLOTH), abs=6)
    assert re.fullmatch(r"Furthest apart: ball \d, [\d.]+ mm", text(player, "#apart"))


@needs_browser
def test_dark_and_light(player):
    for scheme, paper in (("dark", "rgb(23, 25, 26)"), ("light", "rgb(255, 255, 255)")):
        player.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        assert player.run("getComputedStyle(document.body).backgroundColor") == paper
    player.call("Emulation.setEmulatedMedia", features=[])


@needs_browser
def test_the_page_fits_a_telephone(player):
    player.call("Emulation.setDeviceMetricsOverride", width=360, height=740, deviceScaleFactor=3, mobile=True)
    try:
        fits, sharp = "document.documentElement.scrollWidth <= 360", "document.querySelector('#table').width > 900"
        deadline = time.monotonic() + 10.0  # the page adapts to the window after some frames
        while not player.run(f"{fits} && {sharp}") and time.monotonic() < deadline:
            time.sleep(0.02)
        assert player.run(fits)
        assert player.run(sharp)  # physical pixels of the screen
    finally:
        player.call("Emulation.clearDeviceMetricsOverride")


@needs_browser
def test_notebooks_show_the_page_in_an_iframe(tab, shot, tmp_path):
    (tmp_path / "notebook.html").write_text(f"<!doctype html><meta charset=utf-8>{shot._repr_html_()}", "utf-8")
    tab.open(tmp_path / "notebook.html")
    assert tab.run("document.querySelector('iframe').getBoundingClientRect().width") > 600
    with tab.frame():
        assert text(tab, "h1") == "PIC: 14 events in 5.27 s"
        tab.run("billiards.seek(1.0)")
        assert np.abs(at(tab, 0, 1.0) - shot.at(1.0)).max() < 1e-9
        assert pixel(tab, *shot.at(1.0)[0]) == [255, 255, 255]


@needs_browser
@pytest.mark.parametrize("width", [500, 740, 790, 1000, 1600])
def test_the_output_of_a_notebook_has_the_height_of_its_content(width, tab, shot, tmp_path):
    output = f"<!doctype html><meta charset=utf-8><body style='margin: 0; width: {width}px'>{shot._repr_html_()}"
    (tmp_path / "notebook.html").write_text(output, "utf-8")
    tab.open(tmp_path / "notebook.html")
    height = tab.run("document.querySelector('iframe').clientHeight")
    assert tab.run("document.body.scrollHeight") == height
    with tab.frame():
        assert tab.run("document.documentElement.scrollHeight") == height  # no scroll bar
        assert tab.run("document.documentElement.scrollWidth") <= min(width, 1100)
        assert height - tab.run("document.querySelector('main').getBoundingClientRect().bottom") < 16
        unused = "document.querySelector('#felt').{0} - document.querySelector('#table').{0}"
        deadline = time.monotonic() + 10.0  # the table adapts to the frame after some frames
        while tab.run("document.querySelector('#table').clientWidth") < 100 and time.monotonic() < deadline:
            time.sleep(0.02)
        assert tab.run(unused.format("clientWidth")) < 30 or tab.run(unused.format("clientHeight")) < 2
        assert tab.run(unused.format("clientHeight")) < 50


@needs_browser
def test_inserted_text_is_escaped(tab, shot, tmp_path):
    title = "</title><script>document.body.id = 'broken'</script>{{data}} & \"'"
    shot.to_html(tmp_path / "shot.html", title=title)
    tab.open(tmp_path / "shot.html")
    assert text(tab, "h1") == title
    assert tab.run("document.title") == title
    assert tab.run("document.body.id") == ""
    assert tab.run("billiards.duration") == shot.time


def test_the_page_is_one_file_without_links(shot, pit):
    page = make_page(shot.recording(), pit.recording(), "</script><b>")
    assert not re.search(r"(src|href)=|https?:|@import|url\(", page)
    assert page.count("</script>") == 2
    assert "<b>" not in page
    assert "{{" not in page


def test_the_page_contains_the_trajectories_with_all_digits(shot):
    (text,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', make_page(shot.recording()))
    data = json.loads(text)
    paths = shot.recording().trajectory
    for ball, rows in enumerate(data["runs"][0]["pieces"]):
        assert [row[2:4] for row in rows] == paths.position[paths.ball == ball].tolist()
    assert data["runs"][0]["gone"][2] == paths.gone[2]
    assert data["runs"][0]["gone"][0] is None


def test_labels_are_escaped(shot):
    page = make_page(shot.recording()._replace(label="</script><script>alert(1)</script>"))
    assert "alert(1)</script>" not in page
    assert html.escape("</script><script>alert(1)</script>") in page


def test_a_shot_that_ends_at_its_time_limit():
    ideal = simulate(Scene.named("ideal"), [[0.0, 0.0], [0.5, 0.1]], [1.0, 0.0], max_time=2.0, record=True)
    assert "Infinity" not in re.findall(r"application/json.>(.*?)</script>", make_page(ideal.recording()))[0]


def test_notebooks_show_no_page_for_unrecorded_or_long_shots(shot, unrecorded, monkeypatch):
    assert "<iframe " in shot._repr_html_()
    assert unrecorded._repr_html_() is None
    monkeypatch.setattr("billiards_env.shot.LONGEST_SHOWN", 3)
    assert shot._repr_html_() is None


def test_bad_paths_are_rejected(shot, elsewhere, tmp_path):
    with pytest.raises(ValueError, match=r"expected a name that ends in '\.html'"):
        shot.to_html(tmp_path / "a.htm")
    with pytest.raises(FileNotFoundError, match="does not exist"):
        shot.to_html(tmp_path / "none" / "a.html")
    with pytest.raises(ValueError, match="compare: expected a shot with the same balls"):
        shot.to_html(tmp_path / "a.html", compare=elsewhere)
    assert os.listdir(tmp_path) == []


@needs_browser
def test_balls_turn_as_in_python(tab, tmp_path):
    scene = Scene.named("pool", 1)
    shot = simulate(scene, [[-0.6, 0.0], [0.4, 0.02]], [2.0, 0.0], spins=[20.0, -30.0, 60.0], record=True)
    shot.to_html(tmp_path / "spin.html")
    tab.open(tmp_path / "spin.html")
    turns = turning(shot.recording())
    for t in np.linspace(0.0, shot.time, 40).tolist():
        for ball, face in enumerate(turns.at(t)):
            shown = np.array(tab.run(f"billiards.face({ball}, {t!r})"))
            assert min(abs(shown - face).max(), abs(shown + face).max()) < 2e-3
    x, y = shot.at(0.3)[0]
    tab.run("billiards.seek(0.3)")
    views = [pixel(tab, x + dx, y + dy) for dx in (-0.02, 0.0, 0.02) for dy in (-0.02, 0.0, 0.02)]
    tab.run("billiards.seek(0.31)")
    x, y = shot.at(0.31)[0]
    assert views != [pixel(tab, x + dx, y + dy) for dx in (-0.02, 0.0, 0.02) for dy in (-0.02, 0.0, 0.02)]


@needs_browser
def test_touch_plays_and_moves_the_time(player):
    player.call("Emulation.setTouchEmulationEnabled", enabled=True)
    try:
        box = player.run(
            "(r => [r.x, r.y, r.width, r.height])(document.querySelector('#table').getBoundingClientRect())"
        )
        x, y = box[0] + 0.3 * box[2], box[1] + 0.5 * box[3]

        def touch(kind, *points):
            places = [{"x": px, "y": py} for px, py in points]
            player.call("Input.dispatchTouchEvent", type=kind, touchPoints=places)

        touch("touchStart", (x, y))
        touch("touchEnd")
        deadline = time.monotonic() + 10.0  # a tap becomes a click after a while
        while not player.run("billiards.playing") and time.monotonic() < deadline:
            time.sleep(0.02)
        assert player.run("billiards.playing")
        player.run("billiards.pause(); billiards.seek(0)")
        touch("touchStart", (x, y))
        for k in range(1, 9):
            touch("touchMove", (x + 0.05 * k * box[2], y))
        touch("touchEnd")
        moved = player.run("billiards.time")
        assert moved == pytest.approx(0.4 * player.run("billiards.duration"), rel=0.15)
        assert not player.run("billiards.playing")
    finally:
        player.call("Emulation.setTouchEmulationEnabled", enabled=False)
