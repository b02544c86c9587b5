"""Each reader of files refuses damaged, endless and huge files with an OSError or a ValueError that names the file."""

import functools
import gzip
import os
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml

import studies
from agents import config, train
from agents.ppo import PPOTraining, make_ppo, make_vec_env
from billiards_env import Scene, simulate
from billiards_env.bench import benchmark as bench
from billiards_env.calibration import read_tracks
from billiards_env.envs import load_state, make_vector_env, save_state
from billiards_env.games import records as games
from billiards_env.sb3.weights import build_policy, load_policy, read_weights, save_policy, set_weights
from billiards_env.shots import records
from billiards_env.support import files
from tests.helpers.games import random_game, setup
from tests.helpers.training import settings

LEADERBOARD = Path(__file__).parents[1] / "docs" / "leaderboard"
ENV, POLICY = {"task": "pot", "n_object_balls": 1}, {"head": "gaussian", "hidden": [8], "activation": "tanh"}
ROWS = "shot,time,ball,x,y\na,0,0,0.1,0.2\na,0.02,0,0.11,0.2\nb,0,red,1e-1,-.2\n"
FRAMES = "time;cue_x;cue_y;red_x;red_y\n0;0,1;0,2;0,3;0,4\n0,02;0,11;0,2;;\n"
LISTS = '[{"id": 1, "balls": {"1": {"t": [0, 1], "x": [0, 0.1], "y": [0, 0]}, "2": {"t": [0], "x": [1], "y": [1]}}}]'
CURVE = "steps,seconds,training_success,success,score\n256,1.5,0.5,0.25,0.1\n512,3,1,1,1\n"


class Reader(NamedTuple):
    """A reader: the name of a file, a function that writes it, and one that returns a function that reads it."""

    name: str
    write: Callable[[Path], Any]
    make: Callable[[], Callable[[Path], Any]]


def text_file(text: str) -> Callable[[Path], Any]:
    return lambda path: path.write_text(text)


def write_state(path: Path) -> None:
    envs = make_vector_env(2, n_object_balls=1)
    envs.reset(seed=0)
    save_state(path, envs.get_state())


def write_shot(path: Path) -> None:
    records.save(path, simulate("pool", [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True).to_record())


def write_game(path: Path) -> None:
    games.save(path, games.record_game(random_game(setup("nine_ball"), 2, 3)[0]))


def write_weights(path: Path) -> None:
    save_policy(build_policy(ENV, POLICY), path)


def set_file(policy: Any, path: Path) -> None:
    set_weights(policy, read_weights(path), path)


def write_run(path: Path) -> None:
    path.write_text(yaml.safe_dump({"env": ENV, "policy": POLICY}))
    write_weights(path.with_name("policy.pt"))


@functools.cache
def training() -> PPOTraining:
    chosen, training = config.Config.from_dict(settings()), PPOTraining.__new__(PPOTraining)  # without a folder
    training.model = make_ppo(chosen, make_vec_env(chosen))
    return training


READERS = {
    "state": Reader("a.npz", write_state, lambda: load_state),
    "weights": Reader("a.pt", write_weights, lambda: functools.partial(set_file, build_policy(ENV, POLICY))),
    "checkpoint": Reader("256.zip", lambda path: training().save(path), lambda: training().load),
    "shot": Reader("a.json", write_shot, lambda: records.load),
    "game": Reader("a.json", write_game, lambda: games.load),
    "scene": Reader(
        "a.json",
        lambda path: files.write_json(path, Scene.named("real_pool").to_dict()),
        lambda: lambda path: records.read_scene(str(path)),
    ),
    "bench": Reader("a.json", text_file((LEADERBOARD / "ppo_points.json").read_text()), lambda: bench.load),
    "results": Reader("a.json", text_file('{"settings": {}, "a": [1, {"b": null}]}'), lambda: studies.read_results),
    "rows of tracks": Reader("a.csv", text_file(ROWS), lambda: read_tracks),
    "frames of tracks": Reader("a.csv", text_file(FRAMES), lambda: read_tracks),
    "packed tracks": Reader(
        "a.csv.gz", lambda path: path.write_bytes(gzip.compress(ROWS.encode())), lambda: read_tracks
    ),
    "lists of tracks": Reader("a.json", text_file(LISTS), lambda: read_tracks),
    "settings": Reader("a.yaml", text_file(yaml.safe_dump(settings())), lambda: config.load),
    "run": Reader("config.yaml", write_run, lambda: lambda path: load_policy(path.parent)),
    "curve": Reader("training.csv", text_file(CURVE), lambda: lambda path: train.learning_curve(path.parent)),
}
PARTS = [b'"', b"[", b"{", b"}", b",", b"\n", b"\x00", b"-1", b"1e999", b"NaN", b"!!bool ", b"&a ", b": ", b"9" * 5000]
"""Texts that are inserted, besides random bytes."""


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Returns the content after one to three cuts, insertions, or flips of bits."""
    changed = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        at, kind = int(rng.integers(len(changed) + 1)), rng.integers(5)
        if kind == 0:
            changed = changed[:at]
        elif kind == 1:
            changed[at:at] = PARTS[rng.integers(len(PARTS))]
        elif kind == 2:
            changed[at:at] = rng.bytes(int(rng.integers(1, 9)))
        elif at < len(changed):
            changed[at] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def refusal(read: Callable[[Path], Any], path: Path) -> str | None:
    """Returns the message with which a reader refuses a file, None if it reads it."""
    try:
        read(path)
    except (OSError, ValueError) as error:
        return str(error)
    return None


@pytest.mark.parametrize("name", READERS)
def test_a_damaged_file_is_read_or_refused(name, tmp_path):
    path, read, rng = tmp_path / READERS[name].name, READERS[name].make(), np.random.default_rng(0)
    READERS[name].write(path)
    assert refusal(read, path) is None
    content, messages = path.read_bytes(), []
    for _ in range(150):
        path.write_bytes(damaged(content, rng))
        messages.append(refusal(read, path))
    refused = [message for message in messages if message is not None]
    assert len(refused) > 40
    assert [message for message in refused if "expected" not in message or "\n" in message] == []


@pytest.mark.parametrize("name", READERS)
def test_a_pipe_a_folder_and_a_huge_file_are_refused(name, tmp_path):
    read = READERS[name].make()
    for make in (os.mkfifo, Path.mkdir, Path.touch):
        (tmp_path / make.__name__).mkdir()
        path = tmp_path / make.__name__ / READERS[name].name
        path.with_name("policy.pt").touch()  # of a run
        make(path)
        if path.is_file():
            os.truncate(path, 2**40)
        message = refusal(read, path)
        assert message is not None
        assert ("expected" in message, path.parent.name in message) == (True, True)


ARCHIVES = [name for name, reader in READERS.items() if Path(reader.name).suffix in (".npz", ".pt", ".zip")]


@pytest.mark.parametrize("name", ARCHIVES)
@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_small_file_that_unpacks_to_a_large_one_is_refused(name, method, tmp_path, monkeypatch):
    path, read = tmp_path / READERS[name].name, READERS[name].make()
    monkeypatch.setattr(files, "MAX_ARCHIVE", 2**20)
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("state.npy", bytes(2**25))
    tracemalloc.start()
    try:
        message, most = refusal(read, path), tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert f"{path}': expected a" in str(message)
    assert most < 2**23


HEADS = ["{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000000000,)}", "{'descr': '|O', 'shape': (1" * 9]


@pytest.mark.parametrize("head", HEADS)
def test_an_array_with_a_wrong_head_is_refused(head, tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("state.npy", b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode())
    assert "a.npz': expected a file of save_state (" in str(refusal(load_state, tmp_path / "a.npz"))


def test_a_state_that_could_not_be_read_is_not_written(tmp_path, monkeypatch):
    envs: Any = make_vector_env(2, n_object_balls=1)
    monkeypatch.setattr("billiards_env.envs.snapshots.MAX_ARCHIVE", 2**16 + 100)
    with pytest.raises(ValueError, match=r"state has \d+ bytes: expected at most 100"):
        save_state(tmp_path / "a.npz", envs.get_state())
    wrong: tuple[Any, ...] = None, np.zeros(2), np.ma.masked_array(envs.get_state())
    for other in wrong:
        with pytest.raises(TypeError, match=r"state = .*: expected an array that get_state returned"):
            save_state(tmp_path / "a.npz", other)
    assert os.listdir(tmp_path) == []
