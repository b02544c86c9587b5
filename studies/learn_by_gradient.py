"""Measures a network that learns to pot a ball by the gradient of its shots: `python -m studies.learn_by_gradient`.

The observation is that of `Billiards-v0`: the positions. The network returns for a pocket an action and the chance that
it pots the ball. The mirror symmetry of the table makes one corner of four, and one side of two. A shot gives the
margin of the pot and its derivative by the action (see `billiards_env.torch.pot_margins`), and no reward. The shots of
the last batches are used again, with margins that are linear in the action, while the action is near.

The results are in `studies/results/learn_by_gradient.json`. The command skips seeds that have results there.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from tqdm import tqdm

from benchmarks import machine, machine_line, table
from billiards_env.envs import BilliardsVectorEnv
from billiards_env.evaluation import evaluation_seeds, play_together
from billiards_env.files import write_json
from billiards_env.intervals import as_percent, over_seeds
from billiards_env.scene import Scene
from billiards_env.torch import pot_margins
from studies import RESULTS

OUTPUT = RESULTS / "learn_by_gradient.json"
SHOTS, SEEDS, EPISODES = 1_000_000, (20, 21, 22), 2000
BATCH, REPLAYS, MEMORY = 128, 4, 100
LEARNING_RATE, SPEED = 2e-3, 0.5
EXPLORED = 0.1
"""Share of the shots at a random pocket."""
WIDTH, NEAR = 0.05, 0.03
"""m, the scale of the loss of a margin, and the largest change of an action for which a margin counts as linear."""


class Played(NamedTuple):
    """Shots of a batch: what was seen and done, the margins of the pots, m, and their derivatives by the actions."""

    observations: Tensor
    pockets: Tensor
    actions: Tensor
    margins: Tensor
    slopes: Tensor


class Network(nn.Module):
    """Three layers of 256 units: from the positions, mirrored for a pocket, to an action and the logit of a pot."""

    signs: Tensor
    is_side: Tensor
    radius: Tensor

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        layers = (nn.Linear(4, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU())
        self.layers = nn.Sequential(*layers, nn.Linear(256, 6))
        places = torch.tensor([(pocket.x, pocket.y) for pocket in scene.table.pockets])
        self.register_buffer("signs", places.sign())
        self.register_buffer("is_side", (places[:, 0] == 0).long())
        self.register_buffer("radius", torch.tensor([pocket.radius for pocket in scene.table.pockets]))

    def forward(self, observations: Tensor, pockets: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the actions (m, 2) and the logits (m,) for observations (m, 4) and pockets (m,)."""
        signs = self.signs[pockets]
        signs = torch.where(signs == 0, observations[:, 2:].sign(), signs)  # a side: mirrored by the ball
        out = self.layers(observations * signs.repeat(1, 2)).reshape(-1, 2, 3)
        out = out[torch.arange(len(out)), self.is_side[pockets]]
        return SPEED * signs * nn.functional.normalize(out[:, :2], dim=-1), out[:, 2]

    def best(self, observations: Tensor, explored: float = 0.0) -> Tensor:
        """Returns the pockets (m,) with the best chance, or drawn by their chances with a share of random ones."""
        with torch.no_grad():
            m, count = len(observations), len(self.signs)
            logits = self(observations.repeat_interleave(count, 0), torch.arange(count).repeat(m))[1].reshape(m, count)
        if not explored:
            return logits.argmax(-1)
        return ((1.0 - explored) * logits.softmax(-1) + explored / count).multinomial(1)[:, 0]


def loss_of(network: Network, played: Played) -> Tensor:
    """Returns the loss of shots. Its gradient by an action is at most 1; that of an action far from the shot is 0."""
    actions, chances = network(played.observations, played.pockets)
    change = (actions - played.actions).detach()
    missing = network.radius[played.pockets] - played.margins - (played.slopes * change).sum(-1)
    push = played.slopes * (2.0 * missing / (WIDTH**2 + missing**2))[:, None]  # of log(1 + (missing / WIDTH)^2)
    push = push / push.norm(dim=-1, keepdim=True).clamp(min=1.0)
    potted = nn.functional.binary_cross_entropy_with_logits(chances, (played.margins > 0).float(), reduction="none")
    return ((0.1 * potted - (actions * push).sum(-1)) * (change.norm(dim=-1) < NEAR)).mean()


def play(network: Network, envs: BilliardsVectorEnv) -> Played:
    """Plays a shot in a new layout of each environment."""
    observations = torch.as_tensor(envs.reset()[0])
    pockets = network.best(observations, EXPLORED)
    with torch.no_grad():
        actions, _ = network(observations, pockets)
    actions.requires_grad_()
    positions = torch.as_tensor(envs.positions)
    margins = pot_margins(envs, positions, actions, threads=1)[torch.arange(len(actions)), 0, pockets]
    (slopes,) = torch.autograd.grad(margins.sum(), actions)
    return Played(observations, pockets, actions.detach(), margins.detach(), slopes)


def train(seed: int, shots: int, episodes: int) -> float:
    """Trains a network and returns its success on new layouts.

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
    for k in tqdm(range(steps), unit="batch", desc=f"seed {seed}", leave=False):
        for group in optimiser.param_groups:
            group["lr"] = LEARNING_RATE * min(1.0, (k + 1) / 100) * 0.5 * (1.0 + math.cos(math.pi * k / steps))
        memory.append(play(network, envs))
        for chosen in (len(memory) - 1, *random.integers(len(memory), size=REPLAYS)):
            optimiser.zero_grad()
            loss_of(network, memory[chosen]).backward()
            optimiser.step()

    def act(observations: Any) -> Any:
        seen = torch.as_tensor(observations)
        with torch.no_grad():
            return network(seen, network.best(seen))[0].numpy()

    return play_together(BilliardsVectorEnv(episodes), act, evaluation_seeds(seed, episodes).tolist())["success_rate"]


def measure(output: Path) -> dict[str, Any]:
    """Trains what has no results, and writes the result of each seed as soon as it ends.

    Args:
        output: The JSON file of the results.

    Returns:
        The content of the file: `machine`, `settings`, and `results[seed]`, the success.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    settings = {"shots": SHOTS, "episodes": EPISODES}
    found: dict[str, Any] = json.loads(output.read_text(encoding="utf-8")) if output.exists() else {}
    if found.get("settings") != settings:
        found = {"machine": machine(), "settings": settings, "results": {}}
    for seed in SEEDS:
        if str(seed) not in found["results"]:
            found["results"][str(seed)] = train(seed, SHOTS, EPISODES)
            write_json(output, found)
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table for the page, by name."""
    rates = list(found["results"].values())
    row = (f"{found['settings']['shots']:,}", ", ".join(f"{rate:.1%}" for rate in rates), as_percent(over_seeds(rates)))
    return {
        "machine": machine_line(found["machine"]),
        "table": table(("shots", "success by seed", "mean over seeds"), [row], left=0),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.learn_by_gradient --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.learn_by_gradient",
        description="Measure a network that learns by the gradient of its shots.",
    )
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file (default: %(default)s)")
    args = parser.parse_args(arguments)
    torch.set_num_threads(1)
    try:
        found = measure(args.output)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        print("\ninterrupted; the same command continues", file=sys.stderr)
        sys.exit(130)
    print("\n\n".join(blocks(found).values()))
    print(f"\nin {args.output}")


if __name__ == "__main__":
    main()
