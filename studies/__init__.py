"""Experiments with agents and players: commands that print tables and write JSON to `studies/results`.

Modules:
    recipes: Trains every recipe with several seeds: `make results`.
    timestep: Trains one recipe with several timesteps and compares the policies: `make study`.
    players: Measures players without training.
    run_outs: Measures run-outs of players without training, with and without execution noise.
"""

from pathlib import Path

from agents import require

require("plot", ("matplotlib",))

RESULTS = Path(__file__).resolve().parent / "results"

RUNS = RESULTS.parents[1] / "runs"
"""The folder of training runs; git ignores it."""
