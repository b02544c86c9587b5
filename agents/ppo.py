"""Environments, the PPO model and the loading of a trained policy, all from a `Config`."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.type_aliases import Schedule
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

from agents.config import ENV_ID, Config
from agents.vec_env import SameStepVecEnv
from billiards_env.envs.wrappers import ActionFrame, ExecutionNoise, VectorActionFrame, VectorExecutionNoise

_ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU, "elu": torch.nn.ELU, "silu": torch.nn.SiLU}

# Layouts are drawn from environment seeds below this number in training, from it upwards in evaluation.
_FIRST_EVALUATION_SEED = 2**31


def training_seed(config: Config, timesteps: int) -> int:
    """The seed from which training goes on after `timesteps` steps; environment i adds i to it.

    Returns:
        A whole number such that all environments' seeds are below 2^31.
    """
    state = np.random.SeedSequence((config.seed, timesteps)).generate_state(1)[0]
    return int(state) % (_FIRST_EVALUATION_SEED - config.n_envs)


def evaluation_seeds(seed: int, episodes: int) -> NDArray[np.int64]:
    """(episodes,) environment seeds, one an episode, none of which training ever uses.

    Example:
        >>> bool((evaluation_seeds(0, 1000) >= 2**31).all())
        True
    """
    return _FIRST_EVALUATION_SEED + np.random.SeedSequence(seed).generate_state(episodes).astype(np.int64) // 2


def make_env(config: Config) -> gym.Env[NDArray[np.float32], NDArray[np.float32]]:
    """One environment, with the configuration's execution noise and in its action frame.

    Raises:
        ValueError: If an argument of the environment, its noise or its frame is impossible.
        TypeError: If one is of the wrong type.
    """
    env: gym.Env[Any, Any] = gym.make(ENV_ID, **config.env)
    if config.noise is not None:
        env = ExecutionNoise(env, **dataclasses.asdict(config.noise))
    if config.frame is not None:
        env = ActionFrame(env, *dataclasses.astuple(config.frame))
    return env


def make_vec_env(config: Config) -> VecEnv:
    """`config.n_envs` environments as `make_env` makes them, stepped together.

    They add each episode's return and length to its last `info`.
    """
    envs = gym.make_vec(ENV_ID, num_envs=config.n_envs, autoreset_mode="SameStep", **config.env)
    if config.noise is not None:
        envs = VectorExecutionNoise(envs, **dataclasses.asdict(config.noise))
    if config.frame is not None:
        envs = VectorActionFrame(envs, *dataclasses.astuple(config.frame))
    return VecMonitor(SameStepVecEnv(envs))


def make_model(config: Config, envs: VecEnv) -> PPO:
    """An untrained PPO model on `envs`."""
    s = config.ppo
    return PPO(
        ActorCriticPolicy,
        envs,
        n_steps=s.n_steps,
        batch_size=s.batch_size,
        n_epochs=s.n_epochs,
        learning_rate=_learning_rate(config),
        gamma=s.gamma,
        gae_lambda=s.gae_lambda,
        clip_range=s.clip_range,
        ent_coef=s.ent_coef,
        vf_coef=s.vf_coef,
        max_grad_norm=s.max_grad_norm,
        target_kl=s.target_kl,
        policy_kwargs=_policy_arguments(config),
        seed=config.seed,
        stats_window_size=1000,
        device="cpu",  # such small networks gain nothing from an accelerator
    )


def load_policy(path: Path, config: Config, env: gym.Env[Any, Any]) -> ActorCriticPolicy:
    """The trained policy in a `model.zip`.

    The policy is rebuilt from the configuration and only its weights are read from the file: unlike `PPO.load`, which
    unpickles what it finds, this runs no code from it.

    Args:
        path: The file.
        config: The configuration it was trained with.
        env: An environment made from that.

    Returns:
        The policy.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is not a model, or one of another shape.
        pickle.UnpicklingError: If it holds anything but weights.
    """
    _, parameters, _ = load_from_zip_file(path, load_data=False, device="cpu")
    policy = ActorCriticPolicy(
        env.observation_space, env.action_space, _learning_rate(config), **_policy_arguments(config)
    )
    try:
        policy.load_state_dict(cast(dict[str, Any], parameters["policy"]))
    except (KeyError, RuntimeError) as error:
        raise ValueError(f"{path} does not hold the policy of its configuration: {error}") from error
    return policy


def _policy_arguments(config: Config) -> dict[str, Any]:
    return {
        "net_arch": list(config.policy.hidden),
        "activation_fn": _ACTIVATIONS[config.policy.activation],
        "log_std_init": config.policy.log_std_init,
    }


def _learning_rate(config: Config) -> Schedule:
    first, last = config.ppo.learning_rate, config.ppo.final_learning_rate
    if last is None:
        return lambda remaining: first
    return lambda remaining: last + (first - last) * remaining  # the share of steps that remain falls from 1 to 0
