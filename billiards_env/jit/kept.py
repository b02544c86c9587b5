"""Tuples that entry points read from memory.

Numba unpacks a tuple of arrays at each call, which takes 60 ns for each array. A `Kept` tuple is unpacked only once, by
Python. Its memory then holds what the machine code needs, such as the address and the shape of each array, and a call
reads this in a few nanoseconds.

The same machine code takes both: it unpacks a tuple, and reads the memory of a `Kept`, which is no tuple.
"""

from __future__ import annotations

import struct
from ctypes import addressof, c_char
from typing import Any

import numpy as np
from llvmlite import ir
from numba import typeof
from numba.core import cgutils, config
from numba.core.boxing import unbox_tuple
from numba.extending import NativeValue, typeof_impl
from numpy.typing import NDArray

_config: Any = config  # numba defines its attributes at run time


_WORDS, _DATA = 5, 4  # the words of an array before its shape and strides, and the one with its address


_TUPLE = 1 << 26  # Py_TPFLAGS_TUPLE_SUBCLASS


def unpack_or_read(kind: Any, value: Any, c: Any) -> Any:
    """Generates code that unpacks a tuple as numba does, or reads the memory of a `Kept`."""
    flags = c.pyapi._get_function(ir.FunctionType(ir.IntType(64), [c.pyapi.pyobj]), "PyType_GetFlags")
    flag = c.builder.and_(c.builder.call(flags, [c.pyapi.get_type(value)]), ir.Constant(ir.IntType(64), _TUPLE))
    native = cgutils.alloca_once(c.builder, c.context.get_value_type(kind))
    is_error = cgutils.alloca_once_value(c.builder, cgutils.false_bit)
    with c.builder.if_else(cgutils.is_not_null(c.builder, flag)) as (is_tuple, is_kept):
        with is_tuple:
            unpacked = unbox_tuple(kind, value, c)
            assert unpacked.cleanup is None  # the items are arrays, numbers and None
            c.builder.store(unpacked.value, native)
            c.builder.store(unpacked.is_error, is_error)
        with is_kept:
            place = c.builder.bitcast(c.pyapi.long_as_voidptr(value), native.type)
            c.builder.store(c.builder.load(place), native)
    return NativeValue(c.builder.load(native), is_error=c.builder.load(is_error))


class Kept(int):
    """A tuple for entry points that are called by `Typed`: the address of its memory.

    Attributes:
        kind: The numba type of the tuple.
        values: The tuple. Its arrays must not move in memory.
        words: Its memory, int64.
        places: The words with the addresses of the arrays, if the tuple has only arrays and None.
    """

    kind: Any
    values: tuple[Any, ...]
    words: NDArray[np.int64]
    places: NDArray[np.int64]


@typeof_impl.register(Kept)
def _kind(value: Kept, context: Any) -> Any:
    return value.kind


def kept(values: tuple[Any, ...]) -> Any:
    """Returns a tuple of arrays, numbers, None and such tuples as an argument of `Typed` entry points."""
    if _config.DISABLE_JIT:
        return values
    pattern, numbers = _packed(values)
    memory = struct.pack(pattern, *numbers)
    sizes = [_WORDS + 2 * value.ndim if isinstance(value, np.ndarray) else 1 for value in values]
    begins = np.cumsum([0, *sizes[:-1]])[[isinstance(value, np.ndarray) for value in values]]
    return _made(typeof(values), values, np.frombuffer(memory, np.int64).copy(), begins + _DATA)


def moved(like: Any, values: tuple[Any, ...], distance: int) -> Any:
    """Returns `kept(values)` in less time, for arrays at a distance in bytes from those of `like`."""
    if _config.DISABLE_JIT:
        return values
    words = like.words.copy()
    words[like.places] += distance
    return _made(like.kind, values, words, like.places)


def _made(kind: Any, values: tuple[Any, ...], words: NDArray[np.int64], places: Any) -> Kept:
    made = Kept(address_of(words))
    made.kind, made.values, made.words, made.places = kind, values, words, places
    return made


def address_of(array: NDArray[Any]) -> int:
    """Returns the address of a contiguous array of numbers that can be written, faster than NumPy does."""
    memory: Any = array
    return addressof(c_char.from_buffer(memory))


def _packed(value: Any) -> tuple[str, list[Any]]:
    """Returns the memory of a value as numba lays it out: its format for `struct.pack`, and its numbers."""
    if value is None:
        return "P", [0]
    if isinstance(value, bool):
        return "?", [value]
    if isinstance(value, int):
        return "q", [value]
    if isinstance(value, float):
        return "d", [value]
    if isinstance(value, np.ndarray):  # no owner and no parent, which only code that frees arrays needs
        head = [0, 0, value.size, value.itemsize, value.ctypes.data]
        return f"PPqqP{2 * value.ndim}q", [*head, *value.shape, *value.strides]
    if not isinstance(value, tuple):
        raise TypeError(f"value = {value!r}: expected an array, a number, None or a tuple of these")
    parts = [_packed(item) for item in value]
    pattern = "".join(part for part, _ in parts)
    edge = "0P" if pattern.strip("?") else ""  # aligned as its largest item
    return f"{edge}{pattern}{edge}", [number for _, numbers in parts for number in numbers]
