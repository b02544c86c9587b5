"""The frozen tasks and the published hashes of their results."""

import inspect
import json
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from billiards_env.bench.frozen import FROZEN, FROZEN_GAMES, NAMESPACE
from billiards_env.bench.published import HASHES, first_steps
from billiards_env.envs import make_env, make_model


def test_the_results_do_not_change():
    assert {name: first_steps(name) for name in (*FROZEN, *FROZEN_GAMES)} == HASHES


def test_the_ids_are_the_tasks_their_strikes_and_both_with_noise():
    potting = {"Pot1", "Pot3", "Clear5", "Position", "NineBall", "EightBall"}
    names = potting | {"Carom", "ThreeCushion", "SumToThree", "Place", "Jump"} | {f"{name}Strike" for name in potting}
    assert set(FROZEN) == {f"{name}{noise}-v0" for name in names for noise in ("", "Noise")}


@pytest.mark.parametrize("name", [*FROZEN, *FROZEN_GAMES])
def test_environments_of_an_id_and_of_its_json_play_alike(name):
    env = gym.make(NAMESPACE + name)
    assert env.spec is not None
    assert env.spec.reward_threshold == (FROZEN[name].threshold if name in FROZEN else None)
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.spec == env.spec
    envs = gym.make_vec(NAMESPACE + name, 2)
    together, _ = envs.reset(seed=6)
    alone = [env.reset(seed=6)[0], again.reset(seed=7)[0]]
    assert (together == alone).all()
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, envs.action_space.shape)
    _, rewards, over, _, infos = envs.step(actions)
    for k, one in enumerate((env, again)):
        observation, reward, terminated, _, info = one.step(actions[k])
        assert (reward, terminated) == (rewards[k], over[k])
        expected = infos["final_info"] if terminated else infos
        assert info["shot_time"] == expected["shot_time"][k]
        assert observation.shape == together[k].shape


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"n_object_balls": 4, "mode": "pic"}, "n_object_balls = 4"),
        ({"mode": "pit", "dt": 0.01}, "mode = 'pit', dt = 0.01"),
        ({"noise": {"angle_std": 1.0}}, "noise = {'angle_std': 1.0}"),
        ({"noise_seed": 1, "observe": ("positions", "shots_left"), "render_mode": "rgb_array", "max_speed": 4}, None),
    ],
)
def test_a_changed_argument_of_a_frozen_task_warns(changes, named):
    kept = {name: value for name, value in changes.items() if name != "render_mode"}
    vectors = [{**changes, "num_envs": 2, "threads": 1}, {**kept, "vectorization_mode": "sync"}]
    for make, arguments in ((gym.make, changes), *((gym.make_vec, vector) for vector in vectors)):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("default")
            make("Billiards/Pot3-v0", **arguments)
        texts = [str(warning.message) for warning in said]
        expected = f"{named} in Billiards/Pot3-v0: this is no longer the frozen task"
        assert [expected in text for text in texts] == ([] if named is None else [True])
    gym.make("Billiards-v0", n_object_balls=4)


def test_every_argument_with_an_effect_is_frozen():
    """A change of a default then changes no id."""
    env = make_env()
    free = {"dt", "fix", "noise", "noise_seed", "scatter", "goal_radius"}  # ids set `noise`, and the task the radius
    frozen = {"scene", "task", "n_object_balls", "mode", "action", "max_shots", "max_speed", "layout"}
    frozen |= {"observe", "scratch_penalty", "randomize"}
    assert all(set(task.arguments) == frozen for task in FROZEN.values())
    games = {"n_players", "target", "can_call", "can_place", "miss", "edition", "innings"}
    assert all(set(arguments) == frozen | games for arguments in FROZEN_GAMES.values())
    assert inspect.signature(make_model).parameters.keys() == frozen | free | games
    assert json.loads(json.dumps(FROZEN["Clear5-v0"].arguments)) == FROZEN["Clear5-v0"].arguments
    assert env.engine.mode == "pic"
