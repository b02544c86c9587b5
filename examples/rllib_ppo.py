"""PPO of RLlib: `python examples/rllib_ppo.py` (extra `rllib`, in the environment of `make rllib`).

RLlib's own runner plays all tables in one process. It needs the autoreset mode "NextStep", so every second step of an
episode of one shot is a reset. `agents.rllib` has a runner that plays a shot in every step.
"""

from ray.rllib.algorithms.ppo import PPOConfig  # pyright: ignore[reportMissingImports]


def run(steps: int, num_envs: int = 256) -> float:
    """Trains for a number of steps. Returns the mean return of the last episodes."""
    config = (
        PPOConfig()
        .environment("billiards_env:Billiards-v0", env_config={"autoreset_mode": "NextStep"})
        .env_runners(num_env_runners=0, num_envs_per_env_runner=num_envs, gym_env_vectorize_mode="vector_entry_point")
        .training(train_batch_size_per_learner=16 * num_envs, minibatch_size=4 * num_envs, num_epochs=4, gamma=1.0)
    )
    algorithm, result = config.build_algo(), {}
    while result.get("num_env_steps_sampled_lifetime", 0) < steps:
        result = algorithm.train()
    algorithm.stop()
    return result["env_runners"]["episode_return_mean"]


if __name__ == "__main__":
    print(f"mean return: {run(100_000):.3f}")
