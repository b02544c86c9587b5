"""Variants of the environment for the tests of all variants."""

from __future__ import annotations

from billiards_env.envs.tasks import TASKS
from billiards_env.scene import SCENES, Scene
from billiards_env.scene.layouts import LAYOUTS

RUN_OUTS = {name: task.n_object_balls[0] for name, task in TASKS.items() if task.on}
"""The run-outs and their numbers of object balls."""

LONG = {"max_shots": 3, "observe_shots_left": True}
# All valid pairs of a scene and a task, but "position" and "clear" in two scenes only, in turn with one shot and with
# three. The run-outs are separate.
FITTING = [
    (s, t)
    for s in SCENES
    for t in TASKS
    if t not in RUN_OUTS
    and (t != "pot" or Scene.named(s).table.pockets)
    and (t not in ("position", "clear") or s in ("pool", "real_pool"))
    and (t != "sum_to_three" or s in ("ideal", "sum_to_three"))
    and (t not in ("carom", "three_cushion") or Scene.named(s).n_balls <= 3)
]
RACKS = [{"task": task, "n_object_balls": n, "layout": task, "max_shots": 3} for task, n in RUN_OUTS.items()]
FREE_LAYOUTS = [name for name in LAYOUTS if name not in ("snookered", "snooker", *RUN_OUTS)]
VARIANTS = [
    *({"scene": s, "task": t, **(LONG if k % 2 else {})} for k, (s, t) in enumerate(FITTING)),
    *({"layout": layout} for layout in (*FREE_LAYOUTS, None)),
    *RACKS,
    {**RACKS[0], "layout": "random", "observe_shots_left": True},
    {"layout": "snooker", "scene": "snooker"},
    {"layout": "snookered", "scene": "blocked_pool"},
    {"n_object_balls": 9, "layout": "rack", "max_shots": 2},
    {"scene": {"base": "pool", "balls": {"radius": [0.02, 0.03], "mass": [0.1, 0.2]}}},
    {
        "scene": {"base": "ideal", "balls": {"radius": [0.02, 0.1], "mass": [0.1, "inf"]}},
        "task": "carom",
    },
    {"task": "place", "n_object_balls": 0, "max_shots": 3},
]
