"""Ctrl-C interrupts long calls. The calls run in a separate process, whose program is this file."""

import contextlib
import copy
import dataclasses
import functools
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from benchmarks.reference.stress import measure
from billiards_env import Engine, derivatives, simulate, simulate_batch, strike
from billiards_env.engine.compile import MANY_BALLS
from billiards_env.engine.runner import LOOK_AFTER
from billiards_env.engine.shot_input import check_shot
from billiards_env.jit.interrupt import Stopped
from billiards_env.physics.laws.tables import CUSHIONS
from billiards_env.scene import Scene, layouts
from billiards_env.scene.table import POOL_RADIUS
from tests.helpers.arrays import counted_arrays
from tests.helpers.environments import same
from tests.helpers.looks import looks
from tests.helpers.shots import lattice

LONG = 10**9  # events

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot send Ctrl-C to a process")


@contextlib.contextmanager
def long_call(state: Callable[[], Any]) -> Iterator[None]:
    """Announces a long call. Checks after it, also after an interruption, that `state` returns the same as before.

    `state` makes a short call, so the code is compiled before the long call begins, and runs after it.
    """
    before = copy.deepcopy(state())
    print("begins", flush=True)
    try:
        yield
    finally:
        same(state(), before)


def gas(n: int) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Returns scene, positions and velocities of elastic balls without friction, which do not come to rest."""
    places = lattice(n, 0.2)
    side = 0.2 + np.ptp(places[:, 1])
    return measure.gas(n, side, side), places, np.random.default_rng(0).normal(size=(n, 2))


def run_one(n: int, **options: Any) -> None:
    """Runs one long shot."""
    scene, *start = gas(n)
    with long_call(lambda: (start, simulate(scene, *start, max_time=0.01, **options).positions)):
        simulate(scene, *start, max_events=LONG, **options)


def run_batch(m: int, n: int, threads: int | None, max_time: float, **options: Any) -> None:
    """Runs a batch of m long shots."""
    scene, *start = gas(n)
    many, four = (tuple(np.tile(array, (count, 1, 1)) for array in start) for count in (m, 4))
    with long_call(lambda: (many, simulate_batch(scene, *four, threads=threads, max_time=0.01, **options).positions)):
        simulate_batch(scene, *many, threads=threads, max_time=max_time, max_events=LONG, **options)


ENV: dict[str, Any] = {"scene": gas(60)[0].to_dict(), "task": "carom", "layout": "random"}


def step_one() -> None:
    """Plays a long shot in the environment."""
    env: Any = gym.make("Billiards-v0", max_shots=3, **ENV).unwrapped
    env.reset(seed=0)

    def state() -> Any:
        current = env.positions, env.potted, env._episodes.state.over.tolist()
        env.reset(seed=0)
        return current, env.step([0.0, 0.0]), env.reset(seed=0)

    with long_call(state):
        env.step([1.0, 0.3])


def step_many(num_envs: int, threads: int | None, mode: str) -> None:
    """Plays long shots in the vector environment. A tenth of them end at once."""
    envs: Any = gym.make_vec(
        "Billiards-v0", num_envs, vectorization_mode=None, threads=threads, autoreset_mode=mode, **ENV
    )
    envs.reset(seed=0)
    actions = np.tile([1.0, 0.3], (num_envs, 1))
    actions[: num_envs // 10] = 0.0

    def state() -> Any:
        current = envs.get_state()
        envs.reset(seed=0)
        return current, envs.step(0.0 * actions), envs.reset(seed=0)

    with long_call(state):
        envs.step(actions)


class Alarm(Exception):
    """An exception of a signal handler of the user."""


def run_until_alarm() -> None:
    """Runs a long shot until a signal handler raises `Alarm`, and then another one."""

    def ring(*_: Any) -> None:
        raise Alarm

    signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    try:
        run_one(2)
    except Alarm:
        run_one(2)


SMALL_STEPS = Engine("pit", 1e-7)
CALLS: dict[str, Callable[[], None]] = {
    "one shot": lambda: run_one(2),
    "one shot of many balls": lambda: run_one(MANY_BALLS),
    "one shot of pit": lambda: run_one(30, engine=SMALL_STEPS),
    "long shots, all threads": lambda: run_batch(40, 2, None, 1e9),
    "many shots, 1 thread": lambda: run_batch(100_000, 2, 1, 1e3),
    "many shots of pit, 2 threads": lambda: run_batch(100_000, 2, 2, 10.0, engine=Engine("pit", 1e-3)),
    "a step": step_one,
    "a step of many, 1 thread": lambda: step_many(4, 1, "NextStep"),
    "a step of many, 2 threads": lambda: step_many(40, 2, "SameStep"),
    "another signal": run_until_alarm,
}


def serve() -> None:
    """Makes the calls named on stdin and prints their results."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it in commands in the background
    for line in sys.stdin:
        call = CALLS[line.strip()]
        try:
            call()
            print("finished", flush=True)
        except KeyboardInterrupt:
            print("interrupted", flush=True)


@pytest.fixture(scope="module")
def server() -> Iterator[subprocess.Popen[str]]:
    root = str(Path(__file__).parents[2])
    process = subprocess.Popen(
        [sys.executable, __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": root},
        cwd=root,
    )
    assert process.stdout is not None
    with process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_interrupts_a_long_call_and_leaves_no_change(server, name):
    """Such a call once ran to its end before the signal was handled."""
    watchdog = threading.Timer(600.0, server.kill)  # a call without an end
    watchdog.start()
    try:
        server.stdin.write(f"{name}\n")
        server.stdin.flush()
        assert server.stdout.readline() == "begins\n"
        time.sleep(0.4)
        server.send_signal(signal.SIGINT)
        line = server.stdout.readline()
        while line == "begins\n":  # "another signal" makes two long calls
            line = server.stdout.readline()
        assert line == "interrupted\n"
    finally:
        watchdog.cancel()


def test_slow_impacts_on_cushions_count_as_work(monkeypatch):
    """Each counted as one event once. With impacts of 40 ms Ctrl-C had no effect for minutes."""
    for call in (slow_shots, WITH_ARRAYS["push_lanes"], WITH_ARRAYS["pull_lanes"]):
        assert looks(monkeypatch, call)[0] >= recorded().cushions.sum() / 50


def test_the_steps_of_pit_count_as_work(monkeypatch):
    """A look after every ten million pairs, which take about ten milliseconds."""
    n, dt, end = 30, 1e-6, 0.05
    shot = functools.partial(simulate, *gas(n), engine=Engine("pit", dt), max_time=end)
    assert looks(monkeypatch, shot)[0] >= int(end / dt * n * n / 1e7)


def test_slow_impacts_on_cushions_count_as_work_in_pit(monkeypatch):
    scene, places, velocities = gas(30)
    monkeypatch.setitem(CUSHIONS, "restitution", CUSHIONS["restitution"]._replace(work=LOOK_AFTER // 30))
    slow = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, e_cushion=0.99))
    shot = functools.partial(simulate, slow, places, velocities, engine=Engine("pit", 1e-3), max_time=0.5)
    count, result = looks(monkeypatch, shot)
    assert count >= result.cushions.max() > 0


def test_impacts_of_many_balls_at_one_instant_count_as_work(monkeypatch):
    scene = Scene.named("pool", 15)
    rng = np.random.default_rng(0)
    shots = scene, [layouts.draw("tight_rack", scene, rng) for _ in range(20)], [[8.0, 0.0]] * 20
    assert simulate_batch(*shots, threads=1).n_events.sum() < LOOK_AFTER
    assert looks(monkeypatch, lambda: simulate_batch(*shots, threads=1))[0] > 0


def slow_shots(record: bool = False) -> Any:
    """Runs shots with slow impacts on cushions."""
    velocities = np.random.default_rng(0).normal(0.0, 5.0, (50, 2))
    places = [[[-1.0, 0.1], [1.0, 0.2], [1.5, 0.0]]] * 50
    return simulate_batch(Scene.named("snooker", 2), places, velocities, record=record, threads=1)


@functools.cache
def recorded() -> Any:
    return slow_shots(record=True)


def check_many() -> None:
    """Checks the input of shots of many balls."""
    scene, places, velocities = gas(MANY_BALLS)
    check_shot(scene, np.tile(places, (4000, 1, 1)), np.tile(velocities, (4000, 1, 1)), None, None, None)


def strike_frozen_ball() -> None:
    """Strikes the cue ball towards a ball that it touches."""
    simulate("pool", [[0.0, 0.0], [2.0 * POOL_RADIUS, 0.0]], strike("pool", 1.0, 0.0))


WITH_ARRAYS: dict[str, Callable[[], Any]] = {
    "pic": lambda: simulate(*gas(30), max_time=1e9, max_events=100_000),
    "pit": lambda: simulate(*gas(30), engine=Engine("pit", 1e-6), max_time=0.05),
    "check_shot": check_many,
    "strike_frozen": strike_frozen_ball,
    "push_lanes": lambda: derivatives.jvp(recorded(), {"velocities": np.ones((3, 2)), "g": 1.0}, threads=1),
    "pull_lanes": lambda: derivatives.vjp(recorded(), {"positions": np.ones((3, 2))}, ("velocities", "g"), threads=1),
    "push_margins": lambda: derivatives.margins(recorded(), threads=1),
    "find_nonsmooth": lambda: derivatives.nonsmooth(recorded(), threads=1),
    "bound_errors": lambda: derivatives.certainty(recorded()),
}
"""Calls of the entry points that create arrays."""


@pytest.mark.parametrize("name", WITH_ARRAYS)
def test_calls_free_their_arrays_also_if_they_are_interrupted(monkeypatch, name):
    recorded()
    with counted_arrays() as arrays:
        count, _ = looks(monkeypatch, WITH_ARRAYS[name])
    assert count > 0
    assert arrays[0] > arrays[1] == 0
    with counted_arrays() as arrays, pytest.raises(Stopped):
        looks(monkeypatch, WITH_ARRAYS[name], stops=True)
    assert arrays[0] > arrays[1] == 0


if __name__ == "__main__":
    serve()
