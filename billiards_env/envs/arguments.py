"""Checks of arguments: `make_model` for the arguments of `gym.make`, `check_options` for the options of `reset`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from billiards_env.checks import integer, one_of, real, shaped, short, unmasked
from billiards_env.engine import Engine
from billiards_env.engine.compile import check_varied_name
from billiards_env.envs.actions import ACTIONS, ELEVATION, SIDE, SPEED, TOP, TURN, check_action
from billiards_env.envs.tasks import TASKS, task_targets
from billiards_env.frozen import NOISE
from billiards_env.jit import streams
from billiards_env.scene import Balls, Scene, check_positions, check_ranges, layouts


class Model(NamedTuple):
    """The checked arguments of an environment, see `make_model`. Its episodes read them and do not change them.

    Attributes:
        scene: The scene.
        task: One of `TASKS`.
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
        noise_seed: A second seed of the noise, or None.
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


def make_model(
    *,
    scene: str | Scene | Mapping[str, Any] | None = None,
    task: str = "pot",
    n_object_balls: int | None = None,
    mode: str = "pic",
    dt: float | None = None,
    fix: str | None = None,
    action: str = "velocity",
    max_shots: int | None = None,
    max_speed: float = 4.0,
    layout: str | None = None,
    observe: Sequence[Any] | None = None,
    goal_radius: float | None = None,
    scratch_penalty: float = 0.1,
    randomize: Mapping[str, Sequence[float]] | None = None,
    noise: Mapping[str, float] | None = None,
    noise_seed: int | None = None,
) -> Model:
    """Returns the arguments of an environment after a check. The docstring of `BilliardsEnv` describes them.

    Raises:
        ValueError: If an argument is invalid.
        TypeError: If an argument has the wrong type.
    """
    one_of("task", task, tuple(TASKS))
    entry = TASKS[task]
    least, most = entry.n_object_balls
    board = make_scene(scene, n_object_balls, entry.scene, least if least == most else None)
    targets, engine = task_targets(task, board), Engine(mode, dt, fix)
    layout = entry.layout if layout is None else layout
    layouts.draw(layout, board, np.random.default_rng(0))  # an invalid layout raises here, not in `reset`
    speed = real("max_speed", max_speed, "max_speed")
    if goal_radius is not None and not entry.goal_radius:
        raise ValueError(f"goal_radius = {short(goal_radius)} with task = {task!r}: expected a task with a goal")
    return Model(
        scene=board,
        task=task,
        targets=targets,
        engine=engine,
        action=check_action(action, board),
        max_shots=integer("max_shots", entry.max_shots if max_shots is None else max_shots, "max_shots"),
        max_speed=speed,
        layout=layout,
        observe=observe,
        goal_radius=entry.goal_radius if goal_radius is None else real("goal_radius", goal_radius, "length"),
        scratch_penalty=real("scratch_penalty", scratch_penalty, "scratch_penalty"),
        randomize=check_randomize(randomize, board, engine),
        noise=check_noise(noise, board, action, speed),
        noise_seed=None if noise_seed is None else integer("noise_seed", noise_seed, "seed"),
    )


class ResetOptions(NamedTuple):
    """The options of a reset of m environments.

    Attributes:
        positions: (m, n, 2) positions of the balls, m; None to draw them.
        goals: (m, 1, 2) goals, m; None to draw them.
        physics: Numbers of `randomize` by name, (m,) each; the others are drawn.
        episode_seed: (m, 8) uint64, the random streams of layouts and noise; None to continue the current ones.
    """

    positions: NDArray[np.float64] | None = None
    goals: NDArray[np.float64] | None = None
    physics: Mapping[str, NDArray[np.float64]] = {}
    episode_seed: NDArray[np.uint64] | None = None


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
    if not isinstance(noise, Mapping):
        raise TypeError(f"noise = {short(noise)}: expected a mapping from {', '.join(NOISE)} to numbers")
    for key in noise:
        one_of("key of noise", key, tuple(NOISE))
    stds = {name: real(name, value, name) for name, value in {**NOISE, **noise}.items()}
    scales = np.empty(5)
    scales[TURN], scales[SPEED] = stds["angle_std"] / 180.0, stds["speed_std"] / max_speed
    scales[[SIDE, TOP]] = stds["offset_std"] / (scene.cue.miscue_offset * scene.balls.radius[0])
    scales[ELEVATION] = stds["elevation_std"] / 90.0
    return scales[: ACTIONS[action].size]


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
    env._spec = spec


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
    known = "positions", *["goal"] * bool(model.goal_radius), *["physics"] * bool(model.randomize), "episode_seed"
    for key in options:
        one_of("key of options", key, known)
    many = () if mask is None else (len(mask),)
    positions = goals = seeds = None
    if "positions" in options:
        name, shape = "options['positions']", (*many, scene.n_balls, 2)
        in_play = None if mask is None else np.broadcast_to(mask[:, None], shape[:2])
        positions = check_positions(scene, shaped(name, options["positions"], shape), name, in_play)
        positions = positions.reshape(-1, *shape[-2:])
    if "goal" in options:
        goals = shaped("options['goal']", options["goal"], (*many, 2)).reshape(*many, 1, 2)
        in_play = None if mask is None else mask[:, None]
        goals = check_positions(cue_ball_alone(scene), goals, "options['goal'] as a position of the cue ball", in_play)
        goals = goals.reshape(-1, 1, 2)
    if "episode_seed" in options:
        name = "options['episode_seed']"
        array = np.asarray(unmasked(name, options["episode_seed"]))
        if array.dtype != np.int64 or array.shape != (*many, 8):
            raise ValueError(f"{name} = {short(array)}: expected int64 of shape {(*many, 8)}, as in info")
        seeds = array.view(np.uint64).reshape(-1, 8)
        read = seeds[... if mask is None else mask].reshape(-1, 2, 4)[:, : 1 if model.noise is None else 2]
        if not streams.are_seeded(read).all():
            raise ValueError(f"{name} = {short(array)}: expected an info['episode_seed'] of this task")
    return ResetOptions(positions, goals, _checked_physics(model.randomize, options.get("physics", {}), mask), seeds)


def _checked_physics(
    ranges: Mapping[str, tuple[float, float]], numbers: Any, mask: NDArray[np.bool_] | None
) -> dict[str, NDArray[np.float64]]:
    """Returns the physics in the options of a reset, after a check."""
    if not isinstance(numbers, Mapping):
        raise TypeError(f"options['physics'] = {short(numbers)}: expected a mapping from names of randomize to numbers")
    checked = {}
    for key, values in numbers.items():
        one_of("key of options['physics']", key, tuple(ranges))
        name, (low, high) = f"options['physics'][{key!r}]", ranges[key]
        array = shaped(name, values, () if mask is None else mask.shape)
        checked[key] = np.atleast_1d(array)
        bad = array[(True if mask is None else mask) & ~((low <= array) & (array <= high))]
        if bad.size:
            raise ValueError(f"{name} = {bad.flat[0]}: expected a number from {low:g} to {high:g}, as in randomize")
    return checked
