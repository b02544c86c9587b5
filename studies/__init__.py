"""Experiments with agents and players: commands that print tables and write JSON to `studies/results`.

Modules:
    recipes: Trains every recipe with several seeds: `make results`.
    timestep: Trains policies with several timesteps and compares them: `make study`.
    timestep_page: Writes the page with the shots of these policies.
    gradient_timestep: Compares derivatives through timesteps with exact ones.
    planner: Measures the planner under execution noise.
    pot_chances: Compares the probability of a pot to first order with samples.
    leaderboard: Verifies the files of the leaderboard and makes its page.
    tasks: Measures players without training in the frozen tasks.
    run_outs: Measures run-outs of players without training, with and without execution noise.
"""

import argparse
import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

from agents import require

require("plot", ("matplotlib",))

RESULTS = Path(__file__).resolve().parent / "results"

RUNS = RESULTS.parents[1] / "runs"
"""The folder of training runs; git ignores it."""


def parser_of_runs(name: str, description: str) -> argparse.ArgumentParser:
    """Returns the parser of a command that trains, with its options for runs and files."""
    parser = argparse.ArgumentParser(prog=f"python -m studies.{name}", description=description)
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time (default: %(default)s)")
    parser.add_argument("--address", help='address of a Ray cluster that trains, e.g. "auto" (default: this machine)')
    parser.add_argument("--folder", type=Path, help=f"folder of all files (default: see `studies.{name}`)")
    return parser


@contextlib.contextmanager
def errors_in_one_line() -> Iterator[None]:
    """Ends the command with one line if its work raises an error or is interrupted."""
    try:
        yield
    except (ImportError, OSError, RuntimeError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        print("\ninterrupted; the same command continues", file=sys.stderr)
        sys.exit(130)
