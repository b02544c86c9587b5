"""Self-play in nine ball with Stable-Baselines3: `python examples/self_play.py` (extra `train`).

A policy first learns to run out racks of nine ball alone. Then it plays games against frozen copies of itself, and
learns from won and lost games. `Opponents` plays the turns of the copy, so the learner sees an environment of one
player. The command prints the share of games that the policy wins against other players, before and after the games.
"""

import copy
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from billiards_env.envs import Opponents
from billiards_env.players.env_player import acting_in
from billiards_env.players.named import find_player
from billiards_env.sb3 import PPO_SETTINGS, AimPolicy, SameStepVecEnv

TABLE = {"task": "nine_ball", "observe": ("positions", "legal_balls"), "max_speed": 8.0}
GAME = {**TABLE, "n_players": 2, "can_place": False, "max_shots": 60}
RIVALS = ("random", "search:20", "planner:beginner")


def games(num_envs: int) -> Any:
    """Returns games of two players, in which a cue ball in hand is placed near the head spot."""
    return gym.make_vec("billiards_env:Billiards-v0", num_envs, **GAME)


def copy_of(policy: Any) -> Callable:
    """Returns a frozen copy of a policy for `Opponents`."""
    frozen = copy.deepcopy(policy)
    return lambda observations, rows: frozen.predict(observations, deterministic=True)[0]


def share_of_wins(policy: Callable, rival: str, count: int) -> float:
    """Returns the share of games with a winner that a policy wins against a player. Both break equally often."""
    envs = games(count)
    rival_policy = acting_in(find_player(rival, envs.unwrapped.single_env), envs.unwrapped, seed=0)
    observations, infos = envs.reset(seed=1)
    seats, over = np.arange(count) % 2, np.zeros(count, bool)
    winners, next_player = np.full(count, -1), infos["next_player"].copy()
    while not over.all():
        actions = np.zeros(envs.action_space.shape)
        own = next_player == seats
        for mask, play in ((own & ~over, policy), (~own & ~over, rival_policy)):
            if mask.any():
                actions[mask] = play(observations[mask], np.flatnonzero(mask))
        played = ~over
        observations, _, over, _, infos = envs.unwrapped.step_where(played, actions)
        winners[played], next_player[played] = infos["winner"][played], infos["next_player"][played]
    return (winners == seats).sum() / max((winners >= 0).sum(), 1)


class NewCopy(BaseCallback):
    """Replaces the opponent by a copy of the policy from time to time."""

    def __init__(self, envs: Opponents, every: int) -> None:
        super().__init__()
        self.envs, self.every, self.rollouts = envs, every, 0

    def _on_rollout_start(self) -> None:
        self.rollouts += 1
        if self.rollouts % self.every == 0:
            self.envs.policy = copy_of(self.model.policy)

    def _on_step(self) -> bool:
        return True


def run(alone: int, against_itself: int, n_games: int = 200) -> dict[str, tuple[float, float]]:
    """Learns alone, then in games. Returns the shares of games won against `RIVALS`, before and after the games."""
    torch.set_num_threads(1)
    settings: dict[str, Any] = {**PPO_SETTINGS, "n_steps": 4, "gamma": 0.9, "seed": 0}
    arguments = {"hidden": 128, "speeds": [0.1, 0.3, 0.6, 1.0], "exploration": max(alone // 2, 1)}
    racks = gym.make_vec("billiards_env:Billiards-v0", 1024, **TABLE, layout="random", max_shots=30)
    model = PPO(AimPolicy, SameStepVecEnv(racks), **settings, policy_kwargs=arguments)
    model.learn(alone)
    before = [share_of_wins(copy_of(model.policy), rival, n_games) for rival in RIVALS]

    envs = Opponents(games(1024), copy_of(model.policy))
    learner = PPO(AimPolicy, SameStepVecEnv(envs), **settings, policy_kwargs=arguments)
    learner.policy.load_state_dict(model.policy.state_dict())
    learner.learn(against_itself, NewCopy(envs, every=10))
    after = [share_of_wins(copy_of(learner.policy), rival, n_games) for rival in RIVALS]
    return dict(zip(RIVALS, zip(before, after, strict=True), strict=True))


if __name__ == "__main__":
    for rival, (first, last) in run(200_000, 200_000).items():
        print(f"games won against {rival}: {first:.0%} before the games, {last:.0%} after them")
