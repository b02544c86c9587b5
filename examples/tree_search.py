"""Tree search in Billiards: UCT with random shots as actions, in copies of the present position.

    python -m examples.tree_search --episodes 5 --simulations 400

`get_state` and `set_state` copy and restore a position in microseconds. Each simulation goes down the tree to a new
position (selection by UCB1, Kocsis and Szepesvari 2006), plays one shot there (expansion), and adds the points to the
shots on its path. Execution noise makes a shot random, so each visit of a shot plays it again with new noise.
"""

from __future__ import annotations

import argparse
from typing import Any

import gymnasium as gym
import numpy as np

from billiards_env.envs.reset import noise_stream

WIDTH, DEPTH = 24, 3  # shots that a node tries, and the most shots of a simulation


class Node:
    """A position: shots, how often each was played, and the sum of the points from it on."""

    def __init__(self, env: Any, rng: np.random.Generator) -> None:
        self.shots, (self.visits, self.totals) = _shots(env, rng), np.zeros((2, WIDTH))
        self.children: dict[int, Node] = {}

    def simulate(self, env: Any, rng: np.random.Generator, depth: int = DEPTH) -> float:
        """Plays at most `depth` shots and returns their points. A shot that was never played comes first."""
        k = int(self.visits.argmin())
        if self.visits[k]:
            k = int((self.totals / self.visits + 2.0 * np.sqrt(np.log(self.visits.sum()) / self.visits)).argmax())
        _, points, over, _, _ = env.step(self.shots[k])
        if not over and depth > 1:
            if k in self.children:
                points += self.children[k].simulate(env, rng, depth - 1)
            else:
                self.children[k] = Node(env, rng)
        self.visits[k] += 1
        self.totals[k] += points
        return points


def search(env: Any, simulations: int, rng: np.random.Generator) -> Any:
    """Returns the shot that was tried most often. The environment does not change."""
    state, root = env.get_state(), Node(env, rng)
    for _ in range(simulations):
        branch = state.copy()
        branch["noise_stream"] = noise_stream(int(rng.integers(2**63)), None)  # the future is not known
        env.set_state(branch)
        root.simulate(env, rng)
    env.set_state(state)
    return root.shots[root.visits.argmax()]


def _shots(env: Any, rng: np.random.Generator) -> Any:
    """Returns shots that send legal balls towards pockets, at random speeds and with random errors."""
    balls, radius = rng.choice(np.flatnonzero(env.legal_balls & ~env.potted), WIDTH), env.scene.balls.radius[0]
    targets, pockets = env.positions[balls], env.scene.table.pocket_places
    line = targets - rng.choice(pockets, WIDTH)
    ghosts = targets + 2 * radius * line / np.linalg.norm(line, axis=1, keepdims=True)  # the cue ball at the impact
    way = ghosts + rng.normal(0.0, 0.1 * radius, (WIDTH, 2)) - env.positions[0]
    return way / np.linalg.norm(way, axis=1, keepdims=True) * rng.uniform(0.1, 1.0, (WIDTH, 1))


def main(arguments: list[str] | None = None) -> float:
    """Plays episodes and prints their scores; returns the mean."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--simulations", type=int, default=400)
    options = parser.parse_args(arguments)
    env: Any = gym.make("Billiards/NineBallNoise-v0").unwrapped
    rng, scores = np.random.default_rng(0), []
    for seed in range(options.episodes):
        _, info = env.reset(seed=seed)
        over = False
        while not over:
            _, _, over, _, info = env.step(search(env, options.simulations, rng))
        scores.append(int(info["score"]))
        print(f"episode {seed}: {scores[-1]} points", flush=True)
    return float(np.mean(scores))


if __name__ == "__main__":
    print(f"mean {main():.2f} points")
