"""Trains the row `eight_ball`, which plays against itself, and lets it play matches: `python -m studies.self_play`.

The training has the first seed of the published results. The results are

* `studies/results/self_play.json`: the settings of the row, the learning curve, and for each match the numbers of games
  that the policy won, that it lost, and that nobody won,
* `studies/results/policies/eight_ball`: the policy, as `studies.learning` writes those of other rows.

The command continues after an interruption. During a match it saves the results after every 20 games, in the folder of
the run. If the settings have changed, it trains and plays again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from agents.config import LEARNING, load, rows
from agents.train import versions
from benchmarks import machine, run_command, table
from billiards_env.bench.match import play_pairs
from billiards_env.intervals import as_percent, wilson_interval
from billiards_env.settings import read_settings
from billiards_env.support.files import write_atomically, write_json
from studies import RESULTS, RUNS, learning, read_results

OUTPUT = RESULTS / "self_play.json"
ROW = "eight_ball"
GAME = {"task": "eight_ball", "n_players": 2, "scene": "real_pool"}
MATCHES = {"alone": ("", "noisy:club:geometric"), "of 16": (":16", "planner:club")}
"""For each match, the end of the name of the player, and the other player, which has the same noise."""


def measure(output: Path, games: int) -> dict[str, Any]:
    """Trains the row and plays the matches that have no results, and writes each result as soon as it is known.

    Args:
        output: The JSON file of the results. The policy is in `policies/eight_ball` beside it.
        games: The number of games of each match.
    """
    settings, content, output = rows()[ROW], read_results(output), output.resolve()
    folder = (RUNS / "learning" if output == OUTPUT else output.parent / "runs") / ROW
    policy = output.parent / "policies" / ROW
    if content.get("settings") != settings:
        for path in folder.glob("*.json"):  # the games of another policy
            path.unlink()
        seed = read_settings(LEARNING, "settings")["seeds"][0]
        curve, files = learning.trained(load(ROW, seed=seed), folder / f"seed{seed}")
        for file, text in files.items():
            write_atomically(policy / file, text)
        known = {"machine": machine(), "versions": versions()}
        content = {"settings": settings, "curve": [list(point) for point in curve], **known, "matches": {}}
        write_json(output, content)
    for name, (proposals, other) in MATCHES.items():
        if sum(content["matches"].get(name, ())) != games:
            players = (f"noisy:club:policy:{policy}{proposals}", other)
            with tqdm(total=games, desc=name, unit="game") as bar:
                path = folder / f"{name} {games}.json"
                played = play_pairs(players, games, GAME, 0, path, lambda _, count: bar.update(count - bar.n))
            (content["matches"][name],) = played.values()
            write_json(output, content)
    return content


def share(result: Sequence[int]) -> str:
    """Returns the share of the won games, with its interval."""
    won, lost, _ = result
    return as_percent({"mean": won / (won + lost), "interval": wilson_interval(won, won + lost)})


def blocks(content: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table for the page."""
    lines = [
        (name, f"`{MATCHES[name][1]}`", str(sum(result)), share(result)) for name, result in content["matches"].items()
    ]
    return {"table": table(("policy", "against", "games", "share of won games"), lines, left=2)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.self_play --help`."""
    about = "Train the row eight_ball by self-play and let it play matches."
    options = {"output": (OUTPUT, "JSON file"), "games": (400, "games of each match")}
    run_command("studies.self_play", about, arguments, measure, blocks, options)


if __name__ == "__main__":
    main()
