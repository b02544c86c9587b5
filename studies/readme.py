"""Writes the measured tables into README.md, the pages in docs and the paper: `python -m studies.readme`.

A line `<!-- speed: shots -->` is followed by the block "shots" that `benchmarks.speed.blocks` makes from
`benchmarks/results/speed.json`, up to a line `<!-- end -->`. The command replaces this block. It measures nothing, and
text outside of the markers does not change. `--check` writes nothing and fails if a page is not up to date.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import (
    accuracy_report,
    aim,
    calibration,
    comparison,
    differentiable,
    error_limit,
    examples,
    gradients,
    speed,
    start_up,
    stress,
    validation,
    vector,
)
from billiards_env.files import write_whole
from release import dist
from studies import (
    distil,
    errors_in_one_line,
    gradient_timestep,
    leaderboard,
    learn_by_gradient,
    parser_of,
    plain,
    planner,
    positions,
    pot_chances,
    recipes,
    tasks,
    timestep_report,
)

ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", ROOT / "paper" / "paper.md", *sorted((ROOT / "docs").rglob("*.md")))


# By the name of the results: the command, and the function that makes the blocks.
SOURCES: dict[str, tuple[str, Callable[[dict[str, Any]], dict[str, str]]]] = {
    "accuracy": ("benchmarks.accuracy", accuracy_report.blocks),
    "aim": ("benchmarks.aim", aim.blocks),
    "calibration": ("benchmarks.calibration", calibration.blocks),
    "comparison": ("benchmarks.comparison", comparison.blocks),
    "differentiable": ("benchmarks.differentiable", differentiable.blocks),
    "dist": ("release.dist", dist.blocks),
    "distil": ("studies.distil", distil.blocks),
    "examples": ("benchmarks.examples", examples.blocks),
    "english": ("studies.recipes configs/english.yaml", recipes.blocks),
    "error_limit": ("benchmarks.error_limit", error_limit.blocks),
    "gradient_timestep": ("studies.gradient_timestep", gradient_timestep.blocks),
    "gradients": ("benchmarks.gradients", gradients.blocks),
    "leaderboard": ("studies.leaderboard", leaderboard.blocks),
    "learn_by_gradient": ("studies.learn_by_gradient", learn_by_gradient.blocks),
    "plain": ("studies.plain", plain.blocks),
    "planner": ("studies.planner", planner.blocks),
    "pot_chances": ("studies.pot_chances", pot_chances.blocks),
    "positions": ("studies.positions", positions.blocks),
    "prior_knowledge": ("studies.recipes configs/prior_knowledge.yaml", recipes.blocks),
    "prior_knowledge_long": ("studies.recipes configs/prior_knowledge_long.yaml", recipes.blocks),
    "ratings": ("studies.recipes configs/ratings.yaml", recipes.blocks),
    "recipes": ("studies.recipes", recipes.blocks),
    "speed": ("benchmarks.speed", speed.blocks),
    "start_up": ("benchmarks.start_up", start_up.blocks),
    "stress": ("benchmarks.stress", stress.blocks),
    "tasks": ("studies.tasks", tasks.blocks),
    "timestep": ("studies.timestep", timestep_report.blocks),
    "validation": ("benchmarks.validation", validation.blocks),
    "vector": ("benchmarks.vector", vector.blocks),
}

_BEGIN, _END = re.compile(r"<!-- (\w+): (.+) -->"), "<!-- end -->"


def results(source: str, root: Path = ROOT) -> Path:
    """Returns the file of the results of a source, in the package of its command; `bench` reads that of "tasks"."""
    package = "billiards_env" if source == "tasks" else SOURCES[source][0].partition(".")[0]
    return root / package / "results" / f"{source}.json"


def block(source: str, name: str, root: Path = ROOT) -> str:
    """Returns one block of Markdown, or a line with the command that measures it.

    Raises:
        ValueError: If there is no such source or block.
    """
    if source not in SOURCES:
        raise ValueError(f"<!-- {source}: {name} -->: expected one of {', '.join(SOURCES)}")
    command, blocks = SOURCES[source]
    path = results(source, root)
    if not path.exists():
        return f"*Not measured yet: `python -m {command}`.*"
    found = blocks(json.loads(path.read_text(encoding="utf-8")))
    if name not in found:
        raise ValueError(f"<!-- {source}: {name} -->: expected one of {', '.join(found)}")
    return found[name]


def fill(text: str, root: Path = ROOT) -> str:
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
    with errors_in_one_line():
        pages = {path: fill(path.read_text(encoding="utf-8")) for path in PAGES}
    old = [path for path, text in pages.items() if path.read_text(encoding="utf-8") != text]
    if args.check:
        if old:
            sys.exit(f"not up to date: {', '.join(path.name for path in old)}; run python -m studies.readme")
        return
    for path in old:
        write_whole(path, pages[path].encode())
    print(f"Written: {', '.join(path.name for path in old) or 'nothing, all is up to date'}.")


if __name__ == "__main__":
    main()
