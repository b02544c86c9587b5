"""The engines in a browser compute the bits of Python. The tests need `make page` or its extra."""

import contextlib
import dataclasses
import json
import re
import shutil

import numba
import numpy as np
import pytest

from billiards_env import Engine, Scene, simulate, strike
from docs.web import build, check

CASES = [("pool", "random"), ("pool", "break"), ("pool", "timestep"), ("ideal", "random"), ("real_pool", "random")]


@pytest.fixture(scope="module")
def engine():
    try:
        return build.engine_file()
    except RuntimeError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def tab():
    if not any(map(shutil.which, check.BROWSERS)):
        pytest.skip("no chromium or google-chrome on the PATH")
    with check.browser_page() as page:
        yield page


@pytest.fixture
def page(engine, tab):
    """A page of the browser with the engine."""
    check.browser_bits(tab, engine, [])
    return tab


@pytest.fixture(scope="module")
def shots():
    rng = np.random.default_rng(1)
    return [shot for name, case in CASES for shot in check.random_shots(name, case, 3, rng)]


def test_a_browser_computes_the_bits_of_python(engine, tab, shots):
    _, rows = check.browser_bits(tab, engine, shots)
    for shot, row in zip(shots, rows, strict=True):
        assert check.same(row, check.python_bits(shot)), shot


def test_a_strike_has_the_bits_of_python(page):
    parameters = {"speed": 2.5, "heading": 0.7, "side": 0.3, "top": -0.2, "elevation": 0.2}
    struck = page.evaluate("parameters => engine.strike('real_pool', parameters)", parameters)
    expected = strike(Scene.named("real_pool"), **parameters)
    assert struck == {"velocity": expected.velocity.tolist(), "spin": expected.spin.tolist(), "miscue": False}


@pytest.mark.parametrize("name", ["pool", "real_pool"])
def test_a_strike_drives_a_frozen_ball_as_in_python(name, page):
    scene = Scene.named(name)
    positions = [[0.0, 0.0], [2 * scene.balls.radius[0], 0.0]]
    parameters = {"speed": 2.0, "heading": 0.2, "side": 0.1, "top": 0.2}
    call = "engine.simulate(name, positions, engine.strike(name, parameters)).positions"
    final = page.evaluate(f"([name, positions, parameters]) => {call}", [name, positions, parameters])
    struck = strike(scene, **parameters)
    assert final == simulate(scene, positions, struck).positions.tolist()
    assert (
        final != simulate(scene, positions, struck.velocity, spins=[struck.spin.tolist(), [0.0] * 3]).positions.tolist()
    )


WRONG = [
    ("'pol', [[0, 0]], [1, 0]", "scene = 'pol': expected one of 'pool', "),
    ("'pool', [[0, 0], [0.01, 0]], [1, 0]", "positions: expected balls that lie on the table"),
]


@pytest.mark.parametrize(("call", "message"), WRONG)
def test_the_module_rejects_wrong_input(page, call, message):
    error = page.evaluate(f"() => {{ try {{ engine.simulate({call}); }} catch (error) {{ return error.message; }} }}")
    assert re.match(message, error)


@pytest.mark.parametrize("mode", ["pic", "pit"])
def test_other_physics_give_the_bits_of_python(mode, page):
    scene, positions = Scene.named("real_pool"), [[-0.6, 0.0], [0.6, 0.02]]
    physics = {"e_ball": 0.9, "mu_slide": 0.25, "spin_decay": 12.0, "g": 9.8, "mu_ball_factor": 1.5}
    options = {"mode": mode, "dt": 1 / 60 if mode == "pit" else None, "spins": [0.0, 20.0, 30.0], "physics": physics}
    call = "engine.simulate('real_pool', positions, [3, 0.2], options)"
    final = page.evaluate(f"([positions, options]) => {call}.positions", [positions, options])
    changed = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **physics))
    engine = Engine(mode, options["dt"])
    expected = simulate(changed, positions, [3.0, 0.2], spins=options["spins"], engine=engine)
    assert final == expected.positions.tolist()


def test_the_files_are_small_and_the_module_reads_a_long_log(engine, page):
    assert len(engine) <= 850_000
    assert len((build.HERE / "engine.js").read_text(encoding="utf-8").splitlines()) <= 400
    positions = [[-0.5, 0.0], [0.5, 0.0]]
    call = f"engine.simulate('ideal', {positions}, [7, 3], {{maxTime: 3000}})"
    n_events = page.evaluate(f"() => {call}.events.length")
    assert n_events == simulate(Scene.named("ideal"), positions, [7.0, 3.0], max_time=3000.0).n_events > 10_000


def test_the_page_plays_a_shot_and_its_address_holds_it(engine, tab, tmp_path):
    (tmp_path / "play.html").write_text(build.play_page(engine), encoding="utf-8")
    address = (tmp_path / "play.html").as_uri()
    errors, requests = [], []

    def opened(place):
        page = tab.context.browser.new_page()
        page.on("pageerror", lambda error: errors.append(error))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(place)
        page.wait_for_function("() => window.billiards !== undefined")
        return page

    page = opened(address)
    box = page.locator("#exact").bounding_box()
    page.mouse.move(box["x"] + 60, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 20, box["y"] + 63, steps=3)
    page.mouse.up()
    ends = "JSON.stringify(billiards.shots.map(shot => shot.positions))"
    dragged = page.evaluate(ends)
    assert opened(page.url).evaluate(ends) == dragged
    page.select_option("#rate", "0.05")
    page.locator("#exact").focus()
    page.keyboard.press("]")
    assert page.inner_text("#dt-name") == "1/40 s"
    exact, stepped = page.evaluate("billiards.shots.map(shot => shot.positions)")
    assert page.evaluate("billiards.time") < 1.0
    assert exact == json.loads(dragged)[0]
    assert stepped != json.loads(dragged)[1]
    for name in build.FAILURES:
        page.click(f"[data-failure={name}]")
        exact, stepped = page.evaluate("billiards.shots.map(shot => shot.positions)")
        assert np.abs(np.subtract(exact, stepped)).max() > 0.05
        assert build.FAILURES[name].text in page.inner_text("#message")
        assert page.evaluate("billiards.time") == 0.0
    for _ in range(5):  # the balls of the last one overlap before the fifth test
        page.click("#step")
    assert page.evaluate("billiards.time") == pytest.approx(0.2)
    places = np.array(page.evaluate("billiards.shots[1].at(billiards.time)"))
    assert np.hypot(*(places[1] - places[0])) == pytest.approx(0.039, abs=1e-6)
    page.set_viewport_size({"width": 380, "height": 800})
    page.wait_for_function("() => document.documentElement.scrollWidth <= 380")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.wait_for_function("() => document.getElementById('dt').offsetWidth > 1000")
    assert errors == []
    assert all(url.startswith("file:") for url in requests)


def test_the_page_plays_against_the_policy(engine, tab, tmp_path):
    (tmp_path / "play.html").write_text(build.play_page(engine), encoding="utf-8")
    page = tab.context.browser.new_page()
    near = "0,0;1.22,0.585;-1.22,0.585;1.22,-0.585;-1.22,-0.585;0.05,0.58"  # balls next to the pockets
    page.goto((tmp_path / "play.html").as_uri() + f"#game=duel&scene=pool&balls={near}&cue=0,0.1,0,0,0&dt=30")
    page.wait_for_function("() => window.billiards !== undefined")
    page.click("#shoot")
    page.evaluate("billiards.seek(Math.max(...billiards.shots.map(shot => shot.time)) - 0.01)")
    page.click("#play")
    page.wait_for_function("() => billiards.start.turn === 1 && billiards.shots", timeout=120_000)
    assert re.match(r"The computer's shot\. You 0, computer [1-5]\. ", page.inner_text("#message"))
    assert "#game=given" in page.url  # the address holds the motion of the cue ball
    page.click("#undo")
    assert page.evaluate("[billiards.start.turn, billiards.start.won]") == [0, [0, 0]]


def test_another_version_of_numba_is_refused(monkeypatch):
    monkeypatch.setattr(numba, "__version__", "0.99.0")
    with pytest.raises(RuntimeError, match=r"numba = 0\.99\.0: expected numba 0\.68"):
        build.engine_file()


def test_the_commands_write_and_check_the_files(page, tmp_path, monkeypatch, capsys):
    build.main(["--output", str(tmp_path), "--page", str(tmp_path / "page" / "play.html")])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["engine.js", "engine.wasm", "page", "play.html"]
    assert (tmp_path / "page" / "play.html").read_bytes() == (tmp_path / "play.html").read_bytes()
    monkeypatch.setattr(check, "browser_page", lambda: contextlib.nullcontext(page))
    monkeypatch.setattr(check, "SCENES", ("pool",))
    output = tmp_path / "check.json"
    check.main(["--shots", "10", "--engine", str(tmp_path / "engine.wasm"), "--output", str(output)])
    assert "| `pool` | random   |     10 |                    10 |" in capsys.readouterr().out
    assert [row["case"] for row in json.loads(output.read_text())["rows"]] == list(check.CASES)
