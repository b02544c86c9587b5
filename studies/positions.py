"""A fixed set of positions, and the success of a player's strokes in them: `python -m studies.positions PLAYER ...`.

The set, `studies/position_set.json`, has positions of nine ball and of eight ball on `real_pool` with the
stroke that the planner chooses. They come from games of the planner against itself under execution noise, after the
break. `--make` plays these games again and writes the set.

A player chooses one stroke in each position. The stroke is simulated with `SAMPLES` draws of noise, the same for all
players. Its success is the share of the outcomes in which the player wins or keeps the turn, so a safety is not a
success. The scores are in `studies/results/positions.json`.
"""

from __future__ import annotations

import contextlib
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

from benchmarks import machine, machine_line, table
from billiards_env.files import write_json
from billiards_env.games import GAMES, Call, GameState, Setup, Stroke, custom_opening, opening, to_dict
from billiards_env.games.batch import play_batch
from billiards_env.games.game import STATE_FIELDS
from billiards_env.games.placement import cue_ball_point
from billiards_env.intervals import as_percent, mean_interval
from billiards_env.players.named import find_player
from billiards_env.players.planner import add_noise, plan
from billiards_env.scene import Scene
from studies import RESULTS, parser_of, report
from studies.planner import MAX_SPEED, OLYMPIAD, shoot

SET = Path(__file__).with_name("position_set.json")
OUTPUT = RESULTS / "positions.json"
PLAYERS = ("planner:1000", "search:200", "geometric")
COUNTS = {"nine_ball": 100, "eight_ball": 100}
"""The number of positions of each game."""
KEPT = 0.3
"""Share of the positions of a game that go into the set."""
PLAYS, ANSWERS = "planner:1000", 10_000
"""The player of the games, and the number of simulated shots for the strokes in the set."""
SAMPLES, SEED = 1000, 40


def setup_of(rules: str) -> Setup:
    """Returns the setup of the positions of a game."""
    return Setup(rules, Scene.named("real_pool", GAMES[rules].n_object_balls[1]))


def make(path: Path) -> None:
    """Plays games and writes the set."""
    found: list[dict[str, Any]] = []
    with tqdm(total=sum(COUNTS.values()), unit="position") as bar:
        for rules, count in COUNTS.items():
            setup, end, seed = setup_of(rules), len(found) + count, 0
            while len(found) < end:
                some = _positions(setup, seed)[: end - len(found)]
                found += some
                seed += 1
                bar.update(len(some))
    write_json(path, {"noise": list(OLYMPIAD), "max_speed": MAX_SPEED, "positions": found})


def _positions(setup: Setup, seed: int) -> list[dict[str, Any]]:
    """Returns some positions of a game of the planner against itself, with the planner's strokes."""
    rng = np.random.default_rng([SEED, seed])
    game, rngs, found = opening(setup, rng), rng.spawn(3), []
    player = find_player(PLAYS, setup, noise=OLYMPIAD)
    for number in range(60):
        if game.state.over:
            break
        if not game.state.break_shot and rngs[2].random() < KEPT:
            state = {name: value for name, value in to_dict(game.state).items() if name in STATE_FIELDS}
            entry = {"rules": setup.rules, "seed": seed, "stroke": number}
            entry |= {"balls": game.positions.round(6).tolist(), "state": state}
            with contextlib.suppress(ValueError):  # rounded balls that touched may overlap
                found.append(entry | {"answer": _answer(setup, state_of(entry), rngs[2])})
        game = shoot(setup, game, player, OLYMPIAD, rngs).game
    return found


def _answer(setup: Setup, game: GameState, rng: np.random.Generator) -> dict[str, Any]:
    best = plan(setup, game, MAX_SPEED, rng, math.inf, ANSWERS, OLYMPIAD)
    stroke = best.stroke._asdict() | {"call": best.stroke.call._asdict()}
    return {**stroke, "probability": round(best.probability, 4), "value": round(best.value, 4)}


def state_of(entry: Mapping[str, Any]) -> GameState:
    """Returns the state of the game in an entry of the set."""
    return custom_opening(setup_of(entry["rules"]), entry["balls"], entry["state"])


def stroke_of(answer: Mapping[str, Any]) -> Stroke:
    """Returns the stroke of an answer in the set."""
    place = None if answer["place"] is None else tuple(answer["place"])
    return Stroke(tuple(answer["velocity"]), place, tuple(answer["spin"]), Call(**answer["call"]))


def success(setup: Setup, game: GameState, stroke: Stroke, samples: int, rng: np.random.Generator) -> float:
    """Returns the share of the noisy outcomes of a stroke in which the player wins or keeps the turn."""
    drawn = rng.standard_normal((samples, 2)) * (math.radians(OLYMPIAD[0]), OLYMPIAD[1])
    given: NDArray[np.float64] = np.repeat([[*stroke.velocity, *stroke.spin]], samples, axis=0)
    velocities, spins = add_noise(given[:, :2], given[:, 2:], drawn, MAX_SPEED)
    places = None
    if game.state.in_hand:
        assert stroke.place is not None
        place = cue_ball_point(setup.scene, game.positions, game.state, stroke.place)
        places = np.repeat([place], samples, axis=0)
    played = play_batch(setup, game, velocities, spins, places)
    return float((played.verdicts["continues"] | (played.states["winner"] == game.state.player)).mean())


def evaluate(entries: Sequence[Mapping[str, Any]], player: str, samples: int) -> dict[str, Any]:
    """Returns the `success` of a player in each position, and the processor time of all decisions, `seconds`.

    Args:
        entries: The positions.
        player: See `players.named`; "answers" for the strokes in the set.
        samples: The number of noisy outcomes.
    """
    found, seconds = [], 0.0
    for number, entry in enumerate(tqdm(entries, desc=player, unit="position", leave=False)):
        setup, game = setup_of(entry["rules"]), state_of(entry)
        decide: Callable[..., Stroke] = functools.partial(lambda answer, *_: stroke_of(answer), entry["answer"])
        if player != "answers":
            decide = find_player(player, setup, noise=OLYMPIAD)
        begin = time.process_time()
        stroke = decide(setup, game, MAX_SPEED, np.random.default_rng([SEED, number, 1]))
        seconds += time.process_time() - begin
        found.append(success(setup, game, stroke, samples, np.random.default_rng([SEED, number])))
    return {"success": found, "seconds": seconds}


def measure(path: Path, output: Path, players: Sequence[str], samples: int) -> dict[str, Any]:
    """Measures the players that have no scores yet, and writes the scores of each as soon as they are known.

    Returns:
        The content of `output`: `machine`, `samples`, `rules` (of each position), and `scores` by player.

    Raises:
        OSError: If a file cannot be read or written.
        ValueError: If a file is not JSON, or a player is unknown.
    """
    entries = json.loads(path.read_text(encoding="utf-8"))["positions"]
    rules = [entry["rules"] for entry in entries]
    found: dict[str, Any] = json.loads(output.read_text(encoding="utf-8")) if output.exists() else {}
    if (found.get("samples"), found.get("rules")) != (samples, rules):
        found = {"machine": machine(), "samples": samples, "rules": rules, "scores": {}}
    for player in players:
        if player not in found["scores"]:
            found["scores"][player] = evaluate(entries, player, samples)
            write_json(output, found)
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table for the page, by name."""
    rules = np.array(found["rules"])
    rows = []
    for player, score in found["scores"].items():
        success = np.array(score["success"])
        share = as_percent({"mean": success.mean(), "interval": mean_interval(score["success"])})
        parts = (f"{success[rules == one].mean():.1%}" for one in COUNTS)
        taken = "-" if player == "answers" else f"{1e3 * score['seconds'] / len(success):.0f} ms"
        rows.append((player, *parts, share, taken))
    head = ("player", *(rules.replace("_", " ") for rules in COUNTS), "all positions", "decision")
    return {"machine": machine_line(found["machine"]), "table": table(head, rows)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.positions --help`."""
    parser = parser_of(
        "positions",
        "Measure the strokes of players in a fixed set of positions.",
        make=(False, "play the games and write the set"),
        set=(SET, "the positions, JSON"),
        output=(OUTPUT, "the scores, JSON"),
        samples=(SAMPLES, "draws of noise for each stroke"),
    )
    parser.add_argument("players", nargs="*", help=f"players of games (default: answers, {', '.join(PLAYERS)})")
    args = parser.parse_args(arguments)

    def work() -> dict[str, Any]:
        if args.make:
            make(args.set)
        return measure(args.set, args.output, args.players or ("answers", *PLAYERS), args.samples)

    report(work, blocks, args.output)


if __name__ == "__main__":
    main()
