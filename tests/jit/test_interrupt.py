"""Ctrl-C interrupts long calls. The calls run in a separate process, whose program is this file."""

from __future__ import annotations

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

from billiards_env.engine import PIC, Engine
from billiards_env.engine.compile import MANY_BALLS
from billiards_env.engine.runner import LOOK_AFTER
from billiards_env.physics.cushion import CUSHIONS
from billiards_env.scene import Balls, Physics, Scene, layouts
from billiards_env.scene.table import Table
from billiards_env.shots.simulation import simulate, simulate_batch
from tests.helpers.looks import looks

LONG = 10**9  # events

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot send Ctrl-C to a process")


def announce() -> None:
    """Prints that a long call begins."""
    print("begins", flush=True)


def gas(n: int) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Returns scene, positions and velocities of elastic balls without friction, which do not come to rest."""
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=1e9)
    columns = int(np.ceil(np.sqrt(n)))
    side = 0.2 * columns
    scene = Scene(Balls.uniform(n, 0.03), Table(side, side), physics)
    places = np.array([(i % columns, i // columns) for i in range(n)]) * 0.2 + 0.1 - side / 2
    return scene, places, np.random.default_rng(0).normal(size=(n, 2))


def run_one(n: int, **options: Any) -> None:
    """Runs one long shot; checks that its arguments are unchanged and that the next shot is correct."""
    scene, places, velocities = gas(n)
    before = places.copy(), velocities.copy()
    expected = simulate(scene, places, velocities, max_time=0.1).positions
    announce()
    try:
        simulate(scene, places, velocities, max_events=LONG, **options)
    finally:
        assert (places == before[0]).all()
        assert (velocities == before[1]).all()
        assert (simulate(scene, places, velocities, max_time=0.1).positions == expected).all()


def run_batch(m: int, n: int, threads: int | None, max_time: float, **options: Any) -> None:
    """Runs a batch of m long shots and makes the checks of `run_one`."""
    scene, places, velocities = gas(n)
    many = np.tile(places, (m, 1, 1)), np.tile(velocities, (m, 1, 1))
    expected = simulate(scene, places, velocities, max_time=0.1).positions
    announce()
    try:
        simulate_batch(scene, *many, threads=threads, max_time=max_time, max_events=LONG, **options)
    finally:
        assert (many[0] == places).all()
        assert (many[1] == velocities).all()
        again = simulate_batch(scene, many[0][:4], many[1][:4], threads=threads, max_time=0.1)
        assert (again.positions == expected).all()


def step_one(**options: Any) -> None:
    """Plays a long shot in the environment; checks that the state is unchanged."""
    arguments = {"scene": gas(60)[0].to_dict(), "task": "carom", "layout": "random", "max_shots": 3, **options}
    env: Any = gym.make("Billiards-v0", **arguments).unwrapped
    env.reset(seed=0)
    before = env.positions, env.potted
    announce()
    try:
        env.step([1.0, 0.3])
    finally:
        assert (env.positions == before[0]).all()
        assert (env.potted == before[1]).all()
        assert not env._episodes.arrays.over[0]
        env.reset(seed=0)
        assert (env.positions == before[0]).all()


def step_many(num_envs: int, threads: int | None, mode: str) -> None:
    """Plays long shots in the vector environment; checks that the state is unchanged."""
    arguments = {"scene": gas(60)[0].to_dict(), "task": "carom", "layout": "random"}
    envs: Any = gym.make_vec(
        "Billiards-v0", num_envs, vectorization_mode=None, threads=threads, autoreset_mode=mode, **arguments
    )
    envs.reset(seed=0)
    before = envs.get_state()
    actions = np.tile([1.0, 0.3], (num_envs, 1))
    actions[: num_envs // 10] = 0.0  # these shots end at once
    announce()
    try:
        envs.step(actions)
    finally:
        assert (envs.get_state() == before).all()
        envs.reset(seed=0)
        assert (envs.positions == before["positions"]).all()


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


def compile_kernels() -> None:
    """Compiles the kernels of all calls."""
    for n in (2, MANY_BALLS):
        for engine in (PIC, SMALL_STEPS):
            simulate(*gas(n), engine=engine, max_time=1e-6)
    arguments: Any = {"scene": gas(60)[0].to_dict(), "task": "carom", "layout": "random"}
    env = gym.make("Billiards-v0", **arguments)
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    for mode in ("NextStep", "SameStep"):
        envs = gym.make_vec("Billiards-v0", 2, vectorization_mode=None, autoreset_mode=mode, **arguments)
        envs.reset(seed=0)
        envs.step(np.zeros((2, 2), np.float32))


def serve() -> None:
    """Makes the calls named on stdin and prints their results."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it in commands in the background
    compile_kernels()
    print("ready", flush=True)
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
            assert process.stdout.readline() == "ready\n"
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
    scene = Scene.named("snooker", 2)
    velocities = np.random.default_rng(0).normal(0.0, 5.0, (50, 2))
    shots = scene, [[[-1.0, 0.1], [1.0, 0.2], [1.5, 0.0]]] * 50, velocities
    batch = simulate_batch(*shots, threads=1, record=True)
    for call in (
        lambda: simulate_batch(*shots, threads=1),
        lambda: batch.jvp({"velocities": np.ones((3, 2))}, threads=1),
        lambda: batch.vjp({"positions": np.ones((3, 2))}, threads=1),
    ):
        assert looks(monkeypatch, call)[0] >= batch.cushions.sum() / 50


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
    count, found = looks(monkeypatch, shot)
    assert count >= found.cushions.max() > 0


def test_impacts_of_many_balls_at_one_instant_count_as_work(monkeypatch):
    scene = Scene.named("pool", 15)
    rng = np.random.default_rng(0)
    shots = scene, [layouts.draw("tight_rack", scene, rng) for _ in range(20)], [[8.0, 0.0]] * 20
    assert simulate_batch(*shots, threads=1).n_events.sum() < LOOK_AFTER
    assert looks(monkeypatch, lambda: simulate_batch(*shots, threads=1))[0] > 0


if __name__ == "__main__":
    serve()
