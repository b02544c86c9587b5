"""Trains networks by derivatives of shots: `python -m studies.derivatives`.

A pool table without pockets has a cue ball, an object ball and a goal at random places, and the object ball must stop
at the goal. A small network returns where to hit it and with which speed, and learns by the gradient of the squared
distance from the goal. A *world* is an engine in which the shots are played. The gradient is twice the vector from the
goal to the ball in this world, times the derivative of this world, the derivative of another world, or a difference
over 2 mm/s. `benchmarks.gradients` describes these derivatives and measures their errors.

The results are in `studies/results/derivatives.json`. The command skips what has results there, so it continues after
an interruption.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from benchmarks import run_command, table
from benchmarks.gradients import LARGE, SMALL, SceneShots, differences, exact_derivatives, pit
from billiards_env.engine import PIC
from billiards_env.scene import Scene
from billiards_env.support.intervals import as_percent, over_seeds
from studies import RESULTS, fill, resumed

OUTPUT = RESULTS / "derivatives.json"

Floats = NDArray[np.float64]

POOL = Scene.named("pool", 1)
SCENE = dataclasses.replace(POOL, table=dataclasses.replace(POOL.table, pockets=()))

WORLDS = {
    "exact": PIC,
    **{f"{fix} 1/{n} s": pit(n, fix) for fix in ("push_apart", "move_back") for n in (240, 60, 15)},
    "time_of_impact 1/60 s": pit(60, "time_of_impact"),
}
"""The engines."""

UNTRAINED, OVER_JUMPS = "not trained", "over 2 mm/s"
PUSHED = [world for world in WORLDS if world.startswith("push_apart")]
GOAL_RUNS = [
    ("exact", UNTRAINED),
    *((world, world) for world in WORLDS),
    *((world, "exact") for world in PUSHED),
    ("exact", "push_apart 1/60 s"),
    *((world, OVER_JUMPS) for world in PUSHED[1:]),
]
"""The world of a training, and the world whose derivative it uses, or the difference over 2 mm/s."""

GOAL_SEEDS = (20, 21, 22, 23, 24)
UPDATES, BATCH, LAYOUTS = 300, 256, 2000
LEARNING_RATE = 3e-3
LONGEST = 1.0
"""m s. A longer gradient of a shot by its velocity is shortened to this length."""
NEAR = 0.1
"""m, the largest distance from the goal that is a success."""
LEAST, FARTHEST = 0.2, 0.8
"""m. The smallest distance of two places, and the largest distance between the object ball and the goal."""
STEEPEST = np.radians(50.0)
"""The largest cut angle."""


def draw_layouts(count: int, rng: np.random.Generator) -> Floats:
    """Returns places of the cue ball, the object ball and the goal, (count, 3, 2), m, that need no cushion."""
    room = np.array(SCENE.half_extents) - 2.0 * SCENE.balls.radius[0]
    suitable = np.empty((0, 3, 2))
    while len(suitable) < count:
        drawn = rng.uniform(-room, room, (20 * count, 3, 2))
        near, far, _, cut = ways(drawn)
        suits = (near > LEAST) & (far > LEAST) & (far < FARTHEST) & (np.cos(cut) > np.cos(STEEPEST))
        suitable = np.concatenate((suitable, drawn[suits]))
    return suitable[:count]


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


def shots_of(network: nn.Module, layouts: Floats) -> SceneShots:
    """Returns the shots of a network."""
    return SceneShots(SCENE, layouts[:, :2], velocities(network, layouts).detach().numpy())


def misses(shots: SceneShots, layouts: Floats, world: str) -> Floats:
    """Returns the vectors from the goals to the object balls at the end of the shots in a world, (m, 2), m."""
    return shots.batch(engine=WORLDS[world]).positions[:, 1] - layouts[:, 2]


def slopes(shots: SceneShots, layouts: Floats, world: str, derivative: str) -> Floats:
    """Returns the gradients of the squared distances by the velocities, (m, 2), m s, with the length `LONGEST` at most.

    Args:
        shots: The shots.
        layouts: (m, 3, 2), m.
        world: The world of the distances.
        derivative: As in `GOAL_RUNS`.
    """
    if derivative in ("exact", UNTRAINED):
        derivatives = exact_derivatives(shots.batch(record=True))
    elif derivative == OVER_JUMPS:
        derivatives = differences(shots, LARGE, WORLDS[world])
    else:
        derivatives = differences(shots, SMALL, WORLDS[derivative])
    gradients = 2.0 * np.einsum("mi,mij->mj", misses(shots, layouts, world), derivatives[:, 1])
    return gradients / np.maximum(np.linalg.norm(gradients, axis=1, keepdims=True) / LONGEST, 1.0)


def same_signs(shots: SceneShots, layouts: Floats, world: str, derivative: str) -> float:
    """Returns the share of shots whose `slopes` along the velocity have the sign of those in exact physics."""
    along = (
        (slopes(shots, layouts, *of) * shots.velocities).sum(1) for of in ((world, derivative), ("exact", "exact"))
    )
    return float(np.equal(*map(np.sign, along)).mean())


def learn_goals(world: str, derivative: str, seed: int) -> dict[str, Any]:
    """Trains a network and returns its results on new layouts, in its own world and in the exact one.

    Args:
        world: The world of the training.
        derivative: As in `GOAL_RUNS`.
        seed: The seed of the network, of its training and of the layouts.

    Returns:
        `own` and `exact`: the shares of successes. `miss`: the median distance from the goal in the exact world, m.
        `sign`: for the network before the training, the share of the shots whose gradient along the velocity has the
        sign of the exact gradient.
    """
    torch.manual_seed(seed)
    rng, new_layouts = np.random.default_rng((seed, 0)), draw_layouts(LAYOUTS, np.random.default_rng((seed, 1)))
    layers = nn.Linear(4, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 2)
    network = nn.Sequential(*layers).double()
    sign = same_signs(shots_of(network, new_layouts), new_layouts, world, derivative)
    optimiser = torch.optim.Adam(network.parameters(), LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, UPDATES)
    for _ in range(0 if derivative == UNTRAINED else UPDATES):
        layouts = draw_layouts(BATCH, rng)
        actions = velocities(network, layouts)
        shots = SceneShots(SCENE, layouts[:, :2], actions.detach().numpy())
        optimiser.zero_grad()
        (actions * torch.as_tensor(slopes(shots, layouts, world, derivative))).sum(1).mean().backward()
        optimiser.step()
        schedule.step()
    shots = shots_of(network, new_layouts)
    own, exact = (np.linalg.norm(misses(shots, new_layouts, name), axis=1) for name in (world, "exact"))
    shares = {"own": float((own < NEAR).mean()), "exact": float((exact < NEAR).mean())}
    return {**shares, "miss": float(np.median(exact)), "sign": sign}


def measure(output: Path) -> dict[str, Any]:
    """Trains the networks without a result, and writes each result as soon as it is measured.

    Args:
        output: The JSON file of the results.

    Returns:
        The content of the file: `machine`, `settings` and `goals[world][derivative][seed]` (see `learn_goals`).

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    torch.set_num_threads(1)
    goals = {"updates": UPDATES, "batch": BATCH, "layouts": LAYOUTS, "rate": LEARNING_RATE, "longest": LONGEST}
    jobs = {
        ("goals", world, derivative, str(seed)): functools.partial(learn_goals, world, derivative, seed)
        for seed, (world, derivative) in itertools.product(GOAL_SEEDS, GOAL_RUNS)
    }
    return fill(output, resumed(output, {"goals": goals}), jobs)


def blocks(measured: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    learned = []
    for world, derivatives in measured["goals"].items():
        for derivative, runs in derivatives.items():
            of = {name: [run[name] for run in runs.values()] for name in next(iter(runs.values()))}
            shares = (as_percent(over_seeds(of[name])) for name in ("own", "exact"))
            sign = "" if derivative == UNTRAINED else f"{np.mean(of['sign']):.0%}"
            name = "of this world" if derivative == world else derivative
            learned.append((world, name, sign, *shares, f"{np.mean(of['miss']):.3f} m"))
    head = "world", "derivative", "right sign", "success in this world", "success in the exact world", "median miss"
    goals = measured["settings"]["goals"]
    return {
        "goals": table(head, learned, left=2),
        "size": f"{len(GOAL_SEEDS)} seeds for each row, {goals['updates'] * goals['batch']:,} shots of training, "
        f"{goals['layouts']:,} new layouts for each seed.",
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.derivatives --help`."""
    about, output = "Train networks by derivatives of shots.", (OUTPUT, "JSON file")
    run_command("studies.derivatives", about, arguments, measure, blocks, {"output": output})


if __name__ == "__main__":
    main()
