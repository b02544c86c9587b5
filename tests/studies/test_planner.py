"""The study of the planner."""

import functools
import json

import numpy as np
import pytest

from billiards_env.games import Setup
from studies import planner
from studies.planner import CELLS, Cell, blocks, main
from tests.helpers import games

NOISE = (0.125, 0.075)
TINY = (
    Cell("run-outs", (0.03, 0.0), "planner:60", 1.0),
    Cell("run-outs", (0.03, 0.0), "search:2", 1.0),
    Cell("fixed break", NOISE, "planner:60", 0.5),
    Cell("without english", NOISE, "planner:60", 0.5),
    Cell("eight ball", NOISE, "planner:60", 0.5),
    Cell("matches", NOISE, "random", 1.0),
    Cell("one ball", NOISE, "planner:60", 1.0),
    Cell("levels", (0.0, 0.0), "planner:club", 0.5),
    Cell("straight pool", NOISE, "planner:60", 0.5),
    Cell("snooker", NOISE, "planner:60", 0.5),
    Cell("three-cushion", NOISE, "planner:60", 0.5),
)


def setup_with_compiled_physics(rules, scene, **kwargs):
    return games.setup(rules, **kwargs) if rules == "snooker" else Setup(rules, scene, **kwargs)


def test_each_experiment_is_measured_and_only_new_racks_are_played(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(planner, "CELLS", TINY)
    monkeypatch.setattr(planner, "PLANNER", "planner:60")
    monkeypatch.setattr(planner, "MAX_SHOTS", 4)
    monkeypatch.setattr(planner, "Setup", setup_with_compiled_physics)
    output = tmp_path / "planner.json"
    monkeypatch.setattr(planner, "MAX_POINTS", 2)
    monkeypatch.setattr(planner, "EQUAL_TIME", "search:2")
    monkeypatch.setattr(planner, "LAYOUTS", 1)
    argv = ["--output", str(output), "--images", str(tmp_path)]
    main([*argv, "--racks", "1"])
    assert (tmp_path / "planner_budget.png").stat().st_size > 1000
    first = json.loads(output.read_text())
    printed = capsys.readouterr().out
    assert all(text in printed for text in blocks(first).values())
    assert {cell.experiment for cell in CELLS} == first["results"].keys()
    assert [one["player"] for one in first["times"]["players"]] == [
        "planner:60",
        "search:2",
        planner.LEAST,
        planner.LEAST,
    ]
    main([*argv, "--racks", "2"])
    results = json.loads(output.read_text())["results"]
    for experiment, noise, player, share in TINY:
        played = results[experiment][f"{noise[0]:g} degrees, {noise[1]:g} m/s"][player]
        assert len(played) == 2 * share
        assert played[:1] == first["results"][experiment][f"{noise[0]:g} degrees, {noise[1]:g} m/s"][player]
    before = output.read_text()
    main([*argv, "--racks", "2"])
    assert output.read_text() == before


def test_a_turn_of_straight_pool_continues_with_a_new_rack(monkeypatch):
    monkeypatch.setattr(planner, "MAX_POINTS", 6)
    rng, turn = np.random.default_rng(0), functools.partial(planner.EXPERIMENTS["straight pool"], balls=2)
    assert turn("planner:300", (0.01, 0.0), rng)["points"] > 2


def test_a_file_that_cannot_be_read_is_reported(tmp_path):
    for path in (tmp_path, tmp_path / "broken.json"):
        (tmp_path / "broken.json").write_text("{")
        with pytest.raises(SystemExit, match="error: "):
            main(["--output", str(path)])
