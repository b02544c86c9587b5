"""Random streams for kernels: numpy's PCG64, bit for bit.

A stream is four uint64: the high and low halves of the generator's 128-bit state and of its increment. A stream read
from a `numpy.random.Generator` continues with the numbers that `Generator.random` would return.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.jit import kernel

Stream = NDArray[np.uint64]

_MASK = (1 << 64) - 1
# The multiplier of a 128-bit linear congruential generator (O'Neill 2014, PCG, HMC-CS-2014-0905), in halves.
_MULTIPLIER_HI, _MULTIPLIER_LO = np.uint64(0x2360ED051FC65DA4), np.uint64(0x4385DF649FCCF645)
_LOW_HALF = np.uint64(0xFFFFFFFF)
_1, _11, _32, _58, _63 = (np.uint64(bits) for bits in (1, 11, 32, 58, 63))
_TO_UNIT = 2.0**-53


def seeded(seed: int) -> Stream:
    """Returns the (4,) uint64 stream of `numpy.random.default_rng(seed)`."""
    return _halves(np.random.PCG64(seed))


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
        hi, lo = stream[:2].tolist()
        state["state"]["state"] = hi << 64 | lo
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
def next_double(stream):
    """Returns the next number of a stream from [0, 1), the same as `Generator.random()`."""
    hi, lo = stream[0], stream[1]
    hi = hi * _MULTIPLIER_LO + lo * _MULTIPLIER_HI + high_product(lo, _MULTIPLIER_LO)
    lo = lo * _MULTIPLIER_LO
    low = lo + stream[3]
    hi += stream[2]
    if low < lo:
        hi += _1
    stream[0], stream[1] = hi, low
    mixed, rotation = hi ^ low, hi >> _58
    mixed = (mixed >> rotation) | (mixed << (-rotation & _63))
    return (mixed >> _11) * _TO_UNIT
