import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from billiards_env import Scene, doctor, simulate, strike
from billiards_env.__main__ import main
from billiards_env.bench.published import HASHES
from billiards_env.engine.compile import MODES
from billiards_env.engine.overlaps import FIXES
from billiards_env.games import History, Setup, Stroke, custom_opening, opening, records
from billiards_env.jit.folders import versions_hash
from billiards_env.scene import SCENES
from billiards_env.scene.layouts import LAYOUTS
from billiards_env.shots import records as shot_records

PIT_SHOT = ["--scene", "pool", "--mode", "pit", "--dt", "1/60"]
SHOT = ["simulate", "--positions", "-0.635", "0", "0.635", "0.3", "--velocity", "2", "0.45"]


def lines(capsys, *arguments):
    main(arguments)
    return capsys.readouterr().out.splitlines()


def test_the_overview_lists_the_commands(capsys):
    printed = "\n".join(lines(capsys))
    for command in ("play", "simulate", "replay", "calibrate", "web", "doctor", "cache"):
        assert re.search(rf"\n    {command}\s", printed)


def test_the_console_script_is_the_module():
    pyproject = (Path(__file__).parents[1] / "pyproject.toml").read_text()
    assert '\n[project.scripts]\nbilliards = "billiards_env.__main__:main"\n' in pyproject


def test_simulate_prints_the_result_and_writes_a_page_and_a_record(capsys, tmp_path):
    page, record = tmp_path / "shot.html", tmp_path / "shot.json"
    first, *printed = lines(capsys, *SHOT, "--out", str(page), "--out", str(record))
    assert first == "ShotResult: 2 balls, rest after 4.521 s, 8 events"
    assert printed[0] == "  balls potted: 1"
    assert printed[-2:] == [f"wrote {page}", f"wrote {record}"]
    assert page.read_text().startswith("<!doctype html>")
    again = lines(capsys, "replay", str(record), "--out", str(tmp_path / "again.html"))
    assert again[:-1] == [first, *printed[:-2]]
    assert (tmp_path / "again.html").read_text() == page.read_text()


FORMATS = [("png", "matplotlib", b"\x89PNG"), ("svg", "matplotlib", b"<?xml"), ("gif", "pygame", b"GIF8")]


@pytest.mark.parametrize(("suffix", "module", "start"), FORMATS)
def test_the_suffix_selects_the_format(suffix, module, start, tmp_path):
    pytest.importorskip(module)
    path = tmp_path / f"shot.{suffix}"
    main(["simulate", "--max-time", "1/10", "--out", str(path)])
    assert path.read_bytes().startswith(start)


def test_simulate_aims_at_ball_1_and_draws_a_layout(capsys):
    first, _, hit, *_ = lines(capsys, "simulate", "--balls", "3", "--seed", "4", *PIT_SHOT)
    assert first.startswith("ShotResult: 4 balls, rest after ")
    assert hit.startswith("  first hit: ball ")
    assert lines(capsys, "simulate", "--balls", "0")[2] == "  first hit: none"


def test_simulate_aims_at_goals(capsys):
    places = ["--scene", "pool", "--positions", "-0.6", "0", "0.6", "0.3"]
    note, *shot = lines(capsys, "simulate", *places, "--goal", "bank:1:4", "--goal", "leave:0.3:0.2:0.2")
    assert note.endswith(": the goals are reached")
    assert lines(capsys, "simulate", *places, *note.partition(":")[0].split()) == shot


def test_simulate_strikes_the_cue_ball_with_a_cue(capsys, tmp_path):
    path = tmp_path / "shot.json"
    places = ["--positions", "-0.635", "0", "0.635", "0.3"]
    stroke = ["--speed", "2", "--heading", "30", "--side", "0.2", "--top", "-0.25", "--elevation", "5"]
    line, *_ = lines(capsys, "simulate", *places, *stroke, "--out", str(path))
    assert (
        line
        == "stroke: 2 m/s, heading 30 degrees (0.5236 rad), side 0.2 R, top -0.25 R, elevation 5 degrees (0.08727 rad)"
    )
    expected = strike("real_pool", 2.0, np.pi / 6, 0.2, -0.25, np.pi / 36)
    shot = shot_records.load(path)
    assert list(shot.velocities[0]) == pytest.approx(expected.velocity.tolist(), rel=1e-15)
    assert shot.spins is not None
    assert list(shot.spins[0]) == pytest.approx(expected.spin.tolist(), rel=1e-15)
    towards = lines(capsys, "simulate", *places, "--speed", "2", "--side", "0.9")
    assert towards[1] == "the tip slips on the ball: a miscue"


def test_simulate_warns_about_english_that_throws_nothing_and_about_a_speed_that_no_cue_gives(capsys):
    smooth = "the balls of this scene have no friction: english throws no ball, unlike in --scene real_pool"
    fast = "the cue ball begins at 59.1 m/s: a break is 10 to 12 m/s"
    english = ["simulate", "--max-time", "0.1", "--speed", "2", "--side", "0.3"]
    assert smooth in lines(capsys, *english, "--scene", "pool")
    assert smooth in lines(capsys, *SHOT, "--scene", "pool", "--spin", "0", "0", "9")
    assert smooth not in lines(capsys, *english)
    assert smooth not in lines(capsys, *english, "--scene", "pool", "--side", "0")
    assert fast in lines(capsys, *english[:3], "--speed", "45")
    assert not any("a break" in line for line in lines(capsys, *english[:3], "--speed", "12"))


@pytest.fixture
def game(tmp_path):
    setup = Setup("nine_ball", Scene.named("pool", 9))
    strokes = (Stroke((6.0, 0.1), (-0.8, 0.0)), Stroke((1.0, 0.0), (-0.8, 0.3)))
    history = History(setup, opening(setup, np.random.default_rng(0)), strokes)
    records.save(tmp_path / "game.json", records.record_game(history))
    return str(tmp_path / "game.json")


def test_a_number_may_be_negative_in_each_form(capsys):
    printed = []
    for velocity in ("-2 -0.45", "-2e0 -4.5e-1", "-.2e1 -9/20"):
        main(["simulate", "--velocity", *velocity.split(), "--spin", "-1e1", "-1/3", "-.5"])
        printed.append(capsys.readouterr().out)
    assert len(set(printed)) == 1


def test_replay_counts_players_from_1(capsys, tmp_path):
    setup = Setup("straight", Scene.named("pool", 1), target=1)
    game = custom_opening(setup, [[0.97, 0.335], [1.07, 0.435]])
    records.save(tmp_path / "game.json", records.record_game(History(setup, game, (Stroke((0.7, 0.7)),))))
    assert lines(capsys, "replay", str(tmp_path / "game.json"))[0].endswith("won by player 1")


def test_replay_lists_as_potted_what_fell_in_the_shot(capsys, tmp_path):
    setup = Setup("straight", Scene.named("pool", 2))
    game = custom_opening(setup, [[0.97, 0.335], [1.07, 0.435], [-0.5, 0.0]])
    strokes = Stroke((0.7, 0.7)), Stroke((0.1, 0.0))
    records.save(tmp_path / "game.json", records.record_game(History(setup, game, strokes)))
    _, _, *printed = lines(capsys, "replay", str(tmp_path / "game.json"))
    assert printed[:2] == ["  balls potted: none", "  balls not in play: 1"]
    assert printed[printed.index("final positions, m") + 2] == "  ball 1  not in play"


def test_replay_of_a_game_prints_its_state_and_a_shot(capsys, game, tmp_path):
    state, shot, *_ = lines(capsys, "replay", game, "--shot", "1", "--out", str(tmp_path / "break.html"))
    assert state == "nine_ball, 2 players, 2 shots, scores [0, 0], not over"
    assert shot.startswith("ShotResult: 10 balls")
    assert (tmp_path / "break.html").exists()
    assert lines(capsys, "replay", game)[1] != shot
    with pytest.raises(SystemExit, match="--shot = 3: expected a number from 1 to 2"):
        main(["replay", game, "--shot", "3"])


def test_replay_in_a_window(monkeypatch, game):
    pytest.importorskip("pygame")
    shown = []
    monkeypatch.setattr("billiards_env.drawing.window.Window.show", lambda self, frame, fps: shown.append(fps))
    main(["replay", game, "--window"])
    assert len(shown) > 60


@pytest.fixture
def page(tmp_path, monkeypatch):
    monkeypatch.setattr("billiards_env.__main__.PLAY_PAGE", tmp_path / "play.html")
    (tmp_path / "play.html").write_text("<!doctype html>")
    return tmp_path / "play.html"


def test_web_opens_the_page_or_writes_it(capsys, monkeypatch, page, tmp_path):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda address: not opened.append(address))
    assert lines(capsys, "web") == opened == [page.as_uri()]
    copy = tmp_path / "copy.html"
    assert lines(capsys, "web", "--out", str(copy)) == [f"wrote {copy}"]
    assert copy.read_bytes() == page.read_bytes()
    assert len(opened) == 1


def test_web_without_a_page_or_a_browser_is_an_error(monkeypatch, page):
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    with pytest.raises(SystemExit, match="error: browser = None: expected one that the module webbrowser finds"):
        main(["web"])
    with pytest.raises(SystemExit, match=r"error: path = 'x\.htm': expected a name that ends in '\.html'"):
        main(["web", "--out", "x.htm"])
    page.unlink()
    with pytest.raises(SystemExit, match=r"error: page = '.*play\.html': expected a file; 'make page' in a clone"):
        main(["web"])


def test_play_gets_its_arguments(monkeypatch):
    pytest.importorskip("pygame")
    calls = []
    monkeypatch.setattr("billiards_env.play.__main__.main", calls.append)
    main(["play", "--rules", "carom", "--players", "human,human"])
    assert calls == [["--rules", "carom", "--players", "human,human"]]


def test_doctor_prints_versions_and_caches_and_compares_shots(capsys, monkeypatch):
    monkeypatch.setattr(doctor, "IDS", ("Pot1-v0", "Carom-v0"))
    *facts, pot, carom, verdict = lines(capsys, "doctor")
    values = dict(re.split(r"\s{2,}", line, maxsplit=1) for line in facts)
    assert {"billiards-env", "python", "numpy", "numba", "llvmlite", "gymnasium", "processor"} <= set(values)
    assert values["cache"].endswith(" MB, can be written")
    assert values["compiler"].startswith("works, ")
    assert all(re.fullmatch(r"(Pot1|Carom)-v0 +the same bits, \d+\.\d s", line) for line in (pot, carom))
    assert verdict == "the same bits as the published results"


def test_doctor_reports_other_bits_and_a_task_that_fails(capsys, monkeypatch):
    monkeypatch.setitem(HASHES, "Carom-v0", "0" * 16)
    monkeypatch.setattr(doctor, "IDS", ("Pot1-v0", "Carom-v0"))
    with pytest.raises(SystemExit, match="1"):
        main(["doctor"])
    *_, carom, verdict = capsys.readouterr().out.splitlines()
    assert re.search(r"other bits, [0-9a-f]{16} and not 0{16}", carom)
    assert verdict == "other bits than the published results: Carom-v0"
    monkeypatch.setattr(doctor, "IDS", ("Pot2-v0", "Pot1-v0"))
    with pytest.raises(SystemExit, match=r"error: .*Pot2"):
        main(["doctor"])
    assert "\nPot1-v0 " in capsys.readouterr().out


def test_cache_shows_and_clears_the_compiled_code(capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder, old = tmp_path / f"kernels-{versions_hash()}", tmp_path / ("kernels-" + "0" * 16)
    for each in (folder, old, tmp_path / "kernels-of-others"):
        each.mkdir()
        (each / "code.nbc").write_bytes(bytes(1_500_000))
    assert sorted(lines(capsys, "cache")) == sorted(
        [f"{folder}: 1 files, 1.5 MB", f"{old}: 1 files, 1.5 MB, of another version"]
    )
    lines(capsys, "cache", "--clear")
    assert [path.name for path in tmp_path.iterdir()] == ["kernels-of-others"]


def test_simulate_prints_the_positions_and_the_events_and_writes_the_motion(capsys, tmp_path):
    path = tmp_path / "shot.csv"
    printed = lines(capsys, *SHOT, "--out", str(path))
    assert printed[printed.index("final positions, m") + 1].startswith("  ball 0  (")
    assert printed[printed.index("final positions, m") + 2] == "  ball 1  potted"
    assert re.fullmatch(r"   0\.802\d{3} s  ball 0 hits ball 1", next(line for line in printed if "hits ball" in line))
    shot = simulate("real_pool", [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True)
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    assert path.read_text().splitlines()[0] == "time,ball,x,y,vx,vy,wx,wy,wz"
    assert (rows[0] == [0, 0, -0.635, 0.0, 2.0, 0.45, 0, 0, 0]).all()
    assert (rows[-2] == [shot.time, 0, *shot.positions[0], 0, 0, 0, 0, 0]).all()


def test_a_scene_can_be_a_file(capsys, tmp_path):
    """Also the report of a calibration and a saved shot, which hold a scene."""
    scene, report = tmp_path / "scene.json", tmp_path / "report.json"
    data = {"base": "real_pool", "physics": {"mu_roll": 0.02}}
    scene.write_text(json.dumps(data))
    report.write_text(json.dumps({"values": {}, "scene": Scene.from_dict(data).to_dict()}))
    first, *_ = lines(capsys, *SHOT)
    assert lines(capsys, *SHOT, "--scene", str(scene)) == lines(capsys, *SHOT, "--scene", str(report))
    assert lines(capsys, *SHOT, "--scene", str(scene))[0] != first
    lines(capsys, "evaluate", "random", "--beside", "--episodes", "2", "--scene", str(scene))
    with pytest.raises(SystemExit, match="expected no number, the file lists the balls"):
        main(["simulate", "--scene", str(scene), "--balls", "3"])


def test_a_wrong_player_is_an_error_before_the_first_one_plays(capsys):
    with pytest.raises(SystemExit, match="player = 'serch:9': expected one of"):
        main(["evaluate", "random", "--beside", "serch:9", "--episodes", "1"])
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "command",
    [
        "evaluate random --beside aim --task jump",
        "match random aim --rules nine_ball --scene jump_pool",
        "simulate --goal pot:1 --scene jump_pool",
        "bench aim --tasks Jump-v0",
    ],
)
def test_a_player_that_needs_derivatives_is_refused_before_a_shot_with_flights(command, capsys):
    message = r"error: physics\.flight = True with .*aim'?: expected False or .*'search.*\(flights have no d"
    with pytest.raises(SystemExit, match=message):
        main(command.split())
    assert capsys.readouterr().out == ""


def test_ctrl_c_is_one_line(capsys, monkeypatch):
    def interrupt():
        raise KeyboardInterrupt

    monkeypatch.setattr("platform.platform", interrupt)
    with pytest.raises(SystemExit, match="130"):
        main(["doctor"])
    assert capsys.readouterr().err == "\ninterrupted\n"


def test_the_motion_of_a_flight_has_heights(capsys, tmp_path):
    path, cue = tmp_path / "jump.csv", ["--scene", "jump_pool", "--speed", "4", "--elevation", "40"]
    lines(capsys, "simulate", "--positions", "-0.635", "0", "0.635", "0.3", *cue, "--out", str(path))
    assert path.read_text().startswith("time,ball,x,y,z,vx,vy,vz,wx,wy,wz\n")
    time, z, vz = np.loadtxt(path, delimiter=",", skiprows=1)[::2, [0, 4, 7]].T
    assert (z[0], z.max() > 0.1, vz.max() > 1.0) == (0.0, True, True)
    in_air = (z[:-1] > 0.01) & (z[1:] > 0.01) & (np.diff(vz) < 0)
    assert np.diff(vz)[in_air] == pytest.approx(-9.81 * np.diff(time)[in_air], abs=1e-9)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has other pipes")
def test_a_closed_pipe_does_not_lose_the_file(tmp_path):
    """Also if the output has no buffer, and a line comes before the result."""
    command = f"{shlex.quote(sys.executable)} -u -m billiards_env simulate --speed 2 --side 0.9 --max-time 0.1"
    subprocess.run(["bash", "-c", f"{command} --out {shlex.quote(str(tmp_path / 'shot.csv'))} | true"], check=True)
    assert (tmp_path / "shot.csv").read_text().startswith("time,ball,x,y,vx")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has other pipes")
def test_a_closed_pipe_is_silent():
    line = f"{shlex.quote(sys.executable)} -m billiards_env doctor | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (141, "")


def test_cache_compiles_what_is_named(capsys):
    pool, derivatives, *_ = lines(capsys, "cache", "pool", "derivatives")
    assert re.fullmatch(r"pool: \d+\.\d s", pool)
    assert re.fullmatch(r"derivatives: \d+\.\d s", derivatives)


ERRORS = [
    ("simulate --mode pit --dt 0.1 --fix push", "fix = 'push': expected one of 'push_apart', "),
    ("simulate --max-time abc", "max_time = 'abc': expected a number, not str"),
    ("simulate --velocity 2 fast", "velocities = [2.0, 'fast']: expected finite numbers in an array"),
    ("simulate --side 0.3", "--side without --speed: expected the speed of the cue"),
    ("simulate --speed 2 --spin 0 0 9", "--speed with --velocity or --spin: expected the motion"),
    ("simulate --speed 2 --heading east", "--heading = 'east': expected a number, not str"),
    ("simulate --speed -1", "--speed = -1.0: expected a number from 0 to 1000 m/s"),
    ("simulate --max-time nan", "max_time = nan: expected a number from 0 to 1e+12 s"),
    ("simulate --speed 2 --heading 900", "--heading = 900.0: expected a number from -360 to 360 degrees"),
    ("simulate --speed 2 --elevation 100", "--elevation = 100.0: expected a number from 0 to 90 degrees"),
    ("cache pol", "part = 'pol': expected one of 'pool', "),
    ("simulate --scene no.json", "path = 'no.json': expected a file of a scene, but it does not exist"),
    ("simulate --scene pol", "scene = 'pol': expected one of 'pool', "),
    ("simulate --seed -3", "--seed = -3: expected a whole number >= 0"),
    ("simulate --positions 0 0", "--positions with 2 numbers: expected 4, x and y of 2 balls"),
    ("simulate --out shot.txt", "--out = 'shot.txt': expected a name that ends in one of .html .png"),
    ("simulate --out no/shot.png", "path = 'no/shot.png': expected an existing folder"),
    ("replay no.json", "path = 'no.json': expected a file of a shot or a game, but it does not exist"),
    ("replay .", "path = '.': expected a file of a shot or a game, but it is a folder"),
    ("replay shot.json --out copy.json", "--out = 'copy.json': expected a name that ends in"),
    ("bench random --tasks Pot-v0", "task = 'Pot-v0': expected one of 'Pot1-v0'"),
    ("bench random --seed -1", "seed = -1: expected a whole number"),
    ("bench random --noise-seed -1", "noise_seed = -1: expected a whole number"),
    ("bench random --name <b>", "player = '<b>': expected 1 to 80 letters"),
    ("bench random --out x.txt", "path = 'x.txt': expected a name that ends in '.json'"),
    ("bench random x.json", "file = 'x.json' after a player: expected the word verify"),
    ("bench random --again random", "--again = 'random' without verify: expected bench verify FILE --again PLAYER"),
    ("bench verify", "bench verify without a file"),
    ("bench verify no.json", "path = 'no.json': expected a file of a benchmark, but it does not exist"),
    ("simulate --goal pott:1", "goal = 'pott': expected one of 'pot'"),
    ("simulate --goal pot:1:x", "goal = 'pot:1:x': expected numbers, as in 'pot:1:3'"),
    ("simulate --goal leave:1", "goal = 'leave:1': expected numbers"),
    ("simulate --goal pot:1 --speed 2", "--goal with --speed: expected only one of them"),
    ("match random", "player = random: expected at least two players"),
    ("match random random", "player = random random: expected at least two players, each once"),
    ("match random aim --rules carm", "rules = 'carm': expected one of"),
    ("match random aim --games 0", "--games = 0: expected a whole number from 1"),
    ("evaluate nobody:nothing --beside", "player = 'nobody:nothing': "),
    ("evaluate random --task pott --beside", "task = 'pott': expected one of 'pot'"),
    ("evaluate random --episodes 0 --beside", "--episodes = 0: expected a whole number from 1 to 10000000"),
    ("evaluate random --noise 1 x --beside", "--noise[1] = 'x': expected a number, not str"),
    ("evaluate random --noise nan 0 --beside", "--noise[0] = nan: expected a number from 0 to 360 degrees"),
]


@pytest.mark.parametrize(("command", "message"), ERRORS)
def test_errors_are_one_line(command, message):
    with pytest.raises(SystemExit) as exit:
        main(command.split())
    assert isinstance(exit.value.code, str)
    assert exit.value.code.startswith(f"error: {message}")
    assert "\n" not in exit.value.code


def test_help_lists_the_values_of_each_option(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    shown = capsys.readouterr().out
    (layouts,) = re.findall(r"starting positions: (.*?) \(default", " ".join(shown.split()))
    assert re.split(", | or ", layouts) == list(LAYOUTS)
    assert {*SCENES, *MODES, *FIXES} <= set(re.findall(r"[\w.]*\w", shown))


def test_a_missing_extra_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib.axes", None)
    monkeypatch.delitem(sys.modules, "billiards_env.drawing.plot", raising=False)
    with pytest.raises(SystemExit, match=r"error: matplotlib is not installed: expected the extra 'plot': pip install"):
        main([*SHOT, "--out", str(tmp_path / "shot.png")])
    assert not (tmp_path / "shot.png").exists()


@pytest.mark.parametrize(
    "command", ["simulate --balls", "evaluate random --seed", "play --width", "bench random --seed"]
)
def test_a_text_in_place_of_a_whole_number_is_refused(command, capsys):
    with pytest.raises(SystemExit, match=r"^2$"):
        main([*command.split(), "1.5"])
    option = command.split()[-1]
    assert capsys.readouterr().err.endswith(f"error: argument {option}: '1.5': expected a whole number\n")


def test_unknown_options_are_refused(capsys):
    for arguments in (["simulate", "--spede", "2"], ["plya"]):
        with pytest.raises(SystemExit, match="2"):
            main(arguments)
        assert "error: " in capsys.readouterr().err
