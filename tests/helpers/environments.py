"""Variants of the environment for the tests of all variants."""

from __future__ import annotations

from billiards_env.envs.tasks import TASKS

RUN_OUTS = {name: task.n_object_balls[0] for name, task in TASKS.items() if task.opening}
"""The run-outs and their numbers of object balls."""

LONG = {"max_shots": 3, "observe_shots_left": True}
# Each task, scene and layout is in at least one variant.
VARIANTS = [
    {"n_object_balls": 2, **LONG},
    {"layout": None},
    {"n_object_balls": 9, "layout": "rack", "max_shots": 2},
    {"layout": "tight_rack", "scene": "pooltool_pool"},
    {"scene": "blocked_pool", "layout": "snookered", "max_shots": 2},
    {"scene": "snooker", "layout": "snooker", "max_shots": 2},
    {"scene": "ideal", "task": "carom", "n_object_balls": 5, "layout": "random", "max_shots": 2},
    {"scene": "carom", "task": "carom", "layout": "carom_opening", **LONG},
    {"scene": "real_carom", "task": "three_cushion"},
    {"scene": "pooltool_carom", "task": "three_cushion", **LONG},
    {"scene": "sum_to_three", "task": "sum_to_three", "layout": "line", **LONG},
    {"task": "place", "n_object_balls": 0, "max_shots": 3},
    {"scene": "pooltool_real_carom", "task": "place", "layout": "random"},
    {"scene": "real_pool", "task": "position", **LONG},  # one object ball: the engine for two balls
    {"scene": "uk_pool", "task": "clear", "max_shots": 2},
    *({"task": task, "n_object_balls": n, "layout": task, "max_shots": 3} for task, n in RUN_OUTS.items()),
    {"task": "nine_ball", "n_object_balls": 9, "layout": "random", **LONG},
    {"scene": {"base": "pool", "balls": {"radius": [0.02, 0.03], "mass": [0.1, 0.2]}}},
    {"scene": {"base": "ideal", "balls": {"radius": [0.02, 0.1], "mass": [0.1, "inf"]}}, "task": "carom"},
    {"randomize": {"mu_roll": [0.005, 0.02], "e_ball": [0.85, 0.95]}, "observe_physics": True, **LONG},
    {"scene": "real_pool", "task": "position", "randomize": {"g": [8.0, 11.0]}, "observe_physics": True},
    {"mode": "pit", "dt": 0.01, "randomize": {"dt": [0.005, 0.05], "mu_slide": [0.1, 0.3]}, "max_shots": 2},
    {"mode": "pit", "dt": 1 / 60, "n_object_balls": 2, "max_shots": 2},
    {"mode": "pit", "dt": 0.01, "fix": "move_back", "scene": "carom", "task": "carom"},
    {"mode": "pit", "dt": 1 / 60, "fix": "none", "scene": "uk_pool", "max_shots": 2},
]
