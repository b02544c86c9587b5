import re
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("pygame")

from billiards_env import Scene, simulate
from billiards_env.engine.modes import MODES
from billiards_env.games import RULES, Stroke, records
from billiards_env.play import window as windows
from billiards_env.play.__main__ import MAKERS, compile_engines, main, make_history, make_parser
from billiards_env.play.model import HUMAN, go, shoot
from billiards_env.players.strategies import STRATEGIES

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
    return opened


@pytest.fixture
def saved(make_model, tmp_path):
    """A saved game."""
    model = shoot(make_model(positions=BALLS), Stroke((1.0, 0.3)))
    records.save(tmp_path / "saved.json", records.record_game(model.history))
    return tmp_path / "saved.json", go(model)


def history(*arguments, seed=0):
    return make_history(make_parser().parse_args(arguments), np.random.default_rng(seed))


def test_the_default_game():
    setup = history().setup
    assert (setup.rules, setup.n_players, setup.mode, setup.scene.n_balls) == ("eight_ball", 2, "pic", 16)


def test_arguments_describe_the_game():
    given = history("--rules", "straight", "--balls", "3", "--target", "2", "--players", "human,random,random")
    assert (given.setup.scene.n_balls, given.setup.target, given.setup.n_players) == (4, 2, 3)
    pit = history("--rules", "carom", "--mode", "pit", "--dt", "1/240").setup
    assert (pit.mode, pit.dt, pit.scene) == ("pit", 1 / 240, Scene.named("carom"))
    assert history("--layout", "random").opening.state.in_hand == "no"


def test_the_seed_determines_the_rack():
    one, two, other = (history(seed=seed).opening.positions for seed in (1, 1, 2))
    assert (one == two).all()
    assert (one != other).any()


def test_a_window_is_opened(frames, capsys):
    main(["--rules", "nine_ball", "--players", "human,random", "--max-speed", "3", "--speed", "0.5", "--seed", "1"])
    (shown,) = frames
    assert shown.count == 3
    assert (shown.model.max_speed, shown.model.pace, shown.model.players) == (3.0, 0.5, ("human", "random"))
    assert shown.ask
    assert "saved" not in capsys.readouterr().out


def test_a_saved_game_is_continued_and_saved_again(frames, saved, tmp_path, capsys):
    path, model = saved
    main(["--load", str(path), "--players", "human,human", "--save", str(tmp_path / "again.json")])
    (shown,) = frames
    assert not shown.ask
    assert shown.model.strokes == model.strokes
    assert (shown.model.game.positions == model.game.positions).all()
    assert capsys.readouterr().out.endswith(f"\nsaved to {tmp_path / 'again.json'}\n")
    assert records.load(tmp_path / "again.json") == records.load(path)


def test_spaces_between_players_are_ignored(frames):
    main(["--players", "human, geometric", "--seed", "1"])
    assert len(frames) > 0


@pytest.mark.parametrize("dt", [1 / 60, 1 / 240])
def test_the_engines_are_compiled_before_the_window_opens(monkeypatch, dt):
    used = []
    monkeypatch.setattr(
        "billiards_env.play.__main__.simulate", lambda *args, mode, dt, **kwargs: used.append((mode, dt))
    )
    compile_engines(Scene.named("carom"), dt)
    assert used == [("pic", None), ("pit", dt)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
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
        (["--load", "SAVED", "--players", "human,human,human"], "players = human, human, human: expected 2"),
        (["--load", "SHOT"], "holds a shot: expected a game"),
        (["--width", "3"], "width = 3"),
        (["--seed", "-3"], "--seed = -3: expected a whole number >= 0"),
    ],
)
def test_errors_are_one_line(arguments, message, frames, saved, tmp_path):
    shot = tmp_path / "shot.json"
    simulate(Scene.named("pool"), BALLS[:2], [1.0, 0.0], record=True).save(shot)
    given = [str({"SAVED": saved[0], "SHOT": shot}.get(a, a)) for a in arguments]
    with pytest.raises(SystemExit, match=message) as caught:
        main(given)
    assert str(caught.value).startswith("error: ")
    assert frames == []


@pytest.mark.parametrize("text", ["0", "-1", "inf", "nan", "1/0", "fast"])
@pytest.mark.parametrize("option", ["dt", "max_speed", "speed"])
def test_impossible_numbers_are_rejected(option, text, frames):
    with pytest.raises(SystemExit, match=rf"^error: {option} = .*: expected ") as caught:
        main(["--rules", "carom", f"--{option.replace('_', '-')}={text}"])
    assert text.strip("-") in str(caught.value)
    assert frames == []


def test_help_lists_the_values_of_each_option(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    shown = set(re.findall(r"\w+", capsys.readouterr().out))
    layouts = {name for rules in RULES.values() for name in rules.layouts}
    assert {*RULES, *layouts, *MODES, *STRATEGIES, *MAKERS, HUMAN} <= shown


def test_without_pygame_the_error_names_the_package_to_install():
    code = (
        "import sys; sys.modules['pygame'] = None\n"
        "from billiards_env.play.__main__ import main\n"
        "main(['--rules', 'carom'])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("error: pygame is not installed")
    assert "pip install 'billiards-env[render]'" in done.stderr
