"""The arguments of the environments: scenes, and the options of `reset`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from billiards_env.checks import one_of, shaped, short
from billiards_env.envs.episodes import cue_ball_alone
from billiards_env.envs.tasks import TASKS
from billiards_env.scene import Scene, check_positions


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
        usual_count: Usual number of object balls; None for that of the scene.

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


def _set_spec(env: Any, spec: EnvSpec | None) -> None:
    if spec is not None and isinstance(spec.kwargs.get("scene"), Scene):
        spec.kwargs = {**spec.kwargs, "scene": spec.kwargs["scene"].to_dict()}
    env._spec = spec


json_spec: Any = property(lambda env: env._spec, _set_spec)
"""The attribute `spec` of an environment. A `Scene` in its arguments becomes a dict, which JSON can hold."""


def check_options(
    scene: Scene, task: str, options: Mapping[str, Any] | None, mask: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Returns the positions and goals in the options of a reset, after a check.

    Args:
        scene: The scene.
        task: The task.
        options: The options.
        mask: None for one environment. For m environments (m,) bool: those to reset. The positions and goals of the
            others are not used and only have to be finite.

    Returns:
        (n, 2) or (m, n, 2) positions of the balls, m, or None if they are not in the options, and (1, 2) or (m, 1, 2)
        goals, m, or None.

    Raises:
        ValueError: If an option is unknown, or a position of a ball or a goal is impossible.
        TypeError: If the options are not a mapping.
    """
    if options is None:
        return None, None
    if not isinstance(options, Mapping):
        raise TypeError(f"options = {short(options)}: expected a dict")
    for key in options:
        one_of("key of options", key, ("positions", "goal") if TASKS[task].goal_radius else ("positions",))
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
    return positions, goals
