"""Writes the measured tables into README.md and the pages in docs: `python -m benchmarks.readme`.

The text between the lines `<!-- speed: shots -->` and `<!-- end -->` of a page is replaced by the block "shots" that
`benchmarks.speed.blocks` makes from `speed.json`. Text outside of such markers does not change. Nothing is measured.
`--check` writes nothing and fails if a page is out of date.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from agents.intervals import as_percent, over_seeds
from benchmarks import (
    RESULTS,
    ablation,
    accuracy_report,
    contact_rule,
    error_limit,
    growth,
    pressed,
    rendering,
    speed,
    start_up,
    stress,
    table,
    vector,
)
from billiards_env.files import write_whole
from studies import players, recipes, timestep_report

ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))


class Source(NamedTuple):
    """A file of results.

    Attributes:
        command: The module and the arguments that write it.
        path: The file.
        blocks: The function that makes blocks of Markdown, by name, from its content.
    """

    command: str
    path: Path
    blocks: Callable[[dict[str, Any]], dict[str, str]]


def accuracy_blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the blocks of `benchmarks.accuracy`, and the README's comparison of simulators."""
    scenes = [result["scenes"][name]["methods"] for name in ("2 elastic disks", "gas of 16 disks")]
    rows = []
    for few, many in zip(*scenes, strict=True):
        steps = few["steps_per_second"]
        if few["method"] == "PIT" or steps not in (None, 60, 1920):
            continue
        exact = few["method"] == "PIC"
        name = "**billiards-env**" if exact else few["method"]
        errors = [f"{row['median_error_1.0_m']:.1e} m" for row in (few, many)]
        time = "1" if exact else f"{many['time_over_pic']:,.0f}"
        rows.append((name, f"timestep 1/{steps} s" if steps else "event-driven", *errors, time))
    head = ("simulator", "method", "error, 2 disks", "error, 16 disks", "run time")
    return {**accuracy_report.blocks(result), "comparison": table(head, rows, left=2)}


def players_blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the blocks of `studies.players`."""
    return {"table": table(players.HEAD, [players.row(r) for r in result["results"]], left=2)}


def agents_blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the blocks of `studies.recipes`."""
    pot = [r for r in result["results"] if r["recipe"].startswith("pot") and r["env"]["max_shots"] == 1]
    million = (f"{r['recipe']} {as_percent(over_seeds(recipes.at_steps(r, 1_000_000)))}" for r in pot)
    rows = {r["recipe"]: dict(zip(recipes.HEAD, recipes.row(r), strict=True)) for r in result["results"]}
    best = rows["pot"]
    return {
        "table": table(recipes.HEAD, [tuple(row.values()) for row in rows.values()]),
        "million": f"Success after a million shots, mean over the seeds and its 95 % interval: {'; '.join(million)}.",
        "summary": f"The recipe of `make train` takes {best['minutes']} minutes on one core and pots the ball on "
        f"{best['mean over seeds']} of new layouts: the mean over the seeds and its 95 % interval. Random shots in the "
        f"same action frame pot it on {best['random: success']}.",
    }


def study_blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the blocks of a study of `studies.timestep`, with pictures for the pages in docs."""
    pictures = {
        "transfer": "Success of the policies of each world in each world",
        "policies": "Speeds, directions, cuts and false successes of the policies of each world",
    }
    return {
        "findings": "\n".join(f"- {finding}" for finding in timestep_report.findings(result)),
        **{name: table(head, rows) for name, (head, rows) in timestep_report.tables(result).items()},
        "pictures": "\n\n".join(
            f"![{text}](images/study_{result['study']}_{name}.png)" for name, text in pictures.items()
        ),
    }


def _sources() -> dict[str, Source]:
    """Returns all sources by the name that markers use."""
    agents, studies = RESULTS, RESULTS  # the folders of the results of training and of the studies
    modules = {
        "ablation": ablation.blocks,
        "accuracy": accuracy_blocks,
        "contact_rule": contact_rule.blocks,
        "error_limit": error_limit.blocks,
        "growth": growth.blocks,
        "pressed": pressed.blocks,
        "rendering": rendering.blocks,
        "speed": speed.blocks,
        "start_up": start_up.blocks,
        "stress": stress.blocks,
        "vector": vector.blocks,
    }
    study = "studies.timestep configs/study"
    return {
        "agents": Source("studies.recipes", agents / "agents.json", agents_blocks),
        "players": Source("studies.players", agents / "players.json", players_blocks),
        "study_blocked": Source(f"{study}/blocked.yaml", studies / "study_blocked.json", study_blocks),
        "study_pot": Source(f"{study}/pot.yaml", studies / "study_pot.json", study_blocks),
        **{name: Source(f"benchmarks.{name}", RESULTS / f"{name}.json", blocks) for name, blocks in modules.items()},
    }


SOURCES = _sources()

_BEGIN, _END = re.compile(r"<!-- (\w+): (.+) -->"), "<!-- end -->"


def block(source: str, name: str) -> str:
    """Returns one block of Markdown, or a line with the command that measures it if there is no result.

    Raises:
        ValueError: If there is no such source or block.
    """
    if source not in SOURCES:
        raise ValueError(f"<!-- {source}: {name} -->: expected one of {', '.join(sorted(SOURCES))}")
    command, path, blocks = SOURCES[source]
    if not path.exists():
        return f"*Not measured yet: `python -m {command}`.*"
    found = blocks(json.loads(path.read_text(encoding="utf-8")))
    if name not in found:
        raise ValueError(f"<!-- {source}: {name} -->: expected one of {', '.join(found)}")
    return found[name]


def fill(text: str) -> str:
    """Returns a page with all its blocks up to date.

    Raises:
        ValueError: If a marker has no end, or its source or block does not exist.
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
            out += ["", block(*begins.groups()), "", _END]
        elif line == _END:
            raise ValueError(f"{_END} ends nothing")
    return "\n".join(out) + "\n"


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.readme --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.readme",
        description="Write the measured tables into README.md and the pages in docs.",
    )
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a page is out of date")
    args = parser.parse_args(arguments)
    try:
        pages = {path: fill(path.read_text(encoding="utf-8")) for path in PAGES}
    except ValueError as error:
        sys.exit(f"error: {error}")
    old = [path for path, text in pages.items() if path.read_text(encoding="utf-8") != text]
    if args.check:
        if old:
            sys.exit(f"not up to date: {', '.join(path.name for path in old)}; run python -m benchmarks.readme")
        return
    for path in old:
        write_whole(path, pages[path].encode())
    print(f"Written: {', '.join(path.name for path in old) or 'nothing, all pages are up to date'}.")


if __name__ == "__main__":
    main()
