"""Runs the command line; see `python -m benchmarks.validation --help`."""

from __future__ import annotations

import argparse
from pathlib import Path

import benchmarks.validation as validation
from benchmarks import IMAGES, RESULTS, print_blocks, save
from billiards_env.files import write_json


def main(argv: list[str] | None = None) -> int:
    """Measures, prints the tables, writes `benchmarks/results/validation.json` and draws the picture."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.validation", description="Compare the laws of the package with measurements."
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "validation.json", help="where the JSON goes")
    parser.add_argument("--folder", type=Path, default=IMAGES, help="where the picture goes (default: docs/images)")
    arguments = parser.parse_args(argv)
    result = validation.measure()
    print_blocks(validation.blocks(result))
    write_json(arguments.output, result)
    from benchmarks.validation import pictures

    save(pictures.picture(), arguments.folder / "validation.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
