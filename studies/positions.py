"""A fixed set of positions, and the success of a player's strokes in them: `python -m studies.positions`.

The set, `studies/position_set.json`, has positions of nine ball and of eight ball on `real_pool` with the
stroke that the planner chooses. They come from games of the planner against itself under execution noise, after the
break. Commit 672a979 is the last one with the code that made the set.

A player chooses one stroke in each position. The stroke is simulated with `SAMPLES` draws of noise, the same for all
players. Its success is the share of the outcomes in which the player wins or keeps the turn, so a safety is not a
success. The scores are in `studies/results/positions.json`.
"""

from __future__ import annotations

import functools
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import run_command, table
from billiards_env.games import GAMES, Call, GameState, Setup, Stroke, custom_opening
from billiards_env.games.batch import play_batch
from billiards_env.games.placement import cue_ball_point
from billiards_env.players.named import find_player
from billiards_env.players.planner import noisy_strokes
from billiards_env.players.situation import game_situation
from billiards_env.scene import Scene
from billiards_env.support.intervals import as_percent, mean_interval
from studies import RESULTS, fill, resumed
from studies.planner import MAX_SPEED, OLYMPIAD

SET = Path(__file__).with_name("position_set.json")
OUTPUT = RESULTS / "positions.json"
PLAYERS = "answers,planner:1000,search:200,geometric"
RULES = "nine_ball", "eight_ball"
SAMPLES, SEED = 1000, 40


def setup_of(rules: str) -> Setup:
    """Returns the setup of the positions of a game."""
    return Setup(rules, Scene.named("real_pool", GAMES[rules].n_object_balls[1]))


def state_of(entry: Mapping[str, Any]) -> GameState:
    """Returns the state of the game in an entry of the set."""
    return custom_opening(setup_of(entry["rules"]), entry["balls"], entry["state"])


def stroke_of(answer: Mapping[str, Any]) -> Stroke:
    """Returns the stroke of an answer in the set."""
    place = None if answer["place"] is None else tuple(answer["place"])
    return Stroke(tuple(answer["velocity"]), place, tuple(answer["spin"]), Call(**answer["call"]))


def success_share(setup: Setup, game: GameState, stroke: Stroke, samples: int, rng: np.random.Generator) -> float:
    """Returns the share of the noisy outcomes of a stroke in which the player wins or keeps the turn."""
    drawn = rng.standard_normal((samples, 2)) * (math.radians(OLYMPIAD[0]), OLYMPIAD[1])
    motions: NDArray[np.float64] = np.repeat([[*stroke.velocity, *stroke.spin]], samples, axis=0)
    velocities, spins = noisy_strokes(motions[:, :2], motions[:, 2:], drawn, MAX_SPEED)
    places = None
    if game.state.in_hand:
        assert stroke.place is not None
        place = cue_ball_point(setup.scene, game.positions, game.state, stroke.place)
        places = np.repeat([place], samples, axis=0)
    played = play_batch(setup, game, velocities, spins, places)
    return float((played.verdicts["continues"] | (played.states["winner"] == game.state.player)).mean())


def play_all(entries: Sequence[Mapping[str, Any]], player: str, samples: int) -> dict[str, Any]:
    """Returns the `success` of a player in each position, and the processor time of all decisions, `seconds`.

    Args:
        entries: The positions.
        player: See `players.named`; "answers" for the strokes in the set.
        samples: The number of noisy outcomes.
    """
    successes, seconds = [], 0.0
    for number, entry in enumerate(tqdm(entries, desc=player, unit="position", leave=False)):
        setup, game = setup_of(entry["rules"]), state_of(entry)
        decide: Callable[..., Stroke] = functools.partial(lambda answer, *_: stroke_of(answer), entry["answer"])
        if player != "answers":
            decide = find_player(player, setup)
        begin = time.process_time()
        stroke = decide(game_situation(setup, game, MAX_SPEED, OLYMPIAD), np.random.default_rng([SEED, number, 1]))
        seconds += time.process_time() - begin
        successes.append(success_share(setup, game, stroke, samples, np.random.default_rng([SEED, number])))
    return {"success": successes, "seconds": seconds}


def measure(output: Path, players: str, samples: int) -> dict[str, Any]:
    """Measures the players that have no scores yet, and writes the scores of each as soon as they are measured.

    `players` are names for `play_all`, separated by commas.

    Returns:
        The content of `output`: `machine`, `settings`: `samples` and the `rules` of each position, and `scores` by
        player.

    Raises:
        OSError: If a file cannot be read or written.
        ValueError: If a file is not JSON, or a player is unknown.
    """
    entries = json.loads(SET.read_text(encoding="utf-8"))["positions"]
    content = resumed(output, {"samples": samples, "rules": [entry["rules"] for entry in entries]})
    jobs = {("scores", player): functools.partial(play_all, entries, player, samples) for player in players.split(",")}
    return fill(output, content, jobs)


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table for the page, by name."""
    rules = np.array(result["settings"]["rules"])
    rows = []
    for player, score in result["scores"].items():
        success = np.array(score["success"])
        share = as_percent({"mean": success.mean(), "interval": mean_interval(score["success"])})
        parts = (f"{success[rules == one].mean():.1%}" for one in RULES)
        taken = "-" if player == "answers" else f"{1e3 * score['seconds'] / len(success):.0f} ms"
        rows.append((player, *parts, share, taken))
    head = ("player", *(rules.replace("_", " ") for rules in RULES), "all positions", "decision")
    return {"table": table(head, rows)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.positions --help`."""
    options = {
        "output": (OUTPUT, "JSON file"),
        "players": (PLAYERS, "players of games, separated by commas"),
        "samples": (SAMPLES, "draws of noise for each stroke"),
    }
    about = "Measure the strokes of players in a fixed set of positions."
    run_command("studies.positions", about, arguments, measure, blocks, options)


if __name__ == "__main__":
    main()
