"""Measures the player "planner" under execution noise: `python -m studies.planner`.

* Run-outs: racks of nine ball on `real_pool` that are won from the break without losing the turn. "planner" plays for a
  run-out (`run_out=True`). It chooses the place of the cue ball and the break by simulations of the actual rack.
* Matches: eight ball on `real_pool` against other players. The player who breaks is drawn at random.
* One ball: `Billiards-v0` with its default arguments, one shot at one ball from a random layout, without english.

Each player gets the size of the errors as an argument. The results are in `studies/results/planner.json`, written after
each rack. The command continues after an interruption; with `--racks` it adds racks. A decision has a time limit, so
the results depend on the machine.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks import machine, machine_line, table
from billiards_env.evaluation import measure as play_alone
from billiards_env.files import write_json
from billiards_env.games import GameState, PlayedShot, Setup, Stroke, opening, play
from billiards_env.intervals import wilson_interval
from billiards_env.players.game_player import Player, find_player
from billiards_env.players.planner import parse_budget, plan, with_errors
from billiards_env.scene import Scene
from studies import RESULTS, errors_in_one_line

OUTPUT = RESULTS / "planner.json"
RACKS, SEED, MAX_SPEED, MAX_SHOTS = 60, 30, 8.0, 60
ONE_BALL = 10
"""Episodes that count as one rack."""

OLYMPIAD = (0.125, 0.075)
"""The noise of the Computer Olympiad (Smith 2007, PickPocket: A computer billiards shark): degrees and m/s."""

CELLS: tuple[tuple[str, tuple[float, float], str], ...] = (
    ("run-outs", (0.03, 0.0), "planner:100ms"),
    ("run-outs", (0.03, 0.0), "search:1000"),
    ("run-outs", (0.057, 0.0), "planner:100ms"),
    ("run-outs", (0.057, 0.0), "planner:300ms"),
    ("run-outs", (0.057, 0.0), "search:1000"),
    ("run-outs", OLYMPIAD, "planner:100ms"),
    ("run-outs", OLYMPIAD, "search:1000"),
    ("run-outs", (0.5, 0.075), "planner:100ms"),
    ("matches", OLYMPIAD, "search:200"),
    ("matches", OLYMPIAD, "geometric"),
    ("one ball", OLYMPIAD, "planner:100ms"),
    ("one ball", OLYMPIAD, "search:1000"),
)
"""What is measured: the experiment, the noise (degrees and m/s) and the player, in matches the opponent."""

PLANNER = "planner:100ms"
"""The player of the matches."""


def noisy(stroke: Stroke, noise: tuple[float, float], max_speed: float, rng: np.random.Generator) -> Stroke:
    """Returns a stroke with random errors of the direction, degrees, and of the speed, m/s."""
    errors = rng.standard_normal((1, 2)) * (math.radians(noise[0]), noise[1])
    (velocity,), (spin,) = with_errors(np.array([stroke.velocity]), np.array([stroke.spin]), errors, max_speed)
    return stroke._replace(velocity=tuple(velocity.tolist()), spin=tuple(spin.tolist()))


def shoot(setup: Setup, game: GameState, player: Player, noise: tuple[float, float], rngs: Sequence[Any]) -> PlayedShot:
    """Plays one shot with noise; `rngs` are the generators of the player and of the noise."""
    stroke = player(setup, game, MAX_SPEED, rngs[0])
    return play(setup, game, noisy(stroke, noise, MAX_SPEED, rngs[1]))


def run_out(player: str, noise: tuple[float, float], rng: np.random.Generator) -> dict[str, Any]:
    """Plays one rack of nine ball until the turn is lost.

    Returns:
        `success`, `strokes`, and `break`: "nine", "kept" or "lost".
    """
    setup = Setup("nine_ball", Scene.named("real_pool", 9))
    game, rngs, strokes, after_break = opening(setup, rng), rng.spawn(2), 0, ""
    chosen = _for_run_outs(player, noise) if player.startswith("planner") else find_player(player, setup, noise=noise)
    while not game.state.over and game.state.player == 0:
        game, strokes = shoot(setup, game, chosen, noise, rngs).game, strokes + 1
        after_break = after_break or ("nine" if game.state.over else ("lost", "kept")[game.state.player == 0])
    return {"success": game.state.winner == 0, "strokes": strokes, "break": after_break}


def _for_run_outs(player: str, noise: tuple[float, float]) -> Player:
    """Returns the planner that plays for run-outs."""
    seconds, shots = parse_budget(player.partition(":")[2])
    return lambda *given: plan(*given, seconds=seconds, shots=shots, noise=noise, run_out=True).stroke


def match(opponent: str, noise: tuple[float, float], rng: np.random.Generator) -> dict[str, Any]:
    """Plays one rack of eight ball against a player; who breaks is drawn. Returns `success` and `strokes`."""
    setup = Setup("eight_ball", Scene.named("real_pool", 15))
    names = [PLANNER, opponent]
    first = int(rng.integers(2))
    players = [find_player(names[(first + k) % 2], setup, noise=noise) for k in range(2)]
    game, rngs, strokes = opening(setup, rng), rng.spawn(2), 0
    while not game.state.over and strokes < MAX_SHOTS:
        game, strokes = shoot(setup, game, players[game.state.player], noise, rngs).game, strokes + 1
    return {"success": game.state.over and (first + game.state.winner) % 2 == 0, "strokes": strokes}


def one_ball(player: str, noise: tuple[float, float], rng: np.random.Generator) -> dict[str, Any]:
    """Plays `ONE_BALL` episodes of `Billiards-v0`. Returns `success`, the number of pots, and `strokes`."""
    found = play_alone(player, {}, noise, ONE_BALL, int(rng.integers(2**31)))
    return {"success": found["successes"], "strokes": ONE_BALL}


EXPERIMENTS: dict[str, Callable[..., dict[str, Any]]] = {"run-outs": run_out, "matches": match, "one ball": one_ball}


def measure(output: Path, racks: int) -> dict[str, Any]:
    """Plays the racks without results, and writes the results of each as soon as it is played.

    The JSON file `output` has `machine`, `settings`, and `results[experiment][noise][player]`: one entry for each rack.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    settings = {"seed": SEED, "max_speed": MAX_SPEED}
    found: dict[str, Any] = json.loads(output.read_text(encoding="utf-8")) if output.exists() else {}
    if found.get("settings") != settings:
        found = {"machine": machine(), "settings": settings, "results": {}}
    cells = itertools.product(range(racks), CELLS)
    with tqdm(cells, total=racks * len(CELLS), unit="rack") as bar:
        for rack, (experiment, noise, player) in bar:
            name = f"{noise[0]:g} degrees, {noise[1]:g} m/s"
            bar.set_description(f"{experiment}, {name}, {player}")
            played = found["results"].setdefault(experiment, {}).setdefault(name, {}).setdefault(player, [])
            if rack == len(played):
                played.append(EXPERIMENTS[experiment](player, noise, np.random.default_rng([SEED, rack])))
                write_json(output, found)
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    made = {"machine": machine_line(found["machine"])}
    for experiment, noises in found["results"].items():
        rows = [
            (noise, player, *_row(experiment, played)) for noise, ps in noises.items() for player, played in ps.items()
        ]
        head = {
            "run-outs": ("racks", "run-outs", "turn kept after the break", "nine on the break", "strokes"),
            "matches": ("racks", "racks won by the planner", "strokes"),
            "one ball": ("shots", "pots"),
        }[experiment]
        made[experiment] = table(("noise", "opponent" if experiment == "matches" else "player", *head), rows, left=2)
    return made


def _row(experiment: str, played: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    won = sum(rack["success"] for rack in played)
    count = len(played) * (ONE_BALL if experiment == "one ball" else 1)
    low, high = (100 * end for end in wilson_interval(won, count))
    share = str(count), f"{won / count:.1%} ({low:.1f} to {high:.1f})"
    strokes = f"{np.mean([rack['strokes'] for rack in played]):.1f}"
    if experiment == "run-outs":
        breaks = [rack["break"] for rack in played]
        return (
            *share,
            f"{1 - breaks.count('lost') / len(played):.0%}",
            f"{breaks.count('nine') / len(played):.0%}",
            strokes,
        )
    return (*share, strokes) if experiment == "matches" else share


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.planner --help`."""
    parser = argparse.ArgumentParser(prog="python -m studies.planner", description="Measure the planner under noise.")
    parser.add_argument("--racks", type=int, default=RACKS, help="racks of each player (default: %(default)s)")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file (default: %(default)s)")
    args = parser.parse_args(arguments)
    with errors_in_one_line():
        found = measure(args.output, args.racks)
    print("\n\n".join(blocks(found).values()))
    print(f"\nin {args.output}")


if __name__ == "__main__":
    main()
