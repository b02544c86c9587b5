"""Trains the network for the probability of a run-out from a position: `python -m studies.run_outs`.

The planner plays racks of nine ball and eight ball for run-outs, with noise. When it loses its turn, it plays on from
the position of the balls, with the cue ball in a random place if it is in hand. So there are good and bad positions.
The network learns the probability of a run-out from each of them (`billiards_env.players.run_outs`). In the first round
the planner rates positions by the next pot, in the others by a network that was trained on the rounds before. The final
network is trained on all rounds. `FOLDS` other networks measure the loss, each on the racks that it was not trained on.

The positions are in `runs/run_outs`, one file for each `PART` racks. The command skips files that exist, so delete the
folder after a change of the planner or of the settings. The weights are in `billiards_env/players/run_outs.npz`, and
the results in `studies/results/run_outs.json`. A decision has a time limit, so the results depend on the machine.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from benchmarks import machine, rows_table, run_command
from billiards_env.games import GAMES, GameState, Setup, custom_opening, opening, play
from billiards_env.games.batch import unplayed
from billiards_env.games.game_state import members, on_table
from billiards_env.games.placement import cue_ball_area, cue_ball_point
from billiards_env.games.referee import legal_balls
from billiards_env.players import run_outs
from billiards_env.players.levels import with_noise
from billiards_env.players.planner import Options, plan
from billiards_env.players.values import Values
from billiards_env.scene import Scene
from studies import RUNS, completed, executor, load_arrays, save_arrays
from studies.planner import FIXED_BREAK, MAX_SPEED, OLYMPIAD

Floats = NDArray[np.float64]

FOLDER = RUNS / "run_outs"
ROUNDS, PARTS, PART, SEED = 3, 5, 12, 60
"""Numbers of rounds, of parts of a setting in a round, and of racks in a part; the seed."""

SECONDS, LONGEST = 0.1, 60
"""Processor time of a decision, and the largest number of turns in a rack and of strokes in a turn."""

HIDDEN, EPOCHS, BATCH, RATE, DECAY, FOLDS = 16, 30, 256, 5e-3, 0.1, 5


class Setting(NamedTuple):
    """What the planner plays.

    Attributes:
        rules: The game.
        scene: The name of the scene. On `pool` there is no english.
        noise: Standard deviations of the direction, degrees, and of the speed, m/s.
    """

    rules: str
    scene: str
    noise: tuple[float, float]


SETTINGS = tuple(
    Setting(rules, scene, noise)
    for rules, scene, noises in (
        ("nine_ball", "real_pool", ((0.03, 0.0), (0.057, 0.0), OLYMPIAD, (0.5, 0.075))),
        ("nine_ball", "pool", ((0.057, 0.02), OLYMPIAD)),
        ("eight_ball", "real_pool", ((0.057, 0.0), OLYMPIAD)),
        ("eight_ball", "pool", ((0.057, 0.02),)),
    )
    for noise in noises
)


def play_rack(
    setting: Setting, weights: run_outs.Weights | None, rng: np.random.Generator
) -> tuple[list[Floats], list[bool]]:
    """Plays a rack to its end in several turns.

    Returns:
        The inputs (k,) of the network for each position after the break, and whether its turn won the rack.
    """
    setup = Setup(setting.rules, Scene.named(setting.scene, GAMES[setting.rules].n_object_balls[1]))
    deviations, english = (math.radians(setting.noise[0]), setting.noise[1]), setting.scene != "pool"
    game = play(setup, opening(setup, rng), with_noise(FIXED_BREAK, setting.noise, MAX_SPEED, rng)).game
    inputs, won = [], []
    for _ in range(LONGEST):
        if game.state.over:
            break
        game, before = next_turn(setup, game, rng), len(inputs)
        while not game.state.over and game.state.player == 0 and len(inputs) - before < LONGEST:
            values = Values(setup, game, MAX_SPEED, deviations, True, english, weights)
            here = unplayed(game)
            inputs.append(
                values.inputs(here, legal_balls(setup.rules, here.states, np.zeros(1, int)), np.ones(1, bool))[0]
            )
            options = Options(True, english, values.of)
            stroke = plan(setup, game, MAX_SPEED, rng, SECONDS, noise=setting.noise, options=options).stroke
            game = play(setup, game, with_noise(stroke, setting.noise, MAX_SPEED, rng)).game
        won += [game.state.winner == 0] * (len(inputs) - before)
    return inputs, won


def next_turn(setup: Setup, game: GameState, rng: np.random.Generator) -> GameState:
    """Returns the game with player 0 to shoot.

    A cue ball in hand lies in a random place. If the groups are assigned, player 0 gets one at random.
    """
    state, positions = game.state, game.positions.copy()
    if state.in_hand:
        x_low, x_high, y_low, y_high = cue_ball_area(setup.scene, state)
        x, y = rng.uniform((x_low, y_low), (x_high, y_high)).tolist()
        positions[0] = cue_ball_point(setup.scene, positions, state, (x, y))
    solids = int(state.solids) if state.solids < 0 else int(rng.integers(2))
    return custom_opening(setup, positions, {"on_table": members(on_table(state)), "solids": solids})


def play_part(setting: int, part: int, weights: run_outs.Weights | None, path: Path) -> None:
    """Plays `PART` racks of a setting and writes their positions."""
    rng, inputs, won, racks = np.random.default_rng([SEED, setting, part]), [], [], []
    for rack in range(PART):
        rows, ends = play_rack(SETTINGS[setting], weights, rng)
        inputs += rows
        won += ends
        racks += [rack] * len(ends)
    arrays = {"inputs": np.array(inputs, np.float32), "won": np.array(won), "rack": np.array(racks)}
    save_arrays(path, {**arrays, "cell": np.full(len(won), setting)})


class Positions(NamedTuple):
    """L positions of racks.

    Attributes:
        inputs: (L, k) of the network.
        won: (L,) bool, whether the position led to a run-out.
        rack: (L,) the number of the rack.
        cell: (L,) the index of its setting.
    """

    inputs: NDArray[np.float32]
    won: NDArray[np.bool_]
    rack: NDArray[np.int64]
    cell: NDArray[np.int64]


def load_positions(paths: Sequence[Path]) -> Positions:
    """Returns the positions in files."""
    parts = [load_arrays(path) for path in paths]
    racks = [PART * k + part["rack"] for k, part in enumerate(parts)]
    inputs, won, cell = (np.concatenate([part[name] for part in parts]) for name in ("inputs", "won", "cell"))
    return Positions(inputs, won, np.concatenate(racks), cell)


def fit(inputs: NDArray[np.float32], won: NDArray[np.bool_]) -> run_outs.Weights:
    """Returns the weights of a network that is trained on inputs (L, k) and ends (L,), see `Positions`."""
    torch.manual_seed(SEED)
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0) + 1e-3
    x, y = torch.as_tensor((inputs - mean) / scale), torch.as_tensor(won, dtype=torch.float32)
    layers = nn.Linear(inputs.shape[1], HIDDEN), nn.Linear(HIDDEN, 1)
    network = nn.Sequential(layers[0], nn.Tanh(), layers[1])
    optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, total_steps=EPOCHS * math.ceil(len(x) / BATCH))
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(x)).split(BATCH):
            loss = nn.functional.binary_cross_entropy_with_logits(network(x[rows])[:, 0], y[rows])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    matrices = {f"w{k}": layer.weight.detach().numpy().T for k, layer in enumerate(layers)}
    biases = {f"b{k}": layer.bias.detach().numpy() for k, layer in enumerate(layers)}
    return {"mean": mean, "scale": scale, **matrices, **biases}


def losses(positions: Positions) -> list[dict[str, Any]]:
    """Returns for each setting the numbers of positions and of run-outs, and two mean logarithmic losses.

    `network` is the loss in the cross-validation, and `share` the loss of a constant, the share of run-outs in the
    setting.
    """
    chances, fold = np.empty(len(positions.won)), positions.rack % FOLDS
    for k in range(FOLDS):
        weights = fit(positions.inputs[fold != k], positions.won[fold != k])
        chances[fold == k] = run_outs.chances(weights, positions.inputs[fold == k].astype(float))
    rows = []
    for cell in range(len(SETTINGS)):
        won, chance = positions.won[positions.cell == cell], chances[positions.cell == cell]
        both = {"network": _loss(chance, won), "share": _loss(np.full(len(won), won.mean()), won)}
        rows.append({**SETTINGS[cell]._asdict(), "positions": len(won), "run_outs": int(won.sum()), **both})
    return rows


def _loss(chance: Floats, won: NDArray[np.bool_]) -> float:
    """Returns the mean logarithmic loss of probabilities."""
    return float(-np.log(np.clip(np.where(won, chance, 1.0 - chance), 1e-9, 1.0)).mean())


def measure(weights: Path, folder: Path, jobs: int) -> dict[str, Any]:
    """Plays the racks that have no file, trains the network and writes its weights.

    Returns:
        `machine`, and `cells`, see `losses`.

    Raises:
        OSError: If a file cannot be read or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    with executor(jobs) as pool:
        for number in range(ROUNDS):
            network = fit(*load_positions(paths)[:2]) if paths else None
            paths += play_round(pool, number, network, folder)
    positions = load_positions(paths)
    save_arrays(weights, fit(positions.inputs, positions.won))
    return {"machine": machine(), "cells": losses(positions)}


def play_round(pool: Executor, number: int, weights: run_outs.Weights | None, folder: Path) -> list[Path]:
    """Plays the parts of a round that have no file. Returns the paths of all its parts."""
    parts = itertools.product(range(number * PARTS, (number + 1) * PARTS), range(len(SETTINGS)))
    calls = {folder / f"{part:03d}_{cell}.npz": (play_part, cell, part, weights) for part, cell in parts}
    missing = {path: (*call, path) for path, call in calls.items() if not path.exists()}
    for _ in completed(pool, missing, len(calls) - len(missing)):
        pass  # each call writes its file
    return list(calls)


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the table for the page, by name."""
    columns = {
        "game": "{game}",
        "scene": "{scene}",
        "noise": "{noise[0]:g} degrees, {noise[1]:g} m/s",
        "positions": "{positions:,}",
        "run-outs": "{won:.0%}",
        "baseline loss": "{share:.3f}",
        "network loss": "{network:.3f}",
    }
    rows = []
    for cell in result["cells"]:
        won = cell["run_outs"] / max(cell["positions"], 1)
        rows.append({**cell, "game": cell["rules"].replace("_", " "), "won": won})
    return {"table": rows_table(columns, rows, left=3)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.run_outs --help`."""
    options = {
        "weights": (run_outs.WEIGHTS, "weights, .npz"),
        "folder": (FOLDER, "folder of the positions"),
        "jobs": (2, "processes"),
    }
    torch.set_num_threads(1)
    about = "Train the network for the probability of a run-out."
    run_command("studies.run_outs", about, arguments, measure, blocks, options)


if __name__ == "__main__":
    main()
