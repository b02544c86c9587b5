"""The policy that aims, trained by PPO of Stable-Baselines3."""

from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from billiards_env import Scene
from billiards_env.sb3 import PPO_SETTINGS, AimPolicy, SameStepVecEnv
from tests.helpers.errors import refusals

GAMES: dict[str, dict[str, Any]] = {
    "pot": {},
    "three balls": {"n_object_balls": 3, "max_shots": 2, "observe": ("shots_left", "free_to_balls", "positions")},
    "position": {"task": "position", "action": "strike"},
    "carom": {"task": "carom", "layout": "random"},
    "run-out": {"task": "nine_ball"},
    "varied physics": {"randomize": {"mu_roll": [0.004, 0.02]}, "observe": ("positions", "physics")},
}


SETTINGS = {**PPO_SETTINGS, "batch_size": 16}


def vector(envs: int = 16, **arguments: Any) -> SameStepVecEnv:
    return SameStepVecEnv(gym.make_vec("billiards_env:Billiards-v0", num_envs=envs, **arguments))


def make(envs: int = 16, env: dict[str, Any] | None = None, **kwargs: Any) -> PPO:
    """Returns an untrained model with as many environments as shots of a minibatch."""
    settings = {**SETTINGS, "batch_size": envs, "seed": 0}
    return PPO(AimPolicy, vector(envs, **env or {}), **settings, policy_kwargs={"env": env or {}, **kwargs})


def net(model: PPO) -> Any:
    return model.policy.net


def shots(policy: Any) -> int:
    return int(policy.shots)


@pytest.mark.parametrize("name", GAMES)
def test_ppo_trains_it_in_every_game_with_object_balls(name):
    model = make(env=GAMES[name], hidden=16, paths=True)
    before = [weights.clone() for weights in model.policy.parameters()]
    model.learn(32)
    after = list(model.policy.parameters())
    assert all(bool(torch.isfinite(weights).all()) for weights in after)
    assert not all(torch.equal(old, new) for old, new in zip(before, after, strict=True))
    envs: Any = model.env
    actions, _ = model.predict(envs.reset(), deterministic=True)
    assert actions.shape == (16, gym.spaces.flatdim(model.action_space))
    assert (np.hypot(actions[:, 0], actions[:, 1]) > 0).all()
    assert net(model).aim == ("layout" if name == "carom" else "ball")
    assert shots(model.policy) == 32


def test_it_learns_from_positions_alone():
    torch.set_num_threads(1)
    model = make(1024, hidden=64, exploration=50_000).learn(60_000)
    envs: Any = model.env
    success = [envs.step(model.predict(envs.reset(), deterministic=True)[0])[1] for _ in range(2)]
    assert (np.concatenate(success) > 0).mean() > 0.12  # a random shot pots the ball once in a hundred times


def test_a_saved_model_plays_and_learns_as_before(tmp_path):
    model = make(hidden=16, aim="layout", paths=True, exploration=64).learn(32)
    observations = np.array([[0.2, -0.3, -0.4, 0.5]], np.float32)
    model.save(tmp_path / "model")
    model.policy.save(tmp_path / "policy")
    loaded, alone = PPO.load(tmp_path / "model", device="cpu"), AimPolicy.load(tmp_path / "policy", device="cpu")
    for policy in (loaded.policy, alone):
        np.testing.assert_array_equal(
            policy.predict(observations, deterministic=True)[0], model.predict(observations, deterministic=True)[0]
        )
        assert shots(policy) == 32
    assert (net(loaded).aim, net(loaded).diameter) == ("layout", 2 * 0.028575)


def test_the_schedules_follow_the_shots_between_rollouts():
    model = make(hidden=16, exploration=32, std_speed=(0.4, 0.1), std_aim=(0.01, 0.01), entropy=(1.0, 0.25))
    values = []

    def read(*_):
        values.append((net(model).std.tolist(), model.policy.entropy_factor))
        model.predict(np.zeros((1, 4), np.float32))  # an evaluation in between changes nothing
        return True

    model.learn(64, callback=read)
    assert [std[0] for std, _ in values] == pytest.approx([0.4, 0.2, 0.1, 0.1])
    assert [std[1] for std, _ in values] == pytest.approx(4 * [0.01])
    assert [entropy for _, entropy in values] == pytest.approx([1.0, 0.5, 0.25, 0.25])


def test_the_densities_of_an_update_are_those_of_its_rollout():
    model = make(hidden=16)
    observations = torch.rand(8, 4) - 0.5
    with torch.no_grad():
        actions, values, log_prob = model.policy(observations)
        entropy = model.policy.get_distribution(observations).entropy()
    again, evaluated, weighted = model.policy.evaluate_actions(observations, actions)
    torch.testing.assert_close(evaluated, log_prob)
    torch.testing.assert_close(again, values)
    assert torch.equal(model.policy.predict_values(observations), again)
    torch.testing.assert_close(model.policy.get_distribution(observations).log_prob(actions), log_prob)
    torch.testing.assert_close(weighted, entropy)  # its factor begins at 1


@pytest.mark.parametrize("env", GAMES.values(), ids=GAMES)
def test_the_values_alone_are_those_beside_the_mixtures(env):
    model = make(envs=4, hidden=16, env=env)
    envs, policy = cast(Any, model.env), cast(AimPolicy, model.policy)
    observations = torch.as_tensor(envs.reset())
    with torch.no_grad():
        for parameter in net(model).critic.parameters():
            parameter.normal_()
        _, values = policy.mixtures_and_values(observations)
        assert len(set(values.tolist())) > 1
        assert torch.equal(policy.predict_values(observations)[:, 0], values)


def test_the_policy_gets_the_table_and_the_task_from_the_environment(tmp_path):
    """Without `policy_kwargs` it once took every table for that of "pool"."""
    model = PPO(AimPolicy, vector(scene="match_carom", task="carom"), **SETTINGS)
    policy: Any = model.policy
    assert (policy.game.scene, policy.game.task) == (Scene.named("match_carom"), "carom")
    model.save(tmp_path / "model")
    loaded: Any = PPO.load(tmp_path / "model", device="cpu").policy
    assert loaded.game.scene == Scene.named("match_carom")


def alone(of: dict[str, Any], **arguments: Any) -> AimPolicy:
    """Returns a policy for the spaces of an environment, without a model."""
    made = gym.make("billiards_env:Billiards-v0", **of)
    return AimPolicy(made.observation_space, made.action_space, lambda _: 1e-3, **arguments)


def learning(envs: Any, env: dict[str, Any] | None = None) -> PPO:
    return PPO(AimPolicy, envs, **SETTINGS, policy_kwargs={"env": env})


REAL: dict[str, Any] = {"scene": "real_pool"}
NINE: dict[str, Any] = {"task": "nine_ball", "n_players": 2}
EMPTY, WIDE = {"task": "place", "n_object_balls": 0}, gym.spaces.Box(-2.0, 2.0, (2,))
TABLE = "env: expected the arguments of the environment, whose scene is Scene"
NORMALIZED = r"observations up to .*: expected .* from -1 to 1; a wrapper such as VecNorm"
SPACE = r"action_space = Box\(-2.0, 2.0.*: expected Box\(-1.0, 1.0"


WRONG = [
    (lambda: learning(vector(**REAL), {}), TABLE),
    (lambda: learning(vector(**REAL), {**REAL, "max_speed": 3.0}), "env: expected .* whose max_speed is 4.0"),
    (lambda: learning(VecNormalize(vector())).learn(32), NORMALIZED),
    (lambda: AimPolicy(vector().observation_space, WIDE, lambda _: 1e-3), SPACE),
    (lambda: alone({}), "env = None: expected a SameStepVecEnv .*, or policy_kwargs={'env': arguments}"),
    (lambda: learning(vector(action="cut")), "action = 'cut', .*: expected 'velocity' or 'strike'"),
    (lambda: learning(vector(action="plan")), "action = 'plan', .*: expected 'velocity' or 'strike'"),
    (lambda: alone(NINE, env=NINE), "can_place = True, .*: expected .* False"),
    (lambda: alone({}, env={"n_object_balls": 2}), r"expected the arguments .*, whose observation .* not \(6,\)"),
    (lambda: alone({}, env={}, activation="gelu"), "activation = 'gelu': expected one of 'tanh', 'relu'"),
    (lambda: alone({}, env={}, aim="pocket"), "aim = 'pocket': expected one of 'ball', 'layout'"),
    (lambda: alone(EMPTY, env=EMPTY), "expected an object ball"),
]


@refusals("make", WRONG)
def test_a_wrong_world_or_argument_is_refused(make, message, kind):
    with pytest.raises(kind, match=message):
        make()
