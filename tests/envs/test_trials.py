"""Shots that are tried: the results of steps, and an environment that does not change."""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from billiards_env.envs import make_env, make_vector_env
from tests.helpers.environments import VARIED, kinds, same
from tests.helpers.errors import refusals


@kinds
def test_outcomes_are_the_results_of_steps_without_noise(kwargs):
    quiet = {**kwargs, "noise": None}
    env, envs = make_env(**quiet), make_vector_env(6, **quiet, autoreset_mode="Disabled")
    rng = np.random.default_rng(0)
    env.reset(seed=3)
    envs.reset(seed=3)
    actions = rng.uniform(-1, 1, (6, *env.action_space.shape))
    for states in (envs.get_state(), np.stack([env.get_state()] * 6)):
        envs.set_state(states)
        before, outcomes = envs.get_state(), envs.try_actions(actions)
        same(envs.get_state(), before)
        same(env.try_actions(actions, states), outcomes)
        same(envs.try_actions(actions[:4], states[:4]).rewards, outcomes.rewards[:4])
        observations, rewards, terminated, _, infos = envs.step(actions)
        same(outcomes.observations, observations)
        same(outcomes.rewards, rewards)
        same(outcomes.terminated, terminated)
        same(outcomes.infos, {name: infos[name] for name in outcomes.infos})
        same(outcomes.states, envs.get_state())
    same(env.try_actions(actions), outcomes)
    noisy = make_env(**{**kwargs, "noise": {}})
    noisy.reset(seed=3)
    same(noisy.try_actions(actions).rewards, outcomes.rewards)


def test_episodes_continue_from_outcomes():
    env = make_env(**VARIED)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 2))
    first = env.try_actions(actions)
    left = ~first.terminated
    assert 0 < left.sum() < 20
    k = np.argmin(left)
    with pytest.raises(ResetNeeded, match=rf"^states\[{k}\] has not begun or is over.*leave out the `terminated` rows"):
        env.try_actions(actions, first.states)
    second = env.try_actions(actions[left], first.states[left])
    env.step(actions[left][0])
    _, reward, *_ = env.step(actions[left][0])
    assert second.rewards[0] == reward
    assert (env.get_state()["positions"] == second.states["positions"][0]).all()


def test_infos_have_the_physics_and_the_possible_plans():
    env = make_env(action="plan", n_object_balls=2, max_shots=2, randomize={"mu_roll": [0.005, 0.02]})
    _, info = env.reset(seed=0)
    plans = np.flatnonzero(info["action_mask"])[:5]
    outcomes = env.try_actions(plans)
    assert (outcomes.infos["mu_roll"] == info["mu_roll"]).all()
    for k, plan in enumerate(plans):
        twin = copy.deepcopy(env)
        *_, after = twin.step(plan)
        assert outcomes.infos["action_mask"][k].tolist() == after["action_mask"].tolist()


def test_several_actions_for_each_environment():
    envs = make_vector_env(3, autoreset_mode="Disabled")
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (12, 2))
    expected = envs.try_actions(actions, envs.get_state().repeat(4))
    same(envs.try_actions(actions), expected)
    assert envs.try_actions(np.empty((0, 2))).rewards.shape == (0,)
    envs.step(actions[:3])
    envs.reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(ResetNeeded, match="environment 1 has not begun or is over"):
        envs.try_actions(actions)


def test_threads_may_try_shots_of_one_environment():
    env = make_env(n_object_balls=5)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    expected = env.try_actions(actions)
    with ThreadPoolExecutor(4) as pool:
        for outcomes in pool.map(lambda _: env.try_actions(actions), range(20)):
            same(outcomes.states["positions"], expected.states["positions"])


def test_noise_is_drawn_from_the_given_generator():
    env = make_env(noise={"angle_std": 3.0, "speed_std": 0.1}, max_shots=2)
    env.reset(seed=0)
    actions = np.tile([0.3, 0.1], (2000, 1))
    played = env.try_actions(actions, noise=np.random.default_rng(1)).infos["played_action"]
    again = env.try_actions(actions, noise=np.random.default_rng(1)).infos["played_action"]
    assert played.tobytes() == again.tobytes()
    angles = np.degrees(np.arctan2(played[:, 1], played[:, 0]))
    assert angles.mean() == pytest.approx(np.degrees(np.arctan2(0.1, 0.3)), abs=0.3)
    assert angles.std() == pytest.approx(3.0, rel=0.05)
    assert (env.try_actions(actions).infos["played_action"] == actions).all()
    *_, info = env.step(actions[0])
    assert info["played_action"].tolist() not in played.tolist()
    quiet = make_env()
    quiet.reset(seed=0)
    same(quiet.try_actions(actions, noise=np.random.default_rng(1)), quiet.try_actions(actions))


def test_copies_of_an_environment_try_shots_of_their_own():
    env = make_env()
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (3, 2))
    expected = env.try_actions(actions)
    twin = copy.deepcopy(env)
    same(twin.try_actions(actions), expected)
    same(pickle.loads(pickle.dumps(env._trials)).try_actions(actions, env.get_state()[None], None, None, 1), expected)


def test_an_episode_that_has_not_begun_or_is_over_is_refused():
    env = make_env(max_shots=1)
    with pytest.raises(ResetNeeded, match="has not begun or is over"):
        env.try_actions([[0.1, 0.2]])
    env.reset(seed=0)
    assert env.try_actions(np.empty((0, 2))).rewards.shape == (0,)
    env.step([0.1, 0.2])
    with pytest.raises(ResetNeeded, match="has not begun or is over"):
        env.try_actions([[0.1, 0.2]])


OTHER = make_env(n_object_balls=2)


@refusals(
    "arguments",
    [
        (([0.1, 0.2],), "actions"),
        (([[0.1, np.nan]],), "actions = .*: expected finite numbers"),
        (([[0.1, 0.2]] * 4,), "actions: expected a multiple of 3, the number of environments, not 4"),
        (([[0.1, 0.2]], OTHER.get_state()[None]), r"state\['scene'\]"),
        ((np.ma.masked_greater([[0.1, 0.2]] * 3, 0.1),), "actions = .*: expected .*mask"),
        (([["a", "b"]] * 3,), "actions = .*: expected finite numbers"),
        (([[1j, 0.2]] * 3,), "actions = .*: expected finite numbers"),
        (([[0.1, 0.2], [0.1]],), "actions = .*: expected finite numbers"),
        (([[0.1, 0.2]] * 3, None, 3), "noise = 3: expected a numpy.random.Generator", TypeError),
    ],
)
def test_wrong_trials_are_refused(arguments, message, kind):
    envs = make_vector_env(3)
    envs.reset(seed=0)
    with pytest.raises(kind, match=message):
        envs.try_actions(*arguments)
