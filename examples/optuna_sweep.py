"""A search for hyper-parameters with Optuna and Stable-Baselines3: `python examples/optuna_sweep.py`.

A trial trains a small PPO and returns its success on new layouts.
"""

import gymnasium as gym
import optuna  # pyright: ignore[reportMissingImports]
import torch
from stable_baselines3 import PPO

from billiards_env.bench.evaluation import evaluation_seeds, play_together
from billiards_env.sb3 import AimPolicy, SameStepVecEnv

ENV = "billiards_env:Billiards-v0"


def success(trial: optuna.Trial, steps: int, episodes: int) -> float:
    """Trains with the hyper-parameters of a trial. Returns the share of new layouts on which the ball is potted."""
    model = PPO(
        AimPolicy,
        SameStepVecEnv(gym.make_vec(ENV, num_envs=1024)),
        n_steps=1,
        batch_size=2 ** trial.suggest_int("log2_batch_size", 6, 10),
        learning_rate=trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True),
        ent_coef=trial.suggest_float("ent_coef", 1e-3, 1e-1, log=True),
        gamma=1.0,
        policy_kwargs={"exploration": steps // 2},
        seed=trial.number,
        device="cpu",
    ).learn(steps)
    envs = gym.make_vec(ENV, num_envs=episodes)
    seeds = evaluation_seeds(0, episodes).tolist()  # training uses none of these layouts
    return play_together(envs, lambda seen: model.predict(seen, deterministic=True)[0], seeds)["success_rate"]


def run(steps: int, trials: int = 2, episodes: int = 1000) -> optuna.Study:
    """Divides a number of steps between trials. Returns the study; `best_params` has the best hyper-parameters."""
    torch.set_num_threads(1)  # small networks are faster on one thread
    study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=0))
    study.optimize(lambda trial: success(trial, steps // trials, episodes), n_trials=trials)
    return study


if __name__ == "__main__":
    best = run(1_000_000, trials=20)
    print(f"success {best.best_value:.1%} with {best.best_params}")
