"""The PettingZoo environment: `env` for use, `raw_env` without PettingZoo's wrappers.

```python
>>> from billiards_env.games import billiards_v0
>>> env = billiards_v0.env(rules="nine_ball")
>>> env.reset(seed=0)
>>> for agent in env.agent_iter():
...     observation, reward, termination, truncation, info = env.last()
...     env.step(None if termination or truncation else env.action_space(agent).sample())
>>> env.agents
[]

```
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.error import DependencyNotInstalled
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray

from billiards_env.checks import choose, real, whole
from billiards_env.envs.billiards import cue_velocity, make_scene
from billiards_env.envs.rendering import FPS, RENDER_MODES, DrawnShot, Renderer, balls_at_rest
from billiards_env.games.places import Point, room
from billiards_env.games.play import History, Played, Setup, Stroke, Table, opening, play, set_table
from billiards_env.games.rules import RULES

try:
    import pettingzoo
    from pettingzoo.utils.wrappers import ClipOutOfBoundsWrapper, OrderEnforcingWrapper
except ImportError as error:
    raise DependencyNotInstalled("pettingzoo is not installed, run `pip install 'billiards-env[multi]'`") from error

ID = "billiards_env/billiards-v0"
"""The name for `pettingzoo.make("aec", ...)`, once this module has been imported."""

_VALUES = 4  # of a ball in an observation


class raw_env(pettingzoo.AECEnv[str, NDArray[np.float32], NDArray[np.float32]]):
    """Billiards for two to four players: each action is one cue shot, run until every ball rests.

    ## Games

    | `rules` | Players | Object balls | Won by |
    |---|---|---|---|
    | `"straight"` | 2 to 4 | 1 to 15 | most points when the table is clear, or `target` points |
    | `"eight_ball"` | 2 | 15 | potting the own group, then the eight ball |
    | `"nine_ball"` | 2 to 4 | 9 | potting the nine ball |
    | `"carom"` | 2 to 4 | 2 | `target` points |
    | `"three_cushion"` | 2 to 4 | 2 | `target` points |

    The rules are those of the World Pool-Billiard Association and of the Union Mondiale de Billard, simplified where
    the docstring of `games.rules` says so. Agents are `"player_0"` and so on; `player_0` opens. A player who may go on
    is selected again.

    ## Action Space

    `Box(-1, 1, (4,), float32)`, for the carom games, in which the cue ball is never in hand, `Box(-1, 1, (2,),
    float32)`.

    | Num | Action |
    |---|---|
    | 0, 1 | the cue ball's velocity along x and y, as a share of `max_speed`; shortened to 1 where it is longer |
    | 2, 3 | with the cue ball in hand, where to put it: x and y, from one end of the room it has to the other |

    That room is the table, or the part behind the head string, as far as the ball keeps 1 mm clear of the cushions.
    Where it would lie within 1 mm of a ball or a pocket, the nearest place that is free is taken. So every action can
    be played. When the cue ball is not in hand, actions 2 and 3 do nothing.

    ## Observation Space

    `Box(float32)` of `4 * n_balls + 4` values, and of a score for each player in the games won by points.

    | Num | Observation | Min | Max |
    |---|---|---|---|
    | 4 i, 4 i + 1 | x and y of ball i, over half the table's length and width; of a potted one, its pocket's | -1 | 1 |
    | 4 i + 2 | 1 if it lies on the table; 0 if it is potted, or the cue ball in hand | 0 | 1 |
    | 4 i + 3 | 1 if the observing player may touch it first | 0 | 1 |
    | 4 n | 1 if it is the observing player's turn | 0 | 1 |
    | 4 n + 1 | 1 if the next shot is the break | 0 | 1 |
    | 4 n + 2 | 1 if the cue ball is in hand behind the head string | 0 | 1 |
    | 4 n + 3 | 1 if the cue ball is in hand anywhere | 0 | 1 |
    | last | scores over the target, or the number of balls; the observing player's first, then in turn | -1 | 1 |

    The ball to be struck next comes first, then the others by number. In eight ball the fourth value tells the own
    group.

    ## Rewards

    What the shooter wins, the others lose in equal parts. `"eight_ball"` and `"nine_ball"`: 1 for winning the game, -1
    for losing it. The other games: the points of the shot, so that for two players the return is by how much one leads.

    ## Episode End

    All players terminate when the game is decided. After `max_shots` shots they are truncated: the game is a draw.

    ## Starting State

    `layout`: `"rack"` (the default), `"tight_rack"`, or `"random"` with the balls anywhere and no break; a carom game
    has `"carom_opening"` or `"random"`. `reset(options={"positions": [[x, y], ...], "state": {...}})` sets the table by
    hand, see `games.play.set_table`; other options are ignored, as PettingZoo's API test wants it.

    ## Info

    The same for all players; empty after a reset. `shooter`, `foul` ("" for none), `points`, `potted`, `spotted` and
    `first_hit` (lists of balls), `scores`, `winner` (an agent or None), `shot_time` (s), `n_events` and `status`.

    ## Arguments

    | Argument | Type | Default | Description |
    |---|---|---|---|
    | `rules` | str | `"eight_ball"` | the game |
    | `n_players` | int | `2` | number of players |
    | `scene` | str, dict or None | `None` | a scene's name or data as in `Billiards-v0`; None for "pool" or "carom" |
    | `n_object_balls` | int or None | `None` | object balls of a named scene; None for the game's usual number |
    | `target` | int or None | `None` | the score that wins, 0 for none; None for 0 in `straight`, 10 in carom games |
    | `layout` | str or None | `None` | the starting state |
    | `max_shots` | int | `200` | the most shots of a game |
    | `max_speed` | float | `8.0` | speed of the fastest shot, m/s |
    | `mode`, `dt`, `fix` | | `"pic"` | the engine, as in `Billiards-v0` |
    | `render_mode` | str or None | `None` | `"rgb_array"`, `"rgb_array_list"` or `"human"` |

    ## Version History

    * v0: Initial version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (an instance variable in AECEnv)
        "name": "billiards_v0",
        "render_modes": list(RENDER_MODES),
        "render_fps": FPS,
        "is_parallelizable": False,
    }

    def __init__(
        self,
        rules: str = "eight_ball",
        n_players: int = 2,
        scene: str | Mapping[str, Any] | None = None,
        n_object_balls: int | None = None,
        target: int | None = None,
        layout: str | None = None,
        max_shots: int = 200,
        max_speed: float = 8.0,
        mode: str = "pic",
        dt: float | None = None,
        fix: str | None = None,
        render_mode: str | None = None,
    ) -> None:
        super().__init__()
        self.setup = make_setup(rules, n_players, scene, n_object_balls, target, mode, dt, fix)
        self.layout = layout
        # One throw-away draw, for a layout that does not suit the game to be refused here and not at some reset.
        opening(self.setup, np.random.default_rng(0), layout)
        self.max_shots = whole("max_shots", max_shots, "max_shots")
        self.max_speed = real("max_speed", max_speed, "max_speed")
        if render_mode is not None:
            choose("render_mode", render_mode, RENDER_MODES)
        self.render_mode = render_mode
        self._renderer = None if render_mode is None else Renderer(self.setup.scene, render_mode, mode, dt, fix)

        scene_ = self.setup.scene
        n, players = scene_.n_balls, self.setup.n_players
        self.possible_agents = [f"player_{i}" for i in range(players)]
        self.agents = []
        self._half = np.array([scene_.table.length / 2, scene_.table.width / 2])
        keeps_score = self.setup.target is not None
        self._most = float(self.setup.target or n - 1) if keeps_score else 0.0
        low = np.zeros(_VALUES * n + 4 + (players if keeps_score else 0), np.float32)
        low[0 : _VALUES * n : _VALUES] = low[1 : _VALUES * n : _VALUES] = low[_VALUES * n + 4 :] = -1.0
        self._size = len(low)
        width = 4 if self.setup.game.pockets else 2
        # One space an agent: each samples on its own.
        self.observation_spaces = {
            agent: gym.spaces.Box(low, np.ones_like(low), dtype=np.float32) for agent in self.possible_agents
        }
        self.action_spaces = {agent: gym.spaces.Box(-1.0, 1.0, (width,), np.float32) for agent in self.possible_agents}
        self._rng: np.random.Generator | None = None
        self._opening: Table | None = None
        self._strokes: list[Stroke] = []

    def observation_space(self, agent: str) -> gym.Space[NDArray[np.float32]]:
        """The space of `agent`'s observations, see the class's docstring."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gym.Space[NDArray[np.float32]]:
        """The space of `agent`'s actions, see the class's docstring."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Starts a game.

        Args:
            seed: Seeds the generator that racks the balls; the same seed gives the same game bit for bit.
            options: None, or "positions" and "state" to set the table by hand.

        Raises:
            ValueError: If the balls cannot be placed so, or the state is impossible.
        """
        given = options or {}
        table = None
        if "positions" in given:
            table = set_table(self.setup, given["positions"], given.get("state"))
        if seed is not None or self._rng is None:
            self._rng, _ = np_random(seed)
        self.table = opening(self.setup, self._rng, self.layout) if table is None else table
        self._opening = self.table
        self._strokes = []
        self.agents = self.possible_agents[:]
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self.infos = {agent: {} for agent in self.agents}
        self._skip_agent_selection = None
        self.agent_selection = self.agents[self.table.state.player]
        if self._renderer is not None:
            in_play = np.isin(np.arange(len(self.table.positions)), sorted(self.table.state.on_table))
            self._renderer.begin([balls_at_rest(self.table.positions, self.setup.rules, in_play)])

    def step(self, action: NDArray[np.float32] | None) -> None:
        """Plays the selected agent's shot.

        Args:
            action: As in the class's docstring; None for an agent whose game is over.

        Raises:
            ValueError: If the action is not so many finite numbers.
        """
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            self._was_dead_step(action)  # pyright: ignore[reportArgumentType]
            return
        self._cumulative_rewards[agent] = 0.0
        stroke = self._stroke(action)
        played = play(self.setup, self.table, stroke)
        shot, verdict = played.shot, played.verdict
        if shot.status in ("event_limit", "step_limit"):
            warnings.warn(
                f"a shot was cut off at the engine's limit, after {shot.n_events} events and {shot.time} s; "
                f"setup {self.setup}, positions {self.table.positions.tolist()}, stroke {stroke}",
                RuntimeWarning,
                stacklevel=2,
            )
        self._strokes.append(stroke)
        self.table = played.table
        state = self.table.state
        shooter = self.possible_agents.index(agent)
        if self.setup.target is None:
            worth = 0.0 if state.winner < 0 else 1.0 if state.winner == shooter else -1.0
        else:
            worth = float(verdict.points)
        for other in self.agents:
            self.rewards[other] = worth if other == agent else -worth / (len(self.agents) - 1)
        self._accumulate_rewards()
        for other in self.agents:
            self.terminations[other] = state.over
            self.truncations[other] = not state.over and len(self._strokes) >= self.max_shots
            self.infos[other] = {
                "shooter": agent,
                "foul": verdict.foul,
                "points": verdict.points,
                "potted": list(played.facts.potted),
                "spotted": list(verdict.spotted),
                "first_hit": list(played.facts.first),
                "scores": list(state.scores),
                "winner": None if state.winner < 0 else self.possible_agents[state.winner],
                "shot_time": shot.time,
                "n_events": shot.n_events,
                "status": shot.status,
            }
        self.agent_selection = self.possible_agents[state.player]
        if self._renderer is not None:
            left = f"{self.setup.rules}   {agent}   shot {len(self._strokes)} of {self.max_shots}"
            self._renderer.step([DrawnShot(played.given, left, self._said(played))])

    def observe(self, agent: str) -> NDArray[np.float32]:
        """What `agent` sees, as in the class's docstring."""
        positions, state = self.table
        n, viewer = len(positions), self.possible_agents.index(agent)
        cue = state.cue_balls[0]
        order = [cue, *(ball for ball in range(n) if ball != cue)]
        lying = state.on_table if state.in_hand == "no" else state.object_balls
        legal = self.setup.game.legal(state, viewer)
        observation = np.empty(self._size, np.float32)
        balls = observation[: _VALUES * n].reshape(n, _VALUES)
        balls[:, :2] = np.minimum(np.maximum(positions[order] / self._half, -1.0), 1.0)
        balls[:, 2] = [ball in lying for ball in order]
        balls[:, 3] = [ball in legal for ball in order]
        observation[_VALUES * n : _VALUES * n + 4] = (
            viewer == state.player,
            state.break_shot,
            state.in_hand == "behind",
            state.in_hand == "anywhere",
        )
        if self._most:
            scores = state.scores[viewer:] + state.scores[:viewer]
            observation[_VALUES * n + 4 :] = [min(max(score / self._most, -1.0), 1.0) for score in scores]
        return observation

    def history(self) -> History:
        """The game so far, which `games.replay` plays again and `records.record_game` makes a file of."""
        if self._opening is None:
            raise ValueError("no game has begun: expected reset() before history()")
        return History(self.setup, self._opening, tuple(self._strokes))

    def render(self) -> NDArray[np.uint8] | list[Any] | None:
        """Shows the shots, by the render mode as in `Billiards-v0`.

        Returns:
            "rgb_array": the last frame of the last shot, (height, width, 3) uint8. "rgb_array_list": all frames since
            the last call or reset. None without a render mode, and with "human", which shows each shot while it is
            played.

        Raises:
            DependencyNotInstalled: If pygame is not installed.
        """
        if self._renderer is None:
            gym.logger.warn("render() does nothing without a render_mode: expected env(render_mode='rgb_array')")
            return None
        return cast("NDArray[np.uint8] | list[Any] | None", self._renderer.render())

    def close(self) -> None:
        """Closes the window of render_mode "human"."""
        if self._renderer is not None:
            self._renderer.close()

    def _said(self, played: Played) -> str:
        """What there is to say of a shot, for its picture."""
        state, verdict = played.table.state, played.verdict
        said = [verdict.foul.replace("_", " ")] if verdict.foul else []
        if self.setup.target is not None:
            said.append(" : ".join(map(str, state.scores)))
        if state.over:
            said.append("nobody wins" if state.winner < 0 else f"{self.possible_agents[state.winner]} wins")
        return "   ".join(said)

    def _stroke(self, action: NDArray[np.float32] | None) -> Stroke:
        """What an action does to the table as it is."""
        width = 4 if self.setup.game.pockets else 2
        array = np.asarray(action, dtype=np.float64)
        if array.shape != (width,) or not np.isfinite(array).all():
            raise ValueError(f"action = {action!r}: expected {width} finite numbers")
        state = self.table.state
        vx, vy = cue_velocity(array[:2], self.max_speed).tolist()
        place: Point | None = None
        if state.in_hand != "no":
            x_low, x_high, y_low, y_high = room(self.setup.scene, state.cue_balls[0], state.in_hand == "behind")
            x, y = np.minimum(np.maximum(array[2:], -1.0), 1.0).tolist()
            place = (x_low + x_high) / 2 + (x_high - x_low) / 2 * x, (y_low + y_high) / 2 + (y_high - y_low) / 2 * y
        return Stroke((vx, vy), place)


def make_setup(
    rules: str,
    n_players: int,
    scene: str | Mapping[str, Any] | None,
    n_object_balls: int | None,
    target: int | None,
    mode: str,
    dt: float | None,
    fix: str | None,
) -> Setup:
    """The game that the environment's arguments ask for.

    Args:
        rules: As in `raw_env`.
        n_players: As in `raw_env`.
        scene: As in `raw_env`.
        n_object_balls: As in `raw_env`.
        target: As in `raw_env`.
        mode: As in `raw_env`.
        dt: As in `raw_env`.
        fix: As in `raw_env`.

    Returns:
        The setup.

    Raises:
        ValueError: If an argument is unknown, or does not suit the game.
        TypeError: If the scene is of the wrong type.
    """
    choose("rules", rules, tuple(RULES))
    game = RULES[rules]
    if scene is None:
        scene = "pool" if game.pockets else "carom"
    if isinstance(scene, str) and n_object_balls is None:
        n_object_balls = game.n_object_balls[1]
    return Setup(rules, make_scene(scene, n_object_balls), n_players, target, mode, dt, fix)


def env(**kwargs: Any) -> OrderEnforcingWrapper[str, NDArray[np.float32], NDArray[np.float32]]:
    """The environment with PettingZoo's wrappers: actions out of bounds are clipped, the order of calls is checked.

    Args:
        **kwargs: The arguments of `raw_env`.

    Returns:
        The environment.
    """
    return OrderEnforcingWrapper(ClipOutOfBoundsWrapper(raw_env(**kwargs)))


if ID not in pettingzoo.aec_registry:
    pettingzoo.register("aec", ID, entry_point=env)
