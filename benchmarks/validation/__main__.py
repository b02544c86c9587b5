"""Runs the command line; see `python -m benchmarks.validation --help`."""

from __future__ import annotations

from pathlib import Path

import benchmarks.validation as validation
from benchmarks import IMAGES, parser_of, report, save
from billiards_env.commands import ending


@ending()
def main(arguments: list[str] | None = None) -> None:
    """Measures, prints the tables, writes `benchmarks/results/validation.json` and draws the picture."""
    parser = parser_of("validation", "Compare the laws of the package with measurements.")
    parser.add_argument("--folder", type=Path, default=IMAGES, help="where the picture goes (default: docs/images)")
    args = parser.parse_args(arguments)
    report(validation.measure(), validation.blocks, args.output)
    from benchmarks.validation import pictures

    save(pictures.picture(), args.folder / "validation.png")


if __name__ == "__main__":
    main()
