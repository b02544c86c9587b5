"""The PettingZoo environment `GameEnv`: `env` for use, `raw_env` without PettingZoo's wrappers.

```python
>>> from billiards_env import billiards_v0
>>> env = billiards_v0.env(task="nine_ball")
>>> env.reset(seed=0)
>>> for agent in env.agent_iter():
...     observation, reward, termination, truncation, info = env.last()
...     env.step(None if termination or truncation else env.action_space(agent).sample())
>>> env.agents
[]

```
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from billiards_env.envs import BilliardsEnv
from billiards_env.envs.arguments import Model, model_of
from billiards_env.games.playing import GameState, History, Stroke
from billiards_env.support.checks import missing

try:
    import pettingzoo
    from pettingzoo.utils.wrappers import ClipOutOfBoundsWrapper, OrderEnforcingWrapper
except ImportError as error:
    raise DependencyNotInstalled(str(missing("pettingzoo", "multi"))) from error

ID = "billiards_env/billiards-v0"
"""The name for `pettingzoo.make("aec", ...)`, once this module has been imported."""


class GameEnv(pettingzoo.AECEnv[str, Any, NDArray[np.float32]]):
    """A game of `Billiards-v0` with several players in the interface of PettingZoo.

    `BilliardsEnv` documents the arguments, the actions, the observations, the rewards and the info, which is the same
    for all players. The agents are `"player_0"`, `"player_1"` and so on; `player_0` opens. A player whose turn
    continues is selected again. All players terminate when the game is over. After `max_shots` shots they are
    truncated, and the game is a draw.

    Args:
        model: The arguments, see `make_model`.
        render_mode: One of `envs.billiards.RENDER_MODES`, or None.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (an instance variable in AECEnv)
        **BilliardsEnv.metadata,
        "name": "billiards_v0",
        "is_parallelizable": False,
    }

    def __init__(self, model: Model, render_mode: str | None = None) -> None:
        super().__init__()
        if model.setup is None:
            raise ValueError("n_players = 1: expected 2 to 4, a game of several players")
        self.env, self.setup, self.render_mode = BilliardsEnv(model, render_mode), model.setup, render_mode
        self.possible_agents = [f"player_{i}" for i in range(model.n_players)]
        self.agents = []
        # Each agent has a separate space, so each space samples independently.
        self.observation_spaces = {agent: copy.deepcopy(self.env.observation_space) for agent in self.possible_agents}
        self.action_spaces = {agent: copy.deepcopy(self.env.action_space) for agent in self.possible_agents}
        self._opening: GameState | None = None
        self._setup = model.setup  # with the physics of the game
        self._strokes: list[Stroke] = []

    def observation_space(self, agent: str) -> gym.Space[Any]:
        """Returns the observation space of `agent`."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gym.Space[Any]:
        """Returns the action space of `agent`."""
        return self.action_spaces[agent]

    @property
    def game(self) -> GameState:
        """The game before the next shot."""
        return self.env.game

    @property
    def action_masks(self) -> Callable[[], NDArray[np.bool_]]:
        """A method that returns the possible plans of the selected agent, see `BilliardsEnv.action_masks`."""
        return self.env.action_masks

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Begins a game; the arguments and errors are as in `BilliardsEnv.reset`."""
        if isinstance(options, dict):
            options = {key: value for key, value in options.items() if key != "options"}  # PettingZoo's tests pass it
        _, info = self.env.reset(seed=seed, options=options)
        self._opening, self._strokes, self.agents = self.game, [], self.possible_agents[:]
        scene, engine = self.env.episode_scene_and_engine
        self._setup = dataclasses.replace(self.setup, scene=scene, engine=engine)
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self.infos = {agent: dict(info) for agent in self.agents}
        self._skip_agent_selection = None
        self.agent_selection = self.agents[self.game.state.player]

    def step(self, action: Any) -> None:
        """Plays the selected agent's shot; `action` is None for an agent whose game is over.

        Raises:
            ValueError: If the action has the wrong shape or a number is not finite.
        """
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            self._was_dead_step(action)
            return
        self._cumulative_rewards[agent] = 0.0
        _, _, over, _, info = self.env.step(action)
        stroke = self.env.stroke
        assert stroke is not None
        self._strokes.append(stroke)
        self.rewards = dict(zip(self.agents, info["rewards"].tolist(), strict=True))
        self._accumulate_rewards()
        decided = bool(self.game.state.over)
        self.terminations = dict.fromkeys(self.agents, decided)
        self.truncations = dict.fromkeys(self.agents, over and not decided)
        self.infos = {other: dict(info) for other in self.agents}
        self.agent_selection = self.possible_agents[info["next_player"]]

    def observe(self, agent: str) -> Any:
        """Returns the observation of `agent`."""
        return self.env.observe_as(self.possible_agents.index(agent))

    def history(self) -> History:
        """Returns the game up to now, for `games.replay` and `records.record_game`."""
        if self._opening is None:
            raise ValueError("no game has begun: expected reset() before history()")
        return History(self._setup, self._opening, tuple(self._strokes))

    def render(self) -> Any:
        """Renders the shots as `BilliardsEnv` does."""
        return self.env.render()

    def close(self) -> None:
        """Closes the window of render_mode "human"."""
        self.env.close()


def raw_env(
    task: str = "eight_ball", *, n_players: int = 2, render_mode: str | None = None, **arguments: Any
) -> GameEnv:
    """Returns the environment without PettingZoo's wrappers. `BilliardsEnv` documents the arguments and errors."""
    return GameEnv(model_of(raw_env, {"task": task, "n_players": n_players, **arguments}), render_mode)


def env(**arguments: Any) -> OrderEnforcingWrapper[str, Any, NDArray[np.float32]]:
    """Returns the environment with PettingZoo's wrappers, which clip actions and check the order of calls."""
    made = raw_env(**arguments)
    boxes = all(isinstance(space, gym.spaces.Box) for space in made.action_spaces.values())
    return OrderEnforcingWrapper(ClipOutOfBoundsWrapper(made) if boxes else made)


if ID not in pettingzoo.aec_registry:
    pettingzoo.register("aec", ID, entry_point=env)
