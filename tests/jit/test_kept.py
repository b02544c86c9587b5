"""Tuples that entry points read from memory."""

import sys
from typing import Any, NamedTuple, cast

import numpy as np
import pytest

from billiards_env.jit import Typed, address_of, allocating_entry_point, decorators, entry_point, kept, moved


class Pair(NamedTuple):
    number: float
    array: np.ndarray


@entry_point
def add_all(values, out):
    """Adds the numbers of a tuple to `out`, and changes its first array."""
    array, nothing, whole, (yes, (none, third)), pair, no, flags, last = values
    out[0] += array[1, 2] + whole + third + pair.number + pair.array[1] + last
    out[1] += (8 if yes else 0) + (4 if no else 0) + (2 if nothing is None and none is None else 0) + flags[1]
    array[0, 0] = out[0]


def made() -> tuple[Any, ...]:
    """Returns a tuple of all kinds of items."""
    pair = Pair(0.5, np.arange(9.0)[::4])
    return np.arange(6.0).reshape(2, 3), None, 10, (True, (None, 0.25)), pair, False, np.array([1, 1]), 100.0


@pytest.mark.parametrize("decorate", [entry_point, allocating_entry_point])
def test_one_machine_code_reads_plain_and_kept_tuples(decorate):
    add, results = Typed(decorate(cast(Any, add_all).py_func)), []
    for keep in (kept, tuple, kept):
        values, out = made(), np.zeros(2)
        counts = [sys.getrefcount(values[0])]
        for _ in range(3):
            add.call(keep(values), out)
        counts.append(sys.getrefcount(values[0]))
        assert counts[0] == counts[1]
        assert values[0][0, 0] == out[0]
        results.append(out.tolist())
    assert results == [[3 * 119.75, 3 * 11.0]] * 3


def test_moved_tuples_read_another_block():
    def in_block(block):
        return block[:2], block[2:6].reshape(2, 2)

    @entry_point
    def double(arrays):
        arrays[0][0] *= 2.0
        arrays[1][1, 0] *= 2.0

    block, change = np.arange(1.0, 7.0), Typed(double)
    first = kept(in_block(block))
    other = block.copy()
    second = moved(first, in_block(other), address_of(other) - address_of(block))
    change.call(second)
    assert block.tolist() == [1, 2, 3, 4, 5, 6]
    assert other.tolist() == [2, 2, 3, 4, 10, 6]
    assert second.words.tolist() == kept(in_block(other)).words.tolist()
    change.call(first)
    assert block.tolist() == other.tolist()


def test_kept_tuples_have_only_what_has_a_layout():
    with pytest.raises(TypeError, match="value = 'text': expected an array, a number, None or a tuple"):
        kept((1.0, "text"))


def test_without_numba_a_kept_tuple_is_the_tuple(monkeypatch):
    monkeypatch.setattr(decorators._config, "DISABLE_JIT", True)
    values = made()
    assert kept(values) is values
    assert moved(None, values, 8) is values
