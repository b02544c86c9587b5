"""How the timestep changes the policies that are learnt: `python -m agents.timestep_study configs/study/pot.yaml`.

One recipe of training is run in several worlds, the exact one and others in which the same balls move in steps of dt,
with several seeds each. Then every policy plays the same layouts in every world, without its exploration noise (see
`agents.study_measure` for what is compared). The study's folder holds the runs, as `agents.train` makes them, and
`study.json`; the figures go to `docs/images`. The same command resumes an interrupted study, and skips finished runs.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import multiprocessing
import os
import pickle
import re
import sys
from collections.abc import Iterator
from concurrent.futures import FIRST_EXCEPTION, Future, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

from tqdm import tqdm

from agents import study_figures, study_measure, study_report
from agents.config import Config, at_least, load, read
from agents.train import learning_curve, open_run, train
from billiards_env.engine import check_mode
from billiards_env.files import write_json

EXACT = "exact"
"""The name of the world without a timestep."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study.

    Attributes:
        recipe: Path of the configuration that is trained in every world. Its task is "pot", with one shot an episode,
            without execution noise, and its world is the exact one.
        worlds: "exact" and timesteps, s, as fractions, such as "1/60".
        output: The study's folder.
        fix: What the worlds with a timestep do about overlaps, see `gym.make`'s argument of that name.
        seeds: Seeds of the training; a run each in every world.
        layouts: On so many layouts, on none of which a policy was trained, policies are compared.
    """

    recipe: str
    worlds: tuple[str, ...]
    output: str
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
    recipe = load(Path(study.recipe))
    wanted = {"task": "pot", "max_shots": 1, **world_arguments(EXACT, None)}
    for key, value in wanted.items():
        if recipe.env[key] != value:
            raise ValueError(f"env.{key} = {recipe.env[key]!r} in the recipe {study.recipe}: expected {value!r}")
    if recipe.noise is not None:
        raise ValueError(f"noise in the recipe {study.recipe}: expected none, so that policies can be compared by shot")
    return study, recipe


def runs(study: Study, recipe: Config) -> Iterator[tuple[str, int, Path, Config]]:
    """The study's runs: world, seed, folder and configuration of each."""
    for world in study.worlds:
        env = {**recipe.env, **world_arguments(world, study.fix)}
        for seed in study.seeds:
            folder = Path(study.output) / "runs" / f"{world.replace('/', '-')}-seed{seed}"
            yield world, seed, folder, dataclasses.replace(recipe, env=env, seed=seed)


def train_all(study: Study, recipe: Config, jobs: int) -> None:
    """Trains what is not trained yet, `jobs` runs at a time, each in a process of its own if there are several.

    Args:
        study: The study.
        recipe: Its recipe.
        jobs: How many runs are trained side by side.

    Raises:
        ValueError: If a run's folder holds something else.
        OSError: If one cannot be written.
    """
    for _, _, folder, config in runs(study, recipe):
        open_run(config, folder)
    todo = [(config, folder) for _, _, folder, config in runs(study, recipe) if not (folder / "policy.pt").exists()]
    count = len(study.worlds) * len(study.seeds)
    print(f"{count - len(todo)} of {count} runs are trained")
    if jobs == 1:
        for config, folder in todo:
            train(config, folder)
        return
    total = sum(config.timesteps for config, _ in todo)
    # Forked processes would have none of this one's threads, which numba and torch may have started.
    context = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(jobs, mp_context=context) as pool,
        tqdm(total=total, unit="shot", desc=f"{len(todo)} runs") as bar,
    ):
        waiting: set[Future[None]] = {pool.submit(_train_quietly, *run) for run in todo}
        try:
            while waiting:
                ended, waiting = wait(waiting, timeout=2.0, return_when=FIRST_EXCEPTION)
                for future in ended:
                    future.result()
                curves = [learning_curve(folder) for _, folder in todo]
                bar.update(min(sum(curve[-1].steps for curve in curves if curve), total) - bar.n)
                bar.set_postfix(trained=f"{sum((folder / 'policy.pt').exists() for _, folder in todo)}")
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _train_quietly(config: Config, run_dir: Path) -> None:
    """Trains without the progress bar that other processes would write over."""
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        train(config, run_dir)


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m agents.timestep_study --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m agents.timestep_study",
        description="Train one recipe in the exact world and in worlds with a timestep, and compare what is learnt.",
    )
    parser.add_argument("study", type=Path, help="YAML file of the study, e.g. configs/study/pot.yaml")
    parser.add_argument("--jobs", type=int, default=1, help="runs trained side by side (default: %(default)s)")
    parser.add_argument("--images", type=Path, default=Path("docs/images"), help="folder of the figures")
    args = parser.parse_args(arguments)
    try:
        at_least("jobs", args.jobs, 1)
        study, recipe = load_study(args.study)
        train_all(study, recipe, args.jobs)
        worlds = {world: world_arguments(world, study.fix) for world in study.worlds}
        policies = [(world, seed, folder) for world, seed, folder, _ in runs(study, recipe)]
        result = {
            "study": args.study.stem,
            **dataclasses.asdict(study),
            "recipe_config": recipe.to_dict(),
            **study_measure.measure(recipe, worlds, policies, study.layouts),
        }
        write_json(Path(study.output) / "study.json", result)
        drawn = study_figures.draw(result, args.images)
    except (OSError, TypeError, ValueError, pickle.UnpicklingError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        print("\ninterrupted; the same command goes on from the newest checkpoints", file=sys.stderr)
        sys.exit(130)
    print("\n".join(study_report.findings(result)))
    for head, rows in study_report.tables(result).values():
        print(f"\n| {' | '.join(head)} |\n|{' --: |' * len(head)}")
        print("\n".join(f"| {' | '.join(row)} |" for row in rows))
    print(f"\nwritten to {Path(study.output) / 'study.json'}, {', '.join(map(str, drawn))}")


if __name__ == "__main__":
    main()
