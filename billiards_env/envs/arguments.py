"""The arguments of the environments: scenes, and the options of `reset`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from billiards_env.checks import one_of, real, shaped, short
from billiards_env.engine import Engine, checked_engine
from billiards_env.envs.episodes import cue_ball_alone
from billiards_env.envs.tasks import TASKS
from billiards_env.scene import PHYSICS_RANGES, Scene, check_positions, check_ranges

if TYPE_CHECKING:
    from billiards_env.envs.billiards import BilliardsEnv


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
    for key, given in (randomize or {}).items():
        if key == "dt" and engine.mode == "pic":
            raise ValueError("randomize['dt'] with mode='pic': expected mode='pit', PIC has no timestep")
        one_of("key of randomize", key, (*PHYSICS_RANGES, "dt"))
        name = f"randomize[{key!r}]"
        if not isinstance(given, (list, tuple)):
            raise TypeError(f"{name} = {short(given)}: expected (low, high) with low < high")
        pair = tuple(real(name, end) for end in given)
        if len(pair) != 2 or pair[0] >= pair[1]:
            raise ValueError(f"{name} = {short(given)}: expected (low, high) with low < high")
        ranges[key] = pair
    try:
        check_ranges(scene.physics, {key: pair for key, pair in ranges.items() if key != "dt"})
        for dt in ranges.get("dt", ()):
            checked_engine(engine.mode, dt, engine.fix)
    except ValueError as error:
        raise ValueError(f"randomize: {error}") from None
    return ranges


def _set_spec(env: Any, spec: EnvSpec | None) -> None:
    if spec is not None and isinstance(spec.kwargs.get("scene"), Scene):
        spec.kwargs = {**spec.kwargs, "scene": spec.kwargs["scene"].to_dict()}
    env._spec = spec


json_spec: Any = property(lambda env: env._spec, _set_spec)
"""The attribute `spec` of an environment. A `Scene` in its arguments becomes a dict, which JSON can hold."""


def check_options(
    env: BilliardsEnv, options: Mapping[str, Any] | None, mask: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None, dict[str, NDArray[np.float64]]]:
    """Returns the positions, the goals and the physics in the options of a reset, after a check.

    Args:
        env: The environment, or one with the arguments of all.
        options: The options.
        mask: None for one environment. For m environments (m,) bool: those to reset. The values of the others are not
            used, and only their positions and goals have to be finite.

    Returns:
        (n, 2) or (m, n, 2) positions of the balls, m, or None if they are not in the options; (1, 2) or (m, 1, 2)
        goals, m, or None; and numbers of `randomize` by name, () or (m,).

    Raises:
        ValueError: If an option is unknown, a position of a ball or a goal is impossible, or a number is not in its
            range.
        TypeError: If the options or their physics are not a mapping.
    """
    if options is None:
        return None, None, {}
    if not isinstance(options, Mapping):
        raise TypeError(f"options = {short(options)}: expected a dict")
    scene, goal_radius = env.scene, TASKS[env.task].goal_radius
    for key in options:
        one_of("key of options", key, ("positions", *["goal"] * bool(goal_radius), *["physics"] * bool(env.randomize)))
    many = () if mask is None else (len(mask),)
    positions = goals = None
    if "positions" in options:
        name, shape = "options['positions']", (*many, scene.n_balls, 2)
        in_play = None if mask is None else np.broadcast_to(mask[:, None], shape[:2])
        positions = check_positions(scene, shaped(name, options["positions"], shape), name, in_play)
    if "goal" in options:
        goals = shaped("options['goal']", options["goal"], (*many, 2)).reshape(*many, 1, 2)
        in_play = None if mask is None else mask[:, None]
        goals = check_positions(cue_ball_alone(scene), goals, "options['goal'] as a position of the cue ball", in_play)
    return positions, goals, _checked_physics(env.randomize, options.get("physics", {}), mask)


def _checked_physics(
    ranges: Mapping[str, tuple[float, float]], given: Any, mask: NDArray[np.bool_] | None
) -> dict[str, NDArray[np.float64]]:
    """Returns the physics in the options of a reset, after a check."""
    if not isinstance(given, Mapping):
        raise TypeError(f"options['physics'] = {short(given)}: expected a mapping from names of randomize to numbers")
    found = {}
    for key, values in given.items():
        one_of("key of options['physics']", key, tuple(ranges))
        name, (low, high) = f"options['physics'][{key!r}]", ranges[key]
        array = found[key] = shaped(name, values, () if mask is None else mask.shape)
        bad = array[(True if mask is None else mask) & ~((low <= array) & (array <= high))]
        if bad.size:
            raise ValueError(f"{name} = {bad.flat[0]}: expected a number from {low:g} to {high:g}, as in randomize")
    return found
