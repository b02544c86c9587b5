"""The study of run-outs."""

import json

import pytest

from studies import run_outs
from studies.run_outs import NOISES, RUN_OUTS, blocks, main


@pytest.fixture
def small(tmp_path, monkeypatch):
    """Returns the output of a tiny study."""
    monkeypatch.setattr(run_outs, "PLAYERS", ("random", "search:2"))
    monkeypatch.setattr(run_outs, "EPISODES", 2)
    return tmp_path / "run_outs.json"


def test_all_players_play_the_run_outs_with_all_noises(small, capsys):
    main(["--output", str(small)])
    found = json.loads(small.read_text())
    for task in RUN_OUTS:
        for noise in NOISES:
            for player in ("random", "search:2"):
                assert found["results"][task][noise][player]["episodes"] == 2
    table = blocks(found)["table"]
    assert table in capsys.readouterr().out
    assert len(table.splitlines()) == 2 + len(RUN_OUTS) * len(NOISES) * 2


def test_players_with_results_are_not_measured_again(small, monkeypatch):
    played = []

    def spy(player, env, noise, episodes, seed):
        played.append((player, env, noise))
        if len(played) == 5:
            raise KeyboardInterrupt
        return result(episodes)

    monkeypatch.setattr(run_outs, "play_alone", spy)
    with pytest.raises(SystemExit):
        main(["--output", str(small)])
    interrupted = played[-1]
    main(["--output", str(small)])
    assert played[5] == interrupted
    assert len(played) == 1 + len(RUN_OUTS) * len(NOISES) * 2
    before = small.read_text()
    main(["--output", str(small)])
    assert (len(played), small.read_text()) == (13, before)
    monkeypatch.setattr(run_outs, "EPISODES", 3)
    main(["--output", str(small)])
    assert len(played) == 25


def result(episodes):
    """Returns the results of a player that fails at once."""
    shares = {"success_rate": 0.0, "confidence_interval_95": [0.0, 0.5]}
    return {"episodes": episodes, **shares, "mean_score": 0.0, "mean_shots": 1.0}


def test_a_file_that_cannot_be_read_is_reported(small):
    small.write_text("{")
    for path in (small, small.parent):
        with pytest.raises(SystemExit, match="error: "):
            main(["--output", str(path)])
