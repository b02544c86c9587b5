"""The training of the network that rates positions in a run-out."""

import contextlib
import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

pytest.importorskip("torch")

from billiards_env.games import Setup, opening
from billiards_env.games.game_state import ANYWHERE, changed
from billiards_env.scene import Scene
from studies import load_arrays, run_outs

CELLS = tuple(
    run_outs.Setting(rules, "real_pool", noise)
    for rules in ("nine_ball", "eight_ball")
    for noise in ((0.03, 0.0), (3, 0))
)


def test_the_command_plays_what_is_missing_and_the_network_learns(tmp_path, monkeypatch, capsys):
    small = {"SETTINGS": CELLS, "PARTS": 1, "PART": 2, "SECONDS": 0.005, "LONGEST": 8, "EPOCHS": 60, "BATCH": 16}
    for name, value in small.items():
        monkeypatch.setattr(run_outs, name, value)
    monkeypatch.setattr(run_outs, "executor", lambda *_: contextlib.nullcontext(ThreadPoolExecutor(1)))
    output, weights, folder = tmp_path / "run_outs.json", tmp_path / "run_outs.npz", tmp_path / "positions"
    arguments = ["--output", str(output), "--weights", str(weights), "--folder", str(folder)]
    run_outs.main(arguments)
    content = json.loads(output.read_text())
    assert run_outs.blocks(content)["table"] in capsys.readouterr().out
    files = sorted(folder.iterdir())
    assert len(files) == run_outs.ROUNDS * len(CELLS)
    assert sum(cell["positions"] for cell in content["cells"]) == sum(len(load_arrays(file)["won"]) for file in files)
    everything = run_outs.load_positions(files)
    chances = run_outs.run_outs.chances(load_arrays(weights), everything.inputs.astype(float))
    assert chances[everything.won].mean() > chances[~everything.won].mean() + 0.1
    first = load_arrays(weights)
    files[-1].unlink()
    before = [file.read_bytes() for file in files[:-1]]
    run_outs.main(arguments)
    assert [file.read_bytes() for file in files[:-1]] == before
    assert files[-1].exists()
    assert first.keys() == load_arrays(weights).keys()


def test_a_ball_in_hand_lies_in_a_free_place_and_the_groups_are_drawn():
    setup = Setup("eight_ball", Scene.named("pool", 15))
    game, rng = opening(setup, np.random.default_rng(0), "random"), np.random.default_rng(1)
    game = game._replace(state=changed(game.state, in_hand=ANYWHERE, solids=0, player=1))
    turns = [run_outs.next_turn(setup, game, rng) for _ in range(12)]
    assert {turn.state.solids for turn in turns} == {0, 1}
    assert {turn.state.player for turn in turns} == {0}
    assert len({tuple(turn.positions[0]) for turn in turns}) == 12
    np.testing.assert_array_equal(turns[0].positions[1:], game.positions[1:])


def test_the_loss_is_that_of_the_probabilities():
    assert run_outs._loss(np.array([0.5, 0.25]), np.array([True, False])) == pytest.approx(-np.log(0.5 * 0.75) / 2)
