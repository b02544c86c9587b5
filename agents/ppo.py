"""Makes environments and PPO models from a configuration, and loads trained policies."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnv

from agents.config import ENV_ID, Config, load
from billiards_env import sb3
from billiards_env.bench.evaluation import FIRST_EVALUATION_SEED
from billiards_env.sb3.vec_env import SameStepVecEnv
from billiards_env.sb3.weights import POLICIES, build_policy, check_finished, policy_arguments


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


def make_vec_env(config: Config, threads: int | None = None) -> VecEnv:
    """Returns `config.n_envs` environments to train in, for Stable-Baselines3; `threads` as in `make_vector`."""
    return SameStepVecEnv(make_vector(config, config.n_envs, threads))


def make_ppo(config: Config, envs: VecEnv) -> PPO:
    """Returns an untrained PPO model."""
    return PPO(
        POLICIES[config.policy["head"]],
        envs,
        **{**config.ppo, "learning_rate": learning_rate(config)},
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
    return build_policy(config.env, config.policy, learning_rate(config))


def learning_rates(config: Config) -> tuple[float, float]:
    """Returns Adam's step size at the start and at the end."""
    rate = config.ppo.get("learning_rate", 3e-4)
    first, last = rate if isinstance(rate, list) else (rate, rate)
    return first, last


def learning_rate(config: Config) -> Callable[[float], float]:
    """Returns Adam's step size as a function of the share of the steps to come, which may be below 0 at the end."""
    first, last = learning_rates(config)
    return lambda remaining: last + (first - last) * max(remaining, 0.0)


def deterministic(policy: BasePolicy) -> Callable[[NDArray[np.float32]], NDArray[np.floating[Any]]]:
    """Returns the argument `act` of `play_episodes` for a policy without exploration noise."""
    return lambda observations: policy.predict(observations, deterministic=True)[0]


def load_run(run_dir: Path, env: Mapping[str, Any] | None = None) -> tuple[Config, BasePolicy]:
    """Returns the configuration and the trained policy of a run.

    Args:
        run_dir: The folder of the run.
        env: Arguments of `gym.make("Billiards-v0", ...)` that replace those of the run.

    Returns:
        The configuration, and the policy. `policy.predict` returns actions for `make_env(config)`.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        OSError: If a file cannot be read.
        ValueError: If the configuration is invalid, or `policy.pt` does not hold the weights of its policy.
        TypeError: If a value of the configuration has the wrong type.
    """
    check_finished(run_dir)
    config = load(run_dir / "config.yaml")
    arguments, policy = sb3.load_policy(run_dir, env)
    return dataclasses.replace(config, env=arguments), policy
