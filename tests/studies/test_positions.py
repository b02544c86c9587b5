"""The fixed set of positions, and the success of strokes in them."""

import json

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from billiards_env.games import Stroke, play
from studies import positions
from studies.positions import SET, main, setup_of, state_of, stroke_of, success_share

ENTRIES = json.loads(SET.read_text(encoding="utf-8"))["positions"]


def test_the_set_has_legal_positions_with_legal_answers():
    rules = [entry["rules"] for entry in ENTRIES]
    assert {name: rules.count(name) for name in positions.RULES} == {"nine_ball": 100, "eight_ball": 100}
    for entry in ENTRIES[::10]:
        game = state_of(entry)
        assert not game.state.break_shot
        assert play(setup_of(entry["rules"]), game, stroke_of(entry["answer"])).shot.status == "rest"
        assert 0.0 <= entry["answer"]["probability"] <= 1.0
        assert -1.0 <= entry["answer"]["value"] <= 1.0


def test_the_success_of_an_answer_is_near_its_probability():
    gaps = []
    for number, entry in enumerate(ENTRIES[::20]):
        setup, game, rng = setup_of(entry["rules"]), state_of(entry), np.random.default_rng(number)
        share = success_share(setup, game, stroke_of(entry["answer"]), 200, rng)
        gaps.append(share - entry["answer"]["probability"])
    assert np.abs(gaps).mean() < 0.1


def test_a_stroke_that_moves_nothing_has_no_success():
    entry = next(entry for entry in ENTRIES if entry["state"]["in_hand"] == "no")
    setup, game = setup_of(entry["rules"]), state_of(entry)
    assert success_share(setup, game, Stroke((0.001, 0.0)), 5, np.random.default_rng(0)) < 1.0


def test_the_command_measures_players_without_scores(tmp_path, monkeypatch, capsys):
    path, output = tmp_path / "set.json", tmp_path / "scores.json"
    path.write_text(json.dumps({"positions": [ENTRIES[0], ENTRIES[1], ENTRIES[-1]]}))
    monkeypatch.setattr(positions, "SET", path)
    arguments = ["--output", str(output), "--samples", "20"]
    main(["--players", "answers,geometric", *arguments])
    content = json.loads(output.read_text())
    assert list(content["scores"]) == ["answers", "geometric"]
    content["scores"]["geometric"]["success"] = [0.25, 0.25, 1.0]  # stays: it is measured
    output.write_text(json.dumps(content))
    main(["--players", "planner:club", *arguments])
    content = json.loads(output.read_text())
    assert list(content["scores"]) == ["answers", "geometric", "planner:club"]
    text = capsys.readouterr().out
    assert positions.blocks(content)["table"] in text
    assert "25.0% |     100.0% |" in text
