"""The comparison of machines without an emulator: recorded calls, their file, the steps and the rows."""

import json
import shutil
import struct
import subprocess
import threading
from typing import Any

import numpy as np
import pytest

from benchmarks.machines import __main__ as machines
from benchmarks.machines import blocks, record, replay, work
from billiards_env.bench.published import HASHES
from billiards_env.jit import kernel

ENTRIES = """
#include <stdint.h>
#include <string.h>
/* An array of n numbers of 16 bits has seven words: two pointers, two sizes, the address, the shape, the step. */
static int twice(void *slots, void *out, void *error) {
  int64_t *words = slots, n = words[2];
  int16_t *numbers;
  memcpy(&numbers, words + 4, sizeof numbers);
  for (int64_t k = 0; k < n; k++) numbers[k] *= 2;
  memcpy(out, words + 7, 8);
  return 0;
}
int (*const entries[])(void *, void *, void *) = {twice};
"""


@kernel
def same(x):
    return x


def twice(numbers, factor, nothing):
    numbers *= 2
    return factor


def recorded(*numbers):
    calls = record.Calls()
    for number in numbers:
        calls.record("twice", 7, twice, np.array([1, number], np.int16), number, None)
    return calls


def rows_of(each):
    rows = [replay.packed_call(call, [7]) for call in each]
    return [row for row in rows if row is not None]


def test_recorded_calls_are_answered():
    calls = recorded(3.5, 4)
    calls.record("other", -1, lambda one: (one[0] + 1, (2.0, None)), (np.arange(3),))
    calls.calls.reverse()
    array = np.array([1, 3], np.int16)
    assert calls.answer("twice", 7, twice, array, 3.5, None) == 3.5
    assert array.tolist() == [2, 6]
    calls.answer("twice", 7, twice, array, 4, None)
    result = calls.answer("other", -1, twice, (np.arange(3),))
    assert (result[0].tolist(), result[1]) == ([1, 2, 3], (2.0, None))


def test_a_kernel_is_no_argument_of_compiled_code():
    """Kernels once took words of arguments. These moved all later arguments, so the compared functions did nothing."""
    calls = record.Calls()
    calls.record("f", 7, lambda *_: None, (same, (None,)), 3)
    ((_, _, arguments, _),) = rows_of(calls.calls)
    assert arguments == [(2, 0), (0, 3)]


def test_steps_begin_in_order_when_what_they_need_is_done(tmp_path):
    names, barrier = [], threading.Barrier(2)

    def step(name, needs, together):
        return machines.Step("", needs, lambda _: {"name": names.append(name), "at": together and barrier.wait(5)})

    steps = {"a": step("a", (), True), "b": step("b", ("a",), False), "c": step("c", (), True)}
    assert list(machines.do_all(steps, tmp_path, 2)) == ["a", "c", "b"]
    assert names[2] == "b"


def test_a_step_fails_if_what_it_needs_failed(tmp_path):
    steps = {"a": machines.Step("", (), lambda _: {"a": 1 // 0}), "b": machines.Step("", ("a",), lambda _: {})}
    done = machines.do_all(steps, tmp_path, 1)
    with pytest.raises(ZeroDivisionError):
        done["b"].result()


def test_an_error_of_a_call_is_raised_again_and_the_call_is_not_packed():
    calls = record.Calls()
    with pytest.raises(ZeroDivisionError):
        calls.record("divide", 0, lambda: 1 // 0)
    assert replay.packed_call(calls.calls[0], [0]) is None
    with pytest.raises(ZeroDivisionError):
        calls.answer("divide", 0, twice)


def test_arrays_that_overlap_are_not_packed():
    numbers, calls = np.arange(4), record.Calls()
    for other in (numbers, numbers[2:]):
        calls.record("f", 7, lambda *_: None, numbers, other)
    ((_, arrays, _, _),) = rows_of(calls.calls)
    assert len(arrays) == 1


@pytest.mark.parametrize("big", [False, True])
def test_a_file_of_calls_has_the_byte_order_of_its_machine(big):
    calls = recorded(3)
    content = replay.pack(rows_of(calls.calls), big)
    order = ">" if big else "<"
    words = struct.unpack_from(f"{order}26Q", content)
    assert words[:5] == (1, 0, 1, 9, 1)
    size, before, after = words[5:8]
    assert struct.unpack_from(f"{order}2h", content, before) == (1, 3)
    assert struct.unpack_from(f"{order}2h", content, after) == (2, 6)
    assert size == 4
    assert words[8:] == (2, 0, 2, 0, 0, 2, 0, 2, 1, 0, 0, 2, 0, 2, 0, 3, 2, 0)


def test_constants_of_a_big_endian_machine_have_the_other_order():
    assert replay.other_order("abcdefg\\00\\5C\\22345678") == "\\00gfedcba876543\\22\\5C"
    assert replay.other_order("\\\\0CDEFGH") == "HGFEDC0\\\\"  # LLVM writes a backslash as two


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_replayed_calls_are_compared_byte_by_byte(tmp_path):
    (tmp_path / "entries.c").write_text(ENTRIES)
    sources = replay.HERE / "replay.c", tmp_path / "entries.c"
    subprocess.run(["gcc", "-w", *sources, "-lm", "-o", tmp_path / "replay"], check=True)
    calls = recorded(3, 300)
    call = calls.calls[1]
    wrong = call._replace(after=[np.array([2, 601], np.int16)])
    other = call._replace(result=301)
    for one, expected in (([*calls.calls], 0), ([call, wrong, wrong], 2), ([other], 1)):
        (tmp_path / "calls").write_bytes(replay.pack(rows_of(one), False))
        command = [tmp_path / "replay", tmp_path / "calls"]
        text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        result = json.loads(text.splitlines()[-1])
        assert (result["calls"], result["other_calls"]) == (len(one), expected)


def test_a_missing_program_is_named_with_its_package(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(FileNotFoundError, match=r"^qemu-arm-static: not found; .*apt-get install qemu-user-static$"):
        replay.emulator("arm")


@pytest.fixture
def runs(tmp_path, monkeypatch):
    """The names of the steps that run, in place of the real ones, and their rows."""
    rows: dict[str, Any] = {name: {"machine": name, "compared": "all", "other": 0} for name in machines.steps_of([])}
    rows["record"]["left_out"], rows["cross"], rows["system"] = ["games.placement.limits", "a.b"], {}, {}
    rows["functions on aarch64"] |= {"machine": "control", "other": 1}
    names: list[str] = []

    def step_of(name, step):
        return step._replace(run=lambda folder: names.append(name) or rows[name])

    steps = {name: step_of(name, step) for name, step in machines.steps_of([]).items()}
    monkeypatch.setattr(machines, "steps_of", lambda names: steps)
    monkeypatch.setattr(machines, "HOME", tmp_path / "machines")
    return names, rows


def test_the_command_does_what_is_not_done(runs, tmp_path):
    output, (names, _) = ["--output", str(tmp_path / "rows.json")], runs
    machines.main(["--parts", "aarch64", *output])
    assert sorted(names) == ["aarch64", "cross", "record", "system"]
    machines.main(["--parts", "aarch64,kernels", *output])
    assert sorted(names[4:]) == sorted(f"functions on {name}" for name in (*replay.TARGETS, "aarch64"))
    written = json.loads((tmp_path / "rows.json").read_text())
    assert [row["other"] for row in written["rows"]] == [0, 0, 0, 0, 0, 0, 1]
    assert "| aarch64 " in blocks(written)["rows"]
    of_players, other = blocks(written)["left out"].splitlines()
    assert of_players.endswith("for players")
    assert other == "- `a.b`: no work calls it"


@pytest.mark.parametrize("step", ["aarch64", "functions on s390x", "functions on aarch64"])
def test_other_bits_and_a_control_that_finds_nothing_are_errors(step, runs, tmp_path):
    runs[1][step]["other"] = 1 - runs[1][step]["other"]
    with pytest.raises(SystemExit, match=f"^{runs[1][step]['machine']}: other bits, or a control"):
        machines.main(["--parts", "aarch64,kernels", "--output", str(tmp_path / "rows.json")])


def test_results_are_compared_by_name():
    row = {"machine": "here", "results": {"Pot1-v0": ["a", 100], "pots": ["b", 7]}}
    row = machines.compared(row, {"Pot1-v0": ["a", 100], "pots": ["c", 7]})
    assert (row["other"], row["names"]) == (1, ["pots"])
    assert row["compared"] == "107 results (frozen ids: 1, other work: 1)"


@pytest.mark.parametrize("option", ["--parts", "--only"])
def test_unknown_parts_and_work_are_errors(option, runs, tmp_path):
    with pytest.raises(SystemExit):
        machines.main([option, "none", "--output", str(tmp_path / "rows.json")])
    assert runs[0] == []


def test_work_is_done_once(tmp_path, monkeypatch, capsys):
    path, results = tmp_path / "results.json", {"Pot1-v0": [HASHES["Pot1-v0"], 100]}
    work.main(path, ["Pot1-v0"])
    assert json.loads(path.read_text()) == results
    assert capsys.readouterr().out.startswith("Pot1-v0: ")
    monkeypatch.delattr(work, "result_of")
    work.main(path, ["Pot1-v0"])
    assert json.loads(path.read_text()) == results
