"""Learns from every shot that scores: `learner: likelihood` in a row of `configs/learning.yaml`.

An update plays many shots from each of some layouts: random hits of the object balls, and random actions of the policy.
The policy then maximises the likelihood of the shots that score (Peters and Schaal 2007, Reinforcement learning by
reward-weighted regression, with the rewards 0 and 1). The mixture of the policy can represent several ways to score,
and its standard deviations are learned.

In a task with a goal a shot is also a label for another goal (hindsight, Andrychowicz et al. 2017). If it meets the
other condition of the task, it scores for every goal near the place where the cue ball stops, and its goal is drawn
there. So almost every such shot is useful.

The weight of a shot is 1 over the number of shots of its layout that reach the same goal. So easy and difficult layouts
and goals have a similar total weight.
"""

from __future__ import annotations

import io
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.config import Config
from agents.ppo import make_policy, make_vector, training_seed
from billiards_env.envs import BilliardsVectorEnv
from billiards_env.envs.goal_observations import ACHIEVED, CONDITION
from billiards_env.players.strategies import hits
from billiards_env.sb3.aim_network import Mixture
from billiards_env.sb3.aim_policy import AimPolicy
from billiards_env.sb3.weights import whole_archive
from billiards_env.support.files import write_atomically

Floats = NDArray[np.float64]

_KEPT = 32  # number of earlier updates whose labels are fitted again
_LEAST_LOG = -20.0  # log-likelihoods below have no gradient
_NORM = 5.0  # largest norm of a gradient


class Labels(NamedTuple):
    """k shots that score.

    Attributes:
        rows: (k,) int64, the layout of each.
        actions: (k, a) float32.
        goals: (k, 1, 2) float32, the feature "goal"; None in a task without a goal.
        weights: (k,) float32.
    """

    rows: Tensor
    actions: Tensor
    goals: Tensor | None
    weights: Tensor


class Learner:
    """A policy in training. What follows a call of `restart` depends only on the settings and on what `save` writes.

    Attributes:
        policy: The policy.
        shots: The number of shots so far.
    """

    def __init__(self, config: Config) -> None:
        torch.manual_seed(config.seed)
        policy: Any = make_policy(config)
        self.policy: AimPolicy = policy
        self.policy.set_training_mode(False)
        self.policy.set_shots(-1)
        if not set(self.policy.observe) <= {"positions", "goal"}:
            raise ValueError(
                f"env.observe = {self.policy.observe}: expected only 'positions' and 'goal' with learner = 'likelihood'"
            )
        self.shots, self._config, self._settings = 0, config, config.likelihood
        has_goal = config.env["goal_radius"] is not None
        observe = "goal" if has_goal else ["positions"]
        self._envs: Any = make_vector(config, self._settings["layouts"], observe=observe).unwrapped
        self._log_std = nn.Parameter(self.policy.net.std.log())
        parameters = [*self.policy.net.parameters(), self._log_std]
        self._optimizer = torch.optim.Adam(parameters, eps=1e-5, fused=True)
        self._rng = np.random.default_rng(config.seed)
        self._kept: deque[tuple[Tensor, Labels]] = deque(maxlen=_KEPT)

    def restart(self) -> None:
        """Seeds all random generators."""
        seed = training_seed(self._config, self.shots)
        torch.manual_seed(seed)
        self._log_std.data.copy_(self.policy.net.std.log())
        self._rng = np.random.default_rng(seed)
        self._kept.clear()
        self._envs.reset(seed=seed)

    def compile(self) -> None:
        """Plays a shot from each layout, so that compiling the engine is no part of the time of the training."""
        self._envs.reset(seed=0)
        self._envs.try_actions(random_hits(self._envs, self.policy, 1, self._rng)[:, 0], noise=self._rng)

    def update(self) -> float:
        """Plays shots, learns from them, and returns the share of the policy's own shots that score."""
        envs, settings, part = self._envs, self._settings, min(self.shots / self._config.timesteps, 1.0)
        first, last = settings["learning_rate"]
        for group in self._optimizer.param_groups:
            group["lr"] = last + (first - last) * (1.0 - part)
        envs.reset()
        states = envs.get_state()
        half = np.array(envs.single_env.scene.half_extents)
        places, goals = (torch.from_numpy(states[name] / half).float() for name in ("positions", "goals"))
        mixtures = self._mixtures(places)
        with torch.no_grad():
            count, own = len(states), settings["own"]
            mixture = mixtures(torch.arange(count), goals if goals.shape[1] else None)
            sampled = mixture.samples(own).clamp(-1, 1).numpy()
        shots = np.concatenate((random_hits(envs, self.policy, settings["hits"], self._rng), sampled), axis=1)
        outcomes = envs.try_actions(shots.reshape(-1, shots.shape[2]), states.repeat(shots.shape[1]), self._rng)
        self.shots += shots.shape[0] * shots.shape[1]
        labels = labels_of(envs, shots, outcomes, settings["labels"], self._rng)
        if len(labels.rows):
            self._fit(mixtures, labels)
            self._kept.append((places, labels))
            for _ in range(settings["passes"] - 1):
                places, labels = self._kept[self._rng.integers(len(self._kept))]
                self._fit(self._mixtures(places), labels)
        return float(outcomes.infos["is_success"].reshape(count, -1)[:, -own:].mean())

    def _fit(self, mixtures: Callable[[Tensor, Tensor | None], Mixture], labels: Labels) -> None:
        """Takes one step of the optimizer towards a larger likelihood of labels."""
        mixture = mixtures(labels.rows, labels.goals)
        logs = _with_gradient(mixture, self._log_std.exp()).log_prob(labels.actions).clamp(min=_LEAST_LOG)
        self._optimizer.zero_grad()
        (-(labels.weights * logs).sum() / labels.weights.sum()).backward()
        nn.utils.clip_grad_norm_(self._optimizer.param_groups[0]["params"], _NORM)
        self._optimizer.step()
        self.policy.net.std.copy_(self._log_std.detach().exp())

    def _mixtures(self, places: Tensor) -> Callable[[Tensor, Tensor | None], Mixture]:
        """Returns a function that returns the mixtures of layouts, by their numbers, and goals.

        With `goal_units` the goals of a layout share its first layers.
        """
        net = self.policy.net
        if net.goal and not net.goal_units:
            return lambda rows, goals: net(places[rows], goal=goals)[0]
        layouts, _ = net.layouts(places)
        return lambda rows, goals: net.mixtures(layouts, goals, rows)

    def save(self, path: Path) -> None:
        """Writes a checkpoint."""
        buffer, state = io.BytesIO(), {"policy": self.policy.state_dict(), "optimizer": self._optimizer.state_dict()}
        torch.save(state, buffer)
        path.parent.mkdir(exist_ok=True)
        write_atomically(path, buffer.getvalue())

    def load(self, path: Path) -> None:
        """Reads a checkpoint, whose name is the number of shots. Raises a ValueError if it is damaged."""
        with whole_archive(path, "a checkpoint of these settings") as file:
            state = torch.load(file, map_location="cpu", weights_only=True)
            self.policy.load_state_dict(state["policy"])
            self._optimizer.load_state_dict(state["optimizer"])
        self.shots = int(path.stem)


def random_hits(envs: BilliardsVectorEnv, policy: AimPolicy, count: int, rng: np.random.Generator) -> Floats:
    """Returns (m, count, a) random hits of the object balls, at the speeds of the policy.

    In scenes with flight half of the hits have a raised cue.
    """
    net, scene = policy.net, envs.single_env.scene
    slowest, fastest = float(net.slowest.min()), float((net.slowest + net.faster).max())
    size = len(envs.single_env.action_space.low)
    return hits(envs.positions, scene.balls.radius, count, (slowest, fastest), size, rng, scene.physics.flight)


def labels_of(envs: BilliardsVectorEnv, shots: Floats, outcomes: Any, most: int, rng: np.random.Generator) -> Labels:
    """Returns the shots (m, k, a) that score, see the module; random ones if there are more than `most`."""
    model, (m, k) = envs.single_env.model, shots.shape[:2]
    achieved, met = np.zeros((m, k, 3)), outcomes.infos["is_success"].reshape(m, k)
    if model.goal_radius:
        achieved = outcomes.observations[ACHIEVED].reshape(m, k, 3)
        met = achieved[..., CONDITION] > 0
    rows, which = np.nonzero(met)
    if len(rows) > most:
        kept = rng.choice(len(rows), most, replace=False)
        rows, which = rows[kept], which[kept]
    if not model.goal_radius:
        reached, goals = met.sum(1)[rows], None
    else:
        ends, radius, half = achieved[..., :2], model.goal_radius, np.array(model.scene.half_extents)
        far, angles = radius * np.sqrt(rng.random(len(rows))), rng.uniform(0.0, 2.0 * np.pi, len(rows))
        drawn = ends[rows, which] + far[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
        inside = (np.abs(drawn) <= half - model.scene.balls.radius[0]).all(axis=1)
        rows, which, drawn = rows[inside], which[inside], drawn[inside]
        near = ((ends[rows] - drawn[:, None]) ** 2).sum(2) <= radius**2
        reached = np.maximum((near & met[rows]).sum(1), 1)
        goals = torch.from_numpy(drawn / half).float()[:, None]
    actions = torch.from_numpy(shots[rows, which]).float()
    return Labels(torch.from_numpy(rows), actions, goals, torch.from_numpy(1.0 / reached).float())


def _with_gradient(mixture: Mixture, std: Tensor) -> Mixture:
    """Returns a mixture with the gradient of its standard deviations, those of `AimNetwork.std`."""
    along, across, tip = std / std.detach()
    return mixture._replace(along=along * mixture.along, across=across * mixture.across, tip_std=tip * mixture.tip_std)
