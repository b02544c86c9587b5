"""Opponents: turns a vector environment of games into one of a single player.

Example:
    >>> import numpy as np
    >>> from billiards_env.envs import Opponents, make_vector_env
    >>> rng = np.random.default_rng(0)
    >>> games = make_vector_env(8, task="nine_ball", n_players=2)
    >>> envs = Opponents(games, lambda observations, rows: rng.uniform(-1, 1, (len(rows), 4)))
    >>> observations, infos = envs.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    >>> bool((infos["next_player"] == envs.seats).all())
    True
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorWrapper
from numpy.typing import NDArray

from billiards_env.doors import load
from billiards_env.envs.info import masked_info
from billiards_env.envs.observations import nth
from billiards_env.envs.vector import BilliardsVectorEnv, masked_rows
from billiards_env.support.checks import Range, integer, numbers, shaped, short

Policy = Callable[[Any, NDArray[np.int64]], NDArray[Any]]
"""A function `(observations, rows) -> actions`. `rows` (k,) are the numbers of the environments."""

MOST_RESTARTS = 1000
"""The largest number of games in a row that end before the first turn of the learner."""


class Opponents(VectorWrapper):
    """A vector of games in which one player learns, and a policy plays the turns of the other players.

    A step plays the shot of the learner in each game, and then shots of the others until it is the learner's turn again
    or the game is over. Its reward is the sum of the learner's rewards for these shots, and for the shots of the others
    before the first turn. The autoreset mode is "SameStep". After each game the seat of the learner moves to the next
    player, unless `seat` is given. The info is that of the last shot, but `is_success` is whether the learner has won.
    A game that ends before the first turn of the learner is not an episode. The shots are not rendered.

    Args:
        envs: A vector environment of games of several players.
        policy: Plays the turns of the other players: a function, or the name of a player, such as "planner:club" or
            "policy:FOLDER". Assign another function to the attribute `policy` at any time. It plays from the next shot
            on, also in games that have begun.
        seat: The player who learns, from 0 to `n_players` - 1; None to change the seat.

    Attributes:
        policy: The function.
        seats: (num_envs,) int64, the player who learns in each game.
        unplayed: The returns of the learner in games that ended before its first turn.

    Raises:
        TypeError: If `envs` is not a `BilliardsVectorEnv`.
        ValueError: If it has one player, or there is no such seat.
    """

    def __init__(self, envs: BilliardsVectorEnv, policy: Policy | str, seat: int | None = None) -> None:
        if not isinstance(envs, BilliardsVectorEnv):
            raise TypeError(f"envs = {short(envs)}: expected a BilliardsVectorEnv")
        players = envs.single_env.model.n_players
        if players == 1:
            raise ValueError("envs with n_players = 1: expected a game of several players")
        super().__init__(envs)
        self.metadata = {**envs.metadata, "autoreset_mode": AutoresetMode.SAME_STEP}
        self.policy = load("opponent")(policy, envs) if isinstance(policy, str) else policy
        self._games, self._players = envs, players
        self._first = np.arange(envs.num_envs) % players  # the seats of seeded games
        self._moves = 0 if seat is not None else 1
        if seat is not None:
            self._first[:] = integer("seat", seat, Range(0, players - 1))
        self.seats, self.unplayed = self._first.copy(), list[float]()
        self._earned = np.zeros(envs.num_envs)  # before the first turn of the learner
        self._next = np.full(envs.num_envs, -1)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins a game in every environment, or in those of a mask, as `BilliardsVectorEnv.reset`."""
        observations, infos = self._games.reset(seed=seed, options=options)
        mask = (
            np.ones(self.num_envs, np.bool_) if options is None else options.get("reset_mask", self._next == self._next)
        )
        if seed is not None:
            self.seats[mask] = self._first[mask]
        else:
            self._move(mask & (self._next >= 0))
        return self._begin(mask, observations, infos)

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Plays the shots of the learner and those of the others up to its next turn, see the class.

        Raises:
            ResetNeeded: If the games have not begun, or the step before raised an exception.
            ValueError: As in `BilliardsVectorEnv.step`.
        """
        if (self._next != self.seats).any():
            raise ResetNeeded("The games have not begun, or a step was interrupted: call reset() before step()")
        everywhere = np.ones(self.num_envs, np.bool_)
        observations, rewards, over, truncated, infos = self._games.step_where(everywhere, actions)
        rewards, self._earned = rewards + self._earned, np.zeros(self.num_envs)
        self._next[:] = -1
        observations, over, infos = self._play_others(everywhere, observations, over, infos, rewards)
        infos["is_success"] = infos["winner"] == self.seats
        if over.any():
            last, last_info = masked_rows(observations, over), masked_info(_plain(infos), over)
            self._move(over)
            observations, begun = self._games.reset(options={"reset_mask": over})
            observations, begun = self._begin(over, observations, begun)
            infos = {key: merged(over, begun[key], infos[key]) for key in infos}
            infos |= {"final_obs": last, "final_info": last_info, "_final_obs": over, "_final_info": over.copy()}
        self._next[:] = infos["next_player"]
        return observations, rewards, over, truncated, infos

    def _move(self, mask: NDArray[np.bool_]) -> None:
        """Moves the seats of the learner in the mask to the next player."""
        self.seats[mask] = (self.seats[mask] + self._moves) % self._players

    def _begin(self, mask: NDArray[np.bool_], observations: Any, infos: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Plays games that have begun up to the first turn of the learner."""
        self._earned[mask] = 0.0
        for _ in range(MOST_RESTARTS):
            rewards = np.zeros(self.num_envs)
            nowhere = np.zeros(self.num_envs, np.bool_)
            observations, over, infos = self._play_others(mask, observations, nowhere, infos, rewards)
            going_on, mask = mask & ~over, mask & over
            self._earned[going_on] = rewards[going_on]
            self._next[going_on] = infos["next_player"][going_on]
            if not mask.any():
                return observations, infos
            self.unplayed += rewards[mask].tolist()
            self._move(mask)
            observations, begun = self._games.reset(options={"reset_mask": mask})
            infos = {key: merged(mask, begun[key], infos[key]) for key in infos}
        raise ValueError(f"{MOST_RESTARTS} games in a row ended before the learner's turn: expected a larger max_shots")

    def _play_others(
        self,
        mask: NDArray[np.bool_],
        observations: Any,
        over: NDArray[np.bool_],
        infos: dict[str, Any],
        rewards: NDArray[np.float64],
    ) -> tuple[Any, NDArray[np.bool_], dict[str, Any]]:
        """Plays the games in the mask up to the turn of the learner, and adds its rewards to `rewards`."""
        games = np.arange(self.num_envs)
        while (waiting := mask & ~over & (infos["next_player"] != self.seats)).any():
            actions = np.zeros((self.num_envs, *self._games.single_env.action_space.shape))
            actions[waiting] = self._actions(nth(observations, waiting), np.flatnonzero(waiting))
            observations, _, over, _, played = self._games.step_where(waiting, actions)
            rewards += np.where(waiting, played["rewards"][games, self.seats], 0.0)
            infos = {key: merged(waiting, played[key], infos[key]) for key in infos}
        return observations, over, infos

    def _actions(self, observations: Any, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Returns the actions of the policy after a check."""
        name, actions = f"actions of the policy {short(self.policy)}", self.policy(observations, rows)
        if isinstance(actions, tuple):
            raise TypeError(f"{name} = {short(actions)}: expected an array, the first result of model.predict")
        return shaped(name, numbers(name, actions), (len(rows), *self._games.single_env.action_space.shape))


def _plain(infos: dict[str, Any]) -> dict[str, Any]:
    """Returns the infos without their masks."""
    return {key: values for key, values in infos.items() if not key.startswith("_")}


def merged(mask: NDArray[np.bool_], chosen: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
    """Returns the rows of `chosen` in the mask and those of `others` outside of it."""
    return np.where(mask.reshape(-1, *(1,) * (chosen.ndim - 1)), chosen, others)
