"""The leaderboard: its files are valid, and its page is made from them."""

import json

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("matplotlib")

from billiards_env.bench import benchmark as bench
from billiards_env.bench.frozen import BENCH_TASKS
from billiards_env.players.env_player import acting
from billiards_env.players.named import find_player
from studies import leaderboard, learning, read_results
from studies.leaderboard import blocks, entries, main

FILES = sorted(leaderboard.FOLDER.glob("*.json"))


def test_the_page_is_that_of_the_files():
    """The scores are computed from the outcomes in the files. Another test proves a sample of the outcomes."""
    known = read_results(leaderboard.OUTPUT)
    data = json.loads(json.dumps(entries(leaderboard.FOLDER, known, bench.load)))
    assert data == known
    assert {"random", "geometric", "search_200"} <= set(data)
    assert {name for name in data if data[name]["run"]} == set(leaderboard.RUN)
    assert all(set(data[name]["scores"]) == set(BENCH_TASKS) for name in ("aim_policy", "aim_policy_64"))
    assert sum(path.stat().st_size for path in FILES) < 2e6


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_sample_of_each_file_replays(path):
    one = bench.load(path).results[0]
    again = bench.play_actions(one.task, one.seed, one.shots, one.actions, one.noise_seed)
    assert (again.success == one.success).all()
    assert (again.layouts, again.digest) == (one.layouts, one.digest)


@pytest.mark.slow
def test_all_files_are_accepted():
    known = read_results(leaderboard.OUTPUT)
    assert entries(leaderboard.FOLDER, known) == entries(leaderboard.FOLDER, known, bench.load)


def test_players_of_some_tasks_are_ordered_by_these():
    shares = {"weak": [0.1] * 5, "strong": [0.9] * 5, "some": [1.0, 0.6]}
    data = {
        name: {
            "player": name,
            "run": True,
            "scores": {task: {"normalised": x, "success": x} for task, x in zip(BENCH_TASKS, own, strict=False)},
        }
        for name, own in shares.items()
    }
    rows = [row.strip("| ").split() for row in blocks(data)["table"].splitlines()[2:]]
    assert [(row[0], row[2], row.count("-")) for row in rows] == [
        ("`strong`", "0.900", 0),
        ("`some`", "-", 4),
        ("`weak`", "0.100", 0),
    ]


def test_the_player_trained_is_the_best_row_of_its_task():
    pytest.importorskip("torch")
    measured = read_results(learning.OUTPUT)
    rows = [name for name, one in measured.items() if one["runs"] and "Pot1-v0" in one["settings"]["plays"]]
    best = max(rows, key=lambda name: np.mean(learning.mean_rates(measured[name], "Pot1-v0")))
    env = gym.make("Billiards/Pot1-v0")
    observation, _ = env.reset(seed=3)
    names = "studies.leaderboard:trained", f"policy:{learning.OUTPUT.parent / 'policies' / best}"
    mine, other = (acting(find_player(name, env), env, seed=0)(observation) for name in names)
    assert (mine == other).all()


def test_the_command_verifies_and_writes(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(bench, "EPISODES", 6)
    scale = {"players": {"random": {"return": -0.05}, "search:200": {"return": 1.0}}}
    monkeypatch.setattr(bench, "reference", lambda: dict.fromkeys(BENCH_TASKS, scale))
    folder, output = tmp_path / "entries", tmp_path / "leaderboard.json"
    folder.mkdir()
    for player, tasks in (("random", BENCH_TASKS), ("geometric", BENCH_TASKS), ("search:20", BENCH_TASKS[:1])):
        bench.save(folder / f"{player.replace(':', '-')}.json", bench.play_tasks(player, tasks, leaderboard.SEEDS))
    arguments = ["--folder", str(folder), "--output", str(output), "--images", str(tmp_path)]
    main(arguments)
    assert (tmp_path / "leaderboard.png").read_bytes().startswith(b"\x89PNG")
    content = json.loads(output.read_text())
    rows = blocks(content)["table"].splitlines()[2:]
    names = {row.split(" | ")[0].strip("| ") for row in rows}
    assert names == {"`geometric`", "`search:20` (replayed only)", "`random`"}
    assert blocks(content)["table"] in capsys.readouterr().out
    main(arguments)
    assert json.loads(output.read_text()) == content  # the seeds of the noise stay
    path = folder / "geometric.json"
    bench.save(path, bench.load(path)._replace(player="another"))
    main(arguments)
    changed = json.loads(output.read_text())
    seeds = {name: (content[name]["noise_seed"], changed[name]["noise_seed"]) for name in content}
    assert {name for name, (old, new) in seeds.items() if old != new} == {"geometric"}
    content = changed

    bench.save(folder / "other.json", bench.play_tasks("random", BENCH_TASKS[:1], (0,)))
    with pytest.raises(SystemExit, match=r"other\.json: Pot1Noise-v0 with seeds \[0\]: expected some of"):
        main(arguments)
    text = (folder / "random.json").read_text()
    (folder / "other.json").write_text(text.replace('"success": "', '"success": "1', 1))
    with pytest.raises(SystemExit, match=r"other\.json: results\[0\]\.success"):
        main(arguments)
    assert json.loads(output.read_text()) == content
