"""The PettingZoo environment `GameEnv`: `env` for use, `raw_env` without PettingZoo's wrappers.

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

from billiards_env.checks import finite, flag, integer, missing, one_of, real, short
from billiards_env.engine import Engine
from billiards_env.envs.actions import ACTIONS, PLAYED, check_action, cue_strike
from billiards_env.envs.arguments import fixed, make_scene
from billiards_env.envs.rendering import FPS, RENDER_MODES, DrawnShot, Renderer, balls_at_rest
from billiards_env.games.game import (
    NO_CALL,
    Call,
    GameState,
    History,
    PlayedShot,
    Setup,
    Stroke,
    choices,
    custom_opening,
    opening,
    play,
)
from billiards_env.games.placement import Point, cue_ball_area
from billiards_env.games.referee import GAMES
from billiards_env.games.state import ANYWHERE, BEHIND, FOULS, in_play, is_in, on_table, to_dict
from billiards_env.scene import Scene

try:
    import pettingzoo
    from pettingzoo.utils.wrappers import ClipOutOfBoundsWrapper, OrderEnforcingWrapper
except ImportError as error:
    raise DependencyNotInstalled(str(missing("pettingzoo", "multi"))) from error

ID = "billiards_env/billiards-v0"
"""The name for `pettingzoo.make("aec", ...)`, once this module has been imported."""

_VALUES = 4  # of a ball in an observation


class GameEnv(pettingzoo.AECEnv[str, NDArray[np.float32], NDArray[np.float32]]):
    """Billiards for two to four players: each action is one cue shot, simulated until every ball rests.

    ## Games

    `rules` is one of `games.GAMES`. The table in `docs/games.md` describes them.

    The rules follow the World Pool-Billiard Association, the World Professional Billiards and Snooker Association and
    the Union Mondiale de Billard, with the simplifications listed in the docstrings of `games.pool`, `games.snooker`
    and `games.carom`. The agents are `"player_0"`, `"player_1"` and so on; `player_0` opens. A player whose turn
    continues is selected again.

    ## Action Space

    `Box(-1, 1, (4,), float32)`. In carom games, in which the cue ball is never in hand, it is
    `Box(-1, 1, (2,), float32)`.

    | Num | Action |
    |---|---|
    | 0, 1 | velocity of the cue ball along x and y, in units of `max_speed`; a vector longer than 1 is scaled to 1 |
    | 2, 3 | position of the cue ball in hand: x and y, from -1 to 1 over the placement area |

    With `action="strike"` three numbers follow the first two, as in `Billiards-v0`: the offsets of the tip to the left
    of the ball's centre and above it, and the elevation of the cue. The numbers after them move up by three.

    The placement area is the table, or the part behind the head string, except for a margin of 1 mm at the cushions. In
    snooker it is the rectangle around the D. A point outside the D or within 1 mm of a ball or a pocket is replaced by
    the nearest free point, so every action is valid. When the cue ball is not in hand, actions 2 and 3 have no effect.

    By default any ball potted on a legal shot counts, and a player makes no choices, so an action needs no call. With
    `can_call=True` eight ball, ten ball and straight pool have called shots, and three numbers follow:

    | Num | Action |
    |---|---|
    | 4 | the called ball, in snooker the nominated ball: -1 to 1 in equal parts for the object balls 1, 2, ... |
    | 5 | the called pocket: -1 to 1 in equal parts for the pockets 0, 1, ... |
    | 6 | up to 0 an ordinary shot; above 0, in equal parts, the player's other choices |

    The other choices are a safety in the games with called shots, and then `choices` of the info: "push_out" and
    "hand_back" in nine ball and ten ball, "hand_back" and "replace" in snooker, see `games.state.CALLS`. If a player
    has no other choice, every shot is an ordinary one. After "hand_back" and "replace" no ball moves, and the previous
    player plays.

    ## Observation Space

    `Box(float32)` of `4 * n_balls + 4` values. With `can_call=True` three values follow; then one per player in the
    games that penalise three consecutive fouls (nine ball and ten ball with two players, straight pool with a target);
    then one score per player in the games won by points.

    | Num | Observation | Min | Max |
    |---|---|---|---|
    | 4 i, 4 i + 1 | x and y of ball i over `scene.half_extents`; of its pocket if it is potted | -1 | 1 |
    | 4 i + 2 | 1 if ball i lies on the table; 0 if it is potted or is the cue ball in hand | 0 | 1 |
    | 4 i + 3 | 1 if the observing player may touch ball i first | 0 | 1 |
    | 4 n | 1 if it is the observing player's turn | 0 | 1 |
    | 4 n + 1 | 1 if the next shot is the break | 0 | 1 |
    | 4 n + 2 | 1 if the cue ball is in hand behind the head string | 0 | 1 |
    | 4 n + 3 | 1 if the cue ball is in hand anywhere | 0 | 1 |
    | 4 n + 4 to 6 | with `can_call=True`: 1 if "push_out", "hand_back", "replace" is a choice of the player | 0 | 1 |
    | then | consecutive fouls / 3; the observing player's first | 0 | 1 |
    | last | scores over the target, or over the points on a full table; the observing player's first | -1 | 1 |

    The ball to be struck next comes first, then the others by number. In eight ball, value 4 i + 3 marks the player's
    group.

    ## Rewards

    The reward of the shooter is subtracted from the other players in equal parts. In `"eight_ball"`, `"nine_ball"` and
    `"ten_ball"` it is 1 for winning the game and -1 for losing it. In the other games it is the number of points of the
    shot, in snooker minus the penalty points for the other player. With two players the return is therefore the lead.

    ## Episode End

    All players terminate when the game is over. After `max_shots` shots they are truncated, and the game is a draw.

    ## Starting State

    `layout` is one of `GAMES[rules].layouts`, by default the first: `"rack"`, `"tight_rack"` or `"random"` in the pool
    games, `"snooker"` or `"random"` in snooker, `"carom_opening"` or `"random"` in carom games. "random" has no break.
    `reset(options={"positions": [[x, y], ...], "state": {...}})` sets the state, see `games.game.custom_opening`.

    ## Info

    The info is the same for all players, and empty after a reset. Its keys are `shooter`, `foul` ("" for no foul),
    `points`, `potted`, `spotted` and `first_hit` (lists of balls), `choices` (of the next shot), `scores`, `winner` (an
    agent or None), `shot_time` (s), `n_events` and `status`. With `action="strike"` also `miscue`, whether the tip
    slipped.

    ## Arguments

    | Argument | Type | Default | Description |
    |---|---|---|---|
    | `rules` | str | `"eight_ball"` | the game |
    | `n_players` | int | `2` | number of players |
    | `scene` | see right | `None` | a scene as in `Billiards-v0`; None for the game's |
    | `n_object_balls` | int or None | `None` | object balls of a named scene; None for the default of the game |
    | `target` | int or None | `None` | the score that wins, or 0; None for 0, in carom games for 10 |
    | `action` | str | `"velocity"` | `"velocity"` or `"strike"`, see Action Space |
    | `can_call` | bool | `False` | whether players call, see Action Space |
    | `miss` | bool | `False` | whether snooker has the miss rule; needs `can_call=True` |
    | `layout` | str or None | `None` | the starting state |
    | `max_shots` | int | `200` | the largest number of shots of a game |
    | `max_speed` | float | `8.0` | speed of the fastest shot, m/s |
    | `mode`, `dt`, `fix` | | `"pic"` | the engine, as in `Billiards-v0` |
    | `render_mode` | str or None | `None` | `"rgb_array"`, `"rgb_array_list"` or `"human"` |

    These are the arguments of `env` and `raw_env`. Both functions make the `Setup` for the constructor from them.

    ## Version History

    * v0: Initial version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (an instance variable in AECEnv)
        "name": "billiards_v0",
        "render_modes": list(RENDER_MODES),
        "render_fps": FPS,
        "is_parallelizable": False,
    }
    setup: Setup = fixed()
    action: str = fixed()
    can_call: bool = fixed()
    layout: str | None = fixed()
    max_shots: int = fixed()
    max_speed: float = fixed()

    def __init__(
        self,
        setup: Setup,
        action: str = "velocity",
        can_call: bool = False,
        layout: str | None = None,
        max_shots: int = 200,
        max_speed: float = 8.0,
        render_mode: str | None = None,
    ) -> None:
        super().__init__()
        self.setup, game_rules = setup, setup.game_rules
        if flag("can_call", can_call) and not game_rules.pockets:
            raise ValueError(f"can_call = True with rules = {setup.rules!r}: expected False, the game has no calls")
        self.action = check_action(action, setup.scene, PLAYED)
        self.can_call = can_call
        self.layout = layout
        opening(self.setup, np.random.default_rng(0), layout)  # raises here if the layout does not suit the game
        self.max_shots = integer("max_shots", max_shots, "max_shots")
        self.max_speed = real("max_speed", max_speed, "max_speed")
        if render_mode is not None:
            one_of("render_mode", render_mode, RENDER_MODES)
        self.render_mode = render_mode
        self._renderer = None if render_mode is None else Renderer(self.setup.scene, render_mode)

        n, players = self.setup.scene.n_balls, self.setup.n_players
        self.possible_agents = [f"player_{i}" for i in range(players)]
        self.agents = []
        self._half = np.array(self.setup.scene.half_extents)
        self._score_scale = float(self.setup.target or game_rules.most_points(n - 1))
        target = self.setup.target
        self._observes_fouls = game_rules.counts_fouls and (players == 2 if target is None else target > 0)
        scores = players if self.setup.target is not None else 0
        low = np.zeros(_VALUES * n + 4 + 3 * can_call + players * self._observes_fouls + scores, np.float32)
        low[0 : _VALUES * n : _VALUES] = low[1 : _VALUES * n : _VALUES] = low[len(low) - scores :] = -1.0
        self._width = ACTIONS[action].size + 2 * game_rules.pockets + 3 * can_call
        # Each agent has a separate space, so each space samples independently.
        self.observation_spaces = {
            agent: gym.spaces.Box(low, np.ones_like(low), dtype=np.float32) for agent in self.possible_agents
        }
        self.action_spaces = {
            agent: gym.spaces.Box(-1.0, 1.0, (self._width,), np.float32) for agent in self.possible_agents
        }
        self._rng: np.random.Generator | None = None
        self._opening: GameState | None = None
        self._strokes: list[Stroke] = []

    def observation_space(self, agent: str) -> gym.Space[NDArray[np.float32]]:
        """Returns the observation space of `agent`, see the class's docstring."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gym.Space[NDArray[np.float32]]:
        """Returns the action space of `agent`, see the class's docstring."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Starts a game.

        Args:
            seed: Seed of the generator that racks the balls; the same seed gives the same game bit for bit.
            options: None, or a dict with "positions" and, if the default does not fit, "state".

        Raises:
            ValueError: If an option is unknown, or the positions or the state are invalid.
            TypeError: If the options are not a mapping.
        """
        if options is not None and not isinstance(options, Mapping):
            raise TypeError(f"options = {short(options)}: expected a dict")
        start = {key: value for key, value in (options or {}).items() if key != "options"}  # PettingZoo's tests pass it
        for key in start:
            one_of("key of options", key, ("positions", "state"))
        if "state" in start and "positions" not in start:
            raise ValueError(f"options = {short(start)}: expected positions beside the state")
        game = custom_opening(self.setup, **start) if start else None
        if seed is not None or self._rng is None:
            self._rng, _ = np_random(seed)
        self.game = opening(self.setup, self._rng, self.layout) if game is None else game
        self._opening = self.game
        self._strokes = []
        self.agents = self.possible_agents[:]
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self.infos = {agent: {} for agent in self.agents}
        self._skip_agent_selection = None
        self.agent_selection = self.agents[self.game.state.player]
        if self._renderer is not None:
            positions, state, _ = self.game
            lying = is_in(on_table(state), len(positions))
            self._renderer.begin([balls_at_rest(self.setup.scene, positions, lying, self.setup.rules)])

    def step(self, action: NDArray[np.float32] | None) -> None:
        """Plays the selected agent's shot.

        Args:
            action: As in the class's docstring; None for an agent whose game is over.

        Raises:
            ValueError: If the action has the wrong shape or a number is not finite.
        """
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            self._was_dead_step(action)  # pyright: ignore[reportArgumentType]
            return
        self._cumulative_rewards[agent] = 0.0
        stroke, miscue = self._stroke(action)
        played = play(self.setup, self.game, stroke)
        shot, verdict = played.shot, to_dict(played.verdict)
        if shot.status in ("event_limit", "step_limit"):
            warnings.warn(
                f"a shot reached the engine's limit after {shot.n_events} events and {shot.time} s; "
                f"setup {self.setup}, positions {self.game.positions.tolist()}, stroke {stroke}",
                RuntimeWarning,
                stacklevel=2,
            )
        self._strokes.append(stroke)
        self.game = played.game
        state, winner = to_dict(self.game.state), int(self.game.state.winner)
        shooter = self.possible_agents.index(agent)
        if self.setup.target is None:
            worth = 0.0 if winner < 0 else 1.0 if winner == shooter else -1.0
        else:
            worth = float(verdict["points"] - verdict["penalty"])
        for other in self.agents:
            self.rewards[other] = worth if other == agent else -worth / (len(self.agents) - 1)
        self._accumulate_rewards()
        for other in self.agents:
            self.terminations[other] = state["over"]
            self.truncations[other] = not state["over"] and len(self._strokes) >= self.max_shots
            self.infos[other] = {
                "shooter": agent,
                "foul": verdict["foul"],
                "points": verdict["points"],
                "potted": [ball for ball, _ in played.pots],
                "spotted": list(verdict["spotted"]),
                "first_hit": list(to_dict(played.facts)["first"]),
                "choices": list(state["choices"]),
                "scores": list(state["scores"]),
                "winner": None if winner < 0 else self.possible_agents[winner],
                "shot_time": shot.time,
                "n_events": shot.n_events,
                "status": shot.status,
            }
            if ACTIONS[self.action].has_cue:
                self.infos[other]["miscue"] = miscue
        self.agent_selection = self.possible_agents[state["player"]]
        if self._renderer is not None:
            left = f"{self.setup.rules}   {agent}   shot {len(self._strokes)} of {self.max_shots}"
            self._renderer.step([DrawnShot(played.shot, left, self._result_text(played))])

    def observe(self, agent: str) -> NDArray[np.float32]:
        """Returns the observation of `agent`, see the class's docstring."""
        positions, state, _ = self.game
        n, players, viewer = len(positions), self.setup.n_players, self.possible_agents.index(agent)
        cue = int(state.cue_balls[0])
        order = [cue, *(ball for ball in range(n) if ball != cue)]
        balls = np.empty((n, _VALUES), np.float32)
        balls[:, :2] = np.minimum(np.maximum(positions[order] / self._half, -1.0), 1.0)
        balls[:, 2] = is_in(in_play(state), n)[order]
        balls[:, 3] = np.isin(order, self.setup.legal(state, viewer))
        values = [viewer == state.player, state.break_shot, state.in_hand == BEHIND, state.in_hand == ANYWHERE]
        if self.can_call:
            values += [choice in choices(state) for choice in ("push_out", "hand_back", "replace")]
        if self._observes_fouls:
            values += np.minimum(np.roll(state.fouls[:players], -viewer) / 3, 1.0).tolist()
        if self.setup.target is not None:
            scores = np.roll(state.scores[:players], -viewer)
            values += np.clip(scores / self._score_scale, -1.0, 1.0).tolist()
        return np.concatenate((balls.ravel(), np.array(values, np.float32)))

    def history(self) -> History:
        """Returns the game up to now, for `games.replay` and `records.record_game`."""
        if self._opening is None:
            raise ValueError("no game has begun: expected reset() before history()")
        return History(self.setup, self._opening, tuple(self._strokes))

    def render(self) -> NDArray[np.uint8] | list[Any] | None:
        """Renders the shots as in `Billiards-v0`.

        Returns:
            "rgb_array": the last frame of the last shot, (height, width, 3) uint8. "rgb_array_list": all frames since
            the last call or reset. None without a render mode and for "human", whose window shows each shot during
            `step`.

        Raises:
            DependencyNotInstalled: If pygame is not installed.
        """
        if self._renderer is None:
            gym.logger.warn("render() does nothing without a render_mode: expected env(render_mode='rgb_array')")
            return None
        frames = self._renderer.render()
        return None if frames is None else cast("NDArray[np.uint8] | list[Any] | None", frames[0])

    def close(self) -> None:
        """Closes the window of render_mode "human"."""
        if self._renderer is not None:
            self._renderer.close()

    def _result_text(self, played: PlayedShot) -> str:
        """Returns the text that a rendered shot shows at its end."""
        state, verdict = played.game.state, played.verdict
        parts = [FOULS[verdict.foul].replace("_", " ")] if verdict.foul else []
        if self.setup.target is not None:
            parts.append(" : ".join(map(str, state.scores[: self.setup.n_players])))
        if state.over:
            parts.append("nobody wins" if state.winner < 0 else f"{self.possible_agents[state.winner]} wins")
        return "   ".join(parts)

    def _stroke(self, action: NDArray[np.float32] | None) -> tuple[Stroke, bool]:
        """Converts an action to a stroke in the present state; also returns whether the tip slips."""
        array = finite("action", action, (self._width,))
        state, scene, size = self.game.state, self.setup.scene, ACTIONS[self.action].size
        call = self._call(array[-3:]) if self.can_call else NO_CALL
        if call.kind in ("hand_back", "replace"):
            return Stroke((0.0, 0.0), call=Call(kind=call.kind)), False
        struck = cue_strike(array[:size], scene, self.max_speed)
        (vx, vy), (wx, wy, wz) = struck.velocity.tolist(), struck.spin.tolist()
        place: Point | None = None
        if state.in_hand:
            x_low, x_high, y_low, y_high = cue_ball_area(scene, state)
            x, y = np.minimum(np.maximum(array[size : size + 2], -1.0), 1.0).tolist()
            place = (x_low + x_high) / 2 + (x_high - x_low) / 2 * x, (y_low + y_high) / 2 + (y_high - y_low) / 2 * y
        return Stroke((vx, vy), place, (wx, wy, wz), call), bool(struck.miscue)

    def _call(self, values: NDArray[np.float64]) -> Call:
        """Returns the call for the last three numbers of an action."""
        state, scene = self.game.state, self.setup.scene
        ball, pocket, choice = values.tolist()
        safety = ("safety",) if state.call_shot else ()
        kinds = (*safety, *choices(state))
        kind = kinds[_part(2 * choice - 1, len(kinds))] if choice > 0 and kinds else "shot"
        return Call(1 + _part(ball, scene.n_balls - 1), _part(pocket, len(scene.table.pockets)), kind)


def _part(value: float, count: int) -> int:
    """Returns in which of `count` equal parts of -1 to 1 a value lies."""
    return min(max(int((value + 1) / 2 * count), 0), count - 1)


def raw_env(
    rules: str = "eight_ball",
    *,
    n_players: int = 2,
    scene: str | Scene | Mapping[str, Any] | None = None,
    n_object_balls: int | None = None,
    target: int | None = None,
    can_call: bool = False,
    miss: bool = False,
    mode: str = "pic",
    dt: float | None = None,
    fix: str | None = None,
    **options: Any,
) -> GameEnv:
    """Returns the environment without PettingZoo's wrappers. The docstring of `GameEnv` describes the arguments.

    Raises:
        ValueError: If an argument is invalid.
        TypeError: If an argument is unknown or has the wrong type.
    """
    if flag("miss", miss) and not can_call:
        raise ValueError("miss = True with can_call = False: expected can_call = True, the miss rule gives a choice")
    one_of("rules", rules, tuple(GAMES))
    game_rules = GAMES[rules]
    board = make_scene(scene, n_object_balls, game_rules.scene, game_rules.n_object_balls[1])
    call_shot = can_call and game_rules.callable is not None
    setup = Setup(rules, board, n_players, target, Engine(mode, dt, fix), call_shot, miss)
    return GameEnv(setup, can_call=can_call, **options)


def env(**kwargs: Any) -> OrderEnforcingWrapper[str, NDArray[np.float32], NDArray[np.float32]]:
    """Returns the environment with PettingZoo's wrappers, which clip actions and check the order of calls.

    Args:
        **kwargs: The arguments that the docstring of `GameEnv` describes.

    Returns:
        The environment.
    """
    return OrderEnforcingWrapper(ClipOutOfBoundsWrapper(raw_env(**kwargs)))


if ID not in pettingzoo.aec_registry:
    pettingzoo.register("aec", ID, entry_point=env)
