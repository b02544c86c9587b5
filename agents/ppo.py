"""Makes environments and policies from a configuration, and trains with PPO: `learner: ppo`, the default."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.utils import safe_mean, set_random_seed
from stable_baselines3.common.vec_env import VecEnv

from agents.learner import Learner, Setting, Training, rates, up_to, whole
from billiards_env.bench.evaluation import FIRST_EVALUATION_SEED
from billiards_env.envs import BilliardsVectorEnv, Opponents
from billiards_env.sb3 import PPO_SETTINGS
from billiards_env.sb3.vec_env import SameStepVecEnv
from billiards_env.sb3.weights import POLICIES, build_policy, policy_arguments, whole_archive
from billiards_env.support.checks import flag
from billiards_env.support.files import replacing

if TYPE_CHECKING:
    from agents.config import Config  # which imports the learners

ENV_ID = "Billiards-v0"

RIVAL = "geometric"
"""The player against which the policies of games are measured."""


def training_seed(config: Config, timesteps: int) -> int:
    """Returns the seed of the training after `timesteps` steps. Environment i has this seed plus i.

    The seeds of all environments are below 2^31.
    """
    state = np.random.SeedSequence((config.seed, timesteps)).generate_state(1)[0]
    return int(state) % (FIRST_EVALUATION_SEED - config.n_envs)


def make_env(config: Config, render_mode: str | None = None) -> gym.Env[NDArray[np.float32], NDArray[np.float32]]:
    """Returns one environment to play in, with the execution noise of the configuration.

    Raises:
        ValueError: If an argument of the environment or its noise is invalid.
        TypeError: If an argument has the wrong type.
    """
    return gym.make(ENV_ID, render_mode=render_mode, noise=config.noise, **config.env)


def make_vector(config: Config, num_envs: int, threads: int | None = None, **env: Any) -> VectorEnv[Any, Any, Any]:
    """Returns a vector of `num_envs` environments as in `make_env`.

    Args:
        config: The configuration.
        num_envs: The number of environments.
        threads: The number of threads that play; None for one per core.
        env: Arguments that replace those in `config.env`.
    """
    return gym.make_vec(ENV_ID, num_envs=num_envs, threads=threads, noise=config.noise, **{**config.env, **env})


def make_evaluation(config: Config, num_envs: int) -> VectorEnv[Any, Any, Any]:
    """Returns the environments of `make_vector` to measure a policy in: in a game, `RIVAL` plays the other turns."""
    envs = make_vector(config, num_envs)
    return envs if config.env["n_players"] == 1 else Opponents(cast(BilliardsVectorEnv, envs.unwrapped), RIVAL)


def make_vec_env(config: Config, threads: int | None = None) -> VecEnv:
    """Returns `config.n_envs` environments to train in, for Stable-Baselines3; `threads` as in `make_vector`."""
    return SameStepVecEnv(make_vector(config, config.n_envs, threads))


def make_ppo(config: Config, envs: VecEnv) -> PPO:
    """Returns an untrained PPO model."""
    return PPO(
        POLICIES[config.policy["head"]],
        envs,
        **{**config.settings, "learning_rate": learning_rate(config)},
        policy_kwargs=policy_arguments(config.env, config.policy),
        seed=config.seed,
        stats_window_size=1000,
        device="cpu",  # such small networks are not faster on an accelerator
    )


def restart(model: PPO, config: Config, timesteps: int, first: int = 0) -> None:
    """Seeds all random generators and begins new episodes.

    What follows depends only on the weights and the arguments.

    Args:
        model: The model.
        config: The configuration of the training.
        timesteps: The number of steps of the training so far.
        first: The index of the first environment of the model among all environments of the training.
    """
    seed = training_seed(config, timesteps) + first
    assert model.env is not None
    set_random_seed(seed)
    model.env.seed(seed)
    model._last_obs = cast(Any, model.env.reset())
    model._last_episode_starts = np.ones(model.n_envs, dtype=bool)


def make_policy(config: Config) -> ActorCriticPolicy:
    """Returns an untrained policy.

    Raises:
        ValueError: If an argument of the environment or its noise is invalid, or the policy does not fit the task.
        TypeError: If an argument of the environment has the wrong type.
    """
    make_env(config).close()
    return build_policy(config.env, config.policy)


def learning_rates(config: Config) -> tuple[float, float]:
    """Returns Adam's step size at the start and at the end."""
    rate = config.settings.get("learning_rate", 3e-4)
    first, last = rate if isinstance(rate, list) else (rate, rate)
    return first, last


def learning_rate(config: Config) -> Callable[[float], float]:
    """Returns Adam's step size as a function of the share of the steps to come, which may be below 0 at the end."""
    first, last = learning_rates(config)
    return lambda remaining: last + (first - last) * max(remaining, 0.0)


def deterministic(policy: BasePolicy) -> Callable[[NDArray[np.float32]], NDArray[np.floating[Any]]]:
    """Returns the argument `act` of `play_episodes` for a policy without exploration noise."""
    return lambda observations: policy.predict(observations, deterministic=True)[0]


class PPOTraining(Training):
    """A training with PPO of Stable-Baselines3. `finish` also writes `model.zip`."""

    def __init__(self, config: Config, run_dir: Path) -> None:
        self._config, self._updates, self._envs = config, 0, make_vec_env(config)
        self.model = make_ppo(config, self._envs)
        self.policy = self.model.policy
        self.model.set_logger(configure(str(run_dir / "tensorboard"), ["tensorboard"]))
        # A first shot compiles the engine, so that this is no part of the time of the training.
        self._envs.reset()
        self._envs.step(np.zeros((config.n_envs, *(self._envs.action_space.shape or ()))))
        _, self._callback = self.model._setup_learn(config.timesteps)

    def restart(self) -> None:
        """Seeds all random generators and begins new episodes. Unfinished episodes are dropped."""
        restart(self.model, self._config, self.shots)

    def update(self) -> float:
        """Plays and learns from `n_steps` shots of each environment, as `PPO.learn` does."""
        model: Any = self.model
        model.collect_rollouts(model.env, self._callback, model.rollout_buffer, model.n_steps)
        self.shots, self._updates = model.num_timesteps, self._updates + 1
        model._update_current_progress_remaining(self.shots, self._config.timesteps)
        model.dump_logs(self._updates)
        model.train()
        return float(safe_mean(model.ep_success_buffer)) if model.ep_success_buffer else 0.0

    def save(self, path: Path) -> None:
        """Writes the model."""
        with replacing(path) as temporary:
            self.model.save(temporary)

    def load(self, path: Path) -> None:
        """Reads the weights and the number of steps of a model. Nothing else is read, so no code runs."""
        with whole_archive(path, "a checkpoint of these settings") as file:
            self.model.set_parameters(cast(Any, file), device="cpu")
        self.shots = self.model.num_timesteps = self.model._num_timesteps_at_start = int(path.stem)

    def finish(self, run_dir: Path) -> None:
        """Writes `model.zip` and `policy.pt`."""
        self.save(run_dir / "model.zip")
        super().finish(run_dir)

    def close(self) -> None:
        """Closes the environments."""
        self._envs.close()


def _check(config: Config) -> None:
    if config.env["n_players"] > 1:
        raise ValueError(
            f"env.n_players = {config.env['n_players']}: expected 1; the learner 'likelihood' trains in games of two"
        )
    if config.policy["head"] == "aim":
        config.settings = {**AIM_PPO, **config.settings}
    rollout, batch = config.n_envs * config.settings.get("n_steps", 2048), config.settings.get("batch_size", 64)
    if rollout % min(batch, rollout):
        raise ValueError(f"ppo.batch_size = {batch}: expected a divisor of n_envs * ppo.n_steps = {rollout}")


def _limit(name: str, value: Any) -> float | None:
    """Checks a number, or None for no limit."""
    return None if value is None else up_to(1e6)(name, value)


def _rate(name: str, value: Any) -> Any:
    """Checks a learning rate, or those of the start and of the end."""
    return (rates if isinstance(value, list) else up_to(1.0))(name, value)


LEARNER = Learner(
    {name: Setting(whole(1)) for name in ("n_steps", "batch_size", "n_epochs")}
    | {name: Setting(up_to(1.0)) for name in ("gamma", "gae_lambda")}
    | {name: Setting(up_to(1e6)) for name in ("clip_range", "ent_coef", "vf_coef", "max_grad_norm")}
    | {name: Setting(_limit) for name in ("clip_range_vf", "target_kl")}
    | {"learning_rate": Setting(_rate), "normalize_advantage": Setting(flag)},
    _check,
    PPOTraining,
)
"""The learner "ppo". Its settings are arguments of `stable_baselines3.PPO`, which has their defaults.

A pair of learning rates has the rate of the start and of the end. With the policy "aim" the defaults are `AIM_PPO`.
"""

AIM_PPO = {key: PPO_SETTINGS[key] for key in PPO_SETTINGS if key in LEARNER.settings} | {"learning_rate": [2e-3, 2e-5]}
"""The defaults with the policy "aim": `PPO_SETTINGS` as plain data."""
