"""Billiards for reinforcement learning: one action is one cue shot, run to rest by an exact event-driven engine.

Importing the package registers `Billiards-v0` and the ids of the frozen tasks with Gymnasium. The engine and numba are
imported on first use.
"""

import importlib
import importlib.util
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import gymnasium

from billiards_env import doors
from billiards_env.scene import Scene
from billiards_env.version import __version__

if TYPE_CHECKING:
    from billiards_env.engine.compile import Engine
    from billiards_env.engine.strikes import Strike, strike
    from billiards_env.engine.threads import set_num_threads
    from billiards_env.envs.actions import register_action
    from billiards_env.envs.observations import register_feature, register_measure
    from billiards_env.envs.tasks import register_task
    from billiards_env.games.referee import register_game
    from billiards_env.scene.layouts import register_layout
    from billiards_env.scene.scene import register_scene
    from billiards_env.shots.simulation import simulate, simulate_batch

__all__ = [
    "Engine",
    "Scene",
    "Strike",
    "__version__",
    "register_action",
    "register_feature",
    "register_game",
    "register_layout",
    "register_measure",
    "register_player",
    "register_scene",
    "register_task",
    "set_num_threads",
    "simulate",
    "simulate_batch",
    "strike",
]

gymnasium.register(
    id="Billiards-v0",
    entry_point="billiards_env.envs:make_env",
    vector_entry_point="billiards_env.envs:make_vector_env",
)
if doors.is_there("the frozen ids"):
    doors.load("the frozen ids")(gymnasium.register)

register_player: Callable[[str, Any], None]

_MODULES = {
    "Engine": "engine.compile",
    "Strike": "engine.strikes",
    "set_num_threads": "engine.threads",
    "simulate": "shots.simulation",
    "simulate_batch": "shots.simulation",
    "strike": "engine.strikes",
    "register_action": "envs.actions",
    "register_feature": "envs.observations",
    "register_game": "games.referee",
    "register_layout": "scene.layouts",
    "register_measure": "envs.observations",
    "register_scene": "scene.scene",
    "register_task": "envs.tasks",
}
"""The module of each name that is imported on first use."""


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(importlib.import_module(f"billiards_env.{_MODULES[name]}"), name)
    if importlib.util.find_spec(f"billiards_env.{name}") is not None:
        return importlib.import_module(f"billiards_env.{name}")
    return doors.attribute(__name__, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
