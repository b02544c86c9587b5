"""States and facts of games, made by hand."""

import dataclasses
from types import SimpleNamespace

import numpy as np

from billiards_env import Scene
from billiards_env.engine import empty_shots
from billiards_env.games import CALLS, GAMES, IN_HAND, NO_CALL, Call, Setup, referee, to_dict
from billiards_env.games.facts import facts_of_shots
from billiards_env.games.game_state import CALL, changed, row, set_of
from billiards_env.games.playing import History, Stroke, custom_opening, opening, play
from billiards_env.games.turn import next_games


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


def record_of(text, cue=0):
    """Returns the records of a shot, `Shots` with m = 1, from its events.

    The text is such as "hit 0 1 & hit 0 2, cushion 1, pocket 1 5, off 2". Events with "&" are at the same instant.
    """
    shots = empty_shots(1, 1 + max(game.n_object_balls[1] for game in GAMES.values()))
    shots.cue[0], shots.first_hit[0], shots.cushions[0], shots.touched_first[0] = cue, -1, 0, False
    shots.cushions_before_hit[0] = shots.pockets[0] = shots.pot_order[0] = first = -1
    for time, instant in enumerate(text.split(",") if text else ()):
        for kind, *numbers in map(str.split, instant.split("&")):
            ball, other = map(int, (*numbers, -1)[:2])
            if kind == "cushion":
                shots.cushions[0, ball] += 1
            elif kind in ("pocket", "off"):
                shots.pot_order[0, ball] = shots.pot_order.max() + 1
                shots.pockets[0, ball] = max(other, 0) if kind == "pocket" else -1
            elif cue in (ball, other):
                hit = ball + other - cue
                if shots.first_hit[0] < 0:
                    shots.first_hit[0], first = hit, time
                if shots.cushions_before_hit[0, hit] < 0:
                    shots.cushions_before_hit[0, hit] = shots.cushions[0, cue]
                    shots.touched_first[0, hit] = time == first
    return shots


def words(row):
    """Returns a row of a structured array as an object, whose attributes are in words."""
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


def one_shot(rules, before, shot, call=NO_CALL):
    """Returns the state, the facts and the call of a shot, (1,) each.

    `shot` has the events, see `record_of`, or the facts, with tuples of balls as sets.
    """
    calls = np.array([row({**call._asdict(), "kind": CALLS.index(call.kind)}, CALL)])
    if isinstance(shot, str):
        facts = facts_of_shots(GAMES[rules].facts, record_of(shot, int(before.cue_balls[0])), None, calls)
    else:
        sets = {name: set_of(value) if isinstance(value, tuple) else value for name, value in shot.items()}
        facts = np.array([row(sets, GAMES[rules].facts_type)])
    return np.array([before]), facts, calls


def judge(rules, before, shot, call=NO_CALL):
    """Returns the state before the next shot, and its fields and the verdict in words; `shot` is as in `one_shot`."""
    (after,), (verdict,) = referee.judge_shots(rules, *one_shot(rules, before, shot, call))
    return after, OWN | to_dict(after) | to_dict(verdict)


def next_game(rules, scene, before, positions, shot, call=NO_CALL):
    """Returns the positions before the next shot, and the results of `judge`; `positions` are those after the shot."""
    arrays = one_shot(rules, before, shot, call)
    (placed,), (after,), (verdict,) = next_games(GAMES[rules], scene, np.array([positions]), *arrays)
    return placed, after, to_dict(after) | to_dict(verdict)


OWN = {"solids": -1, "colour": False, "free_ball": False}
"""Fields that only the states of some games have."""

FACTS = tuple({fact for game in GAMES.values() for fact in game.facts})


def facts_in_words(events, cue=0):
    """Returns all facts of a shot in words from its events, see `record_of`."""
    return to_dict(facts_of_shots(FACTS, record_of(events, cue))[0])


def ruling(foul="", points=0, **fields):
    """Returns the expected ruling on a shot, in words: the verdict, and the fields of the next state that it sets."""
    usual = {"penalty": 0, "continues": False, "spotted": (), "rack": ""}
    after = {"in_hand": "no", "choices": (), "over": False, "winner": -1, **OWN}
    return {"foul": foul, "points": points, **usual, **after, **fields}


def in_a_row(n, places=None):
    """Returns the positions of n balls, (n, 2) m: those of `places`, by ball, and the others in a row."""
    positions = np.column_stack((0.11 * np.arange(n) - 0.9, np.full(n, -0.3)))
    for ball, place in (places or {}).items():
        positions[ball] = place
    return positions
