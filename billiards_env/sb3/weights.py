"""Policies in files: building a policy from its description, and its weights, also in slim files."""

from __future__ import annotations

import contextlib
import inspect
import io
import os
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from torch import Tensor

from billiards_env.bench.frozen import FROZEN
from billiards_env.envs import BilliardsEnv
from billiards_env.sb3.aim_network import ACTIVATIONS, OBSERVED
from billiards_env.sb3.aim_policy import AimPolicy, find_game
from billiards_env.settings import read_settings
from billiards_env.support.checks import Range, integer, one_of, sequence, short, short_name
from billiards_env.support.files import MAX_ARCHIVE, read_bytes, unzipped, write_atomically

AIM_ARGUMENTS = tuple(inspect.signature(AimPolicy).parameters)[4:-1]
"""The arguments of `AimPolicy` in the section `policy.arguments` of a configuration: those after `env`."""

POLICIES: dict[str, type[ActorCriticPolicy]] = {"aim": AimPolicy, "gaussian": ActorCriticPolicy}
"""The policies, by `policy.head` of a configuration."""


def policy_arguments(env: Mapping[str, Any], description: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the keyword arguments of a policy.

    Args:
        env: Arguments of `gym.make("Billiards-v0", ...)`.
        description: The section `policy` of a configuration: `head`, and `arguments` for the head "aim", or `hidden`
            and `activation` for "gaussian".

    Raises:
        KeyError, TypeError, ValueError: If a value of the description is missing or wrong.
    """
    one_of("policy.head", description["head"], tuple(POLICIES))
    if description["head"] == "gaussian":
        one_of("policy.activation", description["activation"], tuple(ACTIVATIONS))
        hidden = sequence("policy.hidden", description["hidden"])
        return {
            "net_arch": [integer("policy.hidden", n, Range(1, None)) for n in hidden],
            "activation_fn": ACTIVATIONS[description["activation"]],
        }
    for name in description["arguments"]:
        one_of("policy.arguments", name, AIM_ARGUMENTS)
    return {"env": dict(env), **description["arguments"]}


def build_policy(
    env: Mapping[str, Any], description: Mapping[str, Any], learning_rate: Callable[[float], float] = lambda _: 0.0
) -> ActorCriticPolicy:
    """Returns an untrained policy.

    Args:
        env: Arguments of `gym.make("Billiards-v0", ...)`.
        description: The section `policy` of a configuration: `head`, and `arguments` for the head "aim", or `hidden`
            and `activation` for "gaussian".
        learning_rate: The step size of the optimiser, as a function of the share of the steps that remain.

    Raises:
        ValueError: If an argument is invalid, there is no such policy, or it does not fit the task.
        TypeError: If an argument has the wrong type.
        KeyError: If a key is missing.
    """
    game = find_game(env)
    arguments = policy_arguments(env, description)
    return POLICIES[description["head"]](game.observation_space, game.action_space, learning_rate, **arguments)


def check_finished(folder: Path) -> None:
    """Raises a FileNotFoundError unless a folder holds a finished run."""
    for name in ("config.yaml", "policy.pt"):
        if not (folder / name).is_file():
            raise FileNotFoundError(
                f"run_dir = {str(folder)!r}: expected the folder of a finished run of agents.train, with {name}"
            )


def load_policy(
    run_dir: str | os.PathLike[str], env: Mapping[str, Any] | None = None
) -> tuple[dict[str, Any], BasePolicy]:
    """Returns a trained policy and the arguments of its environment.

    Only weights are read from the file. Unlike `PPO.load`, this runs no code from the file.

    Args:
        run_dir: The folder of a run of `agents.train`, with `config.yaml` and `policy.pt`.
        env: Arguments of `gym.make("Billiards-v0", ...)` that replace those of the run. The weights of `AimPolicy` do
            not depend on the number of balls.

    Returns:
        The arguments of `gym.make("Billiards-v0", ...)`, and the policy. `policy.predict` returns actions of this
        environment. The value function of the head "gaussian" is untrained.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        OSError: If a file cannot be read.
        ValueError: If `config.yaml` does not describe a policy, an argument of the environment is invalid, the
            policy was trained for another task, action, table, radius of the balls or largest speed, or `policy.pt`
            does not hold the weights of the policy.
        TypeError: If an argument in `env` has the wrong type.
    """
    folder = Path(run_dir)
    check_finished(folder)
    settings, weights = folder / "config.yaml", folder / "policy.pt"
    try:
        config = read_settings(settings, "the settings of a run")
        arguments, description = {**config["env"], **(env or {})}, {**config["policy"]}
        trained, task = find_game(config["env"]), str(config.get("task"))
        if description["head"] == "aim":  # the networks observe what they observed in the training
            observe = [name for name in OBSERVED if name in trained.features]
            description["arguments"] = {"observe": observe, **description["arguments"]}
        hidden = policy_arguments(arguments, description).get("net_arch", ())
    except (AttributeError, KeyError, RecursionError, TypeError) as error:
        why = " ".join(str(error).split())
        raise ValueError(f"{settings}: expected the sections env and policy of a run ({why})") from None
    played = find_game(arguments)
    _check_world(folder, trained, played, task)
    if description["head"] == "gaussian" and trained.observe != played.observe:
        raise ValueError(
            f"{folder} holds a policy that observes {trained.observe}: expected this, not {played.observe}"
        )
    content = read_weights(weights)
    numbers = sum(tensor.numel() for tensor in content.values())
    if sum(a * b for a, b in zip((1, *hidden), hidden, strict=False)) > numbers:
        raise ValueError(f"{weights} does not hold the policy of its configuration: expected more weights for {hidden}")
    with torch.random.fork_rng(devices=[]):  # the random weights are replaced
        policy = build_policy(arguments, description)
    set_weights(policy, content, weights)
    policy.set_training_mode(False)
    return arguments, policy


def _check_world(folder: Path, trained: BilliardsEnv, played: BilliardsEnv, frozen: str) -> None:
    """Raises a ValueError if a policy was not made for an environment.

    The number of the balls, their friction and the engine may differ. The task may also be the frozen task that the run
    was made for, whose rewards may differ from those of the training.
    """
    task, other = short_name(trained.task), short_name(played.task)
    tasks = {task, FROZEN[frozen].arguments["task"]} if frozen in FROZEN else {task}
    for name, there, here in (
        ("task", task, task if other in tasks else other),
        ("action", trained.action, played.action),
        ("max_speed", trained.max_speed, played.max_speed),
        ("table", trained.scene.table, played.scene.table),
        ("radius of the balls", trained.scene.balls.radius[:2], played.scene.balls.radius[:2]),
    ):
        if there != here:
            expected = "the same table" if name == "table" else f"{short(there)}, not {short(here)}"
            raise ValueError(f"{folder} holds a policy that was trained for another {name}: expected {expected}")


def save_policy(policy: BasePolicy, path: Path) -> None:
    """Writes the weights of a policy; with the head "gaussian" without the value function."""
    write_atomically(path, _packed({name: one for name, one in policy.state_dict().items() if not _is_value(name)}))


def slim(run_dir: Path) -> dict[str, bytes]:
    """Returns the files of a smaller copy of a finished run, by name. Its weights are for playing only.

    Numbers have 9 significant bits in place of 24, as float16 without its last two bits. Untrained weights are 0:
    those of `other_ball` after a training with one object ball, and those of the critic after a training by
    `learner: likelihood` for one shot. The file is deflated.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        OSError: If a file cannot be read.
        ValueError: If `policy.pt` holds no weights or a weight that is too large for float16, or `config.yaml` holds
            no settings.
    """
    check_finished(run_dir)
    weights = read_weights(run_dir / "policy.pt")
    settings = read_settings(run_dir / "config.yaml", "the settings of a run")
    unused = [] if weights.get("net.other_balls.weight", torch.ones(1)).any() else ["net.other_ball."]
    if settings.get("learner") == "likelihood" and (settings.get("env") or {}).get("max_shots") == 1:
        unused.append("net.critic.")
    small = {name: _rounded(0 * one if name.startswith(tuple(unused)) else one) for name, one in weights.items()}
    if not all(one.isfinite().all() for one in small.values()):
        raise ValueError(f"run_dir = {str(run_dir)!r}: expected weights up to 65,000")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in unzipped(_packed(small)).items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED, 9)
    return {"config.yaml": (run_dir / "config.yaml").read_bytes(), "policy.pt": buffer.getvalue()}


def is_slim(weights: Mapping[str, Tensor]) -> bool:
    """Returns whether weights are from a file of `slim`."""
    return any(tensor.dtype == torch.float16 for tensor in weights.values())


def _rounded(tensor: Tensor) -> Tensor:
    if not tensor.is_floating_point():
        return tensor
    bits = tensor.float().flatten().view(torch.int32)
    even = bits + 2**14 - 1 + (bits >> 15 & 1)  # a number halfway between two others becomes the even one
    return (even & -(2**15)).view(torch.float32).half().reshape(tensor.shape)


def _packed(weights: Mapping[str, Tensor]) -> bytes:
    buffer = io.BytesIO()
    torch.save(dict(weights), buffer)
    return buffer.getvalue()


def read_weights(path: Path) -> dict[str, Tensor]:
    """Returns the weights in a file of `save_policy` or `slim`, by name.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it holds no weights.
    """
    with whole_archive(path, "a policy's weights") as file:
        weights = torch.load(file, map_location="cpu", weights_only=True)
        if not isinstance(weights, dict) or not all(isinstance(tensor, Tensor) for tensor in weights.values()):
            raise ValueError
    return weights


def set_weights(policy: BasePolicy, weights: Mapping[str, Tensor], path: Path) -> None:
    """Sets the weights of a policy. Raises a ValueError that names the file if they do not fit."""
    try:
        missing, unknown = policy.load_state_dict(weights, strict=False)
        missing = [name for name in missing if not _is_value(name)]
        if missing or unknown:
            raise RuntimeError(f"missing {missing}, unknown {unknown}")
    except (AttributeError, RuntimeError, TypeError) as error:
        raise ValueError(f"{path} does not hold the policy of its configuration: {error}") from error


@contextlib.contextmanager
def whole_archive(path: Path, what: str) -> Iterator[io.BytesIO]:
    """Yields the content of a zip file after a check. Exceptions in the block become a ValueError.

    The error leaves out PyTorch's message, which advises loading the file with `weights_only=False`: this would run
    code from the file.

    Args:
        path: The file.
        what: What the file should hold, for the message.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the file is damaged, it or its content is larger than `files.MAX_ARCHIVE`, or the block raises
            another exception.
    """
    packed = read_bytes(path, MAX_ARCHIVE, what)
    try:
        unzipped(packed)  # neither PyTorch nor Stable-Baselines3 compares the checksums
        yield io.BytesIO(packed)
    except Exception:
        expected = f"expected a whole file of {what}, it is damaged or holds other objects"
        raise ValueError(f"path = {str(path)!r}: {expected}") from None


def _is_value(name: str) -> bool:
    """Returns whether weights of this name belong to the value function of the head "gaussian"."""
    return "value_net" in name
