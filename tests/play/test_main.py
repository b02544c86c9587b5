import re
import signal
import threading
import time
from pathlib import Path
from typing import Any
from unittest.mock import Mock

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

BALLS = [[-0.4, 0.0], [0.4, 0.0], [0.4, 0.5]]


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
    """A saved game."""
    model = shoot(make_model(positions=BALLS), Stroke((1.0, 0.3)))
    records.save(tmp_path / "saved.json", records.record_game(model.history))
    return tmp_path / "saved.json", go(model)


def history(*arguments, seed=0):
    return make_history(make_parser().parse_args(arguments), np.random.default_rng(seed))


def test_the_default_games():
    setup = history().setup
    assert (setup.rules, setup.n_players, setup.engine, setup.scene.n_balls) == ("eight_ball", 2, PIC, 16)
    scenes = {"eight_ball": "real_pool", "one_pocket": "real_pool", "blackball": "uk_pool", "snooker": "snooker"}
    for rules, scene in scenes.items():
        setup = history("--rules", rules).setup
        assert setup.scene == Scene.named(scene, setup.scene.n_balls - 1)
    assert history("--scene", "uk_pool").setup.scene == Scene.named("uk_pool")


def test_arguments_describe_the_game():
    parsed = history("--rules", "straight", "--balls", "3", "--target", "2", "--players", "human, random,random")
    assert (parsed.setup.scene.n_balls, parsed.setup.target, parsed.setup.n_players) == (4, 2, 3)
    pit = history("--rules", "carom", "--mode", "pit", "--dt", "1/240").setup
    assert (pit.engine, pit.scene) == (Engine("pit", 1 / 240), Scene.named("carom"))
    assert history("--layout", "random").opening.state.in_hand == 0
    assert history("--rules", "straight", "--call-shot").setup.call_shot
    assert history("--rules", "snooker", "--choices", "--miss").setup.miss


def test_a_person_plays_against_the_planner_by_default(frames):
    main(["--rules", "carom"])
    (shown,) = frames
    assert shown.model.players == ("human", "planner:club")


def test_the_seed_determines_the_rack():
    one, two, other = (history(seed=seed).opening.positions for seed in (1, 1, 2))
    assert (one == two).all()
    assert (one != other).any()


def test_a_window_is_opened(frames, capsys):
    options = ["--max-speed", "3", "--speed", "0.5", "--choices"]
    main(["--rules", "nine_ball", "--scene", "pool", "--players", "human,random", *options])
    (shown,) = frames
    assert shown.count == 3
    assert (shown.model.max_speed, shown.model.pace, shown.model.players) == (3.0, 0.5, ("human", "random"))
    assert (shown.ask, shown.model.choices) == (True, True)
    assert shown._view.canvas.looks == looks(Scene.named("pool", 9), "realistic")
    assert "saved" not in capsys.readouterr().out


FAULTS = [
    (lambda: signal.raise_signal(signal.SIGTERM), SystemExit, "130"),
    (Mock(side_effect=RuntimeError("the window broke")), RuntimeError, "the window broke"),
    (Mock(side_effect=KeyError("player")), KeyError, "player"),
]


@pytest.mark.parametrize(("fault", "kind", "message"), FAULTS)
@pytest.mark.parametrize(("options", "file"), [(["--save", "mine.json"], "mine.json"), ([], "game-2.json")])
def test_a_signal_and_an_error_save_the_game(fault, kind, message, options, file, monkeypatch, tmp_path, capsys):
    def frame(self):
        self.model = go(self.model)
        fault()

    monkeypatch.setattr(windows.GameWindow, "frame", frame)
    monkeypatch.chdir(tmp_path)
    Path("game.json").write_text("another game")
    with pytest.raises(kind, match=message):
        main(["--rules", "carom", *options])
    saved: Any = records.load(Path(file))
    assert len(saved.strokes) == 1
    assert Path("game.json").read_text() == "another game"
    assert capsys.readouterr().out.endswith(f"saved to {file}\n")


def test_a_player_of_ones_own_that_fails_saves_the_game(monkeypatch, tmp_path):
    (tmp_path / "failing.py").write_text(
        "def maker(argument):\n    def act(situation, rng):\n        raise KeyError('mine')\n    return act\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(KeyError, match="mine"):
        main(["--rules", "carom", "--players", "failing:maker,human", "--save", str(tmp_path / "game.json")])
    assert isinstance(records.load(tmp_path / "game.json"), records.GameRecord)


def test_a_window_with_a_text_is_open_while_the_engine_is_compiled(monkeypatch, frames):
    release, shown = threading.Event(), []

    def show(self, frame):
        shown.append(frame.get_size())
        if len(shown) == 3:
            release.set()

    monkeypatch.setattr("billiards_env.play.__main__.compile_engines", lambda scene, dt: release.wait(60))
    monkeypatch.setattr("billiards_env.drawing.window.Screen.show", show)
    main(["--rules", "carom", "--width", "600"])
    assert shown[:3] == 3 * [(600, 400)]
    assert len(frames) == 1
    monkeypatch.setattr("billiards_env.play.__main__.compile_engines", lambda scene, dt: time.sleep(60))
    monkeypatch.setattr("pygame.event.get", lambda kind: [kind])
    with pytest.raises(SystemExit):
        main(["--rules", "carom"])
    assert len(frames) == 1


def test_without_a_display_there_is_no_window(monkeypatch, frames):
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)
    monkeypatch.setattr("pygame.display.init", lambda: None)
    monkeypatch.setattr("pygame.display.get_driver", lambda: "offscreen")
    message = "display = 'offscreen': expected one that shows a window"
    with pytest.raises(SystemExit, match=f"^error: {message}"):
        main(["--rules", "carom"])
    assert frames == []


def test_a_saved_game_is_continued_and_saved_again(frames, saved, tmp_path, capsys):
    path, model = saved
    main(["--load", str(path), "--players", "human,human", "--save", str(tmp_path / "again.json")])
    (shown,) = frames
    assert not shown.ask
    assert shown.model.strokes == model.strokes
    assert (shown.model.game.positions == model.game.positions).all()
    assert capsys.readouterr().out.endswith(f"\nsaved to {tmp_path / 'again.json'}\n")
    assert records.load(tmp_path / "again.json") == records.load(path)


@pytest.mark.parametrize("dt", [1 / 60, 1 / 240])
def test_the_engines_are_compiled_before_the_window_opens(monkeypatch, dt):
    used = []
    monkeypatch.setattr("billiards_env.play.__main__.simulate", lambda *args, engine, record: used.append(engine))
    compile_engines(Scene.named("carom"), dt)
    assert used == [PIC, Engine("pit", dt)]


ERRORS = [
    (["--players", "human"], "players = human: expected 2"),
    (["--players", "human,nobody"], "player = 'nobody'"),
    (["--players", "humn,human"], r"player = 'humn': expected one of .*'human'.* \(did you mean 'human'\?\)"),
    (["--rules", "nine_bal"], r"rules = 'nine_bal': expected one of .* \(did you mean 'nine_ball'\?\)"),
    (["--mode", "pti"], r"mode = 'pti': expected one of 'pic', 'pit' \(did you mean 'pit'\?\)"),
    (["--mode", "pit", "--dt", "abc"], "dt = 'abc' with mode='pit': expected the timestep, a number from"),
    (["--rules", "nine_ball", "--balls", "3"], "with a scene of 3 object balls: expected 9"),
    (["--rules", "carom", "--layout", "rack"], "layout = 'rack'"),
    (["--load", "nothing.json"], "nothing.json"),
    (["--load", "SAVED", "--rules", "carom"], "--rules with --load"),
    (["--load", "SAVED", "--call-shot"], "--call-shot with --load"),
    (["--load", "SAVED", "--target", "0"], "--target with --load"),
    (["--rules", "carom", "--call-shot"], "call_shot = True with rules 'carom': expected False"),
    (["--rules", "snooker", "--miss"], "--miss without --choices"),
    (["--scene", "real_pol"], r"scene = 'real_pol': .* \(did you mean 'real_pool'\?\)"),
    (["--rules", "carom", "--palette", "realist"], "palette = 'realist': expected one of 'colour_blind'"),
    (["--load", "SHOT"], "holds a shot: expected a game"),
    (["--scene", "pool", "--width", "3"], "width = 3"),
    (["--seed", "-3"], "--seed = -3: expected a whole number >= 0"),
    (["--save", "no/game.json"], "path = 'no/game.json': expected an existing folder"),
    (["--rules", "carom", "--dt", "0"], "^error: dt = 0.*: expected "),
    (["--rules", "carom", "--max-speed", "fast"], "^error: max_speed = 'fast': expected "),
    (["--rules", "carom", "--speed", "0"], "^error: speed = 0.*: expected "),
    (
        ["--scene", "jump_pool", "--players", "human,aim"],
        r"^error: physics\.flight = True with player = 'aim': ",
    ),
]


@pytest.mark.parametrize(("arguments", "message"), ERRORS)
def test_errors_are_one_line(arguments, message, frames, saved, tmp_path):
    shot = tmp_path / "shot.json"
    simulate(Scene.named("pool"), BALLS[:2], [1.0, 0.0], record=True).save(shot)
    argv = [str({"SAVED": saved[0], "SHOT": shot}.get(a, a)) for a in arguments]
    with pytest.raises(SystemExit, match=message) as caught:
        main(argv)
    assert str(caught.value).startswith("error: ")
    assert frames == []


def test_help_lists_the_values_of_each_option(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    shown = set(re.findall(r"\w+", capsys.readouterr().out))
    layouts = {name for rules in GAMES.values() for name in rules.layouts}
    assert {*GAMES, *layouts, *MODES, *PLAYERS, *SCENES, *PALETTES, HUMAN} <= shown
