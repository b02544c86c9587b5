import contextlib
import dataclasses
import functools
import json
import math
import operator
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env import Engine, Scene, __version__, simulate, strike
from billiards_env.games import GAMES, records, to_dict
from billiards_env.scene import Balls
from billiards_env.shots import records as shot_records
from billiards_env.shots import simulation
from tests.helpers.errors import refusals
from tests.helpers.games import random_game, setup

POOL = [[-0.635, 0.0], [0.635, 0.3]]
MASSES = Scene(Balls((0.03, 0.03, 0.04), (0.2, 0.1 + 0.2, math.inf)))
SHOTS: dict[str, dict[str, Any]] = {  # what differs from a shot with a velocity alone
    "plain": {},
    "numpy": {"positions": np.array(POOL), "velocities": np.array([2.0, 0.45], np.float32)},
    "spins": {"spins": [1 / 3, -20.0, 30.1]},
    "in_play": {"in_play": [True, False]},
    "pit": {"engine": Engine("pit", 1 / 60, "move_back"), "max_time": np.float64(2.5)},
    "masses": {"scene": MASSES, "positions": [[-0.5, 0.0], [0.1, 0.01], [0.7, -0.0]], "velocities": [1.0, -0.0]},
    "event_limit": {"max_events": 3},
    "in ideal": {"scene": Scene.named("ideal")},
    "in real_pool": {"scene": Scene.named("real_pool")},
}


def recorded_shot(name="plain"):
    shot = {"scene": "pool", "positions": POOL, "velocities": [2.0, 0.45], "record": True, **SHOTS[name]}
    return simulate(**shot).to_record()


def recorded_game(rules="nine_ball", shots=12, **kwargs):
    history, _ = random_game(setup(rules, **kwargs), 2, shots)
    return records.record_game(history)


@functools.cache
def shot_text():
    return records.to_json(recorded_shot())


@functools.cache
def game_text():
    return records.to_json(recorded_game())


RECORDS = {
    **{name: functools.partial(recorded_shot, name) for name in SHOTS},
    **{rules: functools.partial(recorded_game, rules) for rules in GAMES},
    "options": lambda: recorded_game("straight", 40, target=40, call_shot=True, edition="2025"),
    "pit game": lambda: recorded_game(engine=Engine("pit", 1 / 100)),
}


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_survives_a_file_and_replays_bit_for_bit(name, tmp_path):
    record = RECORDS[name]()
    records.save(tmp_path / "a.json", record)
    loaded = records.load(tmp_path / "a.json")
    assert loaded == record
    assert repr(loaded) == repr(record)  # text distinguishes 0.0 and -0.0
    records.save(str(tmp_path / "b.json"), loaded)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    data = json.loads((tmp_path / "a.json").read_text(), parse_constant=pytest.fail)  # strict JSON
    assert data["format"] == ("billiards_env/shot" if name in SHOTS else "billiards_env/game")
    assert (data["version"], data["written_by"]) == (2, f"billiards_env {__version__}")
    played: Any = records.replay(loaded)
    end: Any = loaded.end
    assert played.positions.tolist() == [list(row) for row in end.positions]
    if isinstance(loaded, records.GameRecord):
        assert to_dict(played.state)["scores"] == end.scores
    else:
        assert (played.status, played.time, played.n_events) == (end.status, end.time, end.n_events)
        assert played.events is None
        assert records.replay(loaded, record_events=True).events is not None


def test_a_replay_with_another_result_raises():
    record = recorded_shot()
    (x, y), *others = record.end.positions
    end = dataclasses.replace(record.end, positions=((float(np.nextafter(x, 1.0)), y), *others))
    wrong = dataclasses.replace(record, end=end)
    with pytest.raises(ValueError, match="the replay differs from the record: positions = "):
        records.replay(wrong)
    assert records.replay(wrong, check=False).positions[0, 0] == record.end.positions[0][0]
    played = recorded_game()
    with pytest.raises(ValueError, match="the replay differs from the record: scores = "):
        records.replay(dataclasses.replace(played, end=dataclasses.replace(played.end, scores=(7, 0))))


def test_an_impossible_stroke_is_named_by_its_index():
    record = recorded_game()
    strokes = (record.strokes[0]._replace(place=None), *record.strokes[1:])
    with pytest.raises(ValueError, match=r"strokes\[0\]: stroke.place = None"):
        records.replay(dataclasses.replace(record, strokes=strokes))
    assert record.history.strokes == record.strokes


# Files.


def test_a_file_that_is_too_large_is_rejected_before_it_is_parsed(tmp_path, monkeypatch):
    """A file of 63 MB of empty lists once took 1.9 GB and ten seconds."""
    assert shot_records.MAX_BYTES == 4 * 2**20
    records.save(tmp_path / "shot.json", recorded_shot())
    monkeypatch.setattr(shot_records.json, "loads", lambda *_, **__: pytest.fail("the file was parsed"))
    monkeypatch.setattr(shot_records, "MAX_BYTES", 100)
    with pytest.raises(ValueError, match="more than 100 bytes"):
        records.load(tmp_path / "shot.json")
    with pytest.raises(ValueError, match=r"a text of \d+ characters: expected at most 100"):
        records.from_json((tmp_path / "shot.json").read_text())


# Invalid files. A path such as "scene.table.length" names the value that is changed.

DROP, MANY = object(), {"radius": [0.03] * 2000, "mass": [0.1] * 2000, "colours": "pool", "shape": "disk"}
SHOT_FAULTS = [
    ("format", DROP, "format = None: expected 'billiards_env/shot' or 'billiards_env/game'"),
    ("version", 3, "version = 3: expected 2; another version of billiards_env wrote the data"),
    ("version", DROP, "version = None: expected 2"),
    ("scene.version", 2, "scene.version = 2: expected 1; another version of billiards_env wrote the data"),
    ("positions", DROP, "key 'positions' of the file is missing"),
    ("colour", "red", "key 'colour' of the file is unknown"),
    ("positions", [[0, 0]], "positions = .*: expected a list of 2"),
    ("positions.1.0", 10**400, r"positions\[1\]\[0\] = 1000.*: expected a finite number"),
    ("positions.1.0", 5.0, "positions: ball 1 is at"),
    ("positions.1", POOL[0], "positions: balls 0 and 1 are"),
    # A small file with such a velocity could once keep `replay` busy forever.
    ("velocities.0.0", 1e200, r"velocities\[0\] = .*: expected numbers from -1000 to 1000 m/s"),
    ("spins", [[0, 0], [0, 0]], r"spins\[0\] = \[0, 0\]: expected a list of 3"),
    ("mode", "pit", "dt = None"),
    ("scene.table.lenght", 2.0, "key of scene.table = 'lenght'.*did you mean 'length'"),
    ("scene.balls", MANY, "number of balls = 2000: expected a whole number from 1 to 1000"),
    ("end.status", "stop", "end.status = 'stop'"),
]
GAME_FAULTS = [
    ("rules", "eight_ball", "expected 15"),
    ("state.breaker", DROP, "key 'breaker' of state is missing"),
    ("positions.5", [9.0, 0.0], "positions: ball 5"),
    ("strokes.3.velocity", [1.0], r"strokes\[3\].velocity = \[1.0\]"),
    ("strokes.0.velocity.0", 1e200, r"strokes\[0\].velocity\[0\] = .*: expected a number from -1000 to 1000 m/s"),
    ("strokes.3.spin.2", 1e9, r"strokes\[3\].spin\[2\] = 1000000000.0"),
    ("strokes.0.call.ball", 10, r"strokes\[0\].call.ball = 10: expected a whole number from -1 to 9"),
    ("strokes.0.call.kind", "pass", r"strokes\[0\].call.kind = 'pass'"),
    ("strokes.0.place", [None, 0], r"strokes\[0\].place\[0\] = None"),
    ("version", 1, "version = 1: expected 2"),
    ("state.idle", DROP, "key 'idle' of state is missing"),
    ("edition", DROP, "key 'edition' of the file is missing"),
    ("end.winner", 2, "end.winner = 2"),
]


def changed(text, path, value, is_new=False):
    """Returns a text with the value at a path changed or removed or, if `is_new`, with a value added."""
    data = json.loads(text)
    *parents, last = path
    inner = functools.reduce(operator.getitem, parents, data)
    if value is DROP:
        del inner[last]
    elif is_new and isinstance(inner, list):
        inner.insert(last, value)
    else:
        inner[f"{last}s" if is_new else last] = value
    return json.dumps(data)


FAULTS = [(shot_text, *fault) for fault in SHOT_FAULTS] + [(game_text, *fault) for fault in GAME_FAULTS]


@refusals("text, path, value", FAULTS)
def test_an_invalid_file_is_rejected_with_the_reason(text, path, value, message, kind):
    parts = [int(part) if part.isdigit() else part for part in path.split(".")]
    with pytest.raises(kind, match=message):
        records.from_json(changed(text(), parts, value))


def paths_of(value, path=()):
    """Yields the path to every value in nested lists and dicts."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from paths_of(inner, (*path, key))


@pytest.mark.parametrize("text", [shot_text, game_text])
def test_a_value_of_a_wrong_type_is_named(text):
    for path in filter(None, paths_of(json.loads(text()))):
        *_, name = (part for part in path if isinstance(part, str))
        with pytest.raises(ValueError, match=rf"\b{name}\b"):
            records.from_json(changed(text(), path, {"other": []}))


DAMAGES = [
    (lambda _: "", "Expecting value"),
    (lambda _: b"\xff\xfe\x00{", "utf-8"),
    (lambda _: "null", "the file = None: expected a mapping"),
    (lambda _: "NaN", "NaN: expected a finite number"),
    (lambda _: "[" * 100_000 + "]" * 100_000, "nested too deeply"),
    (lambda text: text.replace("{", '{"format": "billiards_env/shot", ', 1), "key 'format' appears twice"),
    (lambda text: text.replace('"version": ', '"version": ' + "9" * 5000), "."),
    (lambda text: text.replace("[[-0.635,", "[[1e999,"), r"positions\[0\]\[0\] = inf: expected a finite number"),
    (lambda text: text[: len(text) // 2], "."),
    (lambda text: text + "x", "Extra data"),
]


@refusals("damage", DAMAGES)
def test_a_file_that_is_not_a_record_is_rejected_with_its_path(damage, message, kind, tmp_path):
    path, content = tmp_path / "shot.json", damage(shot_text())
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(kind, match=f"{re.escape(str(path))}.*{message}"):
        records.load(path)


ANYTHING = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=5),
        st.sampled_from([10**400, -(10**400), "inf", "pic", "pit", 1e308, -0.0, 2**63]),
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)),
    max_leaves=5,
)


def paths():
    """Returns the texts of a shot and of a game with the path to each value in them, as a strategy."""
    texts = shot_text(), game_text()
    return st.sampled_from([(text, path) for text in texts for path in paths_of(json.loads(text)) if path])


@given(st.deferred(paths), st.just(DROP) | ANYTHING, st.booleans())
def test_a_changed_value_is_either_valid_or_a_value_error(target, value, is_new):
    text, path = target
    try:
        record = records.from_json(changed(text, path, value, is_new))
    except ValueError:
        return
    assert records.from_json(records.to_json(record)) == record


@given(st.data())
def test_changed_bytes_are_either_valid_or_a_value_error(tmp_path_factory, data):
    text = bytearray(data.draw(st.sampled_from([shot_text(), game_text()])).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        text[at : at + data.draw(st.integers(0, 20))] = data.draw(st.binary(max_size=4))
    path = tmp_path_factory.getbasetemp() / "mangled.json"
    path.write_bytes(bytes(text))
    with contextlib.suppress(ValueError):
        records.load(path)


def test_loading_does_not_simulate(monkeypatch):
    texts = shot_text(), game_text()

    for module, name in ((simulation, "simulate"), (records, "play")):
        monkeypatch.setattr(module, name, lambda *_, **__: pytest.fail("a shot was run"))
    for text in texts:
        records.from_json(text)


def test_a_shot_saves_itself(tmp_path):
    scene = Scene.named("pool")
    hit = strike(scene, 2.0, 0.2, side=0.3)
    shot = simulate(scene, POOL, hit, max_time=3.0, record=True)
    shot.save(tmp_path / "shot.json")
    record = shot_records.load(tmp_path / "shot.json")
    assert record == simulate(scene, POOL, hit, record=True, max_time=3.0).to_record()
    assert (record.velocities[0], record.max_time) == (tuple(hit.velocity.tolist()), 3.0)
    assert records.replay(record).positions.tobytes() == shot.positions.tobytes()
    with pytest.raises(ValueError, match=r"shot = ShotResult.*: expected a recorded shot"):
        simulate(scene, POOL, hit).save(tmp_path / "shot.json")
    with pytest.raises(ValueError, match="format = 'billiards_env/game': expected 'billiards_env/shot'"):
        shot_records.from_json(game_text())
