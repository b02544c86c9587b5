"""Self-play in straight pool with PyTorch: `python examples/self_play.py` (extras `multi` and `train`).

A policy plays against a frozen copy of itself in the PettingZoo environment and learns by policy gradients (REINFORCE).
After every few updates a copy of the present policy replaces the frozen one. The return of a shot is its points minus
the points of the other player before the next shot of the policy. A foul costs a point.
"""

import copy
from typing import Any

import torch
from torch import nn

from billiards_env.games import billiards_v0

N_BALLS = 3

GAMES, UPDATES_OF_A_COPY = 32, 10
"""Games in each update, and the number of updates before the frozen copy is replaced."""


class Policy(nn.Module):
    """A Gaussian over the two numbers that `shot` takes, and a value function as the baseline."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.body = nn.Sequential(nn.Linear(size, 128), nn.Tanh(), nn.Linear(128, 128), nn.Tanh())
        self.mean, self.value = nn.Linear(128, 2), nn.Linear(128, 1)
        self.log_std = nn.Parameter(torch.full((2,), -0.5))

    def forward(self, observations: torch.Tensor) -> tuple[torch.distributions.Normal, torch.Tensor]:
        """Returns the distributions of the numbers (m, 2) and the values (m,) for observations (m, size)."""
        hidden = self.body(observations)
        return torch.distributions.Normal(self.mean(hidden), self.log_std.exp()), self.value(hidden)[:, 0]


def shot(seen: torch.Tensor, numbers: torch.Tensor) -> torch.Tensor:
    """Returns the action (4,) for two numbers: the angle to the direction of the nearest legal ball, and the speed."""
    balls = seen[: 4 * N_BALLS].reshape(N_BALLS, 4)
    to = (balls[1:, :2] - balls[0, :2]) * torch.tensor([2.0, 1.0])  # the table is twice as long as wide
    far = torch.where(balls[1:, 3] > 0, to.norm(dim=1), torch.inf)
    x, y = to[far.argmin()]
    angle = torch.atan2(y, x) + 0.1 * numbers[0]
    speed = torch.sigmoid(numbers[1])
    place = torch.zeros(2)  # a cue ball in hand goes to the middle
    return torch.cat((speed * torch.stack((angle.cos(), angle.sin())), place))


def play(env: Any, learner: Policy, opponent: Policy, first: bool) -> tuple[list, list, list]:
    """Plays a game. Returns the learner's observations and actions, and the rewards up to its next shot."""
    env.reset()
    me = env.possible_agents[0 if first else 1]
    observations, actions, rewards = [], [], []
    for agent in env.agent_iter():
        seen, reward, terminated, truncated, _ = env.last()
        if agent == me and actions:
            rewards.append(float(reward))  # for its last shot and the opponent's shots after it
        if terminated or truncated:
            env.step(None)
            continue
        seen = torch.as_tensor(seen)
        with torch.no_grad():
            action = (learner if agent == me else opponent)(seen[None])[0].sample()[0]
        if agent == me:
            observations.append(seen)
            actions.append(action)
        env.step(shot(seen, action).numpy())
    return observations, actions, rewards


def lead(env: Any, policy: Policy, opponent: Policy, games: int) -> float:
    """Returns the mean lead in points of a policy over another one at the end of a game."""
    return sum(sum(play(env, policy, opponent, k % 2 == 0)[2]) for k in range(games)) / games


def run(shots: int) -> tuple[Policy, float]:
    """Trains for a number of shots of both players. Returns the policy and its lead over its first copy."""
    env: Any = billiards_v0.env(
        rules="straight", n_object_balls=N_BALLS - 1, layout="random", max_shots=10, max_speed=4.0
    )
    env.reset(seed=0)
    torch.manual_seed(0)
    policy = Policy(env.observation_space("player_0").shape[0])
    opponent, first_copy = copy.deepcopy(policy), copy.deepcopy(policy)
    optimiser, played, update = torch.optim.Adam(policy.parameters(), lr=3e-3), 0, 0
    while played < shots:
        batch: list[tuple] = []
        for game in range(GAMES):
            observations, actions, rewards = play(env, policy, opponent, game % 2 == 0)
            played += len(env.unwrapped.history().strokes)
            batch += zip(observations, actions, torch.tensor(rewards), strict=True)
        observations, actions, returns = (torch.stack(part) for part in zip(*batch, strict=True))
        density, values = policy(observations)
        advantages = returns - values.detach()
        advantages = advantages / (advantages.std() + 1e-6)
        loss = -(density.log_prob(actions).sum(1) * advantages).mean() + 0.5 * (returns - values).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        update += 1
        if update % UPDATES_OF_A_COPY == 0:
            opponent = copy.deepcopy(policy)
    return policy, lead(env, policy, first_copy, 100)


if __name__ == "__main__":
    print(f"lead over the untrained policy: {run(20_000)[1]:.2f} points a game")
