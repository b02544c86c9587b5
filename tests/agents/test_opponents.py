"""Programs to play against: they keep to the rules, know their trade, and load what they need only."""

import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from agents import opponents
from billiards_env import Scene
from billiards_env.games import RULES, Setup, custom_opening, opening, play
from billiards_env.play.players import GROUP

EASY = [[0.6, 0.1], [1.07, 0.435], [-0.5, 0.0]]
RNG = np.random.default_rng


def setup(rules, balls=None):
    game = RULES[rules]
    return Setup(rules, Scene.named("pool" if game.pockets else "carom", balls or game.n_object_balls[1]))


def points_of(player, game, shots, seed=0):
    """Points and fouls of a player's first shots at random layouts."""
    rng, points, fouls = RNG(seed), 0, 0
    for _ in range(shots):
        table = opening(game, rng, "random")
        verdict = play(game, table, player(game, table, 4.0, rng)).verdict
        points, fouls = points + verdict.points, fouls + bool(verdict.foul)
    return points, fouls


def test_the_package_offers_them():
    text = (Path(__file__).resolve().parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    section = text.partition(f'[project.entry-points."{GROUP}"]\n')[2].partition("\n\n")[0]
    offered = dict(re.findall(r'^(\w+) = "(.*)"$', section, re.MULTILINE))
    assert sorted(offered) == ["geometric", "policy", "search"]
    for name, value in offered.items():
        module, _, function = value.partition(":")
        assert getattr(importlib.import_module(module), function) is getattr(opponents, name)


@pytest.mark.parametrize(
    ("name", "rules"),
    [("search", rules) for rules in RULES]
    + [("geometric", rules) for rules in RULES if setup(rules).game_rules.pockets],
)
def test_whole_games_are_played(name, rules):
    game = setup(rules)
    player = getattr(opponents, name)(game, "20" if name == "search" else "")
    rng = RNG(1)
    table = opening(game, rng)
    for _ in range(12):
        stroke = player(game, table, 6.0, rng)
        assert np.hypot(*stroke.velocity) <= 6.0 * (1 + 1e-12)
        table = play(game, table, stroke).game  # refuses what the rules forbid
        if table.state.over:
            break


def test_the_geometric_player_pots():
    game = setup("straight", 2)
    table = custom_opening(game, EASY)
    assert play(game, table, opponents.geometric(game)(game, table, 4.0, RNG(0))).verdict.points == 1


def test_the_geometric_player_hits_what_it_may_hit():
    game = setup("nine_ball")
    # The nine ball hangs in a pocket's mouth, the one is far away: only the one may be touched first.
    balls = [[0.6, 0.1], [-0.9, -0.4], *([-1.1 + 0.1 * i, 0.55] for i in range(7)), [1.07, 0.435]]
    table = custom_opening(game, balls)
    played = play(game, table, opponents.geometric(game)(game, table, 4.0, RNG(0)))
    assert played.facts.first == (1,)


def test_searching_scores_more_than_geometry_and_more_shots_score_more():
    game = setup("straight", 1)
    geometric, _ = points_of(opponents.geometric(game), game, 40)
    few, _ = points_of(opponents.search(game, "5"), game, 40)
    many, fouls = points_of(opponents.search(game, "100"), game, 40)
    assert many > geometric
    assert many > few
    assert fouls == 0
    caroms = setup("carom")
    few, _ = points_of(opponents.search(caroms, "2"), caroms, 20)
    many, _ = points_of(opponents.search(caroms, "100"), caroms, 20)
    assert many > few + 5


def test_a_cue_ball_in_hand_is_put_where_a_pot_is_easy():
    game = setup("nine_ball")
    # The one is before a pocket, the two in the cue ball's way to it, the others along the far cushion.
    balls = [[0.0, -0.535], [1.0, 0.365], [0.1, -0.435], *([-1.1 + 0.15 * i, -0.6] for i in range(7))]
    player = opponents.geometric(game)
    table = custom_opening(game, balls)
    assert 1 not in play(game, table, player(game, table, 4.0, RNG(0))).facts.potted
    table = custom_opening(game, balls, {"in_hand": "anywhere"})
    played = [play(game, table, player(game, table, 4.0, RNG(seed))) for seed in range(10)]
    assert sum(1 in p.facts.potted and not p.verdict.foul for p in played) >= 9


@pytest.mark.slow
def test_the_search_wins_nine_ball_against_geometry():
    game, wins = setup("nine_ball"), 0
    players = opponents.search(game, "100"), opponents.geometric(game)
    for seed in range(10):
        rng = RNG(seed)
        table = opening(game, rng)
        while not table.state.over:
            table = play(game, table, players[table.state.player](game, table, 6.0, rng)).game
        wins += table.state.winner == 0
    assert wins >= 7


def test_a_trained_agent_plays(trained):
    game = setup("nine_ball")
    player = opponents.policy(game, str(trained))
    rng = RNG(0)
    table = opening(game, rng, "random")
    # It is shown the ball on, and nothing else: as if that were alone on the table.
    stroke = player(game, table, 6.0, rng)
    alone = custom_opening(setup("straight", 1), table.positions[[0, 1]])
    assert stroke == opponents.policy(setup("straight", 1), str(trained))(setup("straight", 1), alone, 6.0, rng)
    assert 0 < np.hypot(*stroke.velocity) <= 4.0 * (1 + 1e-6)  # what it was trained with
    slow = player(game, table, 0.5, rng)
    assert np.hypot(*slow.velocity) <= 0.5 * (1 + 1e-6)


@pytest.mark.parametrize(
    ("name", "rules", "argument", "error", "message"),
    [
        ("geometric", "carom", "", ValueError, "expected a game of pockets"),
        ("geometric", "straight", "3", ValueError, "it takes no argument"),
        ("search", "straight", "0", ValueError, "expected a whole number of shots >= 1"),
        ("search", "straight", "many", ValueError, "expected a whole number of shots >= 1"),
        ("policy", "straight", "", FileNotFoundError, "expected the folder of a finished run"),
        ("policy", "straight", "nowhere", FileNotFoundError, "expected the folder of a finished run"),
    ],
)
def test_wrong_arguments_are_refused(name, rules, argument, error, message):
    with pytest.raises(error, match=message):
        getattr(opponents, name)(setup(rules), argument)


def test_an_agent_of_another_game_is_refused(trained):
    with pytest.raises(ValueError, match="expected an agent trained on the same table with 2 object balls, not 1"):
        opponents.policy(setup("carom"), str(trained))


def test_pytorch_is_loaded_for_a_trained_agent_alone():
    code = "import sys, agents.opponents; print(sorted({'torch', 'stable_baselines3', 'pygame'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "[]\n"
