"""States and facts of games, made by hand."""

import dataclasses
from types import SimpleNamespace

import numpy as np

from billiards_env import Scene
from billiards_env.engine.log import EVENT_DTYPE
from billiards_env.games import CALLS, GAMES, IN_HAND, NO_CALL, Call, Setup, referee, to_dict
from billiards_env.games.facts import facts_of, pots_of
from billiards_env.games.game import History, Stroke, custom_opening, opening, play
from billiards_env.games.state import CALL, FACTS, STATE, Called, changed, row, set_of


def setup(rules, balls=None, **kwargs):
    """Returns the settings of a game on its usual table, with the most or a given number of object balls."""
    game = GAMES[rules]
    scene = Scene.named(game.scene, balls or game.n_object_balls[1])
    if rules == "snooker":  # it runs the code that is compiled for the pool games
        scene = dataclasses.replace(scene, physics=Scene.named("real_pool").physics)
    return Setup(rules, **{"scene": scene, **kwargs})


def hanging(**kwargs):
    """Returns the settings of straight pool, and a state in which ball 1 hangs in pocket 3."""
    game = setup("straight", 2, **kwargs)
    return game, custom_opening(game, [[0.6, 0.1], [1.07, 0.435], [-0.5, 0.0]])


def random_game(settings, seed, shots=400):
    """Returns the history of a random game, and its shots."""
    rng = np.random.default_rng(seed)
    game = start = opening(settings, rng)
    strokes, log = [], []
    while len(log) < shots and not game.state.over:
        place = tuple((3 * rng.random(2) - 1.5).tolist()) if game.state.in_hand else None
        spin, ball, pocket = 40 * rng.random(3) - 20, int(rng.integers(-1, 3)), int(rng.integers(-1, 6))
        call = Call(ball, pocket) if settings.game_rules.pockets else NO_CALL
        strokes.append(Stroke(tuple((12 * rng.random(2) - 6).tolist()), place, tuple(spin.tolist()), call))
        log.append(play(settings, game, strokes[-1]))
        game = log[-1].game
    return History(settings, start, tuple(strokes)), log


def log_of(text, times=None):
    """Returns the events of a text such as "hit 0 1, cushion 1, pocket 1 5", one second apart or at the given times."""
    events = [event.split() for event in text.split(",") if event]
    log = np.zeros(len(events), EVENT_DTYPE)
    log["time"] = np.arange(len(events)) if times is None else times
    for event, (kind, ball, *other) in zip(log, events, strict=True):
        event["kind"], event["ball"] = "ball_ball" if kind == "hit" else kind, int(ball)
        event["other"] = int(other[0]) if other else 0
    return log


def words(row):
    """Returns a row of a structured array in words, with attributes."""
    return SimpleNamespace(**to_dict(row))


def state(rules, *, on_table=None, players=2, **fields):
    """Returns a state in the middle of a game, with all balls or the cue ball and the object balls of `on_table`.

    The other fields are those of `RulesState` in words.
    """
    n, cues = 1 + GAMES[rules].n_object_balls[1], fields.pop("cue_balls", GAMES[rules].cue_balls)
    balls = range(n) if on_table is None else on_table
    fields["in_hand"] = IN_HAND.index(fields.get("in_hand", "no"))
    fields["choices"] = set_of(map(CALLS.index, fields.get("choices", ())))
    for name in {"scores", "fouls"} & set(fields):
        fields[name] = (*fields[name], 0, 0, 0, 0)[:4]
    fields = {"break_shot": False, "cue_balls": (cues[0], cues[-1]), **fields}
    first = referee.first_state(rules, n, n_players=players)
    return changed(first, object_balls=set_of(set(balls) - {cues[0]}), **fields)


def judge(rules, before, log, call=NO_CALL):
    """Returns the state before the next shot and the ruling on a shot, in words, from its events, see `log_of`."""
    log = log_of(log) if isinstance(log, str) else log
    called = row(Called(call.ball, CALLS.index(call.kind), (call.ball, call.pocket) in pots_of(log)))
    rows = (before, STATE), (facts_of(log, int(before.cue_balls[0])), FACTS), (called, CALL)
    (after,), (verdict,) = referee.judge_shots(rules, *(np.array([one], kind) for one, kind in rows))
    set_by_rules = {name: to_dict(after)[name] for name in FOLLOWING}
    return after, SimpleNamespace(**to_dict(verdict), **set_by_rules)


FOLLOWING = ("in_hand", "choices", "solids", "colour", "over", "winner")


def ruling(foul="", points=0, **fields):
    """Returns an expected verdict in words, with the fields of the next state that the rules of a game set."""
    usual = {"penalty": 0, "continues": False, "spotted": (), "rack": ""}
    after = {"in_hand": "no", "choices": (), "solids": -1, "colour": False, "over": False, "winner": -1}
    return SimpleNamespace(foul=foul, points=points, **{**usual, **after, **fields})


def in_a_row(n, places=None):
    """Returns the positions of n balls, (n, 2) m: those of `places`, by ball, and the others in a row."""
    positions = np.column_stack((0.11 * np.arange(n) - 0.9, np.full(n, -0.3)))
    for ball, place in (places or {}).items():
        positions[ball] = place
    return positions
