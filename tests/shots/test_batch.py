import dataclasses
import math
import multiprocessing
import pickle
import threading
import time
from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, simulate, simulate_batch, strike
from billiards_env.engine import PIC, Engine, parallel_for
from billiards_env.engine.overlaps import FIXES
from billiards_env.scene import Physics
from billiards_env.shots import simulation
from tests.helpers.heap import fill_heap
from tests.helpers.shots import LAWS, draw_starts, run_both

ROLLING = Physics(motion="rolling", cushion="restitution")
BATCHES: dict[str, tuple[Scene, str, dict[str, Any]]] = {
    **{name: (Scene.named(name, 4), "random", {}) for name in LAWS},
    **{f"{n} threads": (Scene.named("pool", 4), "random", {"threads": n}) for n in (1, 2, 3)},
    **{
        f"a break of a {layout}": (Scene.named("pool", 15), layout, {"threads": 2}) for layout in ("rack", "tight_rack")
    },
    **{
        str(limit): (dataclasses.replace(Scene.named("pool", 3), physics=ROLLING), "random", limit)
        for limit in ({"max_time": 0.5}, {"max_events": 3}, {"max_time": 0.0})
    },
}


@pytest.mark.parametrize("fix", [None, *FIXES])
@pytest.mark.parametrize(("scene", "arrangement", "options"), BATCHES.values(), ids=BATCHES)
def test_a_batch_equals_single_shots_bit_for_bit(scene, arrangement, options, fix):
    engine = PIC if fix is None else Engine("pit", 1 / 60, fix)
    places, starts, spins = draw_starts(scene, 70, arrangement)
    turning = spins if scene.physics.motion == "sliding" else None
    batch, _ = run_both(scene, places, starts, turning, engine=engine, **options)
    assert (batch.first_hit > 0).any() or options.get("max_time") == 0.0


@pytest.mark.parametrize("playing", [np.arange(120).reshape(40, 3) % 7 < 5, [True, False, True]], ids=["each", "all"])
def test_the_balls_in_play_of_each_shot_or_of_all_shots_with_spins_of_all_balls(playing):
    scene, rng = Scene.named("carom"), np.random.default_rng(1)
    places, velocities, spins = draw_starts(scene, 40)[0], rng.normal(size=(40, 3, 2)), rng.normal(size=(40, 3, 3)) * 20
    batch, _ = run_both(scene, places, velocities, spins, in_play=playing)
    assert (batch.potted == ~np.array(playing)).all()


@pytest.mark.parametrize("name", ["pool", "real_pool", "snooker", "uk_pool", "carom", "ideal"])
def test_each_end_is_a_start(name):
    scene = Scene.named(name, 2)
    places, starts, spins = draw_starts(scene, 200)
    turning = None if name == "ideal" else spins
    for limit in (None, 0.3, 1.1):
        ends = simulate_batch(scene, places, starts, spins=turning, max_time=limit)
        spinning = None if name == "ideal" else ends.spins
        simulate_batch(scene, ends.positions, ends.velocities, spins=spinning, in_play=~ends.potted, max_time=limit)


def test_a_ball_at_the_lip_of_a_pocket_is_a_start():
    scene, speed = Scene.named("pool"), -0.06428243465332248
    rolling = np.array([-speed, speed, 0.0]) / scene.balls.radius[0]
    places = [[-1.1992423740278637, -0.5642423740278636], [0.0, 0.0]]
    shot = simulate(scene, places, [speed, speed], spins=rolling)
    pocket = scene.table.pockets[0]
    assert math.dist(shot.positions[0], (pocket.x, pocket.y)) < pocket.radius  # by rounding
    assert not shot.potted[0]
    again = simulate(scene, shot.positions, [0.0, 0.0])
    assert again.positions.tolist() == shot.positions.tolist()


def test_a_velocity_per_shot_is_that_of_the_cue_ball_with_as_many_balls():
    scene = Scene.named("ideal")
    batch = simulate_batch(scene, [[[-0.5, 0.0], [0.5, 0.0]]] * 2, [[0.1, 0.0], [0.0, 0.1]], max_time=1.0)
    assert batch.velocities[:, 0].tolist() == [[0.1, 0.0], [0.0, 0.1]]
    assert not batch.velocities[:, 1].any()


@pytest.mark.parametrize("m", [0, 1, 31, 64, 1000])
@pytest.mark.parametrize("threads", [None, 1, 2, 7])
def test_pieces_cover_every_shot_once(m, threads):
    done = np.zeros(m, np.int64)

    def work(begin, end):
        done[begin:end] += 1

    for _ in range(20):
        parallel_for(work, m, threads)
    assert (done == 20).all()


def threads_at_work(count):
    """Spreads work over `count` threads; returns their number, or raises if they do not work at the same time."""
    meeting = threading.Barrier(count, timeout=60)  # breaks unless `count` threads wait at once
    met = set()

    def work(begin, end):
        if begin == 0:
            time.sleep(0.01)  # the estimate of the remaining time is then long enough for several threads
        elif threading.get_ident() not in met:
            met.add(threading.get_ident())
            meeting.wait()

    parallel_for(work, 1000, count)
    return len(met)


def test_work_runs_on_several_threads_at_the_same_time():
    assert threads_at_work(3) == 3


def pieces_of(m, seconds_per_shot, monkeypatch):
    """Returns the sizes of the pieces for two threads, and the number of threads with pieces, under a mock clock."""
    now, pieces, takers = [0.0], [], set()
    monkeypatch.setattr("billiards_env.engine.threads.perf_counter", lambda: now[0])

    def work(begin, end):
        now[0] += (end - begin) * seconds_per_shot
        pieces.append((begin, end - begin))
        takers.add(threading.get_ident())

    parallel_for(work, m, 2)
    return [size for _, size in sorted(pieces)], len(takers)


def test_short_work_stays_on_one_thread(monkeypatch):
    assert pieces_of(500, 1e-6, monkeypatch) == ([8, 492], 1)
    assert pieces_of(12, 1e-12, monkeypatch) == ([1, 11], 1)


def test_pieces_shrink_to_a_least_size(monkeypatch):
    sizes, _ = pieces_of(10_000, 2**-20, monkeypatch)
    assert sum(sizes) == 10_000
    assert sizes[:3] == [8, 2498, 1873]  # a quarter of the rest, after the first piece
    assert sizes[1:] == sorted(sizes[1:], reverse=True)
    assert min(sizes[1:-1]) == 420


def test_the_last_pieces_of_long_shots_have_one_shot(monkeypatch):
    assert pieces_of(20, 1.0, monkeypatch)[0] == [1, 4, 3, 3, 2, 1, 1, 1, 1, 1, 1, 1]


def _child(queue):
    queue.put(threads_at_work(3))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_starts_new_threads():
    threads_at_work(3)  # starts threads, which a fork does not copy
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=_child, args=(queue,))
    process.start()
    try:
        assert queue.get(timeout=60) == 3
    finally:
        process.kill()
        process.join()


def test_an_error_in_any_piece_is_raised_and_the_threads_continue():
    def work(begin, end):
        if begin <= 500 < end:
            raise ValueError("piece of 500")

    for _ in range(10):
        with pytest.raises(ValueError, match="piece of 500"):
            parallel_for(work, 1000, 3)
    batch = simulate_batch(Scene.named("pool"), [[[-0.5, 0.0], [0.5, 0.0]]] * 100, [[1.0, 0.0]] * 100, threads=3)
    assert batch.first_hit.tolist() == [1] * 100


def test_a_shot_of_a_batch_is_recorded_again():
    scene = Scene.named("pool", 3)
    places, velocities, spins = draw_starts(scene, 5)
    playing = np.arange(20).reshape(5, 4) % 3 < 2
    options = {"in_play": playing, "max_time": 1.0}
    batch: Any = simulate_batch(scene, places, velocities, spins=spins, **options)
    _, expected = run_both(scene, places, velocities, spins, record=True, **options)
    assert (batch.potted >= ~playing).all()
    for array in (places, velocities, spins, playing):
        array[...] = 0  # the batch has copies
    assert len(batch) == 5
    copied: Any
    for copied in (batch, pickle.loads(pickle.dumps(batch))):
        for shot, other in zip(copied, expected, strict=True):
            assert shot.positions.tobytes() == other.positions.tobytes()
            assert np.array_equal(shot.events, other.events)
    assert np.array_equal(batch[-1].events, expected[4].events)
    hit, playing = strike(scene, np.ones(5), 0.0, 0.2), [True] + [False] * 3
    hits = simulate_batch(scene, places, hit, in_play=playing, max_time=0.1)
    assert np.array_equal(hits[2].spins, hits.spins[2])
    assert hits.spins[2].any()


@pytest.mark.parametrize("engine", [PIC, Engine("pit", 1e-3)])
def test_a_recorded_batch_reads_its_shots_from_its_log(engine, monkeypatch):
    scene = Scene.named("pool", 3)
    places, velocities, spins = draw_starts(scene, 70)  # more than are recorded first
    batch: Any = simulate_batch(scene, places, velocities, spins=spins, engine=engine, record=True)
    assert batch.log.bounds.shape == (71, 2)
    starts = zip(places, velocities, spins, strict=True)
    expected: list[Any] = [simulate(scene, x, v, spins=w, engine=engine, record=True) for x, v, w in starts]
    monkeypatch.setattr(simulation, "run_shot", None)  # no shot runs again
    for shot, one in zip(batch, expected, strict=True):
        assert all(a.tobytes() == b.tobytes() for a, b in zip(shot.log, one.log, strict=True))
        assert np.array_equal(shot.events, one.events)
        assert shot.to_record() == one.to_record()


def test_equal_batches_have_equal_pickles():
    scene, pickles = Scene.named("pool", 3), set()
    places, velocities, _ = draw_starts(scene, 5)
    sizes = []
    for byte in (0, 255):
        fill_heap(byte, *sizes)
        batch: Any = simulate_batch(scene, places, velocities, record=True)
        pickles.add(pickle.dumps(batch))
        sizes = [rows.nbytes for rows in batch.log]
        del batch
    assert len(pickles) == 1


def test_a_batch_prints_a_summary():
    scene = Scene.named("ideal")
    batch = simulate_batch(scene, [[[-0.5, 0.0], [0.0, 0.0]]] * 3, [[0.1, 0.0], [0.2, 0.0], [0.0, 0.0]])
    assert repr(batch).splitlines() == [
        "BatchResult: 3 shots of 2 balls",
        "  status: rest 1, max_time 2",
        "  time: 0 to 10, median 10 s",
        "  events: 0 to 2, median 1",
        "  shots with a potted ball: cue ball 0, object balls 0",
    ]
    assert repr(simulate_batch(scene, np.zeros((0, 2, 2)), np.zeros((0, 2)))) == "BatchResult: 0 shots of 2 balls"


def test_the_limit_of_events_has_any_type_of_whole_numbers():
    scene = dataclasses.replace(Scene.named("pool", 1), physics=dataclasses.replace(ROLLING, e_ball=0.9))
    shot = scene, [[-0.3, 0.0], [0.3, 0.0]], [1.0, 0.0]
    few: Any = np.uint8(1)
    assert simulate(*shot, max_events=few).n_events == 1
    assert simulate(*shot, max_events=256).status == "rest"
