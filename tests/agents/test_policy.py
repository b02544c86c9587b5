import dataclasses
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3.common.torch_layers import MlpExtractor

from agents.config import Config
from agents.policy import Geometry, ShortcutPolicy, shape
from agents.pots import direct_pots
from agents.ppo import make_model, make_vec_env, make_vector
from billiards_env.envs import BilliardsEnv

POCKETS = 6


def geometry(env: Any) -> tuple[Geometry, BilliardsEnv]:
    game = cast(BilliardsEnv, env.unwrapped)
    return Geometry(cast(gym.spaces.Box, game.observation_space), shape(game)), game


def pots(features: torch.Tensor) -> np.ndarray:
    """(m, pockets, 6) the shots that features describe."""
    return features[:, -6 * POCKETS :].reshape(len(features), POCKETS, 6).numpy()


def test_the_first_cut_told_pots_nearly_every_ball():
    envs = make_vector(Config.from_dict({"timesteps": 1, "frame": {"name": "cut"}}), 2000)
    observations, _ = envs.reset(seed=0)
    extractor, _ = geometry(cast(Any, envs.unwrapped).single_env)
    cuts = pots(extractor(torch.as_tensor(observations)))[:, 0, 0]
    *_, infos = envs.step(np.column_stack((cuts, np.full(2000, 0.2))))
    assert infos["final_info"]["potted"][:, 1].mean() > 0.93
    *_, infos = envs.step(np.column_stack((-cuts, np.full(2000, 0.2))))
    assert infos["final_info"]["potted"][:, 1].mean() < 0.2


def test_features_agree_with_the_ghost_ball_player():
    env = gym.make("Billiards-v0")
    extractor, game = geometry(env)
    ratios = []
    for seed in range(50):
        observation, _ = env.reset(seed=seed)
        found = direct_pots(game.scene, game.targets, game.positions, game.potted, game.max_speed)
        shots = pots(extractor(torch.as_tensor(observation[None])))[0]
        way = game.positions[1] - game.positions[0]
        reach = 2 * game.scene.balls.radius[0]
        cuts = (way[1] * found.direction[:, 0] - way[0] * found.direction[:, 1]) / reach
        if len(cuts):
            best = np.argmax(found.tolerance)
            near = shots[np.abs(shots[:, 0] - cuts[best]) < 0.1]
            ratios.append(near[:, 5].max() / 200 / found.tolerance[best] if len(near) else 0.0)
    assert len(ratios) == 50
    assert np.median(ratios) == pytest.approx(1.0, abs=0.15)
    assert np.mean(np.array(ratios) > 0.7) > 0.8


def test_balls_come_nearest_first_and_those_potted_last():
    env = gym.make("Billiards-v0", n_object_balls=3, max_shots=4, observe_shots_left=True)
    extractor, _ = geometry(env)
    places = np.array([[0.0, 0.0], [0.5, 0.3], [-0.2, 0.1], [0.9, -0.2]])
    observation, _ = env.reset(options={"positions": places})
    one = extractor(torch.as_tensor(observation[None]))
    other = extractor(torch.as_tensor(env.reset(options={"positions": places[[0, 2, 3, 1]]})[0][None]))
    assert torch.equal(one, other)
    half = torch.tensor([1.27, 0.635])
    told = torch.cat((torch.ones(1), torch.tensor(places[[0, 2, 1, 3]]).float().div(half).flatten(), torch.ones(3)))
    torch.testing.assert_close(one[0, : len(told)], told, rtol=0, atol=1e-6)
    assert extractor.features_dim == one.shape[1] == len(told) + 6 * POCKETS

    observation[4:6] = 1.0  # ball 2 lies in a corner pocket
    gone = extractor(torch.as_tensor(observation[None]))[0]
    told = torch.cat((told[:3], told[5:9], torch.tensor([0.0, 0.0, 1.0, 1.0, 0.0])))
    torch.testing.assert_close(gone[: len(told)], told, rtol=0, atol=1e-6)
    assert not np.array_equal(pots(gone[None]), pots(one))  # these are of another ball now


def test_a_mirrored_table_has_opposite_cuts():
    env = gym.make("Billiards-v0")
    extractor, _ = geometry(env)
    observations = np.stack([env.reset(seed=seed)[0] for seed in range(100)])
    mirrored = observations * np.array([1, -1] * 2, np.float32)
    one, other = (pots(extractor(torch.as_tensor(o))) for o in (observations, mirrored))
    np.testing.assert_allclose(one * np.array([-1, 1, 1, 1, 1, 1]), other, atol=1e-6)


def test_geometry_is_refused_where_it_does_not_apply():
    config = {"timesteps": 1, "n_envs": 4, "policy": {"features": "geometry"}, "ppo": {"n_steps": 16}}
    carom = Config.from_dict({**config, "env": {"scene": "carom", "task": "carom"}})
    with pytest.raises(ValueError, match=r"policy.features = 'geometry' on a table without pockets: expected 'raw'"):
        make_model(carom, make_vec_env(carom))
    env = BilliardsEnv()
    balls = dataclasses.replace(env.scene.balls, radius=(0.03, 0.025))
    env.scene = dataclasses.replace(env.scene, balls=balls)
    with pytest.raises(ValueError, match=r"balls of radii \(0.03, 0.025\): expected one radius"):
        shape(env)


def test_the_shortcut_feeds_the_features_to_the_last_layer():
    config = Config.from_dict(
        {"timesteps": 1, "n_envs": 4, "policy": {"hidden": [8], "shortcut": True}, "ppo": {"n_steps": 16}}
    )
    policy = make_model(config, make_vec_env(config)).policy
    assert isinstance(policy, ShortcutPolicy)
    weights = torch.zeros(2, 8 + 4)
    weights[0, 8 + 2] = 1.0
    with torch.no_grad():
        # The features come first.
        last = cast(torch.nn.Linear, policy.action_net)
        last.weight.copy_(weights.roll(-8, 1))
        last.bias.zero_()
    observations = np.random.default_rng(0).uniform(-1, 1, (5, 4)).astype(np.float32)
    actions, _ = policy.predict(observations, deterministic=True)
    np.testing.assert_allclose(actions, np.column_stack((observations[:, 2], np.zeros(5))), atol=1e-7)
    assert not isinstance(policy.mlp_extractor, MlpExtractor)
