"""The native vector environment has the results of Gymnasium's SyncVectorEnv of single environments."""

import inspect
import itertools
import warnings
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from billiards_env.envs import BilliardsVectorEnv, make_env, make_vector_env
from billiards_env.envs.arguments import make_model
from billiards_env.scene import layouts
from billiards_env.shots.noise import EXECUTION_NOISE
from tests.helpers.environments import GAME_VARIANTS, SOFT, VARIANTS, VARIED, name_of, same

MODES = tuple(AutoresetMode)
modes = pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.value)
NOISY: dict[str, Any] = {**VARIED, "noise": {"angle_std": 5.0, "speed_std": 0.5}}
ACTIONS = [
    {**SOFT, "action": "cut", "noise": {}},
    {**SOFT, "action": "sum_to_three", "noise": {}, "max_speed": 4.5},
    {**SOFT, "action": "plan", "noise": {}},
    {"action": "plan", "noise": {}, "task": "nine_ball", "layout": "random"},
]
soft = pytest.mark.parametrize("kwargs", [SOFT, NOISY], ids=["soft", "varied and noisy"])


def pair(num_envs, autoreset, threads=None, **kwargs):
    """Returns the native vector environment and a SyncVectorEnv with the same arguments."""
    sync = SyncVectorEnv(
        [lambda: gym.make("Billiards-v0", **kwargs) for _ in range(num_envs)], autoreset_mode=autoreset
    )
    return make_vector_env(num_envs, autoreset, threads, **kwargs), sync


def compare(native, sync, steps, seed: Any = 0):
    """Plays the same random shots in both. In the mode "Disabled" a mask resets finished episodes."""
    results = native.reset(seed=seed)
    same(results, sync.reset(seed=seed))
    rng = np.random.default_rng(0)
    for _ in range(steps):
        possible = results[-1].get("action_mask")
        if possible is None:
            actions = rng.uniform(-1, 1, native.action_space.shape).astype(np.float32)
        else:
            actions = (rng.random(possible.shape) * possible).argmax(axis=1)
        results = native.step(actions)
        same(results, sync.step(actions))
        if native.autoreset_mode is AutoresetMode.DISABLED and results[2].any():
            same(*(envs.reset(options={"reset_mask": results[2].copy()}) for envs in (native, sync)))


@pytest.mark.parametrize(
    ("kwargs", "mode"),
    list(zip([*VARIANTS, *ACTIONS, *GAME_VARIANTS], itertools.cycle(MODES), strict=False)),
    ids=name_of,
)
def test_results_equal_those_of_single_environments(kwargs, mode):
    compare(*pair(5, mode, **kwargs), steps=7, seed=11)


@modes
@soft
def test_results_are_equal_with_several_threads_and_many_episodes(mode, kwargs):
    compare(*pair(150, mode, threads=4, **kwargs), steps=12)


@modes
@pytest.mark.parametrize("seed", [5, [3, 1, 4, 1, 5]])
def test_seeds_equal_those_of_single_environments(mode, seed):
    native, sync = pair(5, mode)
    compare(native, sync, 3, seed)
    assert native.np_random_seed == sync.np_random_seed
    compare(native, sync, 3, [None, 7, None, 2**70, 0])
    assert native.np_random_seed == sync.np_random_seed
    for a, b in zip(native.np_random, sync.np_random, strict=True):
        assert a.bit_generator.state == b.bit_generator.state
    native.np_random[0].random()
    same(native.reset(), sync.reset())


def test_unseeded_layouts_differ_and_np_random_seed_reproduces_them():
    envs = make_vector_env(20)
    first, _ = envs.reset()
    assert len(np.unique(first, axis=0)) == 20
    second, _ = envs.reset()
    assert not (first == second).any()
    assert np.array_equal(make_vector_env(20).reset(seed=list(envs.np_random_seed))[0], first)
    assert not np.array_equal(make_vector_env(20).reset()[0], first)


@modes
@soft
def test_a_masked_reset_does_not_change_the_others(mode, kwargs):
    native, sync = pair(6, mode, **kwargs)
    compare(native, sync, steps=2)
    rng = np.random.default_rng(1)
    for step in range(8):
        mask = rng.random(6) < 0.5
        mask[0] = True
        if mode is AutoresetMode.DISABLED:
            mask |= native._episodes.state.over
        seed = [None, 40, [9, 8, 7, 6, None, 4]][step % 3]
        options = {"reset_mask": mask.copy()}
        same(native.reset(seed=seed, options=options), sync.reset(seed=seed, options=dict(options)))
        assert options.keys() == {"reset_mask"}
        actions = rng.uniform(-1, 1, (6, 2))
        same(native.step(actions), sync.step(actions))


OPTIONS = [
    ({}, "positions", [[[0.1, 0.2], [-0.3, -0.4]], [[0.5, 0.0], [-0.5, 0.0]]]),
    ({"task": "place"}, "goal", [[0.1, 0.2], [-0.3, 0.4]]),
    (VARIED, "physics", [0.004, 0.02]),
]


@pytest.mark.parametrize(("kwargs", "name", "values"), OPTIONS)
def test_options_are_those_of_single_environments(kwargs, name, values):
    envs, single, values = make_vector_env(2, **kwargs), make_env(**kwargs), np.array(values)

    def options(values):
        return {name: {"mu_roll": values} if name == "physics" else values}

    observations, _ = envs.reset(seed=3, options=options(values))
    later, _ = envs.reset()
    for i, value in enumerate(values):
        assert np.array_equal(observations[i], single.reset(seed=3 + i, options=options(value))[0])
        assert np.array_equal(later[i], single.reset()[0])
    second = {"reset_mask": np.array([False, True])}
    values[0] = 9.0  # not in the mask, so not used
    again, infos = envs.reset(options={**options(values), **second})
    if name == "physics":
        assert (infos["mu_roll"].tolist(), infos["_mu_roll"].tolist()) == ([0.0, 0.02], [False, True])
    assert np.array_equal(again[0], later[0])
    assert np.array_equal(again[1], single.reset(options=options(values[1]))[0])


def arrays(results):
    """Yields the arrays of numbers in nested tuples and dicts."""
    for value in results.values() if isinstance(results, dict) else results:
        if isinstance(value, (dict, tuple)):
            yield from arrays(value)
        elif isinstance(value, np.ndarray) and value.dtype != object:
            yield value


@modes
@soft
def test_returned_arrays_share_no_memory(mode, kwargs):
    envs, twin, env = (*(make_vector_env(40, mode, **kwargs) for _ in range(2)), make_env(**kwargs))
    rng = np.random.default_rng(0)
    twin.reset(seed=0)
    returned = [*arrays(envs.reset(seed=0)), *arrays(env.reset(seed=0))]
    for _ in range(4):
        actions = rng.uniform(-1, 1, (40, 2))
        kept = actions.copy()
        results = envs.step(actions)
        assert np.array_equal(actions, kept)
        same(results, twin.step(actions))
        returned += arrays((results, (envs.positions, envs.potted, envs.goals), (env.positions, env.potted, env.goals)))
        if mode is AutoresetMode.DISABLED and results[2].any():
            mask = results[2].copy()
            returned += arrays(envs.reset(options={"reset_mask": mask}))
            twin.reset(options={"reset_mask": mask})
        returned += arrays((env.step(0.05 * actions[0]), env.reset()))
    for a, b in itertools.combinations(returned, 2):
        assert not np.may_share_memory(a, b)
    for of in (envs._episodes, env._episodes):
        inner = [of.state.block, *of.state.shots, *of.state.arrays]
        assert not any(np.may_share_memory(a, b) for a in returned for b in inner)


FORMS = {
    "Fortran-ordered": np.asfortranarray,
    "big-endian": lambda actions: actions.astype(">f8"),
    "integers": lambda actions: actions.astype(int),
    "read-only": lambda actions: np.frombuffer(actions.tobytes(), actions.dtype).reshape(actions.shape),
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("vector", [False, True])
def test_the_form_of_an_array_of_actions_changes_no_bit(vector, form):
    def played(form):
        envs: Any = make_vector_env(3, **SOFT) if vector else make_env(**SOFT)
        rng, results = np.random.default_rng(0), []
        for seed in range(4):
            actions = rng.integers(-1, 2, (3, 2)).astype(np.float32)
            results.append((envs.reset(seed=seed), envs.step(form(actions if vector else actions[0]))))
        return results

    same(played(form), played(lambda actions: actions))


def test_next_step_resets_ignore_the_action():
    envs = make_vector_env(2, "NextStep")
    envs.reset(seed=0)
    envs.step(np.zeros((2, 2)))
    *_, infos = envs.step(np.full((2, 2), np.nan))
    assert infos.keys() == envs.reset()[1].keys()
    assert infos["shots_left"].tolist() == [1, 1]
    with pytest.raises(ValueError, match=r"action of environment 1 = \[0.0, nan\]: expected finite numbers"):
        envs.step([[0.0, 0.0], [0.0, np.nan]])


@pytest.mark.parametrize(("kwargs", "mode"), list(zip(VARIANTS[-3:], MODES, strict=True)), ids=name_of)
def test_make_vec(kwargs, mode):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        envs = gym.make_vec("Billiards-v0", num_envs=3, autoreset_mode=mode.value, **kwargs)
    assert isinstance(envs.unwrapped, BilliardsVectorEnv)
    assert envs.metadata["autoreset_mode"] is mode
    assert BilliardsVectorEnv.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert envs.reset(seed=1)[0] in envs.observation_space


def test_a_layout_without_room_raises_from_a_thread(monkeypatch):
    envs = make_vector_env(128, threads=2)
    hole = np.array([[0.0, 0.0, 9.0]])  # as large as the table
    plan = layouts.layout_plan("random", envs.single_env.scene)._replace(pockets=hole)
    monkeypatch.setattr(envs._episodes.reset, "layout", layouts.Drawer(plan))
    with pytest.raises(ValueError, match="found no room for ball 0"):
        envs.reset(seed=0)


@pytest.mark.slow
def test_ten_million_steps_need_no_more_memory_than_a_million():
    resource = pytest.importorskip("resource")
    envs = make_vector_env(4096, autoreset_mode="SameStep")
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (16, 4096, 2)).astype(np.float32)
    most = []
    for steps in (1_000_000, 9_000_000):
        for k in range(steps // 4096 + 1):
            envs.step(actions[k % 16])
        most.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert most[1] <= 1.01 * most[0]


ARGUMENTS = inspect.signature(make_model).parameters


@pytest.mark.parametrize(
    "kwargs", [NOISY, {"task": "snooker", "n_players": 2, "miss": True, "can_call": True}], ids=name_of
)
def test_each_argument_is_an_attribute_that_cannot_be_assigned(kwargs):
    native, sync = pair(2, "SameStep", **kwargs)
    single = native.single_env
    assert native.get_attr("max_shots")[0] == native.reset(seed=0)[1]["shots_left"][0]
    assert native.get_attr("mode") == ("pic", "pic")
    assert (native.miss, native.can_call, native.n_players) == (
        (True, True, 2) if "miss" in kwargs else (False, False, 1)
    )
    assert native.noise == (None if native.miss else {**EXECUTION_NOISE, "angle_std": 5.0, "speed_std": 0.5})
    for name in ARGUMENTS:
        same(native.get_attr(name), sync.get_attr(name))
        for assign in (native.set_attr, sync.set_attr, partial(setattr, single), partial(setattr, native)):
            with pytest.raises(AttributeError, match=rf"^{name} = 3: expected no change; make another environment"):
                assign(name, 3)
    single.np_random, single.render_mode, single.spec = np.random.default_rng(0), None, None


@pytest.mark.parametrize(
    ("kwargs", "options"),
    [
        (
            {"task": "place", "randomize": {"mu_roll": [0.004, 0.02]}},
            {"positions": [[-0.4, 0.1], [0.3, 0.2]], "goal": [0.1, 0.2], "physics": {"mu_roll": 0.01}},
        ),
        ({"task": "carom", "n_players": 2}, {"positions": [[-0.4, 0.1], [0.3, 0.2], [0.1, 0.3]], "state": {}}),
    ],
    ids=name_of,
)
def test_the_options_of_one_environment_apply_to_all(kwargs, options):
    native, sync = pair(3, "SameStep", **kwargs)
    same(native.reset(seed=0, options=options), sync.reset(seed=0, options=options))
    assert (native.positions == options["positions"]).all()
    native.reset(seed=1)
    before = native.positions
    native.reset(options={"positions": options["positions"], "reset_mask": np.array([False, True, False])})
    assert (native.positions == np.stack((before[0], options["positions"], before[2]))).all()


def test_seeds_may_be_numpy_integers():
    def first(**options):
        return gym.make_vec("Billiards-v0", num_envs=2, noise={}).reset(**options)[0].tobytes()

    assert first(seed=np.int64(3)) == first(seed=[np.int64(3), np.uint8(4)]) == first(seed=3)
    env: Any = gym.make("Billiards-v0").unwrapped
    assert env.reset(seed=np.int64(3))[0].tobytes() == env.reset(seed=3)[0].tobytes()


@pytest.mark.parametrize(
    "kwargs", [VARIED, {"task": "eight_ball"}, {"task": "nine_ball"}, {"task": "place"}], ids=name_of
)
def test_attributes_of_each_environment(kwargs):
    native, sync = pair(3, "SameStep", **kwargs)
    for envs in (native, sync):
        envs.reset(seed=5)
        envs.step(np.full((3, 2), 0.3))
    names = "positions potted goals legal_balls np_random_seed max_speed scene episode_scene"
    for name in names.split():
        same(native.get_attr(name), tuple(sync.get_attr(name)))
        same(native.call("get_wrapper_attr", name), native.get_attr(name))
    assert (np.stack(native.call("get_state")) == np.stack(sync.call("get_state"))).all()
    assert native.get_attr("np_random")[2].random() == sync.get_attr("np_random")[2].random()
    with pytest.raises(AttributeError, match="tusk"):
        native.get_attr("tusk")
    native.set_attr("metadata", [{}] * 3)
    assert native.get_attr("metadata") == ({}, {}, {})
    with pytest.raises(ValueError, match=r"metadata = \[1.0, 2.0, 3.0\]: expected one value for all 3"):
        native.set_attr("metadata", [1.0, 2.0, 3.0])
    with pytest.raises(AttributeError, match=r"^max_shot = 1: expected an attribute of .*did you mean 'max_shots'"):
        native.set_attr("max_shot", 1)
    for name in ("positions", "episode_scene", "np_random"):
        with pytest.raises(AttributeError, match=rf"^{name} = 0: expected no change; use the seed or the options of"):
            native.set_attr(name, 0)
    for name in ("reset", "step", "set_state"):
        with pytest.raises(ValueError, match=rf"call\('{name}'\): expected the method of the vector environment"):
            native.call(name)
