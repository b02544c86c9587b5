"""A shot that ends at a time or at a number of events is a prefix of the whole shot, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env.engine import pic, pit
from billiards_env.engine.log import N_EVENTS_LOGGED, N_SEGMENTS_LOGGED, SEGMENT_ROW, TIME, Log
from billiards_env.engine.overlaps import FIXES
from billiards_env.engine.shots import AT_EVENT_LIMIT, AT_REST, Shots
from billiards_env.physics.state import T0
from reference import plain
from reference.stress import families
from tests.helpers.engine_runs import run

KINDS = ("pool, 1 object ball", "UK pool, 5 object balls", "15-ball break, tight rack", "ideal gas of 16 disks")


def play(engine, shot, **options):
    """Returns the `Shots` of one shot, its events and its segments."""
    arrays = run(engine, shot, record=True, **options)
    shots, log = Shots(*arrays[: len(Shots._fields)]), Log(*arrays[len(Shots._fields) :])
    return shots, log.events[: log.used[N_EVENTS_LOGGED]], log.segments[: log.used[N_SEGMENTS_LOGGED]]


def check_cuts(engine, shot, rng, **options):
    """Cuts a shot at random times, at the times of events and at numbers of events."""
    whole, events, segments = play(engine, shot, **options)
    if len(events) == 0:
        return
    times = events[rng.integers(len(events), size=3), TIME]
    limits = np.concatenate((rng.uniform(0, events[-1, TIME], 3), times, np.nextafter(times, 0)))
    for limit in limits:
        _, some, pieces = play(engine, shot, max_time=limit, **options)
        assert np.array_equal(some, events[events[:, TIME] <= limit])
        assert np.array_equal(pieces, segments[: len(pieces)])
        assert (segments[len(pieces) :, SEGMENT_ROW + T0] >= limit).all()
    if whole.status[0] == AT_REST:
        assert play(engine, shot, max_events=len(events), **options)[0].status[0] == AT_REST
    for most in rng.integers(len(events), size=3):
        shots, some, pieces = play(engine, shot, max_events=most, **options)
        assert most <= len(some) == shots.n_events[0]
        assert shots.status[0] == AT_EVENT_LIMIT or len(some) == len(events)
        assert shots.time[0] == (some[-1, TIME] if len(some) else 0.0)
        assert np.count_nonzero(some[:, TIME] < shots.time[0]) < max(most, 1)  # it ends with the instant of the limit
        assert np.array_equal(some, events[: len(some)])
        assert np.array_equal(pieces, segments[: len(pieces)])


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=8)
@given(seed=st.integers(0, 10**6))
def test_a_cut_shot_is_a_prefix(kind, seed):
    rng = np.random.default_rng(seed)
    shot = families.FAMILIES[kind](rng, 1)
    assert shot is not None
    engines = [pic.run_shots]
    if shot[0].balls.shape == "disk":  # for spheres they are not compiled
        engines += [pic.run_shots_of_many, plain.run_shots]
    if shot[0].n_balls <= 2:
        engines.append(pic.run_shots_of_at_most_two)
    for engine in engines:
        check_cuts(engine, shot, rng)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=4)
@given(seed=st.integers(0, 10**6), dt=st.sampled_from((1 / 15, 1 / 60, 1 / 240)), fix=st.sampled_from(FIXES))
def test_a_cut_shot_with_a_timestep_is_a_prefix(kind, seed, dt, fix):
    rng = np.random.default_rng(seed)
    check_cuts(pit.run_shots, families.FAMILIES[kind](rng, 1), rng, dt=dt, fix=fix)
