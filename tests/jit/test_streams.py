"""Compiled streams return the same numbers as numpy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env.jit import kernel, streams
from billiards_env.scene import Scene, layouts

WORDS = st.integers(0, 2**64 - 1)


@kernel
def draw(stream, out):
    for k in range(len(out)):
        out[k] = streams.next_double(stream)


@kernel
def draw_normal(stream, out):
    for k in range(len(out)):
        out[k] = streams.next_normal(stream)


@given(st.integers(0, 2**130), st.integers(0, 200))
def test_a_seeded_stream_returns_the_numbers_of_numpy(seed, count):
    rng, out, stream = np.random.default_rng(seed), np.empty(count), streams.seeded(seed)
    draw(stream, out)
    assert out.tobytes() == rng.random(count).tobytes()
    assert stream.tobytes() == streams.read(rng).tobytes()
    draw_normal(stream, out)
    assert out.tobytes() == rng.standard_normal(count).tobytes()
    assert stream.tobytes() == streams.read(streams.generator(stream)).tobytes() == streams.read(rng).tobytes()


@given(st.lists(WORDS, min_size=1, max_size=5), st.lists(st.integers(0, 2**70), max_size=2))
def test_streams_that_are_seeded_together_are_those_of_numpy(seeds, key):
    expected = [streams.seeded(np.random.SeedSequence(seed, spawn_key=key)) for seed in seeds]
    assert streams.seeded_all(np.array(seeds, np.uint64), tuple(key)).tobytes() == np.array(expected).tobytes()


def test_a_million_normal_numbers_are_those_of_numpy():
    out = np.empty(1_000_000)
    draw_normal(streams.seeded(0), out)
    assert np.abs(out).max() > 3.7  # beyond the layers, in the tail
    assert out.tobytes() == np.random.default_rng(0).standard_normal(len(out)).tobytes()


@given(WORDS, WORDS, WORDS, WORDS)
def test_any_state_and_increment_continue_as_in_numpy(hi, lo, inc_hi, inc_lo):
    bits = np.random.PCG64()
    bits.state = {**bits.state, "state": {"state": hi << 64 | lo, "inc": inc_hi << 64 | inc_lo}}
    rng = np.random.Generator(bits)
    stream, out = streams.read(rng), np.empty(3)
    assert stream.tolist() == [hi, lo, inc_hi, inc_lo]
    draw(stream, out)
    assert out.tobytes() == rng.random(3).tobytes()
    assert stream.tobytes() == streams.read(rng).tobytes()


@given(WORDS, WORDS)
def test_high_product_is_the_high_half_of_the_product(a, b):
    assert int(streams.high_product(np.uint64(a), np.uint64(b))) == a * b >> 64


def test_a_generator_continues_where_the_stream_stopped():
    rng, twin = np.random.default_rng(3), np.random.default_rng(3)
    for generator in (rng, twin):
        generator.integers(10, dtype=np.uint32)  # keeps half of a 64-bit number for the next call
    stream = streams.read(rng)
    draw(stream, np.empty(5))
    assert rng.bit_generator.state == twin.bit_generator.state
    streams.write(rng, stream)
    twin.random(5)
    assert rng.bit_generator.state == twin.bit_generator.state


@pytest.mark.parametrize("bits", [np.random.MT19937, np.random.PCG64DXSM, np.random.SFC64, np.random.Philox])
def test_other_bit_generators_can_draw_layouts(bits):
    scene = Scene.named("pool", 5)
    rng, twin = np.random.Generator(bits(1)), np.random.Generator(bits(1))
    first, second = (layouts.draw("random", scene, rng) for _ in range(2))
    assert not np.array_equal(first, second)
    assert np.array_equal(first, layouts.draw("random", scene, twin))
    assert np.array_equal(second, layouts.draw("random", scene, twin))
