"""What was computed before an error is kept: a job that fails stops no other one, and results are written first."""

import json
from concurrent.futures import ThreadPoolExecutor

import pytest

from benchmarks import run_command
from billiards_env import __main__ as command
from billiards_env.bench import benchmark
from billiards_env.support.commands import all_jobs

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
