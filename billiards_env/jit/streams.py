"""Random streams for kernels: numpy's PCG64, bit for bit.

A stream is four uint64: the high and low halves of the generator's 128-bit state and of its increment. A stream read
from a `numpy.random.Generator` continues with the numbers that `Generator.random` would return.
"""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
from numba.np.random import _constants as ziggurat  # the tables of numpy, which does not export them
from numpy.typing import NDArray

from billiards_env.jit import kernel

Stream = NDArray[np.uint64]

_MASK = (1 << 64) - 1
# The multiplier of a 128-bit linear congruential generator (O'Neill 2014, PCG, HMC-CS-2014-0905), in halves.
_MULTIPLIER_HI, _MULTIPLIER_LO = np.uint64(0x2360ED051FC65DA4), np.uint64(0x4385DF649FCCF645)
_LOW_HALF = np.uint64(0xFFFFFFFF)
_1, _8, _9, _11, _32, _58, _63 = (np.uint64(bits) for bits in (1, 8, 9, 11, 32, 58, 63))
_LAYERS, _PLACES = np.uint64(0xFF), np.uint64(0x000FFFFFFFFFFFFF)
_TO_UNIT = 2.0**-53
# The constants of `numpy.random.SeedSequence`.
_INIT_A, _MULT_A, _INIT_B, _MULT_B, _SHIFT = 0x43B0D7E5, 0x931E8875, 0x8B51F9DD, 0x58F38DED, np.uint32(16)
_MIX_LEFT, _MIX_RIGHT = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)


def seeded(seed: int | np.random.SeedSequence) -> Stream:
    """Returns the (4,) uint64 stream of `numpy.random.default_rng(seed)`."""
    return _halves(np.random.PCG64(seed))


def seeded_all(seeds: NDArray[np.uint64], spawn_key: tuple[int, ...] = ()) -> Stream:
    """Returns the (m, 4) uint64 streams of `SeedSequence(seed, spawn_key=spawn_key)` for seeds (m,).

    It is `numpy.random.SeedSequence` (O'Neill 2015, Developing a seed_seq alternative) for all seeds together.
    """
    low, high = seeds.astype(np.uint32), (seeds >> _32).astype(np.uint32)
    zero = np.zeros_like(low)
    words = [low, high, zero, zero]
    for number in spawn_key:
        parts = [number >> shift & 0xFFFFFFFF for shift in range(0, max(number.bit_length(), 1), 32)]
        words += [np.full_like(low, part) for part in parts]
    pool, factor = [], _INIT_A
    for word in words[:4]:
        word, factor = _hashed(word, factor, _MULT_A)
        pool.append(word)
    for source in range(len(words)):
        for target in range(4):
            if source != target:
                word, factor = _hashed(pool[source] if source < 4 else words[source], factor, _MULT_A)
                mixed = _MIX_LEFT * pool[target] - _MIX_RIGHT * word
                pool[target] = mixed ^ mixed >> _SHIFT
    drawn, factor = [], _INIT_B
    for k in range(8):
        word, factor = _hashed(pool[k % 4], factor, _MULT_B)
        drawn.append(word.astype(np.uint64))
    state_hi, state_lo, sequence_hi, sequence_lo = (drawn[k] | drawn[k + 1] << _32 for k in range(0, 8, 2))
    # PCG64 starts with the increment 2 * sequence + 1 and one step from the state plus the increment.
    increment_hi, increment_lo = sequence_hi << _1 | sequence_lo >> _63, sequence_lo << _1 | _1
    lo = state_lo + increment_lo
    hi = state_hi + increment_hi + (lo < state_lo)
    product = getattr(high_product, "py_func", high_product)  # of arrays
    hi = hi * _MULTIPLIER_LO + lo * _MULTIPLIER_HI + product(lo, _MULTIPLIER_LO)
    lo = lo * _MULTIPLIER_LO + increment_lo
    hi += increment_hi + (lo < increment_lo)
    return np.column_stack((hi, lo, increment_hi, increment_lo))


def _hashed(words: Any, factor: int, multiplier: int) -> tuple[Any, int]:
    """Returns hashed words, and the factor of the next ones."""
    following = factor * multiplier & 0xFFFFFFFF
    words = (words ^ np.uint32(factor)) * np.uint32(following)
    return words ^ words >> _SHIFT, following


def drawn(count: int, rng: np.random.Generator) -> Stream:
    """Returns (count, 4) uint64 streams with random states and increments. Each increment is odd."""
    return rng.integers(0, 2**64, (count, 4), np.uint64) | np.array((0, 0, 0, 1), np.uint64)


def are_seeded(streams: Stream) -> NDArray[np.bool_]:
    """Returns for streams (..., 4) whether the increment is odd, as that of each seeded one (O'Neill 2014)."""
    return streams[..., 3] % 2 == 1


def generator(stream: Stream) -> np.random.Generator:
    """Returns a generator that continues with the numbers of a stream."""
    rng = np.random.Generator(np.random.PCG64(0))
    write(rng, stream)
    return rng


def copied(rng: np.random.Generator | None) -> np.random.Generator | None:
    """Returns a copy of a generator, which draws the same numbers, ten times as fast as `copy.deepcopy`.

    Both have one `SeedSequence`, so what they spawn differs.
    """
    if rng is None or type(rng.bit_generator) is not np.random.PCG64:
        return copy.deepcopy(rng)
    twin = np.random.PCG64(rng.bit_generator.seed_seq)
    twin.state = rng.bit_generator.state
    return np.random.Generator(twin)


def read(rng: np.random.Generator) -> Stream:
    """Returns the present stream of a generator.

    Args:
        rng: A generator. If it does not use PCG64, it draws the seed of a PCG64 stream.

    Returns:
        (4,) uint64, a copy; `write` stores it in the generator again.
    """
    bits = rng.bit_generator
    return _halves(bits) if isinstance(bits, np.random.PCG64) else seeded(int(rng.integers(1 << 63)))


def write(rng: np.random.Generator, stream: Stream) -> None:
    """Stores `stream` in `rng`, from which it was read, so that `rng` continues after the numbers drawn."""
    bits = rng.bit_generator
    if isinstance(bits, np.random.PCG64):  # `read` has already advanced any other generator
        state = bits.state
        hi, lo, increment_hi, increment_lo = stream.tolist()
        state["state"] = {"state": hi << 64 | lo, "inc": increment_hi << 64 | increment_lo}
        bits.state = state


def _halves(bits: np.random.PCG64) -> Stream:
    words: Any = bits.state["state"]
    state, increment = words["state"], words["inc"]
    return np.array((state >> 64, state & _MASK, increment >> 64, increment & _MASK), np.uint64)


@kernel
def high_product(a, b):
    """Returns the high 64 bits of the 128-bit product of two uint64."""
    a_hi, a_lo, b_hi, b_lo = a >> _32, a & _LOW_HALF, b >> _32, b & _LOW_HALF
    cross = a_hi * b_lo + (a_lo * b_lo >> _32)
    other = a_lo * b_hi + (cross & _LOW_HALF)
    return a_hi * b_hi + (cross >> _32) + (other >> _32)


@kernel
def next_uint64(stream):
    """Returns the next number of a stream, the same as `PCG64.random_raw()`."""
    hi, lo = stream[0], stream[1]
    hi = hi * _MULTIPLIER_LO + lo * _MULTIPLIER_HI + high_product(lo, _MULTIPLIER_LO)
    lo = lo * _MULTIPLIER_LO
    low = lo + stream[3]
    hi += stream[2]
    if low < lo:
        hi += _1
    stream[0], stream[1] = hi, low
    mixed, rotation = hi ^ low, hi >> _58
    return (mixed >> rotation) | (mixed << (-rotation & _63))


@kernel
def next_double(stream):
    """Returns the next number of a stream from [0, 1), the same as `Generator.random()`."""
    return (next_uint64(stream) >> _11) * _TO_UNIT


@kernel
def next_normal(stream):
    """Returns the next normal number of a stream, the same as `Generator.standard_normal()`.

    Source: Marsaglia and Tsang 2000, The ziggurat method for generating random variables, with 256 layers.
    """
    while True:
        bits = next_uint64(stream)
        layer, negative, place = bits & _LAYERS, bits >> _8 & _1, bits >> _9 & _PLACES
        x = place * ziggurat.wi_double[layer]
        if place < ziggurat.ki_double[layer]:
            return -x if negative else x
        if layer == 0:  # the tail
            while True:
                beyond = -ziggurat.ziggurat_nor_inv_r * math.log1p(-next_double(stream))
                height = -math.log1p(-next_double(stream))
                if height + height > beyond * beyond:
                    x = ziggurat.ziggurat_nor_r + beyond
                    return -x if place >> _8 & _1 else x
        low, high = ziggurat.fi_double[layer], ziggurat.fi_double[layer - _1]
        if (high - low) * next_double(stream) + low < math.exp(-0.5 * x * x):
            return -x if negative else x
