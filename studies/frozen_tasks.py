"""Measures players without training in the frozen tasks: `python -m studies.frozen_tasks`.

Each player plays the public layouts of `billiards bench`. The results are in
`billiards_env/bench/results/frozen_tasks.json`, where `billiards bench` finds the ends of its scale. The command skips
players that have results there, so it continues after an interruption. If the layouts of a task change, it measures
the task again.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from matplotlib.image import imsave

from benchmarks import new_figure, run_command, save, table
from billiards_env.bench import benchmark as bench
from billiards_env.bench.evaluation import evaluation_seeds
from billiards_env.bench.frozen import FROZEN, NAMESPACE, Frozen
from billiards_env.envs.tasks import task_of
from billiards_env.players.env_player import acting
from billiards_env.players.named import find_player
from billiards_env.shots.noise import EXECUTION_NOISE
from studies import RESULTS, fill, read_results

OUTPUT = Path(bench.__file__).parent / "results" / "frozen_tasks.json"

PLAYERS = ("random", "geometric", "search:200", "aim", "planner:300")

ONLY: dict[str, tuple[str, ...]] = {
    "aim": tuple(
        name for name, task in FROZEN.items() if task.arguments["task"] not in ("jump", "nine_ball", "eight_ball")
    ),
    "planner:300": tuple(name for name, task in FROZEN.items() if task_of(task.arguments["task"]).rules),
}
"""The tasks of players that play only some. In nine ball and eight ball, "aim" takes many times as long as a search. It
does not play flights."""


def measure(output: Path) -> dict[str, Any]:
    """Measures the players without results, and writes the results of each as soon as it is measured.

    Returns:
        The content of the file, see `bench.reference`.
    """
    old, results = read_results(output), {}
    for task in FROZEN:
        layouts, known = bench.layouts_hash(task), old.get(task, {})
        results[task] = known if known.get("layouts") == layouts else {"layouts": layouts, "players": {}}
    jobs = {
        (task, "players", player): functools.partial(scores_of, player, task)
        for task in FROZEN
        for player in PLAYERS
        if task in ONLY.get(player, FROZEN)
    }
    return fill(output, results, jobs)


def scores_of(player: str, task: str) -> dict[str, float]:
    """Returns the mean success and the mean return of a player in the public layouts of a task."""
    (result,) = bench.play_tasks(player, [task]).results
    return {"success": float(result.success.mean()), "return": float(result.returns.mean())}


def blocks(results: Mapping[str, Any]) -> dict[str, str]:
    """Returns a table of all tasks, and one of the player "random" in those without noise."""
    rows, chance = [], []
    for name, task in FROZEN.items():
        known, policy = results.get(name, {}).get("players", {}), learned(name)
        shares = [known[player]["success"] if player in known else None for player in PLAYERS]
        cells = [_percent(share) for share in (*shares, policy and policy.success)]
        rows.append((f"`{NAMESPACE}{name}`", f"{task.threshold:g}", *cells))
        if "random" in known and not task.noise:
            chance.append((f"`{NAMESPACE}{name}`", cells[0], f"{known['random']['return']:.3f}"))
    return {
        "table": table(("id", "solved from", *PLAYERS, "best learned"), rows),
        "random": table(("id", "success", "mean return"), chance),
    }


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{share:.1%}"


class Learned(NamedTuple):
    """The success of a trained policy in a frozen task: its name, the share of successes, and the page about it."""

    policy: str
    success: float
    page: str


def learned(name: str) -> Learned | None:
    """Returns the best trained policy in a frozen task, or None if none was measured.

    The candidates are the entries of the leaderboard, and the rows of `configs/learning.yaml`. A row has its mean
    success over the seeds, and its success with the best of several proposals ("row:64" with 64).
    """
    entries = read_results(RESULTS / "leaderboard.json").values()
    candidates = [
        Learned(entry["player"], entry["scores"][name]["success"], "leaderboard.md")
        for entry in entries
        if entry["player"] not in PLAYERS and name in entry["scores"]
    ]
    for row, result in read_results(RESULTS / "learning.json").items():
        rates = [run["tasks"][name]["success_rate"] for run in result["runs"].values() if name in run["tasks"]]
        if rates:
            candidates.append(Learned(row, float(np.mean(rates)), "training.md"))
        for count, one in result.get("proposals", {}).get(name, {}).items():
            if count != "1" and not name.startswith("SumToThree"):  # its success is the share of shots that score
                candidates.append(Learned(f"{row}:{count}", one["success"], "training.md"))
    return max(candidates, key=lambda one: one.success, default=None)


def page(name: str) -> str:
    """Returns the page of an id in the documentation, in Markdown. `docs/build.py` adds these pages to the site.

    Args:
        name: The id without `NAMESPACE`.
    """
    task, policy = FROZEN[name], learned(name)
    known = read_results(OUTPUT).get(name, {}).get("players", {})
    rows = [
        (f"`{one}`", _percent(known[one]["success"]), f"{known[one]['return']:.3f}") for one in PLAYERS if one in known
    ]
    if policy:
        rows.append((f"best learned: [{policy.policy}](../{policy.page})", _percent(policy.success), ""))
    arguments = ", ".join(f"`{key}={value!r}`" for key, value in task.arguments.items())
    noise = ", ".join(f"`{key}={value!r}`" for key, value in EXECUTION_NOISE.items())
    parts = [
        f"# {name.removesuffix('-v0')}",
        task.summary,
        f"![A shot of search:200 in the first public layout](../images/tasks/{_picture(name)}.jpg)",
        f'```python\nimport gymnasium as gym\nimport billiards_env\n\nenv = gym.make("{NAMESPACE}{name}")\n```',
        "\n".join(_spaces(task)),
        f"The task counts as solved from a mean return of {task.threshold:g}, the `reward_threshold`.",
        "## Scores",
        table(("player", "success", "mean return"), rows),
        "The players without training play the 1,000 public layouts of [`billiards bench`](../leaderboard.md).",
        "## Arguments",
        f"The id stands for `Billiards-v0` with these arguments: {arguments}."
        + task.noise * f" [Execution noise](../environment.md#actions-and-noise): {noise}.",
        "## Versions",
        "\n".join(f"- {line}" for line in task.history),
    ]
    return "\n\n".join(parts) + "\n"


def _picture(name: str) -> str:
    """Returns the name of the picture of an id. The ids with and without noise have the same."""
    return name.removesuffix("-v0").replace("Noise", "")


def _spaces(task: Frozen) -> list[str]:
    """Returns lines about the observation, the action, the reward and the length of an episode."""
    env: Any = gym.make("billiards_env:Billiards-v0", **task.arguments)
    observation, base = env.observation_space.shape[0], env.unwrapped
    parts = [f"`{name}` ({math.prod(shape)})" for name, shape in base.features.items()]
    velocity = f"the velocity of the cue ball divided by {base.max_speed:g} m/s, 2 numbers from -1 to 1."
    strike = "a [strike](../environment.md#strikes-as-actions), 5 numbers from -1 to 1."
    shots = "one shot" if base.model.max_shots == 1 else f"{base.model.max_shots} shots"
    limit = "at most " * (base.model.max_shots > 1 and base.task != "sum_to_three")
    return [
        f"- [Observation](../environment.md#observations): {observation} numbers: {', '.join(parts)}.",
        f"- Action: {strike if env.action_space.shape == (5,) else velocity}",
        f"- Reward: the points of the shot, minus {base.model.scratch_penalty:g} for a scratch. "
        f'[The environment](../environment.md#tasks) describes the points of `"{base.task}"`.',
        f"- Episode: {limit}{shots}.",
    ]


def draw(_: Any, folder: Path) -> None:
    """Draws a shot of "search:200" in the first public layout of each task, and `tasks.png` with one of each kind."""
    pictures = {}
    for name in dict.fromkeys(_picture(name) for name in FROZEN):
        env: Any = gym.make(f"{NAMESPACE}{name}-v0", render_mode="rgb_array")
        observation, _ = env.reset(seed=int(evaluation_seeds(bench.SEED, 1)[0]))
        env.step(acting(find_player("search:200", env), env, seed=0)(observation))
        pictures[name] = env.render()
        env.close()
    (folder / "tasks").mkdir(parents=True, exist_ok=True)
    for name, image in pictures.items():
        imsave(folder / "tasks" / f"{name}.jpg", image, pil_kwargs={"quality": 80, "optimize": True})
    kinds = [name for name in pictures if not name.endswith("Strike")]
    figure = new_figure(8, 1.0 + 2.1 * ((len(kinds) + 1) // 2), dpi=100)
    for k, name in enumerate(kinds):
        ax = figure.add_subplot((len(kinds) + 1) // 2, 2, k + 1)
        ax.imshow(pictures[name])
        ax.set_title(name, fontsize=9)
        ax.axis("off")
    save(figure, folder / "tasks.png")


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.frozen_tasks --help`."""
    about, output = "Measure players without training in the frozen tasks.", (OUTPUT, "JSON file")
    run_command("studies.frozen_tasks", about, arguments, measure, blocks, {"output": output}, draw)


if __name__ == "__main__":
    main()
