"""The features of observations. `FEATURES` has one entry for each.

`gym.make("Billiards-v0", observe=("positions", "shots_left"))` chooses and orders them. An environment compiles and
runs only the writers of its own features.

Example:
    >>> import gymnasium as gym
    >>> env = gym.make("billiards_env:Billiards-v0", observe=("shots_left", "cue_to_balls")).unwrapped
    >>> observation, _ = env.reset(seed=0)
    >>> seen = env.decode(observation)
    >>> observation.shape, seen["shots_left"].item(), seen["cue_to_balls"].shape
    ((4,), 1.0, (1, 3))
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from billiards_env.doors import Entries, offered
from billiards_env.engine.measures import MEASURES, Measure
from billiards_env.engine.shots import Shots
from billiards_env.envs.arguments import Model
from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.envs.goal_observations import ACHIEVED, DESIRED, write_achieved, write_desired
from billiards_env.envs.tasks import task_of
from billiards_env.games.game_state import ANYWHERE, BEHIND, CALLS, PUSH_OUT
from billiards_env.jit import Typed, check_kernel, entry_point, inlined
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import distance_to_segment
from billiards_env.physics.state import CUE_BALL, SceneArrays, State, X, Y
from billiards_env.scene import Scene
from billiards_env.support.checks import (
    Range,
    add_entry,
    check_attributes,
    entry_of,
    integer,
    is_foreign,
    key_of,
    real,
    result_of,
    sequence,
    short,
)

_LEEWAY = 1e-9  # m, by which a path may overlap a ball, because the positions of balls that touch are rounded

USUAL = ("positions", "goal", "legal_balls", "break", "in_hand", "own_pocket", "choices", "fouls", "scores")
"""The features of an environment without the argument `observe`, as far as its task has them."""


class Source(NamedTuple):
    """The data from which features are computed.

    Attributes:
        model: The arguments of the environment.
        arrays: The episodes.
        numbers: The constants of the task.
        physics: The numbers of `randomize` by name, (m,) each.
    """

    model: Model
    arrays: EpisodeArrays
    numbers: TaskNumbers
    physics: Mapping[str, NDArray[np.float64]]

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.model.scene

    @property
    def half_extents(self) -> tuple[float, float]:
        """`Scene.half_extents`, m."""
        return self.model.scene.half_extents

    @property
    def pockets(self) -> NDArray[np.float64]:
        """(p, 2) the centres of the pockets, m."""
        return self.scene.table.pocket_places

    @property
    def reach(self) -> float:
        """The largest distance of a ball's centre from another one or from a pocket's, m."""
        half = np.array(self.half_extents)
        return math.hypot(*(half + np.abs(np.vstack((self.pockets, half))).max(axis=0)))

    @property
    def touching(self) -> NDArray[np.float64]:
        """(n, n) the horizontal distances of the centres of balls that touch, m."""
        return self.scene.balls.contact_distances(np.arange(self.scene.n_balls)[:, None])

    @property
    def sizes(self) -> dict[str, int]:
        """The sizes in `Feature.shape` by name."""
        n = self.scene.n_balls
        return {
            "balls": n,
            "object balls": n - 1,
            "legal balls": max(self.arrays.legal_balls.shape[1] - 1, 0),
            "pockets": len(self.pockets),
            "goals": self.arrays.goals.shape[1],
            "numbers": len(self.physics),
            "planes": 3 + self.arrays.goals.shape[1],
            **players_of(self.model),
        }


@entry_point
def write_places(begin, end, observations, first, places, half_extents):
    """Writes x and y of places (m, n, 2), divided by `Scene.half_extents`."""
    for k in range(begin, end):
        for i in range(places.shape[1]):
            for c in range(2):
                place = places[k, i, c] / half_extents[c]
                observations[k, first + 2 * i + c] = min(max(place, -1.0), 1.0)


@entry_point
def write_flags(begin, end, observations, first, flags, ball, value):
    """Writes 1 for each ball from `ball` on if its flag has the value, else 0."""
    for k in range(begin, end):
        for i in range(ball, flags.shape[1]):
            observations[k, first + i - ball] = 1.0 if flags[k, i] == value else 0.0


@entry_point
def write_shots_left(begin, end, observations, first, fresh, shots_left, max_shots):
    """Writes the fraction of the shots that are left."""
    for k in range(begin, end):
        observations[k, first] = 1.0 if fresh[k] else shots_left[k] / max_shots


@entry_point
def write_physics(begin, end, observations, first, physics, ranges):
    """Writes the numbers of `randomize`, scaled from their ranges to [-1, 1]."""
    for k in range(begin, end):
        for j in range(len(physics)):
            low, high = ranges[j]
            observations[k, first + j] = 2.0 * (physics[j][k] - low) / (high - low) - 1.0


def players_of(model: Model) -> dict[str, int]:
    """Returns the sizes of the features of games of several players; 0 where the game has no such thing."""
    if model.setup is None:
        return dict.fromkeys(("turn", "in hand", "own pocket", "choices", "fouls", "scores"), 0)
    setup, game = model.setup, model.setup.game_rules
    counted = game.counts_fouls and (setup.n_players == 2 if setup.target is None else setup.target > 0)
    return {
        "turn": 1,
        "in hand": 2 * game.pockets,
        "own pocket": int(game.foot_corners),
        "choices": (len(CALLS) - PUSH_OUT) * model.can_call,
        "fouls": setup.n_players * counted,
        "scores": setup.n_players * (setup.target is not None),
    }


@entry_point
def write_measure(begin, end, observations, first, fresh, values, largest):
    """Writes the numbers of a measure of the last shots, (m, l), divided by `largest`; 0 for infinite ones."""
    for k in range(begin, end):
        for j in range(values.shape[1]):
            is_known = not fresh[k] and values[k, j] < math.inf
            observations[k, first + j] = min(max(values[k, j] / largest, -1.0), 1.0) if is_known else 0.0


def feature_of(name: str, measure: Measure) -> Feature:
    """Returns the feature of a measure of the last shot."""

    def reads(source: Source) -> tuple[Any, ...]:
        fresh, values = source.arrays.fresh, source.arrays.measures[name]
        largest = measure.largest(source.scene, source.model.max_speed)
        return fresh, values.reshape(len(fresh), -1), real(f"largest of measure {name!r}", largest, _LARGEST)

    summary = f"{measure.summary}, in the last shot of the episode; zeros if there is none"
    return Feature(summary, measure.shape, -1.0, write_measure, reads)


@entry_point
def write_turn(begin, end, observations, first, states, viewers):
    """Writes 1 if the player who observes is to shoot."""
    for k in range(begin, end):
        observations[k, first] = 1.0 if viewers[k] < 0 or viewers[k] == states[k].player else 0.0


@entry_point
def write_in_hand(begin, end, observations, first, states):
    """Writes whether the cue ball is in hand behind the head string, and whether it is in hand anywhere."""
    for k in range(begin, end):
        observations[k, first] = 1.0 if states[k].in_hand == BEHIND else 0.0
        observations[k, first + 1] = 1.0 if states[k].in_hand == ANYWHERE else 0.0


@entry_point
def write_own_pocket(begin, end, observations, first, states, viewers):
    """Writes 1 if the player who observes owns the foot corner with y > 0, which belongs to player 1."""
    for k in range(begin, end):
        viewer = states[k].player if viewers[k] < 0 else viewers[k]
        observations[k, first] = 1.0 if viewer == 1 else 0.0


@entry_point
def write_choices(begin, end, observations, first, states):
    """Writes which of the choices of `CALLS` from "push_out" on the player to shoot has."""
    for k in range(begin, end):
        for c in range(PUSH_OUT, len(CALLS)):
            observations[k, first + c - PUSH_OUT] = 1.0 if states[k].choices >> c & 1 else 0.0


@entry_point
def write_of_players(begin, end, observations, first, values, states, viewers, limits):
    """Writes a number of each player, the player who observes first; `limits` are the scale and the least number."""
    scale, least = limits
    for k in range(begin, end):
        players, viewer = states[k].n_players, states[k].player if viewers[k] < 0 else viewers[k]
        for p in range(players):
            observations[k, first + p] = min(max(values[k, (viewer + p) % players] / scale, least), 1.0)


def score_scale(model: Model) -> float:
    """Returns the score that a feature shows as 1: the target, or the points on a full table."""
    assert model.setup is not None
    return float(model.setup.target or model.setup.game_rules.most_points(model.scene.n_balls - 1))


@entry_point
def write_cue_to_balls(begin, end, observations, first, positions, in_play, reach):
    """Writes the distances and directions from the cue ball to the object balls."""
    for k in range(begin, end):
        x, y = positions[k, CUE_BALL, X], positions[k, CUE_BALL, Y]
        for i in range(1, positions.shape[1]):
            both = in_play[k, CUE_BALL] and in_play[k, i]
            way = positions[k, i, X] - x, positions[k, i, Y] - y
            _write_way(observations, k, first + 3 * (i - 1), both, way, reach)


@entry_point
def write_balls_to_pockets(begin, end, observations, first, positions, in_play, pockets, reach):
    """Writes the distances and directions from the object balls to the pockets."""
    for k in range(begin, end):
        for i in range(1, positions.shape[1]):
            for p in range(len(pockets)):
                way = pockets[p, X] - positions[k, i, X], pockets[p, Y] - positions[k, i, Y]
                column = first + 3 * ((i - 1) * len(pockets) + p)
                _write_way(observations, k, column, in_play[k, i], way, reach)


@inlined
def _write_way(observations, k, column, is_there, way, reach):
    """Writes the length of a vector over `reach`, and its direction (x, y); zeros without `is_there`."""
    length = norm(way[X], way[Y]) if is_there else 0.0
    observations[k, column] = min(length / reach, 1.0)
    for c in range(2):
        observations[k, column + 1 + c] = way[c] / length if length > 0.0 else 0.0


@entry_point
def write_free_to_balls(begin, end, observations, first, positions, in_play, touching):
    """Writes 1 for each object ball that the cue ball can hit full without touching another ball, else 0."""
    for k in range(begin, end):
        x, y = positions[k, CUE_BALL, X], positions[k, CUE_BALL, Y]
        for i in range(1, positions.shape[1]):
            to_x, to_y = positions[k, i, X] - x, positions[k, i, Y] - y
            share = max(1.0 - touching[CUE_BALL, i] / max(norm(to_x, to_y), 1e-300), 0.0)  # of the way to the hit
            is_clear = _is_clear_path(
                k, CUE_BALL, i, (x + share * to_x, y + share * to_y), positions, in_play, touching
            )
            observations[k, first + i - 1] = 1.0 if is_clear and in_play[k, i] else 0.0


@entry_point
def write_free_to_pockets(begin, end, observations, first, positions, in_play, pockets, touching):
    """Writes 1 for each object ball and pocket if no ball is on the straight line between them, else 0."""
    for k in range(begin, end):
        for i in range(1, positions.shape[1]):
            for p in range(len(pockets)):
                is_clear = _is_clear_path(k, i, i, (pockets[p, X], pockets[p, Y]), positions, in_play, touching)
                observations[k, first + (i - 1) * len(pockets) + p] = 1.0 if is_clear else 0.0


@inlined
def _is_clear_path(k, i, target, end, positions, in_play, touching):
    """Returns whether ball i is on the table and touches no ball but `target` on the straight line to a point."""
    x, y = positions[k, i, X], positions[k, i, Y]
    for j in range(positions.shape[1]):
        if j != i and j != target and in_play[k, j]:
            distance = distance_to_segment(x, y, end[X], end[Y], positions[k, j, X], positions[k, j, Y])
            if distance < touching[i, j] - _LEEWAY:
                return False
    return in_play[k, i]


class Feature(NamedTuple):
    """A part of observations: numbers in the row of features, or an image.

    Attributes:
        summary: What the numbers are, for the documentation.
        shape: The shape of the numbers of one episode; sizes by their names in `Source.sizes`.
        low: The least value, or one for each number of the last axis.
        write: The entry point `(begin, end, observations, first, *reads)`, which writes the numbers of the episodes
            from `begin` to `end - 1` to their rows of `observations`, from the column `first`. That of an image is
            `(begin, end, images, *reads)`.
        reads: Returns the other arguments of `write`; for an image also from its height and width.
        needs: What the environment must have, so that no size is 0; empty for nothing.
        is_image: Whether it is an image of bytes, up to 255. The largest value of the others is 1.
    """

    summary: str
    shape: tuple[int | str, ...]
    low: float | tuple[float, ...]
    write: Callable[..., None]
    reads: Callable[..., tuple[Any, ...]]
    needs: str = ""
    is_image: bool = False


FEATURES: Entries[Feature] = {
    "positions": Feature(
        "x and y of each ball, divided by half the length and half the width of the table",
        ("balls", 2),
        -1.0,
        write_places,
        lambda source: (source.arrays.positions, source.half_extents),
    ),
    "goal": Feature(
        "x and y of the goal, in the same units",
        ("goals", 2),
        -1.0,
        write_places,
        lambda source: (source.arrays.goals, source.half_extents),
        "a task with a goal",
    ),
    "legal_balls": Feature(
        "1 for each object ball that may be touched first, else 0",
        ("legal balls",),
        0.0,
        write_flags,
        lambda source: (source.arrays.legal_balls, 1, True),
        "a run-out or a game",
    ),
    "shots_left": Feature(
        "the number of shots left, divided by `max_shots`",
        (),
        0.0,
        write_shots_left,
        lambda source: (source.arrays.fresh, source.arrays.shots_left, source.numbers.max_shots),
    ),
    "physics": Feature(
        "the numbers of `randomize`, scaled from their ranges to [-1, 1]",
        ("numbers",),
        -1.0,
        write_physics,
        lambda source: (tuple(source.physics.values()), tuple(source.model.randomize.values())),
        "numbers in randomize",
    ),
    "potted": Feature(
        "1 for each ball out of play, else 0",
        ("balls",),
        0.0,
        write_flags,
        lambda source: (source.arrays.in_play, 0, False),
    ),
    "cue_to_balls": Feature(
        "distance and direction (x, y) from the cue ball to each object ball; zeros if one of them is potted",
        ("object balls", 3),
        (0.0, -1.0, -1.0),
        write_cue_to_balls,
        lambda source: (source.arrays.positions, source.arrays.in_play, source.reach),
        "an object ball",
    ),
    "balls_to_pockets": Feature(
        "distance and direction (x, y) from each object ball to the centre of each pocket; zeros if the ball is potted",
        ("object balls", "pockets", 3),
        (0.0, -1.0, -1.0),
        write_balls_to_pockets,
        lambda source: (source.arrays.positions, source.arrays.in_play, source.pockets, source.reach),
        "an object ball, a table with pockets",
    ),
    "free_to_balls": Feature(
        "1 for each object ball that the cue ball hits full on a straight line without touching another ball, else 0; "
        "0 if one of the two is potted",
        ("object balls",),
        0.0,
        write_free_to_balls,
        lambda source: (source.arrays.positions, source.arrays.in_play, source.touching),
        "an object ball",
    ),
    "free_to_pockets": Feature(
        "1 for each object ball and pocket if the ball touches no other ball on the straight line to the centre of the "
        "pocket, else 0; 0 if the ball is potted",
        ("object balls", "pockets"),
        0.0,
        write_free_to_pockets,
        lambda source: (source.arrays.positions, source.arrays.in_play, source.pockets, source.touching),
        "an object ball, a table with pockets",
    ),
    "turn": Feature(
        "1 if the player who observes is to shoot, else 0",
        ("turn",),
        0.0,
        write_turn,
        lambda source: (source.arrays.states, source.arrays.viewers),
        "n_players > 1",
    ),
    "break": Feature(
        "1 if the next shot is the break, else 0",
        ("turn",),
        0.0,
        write_flags,
        lambda source: (source.arrays.states["break_shot"][:, None], 0, True),
        "n_players > 1",
    ),
    "in_hand": Feature(
        "1 if the cue ball is in hand behind the head string, and 1 if it is in hand anywhere, else 0",
        ("in hand",),
        0.0,
        write_in_hand,
        lambda source: (source.arrays.states,),
        "n_players > 1, a game with pockets",
    ),
    "own_pocket": Feature(
        "1 if the player who observes owns the foot corner with y > 0, and 0 for the other foot corner",
        ("own pocket",),
        0.0,
        write_own_pocket,
        lambda source: (source.arrays.states, source.arrays.viewers),
        "one-pocket with n_players = 2",
    ),
    "choices": Feature(
        '1 for each choice of `games.game_state.CALLS` from "push_out" on that the player to shoot has, else 0',
        ("choices",),
        0.0,
        write_choices,
        lambda source: (source.arrays.states,),
        "can_call = True",
    ),
    "fouls": Feature(
        "the number of consecutive fouls of each player, divided by 3; the player who observes is the first",
        ("fouls",),
        0.0,
        write_of_players,
        lambda source: (source.arrays.states["fouls"], source.arrays.states, source.arrays.viewers, (3.0, 0.0)),
        "n_players > 1, a game that penalises three consecutive fouls",
    ),
    "scores": Feature(
        "the score of each player, divided by the target or by the points of a full table; the player who observes is "
        "the first",
        ("scores",),
        -1.0,
        write_of_players,
        lambda source: (
            source.arrays.states["scores"],
            source.arrays.states,
            source.arrays.viewers,
            (score_scale(source.model), -1.0),
        ),
        "n_players > 1, a game that is won by points",
    ),
    **{name: feature_of(name, measure) for name, measure in MEASURES.items()},
} | offered("observe")
"""The features by name: those above, one for each measure, and images, which attachments add."""


def register_feature(name: str, feature: Feature) -> None:
    """Adds a feature of another package to `FEATURES`. The errors are those of `checks.add_entry`."""
    reads = 3 if isinstance(feature, Feature) and feature.is_image else 1  # an image has a height and a width
    least = Range(float(np.finfo(np.float32).min), 1.0)
    add_entry("feature", name, feature, FEATURES, Feature, {"low": least}, reads=reads)


def register_measure(name: str, measure: Measure) -> None:
    """Adds a measure of another package to `engine.measures.MEASURES`, and its feature to `FEATURES`.

    The errors are those of `checks.add_entry`.

    Raises:
        TypeError: Also if `record` is not a kernel.
        ValueError: Also if a size of the shape is invalid, `record` uses a field that `SceneArrays`, `State` or `Shots`
            does not have, or a feature that is not a measure has the name.
    """
    if isinstance(measure, Measure):
        check_kernel(f"record of measure {name!r} = {short(measure.record)}", measure.record)
    if name in FEATURES and name not in MEASURES:
        raise ValueError(f"name = {name!r}: expected a name that no other feature has")
    add_entry("measure", name, measure, dict(MEASURES), Measure, record=7, largest=2)  # checks the types
    for size in measure.shape:
        if size != "balls":
            integer(f"size in shape of measure {name!r}", size, _SIZES)
    fields = SceneArrays._fields, State._fields, Shots._fields
    check_attributes(f"record of measure {name!r}", measure.record, *[()] * 4, *fields)
    MEASURES[name] = measure
    FEATURES[name] = feature_of(name, measure)


_LARGEST, _SIZES = Range(1e-12, 1e12), Range(1, 1_000_000)
"""The range of `Measure.largest`, and of the numbers in `Measure.shape`."""

ROW = "observation"
"""The key of the row of features in an observation that also has images or goals."""

SIDES = Range(8, 4096, "pixels")
"""Range of the height and of the width of an image."""


class Observer:
    """Writes observations: the features one after the other, and images.

    An observation is the row of the numbers of all features, or one image. With both, or with several images, it is a
    dict: the images by name, and the row with the key `ROW`. With "goal" it is the dict of `envs.goal_observations`.

    Args:
        observe: The names of the features, for an image with height and width: `("pixels", 84, 84)`. None for the
            features of `USUAL` that the environment has. "goal" for these without the goal, and the dict with goals.
        source: The data of the features.

    Attributes:
        names: `observe`, or the usual features.
        features: The shape of each feature by name, in the order of the observation.
        space: The space of an observation.

    Raises:
        TypeError: If the names are not a list.
        ValueError: If there is no such feature, the environment does not have it, or a name is repeated.
    """

    def __init__(self, observe: Sequence[Any] | None, source: Source) -> None:
        sizes, self._source = source.sizes, source
        usual = [name for name in USUAL if sizes[cast(str, FEATURES[name].shape[0])]]
        self._task = task_of(source.model.task, source.model.n_players)
        self._has_goal = isinstance(observe, str) and observe == "goal"
        if self._has_goal and self._task.condition is None:
            raise ValueError(f"observe = 'goal': expected {FEATURES['goal'].needs}")
        if observe is None or self._has_goal:
            observe = [name for name in usual if not (self._has_goal and name == "goal")]
        names = tuple(tuple(name) if isinstance(name, list) else name for name in sequence("observe", observe))
        self.names: Any = "goal" if self._has_goal else names
        self.features = dict[str, tuple[int, ...]]()
        for entry in names:
            name, *sides = cast(Any, entry if isinstance(entry, tuple) and entry else (entry,))
            name = key_of("observe", name, FEATURES)
            what = f"shape of feature {name!r}"
            if len(sides) != (2 if FEATURES[name].is_image else 0):
                right = (name, "height", "width") if FEATURES[name].is_image else name
                raise ValueError(f"observe = {short(entry)}: expected {right!r}")
            for side, size in zip(("height", "width"), sides, strict=False):
                sizes[side] = integer(f"{side} of {name!r} in observe", size, SIDES)
            shape = tuple(
                entry_of(what, size, sizes) if isinstance(size, str) else integer(what, size, Range(0, None))
                for size in sequence(what, FEATURES[name].shape)
            )
            if 0 in shape:
                raise ValueError(f"observe = {name!r}: expected {FEATURES[name].needs} in the environment")
            self.features[name] = shape
        if not names or len(self.features) < len(names):
            raise ValueError(f"observe = {short(observe)}: expected at least one feature, and each of them once")
        lows = [_lows(name, shape).ravel() for name, shape in row_of(self.features).items()]
        spaces: dict[str, Any] = {}
        if lows:
            low = np.concatenate(lows).astype(np.float32)
            spaces[ROW] = gym.spaces.Box(low, np.ones_like(low), dtype=np.float32)
        for name, shape in self.features.items():
            if FEATURES[name].is_image:
                spaces[name] = gym.spaces.Box(0, 255, shape, np.uint8)
        if self._has_goal:
            most = np.array([*source.half_extents, 1.0])
            spaces |= {key: gym.spaces.Box(-most, most, dtype=np.float64) for key in (ACHIEVED, DESIRED)}
        self._is_dict = len(spaces) > 1
        self._memory = {key: (space.shape, space.dtype) for key, space in spaces.items()}
        self._shape, self._dtype = next(iter(self._memory.values()))
        self._shape_of_one = 1, *self._shape
        self.space: Any = gym.spaces.Dict(spaces) if self._is_dict else next(iter(spaces.values()))
        writers = {name: FEATURES[name].write for name in self.features}
        if self._has_goal:
            writers |= {ACHIEVED: write_achieved, DESIRED: write_desired}
        self._write = {name: Typed(writer) for name, writer in writers.items()}
        self._foreign = [name for name in row_of(self.features) if is_foreign(FEATURES[name].write)]
        self._bind()

    def _bind(self) -> None:
        first, self._writers = 0, []  # a key of the observation, a writer and its arguments after `observations`
        for name, shape in self.features.items():
            if FEATURES[name].is_image:
                self._writers.append((name, self._write[name], self._read(name, *shape[:2])))
            else:
                self._writers.append((ROW, self._write[name], (first, *self._read(name))))
                first += math.prod(shape)
        if self._has_goal:
            source = self._source
            achieved = source.half_extents, self._task.condition, tuple(source.numbers), tuple(source.arrays)
            self._writers.append((ACHIEVED, self._write[ACHIEVED], achieved))
            self._writers.append((DESIRED, self._write[DESIRED], (source.arrays.goals,)))

    def _read(self, name: str, *sides: int) -> tuple[Any, ...]:
        """Returns the arguments of the writer of a feature."""
        return result_of(f"reads of feature {name!r}", tuple, FEATURES[name].reads, self._source, *sides)

    def bound(self, arrays: EpisodeArrays, physics: Mapping[str, NDArray[np.float64]]) -> Observer:
        """Returns an observer of other episodes of the same environment."""
        twin = object.__new__(Observer)  # faster than copy.copy
        twin.__dict__.update(self.__dict__, _source=Source(self._source.model, arrays, self._source.numbers, physics))
        twin._bind()
        return twin

    def new(self, count: int) -> Any:
        """Returns memory for the observations of `count` episodes: an array, or a dict of arrays."""
        if self._is_dict:
            return {key: np.empty((count, *shape), dtype) for key, (shape, dtype) in self._memory.items()}
        return np.empty((count, *self._shape), self._dtype)

    def new_one(self) -> tuple[Any, Any]:
        """Returns memory for one observation, and the observation, which is a part of it."""
        if self._is_dict:
            observations = self.new(1)
            return observations, nth(observations, 0)
        array = np.empty(self._shape_of_one, self._dtype)
        return array, array[0]

    def write(self, begin: int, end: int, observations: Any) -> None:
        """Writes the observations, memory from `new`, of the episodes from `begin` to `end - 1`."""
        for key, write, arguments in self._writers:
            write.call(begin, end, observations[key] if self._is_dict else observations, *arguments)
        if self._foreign:
            self._check(decode(nth(observations, slice(begin, end)), self.features))

    def _check(self, observations: Mapping[str, NDArray[Any]]) -> None:
        """Raises a ValueError if a feature of another package has a number that is not in its range."""
        for name in self._foreign:
            numbers, lows = np.broadcast_arrays(observations[name], _lows(name, self.features[name]))
            wrong = ~((lows <= numbers) & (numbers <= 1.0))  # True for a NaN
            for number, low in zip(numbers[wrong], lows[wrong], strict=True):
                real(f"feature {name!r}", number, Range(low.item(), 1.0))  # raises


def _lows(name: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """Returns the least values of the numbers of a feature."""
    low = FEATURES[name].low
    if np.shape(low) not in ((), shape[-1:]):
        expected = f"one number, or one for each number of the last axis of {shape}"
        raise ValueError(f"low of feature {name!r} = {short(low)}: expected {expected}")
    return np.broadcast_to(np.asarray(low, np.float32), shape)


def row_of(features: Mapping[str, tuple[int, ...]]) -> dict[str, tuple[int, ...]]:
    """Returns the features that are not images."""
    return {name: shape for name, shape in features.items() if not FEATURES[name].is_image}


def nth(observations: Any, k: int | slice) -> Any:
    """Returns observation k, or some observations, of an array or of a dict of arrays."""
    return {key: array[k] for key, array in observations.items()} if isinstance(observations, dict) else observations[k]


def decode(observation: Any, features: Mapping[str, tuple[int, ...]]) -> dict[str, Any]:
    """Returns the features of an observation by name, as views: arrays that share the memory of the observation.

    Args:
        observation: An array or a tensor (..., size), such as the observations (m, size) of a vector environment, or a
            dict with images and such an array.
        features: The shape of each feature by name: `BilliardsEnv.features`.

    Returns:
        Arrays or tensors (..., *shape).

    Raises:
        ValueError: If the size of the observation is not that of the features.

    Example:
        >>> decode(np.arange(5.0), {"positions": (2, 2), "shots_left": ()})
        {'positions': array([[0., 1.],
               [2., 3.]]), 'shots_left': array(4.)}
    """
    if isinstance(observation, Mapping):
        row = decode(observation[ROW], row_of(features)) if ROW in observation else {}
        return {name: row[name] if name in row else observation[name] for name in features}
    if not row_of(features):
        return dict.fromkeys(features, observation)
    *many, size = getattr(observation, "shape", ()) or (0,)
    if size != (expected := sum(map(math.prod, features.values()))):
        raise ValueError(f"observation has {size} numbers: expected {expected}, of {', '.join(features)}")
    decoded, first = {}, 0
    for name, shape in features.items():
        last = first + math.prod(shape)
        decoded[name] = observation[..., first:last].reshape((*many, *shape))
        first = last
    return decoded
