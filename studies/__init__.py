"""Experiments with agents and players: commands that print tables and write JSON to `studies/results`.

Modules:
    learning: Trains the rows of `configs/learning.yaml` with several seeds: `make results`.
    budgets: Trains some of these rows with fewer and with more shots.
    self_play: Trains a player of eight ball against itself, and lets it play matches.
    timestep: Trains `configs/timestep.yaml` with several timesteps and compares the policies: `make study`.
    timestep_report: Makes its tables and pictures.
    timestep_shots: Chooses shots of these policies for the page of the study.
    failures: The four failures of a timestep, as small scenes.
    frozen_tasks: Measures players without training in the frozen tasks.
    scatter: Measures what players lose by the scatter of the cushions.
    leaderboard: Verifies the files of the leaderboard and makes its tables.
    figures: Draws the pictures that show no measurement, and a film of a run-out of the planner.
    tables: Makes the tables of games, numbers, actions and features.
    cards: Makes the cards of the published policies.
    readme: Writes the measured tables into the pages, and the cards.
"""

import functools
import html
import json
import multiprocessing
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, as_completed
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlencode

import numpy as np
from tqdm import tqdm

from agents import require
from agents.cluster import RayExecutor
from benchmarks import ROOT, machine, processes
from billiards_env.commands import all_jobs
from billiards_env.shots.records import read_data
from billiards_env.support.files import MAX_ARCHIVE, write_json

require("plot", ("matplotlib",))

RESULTS = ROOT / "studies" / "results"

RUNS = ROOT / "runs"
"""The folder of training runs; git ignores it."""


JOBS: dict[str, tuple[Any, str]] = {
    "jobs": (2, "runs at a time"),
    "address": ("", "address of a Ray cluster that trains, such as auto; without one this machine trains"),
}
"""The options of a command that trains, see `benchmarks.run_command`."""

K = TypeVar("K")


def executor(jobs: int, address: str = "") -> AbstractContextManager[Executor]:
    """Returns an executor: processes of this machine, or the Ray cluster at an address."""
    return RayExecutor(address) if address else processes(jobs, multiprocessing.get_context("spawn"))


def completed(pool: Executor, calls: Mapping[K, tuple[Any, ...]], done: int = 0) -> Iterator[tuple[K, Any]]:
    """Makes calls in a pool, and yields the key and the result of each as soon as it ends. Errors come after the last.

    Args:
        pool: The pool.
        calls: The function and the arguments of each call, by its key.
        done: The number of results that are already known, for the progress bar.
    """
    futures = {pool.submit(*call): key for key, call in calls.items()}
    with all_jobs() as job:
        for future in tqdm(as_completed(futures), total=done + len(calls), initial=done, unit="run", smoothing=0):
            key = futures[future]
            with job(str(key)):
                yield key, future.result()


def read_results(output: Path) -> dict[str, Any]:
    """Returns the content of a JSON file of results, {} if it does not exist. The errors are as in `resumed`."""
    return read_data(output, "results", MAX_ARCHIVE) if output.exists() else {}


def resumed(output: Path, settings: Mapping[str, Any], **empty: Any) -> dict[str, Any]:
    """Returns the content of the JSON file `output`, or new content with `empty` results if its settings differ.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the file is not a mapping in JSON.
    """
    settings, content = json.loads(json.dumps(settings)), read_results(output)
    return content if content.get("settings") == settings else {"machine": machine(), "settings": settings, **empty}


def fill(output: Path, content: dict[str, Any], jobs: Mapping[tuple[str, ...], Callable[[], Any]]) -> dict[str, Any]:
    """Computes the missing entries of nested results, and writes the JSON file `output` after each of them.

    Errors are raised after the last entry.

    Args:
        output: The file.
        content: The results so far.
        jobs: The functions that compute the entries, by their keys.

    Returns:
        The results with all entries.
    """
    with tqdm(jobs.items(), unit="result") as bar, all_jobs() as job:
        for (*parents, last), work in bar:
            place = functools.reduce(lambda inner, key: inner.setdefault(key, {}), parents, content)
            if last not in place:
                bar.set_description(name := ", ".join((*parents, last)))
                with job(name):
                    place[last] = work()
                    write_json(output, content)
    return content


def live_shot(scene: str, positions: Any, velocity: Any, steps: int) -> str:
    """Returns the part of the address of `play.html` from "#" on that plays a shot, escaped for an attribute of HTML.

    Args:
        scene: The name of a scene of `docs.web.build`.
        positions: (n, 2) m.
        velocity: (2,) velocity of the cue ball, m/s.
        steps: The number of timesteps in a second.
    """
    balls = ";".join(",".join(map(repr, place)) for place in np.asarray(positions).tolist())
    motion = ",".join(map(repr, [*np.asarray(velocity).tolist(), 0, 0, 0]))
    shot = {"game": "given", "scene": scene, "balls": balls, "motion": motion, "dt": steps}
    return html.escape("#" + urlencode(shot, safe=",;"))
