"""The environment `Billiards-v0`."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.core import RenderFrame
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from billiards_env.doors import load
from billiards_env.engine import Engine
from billiards_env.engine.shots import AT_EVENT_LIMIT
from billiards_env.envs.arguments import Model, OfArguments, check_options, fixed, json_spec, model_of
from billiards_env.envs.episodes import Episodes
from billiards_env.envs.goal_observations import compute_reward
from billiards_env.envs.observations import decode
from billiards_env.envs.reset import noise_stream
from billiards_env.envs.snapshots import SPACES, OfEpisodes, checked_state, copied
from billiards_env.envs.state import EpisodeState
from billiards_env.envs.trials import Outcomes, Trials
from billiards_env.jit import streams
from billiards_env.scene import Scene
from billiards_env.support.checks import Range, finite, integer, one_of, short

if TYPE_CHECKING:
    from billiards_env.games.playing import GameState, Stroke

RENDER_MODES = ("human", "rgb_array", "rgb_array_list")
FPS = 30
"""Frames per second of a film of the moving balls."""

FPS_OF_SHOTS = 1
"""Frames per second of a video with one frame per shot, which the mode "rgb_array" gives."""

_ONE = np.ones(1, np.bool_)


class BilliardsEnv(OfEpisodes, OfArguments, gym.Env[Any, Any]):
    """A billiards table on which each action is one shot.

    ## Description

    A cue ball (ball 0) and object balls (balls 1, 2, ...) lie on a table. The agent chooses the velocity of the cue
    ball, which starts without spin. With `action="strike"` the agent chooses the motion of the cue, which also gives
    the ball spin. `step` simulates the shot until all balls are at rest. An event-driven engine computes the exact time
    of each collision, each contact with a cushion or pocket, and each change from sliding to rolling. With `mode="pit"`
    an engine with a fixed timestep replaces it.

    By default an episode is one shot. The environment is then a contextual bandit with a continuous action.

    In the frictionless scene `"ideal"` balls do not come to rest. There a shot ends after 10 s, and the next shot
    starts with all balls at rest at their last positions.

    ## Action Space

    The action is a `ndarray` with shape `(2,)` and dtype `float32`:

    | Num | Action                                                              | Min | Max |
    |-----|---------------------------------------------------------------------|-----|-----|
    | 0   | Velocity of the cue ball along the table's length (x) / `max_speed` | -1  | 1   |
    | 1   | Velocity of the cue ball along the table's width (y) / `max_speed`  | -1  | 1   |

    An action longer than 1 is scaled to length 1, so no shot is faster than `max_speed`.

    With `action="strike"` the shape is `(5,)`. The first two numbers are the heading and the speed of the cue: they are
    the velocity that the ball gets if a level cue hits its centre. With zeros in the other numbers the shot is the same
    as that of the default action, bit for bit. There is one exception: if the cue ball touches a ball ahead of it, the
    cue drives both balls (see `engine.frozen_strike`), but the default action is played without a cue. The other
    numbers are:

    | Num | Action                                                                       | Min | Max |
    |-----|------------------------------------------------------------------------------|-----|-----|
    | 2   | Offset of the tip to the left of the centre / offset at which the tip slips  | -1  | 1   |
    | 3   | Offset of the tip above the centre / offset at which the tip slips           | -1  | 1   |
    | 4   | Elevation of the cue / 90 degrees; below 0 the cue is level                  | -1  | 1   |

    If the length of the offset (numbers 2 and 3) is greater than 1, the tip slips (a miscue). `billiards_env.strike`
    describes the motion of the ball, and `scene.cue` has the constants of the cue.

    `billiards_env.envs.actions.ACTIONS` is the table of all actions. `"cut"` and `"sum_to_three"` have two numbers, a
    cut at the nearest ball and a speed. `"plan"` is one whole number, the choice of a ball, a pocket and a speed.

    In a game of several players the place of a cue ball in hand and the call follow, see Games.

    ## Observation Space

    The observation is a `ndarray` with dtype `float32`. It consists of features, which `observe` chooses and orders.
    With `observe=[("pixels", 84, 84)]` it is an image, a `ndarray` with dtype `uint8`. With other features beside an
    image it is a dict: the images by name, and the other features with the key `"observation"`.
    `billiards_env.envs.observations.FEATURES` is the table of all features. By default an observation has the positions
    of the balls, in a task with a goal (`"place"` and `"position"`) also the goal, and in a run-out (`"nine_ball"` and
    `"eight_ball"`) also the balls that may be touched first:

    | Feature         | Shape            | Observation                                                  | Min | Max |
    |-----------------|------------------|--------------------------------------------------------------|-----|-----|
    | `"positions"`   | `(n_balls, 2)`   | x of a ball / half the table's length, y / half its width    | -1  | 1   |
    | `"goal"`        | `(1, 2)`         | x and y of the goal in the same units (tasks with a goal)    | -1  | 1   |
    | `"legal_balls"` | `(n_balls - 1,)` | 1 if the object ball may be touched first, else 0 (run-outs) | 0   | 1   |

    `env.unwrapped.decode(observation)` returns the features by name. `env.unwrapped.features` has their shapes. With
    `observe=("positions", "shots_left")` the observation has the positions and then the number of shots left, divided
    by `max_shots`. `"physics"` contains the numbers of `randomize`. Other features are distances and directions of the
    balls and pockets, and whether the straight lines between them are free. Games of several players have more
    features, see Games.

    The origin is the centre of the table. Both numbers of a ball on the table are strictly between -1 and 1. A potted
    ball has the position of the pocket's centre, clipped to [-1, 1]. On a table with an outline of cushions, a ball can
    lie in the jaws of a pocket. On such a table the largest abs(x) and abs(y) of a ball's centre, `scene.half_extents`,
    replace half the length and half the width.

    ## Rewards

    The reward of a shot is its points, minus `scratch_penalty` if the cue ball is potted (a scratch). The episode
    terminates when `max_shots` shots are played or the task is decided. It is never truncated, because the limit on
    shots is part of the task. The points of each task, and what decides it:

    - `task="pot"`: 1 point for each object ball that is potted. Object balls of infinite mass are obstacles and do not
      count. Potted object balls stay out of play in later shots. Decided when all object balls or the cue ball are
      potted.
    - `task="carom"`: 1 point if the cue ball touches all object balls and is not potted. Decided when any ball is
      potted.
    - `task="three_cushion"`: 1 point as in `"carom"`, if the cue ball has at least three cushion contacts before it
      touches the last object ball for the first time. Decided as in `"carom"`.
    - `task="sum_to_three"`: 1 point if the cue ball touches the object ball and the two balls together have exactly
      three cushion contacts, before or after they touch. Never decided.
    - `task="place"`: 1 point if the cue ball touches an object ball, is not potted, and comes to rest at most
      `goal_radius` (0.15 m) from the goal. If no object ball is on the table, the cue ball does not have to touch one.
      Decided when the point is scored or the cue ball is potted.
    - `task="position"`: 1 point if an object ball is potted, the cue ball is not, and the cue ball comes to rest at
      most `goal_radius` (0.3 m) from the goal. Decided when the point is scored, the cue ball is potted, or no object
      ball is left.
    - `task="clear"`: 1 point if the last object ball is potted and the cue ball is not. Decided as in `"pot"`.
    - `task="jump"`: 1 point if ball 1 is potted, the cue ball touches it before any other ball or cushion, the cue
      ball is not potted, and no ball is driven off the table. Decided when ball 1 or the cue ball is out of play.
    - `task="nine_ball"`: 1 point for each ball potted without a foul. The nine ball also scores 1 point for each ball
      that is left on the table, so a run-out scores 9 points. Decided by a foul, by a shot without a point, and when
      the nine ball is potted.
    - `task="eight_ball"`: 1 point for each ball of the group potted without a foul, and for the eight ball. Decided by
      a foul, by a shot without a point, and when the eight ball is potted. An eight ball potted before it is on, also
      in the break, ends the episode without success.

    In the run-outs a shot has no foul if the cue ball first touches a ball that is on, a ball then touches a cushion or
    is potted, and the cue ball is not potted. In nine ball the lowest ball is on. In eight ball all balls are on in the
    break. Then both groups (1 to 7 and 9 to 15) are on until a potted ball decides the group of the player. The eight
    ball is on when no ball of this group is left.

    The default penalty is small, because with a large penalty an agent learns to avoid the pockets before it learns to
    use them.

    ## Games

    With `n_players` from 2 to 4 the task is one of `billiards_env.games.GAMES`, such as `"straight"`, `"nine_ball"`,
    `"snooker"` or `"carom"`. The players take turns in the environment: each step is a shot of the player whose turn it
    is. The docstrings of the modules in `billiards_env.games` list the rules, their sources and what is simplified.

    An action has the numbers of the shot, and then, in games with pockets, two numbers for the place of a cue ball in
    hand: x and y, from -1 to 1 over the table or the part behind the head string, except for a margin of 1 mm at the
    cushions. In snooker it is the rectangle around the D. A point outside the D or within 1 mm of a ball or a pocket is
    replaced by the nearest free point, so every action is valid. If the cue ball is not in hand, these numbers have no
    effect. With `can_place=False` or `action="plan"` these numbers are left out, and a cue ball in hand is played from
    a free place near the head spot. The actions are then those of one player, so a policy that pots can play games.

    By default any ball potted on a legal shot counts, and a player makes no choices, so an action needs no call. With
    `can_call=True` eight ball, ten ball, straight pool and bank pool have called shots. An action then has three more
    numbers:

    | Num | Action |
    |---|---|
    | 1 | the called ball, in snooker the nominated ball: -1 to 1 in equal parts for the object balls 1, 2, ... |
    | 2 | the called pocket: -1 to 1 in equal parts for the pockets 0, 1, ... |
    | 3 | up to 0 an ordinary shot; above 0, in equal parts, the player's other choices |

    The other choices are a safety in the games with called shots, and then those of the state, such as "push_out" and
    "hand_back" in nine ball and ten ball, or "rerack" in eight ball, see `games.game_state.CALLS`. A player without
    other choices plays an ordinary shot. A call from "hand_back" on is a step without a shot.

    The observation is that of the player to shoot. The features "break", "in_hand", "own_pocket", "choices", "fouls"
    and "scores" follow the positions and the legal balls, as far as the game has them. The scores and the numbers of
    consecutive fouls begin with those of the observing player. In the games with two cue balls the cue ball of the next
    shot is ball 0 of the observation, and ball 0 takes its place. A cue ball in hand is observed at a free place near
    the head spot. `env.unwrapped.observe_as(player)` returns the observation of a player who waits.

    The reward is that of the player of the shot. Each other player gets minus this reward, divided by the number of
    other players. In games without a score, such as `"eight_ball"` and `"nine_ball"`, the points of a shot are 1 for
    winning the game and -1 for losing it. In the others they are those of the rules, minus the points for the next
    player.
    An episode is a game. It terminates when the game is over, or as a draw after `max_shots` shots, by default 200. To
    win has no reward of its own in a game with a score. The info also has:

    | Key           | Type                   | Description                                             | After `reset` |
    |---------------|------------------------|---------------------------------------------------------|---------------|
    | `player`      | int64                  | the player of the shot                                  | -1            |
    | `next_player` | int64                  | the player of the next shot                             | 0             |
    | `rewards`     | (n_players,) float64   | the rewards of all players                              | 0             |
    | `scores`      | (n_players,) int64     | the scores of all players                               | 0             |
    | `foul`        | int64                  | index in `games.FOULS`                                  | 0             |
    | `spotted`     | (n,) bool              | the balls that return to the table after the shot       | False         |
    | `winner`      | int64                  | the player who has won, or -1                           | -1            |

    `potted` has the balls out of play before balls are spotted. `score` is the score of the player of the shot, and
    `is_success` whether this player has won.

    `layout` is one of `GAMES[task].layouts`, by default the first. `"random"` has no break.
    `reset(options={"positions": [[x, y], ...], "state": {...}})` begins in the middle of a game, see
    `games.custom_opening`; in a vector environment one state applies to all games. The info then has the `next_player`
    and the `scores` of this state. `env.unwrapped.game` is the state of the
    game, and `env.unwrapped.stroke` the last stroke, for `games.play`. `billiards_env.envs.Opponents` turns a vector
    environment of games into one of a single player.

    ```python
    >>> env = gym.make("billiards_env:Billiards-v0", task="nine_ball", n_players=2)
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step([1.0, 0.0, 0.0, 0.2])  # a break
    >>> info["player"].item(), info["rewards"].tolist()
    (0, [0.0, 0.0])

    ```

    ## Starting State

    The argument `layout` selects the starting positions of the balls. By default the task selects it:
    `"carom_opening"` in `"carom"` and `"three_cushion"`, `"line"` in `"sum_to_three"`, `"snookered"` in `"jump"`, the
    rack of the game in the run-outs, and `"random"` in the others. The docstring of `billiards_env.scene.layouts`
    describes the layouts.

    In a task with a goal, the goal is then drawn uniformly from all positions that the cue ball can have on an empty
    table. The goal does not change during an episode.

    With `randomize` each episode then draws its physics. `randomize` maps names of numbers of `Physics` to ranges (low,
    high), such as `{"mu_roll": (0.008, 0.015)}`, and with `mode="pit"` also "dt". A number is drawn uniformly from its
    range and replaces the scene's number (or `dt`) during the episode. The feature `"physics"` of the observation has
    these numbers, scaled from their ranges to [-1, 1].

    `reset(options={"positions": [[x, y], ...]})` sets the positions of all balls, in metres from the centre of the
    table. `reset(options={"goal": [x, y]})` sets the goal, and `reset(options={"physics": {"mu_roll": 0.01}})` a number
    of `randomize`, within its range.

    ## Info

    `reset` and `step` return the same keys. The numbers are NumPy scalars:

    | Key             | Type         | Description                                          | After `reset` |
    |-----------------|--------------|------------------------------------------------------|---------------|
    | `episode_seed`  | (8,) int64   | seed that repeats this episode, see below            | drawn         |
    | `shot_time`     | float64      | duration of the shot, s                              | 0             |
    | `n_events`      | int64        | number of events in the shot                         | 0             |
    | `status_code`   | int64        | reason for the end of the shot, usually 0, see below | 0             |
    | `first_hit`     | int64        | the first ball that the cue ball touched, -1 if none | -1            |
    | `played_action` | (k,) float64 | velocity or strike that was played, see below        | 0             |
    | `cushions`      | (n,) int32   | number of cushion contacts of each ball in the shot  | 0             |
    | `potted`        | (n,) bool    | balls out of play after the shot                     | False         |
    | `scratch`       | bool         | whether the cue ball was potted                      | False         |
    | `points`        | int64        | points of the shot                                   | 0             |
    | `score`         | int64        | points of the episode up to now                      | 0             |
    | `shots_left`    | int64        | number of shots left in the episode                  | `max_shots`   |
    | `is_success`    | bool         | whether the task was achieved in the episode         | False         |
    | `miscue`        | bool         | whether the tip slipped; only with `action="strike"` | False         |

    With `randomize` the info also has the numbers of the episode by name (float64). `played_action` is the velocity,
    k = 2, or the strike, k = 5, in the units of the action space, after the conversion of other actions, the clipping
    and the noise. With `action="plan"` the info also has `action_mask`, int8: 1 for each plan that is possible in the
    next shot. `env.unwrapped.action_masks()` returns it as bools.

    A measure that the task or the observation uses is also a key, such as `first_hit_velocities`, see
    `engine.measures`. Its numbers are float64. They are infinite before the first shot, and if what they describe does
    not happen.

    `reset(options={"episode_seed": info["episode_seed"]})` begins the same episode in any environment with the same
    arguments, single or vector: the same positions, goal, physics and execution noise. So one of the episodes of a
    vector environment can be played again alone.

    Stable-Baselines3 logs `is_success`. The task `"pot"` is achieved if all object balls are potted and the cue ball is
    not. A run-out is achieved if the nine ball or the eight ball is potted without a foul when it may be potted. The
    other tasks are achieved if the score is at least 1.

    `billiards_env.envs.STATUS[info["status_code"]]` is the name of the status: `"rest"` (0), or `"max_time"` (1) if the
    shot reached the time limit of the scene. It is `"event_limit"` (2) or `"step_limit"` (3) if the engine ended the
    shot at its limit on events or timesteps. In this case `step` also issues a `RuntimeWarning`. Ordinary shots are far
    below these limits.

    ## Arguments

    ```python
    >>> import gymnasium as gym
    >>> env = gym.make("billiards_env:Billiards-v0", n_object_balls=2, max_shots=3)
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> observation.shape, info["shots_left"].item(), info["status_code"].item()
    ((6,), 2, 0)

    ```

    | Argument          | Type          | Default      | Description                                           |
    |-------------------|---------------|--------------|-------------------------------------------------------|
    | `scene`           | see below     | `None`       | scene; None for the task's                            |
    | `task`            | str           | `"pot"`      | the task, see Rewards                                 |
    | `n_object_balls`  | int or None   | `None`       | number of object balls; None for the usual one        |
    | `mode`            | str           | `"pic"`      | engine: `"pic"` (exact) or `"pit"` (fixed timestep)   |
    | `dt`              | float or None | `None`       | timestep of `"pit"`, s                                |
    | `fix`             | str or None   | `None`       | how `"pit"` treats overlaps                           |
    | `action`          | str or None   | `None`       | the kind of action; None for the task's               |
    | `max_shots`       | int or None   | `None`       | maximum number of shots; None for the task's          |
    | `max_speed`       | float or None | `None`       | speed of the fastest shot, m/s; None: 4, in games 8   |
    | `layout`          | str or None   | `None`       | starting positions; None for the task's               |
    | `observe`         | list or None  | `None`       | features of the observation; None for the usual ones  |
    | `goal_radius`     | float or None | `None`       | largest distance from the goal, m; None: the task's   |
    | `scratch_penalty` | float or None | `None`       | subtracted for a scratch; None: 0.1, in games 0       |
    | `randomize`       | dict or None  | `None`       | ranges of physics that each episode draws             |
    | `noise`           | dict or None  | `None`       | standard deviations of the execution noise, see below |
    | `noise_seed`      | int or None   | `None`       | a second seed of the noise                            |
    | `scatter`         | dict or None  | `None`       | standard deviations of the scatter of the cushions    |
    | `n_players`       | int           | `1`          | number of players, see Games                          |
    | `target`          | int or None   | `None`       | score that wins a game, or 0; None: the game's        |
    | `can_call`        | bool          | `False`      | whether players call, see Games                       |
    | `can_place`       | bool          | `True`       | whether players place a cue ball in hand, see Games   |
    | `miss`            | bool          | `False`      | whether snooker has the miss rule                     |
    | `edition`         | str or None   | `None`       | edition of the rules of a game; None: its first one   |
    | `innings`         | int           | `0`          | innings of each player of carom; 0: no limit          |
    | `render_mode`     | str or None   | `None`       | `"human"`, `"rgb_array"` or `"rgb_array_list"`        |

    These are the arguments of `gym.make` and of `make_env`. Each is also an attribute of the environment, such as
    `env.unwrapped.max_shots`, with the value that the environment uses. It cannot be assigned: other arguments need
    another environment. The constructor instead takes a `Model`, which `make_model` returns after a check of the
    arguments.

    - `scene` is a name, a `Scene`, or a mapping for `Scene.from_dict`, such as `{"base": "real_pool", "n_object_balls":
      9, "physics": {"mu_roll": 0.012}}`. By default it is `"carom"` in `"carom"` and `"three_cushion"`,
      `"sum_to_three"` in the task of that name, `"jump_pool"` in `"jump"`, and `"pool"` in the others.
      `n_object_balls` needs a named scene.
    - `action` is one of those in Action Space. By default it is `"strike"` in `"jump"`, which needs a scene with
      flight, and `"velocity"` in the others.
    - `billiards_env.scene.NAMED` is the table of the named scenes, such as `"pool"`, `"carom"` and `"real_pool"`.
    - The tasks `"pot"`, `"position"`, `"clear"`, `"jump"` and the run-outs need a table with pockets. `"jump"` needs 2
      object balls, `"nine_ball"` 9 and `"eight_ball"` 15. `"sum_to_three"` needs a table without pockets and exactly
      one object ball.
    - `noise` maps "angle_std" (of the direction, degrees), "speed_std" (m/s), "offset_std" (of both offsets of the tip,
      m) and "elevation_std" (degrees) to numbers. Missing ones are 0.125, 0.075, 0.0005 and 0.1, those of the pool
      tournaments at the Computer Olympiad (Smith 2007, PickPocket: A computer billiards shark). The speed stays
      between 0 and `max_speed`. A shot of speed 0 stays at speed 0. An action is clipped before the noise is added.
    - `scatter` adds random differences to each impact on a cushion, see `physics.scatter`. It maps "normal_std",
      "along_std" and "spin_std" to numbers. Missing ones have the values of a real table, `shots.noise.SCATTER`.
    - `fix` is a name in `billiards_env.engine.overlaps.TREATMENTS`; None means the first, `"push_apart"`.
    - `"module:name"` names a task, a scene, a layout, a feature or an action that a package of yours registers.
    - An `EnvSpec` can be converted to JSON and back. The spec stores a `Scene` as a dict. All other arguments are JSON
      values. `billiards_env.support.checks.RANGES` contains the range of each number.

    ## Rendering

    Rendering needs pygame (extra `render`). With a render mode each step also records its shot for drawing. Frames are
    drawn to scale. `"human"` and `"rgb_array_list"` have 30 frames for each second of a shot.

    - `"human"`: a window shows each shot in real time during `step`. Without a display it is drawn off screen.
    - `"rgb_array"`: `render()` returns one frame, the end of the last shot with the paths of the balls.
    - `"rgb_array_list"`: `render()` returns all frames since its last call or since the reset: one of the starting
      state, and those of each shot.

    Gymnasium's `RecordVideo` records one frame per step. `billiards_env.envs.RecordVideo` records all frames of the
    shots and has the same arguments.

    ## Vectorized environment

    `gym.make_vec("Billiards-v0", num_envs=1024)` returns a `BilliardsVectorEnv`. It simulates the shots of all
    environments in compiled code on several threads. Its results equal those of single environments with the same
    seeds.

    ## Version History

    * v0: Initial version.
    """

    # gym.Env declares an instance variable.
    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FPS}  # noqa: RUF012
    _spec = None
    spec = json_spec
    model: Model = fixed()
    engine: Engine = fixed()
    features: dict[str, tuple[int, ...]] = fixed()

    def __init__(self, model: Model, render_mode: str | None = None) -> None:
        if not isinstance(model, Model):
            raise TypeError(f"model = {short(model)}: expected a Model from make_model; make_env takes arguments")
        if render_mode is not None:
            one_of("render_mode", render_mode, RENDER_MODES)
        self.model, self.engine, self.render_mode = model, model.engine, render_mode
        if render_mode == "rgb_array":
            self.metadata = {**self.metadata, "render_fps": FPS_OF_SHOTS}
        self._renderer = None if render_mode is None else load("render_mode")(model.scene, render_mode)
        self._episodes = Episodes(1, model, 0 if self._renderer is None else 1)
        self.features = self._episodes.observer.features
        self._set_arguments({**model.arguments, "observe": self._episodes.observer.names})
        self.action_space: Any = gym.spaces.Box(-1.0, 1.0, (sum(model.n_numbers),), np.float32)
        if self._episodes.choices:
            self.action_space = gym.spaces.Discrete(self._episodes.choices)
        self.observation_space = self._episodes.observer.space
        self._action_shape = self.action_space.shape
        if self.observe == "goal":  # other environments have no `compute_reward`
            self.compute_reward = functools.partial(compute_reward, model.goal_radius, model.scratch_penalty)
        self._trials = Trials(model, self._action_shape)
        self._shared = {*vars(self), "_np_random", "_shared", "_spec"} - {"_episodes", "_renderer", *SPACES}

    def __repr__(self) -> str:
        return f"BilliardsEnv({self.model.summary})"

    def __deepcopy__(self, memo: dict[int, Any]) -> BilliardsEnv:
        """Returns a copy that continues with the same bits. It shares what does not change, such as the scene."""
        self._write_stream()
        return copied(self, self._shared, memo, _np_random=None)

    def __copy__(self) -> BilliardsEnv:
        """Returns a deep copy: two environments never have the same episode."""
        return copy.deepcopy(self)

    @property
    def np_random(self) -> np.random.Generator:
        """The generator of the layouts."""
        if self._np_random is None and self._episodes.state.stream[0, 3]:  # the state has the stream
            self._np_random = streams.generator(self._episodes.state.stream[0])
        return super().np_random

    @np_random.setter
    def np_random(self, value: np.random.Generator) -> None:
        if not isinstance(value, np.random.Generator):
            raise TypeError(f"np_random = {short(value)}: expected a numpy.random.Generator")
        self._np_random, self._np_random_seed = value, -1

    def _write_stream(self) -> None:
        """Writes the state of the generator to that of the episode."""
        if self._np_random is not None:
            self._episodes.state.stream[0] = streams.read(self._np_random)

    def get_state(self) -> EpisodeState:
        """Returns the state: all that a step may read or change, a structured array of shape (), see `snapshots`."""
        self._write_stream()
        return np.ndarray((), self._episodes.state.types.saved, self._episodes.state.memory.copy())

    def set_state(self, state: EpisodeState) -> None:
        """Continues from a state of this environment, or of another one with the same scene and task, bit for bit.

        Args:
            state: One row, as from `get_state` of this environment or of a vector environment.

        Raises:
            TypeError: If it is not an array that `get_state` returned.
            ValueError: If it is the state of another scene or task, or holds invalid numbers.
        """
        episodes = self._episodes
        episodes.undo(checked_state(state, episodes.state.types.saved, self.model, 1).view(np.uint8))
        self._np_random, self._np_random_seed = None, -1
        if self._renderer is not None:
            self._renderer.begin(episodes)

    def try_actions(
        self, actions: ArrayLike, states: EpisodeState | None = None, noise: np.random.Generator | None = None
    ) -> Outcomes:
        """Plays a shot for each action, and does not change the environment.

        Args:
            actions: (m, 2), (m, 5) or (m,), as in `step`.
            states: The states to play from, one for each action or one for all, as from `get_state`. None for the
                present state.
            noise: The generator from which the execution noise and the scatter of the environment are drawn; None for
                neither. The next step draws others.

        Raises:
            ResetNeeded: If an episode has not begun, or is over.
            TypeError: As in `set_state`.
            ValueError: As in `set_state`, or if the actions have another shape or a number is not finite.
        """
        return self._trials.try_actions(actions, self.get_state()[None], states, noise, None)

    @property
    def episode_scene(self) -> Scene:
        """The scene with the physics of the present episode: `scene`, unless `randomize` changes it."""
        return self.episode_scene_and_engine[0]

    @property
    def episode_scene_and_engine(self) -> tuple[Scene, Engine]:
        """The scene and the engine of the present episode."""
        return self._episodes.state.scene_and_engine(0)

    @property
    def action_masks(self) -> Callable[[], NDArray[np.bool_]]:
        """A method that returns the plans that are possible in the next shot, (choices,), a copy.

        MaskablePPO of sb3-contrib calls it.

        Raises:
            AttributeError: If an action is not a choice, so `hasattr(env, "action_masks")` is False.
        """
        if not self._episodes.choices:
            raise AttributeError(f"action_masks with action = {self.action!r}: expected action 'plan'")
        return lambda: self._episodes.state.mask[0].astype(np.bool_)

    @property
    def game(self) -> GameState:
        """The game of several players before the next shot, a copy.

        Raises:
            AttributeError: If there is one player.
        """
        self._expect_players("game")
        return self._episodes.game_state(0)

    def _expect_players(self, name: str) -> None:
        if self.model.setup is None:
            raise AttributeError(f"{name} with n_players = 1: expected several players")

    @property
    def stroke(self) -> Stroke | None:
        """The last stroke in a game of several players, which `games.play` repeats bit for bit, but without scatter.

        None before the first shot after a reset, after `set_state`, and in a copy.
        """
        self._expect_players("stroke")
        return self._episodes.stroke(0)

    def observe_as(self, player: int) -> Any:
        """Returns the observation of any player of a game, also of one who is not to shoot.

        Args:
            player: 0 to `n_players` - 1. The observation of the player to shoot is that of `step`.

        Raises:
            ValueError: If there is no such player.
        """
        self._expect_players("observe_as")
        integer("player", player, Range(0, self.model.n_players - 1))
        observations, observation = self._episodes.observer.new_one()
        self._episodes.observe_as(player, observations)
        return observation

    def decode(self, observation: Any) -> dict[str, Any]:
        """Returns the features of an observation (size,), or of several (..., size), by name; see `decode`."""
        return decode(observation, self.features)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode.

        Args:
            seed: Seed of the generator that draws the starting states. The same seed gives the same episodes bit for
                bit.
            options: None, or a dict with any of "positions": (n, 2) positions of the balls, m, "goal": (2,) m in a task
                with a goal, "physics": numbers of `randomize` by name, and "episode_seed": (8,) that of the `info` of
                an earlier reset, which this one repeats. The rest of the starting state is drawn.

        Returns:
            The observation and the info, see the class.

        Raises:
            ValueError: If an option is unknown, or a position or the goal is invalid.
            TypeError: If the options are not a mapping.
        """
        episodes, state = self._episodes, self._episodes.state
        checked = check_options(episodes.model, options)
        if seed is not None:
            super().reset(seed=int(seed) if isinstance(seed, np.integer) else seed)
        if self._np_random is not None or not state.stream[0, 3]:
            state.stream[0] = streams.read(self.np_random)
        if seed is None:
            self._np_random = None  # `np_random` makes it again from the stream
        if self.model.is_noisy and (seed is not None or not state.noise_stream[0, 3]):
            state.noise_stream[0] = noise_stream(self.np_random_seed, self.model.noise_seed)
        observations, observation = episodes.observer.new_one()
        episodes.restart(0, 1, _ONE, observations, checked)
        if self._np_random is not None:
            streams.write(self._np_random, state.stream[0])
        state.begun[0] = True
        if self._renderer is not None:
            self._renderer.begin(episodes)
        return observation, episodes.info_at_start()

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Plays one shot.

        If the call is interrupted (by Ctrl-C), the balls keep their positions and the shot can be played again.

        Args:
            action: (2,) velocity of the cue ball divided by `max_speed`, or (5,) with `action="strike"`.

        Returns:
            The observation, the reward, terminated, truncated (always False) and the info, see the class.

        Raises:
            ResetNeeded: If the episode is over or has not begun.
            ValueError: If the action does not have the shape of the action space, or a number is not finite.
        """
        episodes = self._episodes
        state = episodes.state
        over, reward = state.over, state.rewards
        if over[0] or not state.begun[0]:
            raise ResetNeeded("The episode is over or has not begun: call reset() before step()")
        action = finite("action", action, self._action_shape)
        (observations, observation), before = episodes.observer.new_one(), state.memory.copy()
        try:
            episodes.shoot(0, 1, action[None], reward, observations)
        except BaseException:
            episodes.undo(before)
            raise
        if state.status.item() >= AT_EVENT_LIMIT:
            episodes.warn_cut_off(0, before)
        if self._renderer is not None:
            self._renderer.step(episodes, reward, state.goals, (False,))
        return observation, reward.item(), over.item(), False, episodes.info_after_shot()

    def render(self) -> RenderFrame | list[RenderFrame] | None:
        """Renders the shots, see the class.

        Returns:
            "rgb_array": a frame (height, width, 3) uint8. "rgb_array_list": a list of frames. None in the mode "human"
            and without a render mode.

        Raises:
            DependencyNotInstalled: If pygame is not installed.
        """
        if self._renderer is None:
            gym.logger.warn(
                "render() without a render mode draws nothing: "
                f'make the environment with one, such as gym.make("Billiards-v0", render_mode="{RENDER_MODES[1]}")'
            )
            return None
        frames = self._renderer.render()
        return None if frames is None else frames[0]

    def close(self) -> None:
        """Closes the window of the render mode "human"."""
        if self._renderer is not None:
            self._renderer.close()


def make_env(*, render_mode: str | None = None, **arguments: Any) -> BilliardsEnv:
    """Returns the environment of `gym.make("Billiards-v0", ...)`, without Gymnasium's wrappers.

    The docstring of `BilliardsEnv` describes the arguments.

    Raises:
        ValueError: If an argument is invalid.
        TypeError: If an argument is unknown or has the wrong type.
    """
    return BilliardsEnv(model_of(make_env, arguments), render_mode)
