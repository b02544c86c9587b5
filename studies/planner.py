"""Measures the player "planner" under execution noise: `python -m studies.planner`.

* Run-outs: racks of nine ball on `real_pool` that are won from the break without losing the turn. "planner" plays for a
  run-out (`run_out=True`). It chooses the place of the cue ball and the break by simulations of the actual rack.
* Fixed break: run-outs in which all racks have the same break stroke. Without english: run-outs on `pool`. Eight ball:
  run-outs in eight ball.
* Matches: eight ball on `real_pool` against other players. The player who breaks is drawn at random.
* Straight pool, snooker, three-cushion: the points of one turn from random positions; straight pool over several racks.
* One ball: `Billiards-v0` with its default arguments, one shot at one ball from a random layout, without english.
* Levels: the levels of the planner, such as "planner:club", each at one ball and in matches against the level below it.
  The noise is the noise of the levels.

Each player gets the size of the noise as an argument. The results are in `studies/results/planner.json`, written after
each rack. The command continues after an interruption. A larger number of `--racks` adds racks. Players with a time
limit have other results on another machine.
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from benchmarks import machine, machine_line, new_figure, run_command, save, table
from billiards_env.bench.evaluation import measure as play_alone
from billiards_env.games import GAMES, GameState, PlayedShot, Setup, Stroke, custom_opening, opening, play
from billiards_env.players.levels import LEVELS, with_noise
from billiards_env.players.named import find_player
from billiards_env.players.planner import parse_budget
from billiards_env.players.situation import Player, game_situation
from billiards_env.scene import Scene
from billiards_env.support.files import write_json
from billiards_env.support.intervals import mean_interval, success_rate, wilson_interval
from studies import RESULTS, resumed

OUTPUT = RESULTS / "planner.json"
RACKS, SEED, MAX_SPEED, MAX_SHOTS = 100, 30, 8.0, 200
MAX_POINTS = 150
"""The largest number of shots in a turn, and the target score of straight pool.

With a target, balls are racked again."""

ONE_BALL = 10
"""Episodes that count as one rack."""

OLYMPIAD = (0.125, 0.075)
"""The noise of the Computer Olympiad (Smith 2007, PickPocket: A computer billiards shark): degrees and m/s."""

FIXED_BREAK = Stroke((4.825, 1.654), (-0.831, -0.532))
"""A break from near a long cushion, chosen from 1,600 random breaks. On 60 racks that the study does not use it was
among the breaks that kept the turn most often."""

PLANNER = "planner:100ms"
"""The player of the matches."""

EQUAL_TIME = "search:24000"
"""The search whose decisions in eight ball take the same processor time as the decisions of `PLANNER`, see `times`."""

LEAST = "planner:0.001ms"
"""A planner whose decisions take the least time."""

LAYOUTS = 40
"""The number of layouts in which the time of a decision is measured."""


class Cell(NamedTuple):
    """What is measured.

    Attributes:
        experiment: An entry of `EXPERIMENTS`.
        noise: Standard deviations of the direction, degrees, and of the speed, m/s.
        player: The player, in matches the opponent.
        share: Its number of racks, as a share of `--racks`.
    """

    experiment: str
    noise: tuple[float, float]
    player: str
    share: float = 1.0


CELLS: tuple[Cell, ...] = (
    *(Cell("run-outs", noise, PLANNER) for noise in ((0.057, 0.0), OLYMPIAD, (0.03, 0.0), (0.5, 0.075))),
    Cell("one ball", OLYMPIAD, PLANNER, 0.1),
    Cell("matches", OLYMPIAD, EQUAL_TIME),
    Cell("matches", OLYMPIAD, "geometric"),
    Cell("eight ball", OLYMPIAD, PLANNER),
    *(Cell(name, noise, PLANNER) for name in ("fixed break", "without english") for noise in ((0.057, 0.0), OLYMPIAD)),
    *(Cell(name, OLYMPIAD, PLANNER) for name in ("straight pool", "snooker", "three-cushion")),
    *(
        Cell("run-outs", noise, f"planner:{time}", share)
        for time, share in (("10ms", 0.1), ("30ms", 0.1), ("300ms", 0.1), ("1s", 0.04), ("3s", 0.02))
        for noise in ((0.057, 0.0), OLYMPIAD)
    ),
    *(Cell("run-outs", noise, "search:1000", 0.1) for noise in ((0.03, 0.0), (0.057, 0.0), OLYMPIAD)),
    Cell("one ball", OLYMPIAD, "search:1000", 0.1),
    *(Cell("one ball", (0.0, 0.0), f"planner:{level}", 0.05) for level in LEVELS),
    *(Cell("levels", (0.0, 0.0), f"planner:{level}", 0.1) for level in list(LEVELS)[1:]),
)
"""The cells of the tables, the most interesting first."""


def shoot(
    setup: Setup, game: GameState, player: Player, noise: tuple[float, float], rngs: Sequence[Any], **changes: Any
) -> PlayedShot:
    """Plays one shot with noise; `rngs` are the generators of the player and of the noise.

    `changes` are other fields of the situation.
    """
    stroke = player(game_situation(setup, game, MAX_SPEED, noise)._replace(**changes), rngs[0])
    return play(setup, game, with_noise(stroke, noise, MAX_SPEED, rngs[1]))


def run_out(
    player: str,
    noise: tuple[float, float],
    rng: np.random.Generator,
    rules: str = "nine_ball",
    scene: str = "real_pool",
    fixed_break: Stroke | None = None,
) -> dict[str, Any]:
    """Plays one rack until the turn is lost.

    Returns:
        `success`, `strokes`, and `kept`: whether the turn goes on after the break.
    """
    setup = Setup(rules, Scene.named(scene, GAMES[rules].n_object_balls[1]))
    game, rngs, strokes, kept = opening(setup, rng), rng.spawn(2), 0, False
    chosen = find_player(player, setup)
    while not game.state.over and game.state.player == 0:
        if fixed_break and strokes == 0:
            game = play(setup, game, with_noise(fixed_break, noise, MAX_SPEED, rngs[1])).game
        else:
            game = shoot(setup, game, chosen, noise, rngs, run_out=True, strike=scene != "pool").game
        strokes += 1
        if strokes == 1:
            kept = bool(game.state.over or game.state.player == 0)
    return {"success": bool(game.state.winner == 0), "strokes": strokes, "kept": kept}


def turn(
    player: str,
    noise: tuple[float, float],
    rng: np.random.Generator,
    rules: str,
    balls: int,
    scene: str,
    target: int | None = None,
) -> dict[str, Any]:
    """Plays one turn from random positions of all balls. Returns `points` and `strokes`."""
    setup = Setup(rules, Scene.named(scene, balls), target=target)
    game, rngs, strokes = opening(setup, rng, "random"), rng.spawn(2), 0
    chosen = find_player(player, setup)
    while not game.state.over and game.state.player == 0 and strokes < MAX_POINTS:
        game, strokes = shoot(setup, game, chosen, noise, rngs, run_out=True).game, strokes + 1
    return {"points": int(game.state.scores[0]), "strokes": strokes}


def match(opponent: str, noise: tuple[float, float], rng: np.random.Generator, player: str = PLANNER) -> dict[str, Any]:
    """Plays one rack of eight ball; who breaks is drawn. Returns `success`, whether `player` wins, and `strokes`."""
    setup = Setup("eight_ball", Scene.named("real_pool", 15))
    names = [player, opponent]
    first = int(rng.integers(2))
    players = [find_player(names[(first + k) % 2], setup) for k in range(2)]
    game, rngs, strokes = opening(setup, rng), rng.spawn(2), 0
    while not game.state.over and strokes < MAX_SHOTS:
        game, strokes = shoot(setup, game, players[game.state.player], noise, rngs).game, strokes + 1
    return {"success": bool(game.state.over and (first + game.state.winner) % 2 == 0), "strokes": strokes}


def level_match(player: str, noise: tuple[float, float], rng: np.random.Generator) -> dict[str, Any]:
    """Plays one rack of eight ball against the level below; see `match`."""
    levels = [f"planner:{level}" for level in LEVELS]
    return match(levels[levels.index(player) - 1], noise, rng, player)


def one_ball(player: str, noise: tuple[float, float], rng: np.random.Generator) -> dict[str, Any]:
    """Plays `ONE_BALL` episodes of `Billiards-v0`. Returns `success`, the number of pots, and `strokes`."""
    played = play_alone(player, {}, noise, ONE_BALL, int(rng.integers(2**31)))
    return {"success": played["successes"], "strokes": ONE_BALL}


EXPERIMENTS: dict[str, Callable[..., dict[str, Any]]] = {
    "run-outs": run_out,
    "fixed break": functools.partial(run_out, fixed_break=FIXED_BREAK),
    "without english": functools.partial(run_out, scene="pool"),
    "eight ball": functools.partial(run_out, rules="eight_ball"),
    "matches": match,
    "one ball": one_ball,
    "levels": level_match,
    "straight pool": functools.partial(turn, rules="straight", balls=15, scene="real_pool", target=MAX_POINTS),
    "snooker": functools.partial(turn, rules="snooker", balls=21, scene="snooker"),
    "three-cushion": functools.partial(turn, rules="three_cushion", balls=2, scene="real_carom"),
}
"""A function `(player, noise, rng)` for each experiment."""


def measure(output: Path, racks: int) -> dict[str, Any]:
    """Plays the racks that are missing in `output`, and writes the results after each of them.

    The JSON file `output` has `machine`, `settings`, `results[experiment][noise][player]`: one entry for each rack, and
    `times`, see `times`.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    data = resumed(output, {"seed": SEED, "max_speed": MAX_SPEED}, results={})
    numbers = [
        len(data["results"].get(cell.experiment, {}).get(_name(cell.noise), {}).get(cell.player, [])) for cell in CELLS
    ]
    missing = [max(0, math.ceil(racks * cell.share) - n) for cell, n in zip(CELLS, numbers, strict=True)]
    with tqdm(total=sum(missing), unit="rack") as bar:
        for rack, cell in itertools.product(range(racks), CELLS):
            experiment, noise, player, share = cell
            name = _name(noise)
            played = data["results"].setdefault(experiment, {}).setdefault(name, {}).setdefault(player, [])
            if len(played) < math.ceil((rack + 1) * share):
                bar.set_description(f"{experiment}, {name}, {player}")
                _compile(experiment)
                played.append(EXPERIMENTS[experiment](player, noise, np.random.default_rng([SEED, len(played)])))
                write_json(output, data)
                bar.update()
    if "times" not in data:
        data["times"] = times()
    return data


@functools.cache
def _compile(experiment: str) -> None:
    """Plays a rack that does not count, so that no decision includes compilation."""
    if experiment != "levels":  # their budgets are numbers of shots
        player = "random" if experiment == "matches" else "planner:1500"
        EXPERIMENTS[experiment](player, OLYMPIAD, np.random.default_rng(0))


def _name(noise: tuple[float, float]) -> str:
    return f"{noise[0]:g} degrees, {noise[1]:g} m/s"


def times() -> dict[str, Any]:
    """Returns `machine`, and for some `players` the median processor time of a decision, `seconds`.

    The layouts are random, in eight ball with 15 to 1 object balls.
    """
    eight_ball, snooker = (
        Setup("eight_ball", Scene.named("real_pool", 15)),
        Setup("snooker", Scene.named("snooker", 21)),
    )
    result: dict[str, Any] = {"machine": machine(), "players": []}
    for setup, name in ((eight_ball, PLANNER), (eight_ball, EQUAL_TIME), (eight_ball, LEAST), (snooker, LEAST)):
        player, taken = find_player(name, setup), []
        for k in range(-1, LAYOUTS):  # the first one compiles
            rng = np.random.default_rng([SEED, k + 1])
            lying = {0, 8, *(1 + rng.permutation(15)[: 15 - k % 15]).tolist()}
            game = opening(setup, rng, "random")
            if setup is eight_ball:
                game = custom_opening(setup, game.positions, {"on_table": sorted(lying)})
            begin = time.thread_time()
            player(game_situation(setup, game, MAX_SPEED, OLYMPIAD), rng)
            taken.append(time.thread_time() - begin)
        result["players"].append({"player": name, "game": setup.rules, "seconds": float(np.median(taken[1:]))})
    return result


_HEADS = {
    "run-outs": ("racks", "run-outs", "turn kept after the break", "strokes"),
    "matches": ("racks", "racks won by the planner", "strokes"),
    "one ball": ("shots", "pots"),
    "levels": ("racks", "racks won against the level below", "strokes"),
    "turns": ("turns", "mean points", "most points", "strokes"),
}
_RUN_OUTS = "run-outs", "fixed break", "without english", "eight ball"


def blocks(data: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    timed = [
        (t["player"], t["game"].replace("_", " "), f"{1e3 * t['seconds']:.3g} ms") for t in data["times"]["players"]
    ]
    made = {"times": table(("player", "game", "decision, median"), timed, left=2)}
    made["times machine"] = machine_line(data["times"]["machine"])
    for experiment, noises in data["results"].items():
        rows = [
            (noise, player, *_row(experiment, played))
            for noise, players in noises.items()
            for player, played in sorted(players.items(), key=lambda entry: _order(entry[0]))
        ]
        kind = experiment if experiment in _HEADS else "run-outs" if experiment in _RUN_OUTS else "turns"
        first = "noise", "opponent" if experiment == "matches" else "player"
        made[experiment] = table((*first, *_HEADS[kind]), rows, left=2)
    return made


def _order(player: str) -> tuple[bool, float]:
    """Returns a key that sorts planners by their time, and then other players."""
    name, _, argument = player.partition(":")
    if name != "planner":
        return True, 0.0
    return False, list(LEVELS).index(argument) if argument in LEVELS else parse_budget(argument)[0]


def _row(experiment: str, played: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    strokes = f"{np.mean([rack['strokes'] for rack in played]):.1f}"
    if "points" in played[0]:
        points = [float(rack["points"]) for rack in played]
        low, high = mean_interval(points) or (math.nan, math.nan)
        return str(len(played)), f"{np.mean(points):.2f} ({low:.2f} to {high:.2f})", f"{max(points):.0f}", strokes
    share = _share(played, ONE_BALL if experiment == "one ball" else 1)
    if experiment not in _RUN_OUTS:
        return share if experiment == "one ball" else (*share, strokes)
    return (*share, f"{np.mean([rack['kept'] for rack in played]):.0%}", strokes)


def _share(played: Sequence[Mapping[str, Any]], of: int = 1) -> tuple[str, str]:
    """Returns the number of attempts, `of` in each entry, and the share of successes with its interval."""
    won, count = sum(rack["success"] for rack in played), len(played) * of
    return str(count), success_rate(won, count)


PUBLISHED = (
    ("professional players: 15 to 43%", 0.15, 0.43),
    ("C++ planner, 0.03 degrees: 11 to 18%", 0.11, 0.18),
    ("C++ planner, 0.52 degrees: 1 to 3%", 0.01, 0.03),
)
"""Shares of break and run in nine ball by a C++ program and by players of tournaments, see `docs/planner.md`."""


_FEWEST = 5
"""The picture shows only players with at least this number of racks."""

_BUDGETS = (10, 30, 100, 300, 1000, 3000)


def draw(data: Mapping[str, Any], folder: Path) -> None:
    """Draws the run-outs of nine ball against the time of a decision."""
    figure = new_figure(8.0, 4.2)
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    for (label, low, high), colour in zip(PUBLISHED, ("0.85", "0.6", "0.4"), strict=True):
        axes.axhspan(100 * low, 100 * high, color=colour, alpha=0.6, label=label, linewidth=0)
    for noise, players in data["results"]["run-outs"].items():
        ends = []
        for player, played in players.items():
            if player.startswith("planner") and len(played) >= _FEWEST:
                won, count = sum(rack["success"] for rack in played), len(played)
                ends.append((_order(player)[1], won / count, *wilson_interval(won, count)))
        if not ends:
            continue
        seconds, share, low, high = (100 * np.array(column) for column in zip(*sorted(ends), strict=True))
        reach = np.maximum((share - low, high - share), 0.0)
        axes.errorbar(10 * seconds, share, reach, fmt="o-", capsize=3, label=f"planner, {noise}")
    axes.set_xscale("log")
    axes.set_xticks(_BUDGETS, [str(budget) for budget in _BUDGETS], minor=False)
    axes.minorticks_off()
    axes.set(xlabel="processor time of a decision, ms", ylabel="break and run, %", ylim=(0, 100))
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
    save(figure, folder / "planner_budget.png")


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.planner --help`."""
    options = {"output": (OUTPUT, "JSON file"), "racks": (RACKS, "racks of a row with a full share")}
    run_command("studies.planner", "Measure the planner under noise.", arguments, measure, blocks, options, draw)


if __name__ == "__main__":
    main()
