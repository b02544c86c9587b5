"""What was computed before an error is kept: a job that fails stops no other one, and results are written first."""

import contextlib
import importlib
import json
import re
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest

import benchmarks
from benchmarks import accuracy, gradients, run_command, simulators, speed, stress, validation, vector
from benchmarks.validation import motion
from billiards_env import __main__ as command
from billiards_env.bench import benchmark
from billiards_env.commands import all_jobs
from billiards_env.engine import PIC, Engine
from billiards_env.scene import Scene

DRIFTS = ["energy_drift", "momentum_drift", "deepest_overlap_m"]
FULL = OSError("the disk is full")


def fail(*_):
    raise FULL


def run(errors, done):
    """Runs a job for each error, or without one for None, and adds the names of those that end to `done`."""
    with all_jobs() as job:
        for name, error in errors.items():
            with job(name):
                if error is not None:
                    raise error
                done.append(name)


def test_a_job_that_fails_stops_no_other_one():
    done = []
    message = r"^one, two: the disk is full\nthree: KeyError: 'four' \(.*test_failures.py, line \d+\)$"
    with pytest.raises(RuntimeError, match=message):
        run({"one": FULL, "two": FULL, "three": KeyError("four"), "five": None}, done)
    assert done == ["five"]
    with pytest.raises(RuntimeError, match=r"^a, b, c, d, e, f, g, h and 2 more: the disk is full$"):
        run(dict.fromkeys("abcdefghij", FULL), done)
    with pytest.raises(BrokenPipeError):
        run({"one": BrokenPipeError(), "two": None}, done)
    assert done == ["five"]


def test_a_file_that_fails_stops_no_other_one(tmp_path, monkeypatch, capsys):
    page, record = tmp_path / "shot.html", tmp_path / "shot.json"
    monkeypatch.setitem(command.WRITERS, ".html", fail)
    with pytest.raises(SystemExit, match=r"^error: .*shot\.html: the disk is full$"):
        command.main(["simulate", "--max-time", "0.1", "--out", str(page), "--out", str(record)])
    assert "ShotResult: " in (printed := capsys.readouterr().out)
    assert printed.endswith(f"\nwrote {record}\n")
    assert record.exists()
    assert not page.exists()


@pytest.fixture
def breaking(tmp_path, monkeypatch):
    """A player of the user that raises an error in carom."""
    (tmp_path / "breaking.py").write_text(
        "def maker(argument):\n"
        "    def act(situation, rng):\n"
        "        return situation.stroke([0.5, [0.0][len(situation.observation) == 6]])\n"
        "    return act\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    return "breaking:maker"


def test_evaluate_measures_the_other_players(breaking, capsys):
    with pytest.raises(SystemExit, match=rf"^error: {breaking}: IndexError: .*breaking.py, line 3\)$"):
        command.main(["evaluate", breaking, "--task", "carom", "--beside", "random", "--episodes", "2"])
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["player", "random"]


def test_bench_prints_the_tasks_before_the_error(breaking, monkeypatch, capsys):
    monkeypatch.setattr(benchmark, "EPISODES", 2)
    with pytest.raises(SystemExit, match=r"^error: Carom-v0: IndexError"):
        command.main(["bench", breaking, "--tasks", "Pot1-v0,Carom-v0,Place-v0"])
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[:2]] == ["task", "Pot1-v0"]


def test_bench_verifies_the_other_files(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(benchmark, "EPISODES", 2)
    files = [tmp_path / "a.json", tmp_path / "b.json"]
    files[0].write_text("{}")
    benchmark.save(files[1], benchmark.play_tasks("random", ["Pot1-v0"]))
    with pytest.raises(SystemExit, match=r"^error: .*a\.json: "):
        command.main(["bench", "verify", *map(str, files)])
    assert capsys.readouterr().out.startswith(f"{files[1]}: accepted, random")


def run_measurement(tmp_path, measure):
    """Runs a command whose picture fails."""
    arguments = ["--output", str(tmp_path / "new" / "results.json"), "--images", str(tmp_path)]
    run_command("benchmarks.test", "", arguments, measure, lambda result: {}, {}, fail)


def test_results_are_written_before_pictures(tmp_path):
    with pytest.raises(SystemExit, match=r"^error: the disk is full"):
        run_measurement(tmp_path, lambda: {"rows": 2})
    assert json.loads((tmp_path / "new" / "results.json").read_text()) == {"rows": 2}


def failing_at(wrong, result):
    """Returns a function that fails if its first arguments are `wrong`, and else returns a result."""

    def work(*arguments, **_):
        return fail() if wrong == arguments[: len(wrong)] else result

    return work


ENGINES = [PIC, *(Engine("pit", 1 / 15, fix) for fix in ("push_apart", "move_back", "none"))]
SHOT = {"complete": True, "outcome_as_oracle": True, "errors": [1e-3] * 4}
COMPARED = {"error": 1e-15, "condition": 1.0, "ratio": 1.0, "same_events": True, "to_end": True, "events": 5}
CELL = [{"us": 1.0, "ratio": 1.0, "unfinished": 0, "compared": 1, "median_error_m": 1e-15}]
STARTED = {"seconds": {"start": 0.1, "compile": 1.0}, "modules": [], "functions": []}
GAS = {"passes": 1, "events_per_shot": 2.0, "us_per_shot": 3.0, "us_to_begin": 4.0}


def two_cases(scale):
    return [speed.random_shots(name, Scene.named("pool", 1), 4) for name in (speed.FIRST, "other")]


def failing_case(wrong, result):
    """Returns a function that fails for the case or row `wrong`, and else returns a result."""
    return lambda case, *_: fail() if case.name == wrong else result


FAILING = {
    "accuracy": (
        ["--shots", "4", "--outcomes", "10", "--passes", "1"],
        {
            "PIT": ENGINES[1:],
            "compare_outcomes": failing_at(("5 object balls",), {}),
            "follow_shot": failing_at(("carom",), SHOT),
            "seconds_per_shot": failing_at(("2 elastic disks",), {engine: [1.0] for engine in ENGINES}),
        },
        "2 elastic disks, carom, shot 0, carom, shot 1, carom, shot 2, carom, shot 3, 5 object balls",
        "shots of each scene",
    ),
    "calibration": (
        ["--repeats", "2"],
        {"fit_repeat": failing_at(("han2005", 1), {"values": {}, "intervals": {}, "problems": 1})},
        "han2005, shot 1",
        "In 3 of the 3 fits",
    ),
    "comparison": (
        ["--shots", "1"],
        {"compare": failing_at(("throw and jaws",), CELL)},
        "throw and jaws",
        "elastic disks",
    ),
    "error_limit": (
        ["--shots", "2"],
        {"compare": failing_at(("carom", 0), COMPARED)},
        "carom, shot 0",
        r"\| carom +\| +1 of 1 ",
    ),
    "speed": (
        ["--repeats", "2"],
        {
            "cases": two_cases,
            "time_batch": failing_case(speed.FIRST, (1.0, 0.5)),
            "time_calls": fail,
            "DISKS": (2, 16),
            "time_gas": failing_at((16,), {"disks": 2, **GAS}),
        },
        "pool, 1 object ball, calls, gas of 16 disks",
        r"\| other +\| +4 \|",
    ),
    "vector": (
        ["--repeats", "2"],
        {
            "environments": lambda scale: {vector.SINGLE: (1, lambda: fail), "native, 1": (1, lambda: int)},
            "outside_engine": lambda count, steps, **game: fail if game else float,
        },
        "outside the engine, nine ball, outside the engine, eight ball, single environment",
        r"\| native, 1 +\| +[\d,]+ \| +\|",
    ),
    "ablation": (
        ["--repeats", "2"],
        {
            "started": failing_case(
                "cushions with friction", contextlib.nullcontext(lambda *play: 1.0 if play else STARTED)
            )
        },
        "cushions with friction",
        r"\| throw +\| cushions with friction +\| 1000.00 \| +\| +1.0 \| +\| +100 \| +\| +\|",
    ),
    "gradients": (
        ["--repeats", "2"],
        {
            "cases": two_cases,
            "DRAWN": 4,
            "time_parts": failing_case("other", [1.0] * 4),
            "choose": lambda: {"numbers": [0], "smooth": 1, "other": dict.fromkeys(gradients.ENGINES, 0.0)},
            "errors_of": lambda _, engine: (
                fail() if engine is PIC else dict.fromkeys(("position", "small", "large"), 1.0)
            ),
        },
        "other, exact",
        r"\| exact engine +(\| +){7}\|",
    ),
    "validation": (
        [],
        {"PARTS": {"motion": motion, "pockets": SimpleNamespace(measure=fail)}},
        "pockets",
        "deceleration of a ball that rolls",
    ),
    "stress": (
        ["--scale", "1e-9"],
        {
            "families.check_family": failing_at(("wild",), {"shots": 1, "events": 5, "bad": []}),
            "drift": failing_at((16,), dict.fromkeys(["disks", "collisions", *DRIFTS], 2)),
        },
        "wild, seed 1000, elastic gas of 16 disks",
        "2 disks",
    ),
}
"""Commands: their arguments, what fails in them, the names in the error, and a pattern of the table of the rest."""


@pytest.mark.parametrize("command", FAILING)
def test_a_measurement_keeps_the_rows_that_are_finished(command, tmp_path, monkeypatch, capsys):
    arguments, parts, names, shown = FAILING[command]
    module = importlib.import_module(f"benchmarks.{command}")
    main = importlib.import_module("benchmarks.validation.__main__" if module is validation else module.__name__).main
    for path, value in parts.items():
        monkeypatch.setattr(f"benchmarks.{command}.{path}", value)
    for owner in (benchmarks, stress):
        monkeypatch.setattr(owner, "processes", ThreadPoolExecutor)
    monkeypatch.setattr(benchmarks, "workers", lambda: (1, ""))
    monkeypatch.setattr(simulators, "PYTHON", tmp_path / "python")
    if command == "accuracy":  # the times of the shots are finished, but no row
        (tmp_path / "results.json").write_text("earlier")
        with monkeypatch.context() as patch:
            patch.setattr(accuracy, "follow_shot", fail)
            with pytest.raises(SystemExit, match=r"^error: 2 elastic disks, .*: the disk is full$"):
                main([*arguments, "--output", str(tmp_path / "results.json")])
        assert (tmp_path / "results.json").read_text() == "earlier"
    with pytest.raises(SystemExit, match=rf"^error: {names}: the disk is full$"):
        main([*arguments, "--output", str(tmp_path / "results.json")])
    result = json.loads((tmp_path / "results.json").read_text())
    printed = capsys.readouterr().out
    assert re.search(shown, printed)
    assert all(block in printed for block in module.blocks(result).values())


def test_a_command_whose_jobs_all_fail_keeps_the_earlier_results(tmp_path, capsys):
    output = tmp_path / "results.json"
    output.write_text("earlier")

    def measure(job):
        for name in ("one", "two"):
            with job(name):
                fail()
        return {"rows": []}

    with pytest.raises(SystemExit, match=r"^error: one, two: the disk is full$"):
        run_command("benchmarks.test", "", ["--output", str(output)], measure, lambda result: {}, {}, jobs=True)
    assert output.read_text() == "earlier"
    assert capsys.readouterr().out == ""


def test_a_file_that_cannot_be_written_is_an_error_before_the_measurement(tmp_path):
    (tmp_path / "new" / "results.json").mkdir(parents=True)
    with pytest.raises(SystemExit, match=r"^error: path = .*results\.json': expected a file, not a folder"):
        run_measurement(tmp_path, lambda: pytest.fail("measured"))


def test_a_study_keeps_the_results_of_the_other_jobs(tmp_path):
    pytest.importorskip("stable_baselines3")
    pytest.importorskip("matplotlib")
    from studies import completed, fill

    output, jobs = tmp_path / "results.json", {("a", "one"): fail, ("a", "two"): lambda: 2}
    with pytest.raises(RuntimeError, match=r"^a, one: the disk is full$"):
        fill(output, {}, jobs)
    assert json.loads(output.read_text()) == {"a": {"two": 2}}
    with ThreadPoolExecutor(1) as pool:
        results = completed(pool, {(1, "a"): (fail,), (2, "a"): (int, "3")})
        assert next(results) == ((2, "a"), 3)
        with pytest.raises(RuntimeError, match=r"^\(1, 'a'\): the disk is full$"):
            next(results)
