"""PPO on arrays, built from the parts of RLlib's new API stack."""

# pyright: reportMissingImports=false

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from ray.rllib.algorithms.ppo import PPO, PPOConfig
from ray.rllib.core import DEFAULT_MODULE_ID
from ray.rllib.core.columns import Columns
from ray.rllib.core.rl_module.apis import ValueFunctionAPI
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.core.rl_module.torch import TorchRLModule
from ray.rllib.env import INPUT_ENV_SINGLE_SPACES, INPUT_ENV_SPACES
from ray.rllib.env.env_runner import EnvRunner
from ray.rllib.policy.sample_batch import MultiAgentBatch, SampleBatch
from ray.rllib.utils.checkpoints import Checkpointable
from ray.rllib.utils.metrics import ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME
from stable_baselines3.common.utils import set_random_seed
from torch import Tensor

from agents.config import Config
from agents.ppo import ENV_ID, learning_rates, make_env, make_policy, training_seed
from agents.rllib.rollouts import Rollouts, as_tensors
from billiards_env.sb3.aim_policy import AimPolicy, by_value

_STEPS = (ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME)


class AimModule(TorchRLModule, ValueFunctionAPI):
    """`AimPolicy` as an RLModule. Its weights are the weights of the policy, with the prefix "policy."."""

    policy: AimPolicy

    def setup(self) -> None:
        """Makes the untrained policy of the configuration, with the same weights in every process."""
        config = Config.from_dict(self.model_config["config"])
        with torch.random.fork_rng(devices=()):
            torch.manual_seed(config.seed)
            policy = make_policy(config)
        assert isinstance(policy, AimPolicy)
        self.policy = policy

    def _forward(self, batch: dict[str, Any], **kwargs: Any) -> dict[str, Any]:
        mixtures, values = self.policy.mixtures_and_values(batch[Columns.OBS])
        return {Columns.ACTION_DIST_INPUTS: (mixtures, values), Columns.EMBEDDINGS: values}

    def compute_values(self, batch: dict[str, Any], embeddings: Tensor | None = None) -> Tensor:
        """Returns the values (m,) of the states of a batch."""
        return self._forward(batch)[Columns.EMBEDDINGS] if embeddings is None else embeddings

    def get_inference_action_dist_cls(self) -> Any:
        """Returns an object whose method `from_logits` returns the distribution of the actions."""
        return _Distribution(self.policy)


class _Distribution(NamedTuple):
    """The distribution of a policy with the names of RLlib's methods. `outputs` are the mixtures and the values."""

    policy: AimPolicy
    outputs: Any = None

    def from_logits(self, outputs: Any) -> _Distribution:
        return self._replace(outputs=outputs)

    def logp(self, actions: Tensor) -> Tensor:
        mixtures, values = self.outputs
        return by_value(mixtures.log_prob(actions), values)

    def entropy(self) -> Tensor:
        return self.policy.entropy_factor * self.outputs[0].entropy()


class ArrayRunner(EnvRunner, Checkpointable):
    """An EnvRunner that plays one vector environment in one thread and returns arrays, see `Rollouts`.

    RLlib's own runner keeps a Python object for each environment and episode, and needs a step between two episodes.
    """

    rollouts: Rollouts | None = None

    def __init__(self, *, config: Any, **kwargs: Any) -> None:
        super().__init__(config=config, **kwargs)
        torch.set_num_threads(1)
        torch.set_flush_denormal(True)
        if self.worker_index or not self.config.num_env_runners:  # the process of the command plays without runners
            self.make_env()

    def make_module(self) -> None:
        """Does nothing: `Rollouts` has the policy."""

    def make_env(self) -> None:
        """Makes the environments of this runner."""
        n_envs = self.config.num_envs_per_env_runner
        self.rollouts = Rollouts(settings_of(self.config), n_envs, max(self.worker_index - 1, 0) * n_envs)

    def sample(self, *, weights: Any, steps: int, seed: bool, **kwargs: Any) -> tuple[int, dict[str, Any], list[bool]]:
        """Plays a part of a batch.

        Args:
            weights: The state of the policy module.
            steps: The number of steps of the training so far.
            seed: Whether to seed the random generators. A new runner seeds them in any case.
            kwargs: Not used.

        Returns:
            The index of this runner, and the result of `Rollouts.play`.
        """
        assert self.rollouts is not None
        if seed or not self.rollouts.seeded:
            self.rollouts.seed(steps)
        return self.worker_index, *self.rollouts.collect(as_tensors(weights))

    def get_spaces(self) -> dict[str, Any]:
        """Returns the spaces of observations and actions, as `(observations, actions)`."""
        spaces = self.config.observation_space, self.config.action_space
        return {INPUT_ENV_SPACES: spaces, INPUT_ENV_SINGLE_SPACES: spaces, DEFAULT_MODULE_ID: spaces}

    def get_state(self, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """Returns an empty state: the weights are in the learners, and `sample` sets them."""
        return {}

    def set_state(self, state: dict[str, Any]) -> None:
        """Does nothing, see `get_state`."""

    def get_ctor_args_and_kwargs(self) -> tuple[tuple[()], dict[str, Any]]:
        """Returns the arguments of the construction."""
        return (), {"config": self.config}

    def assert_healthy(self) -> None:
        """Raises an AssertionError if the runner has no environments."""
        assert self.rollouts is not None

    def stop(self) -> None:
        """Closes the environments."""
        if self.rollouts is not None and self.rollouts.model.env is not None:
            self.rollouts.model.env.close()


class ArrayPPO(PPO):
    """PPO that trains on the arrays of `ArrayRunner`.

    Attributes:
        seed_next: Whether the next step seeds all random generators. The training then depends only on the weights, the
            state of the optimizer, and the number of steps.
        successes: The success of each episode that ended in the last step.
    """

    seed_next = True
    successes: tuple[bool, ...] = ()

    @property
    def steps(self) -> int:
        """The number of steps of the training."""
        return int(self.metrics.peek(_STEPS, default=0))

    def training_step(self) -> None:
        """Plays a batch, updates the policy with it, and counts its steps."""
        config, steps, seed, self.seed_next = settings_of(self.config), self.steps, self.seed_next, False

        def prepare(learner: Any) -> None:
            learner.module[DEFAULT_MODULE_ID].unwrapped().policy.set_shots(steps)
            if seed:
                set_random_seed(training_seed(config, steps))

        self.learner_group.foreach_learner(prepare)
        arrays = self._sample(steps, seed)
        gained = arrays["advantages"]
        arrays["advantages"] = (gained - gained.mean()) / (gained.std() + 1e-8)
        # PPO of RLlib also needs the old distributions, for a penalty that is not used here.
        arrays[Columns.ACTION_DIST_INPUTS] = np.zeros((len(gained), 0), np.float32)
        self.learner_group.update(
            batch=MultiAgentBatch({DEFAULT_MODULE_ID: SampleBatch(arrays)}, env_steps=len(gained)),
            timesteps={NUM_ENV_STEPS_SAMPLED_LIFETIME: steps + len(gained)},
            num_epochs=self.config.num_epochs,
            minibatch_size=self.config.minibatch_size,
            shuffle_batch_per_epoch=True,
        )
        self.metrics.log_value(_STEPS, len(gained), reduce="lifetime_sum")

    def _sample(self, steps: int, seed: bool) -> dict[str, Any]:
        """Returns a batch from all runners. Runners that work replace the part of one that does not."""
        weights, size = self.learner_group.get_weights()[DEFAULT_MODULE_ID], self.config.total_train_batch_size
        parts: list[tuple[int, dict[str, Any], list[bool]]] = []
        if not self.config.num_env_runners:
            parts.append(self.env_runner.sample(weights=weights, steps=steps, seed=seed))
        while (have := sum(len(part[1]["advantages"]) for part in parts)) < size:
            collected = self.env_runner_group.foreach_env_runner(
                "sample", kwargs={"weights": weights, "steps": steps + have, "seed": seed}, local_env_runner=False
            )
            parts += sorted(collected, key=lambda part: part[0])
            seed = False
            self.restore_env_runners(self.env_runner_group)
        self.successes = tuple(success for part in parts for success in part[2])
        return {name: np.concatenate([part[1][name] for part in parts])[:size] for name in parts[0][1]}

    def restore_env_runners(self, env_runner_group: Any) -> list[int]:
        """Uses the replaced runners again and returns their indices. They need no state, see `ArrayRunner.sample`."""
        return env_runner_group.probe_unhealthy_env_runners()


def settings_of(config: Any) -> Config:
    """Returns the configuration of `agents.train` in one of RLlib."""
    return Config.from_dict(config.rl_module_spec.model_config["config"])


def algorithm_config(config: Config, runners: int) -> PPOConfig:
    """Returns RLlib's configuration of a training.

    Args:
        config: The configuration.
        runners: The number of processes that play. They share the `n_envs` environments. 0 if this process plays.

    Raises:
        ValueError: If the environments cannot be shared, or the policy is not `AimPolicy`.
    """
    ppo, players = config.settings, max(runners, 1)
    if (unsupported := (config.policy["head"], config.start_from, config.learner)) != ("aim", None, "ppo"):
        raise ValueError(f"policy.head, start_from, learner = {unsupported}: expected 'aim', None and 'ppo' with RLlib")
    if runners < 0 or config.n_envs % players:
        raise ValueError(f"runners = {runners}: expected a divisor of n_envs = {config.n_envs}")
    for name in ("target_kl", "clip_range_vf"):
        if ppo.get(name) is not None:
            raise ValueError(f"ppo.{name} = {ppo[name]}: expected None with RLlib")
    env = make_env(config)
    first, last = learning_rates(config)
    return (
        PPOConfig(algo_class=ArrayPPO)
        .environment(f"billiards_env:{ENV_ID}", observation_space=env.observation_space, action_space=env.action_space)
        .env_runners(
            env_runner_cls=ArrayRunner,
            num_env_runners=runners,
            num_envs_per_env_runner=config.n_envs // players,
            rollout_fragment_length=ppo["n_steps"],
            merge_env_runner_states=False,
            broadcast_env_runner_states=False,
        )
        .rl_module(rl_module_spec=RLModuleSpec(module_class=AimModule, model_config={"config": config.to_dict()}))
        .training(
            lr=[[0, first], [max(config.timesteps, 1), last]],
            train_batch_size_per_learner=config.n_envs * ppo["n_steps"],
            minibatch_size=ppo["batch_size"],
            num_epochs=ppo["n_epochs"],
            clip_param=ppo.get("clip_range", 0.2),
            use_kl_loss=False,
            vf_loss_coeff=ppo.get("vf_coef", 0.5),
            vf_clip_param=float("inf"),
            entropy_coeff=ppo["ent_coef"],
            grad_clip=ppo["max_grad_norm"],
            grad_clip_by="global_norm",
        )
        .debugging(seed=config.seed, log_level="ERROR")
        .fault_tolerance(delay_between_env_runner_restarts_s=1.0, env_runner_health_probe_timeout_s=0.5)
    )
