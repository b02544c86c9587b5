import importlib.metadata
import sys
import types

import numpy as np
import pytest

from billiards_env.games import Stroke
from billiards_env.play.players import GROUP, find_player

BALLS = [[-0.4, 0.0], [0.4, 0.0], [0.4, 0.5]]


def own(setup, argument):
    if argument == "bad":
        raise ValueError("it cannot be had")
    return lambda setup, game, max_speed, rng: Stroke((float(argument or 1), 0.0))


@pytest.fixture
def module(monkeypatch):
    """A module `mine` that can be imported."""
    made = types.ModuleType("mine")
    vars(made)["own"] = own
    monkeypatch.setitem(sys.modules, "mine", made)


def test_a_person_is_no_program(make_model):
    assert find_player("human", make_model(positions=BALLS).setup) is None


def test_the_random_player(make_model):
    model = make_model("nine_ball")
    player = find_player("random", model.setup)
    assert player is not None
    strokes = [player(model.setup, model.game, 5.0, np.random.default_rng(seed)) for seed in range(100)]
    speeds = [np.hypot(*stroke.velocity) for stroke in strokes]
    assert 4.5 < max(speeds) <= 5.0
    assert len({stroke.place for stroke in strokes}) == 100
    assert player(model.setup, model.game, 5.0, np.random.default_rng(7)) == strokes[7]
    on_table = make_model(positions=BALLS)
    assert player(on_table.setup, on_table.game, 5.0, np.random.default_rng(0)).place is None


@pytest.mark.usefixtures("module")
def test_ones_own_player(make_model):
    model = make_model(positions=BALLS)
    for text, speed in (("mine:own", 1.0), ("mine:own:2.5", 2.5)):
        player = find_player(text, model.setup)
        assert player is not None
        assert player(model.setup, model.game, 8.0, np.random.default_rng(0)) == Stroke((speed, 0.0))


@pytest.mark.usefixtures("module")
def test_a_player_offered_by_a_package(make_model, monkeypatch):
    entry = importlib.metadata.EntryPoint("theirs", "mine:own", GROUP)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: importlib.metadata.EntryPoints([entry]))
    model = make_model(positions=BALLS)
    player = find_player("theirs:3", model.setup)
    assert player is not None
    assert player(model.setup, model.game, 8.0, np.random.default_rng(0)) == Stroke((3.0, 0.0))
    with pytest.raises(ValueError, match="expected one of human, random, theirs, or module:function"):
        find_player("them", model.setup)


@pytest.mark.usefixtures("module")
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nobody", "player 'nobody': .*expected one of .*human.*random"),
        ("mine:nothing", "player 'mine:nothing': .*has no attribute"),
        ("mine:own:bad", "it cannot be had"),
        ("random:3", "it takes no argument"),
        ("", "player ''"),
        (":x", "player ':x'"),
    ],
)
def test_what_is_no_player_is_refused(text, message, make_model):
    with pytest.raises(ValueError, match=message):
        find_player(text, make_model(positions=BALLS).setup)
