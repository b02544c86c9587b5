"""Players of games: their shots are legal, they are found by name, and the strategies score points."""

import importlib.metadata
import sys
import types
from typing import Any, cast

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.envs import make_env
from billiards_env.games import GAMES, Call, Setup, Stroke, custom_opening, opening, play
from billiards_env.players.env_player import env_situation, game_observation
from billiards_env.players.named import GROUP, PLAYERS, find_player
from billiards_env.players.situation import game_situation, stroke_of
from tests.helpers.errors import refusals
from tests.helpers.games import hanging, setup

RNG = np.random.default_rng


NAMES = ("random", "geometric", "search:100", "aim", "planner:60")
MOST_STROKES = 400  # a game takes 3 to 50


@pytest.mark.parametrize("rules", list(GAMES))
@pytest.mark.parametrize("name", NAMES)
def test_every_player_plays_whole_games_and_a_seed_repeats_a_stroke(name, rules):
    """The random player only begins the game."""
    balls = 9 if rules == "snooker" else None  # a frame with three reds is short
    game, rng = setup(rules, balls, call_shot=rules == "eight_ball" and "planner" in name), RNG(1)
    if name == "geometric" and not game.game_rules.pockets:
        return
    player, table = find_player(name, game), opening(game, rng)
    situation = game_situation(game, table, 6.0)
    assert player(situation, RNG(2)) == player(situation, RNG(2))
    for _ in range(20 if name == "random" else MOST_STROKES):
        stroke = player(game_situation(game, table, 6.0), rng)
        assert np.hypot(*stroke.velocity) <= 6.0 * (1 + 1e-12)
        table = play(game, table, stroke).game  # refuses what the rules forbid
        if table.state.over:
            break
    assert table.state.over or name == "random"


def test_a_strategy_calls_the_ball_that_it_pots():
    game, table = hanging(call_shot=True)
    for name in ("geometric", "search:20"):
        stroke = find_player(name, game)(game_situation(game, table, 4.0), RNG(0))
        assert (stroke.call, play(game, table, stroke).verdict.points) == (Call(1, 3), 1)


@pytest.mark.parametrize("action", [("1", "2"), (1j, 0.0), (np.nan, 0.0), (0.1, 0.2, 0.3), None])
def test_the_strategies_of_other_packages_give_finite_numbers(action):
    game, table = hanging()
    with pytest.raises(ValueError, match=r"action.*: expected"):
        game_situation(game, table, 4.0).stroke(action)


def test_a_player_that_returns_an_action_gets_a_hint():
    game, table = hanging()
    situation = game_situation(game, table, 4.0)
    with pytest.raises(TypeError, match=r"expected a Stroke, a player returns situation.stroke\(action\)"):
        stroke_of(lambda situation, rng: cast(Any, np.zeros(2)), situation, RNG(0))


@pytest.mark.parametrize("rules", ["nine_ball", "snooker", "carom"])
def test_the_observation_of_a_game_is_that_of_its_environment(rules):
    env, rng = make_env(task=rules, n_players=2), RNG(3)
    observed, _ = env.reset(seed=1)
    for _ in range(6):
        setup, game = env_situation(env).find_game()
        assert np.array_equal(game_observation(setup, game, env.max_speed), observed)
        observed, _, over, *_ = env.step(rng.uniform(-1, 1, env.action_space.shape))
        if over:
            break


def test_a_module_that_ends_the_process_is_named(tmp_path, monkeypatch):
    (tmp_path / "ending.py").write_text("raise SystemExit(3)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match=r"player = 'ending:maker': expected one of .*module:function \(3\)"):
        find_player("ending:maker", setup("carom"))


def test_search_avoids_penalty_points_in_snooker():
    game = setup("snooker")
    rng, penalties = RNG(0), 0
    for _ in range(10):
        table = opening(game, rng, "random")
        stroke = find_player("search:50", game)(game_situation(game, table, 4.0), rng)
        penalties += play(game, table, stroke).verdict.penalty
    assert penalties == 0


def test_the_geometric_player_hits_a_legal_ball_first():
    game = setup("nine_ball")
    # The nine ball hangs in a pocket's mouth, the one is far away: only the one may be touched first.
    balls = [[0.6, 0.1], [-0.9, -0.4], *([-1.1 + 0.1 * i, 0.55] for i in range(7)), [1.07, 0.435]]
    table = custom_opening(game, balls)
    played = play(game, table, find_player("geometric", game)(game_situation(game, table, 4.0), RNG(0)))
    assert played.facts.first == 1 << 1


def test_a_cue_ball_in_hand_is_placed_for_an_easy_pot():
    game = setup("nine_ball")
    # The one is before a pocket, the two in the cue ball's way to it, the others along the far cushion.
    balls = [[0.0, -0.535], [1.0, 0.365], [0.1, -0.435], *([-1.1 + 0.15 * i, -0.6] for i in range(7))]
    player = find_player("geometric", game)
    table = custom_opening(game, balls)
    assert not play(game, table, player(game_situation(game, table, 4.0), RNG(0))).facts.potted >> 1 & 1
    table = custom_opening(game, balls, {"in_hand": "anywhere"})
    played = [play(game, table, player(game_situation(game, table, 4.0), RNG(seed))) for seed in range(10)]
    assert sum(bool(p.facts.potted >> 1 & 1) and not p.verdict.foul for p in played) >= 9


def test_the_random_player_shoots_in_any_direction_at_any_speed():
    game = setup("nine_ball")
    player, situation = find_player("random", game), game_situation(game, opening(game, RNG(0)), 5.0)
    strokes = [player(situation, RNG(seed)) for seed in range(100)]
    speeds = [np.hypot(*stroke.velocity) for stroke in strokes]
    assert 4.5 < max(speeds) <= 5.0 * (1 + 1e-12)
    assert len({stroke.place for stroke in strokes}) == 100
    assert player(situation, RNG(7)) == strokes[7]
    straight, table = hanging()
    assert find_player("random", straight)(game_situation(straight, table, 5.0), RNG(0)).place is None


def own(argument):
    if argument == "bad":
        raise ValueError("it cannot be had")
    return lambda situation, rng: Stroke((float(argument or 1), 0.0))


@pytest.fixture
def module(monkeypatch):
    """A module `mine` that can be imported."""
    made = types.ModuleType("mine")
    vars(made).update(own=own, nullary=lambda: None, of_nothing=lambda argument: lambda game: None)
    monkeypatch.setitem(sys.modules, "mine", made)


THEIRS = importlib.metadata.EntryPoint("theirs", "mine:own", GROUP)


@pytest.mark.usefixtures("module")
@pytest.mark.parametrize(("text", "speed"), [("mine:own", 1.0), ("mine:own:2.5", 2.5), ("theirs:3", 3.0)])
def test_a_player_is_found_in_a_module_and_in_an_installed_package(text, speed, monkeypatch):
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: importlib.metadata.EntryPoints([THEIRS]))
    game, table = hanging()
    assert find_player(text, game)(game_situation(game, table, 8.0), RNG(0)) == Stroke((speed, 0.0))


NAMES = "'aim', 'geometric', 'human', 'noisy', 'planner', 'policy', 'random', 'search', 'theirs'"


WRONG = [
    ("nobody", "straight", f"player = 'nobody': expected one of {NAMES}, or module:"),
    ("mine:nothing", "straight", "player = 'mine:nothing': .*has no attribute"),
    ("mine:own:bad", "straight", "it cannot be had"),
    ("random:3", "straight", "player = 'random:3': expected .* a name without ':'"),
    ("geometric", "carom", "expected a game with pockets"),
    ("planner:fast", "carom", "player = 'planner:fast': expected a time such as 'planner:100ms' or a number"),
    ("mine:nullary", "straight", r"expected a function \(argument\) that returns a player", TypeError),
    ("mine:of_nothing", "straight", r"that returns a player \(situation, rng\)", TypeError),
    ("geometrc", "env", r"player = 'geometrc': .*or module:function \(did you mean 'geometric'\?\)"),
    ("search:0", "env", "player = 'search:0': expected 'search:K' with a whole number K >= 1"),
]


@pytest.mark.usefixtures("module")
def test_a_function_with_the_name_of_a_player_does_not_load_it(monkeypatch):
    monkeypatch.setattr(sys.modules["mine"], "policy", sys.modules["mine"].own, raising=False)
    monkeypatch.setitem(PLAYERS.data, "policy", "player = 'policy'")  # as at the start of a process
    monkeypatch.setitem(sys.modules, "billiards_env.sb3.policy_player", None)
    assert find_player("mine:policy:2.5", setup("straight"))


@pytest.mark.usefixtures("module")
@refusals("text, world", WRONG)
def test_unknown_players_are_refused(text, world, message, kind, monkeypatch):
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: importlib.metadata.EntryPoints([THEIRS]))
    with pytest.raises(kind, match=message):
        find_player(text, make_env() if world == "env" else setup(world), others=("human",))


@pytest.mark.parametrize("where", [Setup("nine_ball", Scene.named("jump_pool", 9)), make_env(task="jump")])
def test_a_player_that_needs_derivatives_is_refused_with_flights(where):
    with pytest.raises(ValueError, match=r"physics\.flight = True with player = 'aim': expected .*'search:200'"):
        find_player("aim", where)
