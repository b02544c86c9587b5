"""The commands `billiards` and `python -m billiards_env`. Each command imports only the modules that it uses."""

from __future__ import annotations

import argparse
import itertools
import secrets
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from billiards_env import Scene, __version__
from billiards_env.bench.frozen import BENCH_TASKS, FROZEN
from billiards_env.commands import Parser, all_jobs, ending
from billiards_env.export import WRITERS, shot_text
from billiards_env.scene import SCENES
from billiards_env.support.checks import MAX_SPEED, Range, entry_of, finite, integer, number, numbers, one_of, real
from billiards_env.support.files import check_path, write_atomically

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from billiards_env.shots.result import ShotResult

    Floats = NDArray[np.float64]

_ANGLES = {"heading": Range(-360.0, 360.0, "degrees"), "elevation": Range(0.0, 90.0, "degrees")}
_SPEED = Range(0.0, MAX_SPEED, "m/s")
_EPISODES = Range(1, 10_000_000)  # gigabytes of memory

FASTEST = 16.0
"""m/s. The hardest breaks; see "speed" in `checks.RANGES`."""

PLAY_PAGE = Path(__file__).with_name("play") / "play.html"
"""The page that `web` opens. `docs.web.build` writes it."""


def make_parser() -> argparse.ArgumentParser:
    """Returns the parser of the command line."""
    parser = Parser(
        prog="billiards" if Path(sys.argv[0]).stem == "billiards" else "python -m billiards_env",
        description=f"billiards-env {__version__}: gym.make('billiards_env:Billiards-v0') makes the environment.",
        epilog="'--help' after a command lists its options. Training and benchmarks run from a clone of the "
        "repository, where 'make' lists them.",
    )
    parser.add_argument("--version", action="version", version=f"billiards-env {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="command", title="commands")
    commands.add_parser("play", add_help=False, help="play in a window, against people or programs")
    for add, run, text in (
        (_add_simulate, simulate, "run one shot, print the result and write pictures or films"),
        (_add_evaluate, evaluate, "measure a player in the environment, next to other players"),
        (_add_match, match, "play games between players, and rate them"),
        (_add_bench, bench, "play frozen tasks and write a file that can be replayed, or replay it"),
        (_add_replay, replay, "run a saved shot or game again, and show it"),
        (_add_calibrate, calibrate, "fit friction and other constants to tracks of shots"),
        (_add_web, web, "open a page that plays shots in a browser"),
        (_add_doctor, doctor, "print versions and caches, and compare shots with the published results, bit for bit"),
        (
            _add_cache,
            cache,
            "compile code in advance, print the folder of the compiled code and its size, or delete it",
        ),
    ):
        command = commands.add_parser(run.__name__, help=text)
        command.set_defaults(run=run)
        add(command)
    return parser


def _add_simulate(parser: argparse.ArgumentParser) -> None:
    parser.description = "Run one shot. Lengths are in metres from the centre of the table, x along its length."
    add = parser.add_argument
    add(
        "--scene",
        default="real_pool",
        help=f"the scene: {', '.join(SCENES)}, module:name or a JSON file (default: %(default)s)",
    )
    add("--balls", type=int, metavar="N", help="number of object balls (default: the scene's)")
    add(
        "--layout",
        default="random",
        help="starting positions: random, rack, tight_rack, nine_ball, nine_ball_2025, ten_ball, eight_ball, "
        "carom_opening, line, snookered or snooker (default: %(default)s)",
    )
    add("--seed", type=int, default=0, help="seed of the layout (default: %(default)s)")
    add("--positions", type=number, nargs="+", metavar="X", help="x and y of each ball, cue ball first; no --layout")
    add("--velocity", type=number, nargs=2, metavar=("VX", "VY"), help="of the cue ball, m/s (default: 2, to ball 1)")
    add("--spin", type=number, nargs=3, metavar=("WX", "WY", "WZ"), help="of the cue ball, rad/s (default: no spin)")
    add("--speed", type=number, help="strike with a cue of this speed, m/s, in place of --velocity and --spin")
    add(
        "--heading",
        type=number,
        help="direction of the cue in degrees (in Python: rad) from the x axis (default: to ball 1)",
    )
    text = "aim at a goal, in place of the options of the cue and the ball: pot:BALL[:POCKET], bank:BALL[:POCKET], "
    text += "leave:X:Y[:RADIUS], touch:BALL, first_touch:BALL or cushions:LEAST[:BEFORE]; several --goal are possible"
    add("--goal", action="append", help=text)
    add("--side", type=number, help="offset of the tip to the left, in ball radii (default: 0)")
    add("--top", type=number, help="offset of the tip above the centre, in ball radii (default: 0)")
    add(
        "--elevation",
        type=number,
        help="angle of the cue above the horizontal in degrees (in Python: rad) (default: 0)",
    )
    add("--mode", default="pic", help="the engine: pic or pit (default: %(default)s)")
    add("--dt", type=number, help="timestep of pit, s, such as 1/60")
    add("--fix", help="how pit treats overlaps: push_apart, move_back, none or time_of_impact")
    add("--max-time", type=number, help="time at which the shot ends, s")
    _add_out(parser)


def _add_evaluate(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Measure players in Billiards-v0, on layouts that training never uses. A player is module:function for a "
        "function that makes the player, policy:FOLDER for a run of agents.train, policy:FOLDER:K (the best of K "
        "actions that it proposes), random, geometric, "
        "search:K (simulates K shots), aim (computes shots), planner:TIME (plans under noise) or a level such as "
        "planner:club (its strokes are noisy), or noisy:LEVEL:PLAYER (another player with this noise). If the first "
        "player is the policy of a run with the same task, the other arguments of the environment are those of the run."
    )
    add = parser.add_argument
    add("player", nargs="+", help="a player, such as mine:player for that of the function player of mine.py")
    add(
        "--beside",
        nargs="*",
        default=["random", "geometric", "search:200"],
        metavar="PLAYER",
        help="players to compare with (default: random geometric search:200)",
    )
    add("--task", help="the task, such as pot, carom, nine_ball or module:name (default: pot)")
    add("--scene", help=f"the scene: {', '.join(SCENES)}, module:name or a JSON file (default: the task's)")
    add("--balls", type=int, metavar="N", dest="n_object_balls", help="number of object balls (default: the task's)")
    add("--layout", help="starting positions (default: the task's)")
    add("--action", help="velocity or strike (default: the task's)")
    add("--max-shots", type=int, help="most shots of an episode (default: the task's)")
    add("--mode", help="the engine: pic or pit (default: pic)")
    add("--dt", type=number, help="timestep of pit, s, such as 1/60")
    add(
        "--noise",
        type=number,
        nargs=2,
        default=(0.0, 0.0),
        metavar=("DEGREES", "SPEED"),
        help="execution noise: standard deviations of the direction and of the speed, m/s (default: none)",
    )
    add("--episodes", type=int, default=1000, help="number of episodes (default: %(default)s)")
    add("--seed", type=int, default=0, help="seed of the layouts (default: %(default)s)")


def _add_match(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Play games between each two of the players, who break in turn. The share of won games is that of the games "
        "with a winner. With more than two players a table has their Elo ratings. Players: as for play."
    )
    add = parser.add_argument
    add("player", nargs="+", help="the players, such as planner:club search:200")
    add("--rules", default="eight_ball", help="the game (default: %(default)s)")
    add("--scene", help=f"the scene: {', '.join(SCENES)}, module:name or a JSON file (default: the game's)")
    add("--games", type=int, default=200, help="games of each two players (default: %(default)s)")
    add("--max-shots", type=int, help="most shots of a game, which then has no winner (default: the game's)")
    add("--seed", type=int, default=0, help="seed of the racks and of the players (default: %(default)s)")
    add("--out", type=Path, metavar="FILE", help="save the results in this .json file; the same command resumes")


def _add_bench(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Play 1,000 layouts of frozen tasks and write a file with all actions and outcomes, or check files: 'billiards "
        "bench verify FILE' plays the actions again and fails if any bit differs. In tasks with noise it also prints "
        "scores with new noise: of the actions in tasks of one shot, of the player of --again in longer tasks. "
        "Players: as for evaluate."
    )
    add = parser.add_argument
    add("player", help="a player, such as search:200 or mine:player, or the word verify")
    add("file", type=Path, nargs="*", help="the files to verify")
    add("--tasks", default=",".join(BENCH_TASKS), help="ids, separated by commas (default: %(default)s)")
    add(
        "--seed",
        type=int,
        nargs="+",
        default=[0],
        metavar="N",
        help="seeds of the layouts (default: 0, the public ones)",
    )
    text = "seed of the noise (default: the seed of the layouts; for verify a random one)"
    add("--noise-seed", type=int, metavar="N", help=text)
    add("--again", metavar="PLAYER", help="with verify: the player that plays longer tasks again, with new noise")
    add("--name", help="the name of the player in the file (default: the player)")
    text = "write the file, .json; FILE.part holds the finished tasks, and the same command resumes"
    add("--out", type=Path, metavar="FILE", help=text)
    add("--force", action="store_true", help="replace an existing file, and do not resume")


def _add_replay(parser: argparse.ArgumentParser) -> None:
    parser.description = "Run a saved shot or game again. It is an error if the result does not have the same bits."
    parser.add_argument("file", type=Path, help="a file of 'simulate --out shot.json', of a game, or of shot.save")
    parser.add_argument("--shot", type=int, metavar="K", help="the shot of a game, from 1 (default: the last)")
    parser.add_argument("--window", action="store_true", help="show the shot, or all shots of a game, in a window")
    _add_out(parser)


def _add_calibrate(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Fit constants of physics to tracks of shots: a CSV file with the columns shot, time (s), ball, x and y (m "
        "from the centre of the table, x along its length), or a JSON file. The ball that moves first is the cue ball."
    )
    add = parser.add_argument
    add("tracks", type=Path, help="the file")
    text = "first write simulated tracks to the file, with constants 5%% smaller than those of the scene; then fit them"
    add("--example", action="store_true", help=text)
    add(
        "--scene",
        default="pool",
        help=f"{', '.join(SCENES)}, module:name or a JSON file of a scene (default: %(default)s)",
    )
    add("--balls", type=int, metavar="N", help="number of object balls (default: those in the file)")
    add("--free", nargs="+", metavar="CONSTANT", help="the constants (default: friction and restitution)")
    add("--unit", default="m", help="unit of x and y: m, cm, mm, in or px (default: %(default)s)")
    add("--fps", type=number, help="frames per second of a file that has frame numbers (column frame) instead of times")
    text = "headings of a CSV file with other headings, such as ball=object,x=pos_x"
    add("--columns", default="", metavar="NAME=HEADING,...", help=text)
    add("--frame", choices=["fit"], help="fit the frame of the file to rebounds, in any unit")
    add("--noise", type=number, help="standard deviation of a coordinate, m (default: an estimate)")
    add("--contacts", type=int, default=4, help="fit rows until this contact of the cue ball (default: %(default)s)")
    text = "write the report: .json, or a picture .png, .svg or .pdf"
    add("--out", type=Path, action="append", default=[], metavar="FILE", help=text)


def _add_web(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Open a page in a browser that plays each shot with the exact engine and with a timestep. The page is one file "
        "with both engines, and needs neither a network nor Python."
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the page to this .html file, do not open it")


def _add_doctor(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Print what a report of a bug needs: versions, the processor and the compiled code. Then play 100 shots in "
        "each of some frozen tasks, and compare hashes of the results with the published ones; exit 1 if any differs."
    )
    parser.add_argument("--all", action="store_true", help="play all frozen tasks and games; takes minutes")


def _add_cache(parser: argparse.ArgumentParser) -> None:
    parser.description = "Compile code in advance, and print the folder of the compiled code and its size."
    text = f"what to compile: a scene ({', '.join(SCENES)}), planner, derivatives, common, environments, or all"
    parser.add_argument("part", nargs="*", help=text)
    parser.add_argument("--clear", action="store_true", help="delete the compiled code; the next run compiles again")


def _add_out(parser: argparse.ArgumentParser) -> None:
    text = f"write the shot to a file; its suffix is one of {' '.join(WRITERS)}"
    parser.add_argument("--out", type=Path, action="append", default=[], metavar="FILE", help=text)


def simulate(args: argparse.Namespace) -> None:
    """Runs the command `simulate`."""
    from billiards_env.engine import Engine
    from billiards_env.scene import layouts
    from billiards_env.shots import simulation
    from billiards_env.shots.records import read_scene

    _check_out(args.out)
    scene = read_scene(args.scene, args.balls)
    if args.positions is None:
        positions = layouts.draw(
            args.layout, scene, np.random.default_rng(integer("--seed", args.seed, Range(0, None)))
        )
    elif len(args.positions) != 2 * scene.n_balls:
        raise ValueError(
            f"--positions with {len(args.positions)} numbers: expected {2 * scene.n_balls}, x and y of {scene.n_balls} "
            "balls"
        )
    else:
        positions = finite("--positions", args.positions, (2 * scene.n_balls,)).reshape(-1, 2)
    velocity, spin, notes = _cue_ball(args, scene, positions)
    engine = Engine(args.mode, args.dt, args.fix)
    options = {"engine": engine, "max_time": args.max_time}
    shot = simulation.simulate(scene, positions, velocity, spins=spin, record=True, **options)
    _write_shot(shot, args.out, notes)


def _cue_ball(args: argparse.Namespace, scene: Scene, positions: Floats) -> tuple[Any, Any, list[str]]:
    """Returns the velocity and the spin of the cue ball that the arguments of `simulate` describe, and notes."""
    from billiards_env.engine.strikes import strike

    aim = positions[min(1, scene.n_balls - 1)] - positions[0]
    stroke = {name: getattr(args, name) for name in ("heading", "side", "top", "elevation")}
    cue = {name: value for name, value in stroke.items() if value is not None}
    for name in _ANGLES.keys() & cue.keys():
        cue[name] = np.deg2rad(real(f"--{name}", cue[name], _ANGLES[name]))
    if args.goal:
        from billiards_env.players import aim as aims

        if other := [name for name in ("velocity", "spin", "speed", *stroke) if getattr(args, name) is not None]:
            raise ValueError(f"--goal with --{other[0]}: expected only one of them")
        aimed = aims.aim(scene, positions, [aims.goal_named(text) for text in args.goal])
        found = "the goals are reached" if aimed.solved else "no shot reaches the goals, the nearest one follows"
        return aimed.velocity, None, [f"--velocity {' '.join(map(str, aimed.velocity.tolist()))}: {found}"]
    if args.speed is None:
        if cue:
            raise ValueError(f"--{next(iter(cue))} without --speed: expected the speed of the cue")
        velocity = 2.0 * aim / np.hypot(*aim) if aim.any() else (2.0, 0.0)
        return args.velocity or velocity, args.spin, _notes(scene, args.velocity or velocity, args.spin)
    if args.velocity or args.spin:
        raise ValueError("--speed with --velocity or --spin: expected the motion either of the cue or of the ball")
    cue = {"heading": np.arctan2(aim[1], aim[0]), "side": 0.0, "top": 0.0, "elevation": 0.0, **cue}
    struck = strike(scene, real("--speed", args.speed, _SPEED), **cue)
    heading, elevation = (f"{np.rad2deg(cue[name]):.6g} degrees ({cue[name]:.4g} rad)" for name in _ANGLES)
    tip = f"side {cue['side']:g} R, top {cue['top']:g} R"
    stroke = f"stroke: {args.speed:g} m/s, heading {heading}, {tip}, elevation {elevation}"
    slips = ["the tip slips on the ball: a miscue"] * bool(struck.miscue)
    return struck, None, [stroke, *slips, *_notes(scene, struck.velocity, struck.spin)]


def _notes(scene: Scene, velocity: Any, spin: Any) -> list[str]:
    """Returns a line if the cue ball is too fast for a cue, and one if its side spin throws no ball."""
    speed, notes = np.hypot(*numbers("velocities", velocity)[:2]), []
    if speed > FASTEST:
        notes.append(f"the cue ball begins at {speed:.3g} m/s: a break is 10 to 12 m/s")
    smooth = scene.physics.ball_ball == "frictionless"
    if smooth and spin is not None and numbers("spins", spin)[2] != 0 and scene.n_balls > 1:
        notes.append("the balls of this scene have no friction: english throws no ball, unlike in --scene real_pool")
    return notes


def evaluate(args: argparse.Namespace) -> None:
    """Runs the command `evaluate`."""
    import gymnasium as gym

    from billiards_env.bench.evaluation import find_player, measure, row_printer
    from billiards_env.shots.records import read_scene

    names = ("task", "scene", "n_object_balls", "layout", "action", "max_shots", "mode", "dt")
    arguments = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    if args.scene is not None and args.scene.endswith(".json"):
        arguments["scene"] = read_scene(args.scene)
    arguments = _of_run(args.player[0], arguments)
    episodes, seed = integer("--episodes", args.episodes, _EPISODES), integer("--seed", args.seed, Range(0, None))
    noise = real("--noise[0]", args.noise[0], "angle_std"), real("--noise[1]", args.noise[1], "speed_std")
    players = [*args.player, *(player for player in args.beside if player not in args.player)]
    env = gym.make("billiards_env:Billiards-v0", **arguments)
    for player in players:  # a wrong name is an error before the first player plays
        find_player(player, env)
    show = row_printer(players, details=True)
    with all_jobs() as job:
        for player in players:
            shots = itertools.count(1)

            def progress(player: str = player, shots: Iterator[int] = shots) -> None:
                number = next(shots)
                if sys.stderr.isatty() and number % 100 == 0:
                    print(f"{player}: {number:,} shots", end="\r", file=sys.stderr)

            with job(player):
                show(player, measure(player, arguments, noise, episodes, seed, progress))


def match(args: argparse.Namespace) -> None:
    """Runs the command `match`."""
    from billiards_env.bench.match import play_pairs, table
    from billiards_env.games import GAMES
    from billiards_env.shots.records import read_scene

    if len(set(args.player)) < max(2, len(args.player)):
        raise ValueError(f"player = {' '.join(args.player)}: expected at least two players, each once")
    entry_of("rules", args.rules, GAMES)
    count = integer("--games", args.games, _EPISODES)
    seed = integer("--seed", args.seed, Range(0, 2**31 // count - 1))
    if args.out is not None:
        check_path(args.out, ".json")
    given = {"scene": args.scene, "max_shots": args.max_shots}
    arguments = {"task": args.rules, "n_players": 2} | {name: value for name, value in given.items() if value}
    if args.scene is not None and args.scene.endswith(".json"):
        arguments["scene"] = read_scene(args.scene).to_dict()
    begin = time.perf_counter()

    def progress(pair: str, games: int) -> None:
        if sys.stderr.isatty():
            print(f"{pair}: {games} of {count} games, {time.perf_counter() - begin:.0f} s ", end="\r", file=sys.stderr)

    results = play_pairs(args.player, count, arguments, seed, args.out, progress)
    print(*table(results), sep="\n")


def _of_run(player: str, given: dict[str, Any]) -> dict[str, Any]:
    """Returns the arguments of the environment: those of the run of a policy, if it has the given task, and the given.

    A given scene has its own balls and layout.
    """
    if not player.startswith("policy:"):
        return given
    from billiards_env.sb3.policy_player import arguments_of_run

    of_run = arguments_of_run(player)
    if given.get("task", of_run.get("task")) != of_run.get("task"):
        return given
    for name in ("n_object_balls", "layout") if "scene" in given else ():
        of_run.pop(name, None)
    print(f"other arguments of the environment: those of {player}", flush=True)
    return of_run | given


def bench(args: argparse.Namespace) -> None:
    """Runs the command `bench`."""
    from billiards_env.bench import benchmark as bench

    if args.player == "verify":
        if not args.file:
            raise ValueError("bench verify without a file: expected the files to verify")
        noise_seed = secrets.randbits(63) if args.noise_seed is None else args.noise_seed
        with all_jobs() as job:
            for path in args.file:
                with job(str(path)):
                    _verify(path, noise_seed, args.again)
        return
    if args.file:
        raise ValueError(f"file = {str(args.file[0])!r} after a player: expected the word verify before files")
    if args.again is not None:
        raise ValueError(f"--again = {args.again!r} without verify: expected bench verify FILE --again PLAYER")
    part = None
    if args.out is not None:
        part = check_path(args.out, ".json").with_suffix(".json.part")
        if args.force:
            part.unlink(missing_ok=True)
        elif args.out.exists():
            raise ValueError(f"--out = {str(args.out)!r}: expected a new file (--force replaces this one)")
        elif part.exists():
            print(f"resuming with the results in {part}", file=sys.stderr)

    def progress(task: str, episodes: int) -> None:
        if sys.stderr.isatty() and episodes % 10 == 0:
            print(f"{task}: {episodes:,} of {bench.EPISODES:,} episodes", end="\r", file=sys.stderr)

    tasks, results = args.tasks.split(","), []
    try:
        played = bench.play_tasks(
            args.player, tasks, args.seed, args.name, progress, args.noise_seed, part, finished=results.append
        )
    finally:  # also after an error or Ctrl-C
        if results:
            print(bench.score_table(bench.Bench(args.player, tuple(results))), flush=True)
    if args.out is not None and part is not None:
        bench.save(args.out, played)
        part.unlink()
        print(f"wrote {args.out}")


def _verify(path: Path, noise_seed: int, player: str | None) -> None:
    """Verifies a file, and prints its scores and those of its actions or of the player with new noise."""
    import gymnasium as gym

    from billiards_env.bench import benchmark as bench
    from billiards_env.bench.frozen import NAMESPACE
    from billiards_env.players.named import find_player

    noisy = [one for one in bench.load(path).results if FROZEN[one.task].noise]
    longer = [one for one in noisy if not bench.is_one_noisy_shot(one.task)]
    if player is not None:
        if not longer:
            raise ValueError(f"--again = {player!r}: expected a file with a task of several shots with noise")
        for one in longer:  # a wrong name is an error before the replay
            find_player(player, gym.make(NAMESPACE + one.task))
    verified = bench.verify(path)
    print(f"{path}: accepted, {verified.player}\n{bench.score_table(verified)}", flush=True)
    other = bench.fresh(verified, noise_seed)
    if other.results:
        print(f"the same actions, {bench.DRAWS} draws of the noise from seed {noise_seed}:", flush=True)
        print(bench.score_table(other), flush=True)
    if player is None:
        for task in dict.fromkeys(one.task for one in longer):
            print(f"{task}: replayed only, the player may have computed the noise beforehand", flush=True)
        return
    print(f"{player} plays again with the noise of seed {noise_seed}:", flush=True)
    again = [bench.play_tasks(player, [one.task], [one.seed], noise_seed=noise_seed).results[0] for one in longer]
    print(bench.score_table(bench.Bench(player, tuple(again))), flush=True)


def calibrate(args: argparse.Namespace) -> None:
    """Runs the command `calibrate`."""
    from billiards_env.calibration import calibrate, read_tracks
    from billiards_env.calibration.example import write_example
    from billiards_env.calibration.report import check_out
    from billiards_env.shots.records import read_scene

    for path in args.out:
        check_out(path)
    pairs = [pair.split("=") for pair in args.columns.split(",") if pair]
    if not all(len(pair) == 2 for pair in pairs):
        raise ValueError(f"--columns = {args.columns!r}: expected NAME=HEADING, separated by commas")
    if args.example:
        print(write_example(args.tracks, read_scene(args.scene, args.balls)), file=sys.stderr)
    tracks = read_tracks(args.tracks, args.unit, args.fps, dict(pairs))
    most = max((int(track.balls.max()) for track in tracks), default=0)
    scene = read_scene(args.scene, most if args.balls is None and not args.scene.endswith(".json") else args.balls)
    result = calibrate(
        scene,
        tracks,
        args.free,
        frame=args.frame,
        noise=args.noise,
        contacts=args.contacts,
        progress=lambda text: print(text, file=sys.stderr, flush=True),
    )
    _write(result.save, args.out, result)


def replay(args: argparse.Namespace) -> None:
    """Runs the command `replay`."""
    from billiards_env.games import records, to_dict
    from billiards_env.games.playing import replay as shots_of

    _check_out(args.out, without=".json")
    record, notes = records.load(args.file), list[str]()
    if isinstance(record, records.ShotRecord):
        shots = [records.replay(record, record_events=True)]
    else:
        setup, state = record.setup, records.replay(record).state
        shots = [played.shot for played in shots_of(record.history)]
        scores = to_dict(state)["scores"]
        result = f"won by player {state.winner + 1}" if state.winner >= 0 else "over" if state.over else "not over"
        notes = [f"{setup.rules}, {setup.n_players} players, {len(shots)} shots, scores {list(scores)}, {result}"]
    if args.shot is not None and not 1 <= args.shot <= len(shots):
        raise ValueError(f"--shot = {args.shot}: expected a number from 1 to {len(shots)}")
    if args.shot is not None:
        shots = [shots[args.shot - 1]]
    if shots:
        _write_shot(shots[-1], args.out, notes)
    else:
        print(*notes)
    if args.window:
        _show(record.scene if isinstance(record, records.ShotRecord) else record.setup.scene, shots)


def _show(scene: Scene, shots: Sequence[ShotResult]) -> None:
    """Shows shots in a window, one after the other."""
    from billiards_env.drawing.canvas import Canvas
    from billiards_env.drawing.recording import recording_of
    from billiards_env.drawing.rendering import WIDTH
    from billiards_env.drawing.window import Window
    from billiards_env.envs.billiards import FPS

    canvas = Canvas(scene, WIDTH)
    window = Window(canvas.size, "Billiards")
    for k, shot in enumerate(shots, start=1):
        window.play(canvas.film(recording_of(shot), FPS, f"shot {k} of {len(shots)}"), FPS)
    window.close()


def _check_out(paths: Sequence[Path], without: str = "") -> None:
    """Raises an error if a file cannot be written, before anything is simulated."""
    for path in paths:
        if path.suffix not in WRITERS or path.suffix == without:
            suffixes = " ".join(suffix for suffix in WRITERS if suffix != without)
            raise ValueError(f"--out = {str(path)!r}: expected a name that ends in one of {suffixes}")
        check_path(path, path.suffix)


def _write_shot(shot: ShotResult, paths: Sequence[Path], notes: Sequence[str]) -> None:
    """Writes a shot to files, then prints notes and the shot."""
    _write(lambda path: WRITERS[path.suffix](shot, path), paths, "\n".join([*notes, str(shot), shot_text(shot)]))


def _write(save: Callable[[Path], object], paths: Sequence[Path], result: object) -> None:
    """Writes files, also after one has failed, then prints a result and the paths: the output may be a closed pipe."""
    written = []
    with all_jobs() as job:
        for path in paths:
            with job(str(path)):
                save(path)
                written.append(f"wrote {path}")
        print(result, *written, sep="\n")


def web(args: argparse.Namespace) -> None:
    """Runs the command `web`."""
    import webbrowser

    if not PLAY_PAGE.is_file():
        raise FileNotFoundError(
            f"page = {str(PLAY_PAGE)!r}: expected a file; 'make page' in a clone writes it, run it before 'pip install'"
        )
    if args.out is not None:
        write_atomically(check_path(args.out, ".html"), PLAY_PAGE.read_bytes())
        print(f"wrote {args.out}")
        return
    address = PLAY_PAGE.as_uri()
    print(address, flush=True)
    if not webbrowser.open(address):
        raise RuntimeError("browser = None: expected one that the module webbrowser finds; open the address by hand")


def doctor(args: argparse.Namespace) -> None:
    """Runs the command `doctor`."""
    from billiards_env.bench.published import HASHES
    from billiards_env.doctor import IDS, examine

    if examine(HASHES if args.all else IDS):
        sys.exit(1)


def cache(args: argparse.Namespace) -> None:
    """Runs the command `cache`."""
    from billiards_env.doctor import content
    from billiards_env.jit.folders import cache_folder

    if args.part:
        from billiards_env.compiling import PARTS

        for part in args.part:
            one_of("part", part, (*PARTS, "all"))
        for part in PARTS if "all" in args.part else args.part:
            print(f"{part}: ", end="", flush=True)
            begin = time.perf_counter()
            PARTS[part]()
            print(f"{time.perf_counter() - begin:.1f} s", flush=True)
    current = cache_folder()
    if current is None:
        return  # `cache_folder` warns
    for folder in sorted(current.parent.glob("kernels-" + "[0-9a-f]" * 16)):
        print(f"{folder}: {content(folder)}{'' if folder == current else ', of another version'}")
        if args.clear:
            shutil.rmtree(folder)
            print("deleted")


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line; see `billiards --help`."""
    if not getattr(sys.flags, "safe_path", False) and Path(sys.argv[0]).stem == "billiards":
        sys.path.insert(0, "")  # a console script does not look for modules in the current folder, unlike python -m
    parser = make_parser()
    args, rest = parser.parse_known_args(arguments)
    if args.command == "play":
        from billiards_env.play.__main__ import main as play

        return play(rest)
    if rest:
        parser.error(f"unrecognized arguments: {' '.join(rest)}")
    if args.command is None:
        return parser.print_help()
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that no temporary file stays
    try:
        with ending("with --out the same command resumes" if args.command in ("bench", "match") else ""):
            args.run(args)
    finally:
        signal.signal(signal.SIGTERM, before)


if __name__ == "__main__":
    main()
