"""Measures what a network learns by derivatives through a timestep: `python -m studies.learn_through_timestep`.

A pool table without pockets has a cue ball, an object ball and a goal at random places. The object ball must stop at
the goal. A small network returns where to hit it and with which speed, and learns by the gradient of the squared
distance from the goal. `studies.gradient_timestep` describes the derivatives. A *world* is an engine in which the shots
are played. The gradient is twice the vector from the goal to the ball in this world, times a derivative: that of
this world, that of another world, or a difference over 2 mm/s.

The results are in `studies/results/learn_through_timestep.json`. The command skips runs that have results there.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from tqdm import tqdm

from benchmarks import table
from billiards_env.files import write_json
from billiards_env.intervals import as_percent, over_seeds
from billiards_env.scene import Scene
from studies import RESULTS, parser_of, report, resumed
from studies.gradient_timestep import LARGE, SMALL, Floats, Shots, differences, exact_derivatives, pit

OUTPUT = RESULTS / "learn_through_timestep.json"

POOL = Scene.named("pool", 1)
SCENE = dataclasses.replace(POOL, table=dataclasses.replace(POOL.table, pockets=()))

WORLDS: dict[str, dict[str, Any]] = {
    "exact": {},
    **{f"{fix} 1/{n} s": pit(n, fix) for fix in ("push_apart", "move_back") for n in (240, 60, 15)},
    "time_of_impact 1/60 s": pit(60, "time_of_impact"),
}
"""The engines, as arguments of `simulate_batch`."""

UNTRAINED, OVER_JUMPS = "not trained", "over 2 mm/s"
PUSHED = [world for world in WORLDS if world.startswith("push_apart")]
RUNS = [
    ("exact", UNTRAINED),
    *((world, world) for world in WORLDS),
    *((world, "exact") for world in PUSHED),
    ("exact", "push_apart 1/60 s"),
    *((world, OVER_JUMPS) for world in PUSHED[1:]),
]
"""The world of a training, and the derivative: that of a world, or the difference over 2 mm/s in this world."""

SEEDS = (20, 21, 22, 23, 24)
STEPS, BATCH, LAYOUTS = 300, 256, 2000
LEARNING_RATE = 3e-3
LONGEST = 1.0
"""m s. A longer gradient of a shot by its velocity is shortened to this length."""
NEAR = 0.1
"""m, the largest distance from the goal that is a success."""
LEAST, MOST = 0.2, 0.8
"""m. The smallest distance of two places, and the largest distance between the object ball and the goal."""
STEEPEST = np.radians(50.0)
"""The largest cut angle."""


def draw_layouts(count: int, rng: np.random.Generator) -> Floats:
    """Returns places of the cue ball, the object ball and the goal, (count, 3, 2), m, that need no cushion."""
    room = np.array(SCENE.half_extents) - 2.0 * SCENE.balls.radius[0]
    layouts = np.empty((0, 3, 2))
    while len(layouts) < count:
        drawn = rng.uniform(-room, room, (20 * count, 3, 2))
        near, far, _, cut = ways(drawn)
        suits = (near > LEAST) & (far > LEAST) & (far < MOST) & (np.cos(cut) > np.cos(STEEPEST))
        layouts = np.concatenate((layouts, drawn[suits]))
    return layouts[:count]


def ways(layouts: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Returns the distances to the object ball and from it to the goal, m, the heading to the ball and the cut angle.

    Each has the shape (m,) for layouts (m, 3, 2).
    """
    (x, far_x), (y, far_y) = np.diff(layouts, axis=1).transpose(2, 1, 0)
    heading = np.arctan2(y, x)
    return np.hypot(x, y), np.hypot(far_x, far_y), heading, np.arctan2(far_y, far_x) - heading


def velocities(network: nn.Module, layouts: Floats) -> Tensor:
    """Returns the velocities (m, 2) of a network. The cue ball hits the object ball in each shot.

    The network chooses the offset of the hit, and the speed of the cue ball at the object ball. On its way the ball
    keeps 5/7 of its speed when it begins to roll, and rolling slows it down.
    """
    near, far, heading, cut = map(torch.as_tensor, ways(layouts))
    side, speed = network(torch.stack((near, far, cut.cos(), cut.sin()), 1)).T
    headings = heading + torch.asin(0.95 * torch.tanh(side) * sum(SCENE.balls.radius) / near)
    arrival = 0.1 + torch.sigmoid(speed - 1.0)
    speeds = 1.4 * torch.sqrt(arrival**2 + 2.0 * SCENE.physics.mu_roll * SCENE.physics.g * near)
    return speeds[:, None] * torch.stack((headings.cos(), headings.sin()), 1)


def shots_of(network: nn.Module, layouts: Floats) -> Shots:
    """Returns the shots of a network."""
    return Shots(SCENE, layouts[:, :2], velocities(network, layouts).detach().numpy())


def misses(shots: Shots, layouts: Floats, world: str) -> Floats:
    """Returns the vectors from the goals to the object balls at the end of the shots in a world, (m, 2), m."""
    return shots.run(**WORLDS[world]).positions[:, 1] - layouts[:, 2]


def slopes(shots: Shots, layouts: Floats, world: str, derivative: str) -> Floats:
    """Returns the gradients of the squared distances by the velocities, (m, 2), m s, with the length `LONGEST` at most.

    Args:
        shots: The shots.
        layouts: (m, 3, 2), m.
        world: The world of the distances.
        derivative: As in `RUNS`.
    """
    if derivative in ("exact", UNTRAINED):
        derivatives = exact_derivatives(shots.run(record=True))
    elif derivative == OVER_JUMPS:
        derivatives = differences(shots, LARGE, **WORLDS[world])
    else:
        derivatives = differences(shots, SMALL, **WORLDS[derivative])
    found = 2.0 * np.einsum("mi,mij->mj", misses(shots, layouts, world), derivatives[:, 1])
    return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True) / LONGEST, 1.0)


def same_signs(shots: Shots, layouts: Floats, world: str, derivative: str) -> float:
    """Returns the share of shots whose `slopes` along the velocity have the sign of those in exact physics."""
    along = (
        (slopes(shots, layouts, *of) * shots.velocities).sum(1) for of in ((world, derivative), ("exact", "exact"))
    )
    return float(np.equal(*map(np.sign, along)).mean())


def train(world: str, derivative: str, seed: int) -> dict[str, Any]:
    """Trains a network and returns its results on new layouts, in its own world and in the exact one.

    Args:
        world: The world of the training.
        derivative: As in `RUNS`.
        seed: The seed of the network, of its training and of the layouts.

    Returns:
        `own` and `exact`: the shares of successes. `miss`: the median distance from the goal in the exact world, m.
        `sign`: for the network before the training, the share of the shots whose gradient along the velocity has the
        sign of the exact gradient. `seconds`: the processor time of the training.
    """
    torch.manual_seed(seed)
    rng, new_layouts = np.random.default_rng((seed, 0)), draw_layouts(LAYOUTS, np.random.default_rng((seed, 1)))
    layers = nn.Linear(4, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 2)
    network = nn.Sequential(*layers).double()
    sign, begin = same_signs(shots_of(network, new_layouts), new_layouts, world, derivative), time.process_time()
    optimiser = torch.optim.Adam(network.parameters(), LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, STEPS)
    for _ in range(0 if derivative == UNTRAINED else STEPS):
        layouts = draw_layouts(BATCH, rng)
        actions = velocities(network, layouts)
        shots = Shots(SCENE, layouts[:, :2], actions.detach().numpy())
        optimiser.zero_grad()
        (actions * torch.as_tensor(slopes(shots, layouts, world, derivative))).sum(1).mean().backward()
        optimiser.step()
        schedule.step()
    seconds, shots = time.process_time() - begin, shots_of(network, new_layouts)
    own, exact = (np.linalg.norm(misses(shots, new_layouts, name), axis=1) for name in (world, "exact"))
    shares = {"own": float((own < NEAR).mean()), "exact": float((exact < NEAR).mean())}
    return {**shares, "miss": float(np.median(exact)), "sign": sign, "seconds": seconds}


def measure(output: Path) -> dict[str, Any]:
    """Trains the runs without results, and writes the result of each as soon as it ends.

    Args:
        output: The JSON file of the results.

    Returns:
        The content of the file: `machine`, `settings`, and `results[world][derivative][seed]` (see `train`).

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    settings = {"steps": STEPS, "batch": BATCH, "layouts": LAYOUTS, "rate": LEARNING_RATE, "longest": LONGEST}
    found = resumed(output, settings, results={})
    for world, derivative in tqdm(RUNS, unit="cell"):
        runs = found["results"].setdefault(world, {}).setdefault(derivative, {})
        for seed in map(str, SEEDS):
            if seed not in runs:
                runs[seed] = train(world, derivative, int(seed))
                write_json(output, found)
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table for the page, and a line about its size, by name."""
    settings, rows, seconds = found["settings"], [], []
    for world, cells in found["results"].items():
        for derivative, runs in cells.items():
            at = {name: [run[name] for run in runs.values()] for name in next(iter(runs.values()))}
            seconds += at["seconds"]
            shares = (as_percent(over_seeds(at[name])) for name in ("own", "exact"))
            sign = "" if derivative == UNTRAINED else f"{np.mean(at['sign']):.0%}"
            name = "of this world" if derivative == world else derivative
            rows.append((world, name, sign, *shares, f"{np.mean(at['miss']):.3f} m"))
    head = ("world", "derivative", "right sign", "success in this world", "success in the exact world", "median miss")
    shots = settings["steps"] * settings["batch"]
    return {
        "table": table(head, rows, left=2),
        "size": f"{len(seconds)} networks, trained with {shots:,} shots if at all, "
        f"{settings['layouts']:,} new layouts for each seed, "
        f"{sum(seconds) / 60.0:.0f} minutes on one core",
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.learn_through_timestep --help`."""
    description = "Measure what a network learns by derivatives through a timestep."
    args = parser_of("learn_through_timestep", description, output=(OUTPUT, "JSON file")).parse_args(arguments)
    torch.set_num_threads(1)
    report(lambda: measure(args.output), blocks, args.output)


if __name__ == "__main__":
    main()
