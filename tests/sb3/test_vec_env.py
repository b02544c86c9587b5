"""The adapter agrees with the DummyVecEnv of Stable-Baselines3."""

from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorWrapper
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize, VecVideoRecorder

from billiards_env.envs import BilliardsVectorEnv, Opponents, make_vector_env
from billiards_env.sb3.vec_env import SameStepVecEnv
from tests.helpers.environments import SOFT

KEPT = ("terminal_observation", "TimeLimit.truncated", "is_success")


def pair(num_envs, **kwargs) -> tuple[Any, Any]:
    """The adapter and a DummyVecEnv."""
    native = gym.make_vec("Billiards-v0", num_envs=num_envs, autoreset_mode="SameStep", **kwargs)
    return SameStepVecEnv(native), DummyVecEnv([lambda: gym.make("Billiards-v0", **kwargs)] * num_envs)


def test_the_docstring_of_the_class_in_the_error_for_the_vector_environment_itself_names_the_adapter():
    with pytest.raises(ValueError, match=r"BilliardsVectorEnv"):
        PPO("MlpPolicy", cast(Any, gym.make_vec("Billiards-v0", num_envs=2)))
    assert "`billiards_env.sb3.SameStepVecEnv(envs)`" in (BilliardsVectorEnv.__doc__ or "")


@pytest.mark.parametrize("kwargs", [{}, SOFT], ids=["one shot", "three shots"])
@pytest.mark.parametrize("wrapper", [lambda envs: envs, VecMonitor, VecNormalize])
@pytest.mark.filterwarnings("ignore:The environment is already wrapped with a `Monitor`:UserWarning")
def test_the_adapter_agrees_with_dummy_vec_env(kwargs, wrapper):
    native, dummy = (wrapper(envs) for envs in pair(7, **kwargs))
    rng = np.random.default_rng(0)
    for start in range(2):
        if start == 0:
            assert native.seed(3) == dummy.seed(3)
        observations = native.reset()
        assert observations.tobytes() == dummy.reset().tobytes()
        for info, other in zip(native.reset_infos, dummy.reset_infos, strict=True):
            assert info.keys() == other.keys()
            assert all((info[key] == other[key]).all() for key in info)
        finished = 0
        for _ in range(6):
            actions = rng.uniform(-1, 1, (7, 2)).astype(np.float32)
            *told, infos = native.step(actions)
            *expected, all_infos = dummy.step(actions)
            for one, other in zip(told, expected, strict=True):
                assert (one.dtype, one.shape) == (other.dtype, other.shape)
                assert one.tobytes() == other.tobytes()
            assert isinstance(infos, list)
            if all(told[2]):
                for key in ("n_events", "shot_time", "status_code"):
                    assert native.infos["final_info"][key].tolist() == [info[key] for info in all_infos]
            for done, info, full in zip(told[2], infos, all_infos, strict=True):
                finished += done
                assert info.keys() == ({*KEPT, "episode"} if done else set())
                for key, value in info.items():
                    if key not in full:  # only VecMonitor reports the episodes of a DummyVecEnv
                        continue
                    assert isinstance(value, type(full[key])) or type(full[key]) is np.bool_
                    if key != "episode":
                        np.testing.assert_array_equal(value, full[key])
        assert finished > 6


def test_episode_infos_agree_with_vec_monitor():
    native, dummy = pair(5, **SOFT)
    monitored = VecMonitor(dummy)
    rng = np.random.default_rng(1)
    for start in range(2):
        for envs in (native, monitored):
            envs.seed(start)
            envs.reset()
        for _ in range(8):  # no multiple of an episode's shots: the second start cuts episodes off
            actions = rng.uniform(-1, 1, (5, 2)).astype(np.float32)
            *_, dones, infos = native.step(actions)
            for done, info, other in zip(dones, infos, monitored.step(actions)[3], strict=True):
                assert ("episode" in info) == done
                if done:
                    mine, theirs = info["episode"], other["episode"]
                    assert (mine.keys(), mine["l"], type(mine["r"])) == (theirs.keys(), theirs["l"], float)
                    assert mine["r"] == pytest.approx(theirs["r"], rel=1e-6)  # VecMonitor's is a float32


def test_options_of_every_environment():
    native, dummy = pair(2, task="place", randomize={"mu_roll": [0.004, 0.02]})
    options = [
        {"positions": [[0.1, 0.2], [0.3, 0.1 * k]], "goal": [0.1 * k, 0.3], "physics": {"mu_roll": 0.01 + 0.001 * k}}
        for k in range(2)
    ]
    for envs in (native, dummy):
        envs.set_options(options)
    assert np.array_equal(native.reset(), dummy.reset())
    assert [info["mu_roll"] for info in native.reset_infos] == [info["mu_roll"] for info in dummy.reset_infos]
    again = native.reset()
    native.set_options(options[0])
    assert not np.array_equal(native.reset(), again)
    for bad, message in (
        ([options[0], {}], "expected the same keys for every"),
        ({"seat": 3}, "key of options = 'seat'"),
    ):
        native.set_options(bad)
        with pytest.raises(ValueError, match=message):
            native.reset()


def test_attributes_and_methods_belong_to_all_environments():
    native, dummy = pair(3)
    for envs in (native, dummy):
        envs.seed(2)
        envs.reset()
    names = "max_speed scene action render_mode task positions potted episode_scene observation_space action_space"
    for name in names.split():
        for indices in (None, 1, [0, 2]):
            for one, other in zip(native.get_attr(name, indices), dummy.get_attr(name, indices), strict=True):
                assert np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other
    assert native.has_attr("task")
    assert not native.has_attr("tusk")
    assert native.env_is_wrapped(Monitor) == [True] * 3  # the infos have `episode`
    assert native.env_is_wrapped(gym.wrappers.TimeLimit, [1]) == [False]
    assert native.env_method("get_wrapper_attr", "task") == dummy.env_method("get_wrapper_attr", "task")
    with pytest.raises(ValueError, match=r"set_attr\('metadata'\) for environments \[1\]: expected all 3"):
        native.set_attr("metadata", {}, indices=1)
    with pytest.raises(ValueError, match=r"call\('reset'\): expected the method of the vector environment"):
        native.env_method("reset")
    assert native.env_method("get_wrapper_attr", "task", indices=[0, 2]) == ["pot"] * 2
    native.set_attr("metadata", {})
    assert native.get_attr("metadata") == [{}] * 3
    with pytest.raises(AttributeError, match=r"^max_speed = 1.0: expected no change"):
        native.set_attr("max_speed", 1.0)
    one, other = (envs.step(np.full((3, 2), 0.5))[3] for envs in (native, dummy))
    assert np.array_equal(one[0]["terminal_observation"], other[0]["terminal_observation"])


def test_attributes_and_methods_of_wrappers():
    class Counted(VectorWrapper):
        seen = 2

        def add(self, count):
            self.seen += count
            return self.seen

    games = make_vector_env(2, task="nine_ball", n_players=2)
    opponents = Opponents(games, lambda observations, rows: np.ones((len(rows), 4)))
    envs = SameStepVecEnv(Counted(opponents))
    envs.set_attr("policy", new := lambda observations, rows: np.zeros((len(rows), 4)))
    assert opponents.policy is new
    assert envs.get_attr("policy") == [new] * 2
    assert envs.env_method("add", 3, indices=[1]) == [5]
    envs.set_attr("seen", 0)
    assert envs.get_attr("seen", 1) == [0]
    with pytest.raises(ValueError, match=r"set_attr\('policy'\) for environments \[1\]: expected all 2"):
        envs.set_attr("policy", new, indices=1)
    assert envs.get_attr("task") == ["nine_ball"] * 2
    with pytest.raises(AttributeError, match=r"^polici = 1: expected an attribute"):
        envs.set_attr("polici", 1)
    opponents.close()


def test_a_game_without_opponents_warns():
    with pytest.warns(UserWarning, match="envs with n_players = 2: expected Opponents"):
        SameStepVecEnv(make_vector_env(2, task="nine_ball", n_players=2))


def test_learners_find_the_masks_of_plans():
    utils = pytest.importorskip("sb3_contrib.common.maskable.utils")
    kwargs = {"action": "plan", "max_shots": 2}
    native, dummy = pair(3, **kwargs)
    for envs in (native, dummy):
        envs.seed(1)
        envs.reset()
    for _ in range(3):
        masks = utils.get_action_masks(native)
        assert np.array_equal(masks, utils.get_action_masks(dummy))
        for envs in (native, dummy):
            envs.step(masks.argmax(axis=1))
    assert np.array_equal(native.env_method("action_masks", indices=[2]), utils.get_action_masks(native)[2:])
    assert np.array_equal([masks() for masks in native.get_attr("action_masks")], utils.get_action_masks(native))
    single = gym.make("Billiards-v0", **kwargs)
    assert utils.get_action_masks(single).shape == (30,)
    for env in (native, dummy, VecNormalize(native), single):
        assert utils.is_masking_supported(env)
    for env in (*pair(2), gym.make("Billiards-v0")):
        assert not utils.is_masking_supported(env)


def test_images_equal_those_of_dummy_vec_env(tmp_path):
    pytest.importorskip("pygame")
    native, dummy = pair(2, render_mode="rgb_array", **SOFT)
    with pytest.raises(ResetNeeded, match="call reset"):
        native.render()
    for envs in (native, dummy):
        envs.seed(0)
        envs.reset()
        assert not envs.step(np.full((2, 2), 0.1))[2].any()
    assert np.array_equal(native.render(), dummy.render())
    assert [image.shape for image in native.env_method("render")] == [image.shape for image in native.get_images()]
    films = VecVideoRecorder(native, str(tmp_path), lambda step: step == 0, video_length=2)
    films.reset()
    for _ in range(3):
        films.step(np.zeros((2, 2)))
    films.close()
    assert films.frames_per_sec == dummy.get_attr("metadata")[0]["render_fps"]
    assert len(list(tmp_path.glob("*.mp4"))) == 1
    with pytest.warns(UserWarning, match="expected 'rgb_array'"):
        assert pair(2)[0].get_images() == [None, None]


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED])
def test_other_autoreset_modes_are_refused(mode):
    with pytest.raises(ValueError, match=r"expected AutoresetMode\.SAME_STEP"):
        SameStepVecEnv(gym.make_vec("Billiards-v0", num_envs=2, autoreset_mode=mode))


def test_any_vector_environment_with_same_step_resets_is_accepted():
    envs = gym.make_vec(
        "CartPole-v1",
        num_envs=2,
        vectorization_mode="sync",
        max_episode_steps=5,
        vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
    )
    envs = SameStepVecEnv(envs)
    envs.reset()
    assert envs.get_attr("gravity", [1]) == [9.8]
    for step in range(1, 5):
        assert not envs.step(np.array([step % 2] * 2))[2].any()
    *_, dones, infos = envs.step(np.array([1, 1]))
    assert dones.all()
    assert [info["TimeLimit.truncated"] for info in infos] == [True, True]
