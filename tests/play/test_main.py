import re
import signal
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from billiards_env.engine import PIC, Engine

pytest.importorskip("pygame")

from billiards_env import Scene, simulate
from billiards_env.drawing.style import PALETTES, looks
from billiards_env.engine.compile import MODES
from billiards_env.games import GAMES, Stroke, records
from billiards_env.play import window as windows
from billiards_env.play.__main__ import compile_engines, main, make_history, make_parser
from billiards_env.play.model import HUMAN, go, shoot
from billiards_env.players.named import PLAYERS
from billiards_env.scene import SCENES


@pytest.fixture
def frames(monkeypatch):
    """The windows that `main` opens; each is closed after three frames."""
    opened = []

    class Closing(windows.GameWindow):
        def __init__(self, *args):
            super().__init__(*args)
            opened.append(self)
            self.count = 0

        def frame(self):
            self.count += 1
            self.open = self.count < 3
            return super().frame()

    monkeypatch.setattr(windows, "GameWindow", Closing)
    monkeypatch.setattr("billiards_env.play.__main__.compile_engines", lambda scene, dt: None)
    return opened


@pytest.fixture
def saved(make_model, tmp_path):
    """The file of a saved game, and its model."""
    model = shoot(make_model(), Stroke((1.0, 0.3)))
    records.save(tmp_path / "saved.json", records.record_game(model.history))
    return tmp_path / "saved.json", go(model)


def setup_of(arguments):
    return make_history(make_parser().parse_args(arguments.split()), np.random.default_rng(0)).setup


def test_the_default_games():
    setup = setup_of("")
    assert (setup.rules, setup.n_players, setup.engine, setup.scene.n_balls) == ("eight_ball", 2, PIC, 16)
    scenes = {"eight_ball": "real_pool", "one_pocket": "real_pool", "blackball": "uk_pool", "snooker": "snooker"}
    for rules, scene in scenes.items():
        setup = setup_of(f"--rules {rules}")
        assert setup.scene == Scene.named(scene, setup.scene.n_balls - 1)


def test_arguments_describe_the_game():
    setup = setup_of("--rules straight --balls 3 --target 2 --call-shot --scene uk_pool --players human,random,random")
    assert (setup.scene, setup.target, setup.n_players, setup.call_shot) == (Scene.named("uk_pool", 3), 2, 3, True)
    pit = setup_of("--rules carom --mode pit --dt 1/240")
    assert (pit.engine, pit.scene) == (Engine("pit", 1 / 240), Scene.named("carom"))
    assert setup_of("--rules snooker --choices --miss").miss


def test_a_window_is_opened(frames, capsys):
    for seed in ("1", "1", "2"):
        main(["--rules", "carom", "--layout", "random", "--seed", seed])
    options = ["--max-speed", "3", "--speed", "0.5", "--choices", "--palette", "colour_blind"]
    main(["--rules", "nine_ball", "--scene", "pool", "--players", "human, random", *options])
    one, two, other, shown = frames
    assert one.model.players == ("human", "planner:club")
    assert (one.model.opening.positions == two.model.opening.positions).all()
    assert (one.model.opening.positions != other.model.opening.positions).any()
    assert (shown.model.max_speed, shown.model.pace, shown.model.players) == (3.0, 0.5, ("human", "random"))
    assert (shown.count, shown.ask, shown.model.choices) == (3, True, True)
    assert shown._view.canvas.looks == looks(Scene.named("pool", 9), "colour_blind")
    assert "saved" not in capsys.readouterr().out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_saves_the_game_without_a_question(number, monkeypatch, tmp_path, capsys):
    def frame(self):
        self.model = go(self.model)
        signal.raise_signal(number)

    before = signal.getsignal(number)
    monkeypatch.setattr(windows.GameWindow, "frame", frame)
    monkeypatch.chdir(tmp_path)
    Path("game.json").write_text("another game")
    with pytest.raises(SystemExit, match="130"):
        main(["--rules", "carom"])
    saved: Any = records.load("game-2.json")
    assert (len(saved.strokes), Path("game.json").read_text()) == (1, "another game")
    assert capsys.readouterr().out.endswith("saved to game-2.json\n")
    assert signal.getsignal(number) is before


@pytest.mark.parametrize(("options", "file"), [(["--save", "mine.json"], "mine.json"), ([], "game.json")])
def test_a_player_that_fails_saves_the_game(options, file, monkeypatch, tmp_path, capsys):
    def maker(argument):
        strokes = [Stroke((1.0, 0.3))]
        return lambda situation, rng: strokes.pop()

    monkeypatch.setitem(sys.modules, "mine", SimpleNamespace(maker=maker))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(IndexError, match="pop from empty list"):
        main(["--rules", "carom", "--players", "mine:maker,mine:maker", "--speed", "1000", *options])
    saved: Any = records.load(file)
    assert len(saved.strokes) == 2
    assert capsys.readouterr().out.endswith(f"saved to {file}\n")


def test_a_window_with_a_text_is_open_while_the_engine_is_compiled(monkeypatch, frames):
    release, shown = threading.Event(), []

    def show(self, frame):
        shown.append(frame.get_size())
        if len(shown) == 3:
            release.set()

    monkeypatch.setattr("billiards_env.play.__main__.compile_engines", lambda scene, dt: release.wait(60))
    monkeypatch.setattr("billiards_env.drawing.window.Screen.show", show)
    main(["--rules", "carom", "--width", "600"])
    assert (shown[:3], len(frames)) == (3 * [(600, 400)], 1)
    monkeypatch.setattr("billiards_env.play.__main__.compile_engines", lambda scene, dt: time.sleep(60))
    monkeypatch.setattr("pygame.event.get", lambda kind: [kind])
    with pytest.raises(SystemExit):
        main(["--rules", "carom"])
    assert len(frames) == 1


def test_without_a_display_there_is_no_window(monkeypatch, frames):
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)
    monkeypatch.setattr("pygame.display.init", lambda: None)
    monkeypatch.setattr("pygame.display.get_driver", lambda: "offscreen")
    with pytest.raises(SystemExit, match=r"^error: display = 'offscreen': expected one that shows a window"):
        main(["--rules", "carom"])
    assert frames == []


def test_a_saved_game_is_continued_and_saved_again(frames, saved, tmp_path, capsys):
    path, model = saved
    main(["--load", str(path), "--players", "human,human", "--save", str(tmp_path / "again.json")])
    (shown,) = frames
    assert (shown.ask, shown.model.strokes) == (False, model.strokes)
    assert (shown.model.game.positions == model.game.positions).all()
    assert capsys.readouterr().out.endswith(f"\nsaved to {tmp_path / 'again.json'}\n")
    assert records.load(tmp_path / "again.json") == records.load(path)


def test_the_engines_are_compiled_before_the_window_opens(monkeypatch):
    used = []
    monkeypatch.setattr("billiards_env.play.__main__.simulate", lambda *args, engine, record: used.append(engine))
    compile_engines(Scene.named("carom"), 1 / 240)
    assert used == [PIC, Engine("pit", 1 / 240)]


ERRORS = [
    ("--players humn,human", r"player = 'humn': expected one of .*'human'.* \(did you mean 'human'\?\)"),
    ("--scene jump_pool --players human,aim", r"physics\.flight = True with player = 'aim': "),
    ("--rules carom --palette realist", "palette = 'realist': expected one of 'colour_blind'"),
    ("--rules carom --speed 0", "speed = 0.*: expected "),
    ("--rules carom --width 3", "width = 3"),
    ("--seed -3", "--seed = -3: expected a whole number >= 0"),
    ("--save no/game.json", "path = 'no/game.json': expected an existing folder"),
    ("--load saved.json --target 0", "--target with --load"),
    ("--load saved.json --call-shot", "--call-shot with --load"),
    ("--load shot.json", "shot.json holds a shot: expected a game"),
    ("--rules snooker --miss", "--miss without --choices"),
]


@pytest.mark.parametrize(("arguments", "message"), ERRORS)
def test_errors_are_one_line(arguments, message, frames, saved, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulate(Scene.named("pool"), [[0.0, 0.0], [0.4, 0.0]], [1.0, 0.0], record=True).save("shot.json")
    with pytest.raises(SystemExit, match=f"^error: .*{message}"):
        main(arguments.split())
    assert frames == []


def test_help_lists_the_values_of_each_option(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    shown = set(re.findall(r"\w+", capsys.readouterr().out))
    layouts = {name for rules in GAMES.values() for name in rules.layouts}
    assert {*GAMES, *layouts, *MODES, *PLAYERS, *SCENES, *PALETTES, HUMAN} <= shown
