"""Trains the policies of `configs/learning.yaml` and measures them in frozen tasks: `python -m studies.learning`.

Each row is trained with each seed by `agents.train`, in `runs/learning/ROW/seedN`. The policy then plays new layouts of
the frozen tasks of its row without exploration. The results are

* `studies/results/learning.json`: for each row its settings, and for each seed the learning curve and the successes;
  for the policy of the first seed also its successes as a player that simulates what it proposes, see `propose`,
* `studies/results/policies/ROW`: the policy of the first seed, with its configuration and smaller weights, see
  `weights.slim`; it plays, and no training starts from it,
* `docs/images/learning.png`: the learning curves.

The command skips the seeds that have results with the same settings. A training that was interrupted continues. With
`--output FILE` the runs and the policies are in the folders `runs` and `policies` beside this file.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from agents.config import LEARNING, Config, load, rows
from agents.evaluate import load_run
from agents.ppo import deterministic
from agents.train import Point, learning_curve, open_run, train, versions
from benchmarks import machine, machine_line, new_figure, run_command, save, table
from billiards_env.bench import benchmark as bench
from billiards_env.bench import evaluation
from billiards_env.bench.evaluation import evaluation_seeds, play_together
from billiards_env.bench.frozen import FROZEN, NAMESPACE
from billiards_env.intervals import as_percent, over_seeds
from billiards_env.players.strategies import FINALISTS, REPEATS
from billiards_env.sb3.weights import slim
from billiards_env.settings import read_settings
from billiards_env.support.files import write_atomically, write_json
from studies import JOBS, RESULTS, RUNS, completed, executor, fill, frozen_tasks, read_results

OUTPUT = RESULTS / "learning.json"

EPISODES = 10_000
"""The number of layouts of each task and seed."""

LAYOUTS = bench.EPISODES
"""The number of public layouts that the players with proposals play, as the players without training do."""

PLAYERS = ("random", "search:200", "planner:300")
"""The players without training beside the policies. `studies.frozen_tasks` measures them."""

LINES: dict[str, dict[str, Any]] = {
    "random": {"color": "0.5", "linestyle": ":"},
    "search:200": {"color": "0.2", "linestyle": "--"},
    "planner:300": {"color": "C4", "linestyle": "-."},
    "aim": {"color": "C3", "linestyle": (0, (1, 1))},
}
"""The lines of the players without training in the picture."""

PROPOSALS = (1, 16, 64)
"""The numbers of simulated proposals of the player "policy"; 1 for the policy alone."""

_BEST_OF = f"AimPolicy:{PROPOSALS[-1]}"

Result = Mapping[str, Any]


def trained(config: Config, folder: Path) -> tuple[list[Point], dict[str, bytes]]:
    """Trains a configuration, unless the folder holds the finished run.

    Returns:
        The learning curve, and the files of `weights.slim`, because another machine may train the policy.
    """
    open_run(config, folder)
    train(config, folder)
    return learning_curve(folder), slim(folder)


def measured_rows() -> dict[str, dict[str, Any]]:
    """Returns the rows whose policies play frozen tasks. `billiards match` measures the others, which play games."""
    return {name: row for name, row in rows().items() if row["plays"]}


def run_row(
    name: str, seed: int, folder: Path, episodes: int, **changes: Any
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Trains a row with a seed and changed settings, unless the folder holds the finished run, and plays its tasks.

    Returns:
        `curve`, the learning curve (a list of `agents.train.Point`), `tasks`: the results of `play_together` by task,
        `machine` and `versions`. Then the files of the policy.
    """
    (curve, files), played = trained(load(name, seed=seed, **changes), folder), {}
    for task in rows()[name]["plays"]:
        envs = gym.make_vec(NAMESPACE + task, num_envs=episodes, autoreset_mode="SameStep")
        policy = load_run(folder, FROZEN[task].arguments)[1]
        played[task] = play_together(envs, deterministic(policy), evaluation_seeds(seed, episodes).tolist())
        envs.close()
    known = {"machine": machine(), "versions": versions()}
    return {"curve": [list(point) for point in curve], "tasks": played, **known}, files


def measure(output: Path, jobs: int, address: str) -> dict[str, Any]:
    """Trains what has no results, and writes the result of each seed as soon as it is known.

    Args:
        output: The JSON file of the results. The policies of the first seed are in the folder `policies` beside it.
            The runs are in `runs/learning` if it is the committed file, and in the folder `runs` beside it otherwise.
        jobs: The number of trainings at a time.
        address: As in `studies.executor`.

    Returns:
        The content of the file: for each row its `settings` and its `runs` by seed, see `run_row`.

    Raises:
        OSError: If a file cannot be read or written.
        ValueError: If a row is invalid.
    """
    output = output.resolve()
    old = read_results(output)
    folder = RUNS / "learning" if output == OUTPUT else output.parent / "runs"
    seeds, measured = read_settings(LEARNING, "settings")["seeds"], {}
    for name, settings in measured_rows().items():
        known = old.get(name, {})
        measured[name] = {"settings": settings, "runs": {}, **(known if known.get("settings") == settings else {})}
    order = [(seed, name) for seed in seeds for name in measured]
    calls = {
        (seed, name): (run_row, name, seed, folder / name / f"seed{seed}", EPISODES)
        for seed, name in order
        if str(seed) not in measured[name]["runs"]
    }
    with executor(jobs, address) as pool:
        for (seed, name), (result, files) in completed(pool, calls, len(order) - len(calls)):
            measured[name]["runs"] = dict(sorted({**measured[name]["runs"], str(seed): result}.items()))
            write_json(output, measured)
            for file, content in files.items() if seed == seeds[0] else ():
                write_atomically(output.parent / "policies" / name / file, content)
    policies = output.parent / "policies"
    return fill(
        output,
        measured,
        {
            (name, "proposals", task, str(count)): functools.partial(propose, policies / name, task, count)
            for name in measured
            for task in with_noise(rows()[name]["plays"])
            for count in PROPOSALS
        },
    )


def propose(folder: Path, task: str, count: int) -> dict[str, float]:
    """Returns the results of the player `policy:FOLDER:COUNT` in the public layouts of a task.

    Returns:
        `success`, as `share_of`, `simulated`, the number of simulated shots for each decision, and `ms`, its median
        time.
    """
    player, frozen = f"policy:{folder}" + (f":{count}" if count > 1 else ""), FROZEN[task]
    result = evaluation.measure(player, frozen.arguments, frozen.execution_noise, LAYOUTS, bench.SEED)
    return {
        "success": share_of(task, result["success_rate"], result["mean_score"]),
        "simulated": 0 if count == 1 else count + REPEATS * min(count, FINALISTS) * frozen.noise,
        "ms": result["ms_per_decision"],
    }


def with_noise(tasks: Sequence[str]) -> list[str]:
    """Returns tasks, each followed by the same task with noise if there is one."""
    both = [one for task in tasks for one in (task, task.replace("-v0", "Noise-v0")) if one in FROZEN]
    return list(dict.fromkeys(both))


def mean_rates(result: Result, task: str) -> list[float]:
    """Returns the success of each seed of a row in a task, as `share_of`."""
    return [
        share_of(task, run["tasks"][task]["success_rate"], run["tasks"][task]["mean_score"]) for run in runs(result)
    ]


def share_of(task: str, success: float, points: float) -> float:
    """Returns the success of a player in a task, or the share of the shots that score in "SumToThree"."""
    return points / FROZEN[task].arguments["max_shots"] if task.startswith("SumToThree") else success


def runs(result: Result) -> list[Result]:
    """Returns the runs of a row, by ascending seed."""
    return list(result["runs"].values())


def players() -> dict[str, dict[str, float]]:
    """Returns the success of the players without training by task and name, as `share_of`."""
    measured = read_results(frozen_tasks.OUTPUT)
    return {
        task: {name: share_of(task, one["success"], one["return"]) for name, one in known["players"].items()}
        for task, known in measured.items()
    }


def policies(measured: Result) -> list[tuple[str, str, Result]]:
    """Returns the name, the task and the result of each row with results and each of its tasks."""
    return [(name, task, one) for name, one in measured.items() if one["runs"] for task in runs(one)[0]["tasks"]]


def blocks(measured: Result) -> dict[str, str]:
    """Returns the tables and sentences for the pages, by name."""
    others, lines = players(), []
    for name, task, result in policies(measured):
        rates, curve = mean_rates(result, task), runs(result)[0]["curve"]
        seconds = np.mean([run["curve"][-1][1] for run in runs(result)])
        shots, learner = curve[-1][0], result["settings"].get("learner", "ppo")
        cost = (f"{shots / 1e6:.1f}", f"{seconds:.0f} s", f"{shots / seconds / 1e3:,.0f},000")
        numbers = (learner, *cost, str(len(rates)), as_percent(over_seeds(rates)))
        cells = (f"{others[task][player]:.1%}" if player in others[task] else "" for player in PLAYERS)
        lines.append((f"`{name}`", f"`{task.removesuffix('-v0')}`", *numbers, *cells))
    what = ("row", "task", "learner", "million shots", "processor time", "shots a second", "seeds", "success")
    head = (*what, *(f"`{name}`" for name in PLAYERS))
    pot, usual = measured["pot"], measured["pot_mlp"]
    first = np.mean([run["curve"][0][3] for run in runs(pot)])
    return {
        "machine": machine_line(runs(pot)[0]["machine"]),
        "table": table(head, lines, left=3),
        "proposals": _proposals(measured, others),
        "solved": _solved(measured, others),
        "summary": f"After at most {max(run['curve'][-1][1] for run in runs(pot)):.0f} s of training on one core, the "
        f"policy pots the ball on {as_percent(over_seeds(mean_rates(pot, 'Pot1-v0')))} of new layouts: the mean over "
        f"{len(runs(pot))} seeds, with its 95% interval. Before the training the rate is {first:.1%}. With as many "
        f'shots `PPO("MlpPolicy")` reaches {np.mean(mean_rates(usual, "Pot1-v0")):.1%}. Random shots pot the ball on '
        f"{others['Pot1-v0']['random']:.1%} of the layouts, and a search of 200 shots for each layout on "
        f"{others['Pot1-v0']['search:200']:.1%}.",
    }


def _solved(measured: Result, others: Mapping[str, Mapping[str, float]]) -> str:
    """Returns the table "solved and open": the best player of each task, beside `AimPolicy`.

    The open tasks come first. A cell has the values without noise, and with noise where they were measured.
    """
    cells = {task: line for task in others if (line := _line_of(task, measured, others[task]))}
    lines = []
    for task, line in cells.items():
        if "Noise" not in task:
            noisy = cells.get(task.replace("-v0", "Noise-v0"), [""] * len(line))
            pairs = zip(line, noisy, strict=True)
            lines.append((f"`{task.removesuffix('-v0')}`", *(" / ".join(filter(None, pair)) for pair in pairs)))
    head = ("task", "state", "best player", f"`{_BEST_OF}`", "`AimPolicy`", "random")
    return table(head, sorted(lines, key=lambda line: line[1]))


def _line_of(task: str, measured: Result, others: Mapping[str, float]) -> list[str]:
    """Returns the cells of a task; none if no row of `AimPolicy` has proposals in it."""
    name = best_row(measured, task)
    if name is None:
        return []
    alone, of_many = _alone(measured[name], task), measured[name]["proposals"][task][str(PROPOSALS[-1])]["success"]
    rates = {**others, "AimPolicy": alone, _BEST_OF: of_many}
    best = max(rates, key=lambda player: rates[player])
    state = "solved" if _is_solved(task, max(alone, of_many)) else "open"
    return [state, f"{rates[best]:.1%} (`{best}`)", f"{of_many:.1%}", f"{alone:.1%}", f"{others['random']:.1%}"]


def _is_solved(task: str, learned: float) -> bool:
    """Returns whether a player reaches the threshold of a task.

    The success of a policy, as `share_of`, gives its mean return if each shot has a point or none, or if an episode is
    one shot (apart from scratches).
    """
    frozen = FROZEN[task]
    returns = [one["return"] for one in read_results(frozen_tasks.OUTPUT)[task]["players"].values()]
    shots = frozen.arguments["max_shots"]
    if shots == 1 or task.startswith("SumToThree"):
        returns.append(shots * learned)
    return max(returns) >= frozen.threshold


def best_row(measured: Result, task: str) -> str | None:
    """Returns the row of `AimPolicy` with the most success in a task with `_BEST_OF`; None if none plays it."""
    names = [name for name, one in measured.items() if task in one.get("proposals", {}) and not _is_usual(one)]
    count = str(PROPOSALS[-1])
    return max(names, key=lambda name: measured[name]["proposals"][task][count]["success"], default=None)


def _is_usual(result: Result) -> bool:
    """Returns whether a row has the usual policy of Stable-Baselines3."""
    return result["settings"].get("policy", {}).get("head") == "gaussian"


def _alone(result: Result, task: str) -> float:
    """Returns the mean success over the seeds, or that of the first seed's policy in a task that it alone plays."""
    if task in runs(result)[0]["tasks"]:
        return float(np.mean(mean_rates(result, task)))
    return result["proposals"][task][str(PROPOSALS[0])]["success"]


def _of_proposals(result: Result, task: str) -> list[str]:
    """Returns the success with each number of simulated proposals."""
    return [f"{result['proposals'][task][str(count)]['success']:.1%}" for count in PROPOSALS[1:]]


def _proposals(measured: Result, others: Mapping[str, Mapping[str, float]]) -> str:
    """Returns the table of the players with proposals."""
    lines = []
    for name, result in measured.items():
        for task, counts in result.get("proposals", {}).items():
            shots = [f"{counts[str(count)]['simulated']:.0f}" for count in PROPOSALS[1:]]
            times = [f"{counts[str(count)]['ms']:.1f} ms" for count in PROPOSALS]
            cells = (f"{others[task][player]:.1%}" if player in others[task] else "" for player in PLAYERS[1:])
            alone = f"{counts[str(PROPOSALS[0])]['success']:.1%}"
            line = (f"`{name}`", f"`{task.removesuffix('-v0')}`", alone, *_of_proposals(result, task), *cells)
            lines.append((*line, ", ".join(shots), ", ".join(times)))
    counts = (f"of {count}" for count in PROPOSALS[1:])
    head = ("row", "task", "alone", *counts, *(f"`{name}`" for name in PLAYERS[1:]), "simulated shots", "time")
    return table(head, lines, left=2)


def draw(measured: Result, folder: Path) -> None:
    """Draws the learning curves of the rows, one panel for each task, beside the players without training.

    A curve is the mean over the seeds and, thin, each seed. A row is in the panel of the task of its training.
    """
    rows_of: dict[str, list[str]] = {}
    for name, result in measured.items():
        if result["runs"]:
            rows_of.setdefault(result["settings"]["task"], []).append(name)
    across = min(5, len(rows_of))
    down = -(-len(rows_of) // across)
    figure = new_figure(2.5 * across, 2.1 * down + 0.4)
    panels = figure.subplots(down, across, sharey=True, squeeze=False).ravel()
    others, lines = players(), {}
    for axes, (task, names) in zip(panels, rows_of.items(), strict=False):
        for k, name in enumerate(names):
            one = runs(measured[name])
            curves = 100 * np.array([[share_of(task, *point[3:5]) for point in run["curve"]] for run in one])
            steps = np.array([point[0] for point in one[0]["curve"]]) / 1e6
            axes.plot(steps, curves.mean(0), color=f"C{k}", linewidth=2, label=name)
            axes.plot(steps, curves.T, color=f"C{k}", linewidth=0.5, alpha=0.6)
        for player, style in LINES.items():
            if player in others[task]:
                lines[player] = axes.axhline(100 * others[task][player], linewidth=1.2, **style)
        axes.set_title(task.removesuffix("-v0"), fontsize=10)
        axes.set(xlim=(0, None), ylim=(0, 105))
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7.5, frameon=False, handlelength=1.2)
    for axes in panels[len(rows_of) :]:
        axes.axis("off")
    figure.supxlabel("million shots", fontsize=10)
    figure.supylabel("success on new layouts (%)", fontsize=10)
    figure.legend(lines.values(), lines, loc="outside upper center", ncols=len(lines), fontsize=9, frameon=False)
    save(figure, folder / "learning.png")


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.learning --help`."""
    about = "Train the rows of configs/learning.yaml and measure them."
    run_command("studies.learning", about, arguments, measure, blocks, {"output": (OUTPUT, "JSON file"), **JOBS}, draw)


if __name__ == "__main__":
    main()
