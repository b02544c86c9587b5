"""Writes the measured tables into README.md, the pages in docs and the paper: `python -m studies.readme`.

A line `<!-- speed: shots -->` is followed by the block "shots" that `benchmarks.speed.blocks` makes from
`benchmarks/results/speed.json`, up to a line `<!-- end -->`. The command replaces this block. It measures nothing, and
text outside of the markers does not change. It also writes the cards of the published policies. `--check` writes
nothing and fails if a page or a card is not up to date.
"""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import ROOT, all_blocks, parser_of, results_file
from billiards_env.commands import ending
from billiards_env.support.files import write_atomically
from studies.cards import cards

PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))


SOURCES = {
    command.rpartition(".")[2]: command
    for command in (
        "benchmarks.ablation",
        "benchmarks.accuracy",
        "benchmarks.calibration",
        "benchmarks.comparison",
        "benchmarks.cushion_error",
        "benchmarks.error_limit",
        "benchmarks.gradients",
        "benchmarks.machines",
        "benchmarks.real_tracks",
        "benchmarks.referees",
        "benchmarks.speed",
        "benchmarks.stress",
        "benchmarks.validation",
        "benchmarks.vector",
        "benchmarks.release.dist",
        "studies.leaderboard",
        "studies.learning",
        "studies.budgets",
        "studies.self_play",
        "studies.frozen_tasks",
        "studies.scatter",
        "studies.timestep",
        "studies.timestep_shots",
        "docs.web.check",
    )
}
"""The commands whose results the pages show, by the name of the results."""

GENERATED = {"tables": "studies.tables"}
"""The module of the tables that need no measurement, by the name of the source."""

_BEGIN, _END = re.compile(r"<!-- (\w+): (.+) -->"), "<!-- end -->"


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name


def results(source: str, root: Path = ROOT) -> Path:
    """Returns the file of the results of a source, in the package of its command, or in `bench`."""
    return results_file("billiards_env.bench.frozen_tasks" if source == "frozen_tasks" else SOURCES[source], root)


def block(source: str, name: str, root: Path = ROOT) -> str:
    """Returns one block of Markdown, or a line with the command that measures it.

    Raises:
        ValueError: If there is no such source or block.
    """
    if source not in SOURCES | GENERATED:
        raise ValueError(f"<!-- {source}: {name} -->: expected one of {', '.join(SOURCES | GENERATED)}")
    measured: dict[str, Any] = {}
    if source in SOURCES:
        path = results(source, root)
        if not path.exists():
            return f"*Not measured yet: `python -m {SOURCES[source]}`.*"
        measured = json.loads(path.read_text(encoding="utf-8"))
    texts = all_blocks(measured, importlib.import_module((SOURCES | GENERATED)[source]).blocks)
    if name not in texts:
        raise ValueError(f"<!-- {source}: {name} -->: expected one of {', '.join(texts)}")
    return texts[name]


def fill_page(text: str, root: Path = ROOT) -> str:
    """Returns a page with its blocks made from the results in the packages of a folder.

    Raises:
        ValueError: If a marker has no end, or names an unknown source or block.
    """
    lines, out = iter(text.splitlines()), []
    for line in lines:
        out.append(line)
        begins = _BEGIN.fullmatch(line)
        if begins:
            for old in lines:
                if old == _END:
                    break
                if _BEGIN.fullmatch(old):
                    raise ValueError(f"{line}: {_END} expected before {old}")
            else:
                raise ValueError(f"{line}: no {_END} follows")
            out += ["", block(begins[1], begins[2], root), "", _END]
        elif line == _END:
            raise ValueError(f"{_END} ends nothing")
    return "\n".join(out) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.readme --help`."""
    check = (False, "write nothing; exit 1 if a page is not up to date")
    args = parser_of("readme", "Write the measured tables into README.md and docs.", check=check).parse_args(arguments)
    with ending("the same command continues"):
        pages = {path: fill_page(path.read_text(encoding="utf-8")) for path in PAGES} | cards()
    old = [path for path, text in pages.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    if args.check:
        if old:
            sys.exit(f"not up to date: {', '.join(map(_name, old))}; run python -m studies.readme")
        return
    for path in old:
        write_atomically(path, pages[path].encode())
    print(f"Written: {', '.join(map(_name, old)) or 'nothing, all is up to date'}.")


if __name__ == "__main__":
    main()
