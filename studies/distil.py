"""Distils a search into a small policy that plays nine ball without simulations: `python -m studies.distil`.

The candidates are the pots that geometry finds, at several speeds. The search simulates each of them and rates the
position after it with the values of the planner. A network learns these values from the positions and from the
geometry of a candidate and of the next pot. The policy plays the candidate with the best prediction. `ROUNDS` rounds of
expert iteration (Anthony, Tian and Barber 2017) collect positions: the search plays in the first round, the network in
the others. All breaks have the same turn and speed, those with the best mean value on `BREAKS` racks.

The weights are in `studies/results/policies/distilled.npz`. `billiards bench studies.distil:act --tasks NineBall-v0`
plays them. The results are in `studies/results/distil.json`.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm import tqdm

from benchmarks import machine, machine_line, table
from billiards_env.evaluation import evaluation_seeds, play
from billiards_env.files import write_json
from billiards_env.frozen import FROZEN, NAMESPACE
from billiards_env.games import GameState, Setup
from billiards_env.games.batch import play_batch
from billiards_env.games.game import opening_state
from billiards_env.intervals import success_rate
from billiards_env.players import run_outs
from billiards_env.players.planner import NOISE, Values, turn
from billiards_env.players.pots import (
    BALL_GAP,
    CUT_SIN,
    DX,
    DY,
    END_X,
    END_Y,
    FAR,
    GAPS,
    GHOST_X,
    GHOST_Y,
    SHOT_WIDTH,
    SPEED,
    SPEEDS,
    TOLERANCE,
    WALL,
    Tables,
    find_pots,
)
from billiards_env.scene import Scene
from studies import RESULTS, load_weights, parser_of, report, save_weights

Floats = NDArray[np.float64]
Weights = dict[str, NDArray[np.float32]]

TASK = "NineBall-v0"
OUTPUT, POLICY = RESULTS / "distil.json", RESULTS / "policies" / "distilled.npz"
ROUNDS, RACKS, BREAKS, EPISODES, SEED = 2, 8_000, 600, 1000, 50
"""Numbers of rounds, of racks in a round, of racks to choose the break and of layouts to evaluate; the seed."""
EXPLORED = 0.2
"""Share of the shots of the search for which it plays a random candidate."""
HIDDEN, EPOCHS, BATCH, RATE = 192, 12, 1024, 2e-3
POTS = 12
"""The largest number of pots of a position."""

SETUP = Setup("nine_ball", Scene.named("pool", 9))
MAX_SPEED = float(FROZEN[TASK].arguments["max_speed"])


def positions_of(observation: NDArray[np.float32]) -> tuple[Floats, NDArray[np.bool_]]:
    """Returns the positions (10, 2), m, and the potted balls (10,) of an observation of the task."""
    balls = observation[:20].reshape(10, 2).astype(np.float64)
    outside = np.asarray(np.abs(balls) >= 1.0)  # a ball in play is inside
    return balls * SETUP.scene.half_extents, outside[:, 0] | outside[:, 1]


def candidates(positions: Floats, potted: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.float32]]:
    """Returns the velocities (k, 2), m/s, and the features (k, f) of the pots of the ball on.

    Without a pot there is one candidate, a full hit.
    """
    ball = int(np.flatnonzero(~potted[1:])[0]) + 1
    targets = np.arange(10) == ball
    pots = find_pots(Tables(SETUP.scene, targets, positions[None], potted[None], MAX_SPEED), most=POTS)
    count = int(pots.count[0])
    rows = pots.rows[0, :count].repeat(len(SPEEDS), axis=0)
    shots = pots.shots[0, :count].reshape(-1, SHOT_WIDTH)
    possible = shots[:, SPEED] > 0
    rows, shots = rows[possible], shots[possible]
    if not len(rows):
        to = positions[ball] - positions[0]
        rows, shots = np.zeros((1, rows.shape[1])), np.zeros((1, SHOT_WIDTH))
        rows[0, TOLERANCE], shots[0, [DX, DY]], shots[0, SPEED] = 1e-3, to / np.hypot(*to), 0.4 * MAX_SPEED
    ends = np.where(shots[:, [END_X]] == 0.0, positions[ball], shots[:, END_X : END_Y + 1])
    signs = np.where(ends < 0, -1.0, 1.0)  # a reflected table has the same features
    rest = np.flatnonzero(~potted & (np.arange(10) > ball))
    later = np.zeros((len(rows), 8, 2))
    later[:, : len(rest)] = positions[rest] * signs[:, None]
    following = later[:, 0] - ends * signs
    leaves = np.repeat(positions[None], len(rows), axis=0)
    leaves[:, 0] = ends
    gone = np.repeat((potted | targets)[None], len(rows), axis=0)
    following_pots = find_pots(Tables(SETUP.scene, np.isin(np.arange(10), rest[:1]), leaves, gone, MAX_SPEED), most=2)
    ease = np.log(np.maximum(following_pots.rows[..., TOLERANCE], 1e-4)) + 4.0
    rows[:, GHOST_X : GHOST_Y + 1] *= signs
    rows[:, CUT_SIN] *= signs.prod(axis=1)
    features = (
        np.log(np.maximum(rows[:, TOLERANCE], 1e-4)) + 4.0,
        rows[:, :TOLERANCE],
        rows[:, BALL_GAP] / FAR,
        rows[:, WALL] >= 0,
        shots[:, SPEED] / MAX_SPEED,
        shots[:, DX : DY + 1] * signs,
        shots[:, GAPS:] / (np.abs(shots[:, GAPS:]) + 0.01),
        ends * signs,
        following,
        np.hypot(following[:, 0], following[:, 1]),
        ease,
        later.reshape(len(rows), -1),
        np.full(len(rows), len(rest) / 8.0),
    )
    return shots[:, SPEED, None] * shots[:, DX : DY + 1], np.column_stack(features).astype(np.float32)


def values_of(positions: Floats, potted: NDArray[np.bool_], velocities: Floats, is_break: bool = False) -> Floats:
    """Returns the probability of a run-out after each of k shots, (k,), as the planner estimates it."""
    state = opening_state(SETUP)._replace(in_hand="no", break_shot=is_break)
    state = state._replace(on_table=frozenset(np.flatnonzero(~potted).tolist()))
    game = GameState(positions, state)
    values = Values(SETUP, game, MAX_SPEED, (math.radians(NOISE[0]), NOISE[1]), True, False, run_outs.trained())
    return values.of(play_batch(SETUP, game, velocities, threads=1))


def predictions(weights: Weights, features: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the predicted value of each candidate, (k,), before the logistic function."""
    hidden = (features - weights["mean"]) / weights["scale"]
    for k in range(3):
        hidden = hidden @ weights[f"w{k}"] + weights[f"b{k}"]
        hidden = np.maximum(hidden, 0.0) if k < 2 else hidden
    return hidden[:, 0]


def action(weights: Weights, observation: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the action (2,) of the policy with the given weights for an observation (29,)."""
    positions, potted = positions_of(observation)
    if not potted.any():
        velocities = breaks(positions, weights["break"][None].astype(np.float64))
        return (velocities[0] / MAX_SPEED).astype(np.float32)
    velocities, features = candidates(positions, potted)
    return (velocities[predictions(weights, features).argmax()] / MAX_SPEED).astype(np.float32)


@functools.cache
def _trained() -> Weights:
    return load_weights(POLICY)


def act(observation: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the action of the policy in `POLICY`."""
    return action(_trained(), observation)


def breaks(positions: Floats, ways: Floats) -> Floats:
    """Returns the velocities (k, 2) of breaks; `ways` (k, 2) are the turn from a full hit, rad, and the speed, m/s."""
    to = (positions[1] - positions[0]) / np.hypot(*(positions[1] - positions[0]))
    return ways[:, 1:] * turn(np.broadcast_to(to, ways.shape), ways[:, 0])


def best_break(racks: int, seed: int) -> NDArray[np.float32]:
    """Returns the turn, rad, and the speed, m/s, of the break with the best mean value over a number of racks."""
    turns, speeds = np.meshgrid(np.linspace(-0.03, 0.03, 25), np.linspace(0.5, 1.0, 9) * MAX_SPEED)
    ways, total = np.column_stack((turns.ravel(), speeds.ravel())), 0.0
    env: Any = gym.make(NAMESPACE + TASK)
    for rack in range(racks):
        env.reset(seed=seed + rack)
        positions, potted = env.unwrapped.positions, env.unwrapped.potted
        total = total + values_of(positions, potted, breaks(positions, ways), is_break=True)
    return ways[np.argmax(total)].astype(np.float32)


def collect(
    racks: int, seed: int, weights: Weights, plays: bool, progress: Callable[[], object]
) -> tuple[NDArray[np.float32], Floats]:
    """Plays racks and returns the features (k, f) of all candidates in them, and their values (k,).

    If `plays`, the network plays. Otherwise the search plays, with some random shots.
    """
    env, rng = cast(Any, gym.make(NAMESPACE + TASK)), np.random.default_rng(seed)
    features, values = [], []
    for rack in range(racks):
        observation, _ = env.reset(seed=seed + rack)
        over = False
        while not over:
            chosen = action(weights, observation) if plays else None
            if env.unwrapped.potted.any():
                velocities, seen = candidates(*positions_of(observation))
                features.append(seen)
                # Not the positions of the observation: they are rounded, so balls that touch would overlap.
                values.append(values_of(env.unwrapped.positions, env.unwrapped.potted, velocities))
                if chosen is None:
                    k = rng.integers(len(seen)) if rng.random() < EXPLORED else values[-1].argmax()
                    chosen = (velocities[k] / MAX_SPEED).astype(np.float32)
            elif chosen is None:
                chosen = action(weights, observation)  # the break
            observation, _, over, _, _ = env.step(chosen)
        progress()
    return np.concatenate(features), np.concatenate(values)


def fit(features: NDArray[np.float32], values: Floats, seed: int) -> Weights:
    """Returns the weights of a network that predicts values (k,) from features (k, f)."""
    torch.manual_seed(seed)
    mean, scale = features.mean(axis=0), features.std(axis=0) + 1e-3
    inputs, targets = torch.as_tensor((features - mean) / scale), torch.as_tensor(values, dtype=torch.float32)
    layers = [nn.Linear(*sizes) for sizes in ((features.shape[1], HIDDEN), (HIDDEN, HIDDEN), (HIDDEN, 1))]
    network = nn.Sequential(layers[0], nn.ReLU(), layers[1], nn.ReLU(), layers[2])
    optimiser = torch.optim.Adam(network.parameters(), lr=RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, EPOCHS * math.ceil(len(inputs) / BATCH))
    descend(network, inputs, targets, optimiser, schedule, EPOCHS, BATCH)
    return {"mean": mean, "scale": scale, **arrays(layers)}


def descend(
    network: nn.Module, inputs: Tensor, targets: Tensor, optimiser: Any, schedule: Any, epochs: int, batch: int
) -> None:
    """Trains a network whose outputs (k, 1) are logits of the targets (k,); the schedule advances with each step."""
    for _ in range(epochs):
        for rows in torch.randperm(len(inputs)).split(batch):
            loss = nn.functional.binary_cross_entropy_with_logits(network(inputs[rows])[:, 0], targets[rows])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()


def arrays(layers: Sequence[nn.Linear]) -> Weights:
    """Returns the weights "w0", "b0", "w1", ... of layers. An input is a row, so "w0" is (inputs, outputs)."""
    found = {f"w{k}": layer.weight.detach().numpy().T for k, layer in enumerate(layers)}
    return found | {f"b{k}": layer.bias.detach().numpy() for k, layer in enumerate(layers)}


def evaluate(weights: Weights, seed: int) -> dict[str, float]:
    """Returns the success on new layouts, and the median time of a decision after the break, ms."""
    times: list[float] = []

    def timed(observation: NDArray[np.float32]) -> NDArray[np.float32]:
        begin = time.perf_counter()
        chosen = action(weights, observation)
        times.append(time.perf_counter() - begin)
        return chosen

    found = play(gym.make(NAMESPACE + TASK), timed, evaluation_seeds(seed, EPISODES).tolist())
    return {"successes": found["successes"], "ms_per_decision": 1e3 * float(np.median(times))}


def measure(output: Path, policy: Path) -> dict[str, Any]:
    """Trains the policy, writes its weights and the results, and returns the results.

    Returns:
        `machine`, `episodes`, and `rounds`: the number of candidates, and the success after each round.

    Raises:
        OSError: If a file cannot be written.
    """
    found: dict[str, Any] = {"machine": machine(), "episodes": EPISODES, "rounds": []}
    weights: Weights = {"break": best_break(BREAKS, 10 * SEED * RACKS)}
    features, values = [], []
    for number in range(ROUNDS):
        seed = (10 * SEED + 1 + number) * RACKS
        with tqdm(total=RACKS, unit="rack", desc=f"round {number + 1}") as bar:
            some = collect(RACKS, seed, weights, number > 0, bar.update)
        features.append(some[0])
        values.append(some[1])
        weights |= fit(np.concatenate(features), np.concatenate(values), seed)
        found["rounds"].append({"candidates": sum(map(len, values)), **evaluate(weights, SEED)})
        save_weights(policy, weights)
        write_json(output, found)
    return found


def blocks(found: dict[str, Any]) -> dict[str, str]:
    """Returns the table for the page, by name."""
    rows = []
    for number, one in enumerate(found["rounds"]):
        share = success_rate(one["successes"], found["episodes"])
        rows.append((str(number + 1), f"{one['candidates']:,}", share, f"{one['ms_per_decision']:.1f} ms"))
    head = ("round", "candidates so far", "success", "decision")
    return {"machine": machine_line(found["machine"]), "table": table(head, rows)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.distil --help`."""
    files = {"output": (OUTPUT, "JSON file"), "policy": (POLICY, "weights, .npz")}
    args = parser_of("distil", "Distil a search into a policy.", **files).parse_args(arguments)
    torch.set_num_threads(1)
    report(lambda: measure(args.output, args.policy), blocks, args.output, args.policy)


if __name__ == "__main__":
    main()
