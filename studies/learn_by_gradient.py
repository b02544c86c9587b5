"""Measures a network that learns to pot a ball by the gradient of its shots: `python -m studies.learn_by_gradient`.

The observation is that of `Billiards-v0`: the positions. For each pocket the network returns a point next to the
object ball, at which the cue ball aims, and for each of several speeds the chance of success. The gradient of the shot
teaches the point: the margin of the pot has a derivative by the action (see `billiards_env.torch.pot_margins`).
Outcomes jump with the pocket and the speed, so these are sampled by their chances, and the network learns the chances
from the outcomes (Suh et al. 2022 combine gradients and samples). The table is symmetric, so the four corner pockets
share one output, and the two side pockets share another one. The shots of the last batches are used again as long as
the action is near; their margins are then taken as linear in the action.

The results are in `studies/results/learn_by_gradient.json`. The command skips runs that have results there. It writes
the weights of the first run to `POLICY`; `billiards bench studies.learn_by_gradient:act` plays them.
"""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm import tqdm

from benchmarks import machine_line, table
from billiards_env.envs import BilliardsVectorEnv
from billiards_env.evaluation import evaluation_seeds, play_together
from billiards_env.files import write_json
from billiards_env.intervals import as_percent, over_seeds
from billiards_env.scene import Scene
from billiards_env.torch import pot_margins
from studies import RESULTS, load_weights, parser_of, report, resumed, save_weights

OUTPUT = RESULTS / "learn_by_gradient.json"
RUNS = {1_000_000: (20, 21, 22), 5_000_000: (20,)}
"""The seeds of the trainings, by the number of shots."""
POLICY = RESULTS / "policies" / "gradient.npz"
EPISODES = 10_000
BATCH, REPLAYS, MEMORY = 512, 8, 100
LEARNING_RATE = 3e-3
SPEEDS = (0.15, 0.25, 0.4, 0.6, 0.9)
"""The speeds of a shot, over the largest speed."""
EXPLORED = 0.1
"""Share of the shots at a random pocket with a random speed."""
WIDTH, NEAR = 0.03, 0.03
"""m, the scale of the loss of a margin, and the largest change of an action for which a margin counts as linear."""


class Played(NamedTuple):
    """Shots of a batch.

    Attributes:
        observations: (m, 4).
        pockets: (m,) the pockets aimed at.
        speeds: (m,) indices of `SPEEDS`.
        actions: (m, 2).
        margins: (m,) m, of the pots.
        slopes: (m, 2) m, the derivatives of the margins by the actions.
        scratches: (m,) whether the cue ball dropped.
    """

    observations: Tensor
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

    def forward(self, observations: Tensor, pockets: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the directions (m, 2) and the logits (m, speeds) for observations (m, 4) and pockets (m,)."""
        signs = self.signs[pockets]
        signs = torch.where(signs == 0, observations[:, 2:].sign(), signs)  # a side: mirrored by the ball
        cue_ball, ball = (observations * signs.repeat(1, 2)).chunk(2, 1)
        to_ball = (ball - cue_ball) * self.half_extents
        distance = to_ball.norm(dim=1, keepdim=True)
        row, side = torch.arange(len(pockets)), self.is_side[pockets]
        point = 0.1 * self.points(ball).reshape(-1, 2, 2)[row, side]
        aims, line = nn.functional.normalize(to_ball + point, dim=1), to_ball / distance
        aside = (to_ball[:, :1] * aims[:, 1:] - to_ball[:, 1:] * aims[:, :1]) / (2.0 * self.ball_radius)
        features = torch.cat((cue_ball, ball, line, distance, 1 / (distance + 0.1), aims.detach(), aside.detach()), 1)
        logits = self.chances(features).reshape(len(pockets), 2, -1)[row, side]
        return signs * aims, logits

    def act(self, observations: Tensor, explored: float = 0.0) -> tuple[Tensor, Tensor, Tensor]:
        """Returns pockets (m,), speeds (m,) and actions (m, 2).

        If `explored` is 0, the pocket and the speed have the best chance. Otherwise they are drawn: this share of them
        uniformly, the others by the softmax of their logits.
        """
        m, count = len(observations), len(self.signs)
        with torch.no_grad():
            directions, logits = self(observations.repeat_interleave(count, 0), torch.arange(count).repeat(m))
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


def loss_of(network: Network, played: Played) -> Tensor:
    """Returns the loss of shots. Its gradient by an action has at most length 1, and is 0 far from the shot."""
    directions, logits = network(played.observations, played.pockets)
    actions = torch.tensor(SPEEDS)[played.speeds, None] * directions
    change = (actions - played.actions).detach()
    margins = played.margins + (played.slopes * change).sum(1)
    missing = network.radius[played.pockets] - margins
    push = played.slopes * (2.0 * missing / (WIDTH**2 + missing**2))[:, None]  # of log(1 + (missing / WIDTH)^2)
    push = push / push.norm(dim=1, keepdim=True).clamp(min=1.0)
    success = ((margins > 0) & ~played.scratches).float()
    chances = logits.gather(1, played.speeds[:, None])[:, 0]
    error = nn.functional.binary_cross_entropy_with_logits(chances, success, reduction="none")
    return ((0.1 * error - (actions * push).sum(1)) * (change.norm(dim=1) < NEAR)).mean()


def play(network: Network, envs: BilliardsVectorEnv) -> Played:
    """Plays a shot in a new layout of each environment."""
    observations = torch.as_tensor(envs.reset()[0])
    positions = torch.as_tensor(envs.positions)
    pockets, speeds, actions = network.act(observations, EXPLORED)
    actions.requires_grad_()
    margins = pot_margins(envs, positions, actions, threads=1)[torch.arange(len(actions)), 0, pockets]
    (slopes,) = torch.autograd.grad(margins.sum(), actions)
    actions, margins = actions.detach(), margins.detach()
    succeeded = torch.as_tensor(envs.step(actions.numpy())[-1]["final_info"]["is_success"])
    return Played(observations, pockets, speeds, actions, margins, slopes, (margins > 0) & ~succeeded)


def load(path: Path) -> Network:
    """Returns the network with the weights in a file. This runs no code from the file.

    Raises:
        OSError: If the file cannot be read.
        RuntimeError, ValueError: If it does not hold the weights of the network.
    """
    network = Network(Scene.named("pool"))
    network.load_state_dict({name: torch.from_numpy(array) for name, array in load_weights(path).items()})
    return network


@functools.cache
def _trained() -> Network:
    return load(POLICY)


def act(observation: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the action (2,) of the network in `POLICY` for an observation (4,) of the task "pot"."""
    return _trained().act(torch.as_tensor(observation)[None])[2][0].numpy()


def train(seed: int, shots: int, episodes: int) -> tuple[float, Network]:
    """Trains a network and returns its success on new layouts, and the network.

    Args:
        seed: The seed of the training and of the layouts of the evaluation.
        shots: Number of shots of the training.
        episodes: Number of layouts of the evaluation.
    """
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    envs = BilliardsVectorEnv(BATCH, threads=1)
    envs.reset(seed=BATCH * seed)
    network, memory = Network(envs.single_env.scene), deque[Played](maxlen=MEMORY)
    optimiser, steps = torch.optim.Adam(network.parameters()), max(1, shots // BATCH)
    for k in tqdm(range(steps), unit="batch", desc=f"{shots:,} shots, seed {seed}", leave=False):
        for group in optimiser.param_groups:
            group["lr"] = LEARNING_RATE * min(1.0, (k + 1) / 100) * 0.5 * (1.0 + math.cos(math.pi * k / steps))
        memory.append(play(network, envs))
        for chosen in (len(memory) - 1, *random.integers(len(memory), size=REPLAYS)):
            optimiser.zero_grad()
            loss_of(network, memory[chosen]).backward()
            optimiser.step()

    def actions(observations: Any) -> Any:
        return network.act(torch.as_tensor(observations))[2].numpy()

    seeds = evaluation_seeds(seed, episodes).tolist()
    return play_together(BilliardsVectorEnv(episodes), actions, seeds)["success_rate"], network


def measure(output: Path, policy: Path) -> dict[str, Any]:
    """Trains the runs without results, and writes the result of each as soon as it ends.

    Args:
        output: The JSON file of the results.
        policy: The file for the weights of the first run. If it does not exist, this run is trained again.

    Returns:
        The content of the file: `machine`, `settings`, and `results[shots][seed]`, the success.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    found = resumed(output, {"episodes": EPISODES, "speeds": SPEEDS}, results={})
    for shots, seeds in RUNS.items():
        runs = found["results"].setdefault(str(shots), {})
        for seed in seeds:
            first = shots == min(RUNS) and seed == seeds[0]
            if str(seed) not in runs or (first and not policy.exists()):
                runs[str(seed)], network = train(seed, shots, EPISODES)
                write_json(output, found)
                if first:
                    save_weights(policy, {name: tensor.numpy() for name, tensor in network.state_dict().items()})
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table for the page, by name."""
    rows = []
    for shots, runs in found["results"].items():
        rates = list(runs.values())
        by_seed = ", ".join(f"{rate:.1%}" for rate in rates)
        rows.append((f"{int(shots):,}", by_seed, as_percent(over_seeds(rates))))
    return {
        "machine": machine_line(found["machine"]),
        "table": table(("shots", "success by seed", "mean over seeds"), rows, left=0),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.learn_by_gradient --help`."""
    files = {"output": (OUTPUT, "JSON file"), "policy": (POLICY, "weights, .npz")}
    description = "Measure a network that learns by the gradient of its shots."
    args = parser_of("learn_by_gradient", description, **files).parse_args(arguments)
    torch.set_num_threads(1)
    report(lambda: measure(args.output, args.policy), blocks, args.output, args.policy)


if __name__ == "__main__":
    main()
