"""How the timestep changes the policies that are learnt: `python -m studies.timestep configs/study/pot.yaml`.

One recipe of training is run in several worlds, the exact one and others in which the same balls move in steps of dt,
with several seeds each. Then every policy plays the same layouts in every world, without its exploration noise (see
`studies.timestep_measure` for what is compared). The runs, as `agents.train` makes them, are in
`benchmarks/results/studies/NAME/WORLD`, what is found in `benchmarks/results/study_NAME.json` and the figures in
`docs/images`. The same command resumes an interrupted study, and skips finished runs.
"""

from __future__ import annotations

import argparse
import dataclasses
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from agents.config import Config, at_least, load, read
from agents.runs import train_all
from billiards_env.engine.modes import check_mode
from billiards_env.files import write_json
from studies import timestep_figures, timestep_measure, timestep_report

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
IMAGES = ROOT / "docs" / "images"

EXACT = "exact"
"""The name of the world without a timestep."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study.

    Attributes:
        recipe: Path of the configuration that is trained in every world, from the folder of the study's file on. Its
            task is "pot", with one shot an episode, without execution noise, and its world is the exact one.
        worlds: "exact" and timesteps, s, as fractions, such as "1/60".
        timesteps: Steps of each run, instead of the recipe's.
        fix: What the worlds with a timestep do about overlaps, see `gym.make`'s argument of that name.
        seeds: Seeds of the training; a run each in every world.
        layouts: On so many layouts, on none of which a policy was trained, policies are compared.
    """

    recipe: str
    worlds: tuple[str, ...]
    timesteps: int | None = None
    fix: str | None = None
    seeds: tuple[int, ...] = (0, 1, 2)
    layouts: int = 2000

    def __post_init__(self) -> None:
        for i, world in enumerate(self.worlds):
            try:
                arguments = world_arguments(world, self.fix)
            except ValueError as error:
                raise ValueError(f"worlds[{i}] = {world!r}: {error}") from error
            check_mode(**arguments)
        if EXACT not in self.worlds:
            raise ValueError(f"worlds = {list(self.worlds)!r}: expected {EXACT!r} among them, to compare with")
        for name in ("worlds", "seeds"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise ValueError(f"{name} = {list(values)!r}: expected at least one, and none twice")
        for i, seed in enumerate(self.seeds):
            at_least(f"seeds[{i}]", seed, 0)
        at_least("layouts", self.layouts, 1)
        if self.timesteps is not None:
            at_least("timesteps", self.timesteps, 1)


def world_arguments(world: str, fix: str | None) -> dict[str, Any]:
    """What `gym.make` takes for a world.

    Args:
        world: "exact", or a timestep as a fraction.
        fix: What a world with a timestep does about overlaps.

    Returns:
        `mode`, `dt` and `fix`.

    Raises:
        ValueError: If the world is neither.

    Example:
        >>> world_arguments("1/50", None)
        {'mode': 'pit', 'dt': 0.02, 'fix': None}
    """
    if world == EXACT:
        return {"mode": "pic", "dt": None, "fix": None}
    fraction = re.fullmatch(r"1/([1-9]\d*)", world)
    if fraction is None:
        raise ValueError(f"expected {EXACT!r} or a timestep in s as a fraction, such as '1/60'")
    return {"mode": "pit", "dt": 1 / int(fraction[1]), "fix": fix}


def load_study(path: Path) -> tuple[Study, Config]:
    """A study from a YAML file, and its recipe.

    Args:
        path: The file.

    Returns:
        The study and the recipe.

    Raises:
        ValueError: If a file is not YAML, a key is unknown or missing, or a value impossible.
        TypeError: If a value is of the wrong type.
        OSError: If a file cannot be read.
    """
    study = read(Study, path)
    recipe = load(path.parent / study.recipe)
    wanted = {"task": "pot", "max_shots": 1, **world_arguments(EXACT, None)}
    for key, value in wanted.items():
        if recipe.env[key] != value:
            raise ValueError(f"env.{key} = {recipe.env[key]!r} in the recipe {study.recipe}: expected {value!r}")
    if recipe.noise is not None:
        raise ValueError(f"noise in the recipe {study.recipe}: expected none, so that policies can be compared by shot")
    return study, recipe if study.timesteps is None else dataclasses.replace(recipe, timesteps=study.timesteps)


def runs(study: Study, recipe: Config, folder: Path) -> Iterator[tuple[str, int, Path, Config]]:
    """World, seed, folder and configuration of each run of a study whose runs are in a folder."""
    for world in study.worlds:
        env = {**recipe.env, **world_arguments(world, study.fix)}
        for seed in study.seeds:
            run_dir = folder / world.replace("/", "-") / f"seed{seed}"
            yield world, seed, run_dir, dataclasses.replace(recipe, env=env, seed=seed)


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m studies.timestep --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.timestep",
        description="Train one recipe in the exact world and in worlds with a timestep, and compare what is learnt.",
    )
    parser.add_argument("study", type=Path, help="YAML file of the study, e.g. configs/study/pot.yaml")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time (default: %(default)s)")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of runs and findings")
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of the figures")
    args = parser.parse_args(arguments)
    name = args.study.stem
    found = args.results / f"study_{name}.json"
    try:
        study, recipe = load_study(args.study)
        planned = list(runs(study, recipe, args.results / "studies" / name))
        train_all({folder: config for _, _, folder, config in planned}, args.jobs)
        worlds = {world: world_arguments(world, study.fix) for world in study.worlds}
        policies = [(world, seed, folder) for world, seed, folder, _ in planned]
        result = {
            "study": name,
            **dataclasses.asdict(study),
            "recipe_config": recipe.to_dict(),
            **timestep_measure.measure(recipe, worlds, policies, study.layouts),
        }
        write_json(found, result)
        drawn = timestep_figures.draw(result, args.images)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        print("\ninterrupted; the same command goes on from the newest checkpoints", file=sys.stderr)
        sys.exit(130)
    print("\n".join(timestep_report.findings(result)))
    for head, rows in timestep_report.tables(result).values():
        print(f"\n| {' | '.join(head)} |\n|{' --: |' * len(head)}")
        print("\n".join(f"| {' | '.join(row)} |" for row in rows))
    print(f"\nwritten to {found}, {', '.join(map(str, drawn))}")


if __name__ == "__main__":
    main()
