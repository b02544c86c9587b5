"""Copies and specs of single environments, of vector environments and of games, and the warning of all three."""

import copy
import json
import pickle
import threading
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from numba.core.serialize import ReduceMixin

from billiards_env import billiards_v0
from billiards_env.envs import STATUS, make_env, make_vector_env, step
from billiards_env.scene import Scene
from tests.helpers.environments import SOFT, VARIANTS, VARIED, name_of, same

KINDS: dict[str, Any] = {
    "a single environment": lambda: make_env(n_object_balls=3, max_shots=6),
    "a vector environment": lambda: make_vector_env(64, "SameStep", **SOFT),
    "an environment with noise": lambda: make_env(noise={}, action="strike", max_shots=6),
    "a vector environment with varied physics": lambda: make_vector_env(64, "SameStep", **VARIED),
    "a game": lambda: billiards_v0.raw_env("straight"),
}


def begun(env: Any, seed: int | None = None) -> Any:
    """Returns the results of `reset`; of a game, those of `last`."""
    return env.reset(seed=seed) or env.last()


def played(env: Any, action: Any) -> Any:
    """Returns the results of `step`; of a game, those of `last`."""
    return env.step(action) or env.last()


def space_of(env: Any) -> Any:
    """Returns the action space; in a game, the action space of the first player."""
    return env.action_space("player_0") if hasattr(env, "agents") else env.action_space


def actions_of(env: Any, count: int) -> np.ndarray:
    """Returns random actions of slow shots, which end no episode of a single environment."""
    return np.random.default_rng(0).uniform(-0.2, 0.2, (count, *space_of(env).shape))


def unpickled(env: Any) -> Any:
    return pickle.loads(pickle.dumps(env))


COPIES: dict[str, Any] = {
    "deep": copy.deepcopy,
    "pickle": unpickled,
    "of copies": lambda env: copy.deepcopy(unpickled(copy.deepcopy(env))),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("copy_of", COPIES.values(), ids=COPIES)
def test_a_copy_continues_like_its_original(kind, copy_of):
    env = KINDS[kind]()
    begun(env, 5)
    space_of(env).seed(3)
    actions = actions_of(env, 5)
    for action in actions[:2]:
        played(env, action)
    twin = copy_of(env)
    for action in actions[2:]:
        same(played(env, action), played(twin, action))
        same(space_of(env).sample(), space_of(twin).sample())
    same(begun(env), begun(twin))


def test_two_environments_never_have_the_same_episode():
    env: Any = make_env(max_shots=6)
    env.reset(seed=1)
    env.lock = threading.Lock()
    with pytest.raises(TypeError):
        copy.deepcopy(env)
    del env.lock
    copy.copy(env)
    before, others = env.positions, [copy.copy(env), copy.deepcopy(env)]
    for other in others:
        other.step([0.9, 0.1])
        assert (other.positions != before).any()
    assert (env.positions == before).all()


def test_a_deep_copy_pickles_no_compiled_function(monkeypatch):
    """Pickling a compiled function takes milliseconds. Copying and stepping an environment takes microseconds."""
    envs = make_env(**VARIANTS[0]), make_vector_env(2, **VARIANTS[0])
    monkeypatch.setattr(ReduceMixin, "__reduce__", lambda _: pytest.fail("a compiled function is pickled"))
    for env in envs:
        env.reset(seed=0)
        action = env.action_space.sample() * 0
        same(copy.deepcopy(env).step(action), env.step(action))


def test_a_deep_copy_has_its_own_renderer():
    pytest.importorskip("pygame")
    env: Any = make_env(render_mode="rgb_array")
    env.reset(seed=0)
    for _ in range(2):  # before the first picture, and after it
        for twin in (copy.deepcopy(env), unpickled(env)):
            assert (twin.render() == env.render()).all()


SCENE = Scene.from_dict({"base": "real_pool", "n_object_balls": 2, "physics": {"mu_roll": 0.012}})


SPECS = [
    *((kwargs, kwargs) for kwargs in VARIANTS[::5]),
    ({"scene": SCENE}, {"scene": SCENE.to_dict()}),
    ({"randomize": {"mu_roll": (0.004, 0.02)}}, {"randomize": {"mu_roll": [0.004, 0.02]}}),
    ({"render_mode": "rgb_array"}, {"render_mode": "rgb_array"}),
    (
        {
            "max_shots": np.int64(3),
            "max_speed": np.float32(2.5),
            "n_object_balls": np.uint8(2),
            "noise_seed": np.int8(1),
        },
        {"max_shots": 3, "max_speed": 2.5, "n_object_balls": 2, "noise_seed": 1},
    ),
    (
        {"randomize": {"mu_roll": [np.float32(0.25), np.float64(0.5)]}, "observe": [("pixels", np.int64(9), 9)]},
        {"randomize": {"mu_roll": [0.25, 0.5]}, "observe": [["pixels", 9, 9]]},
    ),
]


@pytest.mark.parametrize("vector", [False, True], ids=["single", "vector"])
@pytest.mark.parametrize(("kwargs", "written"), SPECS, ids=name_of)
def test_a_spec_recreates_its_environment_from_json_and_pickle(kwargs, written, vector):
    env: Any = gym.make_vec("Billiards-v0", num_envs=3, **kwargs) if vector else gym.make("Billiards-v0", **kwargs)
    assert written.items() <= json.loads(env.spec.to_json())["kwargs"].items()
    (action,) = actions_of(env, 1)
    expected = env.reset(seed=3), env.step(action)
    for spec in (EnvSpec.from_json(env.spec.to_json()), pickle.loads(pickle.dumps(env.spec))):
        again: Any = gym.make_vec(spec) if vector else gym.make(spec)
        same((again.reset(seed=3), again.step(action)), expected)
        assert again.render_mode == kwargs.get("render_mode")


def test_a_shot_that_reaches_the_limit_on_events_warns(monkeypatch):
    monkeypatch.setattr(step, "MAX_EVENTS", 2)
    env, envs, apart = make_env(), make_vector_env(2), [[-0.5, 0.0], [0.5, 0.0]]
    env.reset(options={"positions": apart})
    envs.reset(options={"positions": [apart] * 2})
    with pytest.warns(
        RuntimeWarning, match=r"after 2 events and .* s; .* positions \[\[-0.5, 0.0\], .* action \[1.0, 0"
    ):
        assert STATUS[env.step([1.0, 0.0])[4]["status_code"]] == "event_limit"
    with pytest.warns(RuntimeWarning, match=r"after 2 events and .* positions \[\[-0.5, 0.0\], .* action \[0.75, 0"):
        *_, infos = envs.step([[0.0, 0.0], [0.75, 0.0]])
    assert [STATUS[code] for code in infos["final_info"]["status_code"]] == ["rest", "event_limit"]
