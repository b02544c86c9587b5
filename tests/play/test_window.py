"""The window, driven by mouse and keyboard events on a dummy display."""

import itertools
import math
import re
import signal
import threading
import types
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pygame")

import pygame

from billiards_env import Engine, Scene, simulate
from billiards_env.drawing.canvas import Canvas, pixels
from billiards_env.drawing.pace import slower
from billiards_env.games import Stroke, records
from billiards_env.play import labels
from billiards_env.play import model as act
from billiards_env.play.model import change_pace, go, repeat, shoot, tick, toggle, turn_aim
from billiards_env.play.panel import place_controls
from billiards_env.play.view import View, _row
from billiards_env.play.window import COMMANDS, GameWindow, _Work
from billiards_env.players.levels import LevelPlayer
from billiards_env.players.named import find_player
from billiards_env.players.planner import Plan

BALLS = [[-0.4, 0.0], [0.4, 0.0], [0.4, 0.5]]
SHIFT = pygame.KMOD_LSHIFT


@pytest.fixture
def window(tmp_path):
    """A function that opens a window for a model."""
    windows = []

    def make(model, players=(None, None)):
        windows.append(GameWindow(model, players, np.random.default_rng(0), tmp_path / "game.json", 320))
        pygame.event.clear()
        return windows[-1]

    yield make
    for one in windows:
        one.close()


def post(kind, **fields):
    pygame.event.post(pygame.event.Event(kind, **fields))


@pytest.fixture
def shown(make_model, window):
    """A window with the first turn of a game."""
    return window(make_model(positions=BALLS))


def think(shown):
    """Shows frames until the program or the hint has ended."""
    while shown.model.phase == "thinking" or shown._work is not None:
        shown.frame()
    return shown.model


def press(shown, *keys, mod=0):
    for key in keys:
        post(pygame.KEYDOWN, key=key, mod=mod, unicode="")
    return pixels(shown.frame())


def view_of(shown):
    return getattr(shown, "_view", shown)


def at(shown, point):
    return tuple(np.round(view_of(shown).pixels_of(point)).astype(int).tolist())


def click(shown, point):
    press_mouse(shown, at(shown, point))


def press_mouse(shown, *pixels):
    """Drags the mouse with its left button over pixels; a click has one."""
    post(pygame.MOUSEBUTTONDOWN, pos=pixels[0], button=1)
    for pixel in pixels[1:]:
        post(pygame.MOUSEMOTION, pos=pixel, rel=(0, 0), buttons=(1, 0, 0))
    post(pygame.MOUSEBUTTONUP, pos=pixels[-1], button=1)
    shown.frame()


def click_on(shown, control, across=0.5, down=0.5):
    """Clicks on a control of the window, at shares of its width and height."""
    box = shown._view.panel.places[control]
    press_mouse(shown, (round(box.x + across * box.width), round(box.y + down * box.height)))


def drag(shown, *points):
    press_mouse(shown, *(at(shown, point) for point in points))


def state(model):
    """Returns what the keys change."""
    return model.phase, model.aim, model.page, model.pace, model.zoom, model.ghost, model.strokes


def test_each_key_does_its_action_in_each_phase(make_model, window):
    placing = make_model("nine_ball")
    aiming, rolling = go(placing), go(go(placing))
    shown = window(placing)
    commands = [(key, *command) for key, command in COMMANDS.items() if callable(command[0])]
    for start, mod, (key, action, *arguments) in itertools.product(
        (placing, aiming, rolling, repeat(rolling)), (0, SHIFT), commands
    ):
        shown.model, held = start, pygame.KMOD_LCTRL * key.startswith("ctrl ")
        press(shown, pygame.key.key_code(key.removeprefix("ctrl ")), mod=mod | held)
        arguments = [0.1 * one if mod and isinstance(one, float) else one for one in arguments]
        assert state(shown.model) == state(action(start, *arguments)), key
    shown.model = aiming
    press(shown, pygame.K_LEFT, pygame.K_UP)
    press(shown, pygame.K_RIGHT, pygame.K_UP, mod=SHIFT)
    assert math.degrees(shown.model.aim.angle - aiming.aim.angle) == pytest.approx(1.0 - 0.1)
    assert shown.model.aim.speed == pytest.approx(aiming.aim.speed + 0.1 + 0.01)
    shown.model = rolling
    press(shown, pygame.K_q)
    assert shown.asking


def test_a_shot_by_mouse(shown):
    drag(shown, BALLS[0], (0.0, 0.0), (-0.1, 0.3))
    model = shown.model
    assert model.phase == "aiming"
    assert model.aim.angle == pytest.approx(math.pi / 4, abs=0.03)
    assert 0.09 * model.aim.speed + 1.4 * 0.028575 == pytest.approx(0.3 * math.sqrt(2), abs=0.01)
    drag(shown, (-0.1, 0.3), (0.0, 0.0))  # at the tip of the arrow
    assert shown.model.aim.angle == pytest.approx(0.0, abs=0.03)
    speed = shown.model.aim.speed
    click(shown, (0.8, -0.4))  # aims, and does not shoot
    assert shown.model.aim.angle == pytest.approx(math.atan2(-0.4, 1.2), abs=0.02)
    assert (shown.model.phase, shown.model.aim.speed) == ("aiming", speed)
    expected = shown.model.stroke
    click(shown, (0.0, 0.72))  # next to the table
    assert shown.model.stroke == expected
    click_on(shown, "shoot")
    assert shown.model.strokes == (expected,)
    assert shown.model.phase == "rolling"
    click(shown, (0.8, -0.4))
    assert shown.model.phase == "aiming"


@pytest.mark.parametrize(("width", "height"), [(1280, 900), (320, 240), (401, 777), (900, 300)])
def test_controls_do_not_overlap(width, height):
    row = pygame.Rect(5, 400, width - 10, _row((width, height)))
    boxes = place_controls(row).values()
    assert all(row.contains(box) for box in boxes)
    assert all(one.right <= two.x for one, two in itertools.combinations(boxes, 2))


def test_the_controls_set_the_tip_the_elevation_and_the_speed(shown):
    plain = press(shown)
    click_on(shown, "ball", 0.65, 0.6)  # right of the centre and below it
    side, top = shown.model.aim.tip
    assert (side, top) == pytest.approx((-0.3, -0.2), abs=0.06)
    click_on(shown, "elevation", 0.5, 0.5)
    assert shown.model.aim.elevation == pytest.approx(45.0, abs=3.0)
    click_on(shown, "speed", 0.75, 0.5)
    assert shown.model.aim.speed == pytest.approx(0.75 * 8.0, abs=0.2)
    assert shown.model.strokes == ()
    assert shown.model.stroke.spin[2] > 0  # a hit on the right turns the ball counterclockwise
    assert (press(shown) != plain).any()
    click_on(shown, "ball", 1.0, 0.5)
    assert math.hypot(*shown.model.aim.tip) < shown.model.setup.scene.cue.miscue_offset
    click_on(shown, "ball", 1.0, 0.5)  # the second click of a double click
    assert (shown.model.aim.tip, shown.model.aim.elevation) == ((0.0, 0.0), 0.0)


def test_a_stroke_that_noise_makes_faster_than_the_fastest_shot_is_shown(make_model):
    model = make_model(positions=BALLS)
    view, scales = View(model.setup.scene, 320), []
    box = view.panel.places["speed"]
    for speed in (4.0, 8.0, 8.5):
        frame = pixels(view.draw(shoot(model, Stroke((speed, 0.0)))))
        scales.append(frame[box.top : box.bottom, box.left : box.right])
    assert (scales[2] == scales[1]).all()
    assert (scales[1] != scales[0]).any()


def test_the_called_ball_and_pocket_are_shown(make_model):
    model = make_model(positions=BALLS, call_shot=True)
    view = View(model.setup.scene, 320)
    plain = pixels(view.draw(model)).copy()
    assert (pixels(view.draw(act.next_called(act.next_called(model, "ball"), "pocket"))) != plain).any()


def test_fine_aim(shown):
    press(shown, pygame.K_COMMA)
    press(shown, pygame.K_PERIOD, mod=SHIFT)
    assert math.degrees(shown.model.aim.angle) == pytest.approx(0.01 - 0.001)
    angle, speed = shown.model.aim.angle, shown.model.aim.speed
    plain = press(shown)
    zoomed = press(shown, pygame.K_f)
    post(pygame.MOUSEWHEEL, x=0, y=2)
    shown.frame()
    assert math.degrees(shown.model.aim.angle - angle) == pytest.approx(0.02)
    assert shown.model.aim.speed == speed
    # The enlarged ball is in a corner; a click there aims at the enlarged point.
    rect, enlarged = shown._view._inset
    assert (zoomed != plain)[rect.top : rect.bottom, rect.left : rect.right].mean() > 0.1
    x, y = np.round(enlarged.pixels_of(BALLS[1]) + rect.topleft).astype(int).tolist()
    assert (np.abs(zoomed[y - 20 : y + 20, x - 20 : x + 20].astype(int) - YELLOW).max(axis=2) < 25).any()
    press_mouse(shown, (x, y + 8))
    below = BALLS[1][1] - 8 / enlarged.scale
    assert shown.model.aim.angle == pytest.approx(math.atan2(below, 0.8), abs=1e-3)
    press(shown, pygame.K_f)
    assert shown._view._inset is None


def hint(shown, point):
    """Points at a place and presses A, until the window has an answer."""
    post(pygame.MOUSEMOTION, pos=at(shown, point), rel=(0, 0), buttons=(0, 0, 0))
    press(shown, pygame.K_a)
    return think(shown)


def test_shift_and_the_key_aim_for_the_best_shot(shown, monkeypatch):
    monkeypatch.setattr("billiards_env.play.window.HINT_TIME", 0.05)
    for _ in range(2):  # the first search may spend its time on compilation
        press(shown, pygame.K_a, mod=SHIFT)
        assert shown.message == "thinking"
        think(shown)
    assert shown.model.phase == "aiming"
    assert re.fullmatch(r"ball \S+ into the \w+ \w+ pocket, \d+% with the noise of a good player", shown.message)
    assert shot_of(shown.model).potted.any()


def shot_of(model) -> Any:
    """Returns the aimed shot."""
    return go(model).last_shot.shot  # pyright: ignore[reportOptionalMemberAccess]


def test_the_key_has_no_aim_help_for_flights(make_model, window):
    shown = window(make_model(positions=BALLS, scene=Scene.named("jump_pool", 2)))
    assert hint(shown, BALLS[2]).phase == "aiming"
    assert shown.message == "no aim help for flights"
    press(shown, pygame.K_a, mod=SHIFT)  # the planner needs no derivatives
    assert think(shown).phase == "aiming"
    assert shown.message != "thinking"


def test_a_key_aims_at_the_ball_and_the_pocket_under_the_mouse(shown):
    pocket = shown.model.setup.scene.table.pockets[3]
    model = hint(shown, BALLS[2])
    assert model.preview.ball == 2
    assert shot_of(model).potted.tolist() == [False, False, True]
    model = hint(shown, (pocket.x - 0.01, pocket.y))  # of the ball that is aimed at
    assert shot_of(model).positions[2].tolist() == [pocket.x, pocket.y]
    assert hint(shown, (-0.9, -0.4)) is model
    assert shown.message == "point at a ball or a pocket"


def test_the_texts_of_snooker_do_not_overlap_the_tray(make_model, monkeypatch):
    model = make_model("snooker")
    view, trays = View(model.setup.scene, 640), []
    draw = Canvas.draw_tray
    monkeypatch.setattr(Canvas, "draw_tray", lambda *args: trays.append(draw(*args)) or trays[-1])
    frames = []
    for text in ("", "foul and a miss: wrong ball hit first, 7 points   104 : 96 " * 2):
        monkeypatch.setattr("billiards_env.play.labels.result", lambda _, text=text: text)
        monkeypatch.setattr("billiards_env.play.labels.status", lambda _, text=text: text)
        frames.append(pixels(view.draw(model)))
    (x, y), (width, height) = np.add(trays[0].topleft, view._place.topleft), trays[0].size
    assert (frames[0][y : y + height, x : x + width] == frames[1][y : y + height, x : x + width]).all()
    for side in (slice(0, x), slice(x + width, None)):
        assert (frames[0][y : y + height, side] != frames[1][y : y + height, side]).any()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_closes_the_window_without_a_question(number, shown, monkeypatch):
    press(shown, pygame.K_SPACE, pygame.K_SPACE)
    before = signal.getsignal(number)
    monkeypatch.setattr(shown, "frame", lambda: signal.raise_signal(number))
    shown.run()
    assert (shown.open, shown.asking, shown.interrupted, shown.saved) == (False, False, True, False)
    assert signal.getsignal(number) is before


def test_pages_cover_the_table(shown):
    plain = press(shown)
    cloth = plain[100, 100]
    rules = press(shown, pygame.K_F1)
    assert not (rules == cloth).all(axis=2).any()
    assert (press(shown, pygame.K_h) != rules).any()
    post(pygame.KEYDOWN, key=pygame.K_SLASH, mod=SHIFT, unicode="?")
    assert (pixels(shown.frame()) == rules).all()
    assert (press(shown, pygame.K_ESCAPE) == plain).all()
    press(shown, pygame.K_h, pygame.K_SPACE)
    assert (shown.open, shown.model.page, shown.model.phase) == (True, "", "aiming")


def test_a_new_game_starts_after_the_end(make_model, window):
    model = make_model("straight", [[0.97, 0.335], [1.07, 0.435], [-0.5, 0.0]], target=1)
    shown = window(model)
    press(shown, pygame.K_n)
    assert shown.model is model  # the game is not over
    end = press(shown, pygame.K_SPACE, pygame.K_SPACE)
    assert shown.model.phase == "over"
    assert (pixels(shown._view.canvas.table)[40:80, 100:220] != end[40:80, 100:220]).any()  # the result is shown
    click(shown, (0.0, 0.0))
    assert shown.model.phase == "over"
    click_on(shown, "shoot")
    assert shown.model.strokes == ()
    assert shown.model.phase in ("aiming", "placing")


def test_the_mouse_places_the_cue_ball_in_hand(make_model, window):
    shown = window(make_model(positions=BALLS, state={"in_hand": "anywhere"}))
    post(pygame.MOUSEMOTION, pos=at(shown, (0.6, -0.3)), rel=(0, 0), buttons=(0, 0, 0))
    shown.frame()
    assert shown.model.cue_position == pytest.approx((0.6, -0.3), abs=0.01)
    click(shown, (0.6, -0.3))
    assert shown.model.phase == "aiming"
    post(pygame.MOUSEWHEEL, x=0, y=3)
    shown.frame()
    assert shown.model.aim.speed == pytest.approx(2.3)


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
    press(shown)
    drawn = []
    draw = View.draw
    monkeypatch.setattr(View, "draw", lambda *args: drawn.append(args) or draw(*args))
    for _ in range(3):
        press(shown)
    assert drawn == []
    press(shown, pygame.K_LEFT)
    assert len(drawn) == 1
    post(pygame.VIDEOEXPOSE)
    press(shown)
    assert len(drawn) == 2


@pytest.mark.parametrize("size", [(320, 500), (640, 400), (900, 300), (401, 777)])
def test_the_table_fits_a_window_of_any_size(size, shown):
    pygame.display.set_mode(size, pygame.RESIZABLE)
    frame = press(shown)
    assert frame.shape == (size[1], size[0], 3)
    corners = np.array([shown._view.pixels_of((1.27 * x, 0.635 * y)) for x in (-1, 1) for y in (-1, 1)])
    assert (corners > 0).all()
    assert (corners < size).all()
    assert lit(frame, shown, BALLS[1], YELLOW)
    drag(shown, BALLS[0], (-0.1, 0.3))
    assert shown.model.aim.angle == pytest.approx(math.pi / 4, abs=0.05)
    assert press(shown, pygame.K_h).shape == (size[1], size[0], 3)


def test_the_pace_changes_without_drawing_the_shot_again(make_model, window, monkeypatch):
    model: Any = go(make_model(positions=BALLS))
    view = View(model.setup.scene, 320)
    view.draw(tick(model, 0.5))
    starts = []
    monkeypatch.setattr(View, "_start_paths", lambda *_: starts.append(1))
    frame = pixels(view.draw(change_pace(tick(model, 0.51), slower)))
    assert starts == []
    assert lit(frame, view, model.last_shot.shot.at(0.51)[0], WHITE)


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
    press(shown, pygame.K_s)
    assert (shown.open, shown.message.startswith("not saved: ")) == (True, True)
    press(shown, pygame.K_LEFT)
    assert shown.message == ""
    press(shown, pygame.K_SPACE, pygame.K_SPACE, pygame.K_q, pygame.K_s)
    assert (shown.open, shown.message.startswith("not saved: ")) == (True, True)


def test_the_window_handles_keys_while_a_program_thinks(make_model, window, monkeypatch):
    may_play, calls = threading.Event(), []
    monkeypatch.setattr("billiards_env.play.window.game_observation", lambda setup, game, max_speed: max_speed)

    def player(situation, rng):
        setup, game = situation.find_game()
        calls.append((setup, game.positions.tolist(), situation.observation))
        may_play.wait()
        return Stroke((0.3, 0.4))

    shown = window(make_model(positions=BALLS, players=("human", "program")), (None, player))
    press(shown, pygame.K_LEFT, pygame.K_SPACE, pygame.K_SPACE, pygame.K_h)
    first, model = shown.model.strokes, shown.model
    assert (model.phase, model.page, model.game.state.player) == ("thinking", "keys", 1)
    press(shown, pygame.K_h, pygame.K_u)
    assert (shown.model.phase, shown.model.strokes) == ("aiming", ())
    press(shown, pygame.K_SPACE, pygame.K_SPACE, pygame.K_q)
    assert shown.asking
    press(shown, pygame.K_c)
    assert (shown.open, shown.asking) == (True, False)
    may_play.set()
    assert think(shown).strokes == (*first, Stroke((0.3, 0.4)))
    assert calls == 2 * [(model.setup, model.game.positions.tolist(), 8.0)]


def test_a_shot_is_replayed_while_a_program_thinks(make_model, window):
    shown = window(make_model(positions=BALLS, players=("human", "program")), (None, lambda *_: Stroke((0.3, 0.4))))
    press(shown, pygame.K_LEFT, pygame.K_SPACE, pygame.K_SPACE)
    press(shown, pygame.K_r)
    work: Any = shown._work
    assert work.result(10.0) == Stroke((0.3, 0.4))
    press(shown)
    assert (shown.model.phase, len(shown.model.strokes)) == ("replaying", 1)
    press(shown, pygame.K_SPACE)
    press(shown)
    assert (shown.model.phase, len(shown.model.strokes)) == ("rolling", 2)


@pytest.mark.parametrize(
    ("name", "noise"), [("planner:1s", None), ("planner:club", (1.0, 0.2))], ids=["planner", "level"]
)
def test_the_planner_shows_its_shot_without_errors_before_it_plays_it(name, noise, make_model, window, monkeypatch):
    stroke, intent = Stroke((0.3, 0.4)), "billiards_env.play.window.INTENT"
    player = LevelPlayer(lambda *_: stroke, noise or (0.0, 0.0))
    monkeypatch.setattr(intent, np.inf)
    shown = window(make_model(positions=BALLS, players=(name, "human")), (player, None))
    plain = pixels(shown.frame()).copy()
    while shown.model.preview is None:
        shown.frame()
    assert (pixels(shown.frame()) != plain).any()
    assert (shown.model.phase, shown.model.strokes) == ("thinking", ())
    np.testing.assert_allclose(shown.model.stroke.velocity, stroke.velocity)
    monkeypatch.setattr(intent, 0.01)
    played = think(shown).strokes
    error = np.hypot(*np.subtract(played[0].velocity, stroke.velocity))
    assert 0.0 < error < 1.0 if noise else played == (stroke,)


def test_a_planner_that_thinks_does_not_hold_the_window_up(make_model, window):
    model = make_model(positions=BALLS, players=("planner:60s", "human"))
    shown = window(model, (find_player("planner:60s", model.setup), None))
    for _ in range(10):
        shown.frame()
    assert shown.model.phase == "thinking"
    work: Any = shown._work
    thread = work._thread
    assert thread.is_alive()
    post(pygame.QUIT)
    shown.run()
    assert not shown.open
    thread.join(20.0)
    assert not thread.is_alive()


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


def test_the_window_shows_the_shots_that_a_program_considers(make_model, window):
    may_play, leave = threading.Event(), np.zeros((3, 2))
    plans = [Plan(Stroke((2.0, speed)), 0.31, 0.62, ball, 2, leave, 40) for speed, ball in ((0.0, 1), (2.0, 2))]

    def player(situation, rng):
        situation.watch((plans[1],))
        situation.watch((plans[0],))
        may_play.wait()
        return plans[0].stroke

    shown = window(make_model(positions=BALLS, players=("program", "human")), (player, None))
    frame = plain = press(shown)
    while not shown.model.considered:
        frame = press(shown)
    assert (frame != plain).any()
    assert shown.model.considered[0].plan is plans[0]
    assert labels.key_hint(shown.model).endswith("pocket, 62%, value +0.31 in 40 strokes with noise")
    only = shown.model
    both = act.consider(act.consider(only, plans[1:]), plans[:1])
    assert [one.plan for one in both.considered] == plans
    assert (pixels(shown._view.draw(both)) != frame).any()
    may_play.set()
    assert think(shown).considered == ()
    assert act.consider(shown.model, plans) is shown.model


def lit(frame, shown, point, colour):
    """Returns whether a frame has a colour near a point; edges are smoothed."""
    x, y = at(shown, point)
    patch = frame[y - 4 : y + 5, x - 4 : x + 5].reshape(-1, 3).astype(int)  # larger than the number in the middle
    return bool((np.abs(patch - colour).max(axis=1) < 15).any())


WHITE, YELLOW = (255, 255, 255), (246, 199, 20)


def test_the_ghost_is_visible_in_a_replay(make_model):
    model = tick(repeat(go(go(turn_aim(make_model(positions=BALLS), 1.0)))), 3.0)
    view = View(model.setup.scene, 640)
    with_ghost = pixels(view.draw(model))
    without = pixels(view.draw(toggle(model, "ghost")))
    pit = simulate(model.setup.scene, BALLS, model.strokes[0].velocity, engine=Engine("pit", 1 / 60), record=True)
    comparison = pit.at(3.0)
    differ = (with_ghost != without).any(axis=2)
    x, y = np.round(view.canvas.pixels_of(comparison[1])).astype(int)
    assert differ[y - 12 : y + 13, x - 12 : x + 13].any()
    assert (pixels(view.draw(model)) == with_ghost).all()  # the film starts again


def test_a_ball_in_the_air_is_drawn_at_its_height(make_model, monkeypatch):
    model, drawn = make_model(positions=BALLS, scene=Scene.named("jump_pool", 2)), []
    model = tick(go(act.raise_cue(turn_aim(model, 20.0), 40.0)), 0.05)
    monkeypatch.setattr(Canvas, "draw_balls", lambda *arguments: drawn.append(arguments[5]))
    View(model.setup.scene, 320).draw(model)
    assert drawn[-1][0] > 0.01
    assert not drawn[-1][1:].any()
