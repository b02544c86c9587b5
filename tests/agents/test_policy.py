import dataclasses
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
import torch

from agents.config import Config
from agents.policy import _DIRECT, Geometry, GeometryPolicy, shape
from agents.ppo import in_frame, make_model, make_vec_env, make_vector
from billiards_env.envs import BilliardsEnv
from billiards_env.players.pots import direct_pots

POCKETS = 6


def geometry(env: Any) -> tuple[Geometry, BilliardsEnv]:
    game = cast(BilliardsEnv, env.unwrapped)
    return Geometry(cast(gym.spaces.Box, game.observation_space), shape(game)), game


def pots(features: torch.Tensor) -> np.ndarray:
    """Returns the features of the shots, (m, pockets, 6), with the cuts of the action frame."""
    shots = features[:, -6 * POCKETS :].reshape(len(features), POCKETS, 6).numpy().copy()
    shots[..., 0] *= features[:, :1].numpy()
    return shots


def test_the_first_cut_pots_nearly_every_ball():
    config = Config.from_dict({"timesteps": 1, "frame": {"name": "cut"}})
    envs = in_frame(config, make_vector(config, 2000))
    observations, _ = envs.reset(seed=0)
    extractor, _ = geometry(cast(Any, envs.unwrapped).single_env)
    cuts = pots(extractor(torch.as_tensor(observations)))[:, 0, 0]
    *_, infos = envs.step(np.column_stack((cuts, np.full(2000, 0.2))))
    assert infos["final_info"]["potted"][:, 1].mean() > 0.94
    *_, infos = envs.step(np.column_stack((-cuts, np.full(2000, 0.2))))
    assert infos["final_info"]["potted"][:, 1].mean() < 0.2


def test_features_agree_with_direct_pots():
    env = gym.make("Billiards-v0")
    extractor, game = geometry(env)
    ratios = {False: [], True: []}
    for seed in range(200):
        observation, _ = env.reset(seed=seed)
        found = direct_pots(game.scene, game.targets, game.positions, game.potted, game.max_speed)
        shots = pots(extractor(torch.as_tensor(observation[None])))[0]
        way = game.positions[1] - game.positions[0]
        reach = 2 * game.scene.balls.radius[0]
        for k, pocket in enumerate(found.pocket.tolist()):
            cut = (way[1] * found.direction[k, 0] - way[0] * found.direction[k, 1]) / reach
            near = shots[np.abs(shots[:, 0] - cut) < 0.02]
            if found.tolerance[k] > 1e-3 and len(near) == 1:
                side = game.scene.table.pockets[pocket].x == 0.0
                ratios[side].append(near[0, 5] / 10 / found.tolerance[k])
    assert min(map(len, ratios.values())) > 50
    # At side pockets both reckon alike; at corners the player leaves out what the cushions lead into them.
    assert np.median(ratios[True]) == pytest.approx(1.0, abs=0.1)
    assert 3.0 < np.median(ratios[False]) < 6.0


def test_features_order_balls_by_distance_with_potted_balls_last():
    env = gym.make("Billiards-v0", n_object_balls=3, max_shots=4, observe_shots_left=True)
    extractor, _ = geometry(env)
    places = np.array([[0.0, 0.0], [0.5, 0.3], [-0.2, 0.1], [0.9, -0.2]])
    observation, _ = env.reset(options={"positions": places})
    one = extractor(torch.as_tensor(observation[None]))
    other = extractor(torch.as_tensor(env.reset(options={"positions": places[[0, 2, 3, 1]]})[0][None]))
    assert torch.equal(one, other)
    half = torch.tensor([1.27, 0.635])
    sign = one[0, 0]
    image = torch.tensor([1.0, float(sign)]) / half
    told = torch.cat((torch.ones(1), (torch.tensor(places[[0, 2, 1, 3]]).float() * image).flatten(), torch.ones(3)))
    torch.testing.assert_close(one[0, 1 : 1 + len(told)], told, rtol=0, atol=1e-6)
    assert extractor.features_dim == one.shape[1] == 1 + len(told) + 6 * POCKETS

    observation[4:6] = 1.0  # ball 2 lies in a corner pocket
    gone = extractor(torch.as_tensor(observation[None]))[0]
    left = torch.tensor(places[[0, 1, 3]]).float() * torch.tensor([1.0, float(gone[0])]) / half
    told = torch.cat((torch.ones(1), left.flatten(), torch.tensor([0.0, 0.0, 1.0, 1.0, 0.0])))
    torch.testing.assert_close(gone[1 : 1 + len(told)], told, rtol=0, atol=1e-6)
    assert not np.array_equal(pots(gone[None]), pots(one))  # these are of another ball now


@pytest.mark.parametrize("mirror", [(1, -1), (-1, 1), (-1, -1)])
def test_the_four_images_of_a_layout_have_the_same_features(mirror):
    env = gym.make("Billiards-v0", n_object_balls=2, max_shots=3)
    extractor, _ = geometry(env)
    observations = np.stack([env.reset(seed=seed)[0] for seed in range(100)])
    mirrored = observations * np.array(mirror * 3, np.float32)
    one, other = (extractor(torch.as_tensor(o)).numpy() for o in (observations, mirrored))
    turned = mirror[0] * mirror[1]
    aimed = pots(torch.as_tensor(one))[:, 0, 0] != 0  # a pot is possible
    assert aimed.sum() > 80
    np.testing.assert_array_equal(one[aimed, 0], turned * other[aimed, 0])
    np.testing.assert_allclose(one[aimed, 1:], other[aimed, 1:], atol=1e-6)


def test_geometry_is_refused_if_it_does_not_apply():
    config = {
        "timesteps": 1,
        "n_envs": 4,
        "frame": {"name": "cut"},
        "policy": {"features": "geometry"},
        "ppo": {"n_steps": 16},
    }
    carom = Config.from_dict({**config, "env": {"scene": "carom", "task": "carom"}})
    with pytest.raises(ValueError, match=r"policy.features = 'geometry' in the task 'carom': expected 'raw'"):
        make_model(carom, make_vec_env(carom))
    env = BilliardsEnv()
    table, balls = env.scene.table, env.scene.balls
    env.scene = dataclasses.replace(env.scene, balls=dataclasses.replace(balls, radius=(0.03, 0.025)))
    with pytest.raises(ValueError, match=r"balls of radii \(0.03, 0.025\): expected one radius"):
        shape(env)
    table = dataclasses.replace(table, pockets=table.pockets[:1])
    env.scene = dataclasses.replace(env.scene, balls=balls, table=table)
    with pytest.raises(ValueError, match=r"with asymmetric pockets"):
        shape(env)


def test_a_geometry_policy_mirrors_its_actions_and_its_last_layer_has_the_features():
    config = Config.from_dict(
        {
            "timesteps": 1,
            "n_envs": 4,
            "frame": {"name": "cut"},
            "policy": {"features": "geometry", "hidden": [8]},
            "ppo": {"n_steps": 16},
        }
    )
    policy = make_model(config, make_vec_env(config)).policy
    assert isinstance(policy, GeometryPolicy)
    last = cast(torch.nn.Linear, policy.action_net)
    torch.nn.init.normal_(last.weight)
    env = gym.make("Billiards-v0")
    observations = np.stack([env.reset(seed=seed)[0] for seed in range(100)])
    extractor, _ = geometry(env)
    cuts = pots(extractor(torch.as_tensor(observations)))[:, 0, 0]
    mirrored = observations * np.array([1, -1] * 2, np.float32)
    one, other = (GeometryPolicy.predict(policy, o, deterministic=True)[0] for o in (observations, mirrored))
    np.testing.assert_allclose((one * [-1, 1])[cuts != 0], other[cuts != 0], atol=1e-5)
    with torch.no_grad():
        last.weight.zero_()
        last.bias.zero_()
        last.weight[0, extractor.features_dim - 1 - 6 * POCKETS] = 0.5 / _DIRECT
    actions, _ = GeometryPolicy.predict(policy, observations, deterministic=True)
    np.testing.assert_allclose(actions, np.column_stack((0.5 * cuts, np.zeros(100))), atol=1e-6)


def test_the_mean_speed_of_a_geometry_policy_is_at_most_the_largest():
    config = Config.from_dict(
        {
            "timesteps": 1,
            "n_envs": 64,
            "frame": {"name": "cut"},
            "policy": {"features": "geometry"},
            "ppo": {"n_steps": 2},
        }
    )
    policy = make_model(config, make_vec_env(config)).policy
    with torch.no_grad():
        cast(torch.nn.Linear, policy.action_net).bias.copy_(torch.tensor([0.0, 50.0]))
    observation, _ = gym.make("Billiards-v0").reset(seed=0)
    aimed = cast(Any, policy.get_distribution(torch.as_tensor(observation[None])).distribution)
    assert aimed.mean[0, 1] == 1.0
