import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.games import GAMES, History, Setup, custom_opening, opening
from billiards_env.play.model import HUMAN, begin

BALLS = [[-0.4, 0.0], [0.4, 0.0], [0.4, 0.5]]


@pytest.fixture(scope="session")
def make_model():
    """A function that returns the model of a game for two players, from the opening or from given positions.

    By default it is straight pool with three balls.
    """

    def make(rules="", positions=None, state=None, players=(HUMAN, HUMAN), choices=False, scene=None, **kwargs):
        rules, positions = rules or "straight", positions if rules or positions else BALLS
        balls = GAMES[rules].n_object_balls[1] if positions is None else len(positions) - 1
        name = "real_pool" if rules == "blackball" else GAMES[rules].scene  # other tests compile its engine too
        setup = Setup(rules, Scene.named(name, balls) if scene is None else scene, len(players), **kwargs)
        table = (
            opening(setup, np.random.default_rng(0)) if positions is None else custom_opening(setup, positions, state)
        )
        return begin(History(setup, table, ()), players, 8.0, 1 / 60, choices=choices)

    return make
