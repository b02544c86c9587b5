"""The window, driven by mouse and keyboard events on a dummy display."""

import itertools
import math
import re
import threading
import time
import types
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pygame")

import pygame

from billiards_env import Scene
from billiards_env.drawing.canvas import Canvas, pixels
from billiards_env.drawing.pace import slower
from billiards_env.games import Stroke, records
from billiards_env.play import model as act
from billiards_env.play.model import change_pace, go, repeat, shoot, tick, toggle, turn_aim
from billiards_env.play.panel import place_controls
from billiards_env.play.view import View, _row
from billiards_env.play.window import COMMANDS, GameWindow, _Work
from billiards_env.players.levels import LevelPlayer
from billiards_env.players.planner import Plan

BALLS = [[-0.4, 0.0], [0.4, 0.0], [0.4, 0.5]]
SHIFT = pygame.KMOD_LSHIFT
YELLOW = (246, 199, 20)


@pytest.fixture
def window(make_model, tmp_path, request):
    """A function that opens a window with a game, see `make_model`."""

    def make(rules="", programs=(None, None), **kwargs):
        model = make_model(rules, **kwargs)
        shown = GameWindow(model, programs, np.random.default_rng(0), tmp_path / "game.json", 320)
        request.addfinalizer(shown.close)
        pygame.event.clear()
        return shown

    return make


@pytest.fixture
def shown(window):
    """A window with the first turn of a game."""
    return window()


def post(kind, **fields):
    pygame.event.post(pygame.event.Event(kind, **fields))


def press(shown, *keys, mod=0):
    """Presses keys and returns the next frame."""
    for key in keys:
        post(pygame.KEYDOWN, key=key, mod=mod, unicode="")
    return pixels(shown.frame())


def at(view, point):
    """Returns the pixel of a point, m."""
    return tuple(view.pixels_of(point).round().astype(int).tolist())


def move(pixel):
    post(pygame.MOUSEMOTION, pos=pixel, rel=(0, 0), buttons=(0, 0, 0))


def drag(shown, *pixels):
    """Drags the mouse with its left button over pixels; a click has one."""
    post(pygame.MOUSEBUTTONDOWN, pos=pixels[0], button=1)
    for pixel in pixels[1:]:
        move(pixel)
    post(pygame.MOUSEBUTTONUP, pos=pixels[-1], button=1)
    shown.frame()


def drag_on_table(shown, *points):
    """Drags the mouse over points, m."""
    drag(shown, *(at(shown._view, point) for point in points))


def click_on(shown, control, across=0.5, down=0.5):
    """Clicks on a control of the window, at shares of its width and height."""
    box = shown._view.panel.places[control]
    drag(shown, (round(box.x + across * box.width), round(box.y + down * box.height)))


def wheel(shown, steps):
    post(pygame.MOUSEWHEEL, x=0, y=steps)
    shown.frame()


def think(shown):
    """Shows frames until the program or the hint has ended."""
    while shown.model.phase == "thinking" or shown._work is not None:
        shown.frame()
    return shown.model


def state(model):
    """Returns what the keys change."""
    return model.phase, model.aim, model.page, model.pace, model.zoom, model.ghost, model.strokes


def test_each_key_does_its_action(window):
    shown = window("nine_ball")
    placing, aiming, rolling = shown.model, go(shown.model), go(go(shown.model))
    for start, shift in itertools.product((placing, aiming, rolling, repeat(rolling)), (0, SHIFT)):
        for name, (action, *arguments) in COMMANDS.items():
            if callable(action):
                shown.model, key = start, name.removeprefix("ctrl ")
                press(shown, pygame.key.key_code(key), mod=shift | pygame.KMOD_LCTRL * (key != name))
                steps = [0.1 * one if shift and isinstance(one, float) else one for one in arguments]
                assert state(shown.model) == state(action(start, *steps)), name


def test_a_turn_by_mouse(window):
    shown = window(state={"in_hand": "anywhere"})
    move(at(shown._view, (0.6, -0.3)))
    shown.frame()
    assert shown.model.cue_position == pytest.approx((0.6, -0.3), abs=0.01)
    drag_on_table(shown, BALLS[0])  # places the cue ball at the last point of the mouse
    x, y = shown.model.cue_position
    drag_on_table(shown, (x, y), (x - 0.4, y), (x - 0.3, y + 0.3))
    aim = shown.model.aim
    assert aim.angle == pytest.approx(0.75 * math.pi, abs=0.03)
    assert 0.09 * aim.speed + 1.4 * 0.028575 == pytest.approx(0.3 * math.sqrt(2), abs=0.01)
    drag_on_table(shown, (x - 0.3, y + 0.3), (x + 0.4, y))  # from the tip of the arrow
    assert shown.model.aim.angle == pytest.approx(0.0, abs=0.03)
    speed = shown.model.aim.speed
    drag_on_table(shown, (x, y - 0.3))  # aims, and does not shoot
    assert shown.model.aim.angle == pytest.approx(-math.pi / 2, abs=0.02)
    drag_on_table(shown, (0.0, 0.72))  # next to the table
    wheel(shown, 3)
    assert (shown.model.aim.angle, shown.model.aim.speed) == pytest.approx((-math.pi / 2, speed + 0.3), abs=0.02)
    click_on(shown, "shoot")
    assert (shown.model.phase, len(shown.model.strokes)) == ("rolling", 1)
    drag_on_table(shown, (0.8, -0.4))
    assert shown.model.phase != "rolling"


@pytest.mark.parametrize(("width", "height"), [(1280, 900), (320, 240), (401, 777), (900, 300)])
def test_controls_do_not_overlap(width, height):
    row = pygame.Rect(5, 400, width - 10, _row((width, height)))
    boxes = place_controls(row).values()
    assert all(row.contains(box) for box in boxes)
    assert all(one.right <= two.x for one, two in itertools.combinations(boxes, 2))


def test_the_controls_set_the_tip_the_elevation_and_the_speed(shown):
    click_on(shown, "ball", 0.65, 0.6)  # right of the centre and below it
    click_on(shown, "elevation", 0.5, 0.5)
    click_on(shown, "speed", 0.75, 0.5)
    assert shown.model.aim.tip == pytest.approx((-0.3, -0.2), abs=0.06)
    assert shown.model.aim.elevation == pytest.approx(45.0, abs=3.0)
    assert shown.model.aim.speed == pytest.approx(0.75 * 8.0, abs=0.2)
    click_on(shown, "ball", 1.0, 0.5)
    click_on(shown, "ball", 1.0, 0.5)  # the second click of a double click
    assert (shown.model.aim.tip, shown.model.aim.elevation, shown.model.strokes) == ((0.0, 0.0), 0.0, ())


def test_the_wheel_and_the_mouse_aim_finely_in_the_enlarged_part(shown):
    aim, plain = shown.model.aim, press(shown)
    zoomed = press(shown, pygame.K_f)
    wheel(shown, 2)
    assert math.degrees(shown.model.aim.angle - aim.angle) == pytest.approx(0.02)
    assert shown.model.aim.speed == aim.speed
    rect, enlarged = shown._view._inset
    assert (zoomed != plain)[rect.top : rect.bottom, rect.left : rect.right].mean() > 0.1
    x, y = np.round(enlarged.pixels_of(BALLS[1]) + rect.topleft).astype(int).tolist()
    assert (np.abs(zoomed[y - 20 : y + 20, x - 20 : x + 20].astype(int) - YELLOW).max(axis=2) < 25).any()
    drag(shown, (x, y + 8))
    assert shown.model.aim.angle == pytest.approx(math.atan2(-8 / enlarged.scale, 0.8), abs=1e-3)
    press(shown, pygame.K_f)
    assert shown._view._inset is None


def hint(shown, point):
    """Points at a place and presses A, until the window has an answer."""
    move(at(shown._view, point))
    press(shown, pygame.K_a)
    return think(shown)


def shot_of(model) -> Any:
    """Returns the aimed shot."""
    return go(model).last_shot.shot  # pyright: ignore[reportOptionalMemberAccess]


def test_a_key_aims_at_the_ball_and_the_pocket_under_the_mouse(shown):
    pocket = shown.model.setup.scene.table.pockets[3]
    assert shot_of(hint(shown, BALLS[2])).potted.tolist() == [False, False, True]
    model = hint(shown, (pocket.x - 0.01, pocket.y))  # a pocket for the ball that is aimed at
    assert shot_of(model).positions[2].tolist() == [pocket.x, pocket.y]
    assert hint(shown, (-0.9, -0.4)) is model
    assert shown.message == "point at a ball or a pocket"


def test_shift_and_the_key_aim_for_the_best_shot(window, monkeypatch):
    monkeypatch.setattr("billiards_env.play.window.HINT_TIME", 0.05)
    shown = window(scene=Scene.named("jump_pool", 2))
    hint(shown, BALLS[2])  # this hint needs derivatives; the planner does not
    assert shown.message == "no aim help for flights"
    for _ in range(2):  # the first search may spend its time on compilation
        press(shown, pygame.K_a, mod=SHIFT)
        assert shown.message == "thinking"
        think(shown)
    assert re.fullmatch(r"ball \S+ into the \w+ \w+ pocket, \d+% with the noise of a good player", shown.message)
    assert shot_of(shown.model).potted.any()


PLANS = [Plan(Stroke((2.0, speed)), 0.31, 0.62, ball, 2, np.zeros((3, 2)), 40) for speed, ball in ((0.0, 1), (2.0, 2))]
CHANGES = {
    "the called ball": lambda model: act.next_called(model, "ball"),
    "the called pocket": lambda model: act.next_called(model, "pocket"),
    "the tip of the cue": lambda model: act.set_tip(model, 0.2, 0.2),
    "the elevation of the cue": lambda model: act.raise_cue(model, 30.0),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_the_aim_is_drawn(change, make_model):
    model = make_model(call_shot=True)
    view = View(model.setup.scene, 320)
    assert (pixels(view.draw(model)) != pixels(view.draw(change(model)))).any()


def test_the_considered_shots_are_drawn(make_model):
    thinking = make_model(players=("program", "human"))
    view = View(thinking.setup.scene, 320)
    models = thinking, act.consider(thinking, PLANS[:1]), act.consider(thinking, PLANS)
    assert all((one != other).any() for one, other in itertools.pairwise(pixels(view.draw(model)) for model in models))


def test_the_ghost_is_drawn_at_its_place(make_model):
    model = tick(repeat(go(go(turn_aim(make_model(), 1.0)))), 3.0)
    view, (_, ghost) = View(model.setup.scene, 640), model.shown_shots
    differ = (pixels(view.draw(model)) != pixels(view.draw(toggle(model, "ghost")))).any(axis=2)
    x, y = at(view, ghost.at(3.0)[1])  # pyright: ignore[reportOptionalMemberAccess]
    assert differ[y - 12 : y + 13, x - 12 : x + 13].any()


def test_a_ball_in_the_air_is_drawn_at_its_height(make_model, monkeypatch):
    model, drawn = make_model(scene=Scene.named("jump_pool", 2)), []
    model = tick(go(act.raise_cue(turn_aim(model, 20.0), 40.0)), 0.05)
    monkeypatch.setattr(Canvas, "draw_balls", lambda *arguments: drawn.append(arguments[-1]))
    View(model.setup.scene, 320).draw(model)
    assert drawn[-1][0] > 0.01
    assert not drawn[-1][1:].any()


def test_a_stroke_that_noise_makes_faster_than_the_fastest_shot_is_shown(make_model):
    view = View(make_model().setup.scene, 320)
    box = view.panel.places["speed"]
    shots = [shoot(make_model(), Stroke((speed, 0.0))) for speed in (4.0, 8.0, 8.5)]
    scales = [pixels(view.draw(shot))[box.top : box.bottom, box.left : box.right] for shot in shots]
    assert (scales[2] == scales[1]).all()
    assert (scales[1] != scales[0]).any()


def test_pages_cover_the_table(shown):
    plain = press(shown)
    keys, rules = press(shown, pygame.K_h), press(shown, pygame.K_F1)
    assert not (rules == plain[100, 100]).all(axis=2).any()
    assert (keys != rules).any()
    press(shown, pygame.K_ESCAPE)
    post(pygame.KEYDOWN, key=pygame.K_SLASH, mod=SHIFT, unicode="?")
    assert (press(shown) == rules).all()
    assert (press(shown, pygame.K_ESCAPE) == plain).all()


def test_a_new_game_starts_after_the_end(window):
    shown = window("straight", positions=[[0.97, 0.335], [1.07, 0.435], [-0.5, 0.0]], target=1)
    press(shown, pygame.K_n)  # the game is not over
    end = press(shown, pygame.K_SPACE, pygame.K_SPACE)
    assert (shown.model.phase, len(shown.model.strokes)) == ("over", 1)
    assert (pixels(shown._view.canvas.table)[40:80, 100:220] != end[40:80, 100:220]).any()  # the result is shown
    drag_on_table(shown, (0.0, 0.0))
    assert shown.model.phase == "over"
    click_on(shown, "shoot")
    assert (shown.model.phase, shown.model.strokes) == ("placing", ())


CLOSE, LEFT, Q, S = pygame.QUIT, pygame.K_LEFT, pygame.K_q, pygame.K_s
QUITS = [  # the events, and whether the window is open, asks and has saved the game after them
    ([CLOSE], True, True, False),
    ([pygame.K_ESCAPE], True, True, False),
    ([Q, LEFT], True, False, False),  # any other key continues and has no other effect
    ([CLOSE, CLOSE], False, True, False),
    ([CLOSE, Q], False, True, False),
    ([Q, S], False, False, True),
    ([S, CLOSE], False, False, True),
]


@pytest.mark.parametrize(("events", "is_open", "asks", "saves"), QUITS)
def test_quitting_asks_if_the_game_is_not_saved(events, is_open, asks, saves, shown, tmp_path):
    frame = plain = press(shown, pygame.K_SPACE, pygame.K_SPACE)
    aim = shown.model.aim
    for event in events:
        post(CLOSE) if event == CLOSE else post(pygame.KEYDOWN, key=event, mod=0, unicode="")
        frame = press(shown)
    assert (shown.open, shown.asking, shown.saved, shown.model.aim) == (is_open, asks, saves, aim)
    assert (tmp_path / "game.json").exists() == saves
    if is_open and asks:
        left, top, *_ = shown._view.panel.places["shoot"]
        assert (frame != plain).any()
        assert (frame[top + 3 :, left:] == frame[-1, -1]).all()  # without the button
    if saves:
        assert shown.message == f"saved to {tmp_path / 'game.json'}"
        record: Any = records.load(tmp_path / "game.json")
        assert (record.strokes, len(record.strokes)) == (shown.model.strokes, 1)
    shown.open, shown.ask = True, False
    shown.quit()
    assert not shown.open


def test_nothing_is_drawn_while_nothing_changes(shown, monkeypatch):
    draw, drawn = View.draw, []
    monkeypatch.setattr(View, "draw", lambda *args: drawn.append(args) or draw(*args))
    for events, count in (([], 1), ([], 1), ([(pygame.VIDEOEXPOSE, {})], 2)):
        for kind, fields in events:
            post(kind, **fields)
        shown.frame()
        assert len(drawn) == count
    press(shown, pygame.K_LEFT)
    assert len(drawn) == 3


@pytest.mark.parametrize("size", [(320, 500), (640, 400), (900, 300), (401, 777)])
def test_the_table_fits_a_window_of_any_size(size, shown):
    pygame.display.set_mode(size, pygame.RESIZABLE)
    frame = press(shown)
    assert frame.shape == (size[1], size[0], 3)
    corners = np.array([shown._view.pixels_of((1.27 * x, 0.635 * y)) for x in (-1, 1) for y in (-1, 1)])
    assert (corners > 0).all()
    assert (corners < size).all()
    x, y = at(shown._view, BALLS[1])
    assert (np.abs(frame[y - 4 : y + 5, x - 4 : x + 5].astype(int) - YELLOW).max(axis=2) < 15).any()
    drag_on_table(shown, BALLS[0], (-0.1, 0.3))
    assert shown.model.aim.angle == pytest.approx(math.pi / 4, abs=0.05)
    assert press(shown, pygame.K_h).shape == (size[1], size[0], 3)


def test_a_shot_is_drawn_from_its_start_only_after_a_step_back(make_model, monkeypatch):
    model, starts, start = tick(go(make_model()), 0.5), [], View._start_paths
    monkeypatch.setattr(View, "_start_paths", lambda *args: starts.append(1) or start(*args))
    view = View(model.setup.scene, 320)
    first = pixels(view.draw(model))
    later = pixels(view.draw(change_pace(tick(model, 0.51), slower)))
    assert (len(starts), (first != later).any()) == (1, True)
    assert (pixels(view.draw(model)) == first).all()


def test_a_game_whose_file_cannot_be_written_is_saved_elsewhere(shown, tmp_path, monkeypatch):
    monkeypatch.setattr("billiards_env.play.window._OTHER_FOLDERS", (tmp_path / "none", tmp_path))
    monkeypatch.setattr(shown, "_save", tmp_path / "gone" / "game.json")
    (tmp_path / "game.json").write_text("another game")
    shown.save()
    assert shown.message.endswith(f"'{tmp_path / 'gone'}' does not exist; saved to {tmp_path / 'game-2.json'}")
    assert isinstance(records.load(tmp_path / "game-2.json"), records.GameRecord)
    assert shown.saved


def test_a_game_that_cannot_be_saved_continues(shown, tmp_path, monkeypatch):
    monkeypatch.setattr("billiards_env.play.window._OTHER_FOLDERS", ())
    (tmp_path / "game.json").mkdir()
    press(shown, pygame.K_SPACE, pygame.K_SPACE, pygame.K_q, pygame.K_s)
    assert (shown.open, shown.message.startswith("not saved: ")) == (True, True)
    press(shown, pygame.K_LEFT)
    assert shown.message == ""


def test_the_window_handles_keys_while_a_program_thinks(window, monkeypatch):
    may_play, calls = threading.Event(), []
    monkeypatch.setattr("billiards_env.play.window.game_observation", lambda setup, game, max_speed: max_speed)

    def player(situation, rng):
        setup, game = situation.find_game()
        calls.append((setup, game.positions.tolist(), situation.observation))
        situation.watch(PLANS)
        while not may_play.is_set():
            time.sleep(0.01)
        return Stroke((0.3, 0.4))

    shown = window(programs=(None, player), players=("human", "program"))
    press(shown, pygame.K_LEFT, pygame.K_SPACE, pygame.K_SPACE, pygame.K_h)
    model, work = shown.model, shown._work
    assert (model.phase, model.page, model.game.state.player) == ("thinking", "keys", 1)
    while not shown.model.considered:
        shown.frame()
    assert [one.plan for one in shown.model.considered] == PLANS
    press(shown, pygame.K_h, pygame.K_u)
    assert (shown.model.phase, shown.model.strokes) == ("aiming", ())
    assert "SystemExit" in repr(work.exception(20.0))  # the thread was stopped
    press(shown, pygame.K_SPACE, pygame.K_SPACE, pygame.K_q)
    assert shown.asking
    press(shown, pygame.K_c)
    assert (shown.open, shown.asking) == (True, False)
    may_play.set()
    assert think(shown).strokes == (*model.strokes, Stroke((0.3, 0.4)))
    assert calls == 2 * [(model.setup, model.game.positions.tolist(), 8.0)]
    may_play.clear()
    press(shown, pygame.K_SPACE, pygame.K_SPACE, pygame.K_SPACE)
    work = shown._work
    shown.close()
    assert "SystemExit" in repr(work.exception(20.0))


def test_a_shot_is_replayed_while_a_program_thinks(window):
    shown = window(programs=(None, lambda *_: Stroke((0.3, 0.4))), players=("human", "program"))
    press(shown, pygame.K_LEFT, pygame.K_SPACE, pygame.K_SPACE)
    press(shown, pygame.K_r)
    assert shown._work.result(10.0) == Stroke((0.3, 0.4))
    press(shown)
    assert (shown.model.phase, len(shown.model.strokes)) == ("replaying", 1)
    press(shown, pygame.K_SPACE)
    press(shown)
    assert (shown.model.phase, len(shown.model.strokes)) == ("rolling", 2)


@pytest.mark.parametrize("noise", [(0.0, 0.0), (1.0, 0.2)])
def test_the_planner_shows_its_shot_without_errors_before_it_plays_it(noise, window, monkeypatch):
    stroke, intent = Stroke((0.3, 0.4)), "billiards_env.play.window.INTENT"
    monkeypatch.setattr(intent, np.inf)
    shown = window(programs=(LevelPlayer(lambda *_: stroke, noise), None), players=("planner:club", "human"))
    while shown.model.preview is None:
        shown.frame()
    shown.frame()
    assert (shown.model.phase, shown.model.strokes) == ("thinking", ())
    np.testing.assert_allclose(shown.model.stroke.velocity, stroke.velocity)
    monkeypatch.setattr(intent, 0.01)
    error = np.hypot(*np.subtract(think(shown).strokes[0].velocity, stroke.velocity))
    assert 0.0 < error < 1.0 if any(noise) else error == 0.0


def test_a_thread_that_compiles_is_not_stopped():
    may_end = threading.Event()

    def spin():
        while not may_end.is_set():
            pass
        return 5

    in_numba = types.FunctionType(spin.__code__, {"__name__": "numba.core.compiler"}, closure=spin.__closure__)
    works: Any = [_Work(function) for function in (in_numba, spin)]
    for work in works:
        work.stop()
    assert isinstance(works[1].exception(20.0), SystemExit)
    may_end.set()
    assert works[0].result(20.0) == 5
