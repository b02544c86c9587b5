"""Makes environments and PPO models from a configuration, and saves and loads policies."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import Schedule
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor

from agents.config import ENV_ID, Config, load
from agents.policy import MixturePolicy, find_game
from agents.pot_head import FeatureBuffer, PotFeatures
from agents.vec_env import SameStepVecEnv
from billiards_env.envs.wrappers import ExecutionNoise, VectorExecutionNoise
from billiards_env.files import write_whole

_ACTIVATIONS = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU, "elu": torch.nn.ELU, "silu": torch.nn.SiLU}

# Environment seeds are below this number in training, and not below it in evaluation.
_FIRST_EVALUATION_SEED = 2**31


def training_seed(config: Config, timesteps: int) -> int:
    """Returns the seed of the training after `timesteps` steps. Environment i has this seed plus i.

    The seeds of all environments are below 2^31.
    """
    state = np.random.SeedSequence((config.seed, timesteps)).generate_state(1)[0]
    return int(state) % (_FIRST_EVALUATION_SEED - config.n_envs)


def evaluation_seeds(seed: int, episodes: int) -> NDArray[np.int64]:
    """Returns one environment seed for each episode, (episodes,); training uses none of them.

    Example:
        >>> bool((evaluation_seeds(0, 1000) >= 2**31).all())
        True
    """
    return _FIRST_EVALUATION_SEED + np.random.SeedSequence(seed).generate_state(episodes).astype(np.int64) // 2


def make_env(config: Config, render_mode: str | None = None) -> gym.Env[NDArray[np.float32], NDArray[np.float32]]:
    """Returns one environment to play in, with the execution noise of the configuration.

    Raises:
        ValueError: If an argument of the environment or its noise is impossible.
        TypeError: If an argument has the wrong type.
    """
    env: gym.Env[Any, Any] = gym.make(ENV_ID, render_mode=render_mode, **config.env)
    if config.noise is not None:
        env = ExecutionNoise(env, **dataclasses.asdict(config.noise))
    return env


def make_vector(config: Config, num_envs: int, threads: int | None = None) -> VectorEnv[Any, Any, Any]:
    """Returns a vector of `num_envs` environments as in `make_env`, with same-step autoreset.

    Args:
        config: The configuration.
        num_envs: The number of environments.
        threads: The number of threads that play; None for one per core.
    """
    envs = gym.make_vec(ENV_ID, num_envs=num_envs, autoreset_mode="SameStep", threads=threads, **config.env)
    if config.noise is not None:
        envs = VectorExecutionNoise(envs, **dataclasses.asdict(config.noise))
    return envs


def make_vec_env(config: Config) -> VecEnv:
    """Returns `config.n_envs` environments to train in, for Stable-Baselines3."""
    return SameStepVecEnv(make_vector(config, config.n_envs))


def make_model(config: Config, envs: VecEnv) -> PPO:
    """Returns an untrained PPO model."""
    settings = dataclasses.asdict(config.ppo)
    del settings["final_learning_rate"]
    model = PPO(
        _policy_class(config),
        envs,
        **{**settings, "learning_rate": _learning_rate(config)},
        rollout_buffer_class=FeatureBuffer if config.policy.head == "pots" else None,
        policy_kwargs=_policy_arguments(config),
        seed=config.seed,
        stats_window_size=1000,
        device="cpu",  # such small networks are not faster on an accelerator
    )
    if isinstance(model.rollout_buffer, FeatureBuffer):
        model.rollout_buffer.extractor = cast(PotFeatures, model.policy.features_extractor)
    return model


def make_policy(config: Config) -> ActorCriticPolicy:
    """Returns an untrained policy.

    Raises:
        ValueError: If an argument of the environment or its noise is impossible, or the head does not fit the task.
        TypeError: If an argument of the environment has the wrong type.
    """
    game = find_game(config.env)
    spaces = game.observation_space, game.action_space
    return _policy_class(config)(*spaces, _learning_rate(config), **_policy_arguments(config))


def set_std(policy: ActorCriticPolicy, config: Config, timesteps: int) -> None:
    """Sets the standard deviations of the policy after `timesteps` steps, if the configuration has a schedule."""
    if config.policy.std is not None:
        std = config.policy.std.at(timesteps / config.timesteps)
        if isinstance(policy, MixturePolicy):
            policy.set_std(std)
        else:
            policy.log_std.requires_grad_(False).copy_(torch.tensor(std).log())


def save_policy(policy: ActorCriticPolicy, path: Path) -> None:
    """Writes the weights of a policy without those of the value function."""
    weights = {name: tensor for name, tensor in policy.state_dict().items() if not _is_value(name)}
    buffer = io.BytesIO()
    torch.save(weights, buffer)
    write_whole(path, buffer.getvalue())


def load_policy(run_dir: Path, env: Mapping[str, Any] | None = None) -> tuple[Config, ActorCriticPolicy]:
    """Returns the trained policy of a run.

    The policy is built from the configuration of the run, and only weights are read from the file. Unlike `PPO.load`,
    this runs no code from the file.

    Args:
        run_dir: The folder of the run, with `config.yaml` and `policy.pt`.
        env: Arguments of `gym.make("Billiards-v0", ...)` that replace those of the run. The weights of the head "pots"
            do not depend on the number of balls.

    Returns:
        The configuration, and the policy. `policy.predict` returns actions for `make_env(config)`. The value function
        of the policy is untrained.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        OSError: If a file cannot be read.
        ValueError: If the configuration is impossible, or `policy.pt` does not hold the weights of its policy.
        TypeError: If a value of the configuration has the wrong type.
    """
    for name in ("config.yaml", "policy.pt"):
        if not (run_dir / name).is_file():
            raise FileNotFoundError(
                f"run_dir = {str(run_dir)!r}: expected the folder of a finished run of agents.train, with {name}"
            )
    config = load(run_dir / "config.yaml")
    if env is not None:
        config = dataclasses.replace(config, env={**config.env, **env})
    policy = make_policy(config)
    load_weights(policy, run_dir / "policy.pt")
    policy.set_training_mode(False)
    return config, policy


def load_weights(policy: ActorCriticPolicy, path: Path) -> None:
    """Sets the weights of a policy, without those of the value function, from a file of `save_policy`.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the weights in the file are not those of this policy.
    """
    with whole_archive(path, "a policy's weights"):
        weights = torch.load(path, map_location="cpu", weights_only=True)
        if not isinstance(weights, dict) or not all(isinstance(tensor, Tensor) for tensor in weights.values()):
            raise ValueError
    try:
        missing, unknown = policy.load_state_dict(weights, strict=False)
        missing = [name for name in missing if not _is_value(name)]
        if missing or unknown:
            raise RuntimeError(f"missing {missing}, unknown {unknown}")
    except (AttributeError, RuntimeError, TypeError) as error:
        raise ValueError(f"{path} does not hold the policy of its configuration: {error}") from error


@contextlib.contextmanager
def whole_archive(path: Path, content: str) -> Iterator[None]:
    """Checks a zip file and turns the exceptions of reading it into a ValueError.

    The message of PyTorch is left out: it advises to load the file with `weights_only=False`, which runs its code.

    Args:
        path: The file.
        content: What the file should hold, for the message.

    Raises:
        OSError: If the file cannot be opened.
        ValueError: If the file is damaged or reading it raises another exception.
    """
    with path.open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                if archive.testzip() is not None:  # neither PyTorch nor Stable-Baselines3 compares the checksums
                    raise ValueError
            yield
        except Exception:
            expected = "expected a whole file of weights, it is damaged or holds other objects"
            raise ValueError(f"{path} does not hold {content}: {expected}") from None


def _is_value(name: str) -> bool:
    """Returns whether weights of this name belong to the value function."""
    return "value_net" in name


def _policy_class(config: Config) -> type[ActorCriticPolicy]:
    return ActorCriticPolicy if config.policy.head == "gaussian" else MixturePolicy


def _policy_arguments(config: Config) -> dict[str, Any]:
    p = config.policy
    arguments: dict[str, Any] = {"net_arch": list(p.hidden), "activation_fn": _ACTIVATIONS[p.activation]}
    if p.head != "gaussian":
        own = {name: getattr(p, name) for name in ("head", "components", "speeds", "banks")}
        arguments |= {"env": dict(config.env), **own}
    return arguments


def _learning_rate(config: Config) -> Schedule:
    first, last = config.ppo.learning_rate, config.ppo.final_learning_rate
    if last is None:
        return lambda remaining: first
    # `remaining`, the share of steps to come, falls from 1 to 0. It is below 0 if the last
    # update has more steps than are left.
    return lambda remaining: last + (first - last) * max(remaining, 0.0)
