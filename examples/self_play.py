"""Self-play in nine ball with MaskablePPO: `python examples/self_play.py` (extras `train` and `masks`).

An action is a plan: a ball, a pocket and a speed, made into a shot by geometry. The policy first learns alone to pot
the balls of a rack in their order. Then it plays games against frozen copies of itself, and learns from won and lost
games. `Opponents` plays the turns of the copy, so the learner sees an environment of one player. The command prints the
share of games that the policy wins against other players, before and after these games, and saves the model. Play
against it with

    billiards play --rules nine_ball --scene pool --players human,examples.self_play:player:self_play.zip
"""

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.callbacks import BaseCallback

from billiards_env.bench.match import play_games
from billiards_env.envs import Opponents
from billiards_env.games import Stroke
from billiards_env.players.env_player import acting_by_name, game_observation
from billiards_env.players.situation import Player, Situation, placed
from billiards_env.pots.plans import Plans
from billiards_env.sb3 import SameStepVecEnv
from billiards_env.shots.tables import Tables

OBSERVE = ("positions", "potted", "legal_balls", "free_to_balls", "free_to_pockets")
RACK = {"task": "nine_ball", "observe": OBSERVE, "max_speed": 8.0}
GAME = {**RACK, "n_players": 2, "can_place": False, "max_shots": 60}
RIVALS = ("random", "search:20", "planner:beginner")


def make(num_envs: int, **arguments: Any) -> Any:
    """Returns a vector environment without wrappers."""
    return gym.make_vec("billiards_env:Billiards-v0", num_envs, **arguments).unwrapped


def copy_of(policy: Any) -> Any:
    """Returns a frozen copy of a policy."""
    copied = type(policy)(**policy._get_constructor_parameters())
    copied.load_state_dict(policy.state_dict())
    return copied


def planning(model: Any, games: Any) -> Callable:
    """Returns the function that plays a frozen copy of a policy of plans in games, whose actions may be velocities."""
    policy, scene = copy_of(model.policy), games.single_env.scene
    plans, converts = Plans(scene), games.single_env.action == "velocity"

    def play(observations: np.ndarray, rows: np.ndarray) -> np.ndarray:
        on_table, legal = ~games.potted[rows], games.legal_balls[rows]
        tables = Tables(scene, games.positions[rows], on_table, legal, GAME["max_speed"])
        chosen, _ = policy.predict(observations, action_masks=plans.mask(tables), deterministic=True)
        return plans.strokes(chosen.astype(float), tables) if converts else chosen

    return play


def share_of_wins(model: Any, rival: str, count: int) -> float:
    """Returns the share of games with a winner that a policy wins against a player. Both break equally often."""
    games = make(count, **GAME)
    winners = play_games(games, [planning(model, games), acting_by_name(rival, games)], seed=1)
    return (winners == 0).sum() / max((winners >= 0).sum(), 1)


class NewCopy(BaseCallback):
    """Replaces the opponent by a copy of the policy from time to time."""

    def __init__(self, envs: Opponents, every: int) -> None:
        super().__init__()
        self.envs, self.every, self.rollouts = envs, every, 0

    def _on_rollout_start(self) -> None:
        self.rollouts += 1
        if self.rollouts % self.every == 0:
            self.envs.policy = planning(self.model, self.envs.unwrapped)

    def _on_step(self) -> bool:
        return True


def run(
    alone: int, against_itself: int, n_games: int = 200, rivals: Sequence[str] = RIVALS, save: str = "self_play.zip"
) -> dict[str, tuple[float, float]]:
    """Learns alone, then in games, and saves the model. Returns the shares of games won, before and after the games."""
    torch.set_num_threads(1)
    settings: dict[str, Any] = {"n_steps": 32, "batch_size": 1024, "n_epochs": 4, "gamma": 0.9, "ent_coef": 0.003}
    settings |= {"learning_rate": 1e-3, "policy_kwargs": {"net_arch": [256, 256]}, "device": "cpu", "seed": 0}
    racks = make(128, **RACK, action="plan", layout="random", max_shots=30)
    model = MaskablePPO("MlpPolicy", SameStepVecEnv(racks), **settings).learn(alone)
    before = [share_of_wins(model, rival, n_games) for rival in rivals]

    games = make(128, **GAME, action="plan")
    envs = Opponents(games, planning(model, games))
    learner = MaskablePPO("MlpPolicy", SameStepVecEnv(envs), **{**settings, "learning_rate": 3e-4})
    learner.policy.load_state_dict(model.policy.state_dict())
    learner.learn(against_itself, NewCopy(envs, every=5))
    learner.save(save)
    after = [share_of_wins(learner, rival, n_games) for rival in rivals]
    return dict(zip(rivals, zip(before, after, strict=True), strict=True))


def player(path: str) -> Player:
    """Returns the player of a saved model, see the command `billiards play` above."""
    model = MaskablePPO.load(path)

    def play(situation: Situation, rng: np.random.Generator) -> Stroke:
        situation = placed(situation, rng)
        (setup, game), table = situation.find_game(), situation.table
        plans = Plans(setup.scene)
        observation = game_observation(setup, game, table.max_speed, observe=OBSERVE)
        chosen, _ = model.predict(observation, action_masks=plans.mask(table)[0], deterministic=True)
        return situation.stroke(plans.strokes(np.array([chosen], float), table)[0])

    return play


if __name__ == "__main__":
    for rival, (first, last) in run(60_000, 60_000, n_games=100).items():
        print(f"games won against {rival}: {first:.0%} before the games, {last:.0%} after them")
