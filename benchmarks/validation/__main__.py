"""Runs the command line; see `python -m benchmarks.validation --help`."""

from __future__ import annotations

from benchmarks import run_command
from benchmarks.validation import blocks, measure, pictures


def main(arguments: list[str] | None = None) -> None:
    """Measures, prints the tables, writes `benchmarks/results/validation.json` and draws the picture."""
    about = "Compare the laws of the package with measurements."
    run_command("benchmarks.validation", about, arguments, measure, blocks, {}, pictures.draw, jobs=True)


if __name__ == "__main__":
    main()
