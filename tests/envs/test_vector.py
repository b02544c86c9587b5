"""The native vector environment has the results of Gymnasium's SyncVectorEnv of single environments."""

import copy
import itertools
import pickle
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import vector as wrappers

from billiards_env.envs import STATUS, BilliardsEnv, BilliardsVectorEnv, episodes
from billiards_env.envs.wrappers import VectorExecutionNoise
from tests.helpers.environments import VARIANTS

MODES = tuple(AutoresetMode)
modes = pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.value)


variants = pytest.mark.parametrize(
    ("kwargs", "mode"),
    [(kwargs, MODES[k % len(MODES)]) for k, kwargs in enumerate(VARIANTS)],
    ids=lambda value: ",".join(map(str, value.values()))[:60] if isinstance(value, dict) else value.value,
)
SOFT = {"n_object_balls": 2, "max_shots": 3, "max_speed": 2.0}  # some episodes end with a scratch, some at the limit
VARIED = {**SOFT, "randomize": {"mu_roll": [0.004, 0.02], "g": [5.0, 15.0]}, "observe_physics": True}
soft = pytest.mark.parametrize("kwargs", [SOFT, VARIED], ids=["soft", "varied"])


def pair(num_envs, autoreset, threads=None, **kwargs):
    """Returns the native vector environment and a SyncVectorEnv with the same arguments."""
    sync = SyncVectorEnv(
        [lambda: gym.make("Billiards-v0", **kwargs) for _ in range(num_envs)], autoreset_mode=autoreset
    )
    return BilliardsVectorEnv(num_envs, autoreset, threads, **kwargs), sync


def same(one: Any, other: Any) -> None:
    """Fails unless both are equal bit for bit: values, types, shapes and keys.

    Gymnasium's vector environments return bools of infos as objects, with None for an environment without an info.
    """
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key, value in one.items():
            same(value, other[key])
    elif isinstance(one, np.ndarray):
        if one.dtype == np.bool_ and other.dtype == object:
            other = np.array([False if value is None else value for value in other])
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        if one.dtype == object:
            for a, b in zip(one.tolist(), other.tolist(), strict=True):
                same(a, b)
        else:
            assert one.tobytes() == other.tobytes()
    elif isinstance(one, (tuple, list)):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            same(a, b)
    else:
        assert one == other


def compare(native, sync, steps, seed: Any = 0):
    """Plays the same random shots in both. In the mode "Disabled" a mask resets finished episodes."""
    same(native.reset(seed=seed), sync.reset(seed=seed))
    rng = np.random.default_rng(0)
    for _ in range(steps):
        actions = rng.uniform(-1, 1, (native.num_envs, 2)).astype(np.float32)
        results = native.step(actions)
        same(results, sync.step(actions))
        if native.autoreset_mode is AutoresetMode.DISABLED and results[2].any():
            same(*(envs.reset(options={"reset_mask": results[2].copy()}) for envs in (native, sync)))


@variants
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


def test_unseeded_environments_have_different_layouts_which_np_random_seed_reproduces():
    envs = BilliardsVectorEnv(20)
    first, _ = envs.reset()
    assert len(np.unique(first, axis=0)) == 20
    second, _ = envs.reset()
    assert not (first == second).any()
    assert np.array_equal(BilliardsVectorEnv(20).reset(seed=list(envs.np_random_seed))[0], first)
    assert not np.array_equal(BilliardsVectorEnv(20).reset()[0], first)


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
            mask |= native._episodes.arrays.over
        seed = [None, 40, [9, 8, 7, 6, None, 4]][step % 3]
        options = {"reset_mask": mask.copy()}
        same(native.reset(seed=seed, options=options), sync.reset(seed=seed, options=dict(options)))
        assert options.keys() == {"reset_mask"}
        actions = rng.uniform(-1, 1, (6, 2))
        same(native.step(actions), sync.step(actions))


def test_positions_from_options_draw_nothing():
    envs, single = BilliardsVectorEnv(2), BilliardsEnv()
    envs.reset(seed=0)
    states = [rng.bit_generator.state for rng in envs.np_random]
    positions = np.array([[[0.1, 0.2], [-0.3, -0.4]], [[0.5, 0.0], [-0.5, 0.0]]])
    observations, _ = envs.reset(options={"positions": positions})
    for observation, places in zip(observations, positions, strict=True):
        assert np.array_equal(observation, single.reset(options={"positions": places})[0])
    assert [rng.bit_generator.state for rng in envs.np_random] == states
    positions[0] = 9.0  # not in the mask, so not used
    positions[1, 0, 0] = 0.25
    again, _ = envs.reset(options={"positions": positions, "reset_mask": np.array([False, True])})
    assert np.array_equal(again[0], observations[0])
    assert again[1, 0] == np.float32(0.25 / 1.27)


@pytest.mark.parametrize("task", ["eight_ball", "nine_ball", "pot"])
def test_the_legal_balls_are_those_of_single_environments(task):
    envs, single = BilliardsVectorEnv(2, task=task), BilliardsEnv(task=task)
    envs.reset(seed=3)
    for i, legal in enumerate(envs.legal_balls):
        single.reset(seed=3 + i)
        assert np.array_equal(legal, single.legal_balls)


def test_goals_from_options():
    envs, single = BilliardsVectorEnv(2, task="place"), BilliardsEnv(task="place")
    goals = np.array([[0.1, 0.2], [-0.3, 0.4]])
    observations, _ = envs.reset(seed=3, options={"goal": goals})
    for i, goal in enumerate(goals):
        assert np.array_equal(observations[i], single.reset(seed=3 + i, options={"goal": goal})[0])
    assert np.array_equal(envs.goals, goals[:, None])
    goals[0] = 9.0  # not in the mask, so not used
    again, _ = envs.reset(options={"goal": goals, "reset_mask": np.array([False, True])})
    assert np.array_equal(again[0], observations[0])
    assert np.array_equal(again[1, -2:], observations[1, -2:])
    assert not np.array_equal(again[1, :4], observations[1, :4])
    with pytest.raises(ValueError, match=r"has shape \(2,\): expected \(2, 2\)"):
        envs.reset(options={"goal": goals[0]})


@modes
@soft
def test_returned_arrays_share_no_memory(mode, kwargs):
    envs = BilliardsVectorEnv(40, autoreset_mode=mode, **kwargs)
    rng = np.random.default_rng(0)

    def arrays(results):
        for value in results.values() if isinstance(results, dict) else results:
            if isinstance(value, dict):
                yield from arrays(value)
            elif isinstance(value, np.ndarray) and value.dtype != object:
                yield value

    twin = BilliardsVectorEnv(40, autoreset_mode=mode, **kwargs)
    twin.reset(seed=0)
    given = list(arrays(envs.reset(seed=0)))
    for _ in range(4):
        actions = rng.uniform(-1, 1, (40, 2))
        kept = actions.copy()
        results = envs.step(actions)
        assert np.array_equal(actions, kept)
        given += list(arrays(results))
        same(results, twin.step(actions))
        if mode is AutoresetMode.DISABLED and results[2].any():
            mask = results[2].copy()
            given += list(arrays(envs.reset(options={"reset_mask": mask})))
            twin.reset(options={"reset_mask": mask})
    for a, b in itertools.combinations(given, 2):
        assert not np.may_share_memory(a, b)
    inner = [envs._streams, *envs._episodes.shots, *envs._episodes.arrays, *envs._episodes.physics_arrays()]
    assert not any(np.may_share_memory(a, b) for a in given for b in inner)


def test_next_step_resets_ignore_the_action():
    envs = BilliardsVectorEnv(2, "NextStep")
    envs.reset(seed=0)
    envs.step(np.zeros((2, 2)))
    *_, infos = envs.step(np.full((2, 2), np.nan))
    assert infos.keys() == envs.reset()[1].keys()
    assert infos["shots_left"].tolist() == [1, 1]
    with pytest.raises(ValueError, match=r"action of environment 1 = \[0.0, nan\]: expected finite numbers"):
        envs.step([[0.0, 0.0], [0.0, np.nan]])


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_a_bad_action_raises_and_changes_nothing(mode):
    envs, twin = (BilliardsVectorEnv(3, autoreset_mode=mode) for _ in range(2))
    envs.reset(seed=0)
    twin.reset(seed=0)
    for actions, message in (
        (np.zeros((2, 2)), r"actions has shape \(2, 2\): expected \(3, 2\)"),
        (np.zeros(2), r"actions has shape \(2,\): expected \(3, 2\)"),
        ([[0, 0], [np.inf, 0], [0, 0]], r"action of environment 1 = \[inf, 0.0\]: expected finite numbers"),
    ):
        with pytest.raises(ValueError, match=message):
            envs.step(actions)
    same(envs.step(np.full((3, 2), 0.5)), twin.step(np.full((3, 2), 0.5)))


@modes
def test_step_without_episodes_raises(mode):
    envs = BilliardsVectorEnv(2, autoreset_mode=mode)
    with pytest.raises(ResetNeeded, match="call reset"):
        envs.step(np.zeros((2, 2)))
    with pytest.raises(ResetNeeded, match="never been reset: reset all environments first"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.reset()
    envs.step(np.zeros((2, 2)))
    if mode is AutoresetMode.DISABLED:
        with pytest.raises(ResetNeeded, match="The episode of environment 0 is over"):
            envs.step(np.zeros((2, 2)))
        envs.reset(options={"reset_mask": np.array([True, False])})
        with pytest.raises(ResetNeeded, match="The episode of environment 1 is over"):
            envs.step(np.zeros((2, 2)))


TWO_APART = [[0.0, 0.0], [0.5, 0.0]]


@pytest.mark.parametrize(
    ("kwargs", "error", "message"),
    [
        ({"seed": -1}, ValueError, "seed of environment 0 = -1: expected a whole number >= 0"),
        ({"seed": [1, 2.0]}, ValueError, "seed of environment 1 = 2.0: expected a whole number"),
        ({"seed": [1]}, ValueError, "seed has 1 entries: expected 2"),
        ({"options": [1]}, TypeError, r"options = \[1\]: expected a dict"),
        ({"options": {"position": 1}}, ValueError, "did you mean 'positions'"),
        ({"options": {"positions": TWO_APART}}, ValueError, r"shape \(2, 2\): expected \(2, 2, 2\)"),
        (
            {"options": {"positions": [TWO_APART, [[0, 0], [0.01, 0]]]}},
            ValueError,
            "shot 1, balls 0 and 1 are 0.01 m apart",
        ),
        ({"options": {"reset_mask": [True, True]}}, TypeError, "expected a NumPy array of bool"),
        ({"options": {"reset_mask": np.ones(2)}}, TypeError, "expected a NumPy array of bool"),
        ({"options": {"reset_mask": np.ones(3, bool)}}, ValueError, r"has shape \(3,\): expected \(2,\)"),
        ({"options": {"reset_mask": np.zeros(2, bool)}}, ValueError, "expected at least one environment to reset"),
    ],
)
def test_bad_resets_raise_and_the_episodes_continue(kwargs, error, message):
    envs = BilliardsVectorEnv(2, "NextStep")
    observations, _ = envs.reset(seed=0)
    states = [rng.bit_generator.state for rng in envs.np_random]
    with pytest.raises(error, match=message):
        envs.reset(**kwargs)
    assert [rng.bit_generator.state for rng in envs.np_random] == states
    assert np.array_equal(envs.step(np.zeros((2, 2)))[0], observations)


@pytest.mark.parametrize(
    ("kwargs", "error", "message"),
    [
        ({"num_envs": 0}, ValueError, "num_envs = 0: expected a whole number from 1 to 10000000"),
        ({"num_envs": 1.5}, ValueError, "num_envs = 1.5: expected a whole number from 1 to 10000000"),
        ({"threads": 0}, ValueError, "threads = 0: expected a whole number from 1 to 1024"),
        ({"autoreset_mode": "SameStp"}, ValueError, "autoreset_mode = 'SameStp': .*did you mean 'SameStep'"),
        ({"max_shots": 0}, ValueError, "max_shots = 0: expected a whole number from 1 to 1000000000"),
        ({"max_shot": 1}, TypeError, "max_shot"),
        ({"max_episode_steps": 5}, ValueError, "max_episode_steps = 5: expected max_shots, one step is one shot"),
    ],
)
def test_bad_arguments_raise(kwargs, error, message):
    with pytest.raises(error, match=message):
        BilliardsVectorEnv(**kwargs)


def test_by_default_every_step_plays_a_shot_in_every_environment():
    envs = gym.make_vec("Billiards-v0", num_envs=3)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    envs.reset(seed=0)
    for _ in range(3):
        *_, infos = envs.step(np.ones((3, 2)))
        assert (infos["final_info"]["n_events"] > 0).all()


@pytest.mark.parametrize(("kwargs", "mode"), list(zip(VARIANTS[-3:], MODES, strict=True)))
def test_make_vec(kwargs, mode):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        envs = gym.make_vec("Billiards-v0", num_envs=3, autoreset_mode=mode.value, **kwargs)
    assert isinstance(envs.unwrapped, BilliardsVectorEnv)
    assert envs.metadata["autoreset_mode"] is mode
    assert BilliardsVectorEnv.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    single = BilliardsEnv(**kwargs)
    assert envs.single_observation_space == single.observation_space
    assert envs.single_action_space == single.action_space
    assert envs.spec is not None
    spec = EnvSpec.from_json(envs.spec.to_json())
    observations, infos = envs.reset(seed=1)
    assert observations in envs.observation_space
    assert infos["shots_left"].tolist() == [single.max_shots] * 3
    twin = gym.make_vec(spec)
    assert np.array_equal(twin.reset(seed=1)[0], observations)
    envs.action_space.seed(0)
    observations, rewards, terminated, truncated, _ = envs.step(envs.action_space.sample())
    assert observations in envs.observation_space
    assert (rewards.dtype, terminated.dtype, truncated.dtype) == (np.float64, np.bool_, np.bool_)
    assert not truncated.any()
    envs.close()


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_wrappers_of_gymnasium(mode):
    logs = []
    for plain in pair(4, mode, **SOFT):
        envs: Any = wrappers.RecordEpisodeStatistics(plain)
        if mode is AutoresetMode.NEXT_STEP:  # wrappers of observations support this mode only
            envs = wrappers.FlattenObservation(envs)
        envs = wrappers.DictInfoToList(wrappers.ClipReward(envs, -1.0, 0.5))
        envs.reset(seed=0)
        rng = np.random.default_rng(0)
        log = []
        for _ in range(6):
            observations, rewards, _, _, infos = envs.step(rng.uniform(-1, 1, (4, 2)))
            log.append((observations.tolist(), rewards.tolist(), [sorted(info) for info in infos]))
        logs.append(log)
    assert logs[0] == logs[1]


@pytest.mark.parametrize(
    "wrap",
    [
        wrappers.NormalizeObservation,
        wrappers.FlattenObservation,
        lambda envs: wrappers.TransformObservation(envs, lambda seen: seen),
        lambda envs: wrappers.RescaleObservation(envs, 0.0, 1.0),
        lambda envs: wrappers.ReshapeObservation(envs, (2, 2)),
        lambda envs: wrappers.DtypeObservation(envs, np.float64),
    ],
)
def test_wrappers_of_observations_refuse_the_mode_same_step(wrap):
    with pytest.raises(ValueError, match="SAME_STEP"):
        wrap(BilliardsVectorEnv(2)).reset()


@pytest.mark.skipif(gym.__version__ < "1.4", reason="before 1.4 the wrapper ignores the mode SameStep")
def test_episode_statistics_are_those_of_the_episodes():
    envs: Any = wrappers.RecordEpisodeStatistics(BilliardsVectorEnv(20, **SOFT))
    envs.reset(seed=0)
    rng, totals, lengths = np.random.default_rng(0), np.zeros(20), np.zeros(20, int)
    for _ in range(6):
        _, rewards, over, _, infos = envs.step(rng.uniform(-1, 1, (20, 2)))
        totals, lengths = totals + rewards, lengths + 1
        if over.any():
            assert infos["episode"]["r"][over] == pytest.approx(totals[over])
            assert (infos["episode"]["l"][over] == lengths[over]).all()
        totals[over] = lengths[over] = 0


@pytest.mark.parametrize("copy_of", [copy.deepcopy, lambda envs: pickle.loads(pickle.dumps(envs))])
@soft
def test_a_copy_continues_like_its_original(copy_of, kwargs):
    envs = BilliardsVectorEnv(64, autoreset_mode="SameStep", **kwargs)
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (3, 64, 2))
    envs.step(actions[0])
    twin = copy_of(envs)
    for action in actions[1:]:
        same(envs.step(action), twin.step(action))


def test_a_shot_that_reaches_the_limit_on_events_warns(monkeypatch):
    monkeypatch.setattr(episodes, "MAX_EVENTS", 2)
    envs = BilliardsVectorEnv(2)
    positions = [[-0.5, 0.0], [0.5, 0.0]]
    envs.reset(options={"positions": [positions] * 2})
    with pytest.warns(RuntimeWarning, match=r"after 2 events and .* positions \[\[-0.5, 0.0\], .* action \[0.75, 0"):
        *_, infos = envs.step([[0.0, 0.0], [0.75, 0.0]])
    assert [STATUS[code] for code in infos["final_info"]["status_code"]] == ["rest", "event_limit"]


def test_a_layout_without_room_raises_from_a_thread(monkeypatch):
    envs = BilliardsVectorEnv(128, threads=2)
    hole = np.array([[0.0, 0.0, 9.0]])  # as large as the table
    monkeypatch.setattr(envs._episodes, "plan", envs._episodes.plan._replace(pockets=hole))
    with pytest.raises(ValueError, match="found no room for ball 0"):
        envs.reset(seed=0)


@pytest.mark.slow
def test_ten_million_steps_need_no_more_memory_than_a_million():
    resource = pytest.importorskip("resource")
    envs = BilliardsVectorEnv(4096, autoreset_mode="SameStep")
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (16, 4096, 2)).astype(np.float32)
    most = []
    for steps in (1_000_000, 9_000_000):
        for k in range(steps // 4096 + 1):
            envs.step(actions[k % 16])
        most.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert most[1] <= 1.01 * most[0]


def test_seeds_may_be_numpy_integers():
    def first(wrap=lambda envs: envs, **given):
        return wrap(gym.make_vec("Billiards-v0", num_envs=2)).reset(**given)[0].tobytes()

    for wrap in (lambda envs: envs, VectorExecutionNoise):
        assert first(wrap, seed=np.int64(3)) == first(wrap, seed=3)
        assert first(wrap, seed=[np.int64(3), np.uint8(4)]) == first(wrap, seed=3)
    env: Any = gym.make("Billiards-v0").unwrapped
    assert env.reset(seed=np.int64(3))[0].tobytes() == env.reset(seed=3)[0].tobytes()
    for seed in (np.float64(3), [True, 2], [np.int64(-1), 2]):
        with pytest.raises((TypeError, ValueError)):
            first(seed=seed)


def test_attributes_of_each_environment():
    native, sync = pair(3, "SameStep", **VARIED)
    for envs in (native, sync):
        envs.reset(seed=5)
        envs.step(np.full((3, 2), 0.3))
    for name in (
        "positions",
        "potted",
        "goals",
        "legal_balls",
        "np_random_seed",
        "max_shots",
        "scene",
        "episode_scene",
    ):
        same(native.get_attr(name), tuple(sync.get_attr(name)))
        same(native.call("get_wrapper_attr", name), native.get_attr(name))
    assert native.get_attr("np_random")[2].random() == sync.get_attr("np_random")[2].random()
    with pytest.raises(AttributeError, match="tusk"):
        native.get_attr("tusk")
    native.set_attr("max_speed", [1.0] * 3)
    assert native.get_attr("max_speed") == (1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match=r"max_speed = \[1.0, 2.0, 3.0\]: expected one value for all 3"):
        native.set_attr("max_speed", [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match=r"call\('reset'\): expected the method of the vector environment"):
        native.call("reset")
