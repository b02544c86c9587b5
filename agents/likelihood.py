"""Learns from many shots of each layout: `learner: likelihood` in a row of `configs/learning.yaml`.

A training has two phases. In the first phase, *imitation*, an update plays random hits of the object balls and random
actions of the policy. It does so from each of several layouts. The policy then maximises the likelihood of the shots
that score (Peters and Schaal 2007, Reinforcement learning by reward-weighted regression, with the rewards 0 and 1). The
mixture of the policy can represent several ways to score, and its standard deviations are learned.

In a task with a goal a shot is also a label for another goal (hindsight, Andrychowicz et al. 2017). If it meets the
other condition of the task, it scores for every goal near the place where the cue ball stops, and its goal is drawn
there. So almost every such shot is useful. With `goals` the likeliest shots for random goals are labels too, after a
correction towards the goal. Finite differences of the place where the cue ball stops give the correction (as the
derivatives of a simulator in Mora et al. 2021, Policy optimization via differentiable simulation). So the policy learns
to correct the shots that it would play.

The weight of a shot is 1 over the number of shots of its layout that reach the same goal. So easy and difficult layouts
and goals have a similar total weight.

In the second phase, *improvement*, only the policy plays. The optimizer raises the mean, over the layouts, of the
logarithm of the expected return (policy gradient, Williams 1992, Simple statistical gradient-following algorithms). The
baseline of a shot is the mean return of all shots from the same layout, and the difference is divided by it (Tajwar et
al. 2026, Maximum likelihood reinforcement learning, arXiv:2602.02710). So the safest way to score becomes the most
likely. A return below 0 counts as 0.

In an episode of several shots the return of a shot is its reward plus the value of the position after it. The critic of
the policy learns this value from the mean returns. The next update plays on from one of the shots that score, drawn at
random. If no shot scores, or those that score end the episode, a new episode begins.

In a game of two players the policy plays both. The value of a position is that of the player to shoot, from -1 for a
lost game to 1 for a won game. If the other player has the next shot, the value counts negative in the return (zero sum,
as in negamax). Returns are compared with -1 in place of 0. A shot scores if the player has the next shot or wins, and
the next update plays on from any shot of the policy. A cue ball in hand is placed at the one of some random places with
the largest value.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learner import Learner, Setting, Training, rates, up_to, whole
from agents.ppo import make_policy, make_vector, training_seed
from billiards_env.envs import BilliardsVectorEnv
from billiards_env.envs.goal_observations import ACHIEVED, CONDITION
from billiards_env.envs.trials import Outcomes
from billiards_env.games import GameState
from billiards_env.games.game_state import NOT_IN_HAND
from billiards_env.physics.state import CUE_BALL
from billiards_env.players.situation import PLACES, draw_places
from billiards_env.players.strategies import hits, padded
from billiards_env.pots.finder import DX, DY, SPEED, SPEEDS, find_pots
from billiards_env.sb3.aim_network import Mixture
from billiards_env.sb3.aim_policy import AimPolicy, keeps_turn
from billiards_env.sb3.weights import whole_archive
from billiards_env.shots.tables import Tables
from billiards_env.support.files import replacing

if TYPE_CHECKING:
    from agents.config import Config  # which imports the learners

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Seen = dict[str, Tensor]  # the features that the policy observes, by name

_KEPT = 32  # number of earlier updates whose labels are fitted again
_LEAST_LOG = -20.0  # log-likelihoods below have no gradient
_WORTH = 0.1  # least mean return by which the gradient of a layout is divided
_SLOWER = 0.5  # factor of the learning rate in the second phase, without improvement_rate
_CRITIC = 0.1  # weight of the error of the critic
_NORM = 5.0  # largest norm of a gradient
_BEGIN = 0.3  # share of the shots after which corrections begin; with earlier corrections a policy became worse
_CHANGE = 0.1  # of an action, for finite differences, in standard deviations of the policy
_FARTHEST = 2.5  # largest correction, in standard deviations
_DAMPING = 0.01  # of a correction, over the squared radius of the goal


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


class LikelihoodTraining(Training):
    """A training by likelihood, see the module."""

    def __init__(self, config: Config) -> None:
        torch.manual_seed(config.seed)
        policy: Any = make_policy(config)
        self.policy: AimPolicy = policy  # pyright: ignore[reportIncompatibleVariableOverride]
        self.policy.set_training_mode(False)
        self.policy.end_schedules()
        self._config, self._settings = config, config.settings
        self._has_goal, self._goes_on = config.env["goal_radius"] is not None, config.env["max_shots"] > 1
        self._is_game = config.env["n_players"] > 1
        self._least = -1.0 if self._is_game else 0.0  # the least return
        if self._has_goal and not set(self.policy.observe) <= {"positions", "goal"}:
            raise ValueError(
                f"env.observe = {self.policy.observe}: expected only 'positions' and 'goal' in a task with a goal"
            )
        observe = "goal" if self._has_goal else config.env["observe"]
        self._envs: Any = make_vector(config, self._settings["layouts"], observe=observe).unwrapped
        self._over, self._observations = np.ones(self._settings["layouts"], np.bool_), None
        self._in_hand: tuple[Tensor, Seen] | None = None
        self._log_std = nn.Parameter(self.policy.net.std.log())
        parameters = [*self.policy.net.parameters(), self._log_std]
        # Each phase has its own moments, because the gradients differ in size.
        adam = {"betas": (0.9, self._settings["beta2"]), "eps": self._settings["eps"]}
        self._optimizers = [torch.optim.Adam(parameters, **adam, fused=True) for _ in range(2)]
        self._rng = np.random.default_rng(config.seed)
        self._kept: deque[tuple[Seen, Labels]] = deque(maxlen=_KEPT)
        # A shot from each layout compiles the engine, so that this is no part of the time of the training.
        self._envs.reset(seed=0)
        self._envs.try_actions(random_hits(self._envs, self.policy, 1, self._rng)[:, 0], noise=self._rng)

    def restart(self) -> None:
        """Seeds all random generators and begins new episodes."""
        seed = training_seed(self._config, self.shots)
        torch.manual_seed(seed)
        self._log_std.data.copy_(self.policy.net.std.log())
        self._rng = np.random.default_rng(seed)
        self._kept.clear()
        self._envs.reset(seed=seed)
        self._over[:] = True

    def update(self) -> float:
        """Plays shots, learns from them, and returns the share of the policy's own shots that score."""
        settings, part = self._settings, min(self.shots / self._config.timesteps, 1.0)
        improves = part >= settings["imitation"]
        for group in self._optimizers[improves].param_groups:
            group["lr"] = learning_rate(settings, part)
        if self._over.any():
            self._observations, _ = self._envs.reset(options={"reset_mask": self._over})
        seen, self._in_hand = self._seen(self._observations), None
        if self._is_game:
            self._place(seen)
        outcomes = (self._improve if improves else self._imitate)(seen)
        scored = scores(self._envs, outcomes).reshape(settings["layouts"], -1)
        own = settings["samples" if improves else "own"]
        if self._goes_on:
            self._go_on(outcomes, np.arange(scored.shape[1]) >= scored.shape[1] - own if self._is_game else scored)
        return float(scored[:, -own:].mean())

    def _place(self, seen: Seen) -> None:
        """Places each cue ball in hand at the one of several random places with the largest value.

        `seen` changes. `_in_hand` has its rows from before.
        """
        states, setup, policy = self._envs.get_state(), self._envs.single_env.model.setup, self.policy
        rows = np.flatnonzero(states["game"]["in_hand"])
        if not len(rows):
            return
        states, before = states[rows], {name: feature[rows] for name, feature in seen.items()}
        games = [GameState(*game) for game in zip(states["positions"], states["game"], strict=True)]
        places = np.array([draw_places(setup, game, self._rng, PLACES) for game in games])
        chosen = places[np.arange(len(rows)), policy.best_places(places, **before)]
        states["positions"][:, CUE_BALL], states["game"]["in_hand"] = chosen, NOT_IN_HAND
        self._envs.set_state(states, rows)
        seen["positions"][rows, 0] = torch.from_numpy(chosen / policy.game.scene.half_extents).float()
        if "in_hand" in seen:
            seen["in_hand"][rows] = 0.0
        self._in_hand = torch.from_numpy(rows), before

    def _imitate(self, seen: Seen) -> Outcomes:
        """Makes the shots that score more likely: random hits, shots of the policy and shots of earlier updates."""
        envs, settings, rng, mixtures = self._envs, self._settings, self._rng, self._mixtures(seen)
        count, own = settings["layouts"], settings["own"]
        corrects = settings["goals"] and self.shots >= _BEGIN * self._config.timesteps
        if corrects and len((labels := self._corrected(mixtures)).rows):
            self._fit(mixtures, labels)
            self._kept.append((seen, labels))
            mixtures = self._mixtures(seen)
        with torch.no_grad():
            sampled = mixtures(torch.arange(count), seen.get("goal")).samples(own).clamp(-1, 1).numpy()
        legal = seen["legal_balls"].numpy() > 0 if "legal_balls" in seen else None
        random = random_hits(envs, self.policy, settings["hits"], rng, legal)
        if settings["pots"]:
            easy = padded(easy_pots(envs, min(settings["pots"], settings["hits"]), rng), random.shape[2])
            random[:, : easy.shape[1]] = np.where(easy.any(2, keepdims=True), easy, random[:, : easy.shape[1]])
        shots = np.concatenate((random, sampled), axis=1)
        outcomes = self._play(shots)
        labels = labels_of(envs, shots, outcomes, settings["labels"], rng)
        if len(labels.rows):
            self._fit(mixtures, labels)
            self._kept.append((seen, labels))
            for _ in range(settings["passes"] - 1):
                earlier, labels = self._kept[rng.integers(len(self._kept))]
                self._fit(self._mixtures(earlier), labels)
        if self._goes_on:
            self._step(-self._error(self.policy.net.values(**seen), self._returns(outcomes, own)), 0)
        return outcomes

    @torch.no_grad()
    def _corrected(self, mixtures: Callable[[Tensor, Tensor | None], Mixture]) -> Labels:
        """Corrects the likeliest shots for random goals, see `corrections`, and returns those that then score."""
        scene, radius = self._envs.single_env.scene, self._envs.single_env.model.goal_radius
        rows = torch.arange(self._settings["layouts"]).repeat_interleave(self._settings["goals"])
        half = np.array(scene.half_extents)
        places = self._rng.uniform(-1.0, 1.0, (len(rows), 1, 2)) * (half - scene.balls.radius[0])
        goals = torch.from_numpy(places / half).float()
        mixture = mixtures(rows, goals)
        size = 2 + mixture.tip.shape[1]
        changes = torch.cat((torch.zeros(1, size), _CHANGE * torch.eye(size)))
        _, ends, met = self._play_near(mixture, changes[:, :, None])
        slopes = (ends[:, 1:] - ends[:, :1]) / _CHANGE  # (k, a, 2)
        steps = corrections(slopes, places - ends[:, :1], radius)
        actions, ends, met_again = self._play_near(mixture, torch.from_numpy(steps.T).float()[None])
        near = met.all(1) & met_again[:, 0] & (np.abs(steps) <= _FARTHEST).all(1)
        good = torch.from_numpy(near & (np.hypot(*(ends - places)[:, 0].T) <= radius))
        return Labels(rows[good], actions[good, 0], goals[good], torch.ones(int(good.sum())))

    def _play_near(self, mixture: Mixture, errors: Tensor) -> tuple[Tensor, Floats, Bools]:
        """Plays the likeliest shots with errors, without noise.

        Args:
            mixture: k mixtures, the same number for each layout.
            errors: (e, a, k) or (e, a, 1), in standard deviations.

        Returns:
            The actions (k, e, a), the places (k, e, 2) where the cue ball stops, m, and whether the shots meet the
            condition of the task (k, e).
        """
        actions = torch.stack([mixture.mode(error) for error in errors], 1).clamp(-1, 1)
        outcomes = self._play(actions.reshape(self._settings["layouts"], -1, actions.shape[2]).numpy(), noisy=False)
        achieved = outcomes.observations[ACHIEVED].reshape(*actions.shape[:2], 3)
        return actions, achieved[..., :CONDITION], achieved[..., CONDITION] > 0

    def _improve(self, seen: Seen) -> Outcomes:
        """Takes a step along the gradient of the mean logarithm of the expected return."""
        mixture, values = self.policy.net(**seen)
        mixture = _with_gradient(mixture, self._log_std.exp())
        count = self._settings["samples"]
        with torch.no_grad():
            shots = mixture.samples(count).clamp(-1, 1)  # the density is that of the clipped action
        outcomes = self._play(shots.numpy())
        returns = self._returns(outcomes, count)
        mean = returns.mean(1, keepdim=True)
        advantages = (returns - mean) / (mean - self._least).clamp(min=_WORTH)
        logs = mixture.log_prob(shots).clamp(min=_LEAST_LOG)
        objective = (advantages * logs).mean()
        self._step(objective - self._error(values, returns) if self._goes_on else objective, 1)
        return outcomes

    def _seen(self, observations: Any) -> Seen:
        """Returns what the policy observes."""
        if self._has_goal:
            states, half = self._envs.get_state(), np.array(self._envs.single_env.scene.half_extents)
            features = {"positions": states["positions"] / half, "goal": states["goals"] / half}
        else:
            features = self._envs.decode(observations)
        return {name: torch.from_numpy(features[name]).float() for name in self.policy.observe}

    def _play(self, shots: Floats, noisy: bool = True) -> Outcomes:
        """Returns the outcomes of shots (m, k, a) from the states of the environments."""
        m, k, size = shots.shape
        self.shots += m * k
        return self._envs.try_actions(shots.reshape(-1, size), noise=self._rng if noisy else None)

    def _returns(self, outcomes: Outcomes, count: int) -> Tensor:
        """Computes the returns (m, count) of the last `count` shots from each layout."""
        returns = self.policy.returns(outcomes) if self._goes_on else outcomes.rewards
        returns = returns.reshape(self._settings["layouts"], -1)[:, -count:]
        return torch.from_numpy(returns).float().clamp(min=self._least)

    def _error(self, values: Tensor, returns: Tensor) -> Tensor:
        """Returns the error of the values (m,) for the mean returns, with its weight.

        The value of a layout with the cue ball in hand is that of its best place.
        """
        means = returns.mean(1)
        error = (values - means).square().mean()
        if self._in_hand is not None:
            rows, before = self._in_hand
            error = error + (self.policy.net.values(**before) - means[rows]).square().sum() / len(means)
        return _CRITIC * error

    def _go_on(self, outcomes: Outcomes, allowed: Bools) -> None:
        """Sets each environment to the state after one of its allowed shots that do not end the episode.

        Args:
            outcomes: The outcomes of m * k shots.
            allowed: (m, k), or (k,) for all environments.
        """
        ongoing = ~outcomes.terminated.reshape(self._settings["layouts"], -1)
        chances = self._rng.random(ongoing.shape) * (allowed & ongoing)
        chosen = np.arange(len(chances)) * chances.shape[1] + chances.argmax(1)
        self._over = chances.flatten()[chosen] == 0
        self._observations, going = outcomes.observations[chosen], np.flatnonzero(~self._over)
        self._envs.set_state(outcomes.states[chosen[going]], going)

    def _fit(self, mixtures: Callable[[Tensor, Tensor | None], Mixture], labels: Labels) -> None:
        """Takes one step of the optimizer towards a larger likelihood of labels."""
        mixture = _with_gradient(mixtures(labels.rows, labels.goals), self._log_std.exp())
        logs = mixture.log_prob(labels.actions).clamp(min=_LEAST_LOG)
        self._step((labels.weights * logs).sum() / labels.weights.sum(), 0)

    def _step(self, objective: Tensor, phase: int) -> None:
        """Takes one step of the optimizer of a phase towards a larger objective."""
        optimizer = self._optimizers[phase]
        optimizer.zero_grad()
        (-objective).backward()
        nn.utils.clip_grad_norm_(optimizer.param_groups[0]["params"], _NORM)
        optimizer.step()
        self.policy.net.std.copy_(self._log_std.detach().exp())

    def _mixtures(self, seen: Seen) -> Callable[[Tensor, Tensor | None], Mixture]:
        """Returns a function that returns the mixtures of layouts, by their numbers, and goals.

        With `goal_units` the goals of a layout share its first layers.
        """
        net = self.policy.net
        if net.goal and not net.goal_units:
            return lambda rows, goals: net(seen["positions"][rows], goal=goals)[0]
        layouts, _ = net.layouts(**seen)
        return lambda rows, goals: net.mixtures(layouts, goals, rows)

    def save(self, path: Path) -> None:
        """Writes a checkpoint."""
        optimizers = [optimizer.state_dict() for optimizer in self._optimizers]
        with replacing(path) as temporary:
            torch.save({"policy": self.policy.state_dict(), "optimizers": optimizers}, temporary)

    def load(self, path: Path) -> None:
        """Reads a checkpoint."""
        with whole_archive(path, "a checkpoint of these settings") as file:
            state = torch.load(file, map_location="cpu", weights_only=True)
            self.policy.load_state_dict(state["policy"])
            for optimizer, known in zip(self._optimizers, state["optimizers"], strict=True):
                optimizer.load_state_dict(known)
        self.shots = int(path.stem)


def learning_rate(settings: Mapping[str, Any], part: float) -> float:
    """Returns the learning rate after the share `part` of all shots, from 0 to 1."""
    end, (first, last) = settings["imitation"], settings["learning_rate"]
    improves = part >= end
    if "improvement_rate" not in settings:
        return (last + (first - last) * (1.0 - part)) * (_SLOWER if improves else 1.0)
    if not improves:
        return last + (first - last) * (1.0 - part / end)
    first, last = settings["improvement_rate"]
    return last + (first - last) * (1.0 - part) / (1.0 - end)


def random_hits(
    envs: BilliardsVectorEnv, policy: AimPolicy, count: int, rng: np.random.Generator, legal: Bools | None = None
) -> Floats:
    """Returns (m, count, a) random hits of the object balls, at the speeds of the policy.

    In scenes with flight half of the hits have a raised cue.
    """
    net, scene = policy.net, envs.single_env.scene
    slowest, fastest = float(net.slowest.min()), float((net.slowest + net.faster).max())
    size = len(envs.single_env.action_space.low)
    return hits(envs.positions, scene.balls.radius, count, (slowest, fastest), size, rng, scene.physics.flight, legal)


def easy_pots(envs: BilliardsVectorEnv, count: int, rng: np.random.Generator) -> Floats:
    """Returns (m, count, 2) random shots of the easiest pots by geometry; zeros where there are too few."""
    env, size = envs.single_env, -(-count // len(SPEEDS)) + 1
    pots = find_pots(Tables(env.scene, envs.positions, ~envs.potted, envs.legal_balls, env.max_speed), most=size)
    shots = pots.shots.reshape(len(pots.count), -1, pots.shots.shape[-1])
    chosen = np.argsort(-rng.random(shots.shape[:2]) * (shots[..., SPEED] > 0), axis=1)[:, :count, None]
    shots = np.take_along_axis(shots, chosen, axis=1)
    return shots[..., SPEED, None] / env.max_speed * shots[..., DX : DY + 1]


def scores(envs: BilliardsVectorEnv, outcomes: Outcomes) -> Bools:
    """Returns whether each shot (m,) scores: has a reward, or in an episode of one shot succeeds.

    A shot of a game scores if it wins the game or the player has the next shot.
    """
    if envs.single_env.model.max_shots == 1:
        return outcomes.infos["is_success"]
    scored = outcomes.rewards > 0
    return scored | keeps_turn(outcomes) & ~outcomes.terminated if envs.single_env.model.n_players > 1 else scored


def labels_of(envs: BilliardsVectorEnv, shots: Floats, outcomes: Any, most: int, rng: np.random.Generator) -> Labels:
    """Returns the shots (m, k, a) that score, see the module; random ones if there are more than `most`."""
    model, (m, k) = envs.single_env.model, shots.shape[:2]
    achieved, met = np.zeros((m, k, 3)), scores(envs, outcomes).reshape(m, k)
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


def corrections(slopes: Floats, misses: Floats, radius: float) -> Floats:
    """Returns the smallest changes (k, a) that correct misses to first order: damped Gauss-Newton steps.

    Args:
        slopes: (k, a, 2) m, the derivatives of a place with respect to the changes.
        misses: (k, 1, 2) m, from the place to its goal.
        radius: The radius of the goal, m. Slopes much smaller than it give small changes.
    """
    square = slopes.transpose(0, 2, 1) @ slopes + _DAMPING * radius**2 * np.eye(2)
    return (slopes @ np.linalg.solve(square, misses.transpose(0, 2, 1)))[..., 0]


def _with_gradient(mixture: Mixture, std: Tensor) -> Mixture:
    """Returns a mixture with the gradient of its standard deviations, those of `AimNetwork.std`."""
    along, across, tip = std / std.detach()
    return mixture._replace(along=along * mixture.along, across=across * mixture.across, tip_std=tip * mixture.tip_std)


def _check(config: Config) -> None:
    one_shot = 1 if config.env["goal_radius"] is not None else config.env["max_shots"]
    players = min(config.env["n_players"], 2)
    needed = {"policy.head": (config.policy["head"], "aim"), "env.n_players": (config.env["n_players"], players)}
    for name, (value, expected) in (needed | {"env.max_shots": (config.env["max_shots"], one_shot)}).items():
        if value != expected:
            raise ValueError(f"{name} = {value!r}: expected {expected!r} with learner = 'likelihood'")
    if config.settings["goals"] and config.env["goal_radius"] is None:
        raise ValueError(f"likelihood.goals = {config.settings['goals']}: expected 0 in a task without a goal")
    if config.settings["goals"] and config.settings["imitation"] <= _BEGIN:
        raise ValueError(
            f"likelihood.imitation = {config.settings['imitation']}: expected more than {_BEGIN} with goals"
        )
    if "improvement_rate" in config.settings and config.settings["imitation"] in (0, 1):
        imitation = config.settings["imitation"]
        raise ValueError(
            f"likelihood.imitation = {imitation}: expected a number above 0 and below 1 with improvement_rate"
        )
    if config.settings["pots"] and config.env["n_players"] == 1:
        raise ValueError(f"likelihood.pots = {config.settings['pots']}: expected 0 in a task of one player")
    config.n_envs = config.settings["layouts"]


_COUNTS = {"layouts": 128, "hits": 32, "own": 8, "labels": 1200, "passes": 2, "samples": 32}

LEARNER = Learner(
    {name: Setting(whole(1, 1_000_000), default) for name, default in _COUNTS.items()}
    | {name: Setting(whole(0, 1_000_000), 0) for name in ("goals", "pots")}
    | {"imitation": Setting(up_to(1.0), 0.5), "learning_rate": Setting(rates, [4e-3, 4e-5])}
    | {"improvement_rate": Setting(rates)}
    | {"beta2": Setting(up_to(0.9999), 0.999), "eps": Setting(up_to(1e-3), 1e-5)},
    _check,
    lambda config, run_dir: LikelihoodTraining(config),
)
"""The learner "likelihood". It trains the policy "aim".

`layouts` is the number of layouts of an update, and `imitation` the share of all shots that the first phase plays. In
this phase `hits` and `own` are the numbers of random hits and of actions of the policy in each layout, `labels` is the
largest number of shots that score in a step of the optimizer, and `passes` the number of steps for each update. `goals`
is the number of random goals of each layout for which the likeliest shot is corrected; 0 in a task without a goal.
`pots` is the number of hits of each layout that are pots by geometry; 0 in a task of one player. In the second phase
`samples` is the number of actions of the policy in each layout. `learning_rate` has the first and the last rate of the
training; the second phase has half of them. With `improvement_rate` nothing is halved: `learning_rate` has the first
and the last rate of the first phase, and `improvement_rate` those of the second phase.
`beta2` and `eps` are those of Adam (Kingma and Ba 2015, Adam: a method for stochastic optimization).
"""
