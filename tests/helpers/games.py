"""States and facts of games, made by hand."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np

from billiards_env import Scene
from billiards_env.engine import empty_shots
from billiards_env.games import CALLS, GAMES, IN_HAND, NO_CALL, Call, Setup, referee, to_dict
from billiards_env.games import facts as shot_facts
from billiards_env.games.game_state import CALL, changed, row, set_of
from billiards_env.games.playing import History, Stroke, custom_opening, opening, play


def setup(rules, balls=None, **kwargs):
    """Returns the settings of a game on its usual table, with the most or a given number of object balls."""
    game = GAMES[rules]
    scene = Scene.named(game.scene, balls or game.n_object_balls[1])
    if rules == "snooker":  # it runs the code that is compiled for the pool games
        scene = dataclasses.replace(scene, physics=Scene.named("real_pool").physics)
    if rules == "blackball":
        scene = Scene.named("real_pool", scene.n_balls - 1)
    return Setup(rules, **{"scene": scene, **kwargs})


def flying(rules):
    """Returns the arguments of an environment of a game with flight. Snooker is played on a table of pool with a D."""
    game = GAMES[rules]
    base = Scene.named("pool" if game.pockets else "carom", min(15, game.n_object_balls[1]))
    table = dataclasses.replace(base.table, d_radius=0.2) if rules == "snooker" else base.table
    scene = dataclasses.replace(base, table=table, physics=Scene.named("jump_pool").physics)
    can_call = bool(game.callable or game.choices)
    return {"task": rules, "n_players": 2, "scene": scene, "action": "strike", "can_call": can_call, "max_shots": 40}


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


def record_of(text, times=None, cue=0):
    """Returns the records of a shot, `Shots` with m = 1, from its events.

    The text is such as "hit 0 1, cushion 1, pocket 1 5". The events are one second apart or at the given times.
    """
    shots = empty_shots(1, 1 + max(game.n_object_balls[1] for game in GAMES.values()))
    shots.cue[0], shots.first_hit[0], shots.first_hit_time[0] = cue, -1, np.inf
    shots.cushions[0], shots.touched_first[0] = 0, False
    shots.cushions_before_hit[0] = shots.pockets[0] = shots.pot_order[0] = -1
    for second, event in enumerate(event.split() for event in text.split(",") if event):
        kind, ball, other = event[0], int(event[1]), int((*event, 0)[2])
        time = second if times is None else times[second]
        if kind == "cushion":
            shots.cushions[0, ball] += 1
        elif kind == "pocket":
            shots.pot_order[0, ball], shots.pockets[0, ball] = shots.pot_order.max() + 1, other
        elif kind == "hit" and cue in (ball, other):
            hit = ball + other - cue
            if shots.first_hit[0] < 0:
                shots.first_hit[0], shots.first_hit_time[0] = hit, time
            if shots.cushions_before_hit[0, hit] < 0:
                shots.cushions_before_hit[0, hit] = shots.cushions[0, cue]
                shots.touched_first[0, hit] = time == shots.first_hit_time[0]
    return shots


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
    for name, value in fields.items():
        if isinstance(value, tuple):
            fields[name] = set_of(value) if name == "touching" else (*value, 0, 0, 0, 0)[:4]
    fields = {"break_shot": False, "cue_balls": (cues[0], cues[-1]), **fields}
    first = referee.first_state(rules, n, n_players=players)
    return changed(first, object_balls=set_of(set(balls) - {cues[0]}), **fields)


def judge(rules, before, log, call=NO_CALL):
    """Returns the state before the next shot and the ruling on a shot, in words, from its events, see `record_of`."""
    record = record_of(log, cue=int(before.cue_balls[0])) if isinstance(log, str) else log
    calls = one_call(call)
    facts = shot_facts.facts_of_shots(GAMES[rules].facts, record, None, calls)
    (after,), (verdict,) = referee.judge_shots(rules, np.array([before]), facts, calls)
    following = {"solids": -1, "colour": False, **to_dict(after)}
    return after, SimpleNamespace(**to_dict(verdict), **{name: following[name] for name in FOLLOWING})


FOLLOWING = ("in_hand", "choices", "solids", "colour", "over", "winner")
FACTS = tuple({fact for game in GAMES.values() for fact in game.facts})


def facts_in_words(record):
    """Returns all facts of a shot in words, from its records or its events, see `record_of`."""
    return words(shot_facts.facts_of_shots(FACTS, record_of(record) if isinstance(record, str) else record)[0])


def one_call(call=NO_CALL):
    """Returns a call, (1,) `CALL`."""
    return np.array([row({**call._asdict(), "kind": CALLS.index(call.kind)}, CALL)])


def one_shot(rules, before, call=NO_CALL, **facts):
    """Returns the state, the facts and the call of a shot, (1,) each. Facts that the game does not use are left out."""
    kind: Any = GAMES[rules].facts_type
    used = {name: value for name, value in facts.items() if name in kind.names}
    return np.array([before]), np.array([row(used, kind)]), one_call(call)


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
