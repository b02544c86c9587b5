import html
import re
import shutil

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.drawing.page import make_page
from billiards_env.drawing.raster import rgb
from billiards_env.drawing.recording import recording_of
from billiards_env.drawing.style import CLOTH, POCKET
from tests.helpers.pages import page_data

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("no chromium or google-chrome on the PATH")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def tab(browser):
    page = browser.new_page(viewport={"width": 1200, "height": 800})
    requests, errors = [], []
    page.on("request", lambda request: requests.append(request.url))
    page.on("pageerror", lambda error: errors.append(error))
    page.on("console", lambda message: message.type == "error" and errors.append(message.text))
    yield page
    assert errors == []
    assert all(url.startswith(("file:", "about:")) for url in requests)


def show(tab, shot, folder, **options):
    """Opens the page of a shot from a file."""
    shot.to_html(folder / "shot.html", **options)
    tab.goto((folder / "shot.html").as_uri())
    return tab


def show_notebook(tab, shot, folder, style=""):
    """Opens a notebook with a shot, and returns the frame of the shot."""
    text = f"<!doctype html><meta charset=utf-8><body style='{style}'>{shot._repr_html_()}"
    (folder / "notebook.html").write_text(text, "utf-8")
    tab.goto((folder / "notebook.html").as_uri())
    return tab.frames[1]


@pytest.fixture
def player(tab, shot, tmp_path):
    return show(tab, shot, tmp_path)


def at(tab, t):
    return np.array(tab.evaluate(f"billiards.at({t!r})"))


def text(tab, selector):
    return tab.evaluate(f"document.querySelector({selector!r}).textContent")


def later(tab, milliseconds, value):
    """Returns the value of an expression after a time."""
    return tab.evaluate(f"new Promise(done => setTimeout(() => done({value}), {milliseconds}))")


def pixel(tab, x, y):
    """Returns the colour of the canvas at a point of the table, m."""
    return tab.evaluate(
        f"(() => {{ const c = document.querySelector('#table'), p = c.getContext('2d'), m = p.getTransform();"
        f" const q = m.transformPoint(new DOMPoint({x}, {y}));"
        " return [...p.getImageData(Math.floor(q.x), Math.floor(q.y), 1, 1).data].slice(0, 3); })()"
    )


@pytest.mark.parametrize("name", ["shot", "pit"])
def test_positions_agree_with_the_shot(name, tab, tmp_path, request):
    one = request.getfixturevalue(name)
    show(tab, one, tmp_path)
    for t in [0.0, *np.linspace(0.003, one.time, 40).tolist(), *one.events["time"].tolist()[:40], one.time + 1]:
        assert np.abs(at(tab, t) - one.at(t)).max() < 1e-9


def test_balls_are_drawn_at_their_positions(player, shot):
    player.evaluate("billiards.seek(1.0)")
    for ball, colour in ((1, (240, 228, 66)), (2, (0, 114, 178)), (4, (204, 121, 167))):
        x, y = shot.at(1.0)[ball]
        assert pixel(player, x - 0.7 * 0.028, y) == pytest.approx(colour, abs=3)
    assert pixel(player, *shot.at(1.0)[0]) == [255, 255, 255]
    assert pixel(player, 0.0, 0.0) == pytest.approx(rgb(CLOTH), abs=6)  # with the threads of the cloth
    assert pixel(player, -1.27, 0.635) == pytest.approx(rgb(POCKET), abs=1)


def test_play_runs_and_stops_at_the_end(player, shot):
    assert not player.evaluate("billiards.playing")
    player.click("#play")
    assert later(player, 500, "billiards.playing && billiards.time > 0.05")
    assert text(player, "#play") == "Pause"
    player.click("#play")
    stopped = player.evaluate("billiards.time")
    assert later(player, 100, "billiards.time") == stopped
    end = player.evaluate("billiards.duration")
    assert end == shot.time
    player.evaluate(f"billiards.seek({end - 0.02}); billiards.play()")
    assert later(player, 1000, "[billiards.playing, billiards.time]") == [False, end]
    player.click("#table")  # starts again
    assert player.evaluate("billiards.playing && billiards.time < 1")
    player.evaluate("billiards.pause(); billiards.seek(0)")
    player.evaluate("document.querySelector('#speed').value = '0.05'; billiards.play()")
    assert 0 < later(player, 600, "billiards.time") < 0.2
    player.evaluate("billiards.pause()")


def test_the_time_slider(player):
    player.evaluate("const s = document.querySelector('#scrub'); s.value = 2.5; s.dispatchEvent(new Event('input'))")
    assert player.evaluate("billiards.time") == pytest.approx(2.5, abs=1e-6)
    assert "2.500" in text(player, "#clock")
    player.evaluate("document.querySelector('#scrub').focus()")
    player.keyboard.press("ArrowRight")
    assert player.evaluate("billiards.time") == pytest.approx(2.5 + 1 / 30, abs=1e-6)


def test_events_are_listed_and_can_be_selected(player, shot):
    listed = player.evaluate("[...document.querySelectorAll('#events button')].map(b => b.textContent)")
    strong = shot.events[np.isin(shot.events["kind"], ["ball_ball", "cushion", "pocket"])]
    assert len(listed) == len(strong) == 7
    assert listed[0].startswith("0.043 s")
    assert "Cue ball hits ball 2, 2.38 m/s" in listed[0]
    assert any("Ball 3 is potted" in line for line in listed)
    player.click("#events li:nth-child(3) button")
    assert player.evaluate("billiards.time") == strong["time"][2]
    assert "Ball 3 is potted" in text(player, "#events [aria-current]")
    player.click("#next")
    assert player.evaluate("billiards.time") == strong["time"][3]
    player.click("#back")
    player.click("#back")
    assert player.evaluate("billiards.time") == strong["time"][1]
    player.click("#all")
    assert player.evaluate("document.querySelectorAll('#events button').length") == len(shot.events)


def test_the_keyboard_controls_everything(player, shot):
    player.evaluate("document.activeElement.blur()")
    times = shot.events["time"][np.isin(shot.events["kind"], ["ball_ball", "cushion", "pocket"])]
    steps = [(".", times[0]), (".", times[1]), (",", times[0]), ("End", shot.time), ("Home", 0.0)]
    steps += [("ArrowRight", 1 / 30), ("ArrowLeft", 0.0)]
    speed, playing = "Number(document.querySelector('#speed').value)", "billiards.playing"
    steps = [("billiards.time", *step) for step in steps] + [(speed, "+", 2), (speed, "-", 1), (speed, "-", 0.5)]
    for value, key, expected in [*steps, (playing, " ", True), (playing, " ", False)]:
        player.keyboard.press(key)
        assert player.evaluate(value) == expected
    seen = set()
    for _ in range(12):  # every control can be reached
        player.keyboard.press("Tab")
        seen.add(player.evaluate("document.activeElement.id"))
    assert {"table", "scrub", "play", "back", "next", "speed", "paths"} <= seen


def test_events_at_nearly_the_same_time_have_microseconds(tab, tmp_path):
    scene = Scene.named("ideal", 2)
    shot = simulate(scene, [[0.0, 0.0], [0.1, 0.0], [0.157155, 0.0]], [1.0, 0.0], record=True, max_time=0.5)
    listed = show(tab, shot, tmp_path).evaluate(
        "[...document.querySelectorAll('#events time')].map(one => one.textContent)"
    )
    assert listed == ["0.042850 s", "0.042855 s"]


def test_nothing_is_cut(browser, shot, tmp_path):
    for width in (420, 1280):
        page = show(browser.new_page(viewport={"width": width, "height": 800}), shot, tmp_path)
        wide = "[...document.querySelectorAll('h1, p, label, li')].filter(one => one.scrollWidth > one.clientWidth)"
        assert page.evaluate(f"{wide}.map(one => one.textContent)") == []
        page.close()


def test_dark_and_light(player):
    for scheme, paper in (("dark", "rgb(23, 25, 26)"), ("light", "rgb(255, 255, 255)")):
        player.emulate_media(color_scheme=scheme)
        assert player.evaluate("getComputedStyle(document.body).backgroundColor") == paper
    player.emulate_media(color_scheme="null")


@pytest.fixture
def telephone(browser, shot, tmp_path):
    """The page of a shot on a telephone."""
    page = browser.new_page(
        viewport={"width": 360, "height": 740}, device_scale_factor=3, is_mobile=True, has_touch=True
    )
    yield show(page, shot, tmp_path)
    page.close()


def test_the_page_fits_a_telephone(telephone):
    telephone.wait_for_function("document.querySelector('#table').width > 900")  # physical pixels of the screen
    assert telephone.evaluate("document.documentElement.scrollWidth <= 360")


def test_notebooks_show_the_page_in_an_iframe(tab, shot, tmp_path):
    inner = show_notebook(tab, shot, tmp_path)
    assert tab.evaluate("document.querySelector('iframe').getBoundingClientRect().width") > 600
    assert text(inner, "h1") == "Exact engine (PIC): 7 contacts in 5.27 s"
    assert inner.evaluate("document.querySelectorAll('#events li').length") == 7


@pytest.mark.parametrize("width", [500, 740, 790, 1000, 1600])
def test_the_output_of_a_notebook_has_the_height_of_its_content(width, tab, shot, tmp_path):
    inner = show_notebook(tab, shot, tmp_path, f"margin: 0; width: {width}px")
    height = tab.evaluate("document.querySelector('iframe').clientHeight")
    assert tab.evaluate("document.body.scrollHeight") == height
    assert inner.evaluate("document.documentElement.scrollHeight") == height  # no scroll bar
    assert inner.evaluate("document.documentElement.scrollWidth") <= min(width, 1100)
    assert height - inner.evaluate("document.querySelector('main').getBoundingClientRect().bottom") < 16
    unused = "document.querySelector('#felt').{0} - document.querySelector('#table').{0}"
    inner.wait_for_function("document.querySelector('#table').clientWidth >= 100")
    assert inner.evaluate(unused.format("clientWidth")) < 30 or inner.evaluate(unused.format("clientHeight")) < 2
    assert inner.evaluate(unused.format("clientHeight")) < 50


def test_inserted_text_is_escaped(tab, shot, tmp_path):
    title = "</title><script>document.body.id = 'broken'</script>{{data}} & \"'"
    show(tab, shot, tmp_path, title=title)
    assert text(tab, "h1") == title
    assert tab.evaluate("document.title") == title
    assert tab.evaluate("document.body.id") == ""
    assert tab.evaluate("billiards.duration") == shot.time


def test_the_page_is_one_file_without_links(shot):
    label = "</script><b>"
    page = make_page(recording_of(shot)._replace(label=label), label)
    assert not re.search(r"(src|href)=|https?:|@import|url\(", page)
    assert page.count("</script>") == 2
    assert "<b>" not in page
    assert html.escape(label) in page
    assert html.escape(label) in make_page(recording_of(shot)._replace(label=label))
    assert "{{" not in page


def test_the_page_contains_the_trajectories_with_all_digits(shot):
    data = page_data(shot)
    paths = recording_of(shot).trajectory
    for ball, rows in enumerate(data["shot"]["pieces"]):
        assert [row[2:4] for row in rows] == paths.position[paths.ball == ball].tolist()
    assert data["shot"]["gone"][2] == paths.potted_at[2]
    assert data["shot"]["gone"][0] is None


def test_notebooks_show_no_page_for_unrecorded_or_long_shots(shot, unrecorded, monkeypatch):
    assert "<iframe " in shot._repr_html_()
    assert unrecorded._repr_html_() is None
    monkeypatch.setattr("billiards_env.drawing.page.LONGEST_SHOWN", 3)
    assert shot._repr_html_() is None


def test_balls_turn_as_in_python(tab, tmp_path):
    scene = Scene.named("pool", 1)
    shot = simulate(scene, [[-0.6, 0.0], [0.4, 0.02]], [2.0, 0.0], spins=[20.0, -30.0, 60.0], record=True)
    show(tab, shot, tmp_path)
    turns = recording_of(shot).turning()
    for t in np.linspace(0.0, shot.time, 40).tolist():
        for ball, face in enumerate(turns.at(t)):
            shown = np.array(tab.evaluate(f"billiards.face({ball}, {t!r})"))
            assert min(abs(shown - face).max(), abs(shown + face).max()) < 2e-3
    x, y = shot.at(0.3)[0]
    tab.evaluate("billiards.seek(0.3)")
    views = [pixel(tab, x + dx, y + dy) for dx in (-0.02, 0.0, 0.02) for dy in (-0.02, 0.0, 0.02)]
    tab.evaluate("billiards.seek(0.31)")
    x, y = shot.at(0.31)[0]
    assert views != [pixel(tab, x + dx, y + dy) for dx in (-0.02, 0.0, 0.02) for dy in (-0.02, 0.0, 0.02)]


def test_touch_plays_and_moves_the_time(telephone):
    box = telephone.locator("#table").bounding_box()
    x, y = box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"]
    telephone.touchscreen.tap(x, y)
    telephone.wait_for_function("billiards.playing")
    telephone.evaluate("billiards.pause(); billiards.seek(0)")
    fingers = telephone.context.new_cdp_session(telephone)
    touches = [("touchStart", 0), *(("touchMove", k) for k in range(1, 9))]
    for kind, k in touches:
        points = [{"x": x + 0.05 * k * box["width"], "y": y}]
        fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    moved = telephone.evaluate("billiards.time")
    assert moved == pytest.approx(0.4 * telephone.evaluate("billiards.duration"), rel=0.15)
    assert not telephone.evaluate("billiards.playing")


def test_the_page_of_a_flight_has_the_heights(jump, tab, tmp_path):
    show(tab, jump, tmp_path)
    for t in np.linspace(0.0, 0.99 * jump.time, 5).tolist():
        assert tab.evaluate(f"[0, 1].map(ball => billiards.height(ball, {t!r}))") == pytest.approx(jump.heights_at(t))
    tab.evaluate("billiards.seek(0.1)")
    assert text(tab, "#places tr td:last-child") == f"{jump.heights_at(0.1)[0]:.3f}"
    assert "is driven off the table" in text(tab, "#events")
    gaps = """() => {
        let gaps = 0;
        const move = CanvasRenderingContext2D.prototype.moveTo;
        CanvasRenderingContext2D.prototype.moveTo = function (x, y) { gaps++; move.call(this, x, y); };
        billiards.seek(0.99 * billiards.duration);
        return gaps;
    }"""
    assert tab.evaluate(gaps) > 5  # the path in the air is dashed
