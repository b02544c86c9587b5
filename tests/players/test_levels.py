"""Levels of the planner: stronger ones pot more balls, and a window shows the planned shot without its error."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from billiards_env.evaluation import measure
from billiards_env.games import Stroke
from billiards_env.players.levels import EXPECTED, LEVELS, expected, level_of, with_noise
from billiards_env.players.named import find_player
from tests.helpers.games import hanging

RNG = np.random.default_rng


def test_stronger_levels_pot_more_balls():
    levels = ("beginner", "league", "pro")
    pots = [measure(f"planner:{level}", {}, (0.0, 0.0), 60, 1)["success_rate"] for level in levels]
    assert pots[0] < pots[1] < pots[2]


def test_the_errors_have_the_size_of_the_level():
    stroke, (degrees, speed) = Stroke((3.0, 0.0), None, (0.0, 40.0, 0.0)), LEVELS["club"].noise
    played = [with_noise(stroke, LEVELS["club"].noise, 4.0, RNG(seed)) for seed in range(500)]
    x, y = np.array([one.velocity for one in played]).T
    assert np.degrees(np.arctan2(y, x)).std() == pytest.approx(degrees, rel=0.1)
    assert np.hypot(x, y).std() == pytest.approx(speed, rel=0.1)
    assert np.hypot(x, y).max() <= 4.0
    assert played[0].spin[1] / 40.0 == pytest.approx(np.hypot(*played[0].velocity) / 3.0 * x[0] / np.hypot(x[0], y[0]))
    assert with_noise(Stroke((0.0, 0.0)), (1.0, 1.0), 4.0, RNG(0)) == Stroke((0.0, 0.0))


def test_a_game_and_an_environment_accept_a_level():
    game, table = hanging()
    player: Any = find_player("planner:beginner", game)
    assert player(game, table, 4.0, RNG(0)) == player(game, table, 4.0, RNG(0))
    assert player(game, table, 4.0, RNG(0)) != player.intend(game, table, 4.0, RNG(0))
    env = gym.make("Billiards/Pot1-v0")
    observation, _ = env.reset(seed=0)
    assert find_player("planner:pro", env, seed=0)(observation).shape == (2,)


def test_a_planner_expects_the_errors_of_its_level_and_of_the_game():
    assert expected((0.1, 0.0), level_of("pro")) == pytest.approx((0.1 * 2**0.5, 0.05))
    assert expected((0.0, 0.0), level_of("beginner")) == EXPECTED
    with pytest.raises(ValueError, match=r"a number of shots, or a level: 'beginner', 'club', 'league', 'pro'"):
        level_of("clubs")
