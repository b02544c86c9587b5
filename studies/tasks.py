"""Measures players without training in the frozen tasks: `python -m studies.tasks`.

Each player plays the public layouts of `billiards bench`. The results are in `billiards_env/results/tasks.json`, where
`billiards bench` finds the ends of its scale. The command skips players that have results there, so it continues after
an interruption. If the layouts of a task change, it measures the task again.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
from matplotlib.figure import Figure
from tqdm import tqdm

from benchmarks import save, table, use_own_font
from billiards_env import bench
from billiards_env.evaluation import evaluation_seeds, find_player
from billiards_env.files import write_json
from billiards_env.frozen import FROZEN, NAMESPACE, Frozen
from billiards_env.players.env_player import RULES_OF_TASKS
from studies import parser_of, report

OUTPUT = Path(bench.__file__).parent / "results" / "tasks.json"

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "images" / "tasks.png"

PLAYERS = ("random", "geometric", "search:200", "aim", "planner:300")

ONLY: dict[str, tuple[str, ...]] = {
    "aim": ("Pot1-v0", "Carom-v0", "ThreeCushion-v0", "SumToThree-v0"),
    "planner:300": tuple(name for name, task in FROZEN.items() if task.arguments["task"] in RULES_OF_TASKS),
}
"""The tasks of players that play only some. "aim" takes many times as long as a search in the other tasks."""


def measure(output: Path) -> dict[str, Any]:
    """Measures the players without results, and writes the results of each as soon as it is measured.

    Returns:
        The content of the file, see `bench.reference`.
    """
    found: dict[str, Any] = json.loads(output.read_text(encoding="utf-8")) if output.exists() else {}
    for task in FROZEN:
        layouts = bench.layouts_hash(task)
        if found.get(task, {}).get("layouts") != layouts:
            found[task] = {"layouts": layouts, "players": {}}
    write_json(output, found)
    cells = [(task, player) for task in FROZEN for player in PLAYERS if task in ONLY.get(player, FROZEN)]
    with tqdm(cells, unit="player") as bar:
        for task, player in bar:
            bar.set_description(f"{task}, {player}")
            players = found[task]["players"]
            if player in players:
                continue
            (result,) = bench.play(player, [task]).results
            players[player] = {"success": float(result.success.mean()), "return": float(result.returns.mean())}
            write_json(output, found)
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns a table of all tasks, and the text about each id, by name."""
    head = ("id", "solved from", *PLAYERS)
    rows = [
        (f"`{NAMESPACE}{name}`", f"{task.threshold:g}", *(_success(found, name, player) for player in PLAYERS))
        for name, task in FROZEN.items()
    ]
    return {"table": table(head, rows), **{name: "\n\n".join(_section(name, found)) for name in families()}}


def families() -> list[str]:
    """Returns the names of the tasks, without strikes, noise and version."""
    return [name.removesuffix("-v0") for name in FROZEN if not re.search("Strike|Noise", name)]


def _success(found: Mapping[str, Any], name: str, player: str) -> str:
    players = found.get(name, {}).get("players", {})
    return f"{players[player]['success']:.1%}" if player in players else "-"


def _section(family: str, found: Mapping[str, Any]) -> list[str]:
    """Returns the paragraphs about the ids of a task."""
    ids = {name: task for name, task in FROZEN.items() if name.startswith((f"{family}-", f"{family}N", f"{family}S"))}
    first = ids[f"{family}-v0"]
    rows = []
    for name, task in ids.items():
        known = found.get(name, {}).get("players", {})
        returns = (f"{known[player]['return']:.3f}" if player in known else "-" for player in PLAYERS)
        rows.append((f"`{NAMESPACE}{name}`", f"{task.threshold:g}", *returns))
    given = ", ".join(f"`{key}={value!r}`" for key, value in first.arguments.items())
    history = [f"- `{name}`: {line}" for name, task in ids.items() for line in task.history]
    return [
        first.summary,
        "\n".join(_spaces(first, len(ids) > 2)),
        f"Arguments of `Billiards-v0`: {given}."
        + (" The strikes have `scene='real_pool'` and `action='strike'`." if len(ids) > 2 else ""),
        f"Mean returns:\n\n{table(('id', 'solved from', *PLAYERS), rows)}",
        "\n".join(history),
    ]


def _spaces(task: Frozen, strikes: bool) -> list[str]:
    """Returns lines about the observation, the action, the reward and the length of an episode."""
    env: Any = gym.make("billiards_env:Billiards-v0", **task.arguments)
    observation, base = env.observation_space.shape[0], env.unwrapped
    parts = [f"x and y of {base.scene.n_balls} balls"]
    parts += ["x and y of the goal"] * len(base.goals) + ["the legal balls"] * bool(base.legal_balls.size)
    parts += ["the shots left"] * base.observe_shots_left
    shots = base.max_shots
    return [
        f"- Observation: {observation} numbers: {', '.join(parts)}.",
        f"- Action: the velocity of the cue ball divided by {base.max_speed:g} m/s, 2 numbers from -1 to 1."
        + " A strike has 5." * strikes,
        f"- Reward: the points of the shot, minus {base.scratch_penalty:g} for a scratch. "
        f"[The environment](environment.md#tasks) describes the points of `{base.task!r}`.".replace("'", '"'),
        "- Episode: one shot."
        if shots == 1
        else f"- Episode: {'' if base.task == 'sum_to_three' else 'at most '}{shots} shots.",
    ]


def picture() -> Figure:
    """Returns a picture of each task: a shot of "search:200" in the first public layout."""
    use_own_font()
    names = families()
    figure = Figure(figsize=(8, 1.0 + 2.1 * ((len(names) + 1) // 2)), dpi=100, layout="constrained")
    for k, name in enumerate(names):
        env: Any = gym.make(f"{NAMESPACE}{name}-v0", render_mode="rgb_array")
        observation, _ = env.reset(seed=int(evaluation_seeds(bench.SEED, 1)[0]))
        env.step(find_player("search:200", env, seed=0)(observation))
        ax = figure.add_subplot((len(names) + 1) // 2, 2, k + 1)
        ax.imshow(env.render())
        ax.set_title(name, fontsize=9)
        ax.axis("off")
        env.close()
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.tasks --help`."""
    files = {"output": (OUTPUT, "JSON file"), "figure": (FIGURE, "the picture, .png")}
    args = parser_of("tasks", "Measure players without training in the frozen tasks.", **files).parse_args(arguments)

    def work() -> dict[str, Any]:
        save(picture(), args.figure)
        return measure(args.output)

    report(work, blocks, args.output)


if __name__ == "__main__":
    main()
