"""Results of functions that another package registers: each wrong one is an error that names the entry."""

import functools
import itertools
import re
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import pytest

from billiards_env import (
    Scene,
    register_action,
    register_feature,
    register_game,
    register_layout,
    register_measure,
    register_player,
    register_scene,
    register_task,
)
from billiards_env.engine.measures import MEASURES, Measure
from billiards_env.envs import make_env
from billiards_env.envs.actions import ACTIONS, Action
from billiards_env.envs.observations import FEATURES, Feature
from billiards_env.envs.tasks import TASKS, Task
from billiards_env.games import GAMES, Setup, Stroke, opening, play
from billiards_env.games.entry import Game
from billiards_env.games.facts import USUAL, banked
from billiards_env.games.game_state import verdict
from billiards_env.games.pool import any_ball
from billiards_env.jit import entry_point, inlined, kernel
from billiards_env.players.env_player import acting
from billiards_env.players.named import PLAYERS, PlayerEntry, find_player
from billiards_env.players.situation import game_situation
from billiards_env.scene import NamedScene, layouts, scene
from billiards_env.scene.layouts import make_plan

TABLES: list[Any] = [TASKS, FEATURES, MEASURES, ACTIONS, layouts.LAYOUTS, scene.NAMED, GAMES, PLAYERS]
NAMES = (f"wrong_{k}" for k in itertools.count())
HALF: Any = 0.5
SPOTS, NAN, RNG = np.array([[0.1, 0.1], [0.5, 0.2]]), float("nan"), np.random.default_rng


@pytest.fixture(scope="module", autouse=True)
def own_tables():
    """Removes the entries after the tests."""
    before = [dict(table) for table in TABLES]
    yield
    for table, entries in zip(TABLES, before, strict=True):
        table.clear()
        table.update(entries)


def ending(*_: Any) -> Any:
    raise SystemExit(3)


def failing(*_: Any) -> Any:
    raise LookupError("mine")


def one_shot(**arguments: Any) -> None:
    """Plays a shot in an environment."""
    env = make_env(**arguments)
    env.reset(seed=0)
    env.step(env.action_space.sample())


def in_scene(build: Any) -> None:
    register_scene(name := next(NAMES), NamedScene(build, 1, 15))
    make_env(scene=name)


def in_layout(make: Any) -> None:
    register_layout(name := next(NAMES), make)
    make_env(layout=name)


def spots(*arguments: Any, **changes: Any) -> Any:
    """Returns a layout from the arguments of `make_plan`, with changed fields of the plan."""
    return lambda name, scene: make_plan(name, scene, *arguments)._replace(**changes)


def in_action(converter: Any, size: Any = 2, is_choice: bool = False) -> None:
    register_action(name := next(NAMES), Action("", size, converter, is_choice=is_choice))
    one_shot(action=name)


class Converter:
    """A converter with given results."""

    def __init__(self, strokes: Any, mask: Any = None, choices: Any = 0) -> None:
        self.made, self.masks, self.choices = strokes, mask, choices

    def strokes(self, actions: Any, tables: Any) -> Any:
        return self.made(actions, tables) if callable(self.made) else self.made

    def mask(self, tables: Any) -> Any:
        return self.masks


def strokes(*result: Any) -> Any:
    return lambda scene, max_speed: Converter(*result)


def mask(result: Any, choices: Any = 3) -> Any:
    return functools.partial(in_action, strokes([[0.1, 0.0]], result, choices), is_choice=True)


@entry_point
def write_value(begin, end, observations, first, value):
    for k in range(begin, end):
        observations[k, first] = value


def in_feature(reads: Any, shape: Any = (), low: Any = 0.0) -> None:
    register_feature(name := next(NAMES), Feature("", shape, low, write_value, reads))
    make_env(observe=["positions", name]).reset(seed=0)


@kernel
def nothing(k, numbers, arrays):
    pass


@kernel
def unknown_field(k, numbers, arrays):
    return arrays.score_[k], False, False


@kernel
def two_values(k, numbers, arrays):
    return 1, False


@kernel
def text(k, numbers, arrays):
    return "1", False, False


@kernel
def no_number(k, numbers, arrays):
    return NAN, False, False


def in_step(judge: Any, *, vector: bool = False) -> None:
    register_task(name := next(NAMES), Task(judge, "random"))
    if vector:
        envs: Any = gym.make_vec("Billiards-v0", num_envs=3, task=name)
        envs.reset(seed=0)
        envs.step(envs.action_space.sample())
    else:
        one_shot(task=name)


def in_task(judge: Any) -> None:
    register_task(name := next(NAMES), Task(judge, "random"))
    make_env(task=name)


@inlined
def right(state, facts, call):
    return verdict()


@inlined
def no_verdict(state, facts, call):
    return 1


@inlined
def unknown_in_state(state, facts, call):
    return verdict(state.score[0])


@inlined
def unknown_record(shots, k, bits) -> int:
    return shots.pocket[k, 0]


@inlined
def half_a_point(state, facts, call):
    return verdict(0, HALF, 0, False, 0, 0)


@inlined
def half_a_ball(state, player):
    return 0.5


class Halves(NamedTuple):
    half: float = 0.5


class OwnScores(NamedTuple):
    scores: int = 0


@inlined
def untyped_fact(shots, k, bits):
    return 0


@inlined
def record_start(moment, i, j, k, scene, state, shots):
    pass


@inlined
def unknown_of_shots(moment, i, j, k, scene, state, shots):
    shots.first[k] = 0


def in_measure(record: Any = record_start, shape: Any = (1,), largest: Any = lambda *_: 1.0) -> None:
    register_measure(name := next(NAMES), Measure("", shape, record, largest))
    make_env(observe=["positions", name]).reset(seed=0)


@inlined
def other_meanings(state, facts, call):
    """Reads attributes of names that are no arguments."""
    facts = verdict()
    return verdict(facts.foul, facts.points)


def new_game(**fields: Any) -> str:
    usual: dict[str, Any] = {"judge": right, "legal": any_ball, "scene": "pool", "layouts": ("random",)}
    game = Game(**{**usual, "n_object_balls": (1, 15), "won_by": "", **fields})
    register_game(name := next(NAMES), game)
    return name


def in_game(**fields: Any) -> None:
    make_env(task=new_game(**fields), n_players=2, n_object_balls=1)


def in_play(**fields: Any) -> None:
    """Plays a shot of a game without an environment."""
    setup = Setup(new_game(**fields), Scene.named("pool", 2))
    play(setup, opening(setup, RNG(0), "random"), Stroke((1.0, 0.0)))


CONSTANTS: dict[str, Any] = {
    "task": lambda **fields: register_task(next(NAMES), Task(**{"judge": text, "layout": "random", **fields})),
    "feature": lambda **fields: register_feature(
        next(NAMES), Feature(**{"summary": "", "shape": (), "low": 0.0, "write": write_value, "reads": tuple, **fields})
    ),
    "game": new_game,
    "action": lambda **fields: register_action(next(NAMES), Action("", 2, **fields)),
    "player": lambda **fields: register_player(next(NAMES), PlayerEntry(failing, **fields)),
    "scene": lambda **fields: register_scene(
        next(NAMES), NamedScene(**{"build": lambda n: None, "usual": 1, "most": 2, **fields})
    ),
}
"""Functions that register an entry with changed fields."""


def constant(what: str, field: str, wrong: Any, message: str) -> tuple[Any, Any, str]:
    """Returns a row of `WRONG`: a field of an entry with a wrong constant."""
    shown = re.escape(f"{wrong!r}: {message}")
    return lambda value: CONSTANTS[what](**{field: value}), wrong, f"^{field} of {what} 'wrong_.*' = {shown}"


def maker(make: Any) -> None:
    register_player(name := next(NAMES), PlayerEntry(make))
    find_player(name, make_env())


def in_player(result: Any, *, game: bool = False) -> None:
    """Plays the result of a player in an environment or in a game."""

    def player(situation: Any, rng: Any) -> Any:
        return result(situation, rng) if callable(result) else result

    register_player(name := next(NAMES), PlayerEntry(lambda argument, where: player))
    if game:
        setup = Setup("straight", Scene.named("pool", 2))
        state = opening(setup, RNG(0), "random")
        play(setup, state, find_player(name, setup)(game_situation(setup, state, 8.0), RNG(0)))
    else:
        env = make_env()
        observation, _ = env.reset(seed=0)
        env.step(acting(find_player(name, env), env)(observation))


COMPILED: Any = text
PLAIN = COMPILED.py_func
SOURCELESS: Any = kernel(eval("lambda k, numbers, arrays: (arrays.nonsense[k], False, False)"))
FIELD = "^attribute of '{}' in {} 'wrong_.*' = '{}': expected one of '.*' [(]did you mean '{}'"
ARGUMENTS = "= <function .*>: expected a function with {} argument"
KERNELS = "= .*wrong_.*: expected kernels with the arguments and results"
NUMBERS, TYPE = "expected finite numbers", "expected the type {}, not {}"
ENDED = r"= SystemExit\(3\): expected a result"
WRONG: list[tuple[Any, Any, str]] = [
    (in_scene, lambda n: None, "^scene 'wrong_.*' = None: " + TYPE.format("Scene", "NoneType")),
    (in_scene, lambda n: Scene.named("pool", n), "^n_balls of scene 'wrong_.*' = 3: expected 2"),
    (in_scene, lambda: None, "^build of scene 'wrong_.*' " + ARGUMENTS.format(1)),
    (in_scene, 3, "^build of scene 'wrong_.*' = 3: expected a function with 1 argument"),
    (in_scene, ending, "^scene 'wrong_.*' " + ENDED),
    (in_layout, lambda name, scene: SPOTS, "^layout 'wrong_.*' = array.*: " + TYPE.format("LayoutPlan", "ndarray")),
    (in_layout, lambda name: None, "^layout 'wrong_.*' " + ARGUMENTS.format(2)),
    (in_layout, ending, "^layout 'wrong_.*' " + ENDED),
    (in_layout, spots((), SPOTS[:1]), r"^spots of layout 'wrong_.*' has shape \(1, 2\): expected \(2, 2\)"),
    (in_layout, spots((), SPOTS * 1j), "^spots of layout 'wrong_.*" + NUMBERS),
    (in_layout, spots((), SPOTS * NAN), r"^layout 'wrong_.*': ball 0 is at \[nan, nan\]"),
    (in_layout, spots((7,), SPOTS), "^drawn of layout 'wrong_.*' = 7: expected a whole number from 0 to 1"),
    (in_layout, spots((1, 1), SPOTS), r"^order of layout 'wrong_.*' has shape \(3,\)"),
    (in_layout, spots((1,), SPOTS, NAN), "^displacement of layout 'wrong_.*' = nan"),
    (in_layout, spots((1,), SPOTS, 0.0, NAN), "^x_most of layout 'wrong_.*' = nan"),
    (in_layout, spots((1,), SPOTS, spots=SPOTS[:1]), r"^spots of layout 'wrong_.*' has shape \(1, 2\)"),
    (in_layout, spots((1,), SPOTS, order=np.array([0.0, 1.0])), "^order of layout .*: expected an array of int64"),
    (
        in_layout,
        spots((1,), SPOTS, order=np.array([0, 9])),
        "^order of layout .*: expected the balls of a scene with 2",
    ),
    (in_layout, spots((1,), SPOTS, corners=np.array([[0, 1, 9]])), "^corners of layout .*: expected the balls"),
    (in_layout, spots((1,), SPOTS, midway=True), "^midway of layout 'wrong_.*' = True: expected the balls"),
    (in_layout, spots((1,), SPOTS, n_spots=1.5), "^n_spots of layout 'wrong_.*' = 1.5: expected a whole number"),
    (in_layout, spots((1,), SPOTS, shuffled=8), "^shuffled of layout 'wrong_.*' = 8: expected a whole number"),
    (in_action, lambda scene: None, "^converter of action 'wrong_.*' " + ARGUMENTS.format(2)),
    (in_action, ending, "^converter of action 'wrong_.*' " + ENDED),
    (in_action, lambda scene, speed: None, "^converter of action 'wrong_.*' = None: expected a method 'strokes'"),
    (in_action, strokes(0.5), r"^strokes of action 'wrong_.*' has shape \(\): expected \(1, 2\)"),
    (in_action, strokes(SPOTS), r"^strokes of action 'wrong_.*' has shape \(2, 2\): expected \(1, 2\)"),
    (in_action, strokes(np.array([[NAN, 0.0]])), "^strokes of action 'wrong_.*: " + NUMBERS),
    (in_action, strokes(ending), "^strokes of action 'wrong_.*' " + ENDED),
    (functools.partial(in_action, size=3), None, "^size of action 'wrong_.*' = 3: expected 2, or 5"),
    (mask(None), ..., "^mask of action 'wrong_.*' = None: " + NUMBERS),
    (mask([[1, 1]]), ..., r"^mask of action 'wrong_.*' has shape \(1, 2\): expected \(1, 3\)"),
    (mask([[1, 7, 0]]), ..., "^mask of action 'wrong_.*: expected zeros and ones"),
    (mask([[1]], 1.5), ..., "^choices of converter of action 'wrong_.*' = 1.5: expected a whole number"),
    (in_feature, lambda source: None, "^reads of feature 'wrong_.*' = None: " + TYPE.format("tuple", "NoneType")),
    (in_feature, lambda: (1.0,), "^reads of feature 'wrong_.*' " + ARGUMENTS.format(1)),
    (in_feature, ending, "^reads of feature 'wrong_.*' " + ENDED),
    (in_feature, lambda source: (1j,), "^observe " + KERNELS),
    (in_feature, lambda source: (1.0, 2.0), "^observe " + KERNELS),
    (
        functools.partial(in_feature, shape=("ball",)),
        lambda source: (1.0,),
        "^shape of feature .* = 'ball': expected one",
    ),
    (
        functools.partial(in_feature, shape=(-1,)),
        lambda source: (1.0,),
        "^shape of feature 'wrong_.*' = -1: expected a",
    ),
    (in_feature, lambda source: (NAN,), "^feature 'wrong_.*' = nan: expected a number from 0 to 1"),
    (in_feature, lambda source: (1.5,), "^feature 'wrong_.*' = 1.5: expected a number from 0 to 1"),
    (
        functools.partial(in_feature, low=(0.0, -0.5), shape=(2,)),
        lambda source: (-0.4,),
        "^feature 'wrong_.*' = -0.4: expected a number from 0 to 1",
    ),
    (
        functools.partial(in_feature, low=(0.0, 0.0), shape=(3,)),
        lambda source: (0.0,),
        r"^low of feature 'wrong_.*' = \(0.0, 0.0\): expected one number, or",
    ),
    (in_step, no_number, "^reward of task 'wrong_.*' = nan: expected a finite number"),
    (functools.partial(in_step, vector=True), no_number, "^reward of task 'wrong_.*' = nan: expected a finite number"),
    (in_task, None, "^judge of task 'wrong_.*' = None: expected a function with 3 arguments"),
    (in_task, half_a_ball, "^judge of task 'wrong_.*' = .*: expected a function with 3 arguments"),
    (in_task, nothing, "^task " + KERNELS),
    (in_task, two_values, "^task " + KERNELS),
    (in_task, text, "^task " + KERNELS),
    (in_task, PLAIN, "^judge of task 'wrong_.*' = .*: expected a kernel"),
    (in_task, unknown_field, FIELD.format("arrays", "judge of task", "score_", "score")),
    (in_task, SOURCELESS, "^task " + KERNELS + " of the documentation; EpisodeArrays has no field 'nonsense'$"),
    (lambda judge: in_game(judge=judge), PLAIN, "^judge of game 'wrong_.*' = .*: expected a kernel"),
    (lambda judge: in_game(judge=judge), half_a_ball, "^judge of game 'wrong_.*: expected a function with 3 arguments"),
    (in_measure, unknown_of_shots, FIELD.format("shots", "record of measure", "first", "first_hit")),
    (lambda shape: in_measure(shape=shape), (0,), "^size in shape of measure 'wrong_.*' = 0: expected a whole number"),
    (lambda shape: in_measure(shape=shape), ("ball",), "^size in shape of measure 'wrong_.*' = 'ball': expected a"),
    (lambda largest: in_measure(largest=largest), lambda *_: 0.0, "^largest of measure 'wrong_.*' = 0.0: expected a"),
    (lambda largest: in_measure(largest=largest), lambda *_: "a", "^largest of measure 'wrong_.*' = 'a': expected a"),
    (lambda judge: in_game(judge=judge), unknown_in_state, FIELD.format("state", "judge of game", "score", "scores")),
    (
        lambda fact: in_game(facts=(*USUAL, fact)),
        unknown_record,
        FIELD.format("shots", "fact 'unknown_record' of game", "pocket", "pockets"),
    ),
    (lambda judge: in_game(judge=judge), no_verdict, "^task " + KERNELS),
    (lambda legal: in_game(legal=legal), half_a_ball, "^task " + KERNELS),
    (lambda judge: in_game(judge=judge), half_a_point, "^task " + KERNELS),
    (lambda judge: in_play(judge=judge), half_a_point, "^rules " + KERNELS),
    (lambda judge: in_play(judge=judge), no_verdict, "^rules " + KERNELS),
    (lambda target: in_game(target=target), lambda n: "a", "^target of game 'wrong_.*' = 'a': expected a whole number"),
    (lambda target: in_game(target=target), lambda: 3, "^target of game 'wrong_.*' " + ARGUMENTS.format(1)),
    (lambda target: in_game(target=target), ending, "^target of game 'wrong_.*' " + ENDED),
    (lambda balls: in_game(cue_balls=balls), (0, 9), "^cue_balls of game 'wrong_.*' = 9: expected a whole number"),
    (maker, lambda argument, where: None, "^player = 'wrong_.*': expected a function that returns a player"),
    (maker, lambda: None, "^make of player 'wrong_.*' " + ARGUMENTS.format(2)),
    (maker, ending, "^player 'wrong_.*' " + ENDED),
    (in_player, None, "^stroke of player 'wrong_.*' = None: expected a Stroke, a player returns situation.stroke"),
    (in_player, ending, "^stroke of player 'wrong_.*' " + ENDED),
    (
        in_player,
        Stroke((1.0, 2.0, 3.0)),
        r"^stroke.velocity of player 'wrong_.*' = \(1.0, 2.0, 3.0\): expected two numbers",
    ),
    (in_player, Stroke((NAN, 0.0)), r"^stroke.velocity\[0\] of player 'wrong_.*' = nan: expected a number from"),
    (
        in_player,
        Stroke((1.0, 0.0), spin=(NAN, 0.0, 0.0)),
        r"^stroke.spin\[0\] of player 'wrong_.*' = nan: expected a number from",
    ),
    (
        in_player,
        Stroke((1.0, 0.0), place=(0.0,)),  # pyright: ignore
        r"^stroke.place of player 'wrong_.*' = \(0.0,\): expected two numbers",
    ),
    (in_player, Stroke((1.0, 0.0), call="x"), "^stroke.call of player 'wrong_.*' = 'x': " + TYPE.format("Call", "str")),  # pyright: ignore
    (functools.partial(in_player, game=True), Stroke(None), "^stroke.velocity = None: expected two numbers"),
]


WRONG += [
    constant("task", "n_object_balls", 3, "expected the type tuple[int, int | None], not int"),
    constant("task", "n_object_balls", (-1, 2), "expected numbers >= 0"),
    constant("task", "n_object_balls", (3, 2), "expected the smallest number first"),
    constant("task", "n_targets", 1.5, "expected the type int | None, not float"),
    constant("task", "n_targets", -1, "expected a number >= 0"),
    constant("task", "goal_radius", "a", "expected the type float, not str"),
    constant("task", "goal_radius", NAN, "expected a number from 0 to 10000 m"),
    constant("task", "pockets", 1, "expected the type bool | None, not int"),
    constant("task", "max_shots", 0, "expected a number from 1 to"),
    constant("task", "breaks", "rack", "expected the type tuple[str, ...], not str"),
    constant("feature", "low", None, "expected the type float | tuple[float, ...], not NoneType"),
    constant("feature", "low", NAN, "expected a number from"),
    constant("feature", "low", 2.0, "expected a number from"),
    constant("feature", "write", None, "expected the type collections.abc.Callable[..., None], not NoneType"),
    constant("game", "n_players", 2, "expected the type tuple[int, int], not int"),
    constant("game", "n_players", (2, 9), "expected numbers from 2 to 4"),
    constant("game", "editions", "2025", "expected the type tuple[str, ...], not str"),
    constant("game", "editions", (), "expected at least one"),
    constant("game", "choices", 3, "expected a list"),
    constant("game", "deciding_ball", -2, "expected a number from -1 to 62"),
    constant("action", "is_choice", 1, "expected the type bool, not int"),
    constant("player", "argument", 3, "expected the type str | None, not int"),
    constant("scene", "usual", -1, "expected a number from 0 to 100000"),
    (
        lambda state: new_game(state=state),
        lambda balls: (0,),
        "^state of game 'wrong_.*: expected a function that returns",
    ),
    (
        lambda state: new_game(state=state),
        Halves,
        "^field 'half' of the state .* = <class 'float'>: expected int, bool",
    ),
    (lambda state: new_game(state=state), OwnScores, "^OwnScores.scores: expected another name than those of"),
    (lambda fact: new_game(facts=(*USUAL, fact)), half_a_ball, "^facts of game 'wrong_.*: expected a function with 3"),
    (lambda fact: new_game(facts=(*USUAL, fact)), untyped_fact, "^'untyped_fact' of the facts .* = None: expected int"),
    (
        lambda facts: new_game(facts=facts),
        USUAL[:4],
        r"^facts of game 'wrong_.*\['first', .*: expected 'driven_off' among",
    ),
    (lambda fact: new_game(scoring=fact), banked, "^facts of game 'wrong_.*: expected 'banked' among them"),
    (lambda one: new_game(choices=(one,)), "jump", "^choices of game 'wrong_.*' = 'jump': expected one of 'push_out',"),
]


@pytest.mark.parametrize(("use", "wrong", "message"), WRONG)
def test_a_wrong_result_is_an_error_that_names_the_entry(use, wrong, message):
    with pytest.raises((TypeError, ValueError), match=message):
        use() if wrong is ... else use(wrong)


@pytest.mark.parametrize("use", [in_scene, in_layout, in_action, in_feature, maker, in_player])
def test_errors_of_the_function_itself_pass(use):
    with pytest.raises(LookupError, match="mine"):
        use(failing)


def test_names_that_a_kernel_assigns_are_no_arguments():
    in_game(judge=other_meanings)


@pytest.mark.parametrize(
    ("register", "table"),
    [
        (register_task, TASKS),
        (register_feature, FEATURES),
        (register_measure, MEASURES),
        (register_action, ACTIONS),
        (register_scene, scene.NAMED),
        (register_game, GAMES),
        (register_player, PLAYERS),
    ],
)
def test_the_entries_of_the_package_pass_the_checks(register, table):
    for name in table:
        register(name, table[name])
