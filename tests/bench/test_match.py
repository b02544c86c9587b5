"""Matches of players, and ratings."""

from typing import Any, cast

import numpy as np
import pytest

from billiards_env.__main__ import main
from billiards_env.bench import match
from billiards_env.envs import Opponents, make_vector_env
from tests.helpers.errors import rejected

GAME = {"task": "nine_ball", "n_players": 2}


def test_a_command_plays_resumes_and_rates(tmp_path, capsys, monkeypatch):
    command = ["match", "random", "geometric", "search:5", "--rules", "nine_ball", "--games"]
    out = ["--out", str(tmp_path / "match.json")]
    main([*command, "2", *out])
    first = capsys.readouterr().out
    assert first.count(" - ") == 0
    *_, head, best, _, worst = first.splitlines()
    assert head.split() == ["player", "rating"]
    assert (best.split()[0] in ("geometric", "search:5"), worst.split()[0]) == (True, "random")
    monkeypatch.setattr(match, "play_games", None)  # nothing is played again
    main([*command, "2", *out])
    assert capsys.readouterr().out == first
    with pytest.raises(SystemExit, match=r"expected a match with .*'seed': 1.*not .*'seed': 0"):
        main([*command, "2", *out, "--seed", "1"])


def test_the_players_break_in_turn_and_the_best_wins():
    games, breaks = make_vector_env(4, **GAME), []
    players = [match.acting_by_name(name, games) for name in ("random", "geometric")]

    def first(observations, rows):
        breaks.append(rows.tolist())
        return players[0](observations, rows)

    winners = match.play_games(games, [first, players[1]], seed=0)
    assert breaks[0] == [0, 2]
    assert (winners == 1).sum() >= 3


def test_the_ratings_are_those_of_the_shares():
    # With the additional draw, a wins 7.5 of 10 games against b.
    found = match.ratings({"a - b": [7, 2, 0]})
    assert list(found) == ["a", "b"]
    assert found["a"] - found["b"] == pytest.approx(400 * np.log10(7.5 / 2.5))
    even = match.ratings({"a - b": [3, 3, 0], "b - c": [2, 2, 1], "a - c": [0, 0, 4]})
    assert list(even.values()) == pytest.approx([0.0, 0.0, 0.0])


def test_opponents_by_name_and_wrong_actions():
    games = make_vector_env(2, **GAME)
    Opponents(games, "geometric").reset(seed=0)
    with rejected("player = 'geometrc': expected one of"):
        Opponents(games, "geometrc")
    model_like: Any = Opponents(games, lambda *_: cast(Any, (np.zeros((1, 4)), None)))
    with rejected("expected an array, the first result of model.predict", TypeError):
        model_like.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions of the policy .* has shape \(1, 2\): expected \(1, 4\)"):
        Opponents(games, lambda observations, rows: np.zeros((len(rows), 2))).reset(seed=0)
