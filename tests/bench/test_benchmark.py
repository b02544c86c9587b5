"""Files of the benchmark: a true file is accepted, any other one is refused with the reason."""

import base64
import json
import os
import re
import sys
import tracemalloc
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from billiards_env.__main__ import main
from billiards_env.bench import benchmark as bench
from billiards_env.bench.evaluation import evaluation_seeds
from billiards_env.bench.frozen import BENCH_TASKS, FROZEN, NAMESPACE
from billiards_env.envs.actions import perturb
from billiards_env.intervals import mean_interval
from billiards_env.players.env_player import acting
from billiards_env.players.named import find_player
from billiards_env.shots import records
from billiards_env.shots.noise import EXECUTION_NOISE

TASKS = ["Pot1Noise-v0", "Pot3-v0"]


@pytest.fixture(autouse=True)
def few_episodes(monkeypatch):
    monkeypatch.setattr(bench, "EPISODES", 12)


@cache
def text():
    return bench.to_json(bench.play_tasks("geometric", TASKS, (0, 5)))


@pytest.fixture
def played(tmp_path):
    """Returns a file with two tasks and two seeds."""
    path = tmp_path / "geometric.json"
    path.write_text(text())
    return path


def test_a_file_is_accepted_and_holds_the_outcomes_of_single_environments(played):
    entry = bench.verify(played)
    assert entry.player == "geometric"
    assert [(result.task, result.seed) for result in entry.results] == [(t, s) for t in TASKS for s in (0, 5)]
    for result in entry.results:
        env, k = gym.make(NAMESPACE + result.task), 0
        for episode, seed in enumerate(evaluation_seeds(result.seed, 12).tolist()):
            env.reset(seed=seed)
            total, over, info = 0.0, False, {}
            for _ in range(result.shots[episode]):
                _, reward, over, _, info = env.step(result.actions[k])
                total, k = total + float(reward), k + 1
            assert (over, total) == (True, result.returns[episode])
            assert info["is_success"] == result.success[episode]
    bench.save(played, bench.play_tasks("geometric", TASKS, (0, 5)))
    assert played.read_text() == text()


def test_who_knows_the_noise_can_subtract_it_but_not_that_of_another_seed():
    task = "Pot1Noise-v0"
    env, actions = gym.make(NAMESPACE + task), []
    act = acting(find_player("geometric", env), env)
    scales = np.array([EXECUTION_NOISE["angle_std"] / 180, EXECUTION_NOISE["speed_std"] / 4.0])
    for seed in evaluation_seeds(0, 12).tolist():
        noise = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,))).standard_normal(2) * scales
        actions.append(perturb(act(env.reset(seed=seed)[0]), -noise))
    chosen = bench.play_actions(task, 0, np.ones(12, np.uint8), np.array(actions, np.float32))
    others = bench.fresh(bench.Bench("foresight", (chosen,)), 1).results
    plain = bench.play_tasks("geometric", ["Pot1-v0"]).results[0]
    assert np.array_equal(chosen.success, plain.success)
    assert np.mean([other.success.mean() for other in others]) < plain.success.mean() - 0.1
    assert {other.layouts for other in others} == {chosen.layouts}
    assert len({other.digest for other in others}) == bench.DRAWS == 10
    scores = bench.score(others)
    shares = np.mean([other.success for other in others], axis=0)
    assert scores["success"] == pytest.approx(shares.mean())
    assert scores["success_interval"] == pytest.approx(mean_interval(shares.tolist()))  # over the layouts


def test_a_seed_of_the_noise_is_recorded_and_changes_only_the_noise(tmp_path, capsys):
    entry = bench.play_tasks("geometric", ["Pot1Noise-v0", "Pot3-v0", "Pot3Noise-v0"], noise_seed=2**40)
    noisy, plain, longer = entry.results
    assert [result.noise_seed for result in entry.results] == [2**40, None, 2**40]
    usual = bench.play_tasks("geometric", ["Pot1Noise-v0", "Pot3-v0"]).results
    assert bench.from_json(bench.to_json(entry)).results[0].noise_seed == 2**40
    assert plain.digest == usual[1].digest
    assert (noisy.layouts, (noisy.actions == usual[0].actions).all()) == (usual[0].layouts, True)
    assert noisy.digest != usual[0].digest
    bench.save(tmp_path / "a.json", entry)
    main(["bench", "verify", str(tmp_path / "a.json"), "--noise-seed", "3"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("a.json: accepted, geometric")
    assert lines[2].split()[:2] == ["Pot1Noise-v0", "0"]
    drawn = lines.index("the same actions, 10 draws of the noise from seed 3:")
    assert lines[drawn + 2].split()[:2] == ["Pot1Noise-v0", "0"]
    assert lines[-1].startswith("Pot3Noise-v0: replayed only, the player may have computed the noise beforehand")
    main(["bench", "verify", str(tmp_path / "a.json"), "--noise-seed", "3", "--again", "geometric"])
    lines = capsys.readouterr().out.splitlines()
    other = bench.play_tasks("geometric", ["Pot3Noise-v0"], noise_seed=3)
    assert "\n".join(lines).endswith(f"geometric plays again with the noise of seed 3:\n{bench.score_table(other)}")
    assert bench.fresh(entry, 3).results[0].digest != noisy.digest
    for player, tasks, message in (("nobody", entry.results, "player = 'nobody'"), ("random", (noisy,), "--again = ")):
        bench.save(tmp_path / "a.json", entry._replace(results=tasks))
        with pytest.raises(SystemExit, match=message):
            main(["bench", "verify", str(tmp_path / "a.json"), "--again", player])
        assert capsys.readouterr().out == ""
    assert longer.shots.max() > 1


def edit(change):
    """Returns a function that changes the data of a file."""

    def edited(text):
        data = json.loads(text)
        change(data)
        return json.dumps(data)

    return edited


def set_result(name, value, index=0):
    return edit(lambda data: data["results"][index].__setitem__(name, value))


def better(data):
    """Claims one more success."""
    one = data["results"][0]
    one["success"] = one["success"].replace("0", "1", 1)


def set_zero(text):
    """Changes the sign of a return of zero."""
    head, returns, tail = text.partition('"returns": [')
    return head + returns + re.sub(r"(?<![-\d.])0\.0\b", "-0.0", tail, count=1)


def nudge(data):
    """Changes the last bit of one action of an episode with several shots: the outcome may stay the same."""
    actions = bytearray(base64.b64decode(data["results"][2]["actions"]))
    actions[0] ^= 1
    data["results"][2]["actions"] = base64.b64encode(actions).decode()


def shift(data):
    """Moves a shot from one episode to the next one."""
    shots = bytearray(base64.b64decode(data["results"][2]["shots"]))
    many = shots.index(max(shots))
    shots[many] -= 1
    shots[shots.index(min(shots))] += 1
    data["results"][2]["shots"] = base64.b64encode(shots).decode()


NAN = base64.b64encode(np.full((12, 2), np.nan, "<f4").tobytes()).decode()
ZEROS = base64.b64encode(bytes(12)).decode()

HOSTILE = {
    "edited success": (edit(better), r"success\[\d+\] = True: expected False, the outcome of the actions"),
    "edited returns": (set_result("returns", [1.0] * 12), r"returns\[\d+\] = 1\.0: expected -?0\.\d*, the outcome"),
    "minus zero": (set_zero, r"returns\[\d+\] = -0\.0: expected 0\.0, the outcome of the actions"),
    "edited action": (edit(nudge), "Pot3-v0, seed 0: digest = .*: expected .*; the actions were changed"),
    "edited shots": (edit(shift), "episode .* of Pot3-v0 is (not )?over after . of its . shots"),
    "other layouts": (set_result("layouts", "0" * 64), "layouts = 0*: expected .*, those of the seed"),
    "other seed": (set_result("seed", 6), "layouts = .*: expected .*, those of the seed"),
    "other task": (set_result("task", "Pot1-v0"), "Pot1-v0, seed 0: .* expected"),
    "wrong digest": (set_result("digest", "0" * 64), "digest = 0*: expected"),
    "wrong hash": (set_result("digest", "0" * 63 + "\n"), r"results\[0\]\.digest = .*: expected 64 hexadecimal digits"),
    "truncated": (lambda text: text[:-200], "line .*: expected the JSON of a benchmark"),
    "foreign": (lambda text: '{"format": "billiards_env/shot"}', "format = 'billiards_env/shot': expected 'bill"),
    "newer": (edit(lambda data: data.update(version=99)), "version = 99: expected 2"),
    "deep": (lambda text: "[" * 100_000, "nested too deeply|expected the JSON of a benchmark"),
    "oversized": (lambda text: text + " " * records.MAX_BYTES, "a file of more than 4194304 bytes"),
    "NaN": (lambda text: text.replace('"returns": [', '"returns": [NaN, ', 1), "NaN: expected a finite number"),
    "infinite text": (lambda text: text.replace('"returns": [', '"returns": [1e999, ', 1), "expected a list of 12"),
    "huger number": (lambda text: text.replace('"seed": 5', '"seed": 1' + "0" * 9000), "geometric.json: "),
    "huge return": (set_result("returns", [10**400] * 12), r"results\[0\]\.returns\[0\] = .*: expected a finite"),
    "text return": (set_result("returns", ["1.0"] * 12), r"results\[0\]\.returns\[0\] = '1\.0': expected a number"),
    "few returns": (set_result("returns", [1.0]), "expected a list of 12"),
    "a seed of the noise": (set_result("noise_seed", 1), r"Pot1Noise-v0, seed 0: \w+.* expected"),
    "a noise without noise": (set_result("noise_seed", 1, 2), "noise_seed = 1: expected none, Pot3-v0 has no noise"),
    "a text for a seed": (set_result("noise_seed", "1"), r"results\[0\]\.noise_seed = '1': expected a whole number"),
    "NaN actions": (set_result("actions", NAN), r"results\[0\]\.actions: expected finite numbers"),
    "text actions": (set_result("actions", "?" * 128), "expected 96 bytes as base64"),
    "unicode actions": (set_result("actions", "é" * 128), "expected 96 bytes as base64"),
    "many actions": (set_result("actions", "A" * 100_000), "expected 96 bytes as base64"),
    "list of actions": (set_result("actions", [0.5] * 24), "expected 96 bytes as base64"),
    "no shots": (set_result("shots", ZEROS), r"a number in results\[0\]\.shots = 0: expected 1"),
    "float seed": (set_result("seed", 0.5), r"results\[0\]\.seed = 0\.5: expected a whole number"),
    "unknown task": (set_result("task", "os.system"), r"results\[0\]\.task = 'os.system': expected one of"),
    "wrong success": (set_result("success", "2" * 12), "expected 12 digits 0 or 1"),
    "unknown key": (set_result("code", "print(1)"), r"key 'code' of results\[0\] is unknown"),
    "missing key": (edit(lambda data: data["results"][0].pop("seed")), r"key 'seed' of results\[0\] is missing"),
    "list of writers": (edit(lambda data: data.update(written_by=[1])), r"written_by = \[1\]: expected a text"),
    "no results": (edit(lambda data: data.update(results=[])), "number of results = 0: expected a whole number"),
    "a task twice": (edit(lambda data: data["results"].append(data["results"][0])), "expected each task and seed once"),
    "markup": (edit(lambda data: data.update(player="<script>")), "player = '<script>': expected 1 to 80 letters"),
}


@pytest.mark.parametrize(("change", "message"), HOSTILE.values(), ids=HOSTILE)
def test_a_wrong_file_is_refused_with_the_reason(change, message, played, capsys):
    changed = change(text())
    assert changed != text()
    played.write_text(changed, encoding="utf-8")
    tracemalloc.start()
    with pytest.raises(SystemExit) as refused:
        main(["bench", "verify", str(played)])
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 40e6
    assert isinstance(refused.value.code, str)
    assert re.search(message, refused.value.code), refused.value.code
    assert "\n" not in refused.value.code
    assert "accepted" not in capsys.readouterr().out


def test_bytes_that_are_no_text_are_refused(played):
    played.write_bytes(b"\x80\x04\x95cos\nsystem\n")  # the beginning of a pickle
    with pytest.raises(SystemExit, match="can't decode"):
        main(["bench", "verify", str(played)])


def test_the_command_plays_writes_and_verifies(tmp_path, capsys, monkeypatch):
    players = {"random": {"return": 0.0}, "search:200": {"return": 1.0}}
    monkeypatch.setattr(bench, "reference", lambda: {"Pot1-v0": {"players": players}})
    path = tmp_path / "entry.json"
    main(["bench", "random", "--tasks", "Pot1-v0,Billiards/Pot1Strike-v0", "--out", str(path), "--name", "me: 2"])
    head, *rows, aggregate, wrote = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["task", "seed", "success"]
    assert [row.split()[:2] for row in rows] == [["Pot1-v0", "0"], ["Pot1Strike-v0", "0"]]
    assert aggregate.startswith("interquartile mean of the normalised scores: ")
    assert wrote == f"wrote {path}"
    main(["bench", "verify", str(path), str(path)])
    printed = capsys.readouterr().out.splitlines()
    assert printed[: len(rows) + 2] == [f"{path}: accepted, me: 2", head, *rows]
    assert printed.count(f"{path}: accepted, me: 2") == 2


def test_the_seeds_of_a_task_count_together_as_on_the_leaderboard(monkeypatch):
    monkeypatch.setattr(
        bench, "reference", lambda: {"a": {"players": {"random": {"return": 0.0}, "best": {"return": 1.0}}}}
    )
    games: Any = [(0, np.zeros(6)), (1, np.ones(2))]
    results = [bench.Result("a", seed, "", points, points, points > 0, points, "") for seed, points in games]
    assert bench.score_table(bench.Bench("me", tuple(results))).endswith(" scores: 0.250")


def test_an_interrupted_command_resumes(tmp_path, capsys, monkeypatch):
    """Each finished result is kept, whatever ends the command; the same command plays the others."""
    path, part = tmp_path / "entry.json", tmp_path / "entry.json.part"
    command = ["bench", "geometric", "--tasks", "Pot1Noise-v0, Pot3-v0", "--seed", "0", "5", "--out", str(path)]
    find, played = bench.find_player, []

    def interrupted(*arguments):
        played.append(arguments)
        if len(played) == 3:
            raise KeyboardInterrupt
        return find(*arguments)

    monkeypatch.setattr(bench, "find_player", interrupted)
    with pytest.raises(SystemExit, match="130"):
        main(command)
    assert len(bench.verify(part).results) == 2
    with pytest.raises(SystemExit, match=r"entry\.json\.part holds results of another command"):
        main([*command, "--noise-seed", "3"])
    with pytest.raises(SystemExit, match=r"entry\.json\.part holds results of another command"):
        main(["bench", "random", "--name", "geometric", *command[2:]])
    main(command)
    assert len(played) == 5
    assert path.read_text() == text()
    assert os.listdir(tmp_path) == ["entry.json"]
    with pytest.raises(SystemExit, match=r"--out = '.*entry\.json': expected a new file \(--force replaces this one\)"):
        main(command)
    assert path.read_text() == text()
    main(["bench", "random", "--tasks", "Pot1-v0", "--out", str(path), "--force"])
    assert bench.load(path).player == "random"
    assert "interrupted; with --out the same command resumes" in capsys.readouterr().err


def test_a_pipe_is_refused_and_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.json")  # a reader would wait for a writer
    with pytest.raises(SystemExit, match=r"pipe\.json': expected a file of a benchmark, but it is not a regular file"):
        main(["bench", "verify", str(tmp_path / "pipe.json")])


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("situation.stroke([1, 0, 0])", "error: Carom-v0: .*; --tasks chooses other tasks"),
        ("[][1]", r"error: Carom-v0: IndexError: .* \(.*one_task.py, line 4\); --tasks chooses other tasks"),
    ],
)
def test_the_error_of_a_player_for_one_task_names_the_other(tmp_path, monkeypatch, fault, message):
    (tmp_path / "one_task.py").write_text(
        "def maker(argument):\n"
        "    def act(situation, rng):\n"
        "        if len(situation.observation) == 6:\n"
        f"            {fault}\n"
        "        return situation.stroke([0.5, 0.0])\n"
        "    return act\n"
    )
    monkeypatch.delitem(sys.modules, "one_task", raising=False)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(bench, "EPISODES", 2)
    with pytest.raises(SystemExit, match=message):
        main(["bench", "one_task:maker", "--tasks", "Pot1-v0,Carom-v0"])


def test_an_action_of_a_player_that_is_wrong_leaves_no_file(tmp_path, monkeypatch):
    (tmp_path / "bad_players.py").write_text(
        "def nan(argument):\n    return lambda situation, rng: situation.stroke([float('nan'), 0.0])\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(SystemExit, match=r"action = \[nan, 0\.0\]: expected finite numbers"):
        main(["bench", "bad_players:nan", "--tasks", "Pot1-v0", "--out", str(tmp_path / "bad.json")])
    assert not list(tmp_path.glob("*.json"))


def test_a_file_that_would_be_too_large_is_not_written(played, tmp_path, monkeypatch):
    entry = bench.load(played)
    monkeypatch.setattr(records, "MAX_BYTES", 100)
    with pytest.raises(ValueError, match="expected at most 100; play fewer tasks"):
        bench.save(tmp_path / "large.json", entry)
    assert not (tmp_path / "large.json").exists()


def test_the_scale_ends_at_the_random_player_and_at_the_best_one(monkeypatch):
    players = {"random": {"return": -0.5}, "search:200": {"return": 1.5}, "aim": {"return": 1.0}}
    monkeypatch.setattr(bench, "reference", lambda: {"Pot1-v0": {"players": players}})
    none, ones = np.zeros(4, np.bool_), np.ones(4)
    result = bench.Result("Pot1-v0", 0, "", ones.astype(np.uint8), np.zeros((4, 2), np.float32), none, 0.5 * ones, "")
    assert bench.score((result,))["normalised"] == 0.5
    assert bench.score((result, result._replace(returns=2.5 * ones)))["normalised"] == 1.0
    assert bench.score((result._replace(task="Pot3-v0"),))["normalised"] is None


def test_the_public_layouts_and_the_scale_are_published(monkeypatch):
    """The hashes are those of the first observations of 1,000 environments."""
    monkeypatch.undo()
    published = bench.reference()
    assert list(published) == list(FROZEN)
    for task in BENCH_TASKS:
        assert bench.layouts_hash(task) == published[task]["layouts"]
    assert all({"random", "geometric", "search:200"} <= set(entry["players"]) for entry in published.values())
