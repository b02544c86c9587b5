"""Policies over the velocity of the cue ball, one for each head."""

import math
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.utils import set_random_seed
from torch import Tensor

from agents import config
from agents.config import Config
from agents.ppo import make_model, make_vec_env
from billiards_env.envs import BilliardsEnv
from billiards_env.envs.actions import cue_strike
from billiards_env.players.pots import Tables, find_pots
from billiards_env.sb3.cue_parts import cue_of, cue_parts, turned
from billiards_env.sb3.mixture import NEVER, Components, MixtureDistribution
from billiards_env.sb3.policy import HEADS, MixturePolicy
from billiards_env.sb3.pot_head import FeatureBuffer, PotFeatures

MIRRORS = [(1, -1), (-1, 1), (-1, -1)]
SET = ("log_along", "log_across")  # names of the standard deviations that `set_std` sets


def layouts(count: int, **env: Any) -> np.ndarray:
    """Returns the observations of random layouts, (count, size)."""
    envs = gym.make_vec("Billiards-v0", num_envs=count, **env)
    observations, _ = envs.reset(seed=0)
    envs.close()
    return observations


def make(head: str, **env: Any) -> MixturePolicy:
    """Returns an untrained policy for the environment."""
    game = gym.make("Billiards-v0", **env)
    spaces_ = game.observation_space, game.action_space
    return MixturePolicy(*spaces_, lambda _: 1e-3, env=env, head=head, components=5, net_arch=[16])


def disturbed(head: str, **env: Any) -> MixturePolicy:
    """Returns a policy with random weights, so that its shots depend on all networks."""
    changed, rng = make(head, **env), torch.Generator().manual_seed(1)
    with torch.no_grad():
        for name, weights in changed.named_parameters():
            if "log_" not in name:
                weights.add_(0.3 * torch.randn(weights.shape, generator=rng))
    return changed


def components(actor: ActorCriticPolicy, observations: np.ndarray) -> Components:
    """Returns the components of a policy on each layout."""
    with torch.no_grad():
        return cast(MixtureDistribution, actor.get_distribution(torch.as_tensor(observations))).components


def train(head: str, env: dict[str, Any] | None = None, **arguments: Any) -> PPO:
    """Returns a model of Stable-Baselines3 after three updates in the environment with the arguments `env`."""
    mixture = {"head": head, "components": 3, "env": env}
    kind, kwargs = ("MlpPolicy", {}) if head == "gaussian" else (MixturePolicy, mixture)
    model = PPO(
        kind,
        gym.make("Billiards-v0", **(env or {})),
        n_steps=16,
        batch_size=8,
        n_epochs=1,
        seed=0,
        device="cpu",
        policy_kwargs={"net_arch": [8], **kwargs, **arguments},
    )
    return model.learn(48)


@pytest.fixture(scope="module", params=("gaussian", *HEADS))
def learned(request) -> PPO:
    """Returns a model with each head after a few updates."""
    return train(request.param)


def test_the_configuration_and_the_policy_have_the_same_heads():
    assert ("aim", "gaussian", *HEADS) == config.HEADS


def test_ppo_trains_in_the_plain_environment_and_its_actions_are_velocities(learned):
    assert all(bool(torch.isfinite(weights).all()) for weights in learned.policy.parameters())
    env = gym.make("Billiards-v0")
    game = cast(Any, env.unwrapped)
    for seed in range(10):
        observation, _ = env.reset(seed=seed)
        for deterministic in (True, False):
            action, _ = learned.predict(observation, deterministic=deterministic)
            assert env.action_space.contains(action)
        way = game.max_speed * learned.predict(observation, deterministic=True)[0].astype(float)
        *_, info = env.step(learned.predict(observation, deterministic=True)[0])
        assert 0 < np.hypot(*way) <= math.sqrt(2) * game.max_speed
        assert info["n_events"] > 0


def test_updates_change_the_weights_of_actor_and_critic(learned):
    begun = PPO(learned.policy_class, "Billiards-v0", seed=0, device="cpu", policy_kwargs=learned.policy_kwargs)
    changed = [
        name
        for (name, old), new in zip(begun.policy.named_parameters(), learned.policy.parameters(), strict=True)
        if not torch.equal(old, new)
    ]
    assert any("value_net" in name for name in changed)
    assert any("value_net" not in name and "log_" not in name for name in changed)
    assert any("log_" in name for name in changed)  # the standard deviations are learned


def test_a_policy_survives_saving_and_loading(learned, tmp_path):
    observations = layouts(30)
    expected, _ = learned.predict(observations, deterministic=True)
    learned.save(tmp_path / "model")
    learned.policy.save(tmp_path / "policy")
    loaded = PPO.load(tmp_path / "model", device="cpu")
    alone = type(learned.policy).load(tmp_path / "policy", device="cpu")
    for actor in (loaded, alone):
        np.testing.assert_array_equal(actor.predict(observations, deterministic=True)[0], expected)
    for weights in (loaded.policy.state_dict(), alone.state_dict()):
        assert weights.keys() == learned.policy.state_dict().keys()
        assert all(torch.equal(weights[name], value) for name, value in learned.policy.state_dict().items())
    observation, _ = gym.make("Billiards-v0").reset(seed=0)
    assert loaded.predict(observation)[0].shape == (2,)


def test_a_loaded_model_with_a_feature_buffer_is_trained_further(tmp_path):
    settings = pots_config()
    make_model(settings, make_vec_env(settings)).save(tmp_path / "model")
    loaded = PPO.load(tmp_path / "model", env=make_vec_env(settings), device="cpu")
    before = [weights.clone() for weights in loaded.policy.parameters()]
    loaded.learn(32)
    assert not all(torch.equal(old, new) for old, new in zip(before, loaded.policy.parameters(), strict=True))


def test_the_density_is_that_of_the_velocity(learned):
    observations = torch.as_tensor(layouts(40))
    with torch.no_grad():
        actions, values, log_prob = learned.policy(observations)
        distribution = learned.policy.get_distribution(observations)
        again, evaluated, _ = learned.policy.evaluate_actions(observations, actions)
    torch.testing.assert_close(distribution.log_prob(actions), log_prob)
    torch.testing.assert_close(evaluated, log_prob)
    torch.testing.assert_close(again, values)
    assert torch.equal(learned.policy.predict_values(observations), again)


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize(
    "env",
    [
        {},
        {"n_object_balls": 3, "max_shots": 4, "observe_shots_left": True},
        {"action": "strike"},
        {"task": "position", "action": "strike"},
    ],
    ids=["plain", "three balls", "strike", "position"],
)
def test_mirrored_layouts_have_mirrored_shots(head, env):
    actor, observations = disturbed(head, **env), layouts(100, **env)
    shots, balls = actor.predict(observations, deterministic=True)[0], 1 + env.get("n_object_balls", 1)
    points = balls + (env.get("task") == "position")
    table = torch.as_tensor(observations)
    assert len(np.unique(shots, axis=0)) == 100
    with torch.no_grad():
        distribution, value = actor.get_distribution(table), actor.predict_values(table)
        actions = distribution.sample()
        for mirror in MIRRORS:
            mirrored, signs = observations.copy(), np.array(mirror, np.float32)
            mirrored[:, : 2 * points] *= np.tile(signs, points)
            of_actions = np.array([*mirror, mirror[0] * mirror[1], 1, 1], np.float32)[: shots.shape[1]]
            np.testing.assert_allclose(actor.predict(mirrored, deterministic=True)[0], shots * of_actions, atol=1e-5)
            image = torch.as_tensor(mirrored)
            log_prob = actor.get_distribution(image).log_prob(actions * torch.as_tensor(of_actions))
            torch.testing.assert_close(log_prob, distribution.log_prob(actions), rtol=1e-3, atol=1e-2)
            torch.testing.assert_close(actor.predict_values(image), value, rtol=0, atol=1e-4)


def test_the_shots_of_the_head_pots_do_not_depend_on_the_order_of_the_balls():
    env = {"n_object_balls": 3, "max_shots": 4}
    actor, observations = disturbed("pots", **env), layouts(100, **env)
    observations[:30, 4:6] = 1.0  # ball 2 is potted
    shots, _ = actor.predict(observations, deterministic=True)
    for order in ((1, 3, 2), (2, 3, 1), (3, 2, 1)):
        renumbered = observations.reshape(-1, 4, 2)[:, [0, *order]].reshape(-1, 8)
        np.testing.assert_allclose(actor.predict(renumbered, deterministic=True)[0], shots, atol=1e-5)


def with_potted_balls(balls: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns 200 layouts in which at least one object ball is left, (200, size), and whether each ball is in play."""
    observations, rng = layouts(200, n_object_balls=balls, max_shots=2), np.random.default_rng(0)
    playing = rng.random((200, 1 + balls)) < 0.5
    playing[:, 0] = True
    playing[np.arange(200), rng.integers(1, 1 + balls, 200)] = True
    positions = observations.reshape(200, -1, 2)
    positions[~playing] = rng.choice([[1.0, 1.0], [-1.0, 1.0], [0.0, -1.0]], (~playing).sum())
    return positions.reshape(200, -1), playing


@pytest.mark.parametrize("balls", [1, 3, 15])
@pytest.mark.parametrize("head", ["hits", "pots"])
def test_potted_balls_are_never_aimed_at(head, balls):
    env = {"n_object_balls": balls, "max_shots": 2}
    actor, (observations, playing) = make(head, **env), with_potted_balls(balls)
    found, game = components(actor, observations), cast(BilliardsEnv, gym.make("Billiards-v0", **env).unwrapped)
    size = np.array([game.scene.table.length, game.scene.table.width]) / 2
    positions = observations.reshape(200, -1, 2) * size
    ways = positions[:, 1:] - positions[:, :1]
    dx, dy = (part.numpy()[..., None] for part in (found.dx, found.dy))
    ahead = ways[:, None, :, 0] * dx + ways[:, None, :, 1] * dy
    aside = np.abs(ways[:, None, :, 1] * dx - ways[:, None, :, 0] * dy)
    reach = 2 * game.scene.balls.radius[0]
    hit: Any = (ahead > 0) & (aside < 1.05 * reach) & playing[:, None, 1:]
    exists = (found.logit != NEVER).numpy()
    assert exists.any(axis=1).all()
    assert np.any(hit, axis=2)[exists].all()
    if head == "hits":
        assert exists.sum() == 5 * playing[:, 1:].sum()
    chosen = np.hypot(*actor.predict(observations, deterministic=True)[0].T)
    assert (chosen > 0).all()


@pytest.mark.parametrize("balls", [1, 3])
def test_the_position_of_a_potted_ball_does_not_change_the_shot(balls):
    actor, (observations, playing) = disturbed("pots", n_object_balls=balls, max_shots=2), with_potted_balls(balls)
    moved = observations.reshape(200, -1, 2).copy()
    moved[~playing] = (-1.0, -1.0)
    shots, others = (actor.predict(o.reshape(200, -1), deterministic=True)[0] for o in (observations, moved))
    np.testing.assert_array_equal(others, shots)


def test_without_a_pot_the_head_pots_plays_a_full_hit_on_the_nearest_ball():
    env: dict[str, Any] = {"n_object_balls": 2, "max_shots": 2}
    actor, game = make("pots", **env), cast(BilliardsEnv, gym.make("Billiards-v0", **env).unwrapped)
    size = np.array([game.scene.table.length, game.scene.table.width]) / 2
    observations = layouts(3000, **env)
    positions = observations.reshape(-1, 3, 2) * size
    playing = np.zeros((3000, 3), np.bool_)
    alone = find_pots(Tables(game.scene, game.targets, positions, playing, game.max_speed), most=5).count == 0
    assert alone.sum() >= 5
    ways = (positions[:, 1:] - positions[:, :1])[alone]
    nearest = ways[np.arange(len(ways)), np.hypot(*ways.T).T.argmin(1)]
    shots, _ = actor.predict(observations[alone], deterministic=True)
    np.testing.assert_allclose(shots / np.hypot(*shots.T)[:, None], nearest / np.hypot(*nearest.T)[:, None], atol=1e-4)

    # Both balls are at a long cushion, and the cue ball is at the same one. The farther ball has the lower number.
    x, y = size
    edge = y - game.scene.balls.radius[0]
    table = np.array([[0.3 / x, edge / y, -0.5 / x, edge / y, 1, 1], [-0.3 / x, edge / y, 1, -1, 0.3 / x, edge / y]])
    shots, _ = actor.predict(table.astype(np.float32), deterministic=True)
    np.testing.assert_allclose(np.sign(shots[:, 0]), [-1, 1])
    np.testing.assert_allclose(shots[:, 1], 0, atol=1e-5)


def test_with_banks_the_head_pots_has_more_components(tmp_path):
    observations = layouts(200)
    plain, more = train("pots", components=8), train("pots", components=8, banks=True)
    few, many = ((components(model.policy, observations).logit > NEVER).sum(1) for model in (plain, more))
    assert (many >= few).all()
    assert (many > few).float().mean() > 0.2
    more.save(tmp_path / "model")
    loaded = PPO.load(tmp_path / "model", device="cpu")
    shots, again = (model.predict(observations, deterministic=True)[0] for model in (more, loaded))
    np.testing.assert_array_equal(again, shots)


def untrained_success(**env: Any) -> tuple[float, np.ndarray]:
    """Returns the success of the untrained head "pots" in 300 episodes of a shot, and its actions."""
    envs = gym.make_vec("Billiards-v0", num_envs=300, autoreset_mode="SameStep", **env)
    actions = make("pots", **env).predict(envs.reset(seed=0)[0], deterministic=True)[0]
    return envs.step(actions)[-1]["final_info"]["is_success"].mean(), actions


def test_the_untrained_head_pots_pots_more_than_nine_balls_in_ten():
    assert untrained_success()[0] > 0.9


def test_untrained_policies_of_strikes_reach_more_goals_than_those_of_velocities():
    plain, _ = untrained_success(task="position")
    spinning, actions = untrained_success(task="position", action="strike")
    assert np.abs(actions[:, 2:4]).max(axis=1).mean() > 0.2
    assert spinning > plain + 0.1


@pytest.mark.parametrize("side", [-0.6, 0.0, 0.8])
@pytest.mark.parametrize("top", [-0.5, 0.3])
def test_the_cue_of_a_component_keeps_the_velocity_of_the_ball(side, top):
    game = make("pots", action="strike").game
    cue = cue_of(game)
    assert cue is not None
    parts = cue_parts(cue, *(torch.tensor([[value]]) for value in (side, top, 0.0)))
    (dx, dy), speed = turned(torch.ones(1, 1), torch.zeros(1, 1), parts.turn), 0.5 / parts.gain
    action = [float(part) for part in (speed * dx, speed * dy, parts.side, parts.top, parts.elevation)]
    np.testing.assert_allclose(cue_strike(action, game.scene, 4.0).velocity, [2.0, 0.0], atol=1e-5)
    assert not cue_strike(action, game.scene, 4.0).miscue


def test_a_head_is_refused_in_a_task_that_it_does_not_fit():
    expected = (
        "policy.head = 'pots' in the task 'carom': expected one of the tasks pot, position, clear, or another head"
    )
    with pytest.raises(ValueError, match=expected):
        make("pots", scene="carom", task="carom")
    with pytest.raises(ValueError, match=r"policy.head = 'hits' in the task 'place': expected at least one object"):
        make("hits", task="place", n_object_balls=0, max_shots=3)
    with pytest.raises(ValueError, match=r"policy.head = 'pot': expected one of .*did you mean 'pots'"):
        make("pot")


@pytest.mark.parametrize("head", HEADS)
def test_an_environment_whose_observations_do_not_fit_is_refused(head):
    with pytest.raises(ValueError, match=r"env = \{\}: expected .* has the shape \(8,\), not \(4,\)"):
        PPO(MixturePolicy, gym.make("Billiards-v0", n_object_balls=3), policy_kwargs={"head": head})


@pytest.mark.parametrize(
    "env",
    [
        {"n_object_balls": 3, "max_shots": 3, "observe_shots_left": True},
        {"scene": "carom", "task": "carom"},
        {"task": "place", "n_object_balls": 0, "max_shots": 3},
        {"task": "nine_ball", "n_object_balls": 9, "layout": "nine_ball", "max_shots": 3},
        {"scene": {"base": "pool", "balls": {"radius": [0.02, 0.03], "mass": [0.1, 0.2]}}},
        {"scene": "real_pool"},
    ],
    ids=str,
)
def test_the_heads_play_every_kind_of_the_environment(env):
    game = gym.make("Billiards-v0", **env)
    observations = np.stack([game.reset(seed=seed)[0] for seed in range(3)])
    pots = env.get("task", "pot") == "pot"
    for head in ("mixture", "hits", *(["pots"] if pots else [])):
        if head == "hits" and env.get("n_object_balls") == 0:
            continue  # refused, because there is no object ball
        actor = disturbed(head, **env)
        with torch.no_grad():
            actions, values, log_prob = actor(torch.as_tensor(observations))
        assert all(bool(torch.isfinite(part).all()) for part in (actions, values, log_prob))
        shots, _ = actor.predict(observations, deterministic=True)
        assert all(game.action_space.contains(shot) for shot in shots)


@pytest.mark.parametrize("head", HEADS)
def test_set_std_fixes_the_standard_deviations(head):
    actor, observations = make(head), layouts(20)
    actor.set_std((0.05, 0.02))
    found = components(actor, observations)
    real = found.logit != NEVER
    torch.testing.assert_close(found.log_along.exp()[real], torch.full((int(real.sum()),), 0.05))
    if head == "mixture":
        torch.testing.assert_close(found.log_across.exp()[real], 0.02 * found.speed[real])

    distribution = actor.get_distribution(torch.as_tensor(observations))
    loss = -distribution.log_prob(distribution.sample().detach()).sum()
    loss.backward()
    actor.optimizer.step()
    stds = {name: value.exp().item() for name, value in actor.named_parameters() if name.endswith(SET)}
    assert list(stds.values()) == pytest.approx([0.05, 0.02])


@pytest.mark.parametrize("head", HEADS)
def test_strikes_have_a_density(head, tmp_path):
    strike = {"action": "strike"}
    model = train(head, strike)
    observations = layouts(100)
    shots, _ = model.predict(observations, deterministic=True)
    assert shots.shape == (100, 5)
    with torch.no_grad():
        actions, _, log_prob = model.policy(torch.as_tensor(observations))
        _, evaluated, _ = model.policy.evaluate_actions(torch.as_tensor(observations), actions)
    torch.testing.assert_close(evaluated, log_prob)
    found = components(model.policy, observations)
    assert found.others.shape[:2] == (100, 3)
    errors = actions[:, 2:, None] - found.others
    nearest = errors[:, :2].norm(dim=1).argmin(1)  # the means of the offsets are 0.3 or more apart
    spread = errors[torch.arange(100), :, nearest].std(0)
    np.testing.assert_allclose(spread, 0.1, atol=0.03)
    model.save(tmp_path / "model")
    loaded = PPO.load(tmp_path / "model", device="cpu")
    np.testing.assert_array_equal(loaded.predict(observations, deterministic=True)[0], shots)


def pots_config() -> Config:
    """Returns the configuration of two updates with the head "pots" and several minibatches."""
    return Config.from_dict(
        {
            "timesteps": 64,
            "n_envs": 8,
            "env": {"n_object_balls": 2, "max_shots": 3},
            "policy": {"head": "pots", "components": 3, "hidden": [8]},
            "ppo": {"n_steps": 4, "batch_size": 8, "n_epochs": 3},
        }
    )


@pytest.fixture
def computed(monkeypatch) -> list[int]:
    """Returns a list that holds the number of layouts of each computation of features."""
    counts, compute = [], PotFeatures.compute

    def counted(self: PotFeatures, observations: Tensor) -> Tensor:
        counts.append(len(observations))
        return compute(self, observations)

    monkeypatch.setattr(PotFeatures, "compute", counted)
    return counts


def test_stored_features_do_not_change_the_training(computed):
    settings = pots_config()
    weights, counts, batches = [], [], []
    for kind in (FeatureBuffer, RolloutBuffer):
        model = make_model(settings, make_vec_env(settings))
        if kind is RolloutBuffer:
            arguments: dict[str, Any] = {"gae_lambda": model.gae_lambda, "gamma": model.gamma, "n_envs": 8}
            arguments |= {"observation_space": model.observation_space, "action_space": model.action_space}
            model.rollout_buffer = RolloutBuffer(4, device="cpu", **arguments)
        assert type(model.rollout_buffer) is kind
        computed.clear()
        model.learn(64)
        counts.append(sum(computed))
        weights.append([parameter.clone() for parameter in model.policy.parameters()])
        set_random_seed(0)
        batches.append(list(model.rollout_buffer.get(8)))
        extractor = cast(PotFeatures, model.policy.features_extractor)
    assert all(torch.equal(one, other) for one, other in zip(*weights, strict=True))
    assert counts[0] <= 2 * 8 * (4 + 2)  # once for each step, and for the values after the last step
    assert counts[1] > 2 * 3 * 32
    assert len(batches[0]) == len(batches[1]) == 4
    for stored, plain in zip(*batches, strict=True):
        assert torch.equal(stored.observations, extractor(plain.observations))
        assert all(torch.equal(one, other) for one, other in zip(stored[1:6], plain[1:6], strict=True))


def test_features_of_equal_observations_are_computed_once(computed):
    extractor = cast(PotFeatures, make("pots").features_extractor)
    observations = torch.as_tensor(layouts(20))
    features = extractor(observations)
    assert extractor(observations.clone()) is features
    assert computed == [20]
    assert extractor(features) is features  # features are no observations
    observations[0, 0] += 0.01
    moved = extractor(observations)
    assert computed == [20, 20]
    assert torch.equal(moved[1:], features[1:])
    assert not torch.equal(moved[0], features[0])
    assert torch.equal(extractor(observations[:7]), moved[:7])
