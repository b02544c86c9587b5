"""The command line of `python -m billiards_env.play`."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from billiards_env import records
from billiards_env.games import RULES, History, Setup, opening
from billiards_env.play.model import HUMAN, begin
from billiards_env.players.game_player import find_player
from billiards_env.scene import Scene

DT = 1 / 60
"""s. The timestep of PIT if none is given: that of a game that moves its balls once a frame."""


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    made = argparse.ArgumentParser(
        prog="python -m billiards_env.play",
        description="Play billiards in a window, with the mouse or the keyboard; H shows what does what.",
    )
    made.add_argument("--rules", choices=tuple(RULES), help="the game (default: eight_ball)")
    made.add_argument(
        "--players",
        default=None,
        metavar="A,B",
        help="who plays: human, random, geometric, search[:SHOTS], policy:RUN_FOLDER or module:function[:ARGUMENT] "
        "(default: all human)",
    )
    made.add_argument("--balls", type=int, help="object balls, for straight (default: the game's usual number)")
    made.add_argument("--layout", help="how the balls lie: rack, tight_rack, random or carom_opening")
    made.add_argument("--target", type=int, help="the score that wins, for straight and the carom games")
    made.add_argument("--max-speed", type=_positive, default=8.0, help="fastest shot, m/s (default: %(default)s)")
    made.add_argument("--mode", choices=("pic", "pit"), help="the engine that the game is played by (default: pic)")
    made.add_argument("--dt", type=_positive, default=DT, help="timestep of PIT, in s (default: 1/60)")
    made.add_argument("--load", type=Path, metavar="FILE", help="go on with a saved game")
    made.add_argument(
        "--save",
        type=Path,
        metavar="FILE",
        help="where S saves, and quitting does too (default: S alone saves, to the loaded file or game.json)",
    )
    made.add_argument(
        "--seed", type=int, default=None, help="of the rack and the programs (default: another each time)"
    )
    made.add_argument("--speed", type=_positive, default=1.0, help="how fast shots are shown (default: in real time)")
    made.add_argument("--width", type=int, default=1080, help="pixels (default: %(default)s)")
    return made


def _positive(text: str) -> float:
    """A number of the command line; "1/60" is one too."""
    above, _, below = text.partition("/")
    number, parts = float(above), float(below) if below else 1.0
    if not (0 < number < math.inf and 0 < parts < math.inf):
        raise ValueError
    return number / parts


def start(args: argparse.Namespace, rng: np.random.Generator) -> History:
    """The game that the command line asks for.

    Args:
        args: What `parser` gives.
        rng: Where the rack is drawn from.

    Returns:
        The game so far.

    Raises:
        OSError: If a saved game cannot be read.
        ValueError: If it is none, or an argument does not suit the game.
    """
    if args.load is not None:
        for option in ("rules", "balls", "layout", "target", "mode"):
            if getattr(args, option) is not None:
                raise ValueError(f"--{option} with --load: expected neither, a saved game has its own")
        record = records.load(args.load)
        if not isinstance(record, records.GameRecord):
            raise ValueError(f"{args.load} holds a shot: expected a game")
        records.replay(record)  # refuses a file that this machine plays otherwise
        return record.history
    rules = args.rules or "eight_ball"
    game, mode = RULES[rules], args.mode or "pic"
    balls = game.n_object_balls[1] if args.balls is None else args.balls
    scene = Scene.named("pool" if game.pockets else "carom", balls)
    n_players = max(2, len(args.players.split(","))) if args.players else 2
    setup = Setup(rules, scene, n_players, args.target, mode, args.dt if mode == "pit" else None)
    return History(setup, opening(setup, rng, args.layout), ())


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line; see `python -m billiards_env.play --help`."""
    args = parser().parse_args(arguments)
    rng = np.random.default_rng(args.seed)
    print("H in the window shows what does what.", flush=True)
    try:
        history = start(args, rng)
        names = tuple(args.players.split(",")) if args.players else (HUMAN,) * history.setup.n_players
        players = [None if name == HUMAN else find_player(name, history.setup) for name in names]
        from billiards_env.play.window import GameWindow, pygame
    except (ModuleNotFoundError, OSError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    try:
        model = begin(history, names, args.max_speed, args.dt, args.speed)
        save = args.save or args.load or Path("game.json")
        window = GameWindow(model, players, rng, save, args.width)
    except (pygame.error, ValueError) as error:
        sys.exit(f"error: {error}")
    window.run()
    if args.save is not None:
        window.save()
        print(window.note)


if __name__ == "__main__":
    main()
