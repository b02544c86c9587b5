"""The settings of a training, and how they are read from YAML and checked.

`configs/learning.yaml` holds the settings of the published results: a row for each task. A training reads a row, or a
file with the same keys.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from agents.learner import whole
from agents.learners import LEARNERS
from billiards_env.bench.frozen import FROZEN
from billiards_env.envs import make_model
from billiards_env.envs.tasks import task_of
from billiards_env.settings import read_settings
from billiards_env.shots.noise import EXECUTION_NOISE
from billiards_env.support.checks import Range, entry_of, fields_of, integer, key_of, number, one_of, short, short_name

LEARNING = Path(__file__).resolve().parent.parent / "configs" / "learning.yaml"

AIM_POLICY: dict[str, Any] = {"arguments": {}}
USUAL_POLICY: dict[str, Any] = {"hidden": [64, 64], "activation": "tanh"}

_POLICY = {"aim": ("head", "arguments"), "gaussian": ("head", "hidden", "activation")}


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
        learner: A learner of `agents.learners`: "ppo", "likelihood", or "module:name" for one that a module registers.
        settings: The settings of the learner. In the form of `to_dict` they are a section with the name of the learner.
            The constructor adds all missing ones that have a default.

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
    learner: str = "ppo"
    settings: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        least = {"timesteps": 0, "seed": 0, "n_envs": 1, "checkpoint_every": 1, "evaluation_episodes": 1}
        for name, bound in least.items():  # Stable-Baselines3 limits the seed
            setattr(self, name, whole(bound, 2**32 - 1)(name, getattr(self, name)))
        if self.task is not None:
            one_of("task", self.task, tuple(FROZEN))
        task = None if self.task is None else FROZEN[self.task]
        noise: Any = self.noise
        if noise == "task":
            noise = {} if task is not None and task.noise else None
        learner, section = entry_of("learner", self.learner, LEARNERS), short_name(self.learner)
        if section in vars(self):
            raise ValueError(f"learner = {self.learner!r}: expected a learner whose name is no key of the settings")
        mappings = {"env": self.env, "policy": self.policy, section: self.settings}
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
        self.policy = {"head": head, **(AIM_POLICY if head == "aim" else USUAL_POLICY), **_numbers(self.policy)}
        for name in self.settings:
            one_of(f"key of {section}", name, tuple(learner.settings))
        defaults = {name: setting.default for name, setting in learner.settings.items() if setting.default is not None}
        settings = {**defaults, **_numbers(self.settings)}
        self.settings = {name: learner.settings[name].check(f"{section}.{name}", settings[name]) for name in settings}
        learner.check(self)

    def to_dict(self) -> dict[str, Any]:
        """Returns the configuration as plain data: dicts, lists, strings and numbers."""
        data = dataclasses.asdict(self)
        settings = data.pop("settings")
        return data | {short_name(self.learner): settings}

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
        if not isinstance(data, Mapping):
            raise TypeError(f"the settings = {short(data)}: expected a mapping")
        learner = data.get("learner", cls.learner)
        section = key_of("learner", learner, LEARNERS)
        keys = [field.name for field in dataclasses.fields(cls) if field.name != "settings"]
        for key, value in data.items():
            one_of("key of the settings", key, (*keys, *LEARNERS))
            if value != {} and key not in (*keys, section):
                raise ValueError(f"{key} = {short(value)}: expected nothing with learner = {learner!r}")
        own = {key: data[key] for key in keys if key in data}
        return cls(**fields_of(cls, "the settings", {**own, "settings": data.get(section, {})}))


def rows() -> dict[str, dict[str, Any]]:
    """Returns the rows of `configs/learning.yaml` by name.

    Each has the values of `defaults`, and `plays`: the frozen tasks in which `studies.learning` measures the policy.
    """
    content = read_settings(LEARNING, "settings")
    defaults = content["defaults"]
    return {
        name: {
            "plays": [row["task"]] if "task" in row else [],
            **defaults,
            **row,
            "env": {**defaults["env"], **row.get("env", {})},
        }
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
    of_task = {"scene": task.scene, "layout": task.layout, "max_shots": task.max_shots, "action": task.action}
    of_task["goal_radius"] = task.goal_radius or None
    return arguments | {name: default for name, default in of_task.items() if arguments[name] is None}
