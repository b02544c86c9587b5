"""Tree search in Billiards: UCT with random shots as actions, in copies of the present position.

    python -m examples.tree_search --episodes 5 --simulations 400

`get_state` and `set_state` copy and restore a position in microseconds. Each simulation goes down the tree to a new
position (selection by UCB1, Kocsis and Szepesvari 2006), plays one shot there (expansion), and adds the points to the
nodes on its path. Execution noise makes a shot random, so each visit of an action plays it again with new noise.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from typing import Any

import gymnasium as gym
import numpy as np

import billiards_env  # noqa: F401  # registers the ids

WIDTH = 24  # shots that a node tries


@dataclasses.dataclass
class Node:
    """A shot from a position: how often it was played, and the sum of the points from it on."""

    shot: Any
    visits: int = 0
    total: float = 0.0
    children: list[Node] = dataclasses.field(default_factory=list)

    def best(self) -> Node:
        """Returns the next shot to try: a new one first, then the one with the largest upper bound."""
        return max(self.children, key=lambda child: _bound(child, self.visits))


def _bound(node: Node, visits: int) -> float:
    return node.total / node.visits + 2.0 * math.sqrt(math.log(visits) / node.visits) if node.visits else math.inf


def search(env: Any, simulations: int, rng: np.random.Generator, depth: int = 3) -> Any:
    """Returns the shot that was tried most often. The environment does not change."""
    state, root = env.get_state(), Node(None)
    for _ in range(simulations):
        branch, node, path, rewards = state.copy(), root, [root], []
        branch["noise_stream"] = rng.integers(0, 2**64, 4, np.uint64) | np.uint64(1)  # the future is not known
        env.set_state(branch)
        over, new = False, False
        while not over and not new and len(rewards) < depth:
            if not node.children:
                node.children = [Node(shot) for shot in _shots(env, rng)]
            node = node.best()
            new = node.visits == 0
            _, reward, over, _, _ = env.step(node.shot)
            path.append(node)
            rewards.append(reward)
        for k, visited in enumerate(path):
            visited.visits += 1
            visited.total += sum(rewards[max(k - 1, 0) :])
    env.set_state(state)
    return max(root.children, key=lambda child: child.visits).shot


def _shots(env: Any, rng: np.random.Generator) -> Any:
    """Returns shots that send legal balls towards pockets, at random speeds and with random errors."""
    balls, radius = rng.choice(np.flatnonzero(env.legal_balls & ~env.potted), WIDTH), env.scene.balls.radius[0]
    targets, pockets = env.positions[balls], np.array([(p.x, p.y) for p in env.scene.table.pockets])
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
