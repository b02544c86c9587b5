"""Experiments with agents and players: commands that print tables and write JSON to `studies/results`.

Modules:
    learning: Trains the rows of `configs/learning.yaml` with several seeds: `make results`.
    timestep: Trains policies with several timesteps and compares them: `make study`.
    timestep_report: Makes its tables and pictures.
    timestep_shots: Chooses shots of these policies for the page of the study.
    other_simulators: Trains such policies in pymunk and MuJoCo, and plays policies of exact worlds in them.
    simulators_worker: Plays shots in pymunk or MuJoCo, in a separate environment.
    derivatives: Compares derivatives through timesteps with exact ones, and trains networks by derivatives.
    failures: The four failures of a timestep, as small scenes.
    planner: Measures the planner under execution noise.
    positions: Measures the strokes of players in a fixed set of positions.
    tasks: Measures players without training in the frozen tasks.
    leaderboard: Verifies the files of the leaderboard and makes its tables.
    figures: Draws the pictures that show no measurement, and a film of a run-out of the planner.
    run_outs: Trains the network that computes the probability of a run-out from a position.
    games: Makes the table of the games.
    readme: Writes the measured tables into the pages.
"""

import argparse
import contextlib
import html
import json
import multiprocessing
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np

from agents import require
from agents.cluster import RayExecutor
from benchmarks import machine, processes
from billiards_env.commands import ending
from billiards_env.files import replacing

require("plot", ("matplotlib",))

RESULTS = Path(__file__).resolve().parent / "results"

RUNS = RESULTS.parents[1] / "runs"
"""The folder of training runs; git ignores it."""


def parser_of(name: str, description: str, **options: tuple[Any, str]) -> argparse.ArgumentParser:
    """Returns the parser of a command. An option is its default value, which sets its type, and its help text.

    An option with the default False is a switch.
    """
    parser = argparse.ArgumentParser(prog=f"python -m studies.{name}", description=description)
    for option, (default, text) in options.items():
        if default is False:
            parser.add_argument(f"--{option}", action="store_true", help=text)
        else:
            kind = type(default)
            parser.add_argument(f"--{option}", type=kind, default=default, help=f"{text} (default: %(default)s)")
    return parser


def parser_of_runs(name: str, description: str) -> argparse.ArgumentParser:
    """Returns the parser of a command that trains, with its options for runs and files."""
    parser = parser_of(name, description, jobs=(2, "runs at a time"))
    parser.add_argument("--address", help='address of a Ray cluster that trains, e.g. "auto" (default: this machine)')
    parser.add_argument("--folder", type=Path, help=f"folder of all files (default: see `studies.{name}`)")
    return parser


@contextlib.contextmanager
def workers(jobs: int, address: str | None) -> Iterator[Executor]:
    """Yields processes of this machine, or the nodes of the Ray cluster at an address."""
    if address is not None:
        yield RayExecutor(address)
    else:
        with processes(jobs, multiprocessing.get_context("spawn")) as pool:
            yield pool


def resumed(output: Path, settings: Mapping[str, Any], **empty: Any) -> dict[str, Any]:
    """Returns the content of the JSON file `output`, or new content with `empty` results if its settings differ.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the file is not JSON.
    """
    settings = json.loads(json.dumps(settings))
    found: dict[str, Any] = json.loads(output.read_text(encoding="utf-8")) if output.exists() else {}
    return found if found.get("settings") == settings else {"machine": machine(), "settings": settings, **empty}


def live_shot(scene: str, positions: Any, velocity: Any, steps: int) -> str:
    """Returns the address of a page that plays a shot with both engines, escaped for an attribute of HTML.

    Args:
        scene: The name of a scene of `web.build`.
        positions: (n, 2) m.
        velocity: (2,) velocity of the cue ball, m/s.
        steps: The number of timesteps in a second.
    """
    balls = ";".join(",".join(map(repr, place)) for place in np.asarray(positions).tolist())
    motion = ",".join(map(repr, [*np.asarray(velocity).tolist(), 0, 0, 0]))
    shot = {"game": "given", "scene": scene, "balls": balls, "motion": motion, "dt": steps}
    return html.escape("play.html#" + urlencode(shot, safe=",;"))


def save_weights(path: Path, weights: Mapping[str, Any]) -> None:
    """Writes arrays by name, completely or not at all."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **weights)


def load_weights(path: Path) -> dict[str, Any]:
    """Returns the arrays in a file, by name. This runs no code from the file.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it does not hold arrays of numbers.
    """
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def report(measure: Callable[[], Any], blocks: Callable[[Any], Mapping[str, str]], *outputs: Path) -> None:
    """Runs the work of a command, and prints its blocks and its files. After an error it prints one line."""
    with ending("the same command continues"):
        found = measure()
    print("\n\n".join(blocks(found).values()))
    print("\nin", " and ".join(map(str, outputs)))
