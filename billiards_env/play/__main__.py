"""The command line of `python -m billiards_env.play`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from billiards_env.commands import Parser, ending
from billiards_env.drawing.style import PALETTES
from billiards_env.engine.compile import MODES, PIC, Engine
from billiards_env.games import GAMES, History, Setup, opening, records
from billiards_env.games.entry import Game
from billiards_env.play.model import HUMAN, PACES, WindowModel, begin
from billiards_env.players.levels import LEVELS
from billiards_env.players.named import find_player
from billiards_env.scene import SCENES, Scene, layouts
from billiards_env.shots.records import read_scene
from billiards_env.shots.simulation import simulate
from billiards_env.support.checks import Range, entry_of, integer, number, one_of, real
from billiards_env.support.files import check_path, free_path

DT = 1 / 60
"""s. The default timestep of PIT: a game that moves its balls once per frame at 60 frames per second."""

OPPONENT = "planner:club"
"""The default player of all places but the first."""

REAL_SCENES = {"pool": "real_pool"}
"""The scenes of the window in place of the usual scenes of the games: they have jaws and throw."""


def _games(condition: Callable[[Game], object]) -> str:
    """Returns the names of the games that meet a condition."""
    return ", ".join(name for name, game in GAMES.items() if condition(game))


def make_parser() -> argparse.ArgumentParser:
    """Returns the parser of the command line."""
    parser = Parser(
        prog="billiards play" if Path(sys.argv[0]).stem == "billiards" else "python -m billiards_env.play",
        description="Play billiards in a window with mouse and keyboard; H shows the keys.",
    )
    add = parser.add_argument
    layouts_of_games = dict.fromkeys(name for rules in GAMES.values() for name in rules.layouts)
    add("--rules", help=f"the game: {', '.join(GAMES)} (default: eight_ball)")
    levels = ", ".join(f"planner:{level}" for level in LEVELS)
    text = f"the players: human, random, geometric, search[:SHOTS], aim, planner[:TIME], {levels} (levels, the weakest "
    text += "first), noisy:LEVEL:PLAYER, policy:RUN_FOLDER[:PROPOSALS] or module:function[:ARGUMENT] "
    text += f"(default: {HUMAN},{OPPONENT})"
    add("--players", metavar="A,B", help=text)
    text = f"table, balls and physics: {', '.join(SCENES)}, module:name or a JSON file (default: that of the game)"
    add("--scene", help=text)
    any_number = _games(lambda game: len(set(game.n_object_balls)) > 1)
    add("--balls", type=int, help=f"number of object balls, for {any_number} (default: the most)")
    add("--layout", help=f"starting positions: {', '.join(layouts_of_games)} (default: the game's)")
    add("--target", type=int, help=f"the score that wins, for {_games(lambda game: game.target)}")
    text = f"a potted ball counts only if it was called, for {_games(lambda game: game.callable)}"
    add("--call-shot", action="store_true", help=text)
    add(
        "--choices",
        action="store_true",
        help="players have choices other than a shot, such as to push out or to hand back",
    )
    add("--miss", action="store_true", help="snooker with the miss rule; needs --choices")
    add("--edition", help=f"the edition of the rules, for {_games(lambda game: len(game.editions) > 1)}")
    innings = _games(lambda game: "innings" in game.state_names)
    text = f"innings of each player, for {innings} (default: no limit)"
    add("--innings", type=int, help=text)
    add("--max-speed", type=number, default=8.0, help="speed of the fastest shot, m/s (default: %(default)s)")
    add("--mode", help=f"the engine of the game: {' or '.join(MODES)} (default: pic)")
    add("--dt", type=number, default=DT, help="timestep of PIT, s (default: 1/60)")
    add("--load", type=Path, metavar="FILE", help="continue a saved game")
    text = "save to this file with S and at the end, also after an error (default: the loaded file or a new game.json)"
    add("--save", type=Path, metavar="FILE", help=text)
    add("--seed", type=int, help="seed of the rack and of the programs (default: random)")
    add("--speed", type=number, default=1.0, help="playback speed over real time (default: %(default)s)")
    add("--width", type=int, default=1080, help="width of the window, pixels (default: %(default)s)")
    add("--palette", default="realistic", help=f"colours of the balls: {', '.join(PALETTES)} (default: %(default)s)")
    return parser


def make_history(args: argparse.Namespace, rng: np.random.Generator) -> History:
    """Returns the game that the parsed arguments describe: the saved game, or a new one with a rack from `rng`.

    Raises:
        OSError: If the saved game cannot be read.
        ValueError: If the file does not hold a game, or an argument does not suit the game.
    """
    if args.load is not None:
        of_game = ("rules", "scene", "balls", "layout", "target", "mode", "call_shot", "miss", "edition", "innings")
        for option in of_game:
            if all(getattr(args, option) is not off for off in (None, False)):
                raise ValueError(
                    f"--{option.replace('_', '-')} with --load: expected only one of them, the saved game sets it"
                )
        record = records.load(args.load)
        if not isinstance(record, records.GameRecord):
            raise ValueError(f"{args.load} holds a shot: expected a game")
        records.replay(record)  # raises if the result differs on this machine
        return record.history
    if args.miss and not args.choices:
        raise ValueError("--miss without --choices: expected both, the miss rule gives a choice")
    rules = args.rules or "eight_ball"
    game_rules = entry_of("rules", rules, GAMES)
    balls = game_rules.n_object_balls[1] if args.balls is None else args.balls
    named = args.scene or REAL_SCENES.get(game_rules.scene, game_rules.scene)
    scene = read_scene(named, args.balls if named.endswith(".json") else balls)
    n_players = max(2, len(args.players.split(","))) if args.players else 2
    engine = Engine(args.mode, args.dt) if args.mode == "pit" else Engine(args.mode or "pic")
    settings = {"target": args.target, "edition": args.edition, "innings": args.innings or 0}
    setup = Setup(rules, scene, n_players, engine=engine, call_shot=args.call_shot, miss=args.miss, **settings)
    return History(setup, opening(setup, rng, args.layout), ())


def compile_engines(scene: Scene, ghost_dt: float) -> None:
    """Runs a shot with each engine to compile it. A window with a game would not respond during this time."""
    positions = layouts.draw("random", scene, np.random.default_rng(0))
    for engine in (PIC, Engine("pit", ghost_dt)):
        simulate(scene, positions, [0.1, 0.0], engine=engine, record=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m billiards_env.play --help`."""
    args = make_parser().parse_args(arguments)
    with ending():
        if args.save is not None:
            check_path(args.save)
        rng = np.random.default_rng(None if args.seed is None else integer("--seed", args.seed, Range(0, None)))
        history = make_history(args, rng)
        names = (HUMAN, *(OPPONENT,) * (history.setup.n_players - 1))
        if args.players:
            names = tuple(name.strip() for name in args.players.split(","))
        players = [None if name == HUMAN else find_player(name, history.setup, others=(HUMAN,)) for name in names]
        from billiards_env.play.window import GameWindow, wait_for

        one_of("palette", args.palette, tuple(PALETTES))
        pace = real("speed", args.speed, PACES)

        def prepare() -> WindowModel:
            model = begin(history, names, args.max_speed, args.dt, pace, args.choices)
            compile_engines(model.setup.scene, model.ghost_dt)
            return model

        width = integer("width", args.width, "frame_width")
        model = wait_for(prepare, "compiling the engine, up to a minute", width)
        save = args.save or args.load or free_path(Path("game.json"))
        window = GameWindow(model, players, rng, save, width, args.palette)
    print("H shows the keys in the window, F1 the rules.", flush=True)
    window.ask = args.save is None
    try:
        window.run()
    finally:
        if args.save is not None or (window.interrupted and not window.saved):
            window.save()
            print(window.message, flush=True)
    if window.interrupted:
        sys.exit(130)


if __name__ == "__main__":
    main()
