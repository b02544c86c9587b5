"""Studies derivatives of shots, and what networks learn by them: `python -m studies.derivatives`.

Automatic differentiation of a simulation with a timestep returns the derivative with each contact fixed at its
timestep. A central difference so small that no contact moves to another timestep equals it: here one over 2e-9 m/s.

* Errors: this difference, and one over 2e-3 m/s, against the exact derivative, for each fix and each timestep. Each
  shot has the same contacts with all of them.
* Goals: a pool table without pockets has a cue ball, an object ball and a goal at random places, and the object ball
  must stop at the goal. A small network returns where to hit it and with which speed, and learns by the gradient of the
  squared distance from the goal. A *world* is an engine in which the shots are played. The gradient is twice the vector
  from the goal to the ball in this world, times the derivative of this world, the derivative of another world, or a
  difference over 2 mm/s.
* Pots: a network learns to pot a ball in `Billiards-v0` from the positions. For each pocket it returns a point next to
  the object ball, at which the cue ball aims, and for each of several speeds the chance of success. The margin of the
  pot has a derivative by the action (see `billiards_env.torch.pot_margins`), which teaches the point. Outcomes jump
  with the pocket and the speed, so these are sampled by their chances, and the network learns the chances from the
  outcomes (Suh et al. 2022 combine gradients and samples). The table is symmetric, so the four corner pockets share one
  output, and the two side pockets share another one. The shots of the last batches are used again as long as the action
  is near; their margins are then taken as linear in the action.

The results are in `studies/results/derivatives.json`, the pictures in `docs/images`. The command skips what has
results there, so it continues after an interruption.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm import tqdm

from benchmarks import new_figure, run_command, save, table
from benchmarks.accuracy_report import PIT_STYLES
from billiards_env.bench.evaluation import evaluation_seeds, play_together
from billiards_env.engine import PIC, Engine
from billiards_env.engine.overlaps import FIXES
from billiards_env.envs import BilliardsVectorEnv, make_vector_env
from billiards_env.scene import Balls, Physics, Scene, layouts
from billiards_env.scene.table import Table
from billiards_env.shots.simulation import BatchResult, simulate_batch
from billiards_env.support.intervals import as_percent, over_seeds
from billiards_env.torch import pot_margins
from studies import RESULTS, fill, resumed

OUTPUT = RESULTS / "derivatives.json"

STEPS = (60, 240, 960, 3840, 15360)
"""Numbers of timesteps per second."""

DRAWN, SLOWEST, FASTEST = 2300, 0.5, 4.0
"""The number of drawn shots, and the least and the largest speed, m/s."""

SMALL, LARGE = 1e-9, 1e-3
"""Changes of the velocity for the central differences, m/s."""

MOST = 30.0
"""s. Shots whose derivative is larger are left out: 1 mm/s moves a ball by more than 3 cm."""

SEED = 0

STYLES: dict[str, dict[str, Any]] = {
    **PIT_STYLES,
    "time_of_impact": {"marker": "D", "color": "#cc79a7", "markersize": 4, "linewidth": 1.6},
}

Floats = NDArray[np.float64]


class SceneShots(NamedTuple):
    """Shots of n balls in one scene: positions (m, n, 2), m, and velocities of the cue ball (m, 2), m/s."""

    scene: Scene
    positions: Floats
    velocities: Floats

    def run(self, change: float | Floats = 0.0, engine: Engine = PIC, record: bool = False) -> BatchResult:
        """Runs the shots on one core, with the velocities changed by `change` m/s."""
        moving = self.velocities + change
        return simulate_batch(self.scene, self.positions, moving, engine=engine, record=record, threads=1)

    def part(self, chosen: Any) -> SceneShots:
        """Returns some of the shots."""
        return SceneShots(self.scene, self.positions[chosen], self.velocities[chosen])


def pit(steps: int, fix: str) -> Engine:
    """Returns the engine with a number of timesteps per second and a fix."""
    return Engine("pit", 1.0 / steps, fix)


ENGINES = {f"{fix} 1/{steps} s": pit(steps, fix) for steps in STEPS for fix in FIXES}
"""The engines with a timestep."""


def draw_shots() -> SceneShots:
    """Returns random shots with one object ball. The cue ball is aimed at it, at any cut."""
    scene, rng = Scene.named("pool", 1), np.random.default_rng(SEED)
    positions = np.array([layouts.draw("random", scene, rng) for _ in range(DRAWN)])
    rng.uniform(size=DRAWN)  # skips these numbers, so that the shots are the published ones
    x, y = (positions[:, 1] - positions[:, 0]).T
    offset = rng.uniform(-0.95, 0.95, DRAWN) * sum(scene.balls.radius[:2])
    headings = np.arctan2(y, x) + np.arcsin(offset / np.hypot(x, y))
    speeds = rng.uniform(SLOWEST, FASTEST, DRAWN)[:, None]
    return SceneShots(scene, positions, speeds * np.c_[np.cos(headings), np.sin(headings)])


def outcomes(batch: BatchResult) -> NDArray[np.int64]:
    """Returns the ball that is hit first, the cushions of each ball and the potted balls of each shot, (m, ...)."""
    return np.c_[batch.first_hit, batch.cushions, batch.potted]


def exact_derivatives(batch: BatchResult) -> Floats:
    """Returns the derivatives of the final positions by the cue ball's velocity, (m, n, 2, 2)."""
    return batch.jacobian("positions", "velocities", threads=1)[:, :, :, 0]


def differences(shots: SceneShots, h: float, engine: Engine = PIC) -> Floats:
    """Returns central differences with a change of `h`, m/s, in each direction, shaped as `exact_derivatives`."""
    changes = h * np.eye(2)
    ends = [shots.run(change, engine).positions - shots.run(-change, engine).positions for change in changes]
    return np.stack(ends, axis=-1) / (2.0 * h)


def sizes(derivatives: Floats) -> Floats:
    """Returns the Frobenius norm of the derivatives (m, n, 2, 2) of each shot, (m,)."""
    return np.sqrt(np.square(derivatives).sum(axis=(1, 2, 3)))


def choose() -> dict[str, Any]:
    """Chooses the drawn shots that are smooth and have the same contacts with each timestep.

    Returns:
        `numbers`: the numbers of the chosen shots. `smooth`: the number of smooth shots. `other`: the share of them
        with contacts that the exact engine does not have, by fix and timestep.
    """
    shots = draw_shots()
    exact = shots.run(record=True)
    size = sizes(exact_derivatives(exact))
    hit, smooth = exact.first_hit == 1, exact.nonsmooth().reason == ""
    smooth = np.flatnonzero(hit & smooth & (size > 0.0) & (size < MOST))
    part, same = shots.part(smooth), {}
    for name, engine in ENGINES.items():
        same[name] = (outcomes(part.run(engine=engine)) == outcomes(exact)[smooth]).all(axis=1)
    return {
        "numbers": smooth[np.all(list(same.values()), axis=0)].tolist(),
        "smooth": len(smooth),
        "other": {name: 1.0 - float(agrees.mean()) for name, agrees in same.items()},
    }


def errors(results: Mapping[str, Any], engine: str) -> dict[str, float]:
    """Returns the median errors of "exact" or of one of `ENGINES` in the chosen shots.

    Args:
        results: The results so far, with the output of `choose`.
        engine: The name of the engine.

    Returns:
        `position`, m: the largest distance of a ball's final position. `small` and `large`: the relative
        errors of the central differences with `SMALL` and `LARGE` (see `sizes`).
    """
    return errors_of(draw_shots().part(results["chosen"]["numbers"]), ENGINES.get(engine, PIC))


def errors_of(shots: SceneShots, engine: Engine) -> dict[str, float]:
    """Returns the median errors of an engine in shots, see `errors`."""
    exact = shots.run(record=True)
    derivatives = exact_derivatives(exact)
    away = np.linalg.norm(shots.run(engine=engine).positions - exact.positions, axis=2)
    relative = {"position": away.max(axis=1)}
    for name, h in (("small", SMALL), ("large", LARGE)):
        relative[name] = sizes(differences(shots, h, engine) - derivatives) / sizes(derivatives)
    return {name: float(np.median(values)) for name, values in relative.items()}


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
    return shots.run(engine=WORLDS[world]).positions[:, 1] - layouts[:, 2]


def slopes(shots: SceneShots, layouts: Floats, world: str, derivative: str) -> Floats:
    """Returns the gradients of the squared distances by the velocities, (m, 2), m s, with the length `LONGEST` at most.

    Args:
        shots: The shots.
        layouts: (m, 3, 2), m.
        world: The world of the distances.
        derivative: As in `GOAL_RUNS`.
    """
    if derivative in ("exact", UNTRAINED):
        derivatives = exact_derivatives(shots.run(record=True))
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


POT_RUNS = {1_000_000: (20, 21, 22), 5_000_000: (20,)}
"""The seeds of the trainings, by the number of shots."""
EPISODES = 10_000
POT_BATCH, REPLAYS, MEMORY = 512, 8, 100
SPEEDS = (0.15, 0.25, 0.4, 0.6, 0.9)
"""The speeds of a shot, over the largest speed."""
EXPLORED = 0.1
"""Share of the shots at a random pocket with a random speed."""
WIDTH, LINEAR = 0.03, 0.03
"""m, the scale of the loss of a margin, and the largest change of an action for which a margin counts as linear."""


class PotBatch(NamedTuple):
    """Shots of a batch.

    Attributes:
        positions: (m, 2, 2) the feature "positions" of the observations.
        pockets: (m,) the pockets aimed at.
        speeds: (m,) indices of `SPEEDS`.
        actions: (m, 2).
        margins: (m,) m, of the pots.
        slopes: (m, 2) m, the derivatives of the margins by the actions.
        scratches: (m,) whether the cue ball dropped.
    """

    positions: Tensor
    pockets: Tensor
    speeds: Tensor
    actions: Tensor
    margins: Tensor
    slopes: Tensor
    scratches: Tensor


class Network(nn.Module):
    """Two networks: `points` maps the object ball to points to aim at, `chances` the layout and the aim to chances."""

    signs: Tensor
    is_side: Tensor
    radius: Tensor
    half_extents: Tensor
    ball_radius: Tensor

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        self.points, self.chances = _layers(2, 64, 4), _layers(11, 256, 2 * len(SPEEDS))
        places = torch.tensor([(pocket.x, pocket.y) for pocket in scene.table.pockets])
        self.register_buffer("signs", places.sign())
        self.register_buffer("is_side", (places[:, 0] == 0).long())
        self.register_buffer("radius", torch.tensor([pocket.radius for pocket in scene.table.pockets]))
        self.register_buffer("half_extents", torch.tensor(scene.half_extents))
        self.register_buffer("ball_radius", torch.tensor(scene.balls.radius[0]))

    def forward(self, positions: Tensor, pockets: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the directions (m, 2) and the logits (m, speeds) for positions (m, 2, 2) and pockets (m,)."""
        signs = self.signs[pockets]
        signs = torch.where(signs == 0, positions[:, 1].sign(), signs)  # a side: mirrored by the ball
        cue_ball, ball = (positions * signs[:, None]).unbind(1)
        to_ball = (ball - cue_ball) * self.half_extents
        distance = to_ball.norm(dim=1, keepdim=True)
        row, side = torch.arange(len(pockets)), self.is_side[pockets]
        point = 0.1 * self.points(ball).reshape(-1, 2, 2)[row, side]
        aims, line = nn.functional.normalize(to_ball + point, dim=1), to_ball / distance
        aside = (to_ball[:, :1] * aims[:, 1:] - to_ball[:, 1:] * aims[:, :1]) / (2.0 * self.ball_radius)
        features = torch.cat((cue_ball, ball, line, distance, 1 / (distance + 0.1), aims.detach(), aside.detach()), 1)
        logits = self.chances(features).reshape(len(pockets), 2, -1)[row, side]
        return signs * aims, logits

    def act(self, positions: Tensor, explored: float = 0.0) -> tuple[Tensor, Tensor, Tensor]:
        """Returns pockets (m,), speeds (m,) and actions (m, 2).

        If `explored` is 0, the pocket and the speed have the best chance. Otherwise they are drawn: this share of them
        uniformly, the others by the softmax of their logits.
        """
        m, count = len(positions), len(self.signs)
        with torch.no_grad():
            directions, logits = self(positions.repeat_interleave(count, 0), torch.arange(count).repeat(m))
        logits = logits.reshape(m, -1)
        if explored:
            shares = (1.0 - explored) * logits.softmax(1) + explored / logits.shape[1]
            chosen = shares.multinomial(1)[:, 0]
        else:
            chosen = logits.argmax(1)
        pockets, speeds = chosen // len(SPEEDS), chosen % len(SPEEDS)
        directions = directions.reshape(m, count, 2)[torch.arange(m), pockets]
        return pockets, speeds, torch.tensor(SPEEDS)[speeds, None] * directions


def _layers(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    layers = (nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU())
    return nn.Sequential(*layers, nn.Linear(hidden, outputs))


def loss_of(network: Network, played: PotBatch) -> Tensor:
    """Returns the loss of shots. Its gradient by an action has at most length 1, and is 0 far from the shot."""
    directions, logits = network(played.positions, played.pockets)
    actions = torch.tensor(SPEEDS)[played.speeds, None] * directions
    change = (actions - played.actions).detach()
    margins = played.margins + (played.slopes * change).sum(1)
    missing = network.radius[played.pockets] - margins
    push = played.slopes * (2.0 * missing / (WIDTH**2 + missing**2))[:, None]  # of log(1 + (missing / WIDTH)^2)
    push = push / push.norm(dim=1, keepdim=True).clamp(min=1.0)
    success = ((margins > 0) & ~played.scratches).float()
    chances = logits.gather(1, played.speeds[:, None])[:, 0]
    error = nn.functional.binary_cross_entropy_with_logits(chances, success, reduction="none")
    return ((0.1 * error - (actions * push).sum(1)) * (change.norm(dim=1) < LINEAR)).mean()


def play_pots(network: Network, envs: BilliardsVectorEnv) -> PotBatch:
    """Plays a shot in a new layout of each environment."""
    seen = torch.as_tensor(envs.decode(envs.reset()[0])["positions"])
    positions = torch.as_tensor(envs.positions)
    pockets, speeds, actions = network.act(seen, EXPLORED)
    actions.requires_grad_()
    margins = pot_margins(envs, positions, actions, threads=1)[torch.arange(len(actions)), 0, pockets]
    (slopes,) = torch.autograd.grad(margins.sum(), actions)
    actions, margins = actions.detach(), margins.detach()
    succeeded = torch.as_tensor(envs.step(actions.numpy())[-1]["final_info"]["is_success"])
    return PotBatch(seen, pockets, speeds, actions, margins, slopes, (margins > 0) & ~succeeded)


def learn_pots(seed: int, shots: int) -> float:
    """Trains a network by the gradients of its pots and returns its success on new layouts.

    Args:
        seed: The seed of the training and of the layouts of the evaluation.
        shots: Number of shots of the training.
    """
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    envs = make_vector_env(POT_BATCH, threads=1)
    envs.reset(seed=POT_BATCH * seed)
    network, memory = Network(envs.single_env.scene), deque[PotBatch](maxlen=MEMORY)
    optimiser, steps = torch.optim.Adam(network.parameters()), max(1, shots // POT_BATCH)
    for k in tqdm(range(steps), unit="batch", desc=f"{shots:,} shots, seed {seed}", leave=False):
        for group in optimiser.param_groups:
            group["lr"] = LEARNING_RATE * min(1.0, (k + 1) / 100) * 0.5 * (1.0 + math.cos(math.pi * k / steps))
        memory.append(play_pots(network, envs))
        for chosen in (len(memory) - 1, *random.integers(len(memory), size=REPLAYS)):
            optimiser.zero_grad()
            loss_of(network, memory[chosen]).backward()
            optimiser.step()

    def actions(observations: Any) -> Any:
        return network.act(torch.as_tensor(envs.decode(observations)["positions"]))[2].numpy()

    seeds = evaluation_seeds(seed, EPISODES).tolist()
    return play_together(make_vector_env(EPISODES), actions, seeds)["success_rate"]


def measure(output: Path) -> dict[str, Any]:
    """Measures the entries without a result, and writes each result as soon as it is measured.

    Args:
        output: The JSON file of the results.

    Returns:
        The content of the file: `machine`, `settings`, `chosen` (see `choose`), `errors`, by "exact" and by fix and
        timestep (see `errors`), `goals[world][derivative][seed]` (see `learn_goals`), and `pots[shots][seed]`, the
        success.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    torch.set_num_threads(1)
    goals = {"updates": UPDATES, "batch": BATCH, "layouts": LAYOUTS, "rate": LEARNING_RATE, "longest": LONGEST}
    drawn = {"shots": [DRAWN, SLOWEST, FASTEST], "steps": STEPS, "fixes": FIXES, "seed": SEED}
    results = resumed(output, {**drawn, "goals": goals, "episodes": EPISODES})
    jobs: dict[tuple[str, ...], Callable[[], Any]] = {("chosen",): choose}
    jobs |= {("errors", name): functools.partial(errors, results, name) for name in ("exact", *ENGINES)}
    for seed, (world, derivative) in itertools.product(GOAL_SEEDS, GOAL_RUNS):
        jobs["goals", world, derivative, str(seed)] = functools.partial(learn_goals, world, derivative, seed)
    for shots, seeds in POT_RUNS.items():
        jobs |= {("pots", str(shots), str(seed)): functools.partial(learn_pots, seed, shots) for seed in seeds}
    return fill(output, results, jobs)


def percent(share: float) -> str:
    """Returns the text of a share with two digits."""
    return "< 0.001%" if 0.0 < share < 1e-5 else f"{100 * share:.2g}%"


def blocks(measured: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    fixes, steps, chosen = measured["settings"]["fixes"], measured["settings"]["steps"], measured["chosen"]
    dts = [f"1/{n} s" for n in steps]
    ends, shown = (dts[0], dts[-1]), (dts[0], dts[len(dts) // 2], dts[-1])
    rows, results = [], measured["errors"]
    for fix in fixes:
        at = {dt: results[f"{fix} {dt}"] for dt in dts}
        positions = (f"{at[dt]['position']:.1e} m" for dt in ends)
        small, large = (percent(at[dt]["small"]) for dt in shown), (percent(at[dt]["large"]) for dt in ends)
        rows.append((f"`{fix}`", *positions, *small, *large))
    exact = results["exact"]
    rows.append(("exact engine", "", "", percent(exact["small"]), "", "", percent(exact["large"]), ""))
    columns = (("position", ends), ("derivative", shown), ("over 2 mm/s", ends))
    head = ("fix", *(f"{name}, {dt}" for name, at in columns for dt in at))
    other = (f"{percent(chosen['other'][f'time_of_impact {dt}'])} (timestep {dt})" for dt in dts)
    learned = []
    for world, derivatives in measured["goals"].items():
        for derivative, runs in derivatives.items():
            of = {name: [run[name] for run in runs.values()] for name in next(iter(runs.values()))}
            shares = (as_percent(over_seeds(of[name])) for name in ("own", "exact"))
            sign = "" if derivative == UNTRAINED else f"{np.mean(of['sign']):.0%}"
            name = "of this world" if derivative == world else derivative
            learned.append((world, name, sign, *shares, f"{np.mean(of['miss']):.3f} m"))
    in_worlds = (
        "world",
        "derivative",
        "right sign",
        "success in this world",
        "success in the exact world",
        "median miss",
    )
    goals = measured["settings"]["goals"]
    pots = []
    for shots, runs in measured["pots"].items():
        rates = list(runs.values())
        pots.append((f"{int(shots):,}", ", ".join(f"{rate:.1%}" for rate in rates), as_percent(over_seeds(rates))))
    return {
        "errors": table(head, rows),
        "contacts": f"Shots in which `time_of_impact` makes other contacts: {', '.join(other)}.",
        "shots": f"{len(chosen['numbers'])} of {chosen['smooth']:,} smooth shots are compared: those with the same "
        "contacts for each fix and timestep.",
        "goals": table(in_worlds, learned, left=2),
        "size": f"{len(GOAL_SEEDS)} seeds for each row, {goals['updates'] * goals['batch']:,} shots of training, "
        f"{goals['layouts']:,} new layouts for each seed.",
        "pots": table(("shots", "success by seed", "mean over seeds"), pots, left=0),
    }


def draw(measured: Mapping[str, Any], folder: Path) -> None:
    """Draws the errors of whole shots, and the reason for them."""
    draw_errors(measured, folder / "gradient_timestep.png")
    draw_reason(folder / "gradient_timestep_reason.png")


def draw_errors(measured: Mapping[str, Any], path: Path) -> None:
    """Draws the errors of the positions and of the derivatives of whole shots against the timestep."""
    steps, results = measured["settings"]["steps"], measured["errors"]
    figure = new_figure(8.4, 4.0, dpi=120)
    left, right = figure.subplots(1, 2)
    for fix, style in STYLES.items():
        cells = [results[f"{fix} 1/{n} s"] for n in steps]
        left.loglog(steps, [cell["position"] for cell in cells], **style, label=fix)
        right.loglog(steps, [100.0 * cell["small"] for cell in cells], **style)
    left.set_title("Positions converge", fontsize=11)
    left.set_ylabel("error of the final position (m)")
    right.set_title("Derivatives do not, except with time_of_impact", fontsize=11)
    right.set_ylabel("error of its derivative (%)")
    right.yaxis.set_major_formatter("{x:g}")
    for axes in (left, right):
        axes.set_xticks(steps, [f"1/{n}" for n in steps])
        axes.minorticks_off()
        axes.set_xlabel("timestep (s)")
        axes.grid(alpha=0.3)
    left.legend(frameon=False, fontsize=9)
    save(figure, path)


def bounces(speeds: Floats) -> SceneShots:
    """Returns shots of 1 s in which a ball bounces off a cushion at right angles, without friction and without loss."""
    physics = Physics(motion="ideal", cushion="restitution", e_cushion=1.0, max_time=1.0)
    scene = Scene(Balls((0.03,), (0.2,)), Table(2.0, 1.0), physics)
    return SceneShots(scene, np.zeros((len(speeds), 1, 2)), np.c_[speeds, np.zeros_like(speeds)])


def draw_reason(path: Path) -> None:
    """Draws the final position of `bounces` against the speed."""
    speeds = np.linspace(1.4, 1.6, 2001)
    shots = bounces(speeds)
    figure = new_figure(8.4, 3.4, dpi=120)
    panels = figure.subplots(1, 2, sharey=True)
    titles = {60: "timestep 1/60 s", 240: "timestep 1/240 s: smaller jumps, the same slopes"}
    for (steps, title), axes in zip(titles.items(), panels, strict=True):
        for fix in ("push_apart", "time_of_impact"):
            places = shots.run(engine=pit(steps, fix)).positions[:, 0, 0]
            jumps = np.abs(np.diff(places, append=places[-1])) > 5.0 * (speeds[1] - speeds[0])
            axes.plot(speeds, np.where(jumps, np.nan, places), color=STYLES[fix]["color"], linewidth=2.2, label=fix)
        axes.plot(speeds, shots.run().positions[:, 0, 0], "k:", linewidth=1.2, label="exact")
        axes.set_title(title, fontsize=11)
        axes.set(xlabel="speed at the start (m/s)", xticks=(1.4, 1.45, 1.5, 1.55, 1.6))
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("position 1 s later (m)")
    panels[0].legend(frameon=False, fontsize=9)
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.derivatives --help`."""
    about, output = "Study derivatives of shots and learning by them.", (OUTPUT, "JSON file")
    run_command("studies.derivatives", about, arguments, measure, blocks, {"output": output}, draw)


if __name__ == "__main__":
    main()
