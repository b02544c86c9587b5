"""Writes what was measured into README.md and docs/measurements.md: `python -m benchmarks.readme`.

A line `<!-- speed: shots -->` is followed by the block "shots" that `benchmarks.speed.blocks` makes of
`benchmarks/results/speed.json`, up to a line `<!-- end -->`; what stood there before is replaced. Nothing is measured,
and text outside of such markers stays as it is. `--check` writes nothing and fails if a file is not up to date.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

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
PAGES = ROOT / "README.md", ROOT / "docs" / "measurements.md"


def players_blocks(result: dict[str, Any]) -> dict[str, str]:
    """What `studies.players` has measured."""
    return {"table": table(players.HEAD, [players.row(r) for r in result["results"]], left=2)}


def agents_blocks(result: dict[str, Any]) -> dict[str, str]:
    """What each recipe of `studies.recipes` reaches."""
    pot = [r for r in result["results"] if r["recipe"].startswith("pot") and r["env"]["max_shots"] == 1]
    million = (f"{r['recipe']} {as_percent(over_seeds(recipes.at_steps(r, 1_000_000)))}" for r in pot)
    return {
        "table": table(recipes.HEAD, [recipes.row(r) for r in result["results"]]),
        "million": f"Success after a million shots, mean over the seeds and its 95 % interval: {'; '.join(million)}.",
    }


def study_blocks(result: dict[str, Any]) -> dict[str, str]:
    """What a study of `studies.timestep` has found; pictures as the README and the pages in `docs` see them."""
    pictures = {
        name: f"![{text}](FOLDER/study_{result['study']}_{name}.png)"
        for name, text in (
            ("success", "Success in the exact world and in the world of the training, against the timestep"),
            ("transfer", "Success of the policies of each world in each world"),
            ("policies", "Speeds, directions, cuts and false successes of the policies of each world"),
        )
    }
    return {
        "findings": "\n".join(f"- {said}" for said in timestep_report.findings(result)),
        **{name: table(head, rows) for name, (head, rows) in timestep_report.tables(result).items()},
        "picture": pictures["success"].replace("FOLDER", "docs/images"),
        "pictures": "\n\n".join(pictures[name].replace("FOLDER", "images") for name in ("transfer", "policies")),
    }


# By the name of the results: the command, and what makes the blocks.
SOURCES: dict[str, tuple[str, Callable[[dict[str, Any]], dict[str, str]]]] = {
    "agents": ("studies.recipes", agents_blocks),
    "ablation": ("benchmarks.ablation", ablation.blocks),
    "accuracy": ("benchmarks.accuracy", accuracy_report.blocks),
    "contact_rule": ("benchmarks.contact_rule", contact_rule.blocks),
    "error_limit": ("benchmarks.error_limit", error_limit.blocks),
    "growth": ("benchmarks.growth", growth.blocks),
    "players": ("studies.players", players_blocks),
    "pressed": ("benchmarks.pressed", pressed.blocks),
    "rendering": ("benchmarks.rendering", rendering.blocks),
    "speed": ("benchmarks.speed", speed.blocks),
    "start_up": ("benchmarks.start_up", start_up.blocks),
    "stress": ("benchmarks.stress", stress.blocks),
    "study_blocked": ("studies.timestep configs/study/blocked.yaml", study_blocks),
    "study_pot": ("studies.timestep configs/study/pot.yaml", study_blocks),
    "vector": ("benchmarks.vector", vector.blocks),
}

_BEGIN, _END = re.compile(r"<!-- (\w+): (.+) -->"), "<!-- end -->"


def block(results: Path, source: str, name: str) -> str:
    """One block of Markdown, or a line that says how to measure what it shows.

    Raises:
        ValueError: If there is no such source or block.
    """
    if source not in SOURCES:
        raise ValueError(f"<!-- {source}: {name} -->: expected one of {', '.join(SOURCES)}")
    command, blocks = SOURCES[source]
    path = results / f"{source}.json"
    if not path.exists():
        return f"*Not measured yet: `python -m {command}`.*"
    found = blocks(json.loads(path.read_text(encoding="utf-8")))
    if name not in found:
        raise ValueError(f"<!-- {source}: {name} -->: expected one of {', '.join(found)}")
    return found[name]


def fill(text: str, results: Path = RESULTS) -> str:
    """A page with all its blocks made anew from the results in a folder.

    Raises:
        ValueError: If a marker has no end, or asks for what there is not.
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
            out += ["", block(results, *begins.groups()), "", _END]
        elif line == _END:
            raise ValueError(f"{_END} ends nothing")
    return "\n".join(out) + "\n"


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.readme --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.readme", description="Write the measured tables into README.md and docs."
    )
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a page is not up to date")
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
    print(f"Written: {', '.join(path.name for path in old) or 'nothing, all is up to date'}.")


if __name__ == "__main__":
    main()
