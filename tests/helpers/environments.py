"""Variants of the environment for the tests of all variants, and comparisons of results bit for bit."""

from typing import Any

import numpy as np
import pytest

from billiards_env.envs.tasks import TASKS

RUN_OUTS = {name: task.n_object_balls[0] for name, task in TASKS.items() if task.is_game}
"""The run-outs and their numbers of object balls."""

LONG = {"max_shots": 3, "observe": ["positions", "shots_left"]}
SOFT = {"n_object_balls": 2, "max_shots": 3, "max_speed": 2.0}
"""Some episodes end with a scratch, some at the limit."""
VARIED = {**SOFT, "randomize": {"mu_roll": [0.004, 0.02], "g": [5.0, 15.0]}, "observe": ["positions", "physics"]}
STRIKE = {"n_object_balls": 2, "action": "strike", "max_shots": 3, "scratch_penalty": 0.3}
# Each task, scene, layout, engine, fix and feature is in at least one variant.
VARIANTS: list[dict[str, Any]] = [
    {
        "n_object_balls": 2,
        "max_shots": 3,
        "observe": ["free_to_balls", "cue_to_balls", "balls_to_pockets", "free_to_pockets", "potted", "positions"],
    },
    {"layout": None},
    {"n_object_balls": 9, "layout": "rack", "max_shots": 2},
    {"layout": "tight_rack", "scene": "benchmarks:pooltool_pool"},
    {"scene": "blocked_pool", "layout": "snookered", "max_shots": 2},
    {"scene": "snooker", "layout": "snooker", "max_shots": 2},
    {"scene": "ideal", "task": "carom", "n_object_balls": 5, "layout": "random", "max_shots": 2},
    {"scene": "carom", "task": "carom", "layout": "carom_opening", "scatter": {}, **LONG},
    {"scene": "real_carom", "task": "place"},  # the engine for two balls
    {"scene": "match_carom", "task": "three_cushion", "layout": "random", "max_shots": 2},
    {"scene": "benchmarks:match_carom_2", "task": "three_cushion"},
    {"scene": "jump_pool", "task": "jump", "action": "strike", "max_shots": 2, "observe": ["positions", "times_over"]},
    {"task": "clear", "n_object_balls": 10, "layout": "ten_ball", "max_shots": 2},
    {"task": "clear", "n_object_balls": 9, "layout": "nine_ball_2025", "max_shots": 2},
    {"scene": "benchmarks:pooltool_carom", "task": "three_cushion", **LONG},
    {"scene": "sum_to_three", "task": "sum_to_three", "layout": "line", **LONG},
    {"task": "place", "n_object_balls": 0, "max_shots": 3, "observe": [["planes", 36, 40], "goal", ["pixels", 40, 36]]},
    {"scene": "benchmarks:pooltool_real_carom", "task": "place", "layout": "random"},
    # One object ball: the engine for two balls.
    {"scene": "real_pool", "task": "position", **LONG, "observe": ["positions", "goal"]},
    {"scene": "uk_pool", "task": "clear", "max_shots": 2, "observe": [["pixels", 36, 40]]},
    {"scene": "pool", "task": "position", "n_object_balls": 2, "max_shots": 3, "observe": "goal"},
    STRIKE,
    *({"task": task, "n_object_balls": n, "layout": task, "max_shots": 3} for task, n in RUN_OUTS.items()),
    {"task": "nine_ball", "n_object_balls": 9, "layout": "random", **LONG, "observe": ["shots_left", "legal_balls"]},
    {"scene": {"base": "pool", "balls": {"radius": [0.02, 0.03], "mass": [0.1, 0.2]}}},
    {"scene": {"base": "ideal", "balls": {"radius": [0.02, 0.1], "mass": [0.1, "inf"]}}, "task": "carom"},
    {"randomize": {"mu_roll": [0.005, 0.02], "e_ball": [0.85, 0.95]}, "observe": ["physics", "positions"]},
    {"scene": "real_pool", "task": "position", "randomize": {"g": [8.0, 11.0]}, "observe": ["positions", "physics"]},
    {"mode": "pit", "dt": 0.01, "randomize": {"dt": [0.005, 0.05], "mu_slide": [0.1, 0.3]}, "max_shots": 2},
    {"mode": "pit", "dt": 1 / 15, "n_object_balls": 9, "layout": "rack", "max_shots": 5, "max_speed": 8.0},
    {"mode": "pit", "dt": 1 / 60, "fix": "move_back", "scene": "carom", "task": "carom", "scatter": {}, "max_shots": 5},
    {"mode": "pit", "dt": 1 / 60, "fix": "none", "scene": "uk_pool", **LONG, "observe": ["first_hit_velocities"]},
    {"mode": "pit", "dt": 1 / 30, "fix": "time_of_impact", "scene": "ideal", "task": "carom", "max_speed": 10.0},
]
# Games of several players: each game, and each kind of action and choice.
GAME_VARIANTS: list[dict[str, Any]] = [
    {"task": "nine_ball", "n_players": 2, "max_shots": 5, "noise": {}},
    {"task": "eight_ball", "n_players": 2, "max_shots": 4, "action": "plan", "observe": ["positions", "turn"]},
    {"task": "ten_ball", "n_players": 2, "can_call": True, "observe": ["choices", "fouls", "in_hand", "break"]},
    {"task": "straight", "n_players": 4, "n_object_balls": 4, "target": 2, "layout": "random", "action": "cut"},
    {"task": "snooker", "n_players": 2, "n_object_balls": 8, "can_call": True, "miss": True, "max_shots": 9},
    {
        **{"task": "carom", "n_players": 2, "target": 2, "innings": 3, "can_call": True, "action": "strike"},
        "observe": ["cue_to_balls", "scores", "potted"],
    },
    {"task": "three_cushion", "n_players": 3, "max_shots": 4, "randomize": {"mu_roll": [0.004, 0.01]}},
    {"task": "one_pocket", "n_players": 2, "n_object_balls": 3, "max_shots": 6, "observe": ["positions", "own_pocket"]},
    {"task": "bank_pool", "n_players": 2, "n_object_balls": 9, "can_call": True, "max_shots": 4},
    {"task": "blackball", "n_players": 2, "layout": "random", "max_shots": 5, "can_place": False},
    {"task": "nine_ball", "n_players": 2, "mode": "pit", "dt": 1 / 60, "max_shots": 4, "observe": [["planes", 36, 40]]},
]


def name_of(argument: Any) -> str:
    """Returns the arguments of an environment, or a mode of autoreset, as the id of a test."""
    if isinstance(argument, dict):
        return ",".join(map(str, argument.values()))[:60]
    return str(getattr(argument, "value", argument))


NINE: dict[str, Any] = {"task": "nine_ball", "max_shots": 3, "max_speed": 8.0, "noise": {}}
# Kinds of states.
KINDS: list[dict[str, Any]] = [
    {**VARIED, "noise": {"angle_std": 2.0}},
    NINE,
    {"task": "place", "max_shots": 3, "observe": ["positions", "first_hit_velocities"]},
    {**STRIKE, "noise": {}},
    {**SOFT, "mode": "pit", "dt": 1 / 15, "randomize": {"dt": [0.01, 0.1]}},
    {"task": "snooker", "n_players": 2, "n_object_balls": 8, "can_call": True, "miss": True, "max_shots": 3},
    {"task": "carom", "n_players": 2, "action": "cut", "max_shots": 3},
]
kinds = pytest.mark.parametrize("kwargs", KINDS, ids=name_of)


def same(one: Any, other: Any) -> None:
    """Fails unless both are equal bit for bit: values, types, shapes and keys.

    Gymnasium's vector environments return bools of infos as objects, with None for an environment without an info.
    """
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key, value in one.items():
            same(value, other[key])
    elif isinstance(one, np.ndarray):
        if one.dtype == np.bool_ and other.dtype == object:
            other = np.array([False if value is None else value for value in other])
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        if one.dtype == object:
            same(one.tolist(), other.tolist())
        else:
            assert one.tobytes() == other.tobytes()
    elif isinstance(one, (tuple, list)):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            same(a, b)
    else:
        assert one == other
