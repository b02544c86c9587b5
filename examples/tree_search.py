"""Tree search in Billiards: UCT over the plans of a position, in copies of the present position.

    python -m examples.tree_search --episodes 5 --simulations 400

`get_state` and `set_state` copy and restore a position in microseconds. With `action="plan"` an action is the choice of
a pot and of a speed. Each simulation goes down the tree to a new position (selection by UCB1, Kocsis and Szepesvari
2006), plays one shot there (expansion), and adds the points to the plans on its path. Execution noise makes a shot
random, so each visit of a plan plays it again with new noise.
"""

from __future__ import annotations

import argparse
from typing import Any

import gymnasium as gym
import numpy as np

import billiards_env  # noqa: F401  # registers the ids


class Node:
    """A position: its plans, how often each was played, and the sum of the points from it on."""

    def __init__(self, mask: np.ndarray) -> None:
        self.plans = np.flatnonzero(mask)
        self.visits, self.totals = np.zeros((2, len(self.plans)))
        self.children: dict[int, Node] = {}

    def simulate(self, env: Any, depth: int) -> float:
        """Plays at most `depth` shots and returns their points. A plan that was never played comes first."""
        visits = np.maximum(self.visits, 1e-9)
        bounds = self.totals / visits + 2.0 * np.sqrt(np.log(self.visits.sum() + 1.0) / visits)
        k = int(bounds.argmax() if self.visits.all() else self.visits.argmin())
        _, points, over, _, info = env.step(self.plans[k])
        if not over and depth > 1:
            if k in self.children:
                points += self.children[k].simulate(env, depth - 1)
            else:
                self.children[k] = Node(info["action_mask"])
        self.visits[k] += 1
        self.totals[k] += points
        return points


def search(env: Any, mask: np.ndarray, simulations: int, rng: np.random.Generator) -> int:
    """Returns the plan that was tried most often. The environment does not change."""
    state, root = env.get_state(), Node(mask)
    for _ in range(simulations):
        branch = state.copy()
        branch["noise_stream"] = rng.integers(0, 2**64, 4, np.uint64) | np.uint64(1)  # the future is not known
        env.set_state(branch)
        root.simulate(env, depth=3)
    env.set_state(state)
    return root.plans[root.visits.argmax()]


def main(arguments: list[str] | None = None) -> float:
    """Plays episodes and prints their scores; returns the mean."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--simulations", type=int, default=400)
    options = parser.parse_args(arguments)
    env: Any = gym.make("Billiards/NineBallNoise-v0", action="plan").unwrapped
    rng, scores = np.random.default_rng(0), []
    for seed in range(options.episodes):
        _, info = env.reset(seed=seed)
        over = False
        while not over:
            plan = search(env, info["action_mask"], options.simulations, rng)
            _, _, over, _, info = env.step(plan)
        scores.append(int(info["score"]))
        print(f"episode {seed}: {scores[-1]} points", flush=True)
    return float(np.mean(scores))


if __name__ == "__main__":
    print(f"mean {main():.2f} points")
