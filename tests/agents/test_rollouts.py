"""The arrays that a runner of RLlib records."""

import numpy as np
import pytest
import torch

from agents.config import Config
from agents.ppo import make_policy, make_vector, training_seed
from agents.rllib.rollouts import Rollouts


def config(**changes):
    return Config.from_dict(
        {
            "timesteps": 1000,
            "n_envs": 8,
            "seed": 3,
            "ppo": {"n_steps": 5, "batch_size": 8, "gae_lambda": 0.9},
            **changes,
        }
    )


def rollouts(settings, n_envs=8, first=0):
    torch.manual_seed(0)
    return Rollouts(settings, make_policy(settings), n_envs, first)


def test_runners_play_the_layouts_of_one_vector_environment():
    settings = config()
    envs = make_vector(settings, 8)
    together, _ = envs.reset(seed=training_seed(settings, 640))
    parts = [rollouts(settings, 4, first) for first in (0, 4)]
    for part in parts:
        part.seed(640)
    np.testing.assert_array_equal(together, np.concatenate([part.observations for part in parts]))
    later = rollouts(settings, 4, 0)
    later.seed(1280)
    assert not np.isin(later.observations, together).any()


def test_runners_explore_differently():
    settings = config()
    actions = []
    for first in (0, 4):
        part = rollouts(settings, 4, first)
        part.seed(0)
        part.observations[:] = 0.3
        actions.append(part.play(1)[0]["actions"])
    assert not np.isin(*actions).any()


@pytest.mark.parametrize("head", ["gaussian", "aim"])
def test_every_step_is_a_shot_with_the_numbers_of_its_policy(head):
    settings = config(policy={"head": head, **({"hidden": [8]} if head == "gaussian" else {})})
    played = rollouts(settings)
    played.seed(0)
    arrays, successes = played.play(5)
    assert len(successes) == 40  # one shot is one episode, and no step is a reset
    assert {len(array) for array in arrays.values()} == {40}
    obs, actions = torch.from_numpy(arrays["obs"]), torch.from_numpy(arrays["actions"])
    assert obs.shape[1] == 4
    with torch.no_grad():
        values, log_prob, _ = played.policy.evaluate_actions(obs, actions)
    np.testing.assert_allclose(arrays["action_logp"], log_prob, atol=1e-5)
    np.testing.assert_allclose(arrays["value_targets"] - arrays["advantages"], values[:, 0], atol=1e-5)
    penalty = settings.env["scratch_penalty"]
    np.testing.assert_allclose(arrays["value_targets"].reshape(5, 8).max(), 1 if successes.any() else 0, atol=1e-6)
    assert arrays["value_targets"].min() >= -penalty - 1e-6


def test_unfinished_episodes_use_the_value_of_the_last_state():
    slow = {"head": "aim", "arguments": {"speeds": [1e-3, 2e-3], "std_speed": [1e-3, 1e-3]}}
    settings = config(env={"max_shots": 3, "n_object_balls": 2}, policy=slow)
    played = rollouts(settings)
    played.seed(0)
    arrays, successes = played.play(1)
    assert len(successes) == 0
    state = torch.from_numpy(played.observations)
    with torch.no_grad():
        value = played.policy.predict_values(state)[:, 0].numpy()
    rewards = arrays["value_targets"] - settings.ppo["gamma"] * value
    np.testing.assert_allclose(rewards, 0, atol=1e-5)  # slow shots pot nothing


def test_advantages_agree_with_the_definition():
    settings = config(env={"max_shots": 3, "n_object_balls": 2}, ppo={"n_steps": 5, "gamma": 0.9, "gae_lambda": 0.8})
    played = rollouts(settings)
    played.seed(0)
    steps, step = [], played.envs.step

    def spy(actions):
        steps.append(step(actions))
        return steps[-1]

    played.envs.step = spy
    arrays, _ = played.play(5)
    found, values = (arrays[name].reshape(5, 8) for name in ("advantages", "value_targets"))
    values = np.vstack((values - found, played.policy.predict_values(torch.from_numpy(played.observations)).detach().T))
    for i in range(8):
        for t in range(5):
            total, weight = 0.0, 1.0
            for k in range(t, 5):
                _, rewards, terminated, truncated, _ = steps[k]
                goes_on = not (terminated[i] or truncated[i])
                total += weight * (rewards[i] + 0.9 * goes_on * values[k + 1, i] - values[k, i])
                weight *= 0.9 * 0.8 * goes_on
            assert found[t, i] == pytest.approx(total, abs=1e-5)
