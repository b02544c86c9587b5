"""Behaviour cloning from a dataset of Minari: `python examples/dataset_cloning.py` (extra `train`).

`pip install 'minari[create,hdf5]'` installs Minari. The policy observes the positions of the balls alone.
"""

import tempfile
from unittest import mock

import gymnasium as gym
import minari  # pyright: ignore[reportMissingImports]
import numpy as np
import torch
from stable_baselines3 import PPO

from billiards_env.bench.evaluation import evaluation_seeds, play_episodes, play_together, steps
from billiards_env.bench.frozen import FROZEN
from billiards_env.players.env_player import acting
from billiards_env.players.named import find_player
from billiards_env.sb3 import AimPolicy, SameStepVecEnv


def record(task: str, player: str, episodes: int, dataset_id: str):
    """Plays episodes of a frozen task, such as "Pot1-v0", and returns their dataset in the folder of Minari.

    The actions are those of the player, without the noise of the task. Episode k has the seed k.
    """
    env = minari.DataCollector(gym.make(f"Billiards/{task}"))
    act = acting(find_player(player, env), env, FROZEN[task].execution_noise, seed=0)
    for k in range(episodes):
        for _ in steps(env, lambda seen: np.asarray(act(seen), np.float32), k):
            pass
    dataset = env.create_dataset(dataset_id, algorithm_name=player)
    env.close()
    return dataset


def clone(data, epochs: int = 10) -> PPO:
    """Returns a policy that is trained to maximise the likelihood of the actions of a dataset."""
    env = data.recover_environment()  # Billiards/Pot1-v0
    envs = SameStepVecEnv(gym.make_vec(env.spec.id, num_envs=1))
    model = PPO(AimPolicy, envs, learning_rate=1e-3, device="cpu")
    episodes = list(data.iterate_episodes())
    observations = torch.cat([torch.as_tensor(episode.observations[:-1]) for episode in episodes])
    actions = torch.cat([torch.as_tensor(episode.actions) for episode in episodes])
    for _ in range(epochs):
        for rows in torch.randperm(len(actions)).split(256):
            log_density = model.policy.get_distribution(observations[rows]).log_prob(actions[rows])
            model.policy.optimizer.zero_grad()
            (-log_density.mean()).backward()
            model.policy.optimizer.step()
    return model


def run(shots: int, episodes: int = 1000) -> tuple[float, float]:
    """Writes a dataset into a temporary folder. Returns the success of the clone and of its teacher on new layouts."""
    with tempfile.TemporaryDirectory() as folder, mock.patch.dict("os.environ", MINARI_DATASETS_PATH=folder):
        model = clone(record("Pot1-v0", "geometric", shots, "billiards/pot1/geometric-v0"))
    seeds, env = evaluation_seeds(0, episodes).tolist(), gym.make("Billiards/Pot1-v0")
    envs = gym.make_vec("Billiards/Pot1-v0", num_envs=episodes)
    cloned = play_together(envs, lambda seen: model.predict(seen, deterministic=True)[0], seeds)
    return cloned["success_rate"], play_episodes(env, acting(find_player("geometric", env), env), seeds)["success_rate"]


if __name__ == "__main__":
    print("success of the clone {:.1%} and of the teacher {:.1%}".format(*run(5000)))
