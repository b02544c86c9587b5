"""The settings of a training, and how they are read from YAML and checked.

`configs/learning.yaml` holds the settings of the published results: a row for each task. A training reads a row, or a
file with the same keys.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeGuard

import yaml

from billiards_env.bench.frozen import FROZEN
from billiards_env.envs import make_model
from billiards_env.envs.tasks import task_of
from billiards_env.sb3 import PPO_SETTINGS
from billiards_env.shots.noise import EXECUTION_NOISE
from billiards_env.support.checks import Range, fields_of, flag, integer, number, one_of, real, short
from billiards_env.support.settings import read_settings

ENV_ID = "Billiards-v0"

LEARNING = Path(__file__).resolve().parent.parent / "configs" / "learning.yaml"

AIM_POLICY: dict[str, Any] = {"arguments": {}}
USUAL_POLICY: dict[str, Any] = {"hidden": [64, 64], "activation": "tanh"}

LEARNERS = ("ppo", "likelihood")

_PPO = (
    *("learning_rate", "n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "clip_range", "clip_range_vf"),
    *("normalize_advantage", "ent_coef", "vf_coef", "max_grad_norm", "target_kl"),
)
_POLICY = {"aim": ("head", "arguments"), "gaussian": ("head", "hidden", "activation")}
_COUNTS = ("n_steps", "batch_size", "n_epochs")
_SHARES = ("learning_rate", "gamma", "gae_lambda")
_OPTIONAL = ("clip_range_vf", "target_kl")  # None: no limit

LIKELIHOOD = {
    "layouts": 128,
    "hits": 32,
    "own": 8,
    "labels": 1200,
    "passes": 2,
    "imitation": 0.5,
    "samples": 32,
    "learning_rate": [4e-3, 4e-5],
}
"""The defaults of `Config.likelihood`."""

AIM_PPO = {**{name: PPO_SETTINGS[name] for name in PPO_SETTINGS if name in _PPO}, "learning_rate": [2e-3, 2e-5]}
"""`PPO_SETTINGS` as plain data."""


@dataclasses.dataclass(kw_only=True)
class Config:
    """A training run.

    Attributes:
        timesteps: The number of environment steps (shots), rounded up to whole updates; 0 for no training.
        task: A frozen task, such as "Pot1-v0", which sets `env` and `noise`; None for none.
        env: Arguments of `gym.make("Billiards-v0", ...)`. They replace the arguments of `task`. The constructor adds
            all missing arguments.
        noise: The argument `noise` of `Billiards-v0`; None for no noise, "task" for the noise of `task`. The
            constructor replaces "task" and adds all missing numbers.
        start_from: The folder of a finished run. The training starts with its weights. None for new weights.
        n_envs: The number of environments that are stepped together.
        seed: The seed of all random numbers; equal seeds give equal runs.
        checkpoint_every: Steps between two checkpoints, and between two points of the learning curve.
        evaluation_episodes: The number of episodes on new layouts at each point of the learning curve, and in
            `agents.evaluate`.
        policy: `head`: "aim" for `billiards_env.sb3.AimPolicy`, with its arguments in `arguments`, or "gaussian" for
            the usual policy of Stable-Baselines3, with `hidden` and `activation`.
        ppo: Arguments of `stable_baselines3.PPO`. A pair of learning rates has the rate of the start and of the end.
            For "aim" they replace those in `billiards_env.sb3.PPO_SETTINGS`.
        learner: "ppo", or "likelihood" for `agents.likelihood`, which plays many shots of each layout, with the policy
            "aim".
        likelihood: For this learner, `layouts`, the number of layouts of an update, and `imitation`, the share of all
            shots that the first phase plays. In this phase `hits` and `own` are the numbers of random hits and of
            actions of the policy in each layout, `labels` is the largest number of shots that score in a step of the
            optimizer, and `passes` the number of steps for each update. In the second phase `samples` is the number of
            actions of the policy in each layout. `learning_rate` is a pair as in `ppo`; in the second phase it is
            halved.

    Raises:
        ValueError: If a key is unknown or a value is invalid.
        TypeError: If a value has the wrong type.
    """

    timesteps: int
    task: str | None = None
    env: dict[str, Any] = dataclasses.field(default_factory=dict)
    noise: Any = "task"
    start_from: str | None = None
    n_envs: int = 4096
    seed: int = 0
    checkpoint_every: int = 100_000
    evaluation_episodes: int = 2000
    policy: dict[str, Any] = dataclasses.field(default_factory=dict)
    ppo: dict[str, Any] = dataclasses.field(default_factory=dict)
    learner: str = "ppo"
    likelihood: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        least = {"timesteps": 0, "seed": 0, "n_envs": 1, "checkpoint_every": 1, "evaluation_episodes": 1}
        for name, bound in least.items():  # Stable-Baselines3 limits the seed
            setattr(self, name, integer(name, _as_integer(getattr(self, name)), Range(bound, 2**32 - 1)))
        if self.task is not None:
            one_of("task", self.task, tuple(FROZEN))
        task = None if self.task is None else FROZEN[self.task]
        noise: Any = self.noise
        if noise == "task":
            noise = {} if task is not None and task.noise else None
        mappings = {name: getattr(self, name) for name in ("env", "policy", "ppo", "likelihood")}
        mappings["noise"] = {} if noise is None else noise
        for name, value in mappings.items():
            if not isinstance(value, Mapping):
                raise ValueError(f"{name} = {short(value)}: expected a mapping")
        self.env = _resolved(_numbers({**({} if task is None else task.arguments), **self.env}))
        for name in noise or ():
            one_of("key of noise", name, tuple(EXECUTION_NOISE))
        self.noise = None if noise is None else EXECUTION_NOISE | _numbers(noise)
        head = self.policy.get("head", "aim")
        one_of("policy.head", head, tuple(_POLICY))
        for name in self.policy:
            one_of(f"key of policy ({head})", name, _POLICY[head])
        policy, ppo = (AIM_POLICY, AIM_PPO) if head == "aim" else (USUAL_POLICY, {})
        self.policy = {"head": head, **policy, **_numbers(self.policy)}
        for name in self.ppo:
            one_of("key of ppo", name, _PPO)
        ppo = ppo if self.learner == "ppo" else {}
        self.ppo = {**ppo, **_numbers(self.ppo)}
        one_of("learner", self.learner, LEARNERS)
        self._check_ppo()
        self._check_likelihood()

    def _check_ppo(self) -> None:
        ppo = self.ppo
        for name, value in ppo.items():
            if name in _COUNTS:
                ppo[name] = integer(f"ppo.{name}", _as_integer(value), Range(1, None))
            elif name == "normalize_advantage":
                flag(f"ppo.{name}", value)
            elif value is not None or name not in _OPTIONAL:
                for one in value if name == "learning_rate" and _is_pair(value) else [value]:
                    real(f"ppo.{name}", one, Range(0.0, 1.0 if name in _SHARES else 1e6))
        rollout, batch = self.n_envs * ppo.get("n_steps", 2048), ppo.get("batch_size", 64)
        if rollout % min(batch, rollout):
            raise ValueError(f"ppo.batch_size = {batch}: expected a divisor of n_envs * ppo.n_steps = {rollout}")

    def _check_likelihood(self) -> None:
        known = LIKELIHOOD if self.learner == "likelihood" else {}
        for name in self.likelihood:
            one_of(f"key of likelihood (learner = {self.learner!r})", name, tuple(known))
        if not known:
            return
        if self.ppo:
            raise ValueError(f"ppo = {short(self.ppo)}: expected no settings of PPO with learner = 'likelihood'")
        one_shot = 1 if self.env["goal_radius"] is not None else self.env["max_shots"]
        needed = {"policy.head": (self.policy["head"], "aim"), "env.n_players": (self.env["n_players"], 1)}
        for name, (value, expected) in (needed | {"env.max_shots": (self.env["max_shots"], one_shot)}).items():
            if value != expected:
                raise ValueError(f"{name} = {value!r}: expected {expected!r} with learner = 'likelihood'")
        settings = {**known, **_numbers(self.likelihood)}
        for name in ("layouts", "hits", "own", "labels", "passes", "samples"):
            settings[name] = integer(f"likelihood.{name}", _as_integer(settings[name]), Range(1, 1_000_000))
        real("likelihood.imitation", settings["imitation"], Range(0.0, 1.0))
        if not _is_pair(rates := settings["learning_rate"]):
            raise ValueError(f"likelihood.learning_rate = {short(rates)}: expected a pair of rates")
        for rate in rates:
            real("likelihood.learning_rate", rate, Range(0.0, 1.0))
        self.likelihood = settings
        self.n_envs = settings["layouts"]

    def to_dict(self) -> dict[str, Any]:
        """Returns the configuration as plain data: dicts, lists, strings and numbers."""
        return dataclasses.asdict(self)

    def to_yaml(self) -> str:
        """Returns the configuration as YAML, with all defaults."""
        return yaml.safe_dump(self.to_dict(), sort_keys=False)

    @classmethod
    def from_dict(cls, data: Any) -> Config:
        """Returns a configuration from plain data, for example from the content of a YAML file.

        Raises:
            ValueError, TypeError: See the class.

        Example:
            >>> Config.from_dict({"timestep": 1000})
            Traceback (most recent call last):
            ValueError: key of the settings = 'timestep': expected one of ... (did you mean 'timesteps'?)
        """
        return cls(**fields_of(cls, "the settings", data))


def rows() -> dict[str, dict[str, Any]]:
    """Returns the rows of `configs/learning.yaml` by name.

    Each has the values of `defaults`, and `plays`: the frozen tasks in which `studies.learning` measures the policy.
    """
    content = read_settings(LEARNING, "settings")
    defaults = content["defaults"]
    return {
        name: {"plays": [row["task"]], **defaults, **row, "env": {**defaults["env"], **row.get("env", {})}}
        for name, row in content["rows"].items()
    }


def load(source: str | Path, **changes: Any) -> Config:
    """Returns the configuration of a row of `configs/learning.yaml` or of a YAML file, with some values changed.

    Raises:
        ValueError: If there is no such row, the file is not YAML, or a value is invalid, see `Config`.
        OSError: If the file cannot be read.
    """
    if Path(source).suffix:
        data = read_settings(Path(source), "settings")
    else:
        known = rows()
        one_of("config", str(source), tuple(known))
        data = {key: value for key, value in known[str(source)].items() if key not in ("plays", "seeds")}
    if not isinstance(data, Mapping):
        raise ValueError(f"config = {str(source)!r}: expected settings, the file has none")
    try:
        return Config.from_dict({**data, **changes})
    except TypeError as error:
        raise ValueError(str(error)) from error


def _is_pair(value: Any) -> TypeGuard[list[Any]]:
    return isinstance(value, list) and len(value) == 2


def _as_integer(value: Any) -> Any:
    """Returns a text such as "1e6" as a whole number, if it is one."""
    value = number(value)
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _numbers(value: Any) -> Any:
    """Returns plain data with texts such as "1e6" or "1/60" as numbers."""
    if isinstance(value, Mapping):
        return {key: _numbers(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_numbers(item) for item in value]
    return number(value)


def _resolved(own: Mapping[str, Any]) -> dict[str, Any]:
    """Returns all arguments of the environment. Missing ones have their defaults, or the defaults of the task."""
    parameters = dict(inspect.signature(make_model).parameters)
    for name in ("noise", "noise_seed"):  # `noise` has its own section
        del parameters[name]
    for key in own:
        one_of("key of env", key, tuple(parameters))
    arguments = {name: own.get(name, parameter.default) for name, parameter in parameters.items()}
    integer("n_players", arguments["n_players"], Range(1, None))
    task = task_of(arguments["task"], arguments["n_players"])
    of_task = {"scene": task.scene, "layout": task.layout, "max_shots": task.max_shots}
    of_task["goal_radius"] = task.goal_radius or None
    return arguments | {name: default for name, default in of_task.items() if arguments[name] is None}
