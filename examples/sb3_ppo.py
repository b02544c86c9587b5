"""PPO of Stable-Baselines3 on 64 tables, with curves for tensorboard: `python examples/sb3_ppo.py`.

The learning curves are in `runs/sb3_ppo`: `tensorboard --logdir runs`.
"""

import gymnasium as gym
from stable_baselines3 import PPO

from billiards_env.sb3 import MixturePolicy, SameStepVecEnv


def run(steps: int, logs: str | None = "runs/sb3_ppo") -> PPO:
    """Trains for a number of steps, and writes curves into the folder `logs`. Returns the model."""
    envs = SameStepVecEnv(gym.make_vec("billiards_env:Billiards-v0", num_envs=64))
    model = PPO(
        MixturePolicy,  # a mixture of Gaussians over the pots that geometry finds; "MlpPolicy" works too
        envs,
        n_steps=16,
        batch_size=256,
        gamma=1.0,
        policy_kwargs={"head": "pots"},
        tensorboard_log=logs,
        device="cpu",
    )
    return model.learn(steps)


if __name__ == "__main__":
    run(100_000).save("policy.zip")
