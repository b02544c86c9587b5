"""Checks of arguments: `make_model` for the arguments of `gym.make`, `check_options` for the options of `reset`."""

from __future__ import annotations

import dataclasses
import inspect
import json
from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from billiards_env.engine import Engine
from billiards_env.engine.compile import check_varied_name
from billiards_env.engine.measures import MEASURES
from billiards_env.envs.actions import ELEVATION, SIDE, SPEED, TOP, TURN, action_named, check_action
from billiards_env.envs.tasks import TASKS, task_of, task_targets
from billiards_env.games.game_state import MOST_PLAYERS
from billiards_env.games.referee import GAMES
from billiards_env.jit import streams
from billiards_env.scene import Balls, Scene, check_ends_on_cloth, check_positions, check_ranges, layouts
from billiards_env.shots.noise import EXECUTION_NOISE, SCATTER, check_scatter, deviations
from billiards_env.support.checks import (
    Range,
    array_of,
    entry_of,
    flag,
    import_module_of,
    integer,
    key_of,
    numbers,
    one_of,
    real,
    shaped,
    short,
    short_name,
    suggestion,
)

if TYPE_CHECKING:
    from billiards_env.games.playing import Setup

MAX_SPEED = 4.0
"""m/s. The default of `max_speed` for one player."""

GAME_SPEED = 8.0
"""m/s. The default of `max_speed` in games, enough for a break."""

SCRATCH_PENALTY = 0.1
"""The default of `scratch_penalty` for one player. In games it is 0."""


class Model(NamedTuple):
    """The checked arguments of an environment, see `make_model`. Its episodes read them and do not change them.

    Attributes:
        scene: The scene.
        task: One of `TASKS`, or for several players one of `GAMES`.
        targets: (n,) bool, see `tasks.task_targets`.
        engine: The engine.
        action: One of `ACTIONS`.
        max_shots: Number of shots after which an episode ends.
        max_speed: The speed of an action of length 1, m/s.
        layout: The layout at the start of an episode.
        observe: As in `BilliardsEnv`.
        goal_radius: m. Largest distance from the goal, see `Task`; 0 for a task without a goal.
        scratch_penalty: Reward subtracted for a scratch.
        randomize: The ranges (low, high) of the numbers that each episode draws, by name.
        noise: The standard deviations of the noise of `actions.perturb`, one per number of an action; None for none.
        noise_seed: A second seed of the noise and of the scatter, or None.
        setup: The settings of a game of several players; None for one player.
        can_call: Whether the players call, see `BilliardsEnv`.
        can_place: Whether the players place a cue ball in hand.
        scatter: The standard deviations of the scatter of the cushions, see `physics.scatter`; None for none.
        measures: The measures that the shots record for the task and the observation, see `engine.measures`. They are
            also keys of `info`.
        arguments: The arguments by name, with the values that the environment uses in place of None.
    """

    scene: Scene
    task: str
    targets: NDArray[np.bool_]
    engine: Engine
    action: str
    max_shots: int
    max_speed: float
    layout: str
    observe: Sequence[Any] | None
    goal_radius: float
    scratch_penalty: float
    randomize: dict[str, tuple[float, float]]
    noise: NDArray[np.float64] | None
    noise_seed: int | None
    setup: Setup | None = None
    can_call: bool = False
    can_place: bool = False
    scatter: NDArray[np.float64] | None = None
    measures: tuple[str, ...] = ()
    arguments: Mapping[str, Any] = {}

    @property
    def is_noisy(self) -> bool:
        """Whether the strokes have noise or the cushions have scatter."""
        return self.noise is not None or self.scatter is not None

    @property
    def summary(self) -> str:
        """The task, the scene, the balls and the engine in one line, for the `repr` of an environment."""
        table = self.scene.table
        size = f"table {table.length:g} x {table.width:g} m, {len(table.pockets)} pockets"
        return f"task {self.task!r}, {size}, {self.scene.n_balls} balls, {self.engine}"

    @property
    def n_players(self) -> int:
        """The number of players."""
        return 1 if self.setup is None else self.setup.n_players

    @property
    def n_numbers(self) -> tuple[int, int, int]:
        """The numbers of an action: those of the shot, of the place of a cue ball in hand, and of the call.

        A choice has only those of the shot that is made of it.
        """
        entry = action_named(self.action)
        if entry.is_choice:
            return entry.size, 0, 0
        return entry.size, 2 * self.can_place, 3 * self.can_call


def make_model(
    *,
    scene: str | Scene | Mapping[str, Any] | None = None,
    task: str = "pot",
    n_object_balls: int | None = None,
    mode: str = "pic",
    dt: float | None = None,
    fix: str | None = None,
    action: str | None = None,
    max_shots: int | None = None,
    max_speed: float | None = None,
    layout: str | None = None,
    observe: Sequence[Any] | None = None,
    goal_radius: float | None = None,
    scratch_penalty: float | None = None,
    randomize: Mapping[str, Sequence[float]] | None = None,
    noise: Mapping[str, float] | None = None,
    noise_seed: int | None = None,
    scatter: Mapping[str, float] | None = None,
    n_players: int = 1,
    target: int | None = None,
    can_call: bool = False,
    can_place: bool = True,
    miss: bool = False,
    edition: str | None = None,
    innings: int = 0,
) -> Model:
    """Returns the arguments of an environment after a check. The docstring of `BilliardsEnv` describes them.

    Raises:
        ValueError: If an argument is invalid.
        TypeError: If an argument has the wrong type.
    """
    given = dict(locals())  # at the start: the arguments alone
    players = integer("n_players", n_players, Range(1, MOST_PLAYERS))
    key = key_of("task", task, ChainMap(GAMES, TASKS))
    if players == 1 and key not in TASKS:
        raise ValueError(f"task = {task!r} with n_players = 1: expected n_players = 2, it is a game of several players")
    if players > 1 and key not in GAMES:
        raise ValueError(f"task = {task!r} with n_players = {players}: expected one of {', '.join(map(repr, GAMES))}")
    entry = task_of(task, players)
    least, most = entry.n_object_balls
    board = make_scene(scene, n_object_balls, entry.scene, most if players > 1 or least == most else None)
    check_ends_on_cloth(board)
    action = entry.action if action is None else action
    check_action(action, board)
    if entry.flies and not (board.physics.flight and action_named(action).has_cue):
        raise ValueError(
            f"task = {task!r} with action = {action!r} and physics.flight = {board.physics.flight}: expected action "
            f"'strike' in a scene with flight, such as scene {entry.scene!r}"
        )
    targets, engine = task_targets(task, board, players), Engine(mode, dt, fix)
    layout = entry.layout if layout is None else layout
    layouts.draw(layout, board, np.random.default_rng(0))  # an invalid layout raises here, not in `reset`
    usual_speed, usual_penalty = (MAX_SPEED, SCRATCH_PENALTY) if players == 1 else (GAME_SPEED, 0.0)
    speed = real("max_speed", usual_speed if max_speed is None else max_speed, "max_speed")
    penalty = usual_penalty if scratch_penalty is None else scratch_penalty
    if goal_radius is not None and not entry.goal_radius:
        raise ValueError(f"goal_radius = {short(goal_radius)} with task = {task!r}: expected a task with a goal")
    if flag("can_call", can_call) and action_named(action).is_choice:
        raise ValueError(f"can_call = True with action = {action!r}: expected False, it has no numbers for a call")
    of_games = {"target": target, "miss": miss, "edition": edition, "innings": innings}
    setup = _make_setup(task, board, players, engine, can_call, of_games) if players > 1 else None
    for name, value in {**of_games, "can_call": can_call}.items():
        usual = inspect.signature(make_model).parameters[name].default
        if players == 1 and value is not usual:
            raise ValueError(f"{name} = {short(value)} with n_players = 1: expected {usual}, it belongs to games")
    if setup is not None and short_name(layout) not in (names := setup.game_rules.layouts):
        expected = ", ".join(map(repr, names))
        raise ValueError(f"layout = {layout!r} with n_players = {players}: expected one of {expected}")
    model = Model(
        scene=board,
        task=task,
        targets=targets,
        engine=engine,
        action=action,
        max_shots=integer("max_shots", entry.max_shots if max_shots is None else max_shots, "max_shots"),
        max_speed=speed,
        layout=layout,
        observe=observe,
        goal_radius=entry.goal_radius if goal_radius is None else real("goal_radius", goal_radius, "length"),
        scratch_penalty=real("scratch_penalty", penalty, "scratch_penalty"),
        randomize=check_randomize(randomize, board, engine),
        noise=check_noise(noise, board, action, speed),
        noise_seed=None if noise_seed is None else integer("noise_seed", noise_seed, "seed"),
        setup=setup,
        can_call=can_call,
        can_place=flag("can_place", can_place) and setup is not None and setup.game_rules.pockets,
        scatter=check_scatter(scatter),
        measures=_asked(entry.measures if setup is None else setup.game_rules.measures, observe),
    )
    return model._replace(arguments=_used(given, model))


def _asked(of_task: tuple[str, ...], observe: Any) -> tuple[str, ...]:
    """Returns the measures of a task, and those among the features of the observation."""
    asked = *of_task, *(observe if isinstance(observe, (list, tuple)) else ())
    names = [name for name in asked if isinstance(name, str)]
    for name in names:
        import_module_of("observe", name)
    return tuple(name for name in MEASURES if name in map(short_name, names))


def _used(given: Mapping[str, Any], model: Model) -> dict[str, Any]:
    """Returns the arguments of `make_model` by name, with the values of its model."""
    used = {name: getattr(model, name) for name in given.keys() & set(Model._fields)}
    used |= dataclasses.asdict(model.engine) | {"n_object_balls": model.scene.n_balls - 1, "n_players": model.n_players}
    if model.setup is not None:
        used |= {name: getattr(model.setup, name) for name in ("target", "miss", "edition", "innings")}
    for name, usual in ("noise", EXECUTION_NOISE), ("scatter", SCATTER):
        used[name] = None if given[name] is None else {**usual, **given[name]}
    return {**given, **used}


def model_of(maker: Callable[..., Any], arguments: Mapping[str, Any]) -> Model:
    """Returns the model for the arguments of a function that makes an environment, besides its own.

    Raises:
        TypeError: If an argument is unknown, or as in `make_model`.
        ValueError: As in `make_model`.
    """
    known = list({**inspect.signature(make_model).parameters, **inspect.signature(maker).parameters})
    known.remove("arguments")
    for name, value in arguments.items():
        if name not in known:
            expected = f"one of the arguments {', '.join(known)}{suggestion(name, known)}"
            # TorchRL searches for the words of Python's own message.
            python = f"{maker.__name__}() got an unexpected keyword argument {name!r}"
            raise TypeError(f"{name} = {short(value)}: expected {expected}; {python}")
    return make_model(**arguments)


def _make_setup(
    rules: str, scene: Scene, n_players: int, engine: Engine, can_call: bool, settings: dict[str, Any]
) -> Setup:
    """Returns the settings of a game of several players; `settings` are arguments of `Setup`."""
    from billiards_env.games.playing import Setup

    game = entry_of("task", rules, GAMES)
    if can_call and not (game.callable or game.choices):
        raise ValueError(f"can_call = True with task = {rules!r}: expected False, the game has no calls")
    if flag("miss", settings["miss"]) and not can_call:
        raise ValueError("miss = True with can_call = False: expected can_call = True, the miss rule gives a choice")
    called = can_call and game.callable is not None
    return Setup(rules, scene, n_players, engine=engine, call_shot=called, **settings)


class ResetOptions(NamedTuple):
    """The options of a reset of m environments.

    Attributes:
        positions: (m, n, 2) positions of the balls, m; None to draw them.
        goals: (m, 1, 2) goals, m; None to draw them.
        physics: Numbers of `randomize` by name, (m,) each; the others are drawn.
        episode_seed: (m, 8) uint64, the random streams of layouts and noise; None to continue the current ones.
        states: (m,) `Game.state_type`, the states of games of several players; None for the opening.
    """

    positions: NDArray[np.float64] | None = None
    goals: NDArray[np.float64] | None = None
    physics: Mapping[str, NDArray[np.float64]] = {}
    episode_seed: NDArray[np.uint64] | None = None
    states: NDArray[Any] | None = None


NO_OPTIONS = ResetOptions()


def cue_ball_alone(scene: Scene) -> Scene:
    """Returns the scene without its object balls."""
    return dataclasses.replace(scene, balls=Balls(scene.balls.radius[:1], scene.balls.mass[:1]))


def make_scene(
    scene: str | Scene | Mapping[str, Any] | None,
    n_object_balls: int | None,
    usual: str = "pool",
    usual_count: int | None = None,
) -> Scene:
    """Returns the scene of an environment.

    Args:
        scene: Name of a scene, a scene, or a mapping for `Scene.from_dict`; None for the usual one.
        n_object_balls: Number of object balls of a named scene; None for the usual number.
        usual: Name of the usual scene.
        usual_count: Usual number of object balls; None for the scene's.

    Raises:
        ValueError: If the name is unknown, the data are invalid, or `n_object_balls` is not None without a name.
        TypeError: If `scene` has another type, or a value in it has the wrong type.
    """
    if scene is None or isinstance(scene, str):
        return Scene.named(usual if scene is None else scene, usual_count if n_object_balls is None else n_object_balls)
    if not isinstance(scene, (Scene, Mapping)):
        raise TypeError(f"scene = {short(scene)}: expected a name, a Scene, or a dict in the form of Scene.to_dict()")
    if n_object_balls is not None:
        raise ValueError(
            f"n_object_balls = {short(n_object_balls)} with a scene without a name: expected None, it lists the balls"
        )
    return scene if isinstance(scene, Scene) else Scene.from_dict(scene)


def check_randomize(
    randomize: Mapping[str, Any] | None, scene: Scene, engine: Engine
) -> dict[str, tuple[float, float]]:
    """Returns the ranges (low, high) of the numbers that each episode draws, by name, after a check.

    Args:
        randomize: The argument of the environment.
        scene: The scene.
        engine: The engine.

    Raises:
        ValueError: If a number is unknown or does not vary with this engine, or if a range is empty or has values that
            `Physics` or the engine rejects.
        TypeError: If `randomize` is not a mapping to pairs of numbers.
    """
    ranges = {}
    if randomize is not None and not isinstance(randomize, Mapping):
        raise TypeError(f"randomize = {short(randomize)}: expected a mapping from names of numbers to (low, high)")
    for key, limits in (randomize or {}).items():
        check_varied_name("randomize", key, engine)
        name = f"randomize[{key!r}]"
        if not isinstance(limits, (list, tuple)):
            raise TypeError(f"{name} = {short(limits)}: expected (low, high) with low < high")
        pair = tuple(real(name, end) for end in limits)
        if len(pair) != 2 or pair[0] >= pair[1]:
            raise ValueError(f"{name} = {short(limits)}: expected (low, high) with low < high")
        ranges[key] = pair
    try:
        check_ranges(scene.physics, {key: pair for key, pair in ranges.items() if key != "dt"})
        for dt in ranges.get("dt", ()):
            dataclasses.replace(engine, dt=dt)
    except ValueError as error:
        raise ValueError(f"randomize: {error}") from None
    return ranges


def check_noise(
    noise: Mapping[str, Any] | None, scene: Scene, action: str, max_speed: float
) -> NDArray[np.float64] | None:
    """Returns the standard deviations of the noise of `actions.perturb`, or None without noise, after a check.

    Args:
        noise: The argument of the environment.
        scene: The scene.
        action: The kind of action.
        max_speed: m/s.

    Raises:
        ValueError: If a name is unknown, or a standard deviation is negative or not finite.
        TypeError: If `noise` is not a mapping to numbers.
    """
    if noise is None:
        return None
    stds, scales = deviations("noise", noise, EXECUTION_NOISE), np.empty(5)
    scales[TURN], scales[SPEED] = stds["angle_std"] / 180.0, stds["speed_std"] / max_speed
    scales[[SIDE, TOP]] = stds["offset_std"] / (scene.cue.miscue_offset * scene.balls.radius[0])
    scales[ELEVATION] = stds["elevation_std"] / 90.0
    return scales[: action_named(action).size]


class _Fixed:
    """An attribute that only the constructor sets, because other attributes are computed from it."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __set__(self, env: Any, value: Any) -> None:
        if self._name in vars(env):
            raise AttributeError(f"{self._name} = {short(value)}: expected no change; make another environment")
        vars(env)[self._name] = value


def fixed() -> Any:
    """Returns the declaration of an attribute of a class that only the constructor sets."""
    return _Fixed()


class OfArguments:
    """The arguments of an environment as attributes, with the values that it uses. Only the constructor sets them."""

    scene: Scene = fixed()
    task: str = fixed()
    n_object_balls: int = fixed()
    mode: str = fixed()
    dt: float | None = fixed()
    fix: str | None = fixed()
    action: str = fixed()
    max_shots: int = fixed()
    max_speed: float = fixed()
    layout: str = fixed()
    observe: Any = fixed()
    goal_radius: float = fixed()
    scratch_penalty: float = fixed()
    randomize: dict[str, tuple[float, float]] = fixed()
    noise: Mapping[str, float] | None = fixed()
    noise_seed: int | None = fixed()
    scatter: Mapping[str, float] | None = fixed()
    n_players: int = fixed()
    target: int | None = fixed()
    can_call: bool = fixed()
    can_place: bool = fixed()
    miss: bool = fixed()
    edition: str | None = fixed()
    innings: int = fixed()

    def _set_arguments(self, arguments: Mapping[str, Any]) -> None:
        for name, value in arguments.items():
            setattr(self, name, value)


def plain(value: Any) -> Any:
    """Returns an argument of an environment as plain data: a scene as a dict, numbers of NumPy as those of Python."""
    if isinstance(value, Scene):
        return value.to_dict()
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, Mapping):
        return {plain(key): plain(item) for key, item in value.items()}
    return type(value)(map(plain, value)) if type(value) in (list, tuple) else value


def _set_spec(env: Any, spec: EnvSpec | None) -> None:
    if spec is not None:
        spec.kwargs = plain(spec.kwargs)
        _warn_of_changes(spec)
    env._spec = spec


def _warn_of_changes(spec: EnvSpec) -> None:
    """Warns if an argument that changes the results differs from that of a frozen task, such as `Billiards/Pot1-v0`."""
    if spec.namespace != "Billiards" or spec.id not in gym.registry:
        return
    usual = {name: parameter.default for name, parameter in inspect.signature(make_model).parameters.items()}
    frozen = {**usual, **gym.registry[spec.id].kwargs, "noise_seed": spec.kwargs.get("noise_seed")}
    given = json.loads(json.dumps({name: spec.kwargs.get(name, value) for name, value in frozen.items()}, default=str))
    changed = ", ".join(f"{name} = {short(value)}" for name, value in given.items() if value != frozen[name])
    if changed:
        gym.logger.warn(f"{changed} in {spec.id}: this is no longer the frozen task, results are not comparable")


json_spec: Any = property(lambda env: env._spec, _set_spec)
"""The attribute `spec` of an environment, with `plain` arguments."""


def check_options(
    model: Model, options: Mapping[str, Any] | None, mask: NDArray[np.bool_] | None = None
) -> ResetOptions:
    """Returns the options of a reset, after a check.

    Args:
        model: The arguments of the environment.
        options: The options.
        mask: None for one environment. For m environments (m,) bool: those to reset. The values of the others are not
            used, and only their positions and goals have to be finite.

    Raises:
        ValueError: If an option is unknown, a position of a ball or a goal is invalid, or a number is not in its
            range.
        TypeError: If the options or their physics are not a mapping.
    """
    if options is None:
        return NO_OPTIONS
    if not isinstance(options, Mapping):
        raise TypeError(f"options = {short(options)}: expected a dict")
    scene = model.scene
    own = {"goal": model.goal_radius, "physics": model.randomize, "state": model.setup}
    known = "positions", *(key for key, value in own.items() if value), "episode_seed"
    for key in options:
        if key == "physics" and not model.randomize:
            text = short(options[key])
            raise ValueError(f"options['physics'] = {text} without randomize: expected the argument randomize")
        one_of("key of options", key, known)
    many, mask = ((), np.ones(1, np.bool_)) if mask is None else (mask.shape, mask)
    positions = goals = seeds = states = None
    if "positions" in options:
        positions = _for_each("options['positions']", options["positions"], many, (scene.n_balls, 2))
        if model.setup is None:
            in_play = np.broadcast_to(mask[:, None], (len(mask), scene.n_balls)).reshape(*many, -1)
            check_positions(scene, positions, "options['positions']", in_play)
        positions = positions.reshape(-1, scene.n_balls, 2)
    if model.setup is not None and ("positions" in options or "state" in options):
        states = _custom_states(model.setup, positions, options.get("state"), mask)
    if "goal" in options:
        goals = _for_each("options['goal']", options["goal"], many, (2,)).reshape(*many, 1, 2)
        name = "options['goal'] as a position of the cue ball"
        goals = check_positions(cue_ball_alone(scene), goals, name, mask.reshape(*many, 1)).reshape(-1, 1, 2)
    if "episode_seed" in options:
        name = "options['episode_seed']"
        array = array_of(name, options["episode_seed"])
        if array.dtype != np.int64 or array.shape != (*many, 8):
            raise ValueError(f"{name} = {short(array)}: expected int64 of shape {(*many, 8)}, as in info")
        seeds = array.view(np.uint64).reshape(-1, 8)
        read = seeds[mask].reshape(-1, 2, 4)[:, : 1 + model.is_noisy]
        if not streams.are_seeded(read).all():
            raise ValueError(f"{name} = {short(array)}: expected an info['episode_seed'] of this task")
    physics = _checked_physics(model.randomize, options.get("physics", {}), many, mask)
    return ResetOptions(positions, goals, physics, seeds, states)


def _for_each(name: str, value: Any, many: tuple[int, ...], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Returns a copy of an array (*many, *shape); one array of the shape `shape` is repeated for all environments."""
    array = numbers(name, value)
    return shaped(name, np.broadcast_to(array, (*many, *shape)) if array.shape == shape else array, (*many, *shape))


def _custom_states(
    setup: Setup, positions: NDArray[np.float64] | None, state: Any, mask: NDArray[np.bool_]
) -> NDArray[Any]:
    """Returns the states (m,) of games that begin at positions (m, n, 2), after a check of both."""
    from billiards_env.games.playing import custom_opening

    if positions is None:
        raise ValueError("options['state'] without options['positions']: expected both")
    states = np.zeros(len(mask), setup.game_rules.state_type)
    for k in np.flatnonzero(mask).tolist():
        states[k] = custom_opening(setup, positions[k], state).state
    return states


def _checked_physics(
    ranges: Mapping[str, tuple[float, float]], numbers: Any, many: tuple[int, ...], mask: NDArray[np.bool_]
) -> dict[str, NDArray[np.float64]]:
    """Returns the physics in the options of a reset, after a check."""
    if not isinstance(numbers, Mapping):
        raise TypeError(f"options['physics'] = {short(numbers)}: expected a mapping from names of randomize to numbers")
    checked = {}
    for key, values in numbers.items():
        one_of("key of options['physics']", key, tuple(ranges))
        name, (low, high) = f"options['physics'][{key!r}]", ranges[key]
        checked[key] = array = np.atleast_1d(_for_each(name, values, many, ()))
        bad = array[mask & ~((low <= array) & (array <= high))]
        if bad.size:
            raise ValueError(f"{name} = {bad.flat[0]}: expected a number from {low:g} to {high:g}, as in randomize")
    return checked
