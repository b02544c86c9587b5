"""The work whose results are compared: `python -m benchmarks.machines.work FILE NAME ...` writes its hashes as JSON.

Decisions of players are not part of it: they use functions of NumPy, such as a cosine, whose last bits depend on the
machine. The names are frozen ids, files of the leaderboard, and those of `WORK`. A name in the file is not repeated.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks import ROOT
from benchmarks.reference.stress import families
from billiards_env import Engine, Scene, simulate_batch, strike
from billiards_env.bench.benchmark import verify
from billiards_env.bench.published import HASHES, first_steps
from billiards_env.derivatives import certainty, jacobian, margins, nonsmooth, vjp
from billiards_env.engine.threads import set_num_threads
from billiards_env.games import GAMES, NO_CALL, Call, Setup, Stroke, opening, play
from billiards_env.games.game_state import to_dict
from billiards_env.pots.finder import find_pots
from billiards_env.scene import Balls, Physics, Table, layouts
from billiards_env.shots.simulation import _OUTCOME, BatchResult
from billiards_env.shots.tables import Tables
from billiards_env.support.files import write_json

FILES = "geometric.json", "ppo_points.json"
"""The files of the leaderboard whose actions are played again."""


def shots(family: Callable[..., Any], m: int, **options: Any) -> Any:
    """Returns m random shots of a family of the stress test."""
    scene, places, velocities, spins = family(np.random.default_rng(7), m)
    return simulate_batch(scene, places, velocities, spins=spins, threads=1, **options)


def breaks(rng: np.random.Generator, m: int) -> Any:
    """Returns random breaks, whose numbers follow from random ones by sums and products alone."""
    scene = Scene.named("pool", 15)
    places = np.array([layouts.draw("rack", scene, rng) for _ in range(m)])
    velocities = np.stack((rng.uniform(4, 12, m), rng.uniform(-0.2, 0.2, m)), axis=1)
    return scene, places, velocities, rng.uniform(-100, 100, (m, 3))


def tables_of(balls: int, m: int) -> Tables:
    """Returns m tables with random positions."""
    scene, rng = Scene.named("real_pool", balls), np.random.default_rng(7)
    positions = np.array([layouts.draw("random", scene, rng) for _ in range(m)])
    in_play = np.ones(positions.shape[:2], bool)
    return Tables(scene, positions, in_play, in_play & (np.arange(balls + 1) > 0), 8.0)


def strikes() -> Iterator[Any]:
    """Yields strikes of a cue ball that touches another ball."""
    scene, rng = Scene.named("real_pool", 3), np.random.default_rng(7)
    positions = np.array([[0.0, 0.0], [2 * scene.balls.radius[0], 0.0], [0.4, 0.2], [-0.4, -0.1]])
    parts = (rng.uniform(low, high, 100) for low, high in ((0.5, 6), (-3, 3), (-0.3, 0.3), (-0.3, 0.3), (0, 0.5)))
    yield simulate_batch(scene, np.tile(positions, (100, 1, 1)), strike(scene, *parts), threads=1)


def many_balls() -> Iterator[Any]:
    """Yields a shot of 160 balls, all in motion."""
    x, y = np.meshgrid(np.arange(16) - 7.5, np.arange(10) - 4.5)
    positions = 0.08 * np.stack((x.ravel(), y.ravel()), axis=1)
    scene = Scene(Balls.uniform(160, 0.028575), Table(1.3, 0.9), Physics())
    yield simulate_batch(scene, positions[None], np.random.default_rng(7).normal(size=(1, 160, 2)), threads=1)


def derivatives() -> Iterator[Any]:
    """Yields derivatives, margins, certainties and the events without a derivative of recorded shots."""
    for name in ("pool, 5 object balls", "real pool, 5 object balls"):
        batch = shots(families.FAMILIES[name], 20, record=True)
        yield jacobian(batch, "positions", "velocities")
        yield vjp(batch, {"positions": np.ones_like(batch.positions)})
        yield from (margins(batch), certainty(batch), nonsmooth(batch))


def pots() -> Iterator[Any]:
    """Yields pots and banks."""
    yield find_pots(tables_of(9, 20), banks=True)


def games() -> Iterator[Any]:
    """Yields the states of a random game of each kind."""
    for name, rules in GAMES.items():
        setup, rng = Setup(name, Scene.named(rules.scene, rules.n_object_balls[1])), np.random.default_rng(7)
        game, strokes = opening(setup, rng), 0
        while strokes < 30 and not game.state.over:
            place = tuple((3.0 * rng.random(2) - 1.5).tolist()) if game.state.in_hand else None
            call = Call(int(rng.integers(-1, 3)), int(rng.integers(-1, 6))) if rules.pockets else NO_CALL
            velocity, spin = rng.uniform(-6.0, 6.0, 2), rng.uniform(-20.0, 20.0, 3)
            game = play(setup, game, Stroke(tuple(velocity.tolist()), place, tuple(spin.tolist()), call)).game
            strokes += 1
            yield game.positions, sorted(to_dict(game.state).items())


def observations() -> Iterator[Any]:
    """Yields observations of all kinds, with pixels, noise, scatter and random physics."""
    ways = "free_to_balls", "cue_to_balls", "balls_to_pockets", "free_to_pockets", "shots_left", "physics", "potted"
    options: dict[str, Any] = {"n_object_balls": 3, "max_shots": 3, "noise": {}, "scatter": {}}
    options |= {"observe": [*ways, "positions", ["pixels", 36, 40]], "randomize": {"mu_roll": [0.005, 0.02]}}
    envs: Any = gym.make_vec("Billiards-v0", 8, **options)
    yield envs.reset(seed=0)[0]
    envs.action_space.seed(0)
    yield from (envs.step(envs.action_space.sample())[0] for _ in range(4))


_PIT = {fix: Engine("pit", 1 / 60, fix) for fix in ("push_apart", "move_back", "none", "time_of_impact")}

WORK: dict[str, Callable[[], Any]] = {
    "breaks": lambda: [shots(breaks, 40)],
    "random physics": lambda: [shots(breaks, 40, physics={"mu_roll": np.linspace(0.005, 0.015, 40)})],
    **{f"timestep {fix}": lambda engine=engine: [shots(breaks, 40, engine=engine)] for fix, engine in _PIT.items()},
    **{work.__name__.replace("_", " "): work for work in (strikes, many_balls, derivatives, pots, games, observations)},
}
"""Functions that yield results, by name."""


def result_of(name: str) -> tuple[str, int]:
    """Returns the hash and the number of the results of some work."""
    if name in HASHES:
        return first_steps(name), 100
    if name in FILES:  # raises an error if a bit differs
        return name, sum(len(one.actions) for one in verify(ROOT / "docs" / "leaderboard" / name).results)
    digest, count = hashlib.sha256(), 0
    for value in WORK[name]():
        count += len(value) if isinstance(value, BatchResult) else 1
        add(value, digest)
    return digest.hexdigest()[:16], count


def add(value: Any, digest: Any) -> None:
    """Adds arrays, numbers, texts and batches of shots, and collections of them, to a hash."""
    if isinstance(value, BatchResult):
        value = [getattr(value, field) for field in _OUTCOME]
    if isinstance(value, np.ndarray) and value.dtype != object:
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, (tuple, list, dict, np.ndarray)):
        for item in value.items() if isinstance(value, dict) else value:
            add(item, digest)
    else:
        digest.update(repr(value).encode())


def main(path: Path, names: list[str]) -> None:
    """Writes the results of `names` to a JSON file, by name."""
    set_num_threads(1)
    results: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for name in names:
        if name not in results:
            begin = perf_counter()
            results[name] = result_of(name)
            write_json(path, results)
            print(f"{name}: {results[name][0]}, {perf_counter() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
