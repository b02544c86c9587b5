"""The environment: one action is one shot."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.core import RenderFrame
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from billiards_env import layouts
from billiards_env.checks import choose, real, whole
from billiards_env.engine import STATUS, ShotInput, check_mode
from billiards_env.engine.shots import AT_EVENT_LIMIT
from billiards_env.envs.episodes import SCORE, SHOTS_LEFT, Episodes, Settings, cue_ball_alone, shorten
from billiards_env.envs.rendering import FPS, RENDER_MODES, DrawnShot, Renderer, balls_at_rest
from billiards_env.envs.tasks import PLACE_RADIUS, TASKS
from billiards_env.scene import Scene, check_positions

# The layout a game of each task opens with.
_OPENING = {
    "pot": "rack",
    "carom": "carom_opening",
    "three_cushion": "carom_opening",
    "sum_to_three": "line",
    "place": "random",
}

_ONE = np.ones(1, np.bool_)
_NONE = np.zeros(1, np.bool_)


class BilliardsEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Billiards: each action is one cue shot, and each step runs the shot until every ball is at rest.

    ## Description

    A cue ball (ball 0) and object balls lie on a table. The agent chooses the velocity with which the cue ball leaves
    the cue, without spin. An event-driven engine computes the shot: it solves for the instant of each collision,
    cushion contact, pocket and end of sliding. In the frictionless scene "ideal" nothing comes to rest. There a shot
    ends after 10 s, and the next one starts with the balls at rest at their positions. With one shot in an episode, the
    default, the environment is a contextual bandit with a continuous action.

    ## Action Space

    `Box(-1, 1, (2,), float32)`: the velocity of the cue ball along the table's length (x) and width (y), as a fraction
    of `max_speed`. A vector longer than 1 is shortened to length 1, so no shot is faster than `max_speed`.

    ## Observation Space

    `Box(-1, 1, (2 * n_balls,), float32)`: the positions of the balls, the cue ball first. Some arguments append values:

    | Num     | Observation                                               | Min | Max |
    |---------|-----------------------------------------------------------|-----|-----|
    | 2 i     | x of ball i over half the table's length                  | -1  | 1   |
    | 2 i + 1 | y of ball i over half the table's width                   | -1  | 1   |
    | next 2  | with `task="place"`: x and y of the goal, scaled alike    | -1  | 1   |
    | last    | with `observe_shots_left`: fraction of the shots left     | 0   | 1   |

    The table's centre is (0, 0). A potted ball has the position of its pocket, clipped to the box. No ball on the table
    reaches 1 or -1.

    ## Rewards

    The reward of a shot is its points, minus `scratch_penalty` if the shot pots the cue ball (a scratch).

    - `task="pot"` (needs pockets): one point for each object ball potted. Balls of infinite mass are obstacles, not
      object balls.
    - `task="carom"`: one point if the cue ball touches every object ball in this shot and does not scratch.
    - `task="three_cushion"`: the same, but the cue ball must make at least three cushion contacts before it first
      touches the last object ball.
    - `task="sum_to_three"` (one object ball, no pockets): one point if the cue ball touches the object ball and both
      together make exactly three cushion contacts in this shot, before or after the hit.
    - `task="place"`: one point if the cue ball touches an object ball, does not scratch and comes to rest within 0.15 m
      of the goal. If no object ball is left on the table, the cue ball need not touch one.

    The default penalty is small: with a large one an agent learns to avoid the pockets before it learns to use them.

    ## Starting State

    `layout` determines the starting positions:

    - `"random"`: all balls anywhere on the table, 1 mm clear of each other, of the cushions and of the pockets.
    - `"rack"`: the object balls in a triangle at the foot spot (9 balls: a diamond) with random gaps of 0.1 to 0.5 mm;
      the cue ball anywhere behind the head string.
    - `"tight_rack"`: the same, but neighbouring object balls touch.
    - `"carom_opening"`: the opening position of carom billiards, for one or two object balls.
    - `"line"`: the cue ball and one object ball on the long axis.
    - `"snookered"`: the cue ball and ball 1 anywhere, ball 2 midway between them, so that no straight path of the cue
      ball meets ball 1 first.

    With `task="place"` the goal is drawn next, uniformly over all positions that the cue ball can have on an empty
    table. It is constant during an episode.

    `reset(options={"positions": [[x, y], ...]})` sets the positions of the balls, one row for each ball, in metres from
    the table's centre. `options={"goal": [x, y]}` sets the goal.

    ## Episode End

    The episode terminates when the task is decided or after `max_shots` shots. The limit on shots is part of the task,
    so the environment never truncates.

    - `task="pot"` is decided when all object balls are potted, or the cue ball is. A potted object ball stays out.
    - `task="carom"` and `task="three_cushion"` continue after a point and after a miss. On a table with pockets any
      potted ball decides them.
    - `task="sum_to_three"` ends only after its last shot.
    - `task="place"` is decided when the point is made, or the cue ball is potted.

    ## Info

    The info of `reset` is empty. The info of `step` has these keys:

    | Key | Type | Meaning |
    |---|---|---|
    | `shot_time` | float | duration of the shot, s |
    | `n_events` | int | number of events in the shot |
    | `status` | str | why the shot ended: "rest", "max_time", "event_limit" or "step_limit" |
    | `first_hit` | int | the first ball that the cue ball touched, -1 if none |
    | `cushions` | (n,) int32 | cushion contacts of each ball in this shot |
    | `potted` | (n,) bool | the balls off the table after this shot |
    | `scratch` | bool | whether the cue ball is off the table |
    | `points` | int | points of this shot |
    | `score` | int | points of the episode so far |
    | `shots_left` | int | shots left in the episode |
    | `success` | bool | `pot`: all object balls potted, no scratch; other tasks: at least one point so far |
    | `is_success` | bool | the same, under the name that Stable-Baselines3 logs |

    A shot that reaches the engine's limit on events or on timesteps raises a `RuntimeWarning`. No ordinary shot does.

    ## Many at Once

    `gym.make_vec("Billiards-v0", num_envs=1024)` returns a `BilliardsVectorEnv`. It runs the shots of all environments
    in compiled code on several threads. Each of them gives the same bits as a `BilliardsEnv` with the same seed.

    ## Arguments

    ```python
    >>> import gymnasium as gym
    >>> env = gym.make("billiards_env:Billiards-v0", n_object_balls=2, max_shots=3)
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> observation.shape, info["shots_left"], info["status"]
    ((6,), 2, 'rest')

    ```

    All arguments are strings, numbers, dicts or None, so an `EnvSpec` can be converted to JSON and back.
    `billiards_env.checks.RANGES` holds the range of each number.

    | Argument | Type | Default | Description |
    |---|---|---|---|
    | `scene` | str or dict | `"pool"` | name of a scene, or a scene in the form of `Scene.to_dict()` |
    | `task` | str | `"pot"` | `"pot"`, `"carom"`, `"three_cushion"`, `"sum_to_three"` or `"place"`, see Rewards |
    | `n_object_balls` | int or None | `None` | object balls of a named scene; None for its usual number |
    | `mode` | str | `"pic"` | the engine: `"pic"` (exact) or `"pit"` (fixed timestep) |
    | `dt` | float or None | `None` | the timestep of `"pit"`, s; must be None with `"pic"` |
    | `fix` | str or None | `None` | how `"pit"` corrects overlaps: `"push_apart"` (None), `"move_back"` or `"none"` |
    | `max_shots` | int | `1` | largest number of shots in an episode |
    | `max_speed` | float | `4.0` | speed of the fastest shot, m/s; an action is a fraction of it |
    | `layout` | str or None | `"random"` | the starting positions, see Starting State; None for those of the task |
    | `observe_shots_left` | bool | `False` | whether to append the fraction of shots left to the observation |
    | `scratch_penalty` | float | `0.1` | penalty of a scratch |
    | `render_mode` | str or None | `None` | `"human"`, `"rgb_array"` or `"rgb_array_list"`, see Rendering |

    The named scenes with their usual number of object balls are `"pool"` (1), `"blocked_pool"` (2, the second one is a
    fixed post), `"carom"` (2), `"ideal"` (1), `"pooltool_carom"` (2) and `"sum_to_three"` (1). The task's own layout is
    `"rack"` for `pot`, `"carom_opening"` for `carom` and `three_cushion`, `"line"` for `sum_to_three` and `"random"`
    for `place`.

    ## Rendering

    pygame (extra `render`) draws the exact trajectories to scale, with 30 frames a second.

    - `"human"`: a window in which each step plays its shot in real time.
    - `"rgb_array"`: `render()` returns one frame, the end of the last shot with the paths of the balls.
    - `"rgb_array_list"`: `render()` returns all frames since its last call or the reset: the starting position and each
      shot in motion.

    Gymnasium's `RecordVideo` keeps one frame of each step. `billiards_env.envs.RecordVideo` has the same arguments and
    films the shots in motion. Without a render mode nothing is drawn, and no drawing library is imported.

    ## Version History

    * v0: Initial version.
    """

    # An instance variable in gym.Env.
    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FPS}  # noqa: RUF012

    def __init__(
        self,
        scene: str | Mapping[str, Any] = "pool",
        task: str = "pot",
        n_object_balls: int | None = None,
        mode: str = "pic",
        dt: float | None = None,
        fix: str | None = None,
        max_shots: int = 1,
        max_speed: float = 4.0,
        layout: str | None = "random",
        observe_shots_left: bool = False,
        scratch_penalty: float = 0.1,
        render_mode: str | None = None,
    ) -> None:
        self.scene = make_scene(scene, n_object_balls)
        self.targets = task_targets(task, self.scene)
        self.task = task
        check_mode(mode, dt, fix)
        self.mode = mode
        self.dt = dt
        self.fix = fix
        self.max_shots = whole("max_shots", max_shots, "max_shots")
        self.max_speed = real("max_speed", max_speed, "max_speed")
        self.layout = _OPENING[task] if layout is None else layout
        # A layout that is impossible in the scene raises here, not at a reset.
        layouts.draw(self.layout, self.scene, np.random.default_rng(0))
        if not isinstance(observe_shots_left, (bool, np.bool_)):
            raise ValueError(f"observe_shots_left = {observe_shots_left!r}: expected True or False")
        self.observe_shots_left = bool(observe_shots_left)
        self.scratch_penalty = real("scratch_penalty", scratch_penalty, "scratch_penalty")
        if render_mode is not None:
            choose("render_mode", render_mode, RENDER_MODES)
        self.render_mode = render_mode
        self._renderer = None if render_mode is None else Renderer(self.scene, render_mode, mode, dt, fix)

        self._episodes = self.episodes(1)
        coordinates = 2 * (self.scene.n_balls + self._episodes.goals.shape[1])
        self.action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
        low = np.full(coordinates + self.observe_shots_left, -1.0, np.float32)
        low[coordinates:] = 0.0
        self.observation_space = gym.spaces.Box(low, np.ones_like(low), dtype=np.float32)
        self._rewards = np.empty(1)
        self._size = len(low)

    def episodes(self, count: int) -> Episodes:
        """Returns a number of new episodes of environments with these arguments."""
        settings = Settings(
            scene=self.scene,
            task=self.task,
            targets=self.targets,
            layout=self.layout,
            max_shots=self.max_shots,
            max_speed=self.max_speed,
            scratch_penalty=self.scratch_penalty,
            mode=self.mode,
            dt=self.dt,
            fix=self.fix,
        )
        return Episodes(count, settings)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(n, 2) Positions of the balls, m, a copy; a potted ball is at the centre of its pocket."""
        return self._episodes.shots.positions[0].copy()

    @property
    def potted(self) -> NDArray[np.bool_]:
        """(n,) The balls off the table, a copy."""
        return ~self._episodes.shots.in_play[0]

    @property
    def goals(self) -> NDArray[np.float64]:
        """(g, 2) The goals, m, a copy: one in the task "place", none in the others."""
        return self._episodes.goals[0].copy()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: Seed of the generator that draws the layouts. The same seed gives the same episode bit for bit.
            options: None or a dict with any of "positions": (n, 2) positions of the balls, m, and, in the task "place",
                "goal": (2,) m. The others are drawn.

        Returns:
            The observation, as in the docstring of the class, and an empty info.

        Raises:
            ValueError: If an option is unknown or the positions are impossible.
            TypeError: If the options are not a mapping.
        """
        positions, goal = check_options(self.scene, self.task, options)
        super().reset(seed=int(seed) if isinstance(seed, np.integer) else seed)
        episodes = self._episodes
        episodes.shots.positions[0] = (
            layouts.draw_one(episodes.plan, self.np_random) if positions is None else positions
        )
        if episodes.goal_plan is not None:
            episodes.goals[0] = layouts.draw_one(episodes.goal_plan, self.np_random) if goal is None else goal
        observation = np.empty(self._size, np.float32)
        episodes.begin(0, 1, _ONE, observation[None])
        if self._renderer is not None:
            circles = goal_circles(episodes.goals[0])
            self._renderer.begin([balls_at_rest(episodes.shots.positions[0], self.task, circles=circles)])
        return observation, {}

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Plays one shot.

        If it is interrupted (by Ctrl-C), the balls are where they were before, and the shot can be played again.

        Args:
            action: (2,) velocity of the cue ball over `max_speed`.

        Returns:
            Observation, reward, terminated, truncated (always False) and info, as in the docstring of the class.

        Raises:
            ResetNeeded: If the episode has ended or not begun.
            ValueError: If the action is not two finite numbers.
        """
        episodes = self._episodes
        if episodes.over[0]:
            raise ResetNeeded("The episode is over or has not begun: call reset() before step()")
        action = check_action(action)
        observation = np.empty(self._size, np.float32)
        potted = np.empty(len(self.targets), np.bool_)
        reward = self._rewards
        episodes.shoot(0, 1, _NONE, action[None], reward, potted[None], observation[None])
        shots = episodes.shots
        points, score, shots_left, success = episodes.tally[0].tolist()
        status = shots.status.item()
        if status >= AT_EVENT_LIMIT:
            warn_cut_off(episodes, 0, self.scene, action)
        info = {
            "shot_time": shots.time.item(),
            "n_events": shots.n_events.item(),
            "status": STATUS[status],
            "first_hit": shots.first_hit.item(),
            "cushions": shots.cushions[0].copy(),
            "potted": potted,
            "scratch": potted.item(0),
            "points": points,
            "score": score,
            "shots_left": shots_left,
            "success": success == 1,
            "is_success": success == 1,
        }
        if self._renderer is not None:
            self._renderer.step([self.drawn_shot(episodes, 0, action, reward.item(), episodes.tally[0], self.goals)])
        return observation, reward.item(), episodes.over.item(), False, info

    def drawn_shot(
        self,
        episodes: Episodes,
        k: int,
        action: NDArray[np.float64],
        reward: float,
        tally: NDArray[np.int64],
        goals: NDArray[np.float64],
    ) -> DrawnShot:
        """Returns the last shot of episode k for drawing, with its action, reward, tally and goals."""
        n = self.scene.n_balls
        velocities = np.zeros((n, 2))
        velocities[0] = cue_velocity(action, self.max_speed)
        limit = self.scene.physics.max_time or math.inf
        in_play = ~episodes.potted_before[k]
        shot = ShotInput(episodes.start[k].copy(), velocities, np.zeros((n, 3)), in_play, limit)
        number = self.max_shots - int(tally[SHOTS_LEFT])
        left = f"{self.task}   shot {number} of {self.max_shots}   {math.hypot(*velocities[0]):.2f} m/s"
        return DrawnShot(shot, left, f"reward {reward:g}   score {tally[SCORE]}", goal_circles(goals))

    def render(self) -> RenderFrame | list[RenderFrame] | None:
        """Draws the shots, as the docstring of the class describes.

        Returns:
            A frame (height, width, 3) uint8, a list of frames, or None, depending on the render mode.

        Raises:
            DependencyNotInstalled: If pygame is not installed.
        """
        if self._renderer is None:
            gym.logger.warn(
                "render() without a render mode draws nothing: "
                f'make the environment with one, such as gym.make("Billiards-v0", render_mode="{RENDER_MODES[1]}")'
            )
            return None
        return self._renderer.render()

    def close(self) -> None:
        """Closes the window of the render mode "human"."""
        if self._renderer is not None:
            self._renderer.close()


def make_scene(scene: str | Mapping[str, Any], n_object_balls: int | None) -> Scene:
    """Returns the scene of an environment.

    Args:
        scene: Name of a scene, or its data in the form of `Scene.to_dict()`.
        n_object_balls: Number of object balls of a named scene; None for its usual number.

    Raises:
        ValueError: If the name is unknown, the data are invalid, or both data and `n_object_balls` are given.
        TypeError: If `scene` is neither a string nor a mapping, or a value in it is of the wrong type.
    """
    if isinstance(scene, str):
        return Scene.named(scene, n_object_balls)
    if not isinstance(scene, Mapping):
        raise TypeError(f"scene = {scene!r}: expected a name or a dict in the form of Scene.to_dict()")
    if n_object_balls is not None:
        raise ValueError(
            f"n_object_balls = {n_object_balls!r} with a scene given as a dict: expected None, the dict lists the balls"
        )
    return Scene.from_dict(scene)


def task_targets(task: str, scene: Scene) -> NDArray[np.bool_]:
    """Returns the balls of a task, (n,) bool: the object balls, in "pot" only those that can move.

    Args:
        task: One of `TASKS`.
        scene: The scene.

    Raises:
        ValueError: If the task is unknown or cannot be played in the scene.
    """
    choose("task", task, tuple(TASKS))
    targets = np.arange(scene.n_balls) > 0
    if task != "place" and not targets.any():
        raise ValueError(f"task = {task!r} with a scene of the cue ball alone: expected at least one object ball")
    if task == "sum_to_three" and (scene.n_balls != 2 or scene.table.pockets):
        raise ValueError(
            f"task = 'sum_to_three' with {scene.n_balls - 1} object balls and {len(scene.table.pockets)} pockets: "
            "expected one object ball and a table without pockets, such as scene 'sum_to_three'"
        )
    if task == "pot":
        if not scene.table.pockets:
            raise ValueError(
                "task = 'pot' with a scene without pockets: expected a table with pockets, or task 'carom'"
            )
        targets &= np.isfinite(scene.balls.mass)
        if not targets.any():
            raise ValueError("task = 'pot' with object balls of infinite mass only: expected one that can move")
    return targets


def check_options(
    scene: Scene, task: str, options: Mapping[str, Any] | None, mask: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Returns the positions and goals in the options of a reset.

    Args:
        scene: The scene.
        task: The task; only "place" has goals.
        options: The options.
        mask: None for one environment; for m environments (m,) bool, those that are reset.

    Returns:
        (n, 2) or (m, n, 2) positions of the balls, m, or None if the options have none, and (1, 2) or (m, 1, 2) goals,
        m, or None.

    Raises:
        ValueError: If an option is unknown, or the positions of balls or goals are impossible.
        TypeError: If the options are not a mapping.
    """
    if options is None:
        return None, None
    if not isinstance(options, Mapping):
        raise TypeError(f"options = {options!r}: expected a dict")
    for key in options:
        choose("key of options", key, ("positions", "goal") if task == "place" else ("positions",))
    many = () if mask is None else (len(mask),)
    positions = goals = None
    if "positions" in options:
        expected = (*many, scene.n_balls, 2)
        shape = np.shape(options["positions"])
        if shape != expected:
            raise ValueError(f"options['positions'] has shape {shape}: expected {expected}, a row a ball")
        in_play = None if mask is None else np.broadcast_to(mask[:, None], expected[:2])
        positions = check_positions(scene, options["positions"], "options['positions']", in_play)
    if "goal" in options:
        shape = np.shape(options["goal"])
        if shape != (*many, 2):
            raise ValueError(f"options['goal'] has shape {shape}: expected {(*many, 2)}, one per environment")
        in_play = None if mask is None else mask[:, None]
        goals = np.reshape(options["goal"], (*many, 1, 2))
        goals = check_positions(cue_ball_alone(scene), goals, "options['goal'] as a position of the cue ball", in_play)
    return positions, goals


def goal_circles(goals: NDArray[np.float64]) -> list[tuple[float, float, float]]:
    """Returns the circles in which the cue ball has to come to rest, x, y and radius, m, for (g, 2) goals."""
    return [(x, y, PLACE_RADIUS) for x, y in goals.tolist()]


def check_action(action: ArrayLike) -> NDArray[np.float64]:
    """Returns the action as two doubles.

    Raises:
        ValueError: If it is not two finite numbers.
    """
    array = np.asarray(action, dtype=np.float64)
    if array.shape != (2,):
        raise ValueError(f"action has shape {array.shape}: expected (2,)")
    x, y = array.tolist()
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f"action = {[x, y]}: expected two finite numbers")
    return array


def cue_velocity(action: ArrayLike, max_speed: float) -> NDArray[np.float64]:
    """Returns the velocity of the cue ball for an action, (2,) m/s.

    Args:
        action: (2,) fraction of `max_speed` along x and y. It is shortened to length 1 if it is longer.
        max_speed: m/s.

    Raises:
        ValueError: If the action is not two finite numbers.

    Example:
        >>> cue_velocity([0.0, -0.5], 4.0).tolist(), cue_velocity([3.0, 4.0], 1.0).tolist()
        ([0.0, -2.0], [0.6, 0.8])
    """
    x, y = check_action(action).tolist()
    return np.array(shorten(x, y, float(max_speed)))


def warn_cut_off(episodes: Episodes, k: int, scene: Scene, action: NDArray[np.float64]) -> None:
    """Warns that the shot of episode k reached the engine's limit on events or timesteps."""
    shots = episodes.shots
    warnings.warn(
        f"the engine ended a shot at its limit, after {shots.n_events[k]} events and {shots.time[k]} s; "
        f"scene {scene}, positions {episodes.start[k].tolist()}, action {action.tolist()}",
        RuntimeWarning,
        stacklevel=3,
    )
