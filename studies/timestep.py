"""Studies the effect of the timestep on the learned policies: `python -m studies.timestep configs/study/pot.yaml`.

One recipe is trained in several worlds with several seeds each. One world is exact; in the others the same balls move
in steps of dt. Then every policy plays the same layouts once in every world, without exploration noise. A shot is a
false success if it succeeds in the world of the training and fails in the exact one. `studies.causes` finds the cause.

The results, with the learning curve of every run, are written to `studies/results/timestep_NAME.json` and the figure
to `docs/images`. A study outside of `configs/study` has both in the folder of its runs. If the results of a study are
there, nothing is trained: the command prints its tables and draws its figures. The runs are kept in
`runs/timestep/NAME/WORLD/seedN`, so an interrupted command continues when it is started again.
"""

from __future__ import annotations

import dataclasses
import json
import re
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator
from pydantic.dataclasses import dataclass
from tqdm import tqdm

from agents.config import CHECKS, Checked, Config, Count, Seed, distinct, load, read
from agents.evaluate import deterministic
from agents.ppo import load_policy
from agents.runs import train_all
from agents.train import learning_curve, versions
from benchmarks import IMAGES
from billiards_env.engine.modes import checked_engine
from billiards_env.envs import BilliardsEnv, BilliardsVectorEnv
from billiards_env.envs.actions import cue_strike
from billiards_env.evaluation import evaluation_seeds
from billiards_env.files import write_json
from billiards_env.shots.simulation import simulate
from studies import RESULTS, RUNS, errors_in_one_line, parser_of_runs, timestep_report
from studies.causes import CAUSES, cause

Floats = NDArray[np.float64]

STUDIES = RUNS.parent / "configs" / "study"
"""The folder of the project's studies."""

EXACT = "exact"
"""The name of the world without a timestep."""

LAYOUT_SEED = 0


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Study(Checked):
    """A study.

    Attributes:
        recipe: Path of the configuration to train, relative to the study's file. Its task is "pot", with one shot an
            episode and no execution noise, and its world is the exact one.
        worlds: "exact" and timesteps, s, as fractions, such as "1/60".
        timesteps: Steps of each run; None for the recipe's.
        fix: How worlds with a timestep resolve overlaps, see `gym.make`'s argument of that name.
        seeds: The seeds of the training; in every world there is a run with each.
        layouts: The number of layouts on which the policies are compared. No policy is trained on them.
    """

    recipe: str
    worlds: Annotated[tuple[str, ...], AfterValidator(distinct)]
    timesteps: Count | None = None
    fix: str | None = None
    seeds: Annotated[tuple[Seed, ...], AfterValidator(distinct)] = (0, 1, 2)
    layouts: Count = 2000

    def __post_init__(self) -> None:
        for i, world in enumerate(self.worlds):
            try:
                arguments = world_arguments(world, self.fix)
            except ValueError as error:
                raise ValueError(f"worlds[{i}] = {world!r}: {error}") from error
            checked_engine(**arguments)
        if EXACT not in self.worlds:
            raise ValueError(f"worlds = {list(self.worlds)!r}: expected {EXACT!r} among them, to compare with")


def world_arguments(world: str, fix: str | None) -> dict[str, Any]:
    """Returns the arguments of `gym.make` for the world "exact", or for a timestep as a fraction: `mode`, `dt`, `fix`.

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
    """Returns the study in a YAML file, and its recipe.

    Raises:
        ValueError: If a file is not YAML, a key is unknown or missing, or a value impossible.
        TypeError: If a value has the wrong type.
        OSError: If a file cannot be read.
    """
    study = read(Study, path)
    recipe = load(path.parent / study.recipe)
    expected = {"task": "pot", "max_shots": 1, **world_arguments(EXACT, None)}
    for key, value in expected.items():
        if recipe.env[key] != value:
            raise ValueError(f"env.{key} = {recipe.env[key]!r} in the recipe {study.recipe}: expected {value!r}")
    if recipe.noise is not None:
        raise ValueError(f"noise in the recipe {study.recipe}: expected none, so that policies can be compared by shot")
    return study, recipe if study.timesteps is None else dataclasses.replace(recipe, timesteps=study.timesteps)


class Run(NamedTuple):
    """A finished training run: the world and the seed of the training, and the folder."""

    world: str
    seed: int
    folder: Path


def runs(study: Study, recipe: Config, folder: Path) -> Iterator[tuple[Run, Config]]:
    """Yields each run of a study, with its folder under `folder`, and its configuration."""
    for world in study.worlds:
        env = {**recipe.env, **world_arguments(world, study.fix)}
        for seed in study.seeds:
            run_dir = folder / world.replace("/", "-") / f"seed{seed}"
            yield Run(world, seed, run_dir), dataclasses.replace(recipe, env=env, seed=seed)


def find_result(path: Path, study: Study, recipe: Config) -> dict[str, Any] | None:
    """Returns the result in a file; None if there is none, or it is of another study or recipe."""
    if not path.exists():
        return None
    result = json.loads(path.read_text(encoding="utf-8"))
    asked = json.loads(json.dumps(dataclasses.asdict(study)))
    same = all(result.get(key) == value for key, value in asked.items())
    return result if same and recipe.is_saved_as(result["recipe_config"]) else None


def measure(
    name: str, study: Study, recipe: Config, folder: Path, jobs: int, address: str | None = None
) -> dict[str, Any]:
    """Trains the policies of a study, and returns the study, its recipe and the output of `compare` as plain data.

    `jobs` runs are trained at a time, in `folder`, on this machine or on the Ray cluster at `address`.
    """
    planned = list(runs(study, recipe, folder))
    train_all({run.folder: config for run, config in planned}, jobs, address)
    worlds = {world: world_arguments(world, study.fix) for world in study.worlds}
    return {
        "study": name,
        **dataclasses.asdict(study),
        "recipe_config": recipe.to_dict(),
        **compare(recipe, worlds, [run for run, _ in planned], study.layouts),
    }


def compare(
    recipe: Config, worlds: Mapping[str, Mapping[str, Any]], runs: Sequence[Run], layouts: int
) -> dict[str, Any]:
    """Plays the policies of finished runs in all worlds, on a number of layouts.

    `worlds` has the arguments of `gym.make` of each world, by name; "exact" is among them.

    Returns:
        Plain data: `versions`; `worlds_measured`, the arguments and speed of each world; and `policies`. A policy has
        `world`, `seed`, `curve` (a list of `agents.train.Point`), `success` (the number of successes in each world),
        and `false_successes` (their number by cause).

    Raises:
        OSError: If a file of a run cannot be read.
        ValueError: If a file of a run has the wrong content.
    """
    seeds = evaluation_seeds(LAYOUT_SEED, layouts).tolist()
    envs = {
        world: BilliardsVectorEnv(layouts, "Disabled", 1, **{**recipe.env, **arguments})
        for world, arguments in worlds.items()
    }
    observations, _ = envs["exact"].reset(seed=seeds)
    positions, env = envs["exact"].positions, envs["exact"].single_env
    shots = [_shots(run.folder, observations) for run in tqdm(runs, "policies")]
    successes = {world: [] for world in worlds}
    seconds = dict.fromkeys(worlds, 0.0)
    for world in tqdm(worlds, "worlds"):
        for actions in shots:
            envs[world].reset(options={"positions": positions})
            begin = time.perf_counter()
            *_, infos = envs[world].step(actions)
            seconds[world] += time.perf_counter() - begin
            successes[world].append(infos["is_success"])
    policies = []
    for k, run in enumerate(tqdm(runs, "false successes")):
        own, exact = successes[run.world][k], successes["exact"][k]
        policies.append(
            {
                "world": run.world,
                "seed": run.seed,
                "curve": [list(point) for point in learning_curve(run.folder)],
                "success": {world: int(successes[world][k].sum()) for world in worlds},
                "false_successes": _causes(worlds[run.world], env, positions, shots[k], own & ~exact),
            }
        )
    return {
        "versions": versions(),
        "worlds_measured": {
            world: {**worlds[world], "shots_per_second": layouts * len(shots) / seconds[world]} for world in worlds
        },
        "policies": policies,
    }


def _shots(run_dir: Path, observations: NDArray[np.float32]) -> Floats:
    """Returns the actions of a run's policy, (m, 2)."""
    _, policy = load_policy(run_dir)
    return np.asarray(deterministic(policy)(observations), np.float64)


def _causes(
    world: Mapping[str, Any], env: BilliardsEnv, positions: Floats, actions: Floats, false: NDArray[np.bool_]
) -> dict[str, int]:
    """Returns the number of false successes by cause."""
    counts: Counter[str] = Counter()
    for i in np.flatnonzero(false).tolist():
        start = env.scene, positions[i], cue_strike(actions[i], env.scene, env.max_speed)
        exact, stepped = simulate(*start, record=True), simulate(*start, **world, record=True)
        differs = np.flatnonzero(exact.potted != stepped.potted)
        counts[cause(exact, stepped, world["dt"], int(differs[-1]))] += 1  # a ball to pot, or else the cue ball
    return {name: counts[name] for name in CAUSES}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.timestep --help`."""
    description = "Train one recipe in the exact world and in worlds with a timestep, and compare the policies."
    parser = parser_of_runs("timestep", description)
    parser.add_argument("study", type=Path, help="YAML file of the study, e.g. configs/study/pot.yaml")
    args = parser.parse_args(arguments)
    name = args.study.stem
    published = args.folder is None and args.study.resolve().parent == STUDIES
    runs_folder = (args.folder or RUNS / "timestep") / name
    path = (RESULTS if published else runs_folder) / f"timestep_{name}.json"
    figure = (IMAGES if published else runs_folder) / f"study_{name}_success.png"
    with errors_in_one_line():
        study, recipe = load_study(args.study)
        result = find_result(path, study, recipe)
        if result is None:
            result = measure(name, study, recipe, runs_folder, args.jobs, args.address)
            write_json(path, result)
        timestep_report.draw(result, figure)
    shown = timestep_report.blocks(result)
    print("\n\n".join(shown[name] for name in timestep_report.tables(result)))
    print(f"\nin {path} and {figure}")


if __name__ == "__main__":
    main()
