"""The frozen tasks: ids of Gymnasium with arguments that never change, such as `Billiards/Pot1-v0`.

`FROZEN` has one entry for each id. A change of the results needs a new version of the id. `import billiards_env`
registers the ids, so this module imports only small modules.

Example:
    >>> FROZEN["Pot1-v0"].arguments["n_object_balls"], len(FROZEN)
    (1, 34)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.shots.noise import EXECUTION_NOISE

NAMESPACE = "Billiards/"
"""The beginning of the ids in Gymnasium."""


class Frozen(NamedTuple):
    """A frozen task.

    Attributes:
        arguments: The arguments of `Billiards-v0`. The others have their default values.
        threshold: The mean return from which the task counts as solved, Gymnasium's `reward_threshold`.
        summary: One sentence about the task.
        noise: Whether the environment adds the execution noise `EXECUTION_NOISE` to each shot.
        history: A line for each version.
    """

    arguments: dict[str, Any]
    threshold: float
    summary: str
    noise: bool = False
    history: tuple[str, ...] = ("v0: the first version.",)

    @property
    def execution_noise(self) -> tuple[float, float]:
        """The standard deviations of the direction, degrees, and of the speed, m/s, that a player expects."""
        return (EXECUTION_NOISE["angle_std"], EXECUTION_NOISE["speed_std"]) if self.noise else (0.0, 0.0)


_COMMON = {
    "mode": "pic",
    "action": "velocity",
    "layout": "random",
    "max_shots": 1,
    "max_speed": 4.0,
    "observe": ["positions"],
    "scratch_penalty": 0.1,
    "randomize": None,
}

_SHOTS_LEFT = ["positions", "shots_left"]

# By name: the arguments that differ from _COMMON, the summary, and the thresholds without and with noise. Tasks with
# strikes have two more thresholds, for strikes without and with noise.
_TASKS: dict[str, tuple[dict[str, Any], str, tuple[float, ...]]] = {
    "Pot1": (
        {"task": "pot", "scene": "pool", "n_object_balls": 1},
        "Pot the object ball with one shot.",
        (0.95, 0.75, 0.95, 0.75),
    ),
    "Pot3": (
        {"task": "pot", "scene": "pool", "n_object_balls": 3, "max_shots": 5, "observe": _SHOTS_LEFT},
        "Pot three object balls with at most five shots.",
        (2.8, 2.5, 2.8, 2.5),
    ),
    "Clear5": (
        {"task": "clear", "scene": "pool", "n_object_balls": 5, "max_shots": 10, "observe": _SHOTS_LEFT},
        "Clear the table of five object balls with at most ten shots. Only the last ball scores.",
        (0.95, 0.8, 0.95, 0.8),
    ),
    "Carom": (
        {"task": "carom", "scene": "carom", "n_object_balls": 2, "max_speed": 6.0},
        "Touch both object balls with one shot.",
        (0.95, 0.6),
    ),
    "ThreeCushion": (
        {"task": "three_cushion", "scene": "carom", "n_object_balls": 2, "max_speed": 6.0},
        "Touch both object balls with one shot, the second one after at least three cushion contacts.",
        (0.8, 0.35),
    ),
    "SumToThree": (
        {
            "task": "sum_to_three",
            "scene": "sum_to_three",
            "n_object_balls": 1,
            "max_shots": 5,
            "max_speed": 4.2,
            "observe": _SHOTS_LEFT,
        },
        "Touch the object ball in shots with exactly three cushion contacts in total. An episode has five shots.",
        (4.5, 3.5),
    ),
    "Place": (
        {"task": "place", "scene": "pool", "n_object_balls": 1, "observe": ["positions", "goal"]},
        "Touch the object ball and bring the cue ball to rest at most 0.15 m from the goal.",
        (0.9, 0.6),
    ),
    "Position": (
        {"task": "position", "scene": "pool", "n_object_balls": 1, "observe": ["positions", "goal"]},
        "Pot the object ball and bring the cue ball to rest at most 0.3 m from the goal.",
        (0.6, 0.4, 0.6, 0.4),
    ),
    "Jump": (
        {
            "task": "jump",
            "scene": "jump_pool",
            "n_object_balls": 2,
            "layout": "snookered",
            "action": "strike",
            "max_speed": 6.0,
        },
        "Jump over ball 2, which hides ball 1, and pot ball 1. An action is a strike of the cue.",
        (0.9, 0.3),
    ),
    "NineBall": (
        {
            "task": "nine_ball",
            "scene": "pool",
            "n_object_balls": 9,
            "layout": "nine_ball",
            "max_shots": 30,
            "max_speed": 8.0,
            "observe": ["positions", "legal_balls"],
        },
        "Run out a rack of nine ball from the break, with at most 30 shots.",
        (4.0, 1.5, 4.0, 1.5),
    ),
    "EightBall": (
        {
            "task": "eight_ball",
            "scene": "pool",
            "n_object_balls": 15,
            "layout": "eight_ball",
            "max_shots": 30,
            "max_speed": 8.0,
            "observe": ["positions", "legal_balls"],
        },
        "Run out a rack of eight ball from the break, with at most 30 shots.",
        (7.0, 2.5, 6.0, 1.5),
    ),
}

_STRIKES = {"scene": "real_pool", "action": "strike"}


def _entries() -> dict[str, Frozen]:
    entries = {}
    for name, (arguments, summary, thresholds) in _TASKS.items():
        for k, threshold in enumerate(thresholds):
            strike, noise = k >= 2, k % 2 == 1
            text = summary + strike * " The table has real pockets, and an action is a strike of the cue."
            text += noise * " The environment adds noise to each shot."
            own = _COMMON | arguments | (_STRIKES if strike else {})
            entries[f"{name}{'Strike' * strike}{'Noise' * noise}-v0"] = Frozen(own, threshold, text, noise)
    return entries


FROZEN = _entries()
"""The frozen tasks, by their id without `NAMESPACE`."""

_GAME = {
    "mode": "pic",
    "action": "velocity",
    "max_shots": 200,
    "max_speed": 8.0,
    "scratch_penalty": 0.0,
    "randomize": None,
    "n_players": 2,
    "can_call": False,
    "can_place": True,
    "miss": False,
    "innings": 0,
}
_POOL = ["positions", "legal_balls", "break", "in_hand"]

# By name: the task, the edition of its rules, the scene, the number of object balls, the layout, the target and the
# observation.
_GAMES: dict[str, tuple[str, str, str, int, str, int | None, list[str]]] = {
    "StraightGame": ("straight", "2016", "pool", 15, "rack", 0, [*_POOL, "scores"]),
    "EightBallGame": ("eight_ball", "2016", "pool", 15, "rack", None, _POOL),
    "NineBallGame": ("nine_ball", "2016", "pool", 9, "rack", None, [*_POOL, "fouls"]),
    "TenBallGame": ("ten_ball", "2016", "pool", 10, "rack", None, [*_POOL, "fouls"]),
    "OnePocketGame": ("one_pocket", "2005", "pool", 15, "rack", 8, [*_POOL, "own_pocket", "fouls", "scores"]),
    "BankPoolGame": ("bank_pool", "2006", "pool", 9, "rack", 5, [*_POOL, "fouls", "scores"]),
    "BlackballGame": ("blackball", "2005", "uk_pool", 15, "eight_ball", None, _POOL),
    "SnookerGame": ("snooker", "2014", "snooker", 21, "snooker", 0, [*_POOL, "scores"]),
    "CaromGame": ("carom", "1989", "carom", 2, "carom_opening", 10, ["positions", "legal_balls", "break", "scores"]),
    "ThreeCushionGame": (
        "three_cushion",
        "1989",
        "carom",
        2,
        "carom_opening",
        10,
        ["positions", "legal_balls", "break", "scores"],
    ),
}
_GAME_NAMES = ("task", "edition", "scene", "n_object_balls", "layout", "target", "observe")

# v1: balls that touch the cue ball have their rules, and a snooker behind a free ball is a foul.
# v2: cushions are exact to rounding.
_VERSIONS = {"SnookerGame": 2, "CaromGame": 1, "ThreeCushionGame": 1}

FROZEN_GAMES = {
    f"{name}-v{_VERSIONS.get(name, 0)}": {**_GAME, **dict(zip(_GAME_NAMES, row, strict=True))}
    for name, row in _GAMES.items()
}
"""The arguments of the frozen games of two players, by their id without `NAMESPACE`."""

BENCH_TASKS = ("Pot1Noise-v0", "Clear5Noise-v0", "ThreeCushionNoise-v0", "PositionNoise-v0", "NineBallNoise-v0")
"""The tasks of the leaderboard, and the default of `billiards bench`."""


def register(register_one: Callable[..., None]) -> None:
    """Registers all ids with `gymnasium.register`."""
    entry_points = {
        "entry_point": "billiards_env.envs:make_env",
        "vector_entry_point": "billiards_env.envs:make_vector_env",
    }
    for name, task in FROZEN.items():
        register_one(
            id=NAMESPACE + name,
            **entry_points,
            reward_threshold=task.threshold,
            nondeterministic=False,
            kwargs={**task.arguments, "noise": dict(EXECUTION_NOISE) if task.noise else None},
        )
    for name, arguments in FROZEN_GAMES.items():
        register_one(id=NAMESPACE + name, **entry_points, nondeterministic=False, kwargs=arguments)
