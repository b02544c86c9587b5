"""Wrong arguments, resets and actions are refused with the name, the value and what was expected."""

import inspect
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import OrderEnforcing

from billiards_env.billiards_v0 import raw_env
from billiards_env.envs import make_env, make_model, make_vector_env
from tests.helpers.environments import STRIKE, same
from tests.helpers.errors import refusals

ALL_FIXED = {"base": "pool", "balls": {"radius": [0.02, 0.02], "mass": [0.1, "inf"]}}
RANGES = {"mu_roll": [0.004, 0.02], "e_ball": [0.8, 1.0]}
NO_TIMESTEP = {"mode": "pit", "dt": 1 / 60, "randomize": {"dt": [0, 1]}}
CUT_IN_THE_AIR = {"base": "jump_pool", "physics": {"max_time": 1.0}}
CAROM, OF_VECTOR = {"scene": "carom", "task": "carom"}, ("num_envs", "autoreset_mode", "threads")
EIGHT_BALL = {"task": "eight_ball", "n_players": 2}
ARGUMENTS = [*inspect.signature(make_model).parameters, "render_mode", *OF_VECTOR]


@pytest.mark.parametrize("name", ARGUMENTS)
def test_every_argument_refuses_a_value_of_a_wrong_type(name):
    game = {"task": "snooker", "n_players": 2, "can_call": True}
    for make in (make_vector_env,) if name in OF_VECTOR else (make_env, make_vector_env):
        for others in ({}, game, {"task": "place", "mode": "pit", "dt": 0.01}):
            with pytest.raises((TypeError, ValueError), match=rf"^{name} = <object .*: expected "):
                make(**{**others, name: object()})


@pytest.mark.parametrize("make", [make_env, make_vector_env, raw_env])
def test_an_unknown_argument_has_the_words_of_python_too(make):
    """TorchRL first passes `frameskip`, and makes the environment without it if the message has these words."""
    words = (
        rf"^frameskip = 1: expected one of the arguments .*; {make.__name__}\(\) got an unexpected keyword argument 'fr"
    )
    with pytest.raises(TypeError, match=words):
        make(frameskip=1)


WRONG: list[tuple[Any, ...]] = [
    ({"scene": ALL_FIXED, "n_object_balls": 2}, "n_object_balls = 2 with a scene without a name: expected None"),
    ({"n_object_balls": 0}, "task = 'pot' with a scene of the cue ball alone: expected at least one object ball"),
    ({"task": "sum_to_three", "n_object_balls": 2}, "'sum_to_three' with 2 object balls and 0 pockets: expected 1"),
    ({"scene": "carom"}, "'pot' with 2 object balls and 0 pockets: expected object balls and a table with"),
    ({"scene": ALL_FIXED}, "task = 'pot' with object balls of infinite mass only: expected one of finite mass"),
    ({"layout": "line", "n_object_balls": 2}, "layout = 'line' with 2 object balls: expected 1"),
    ({"observe_shot": True}, "observe_shot = True: expected one of .*observe", TypeError),
    ({"observe": "positions"}, "observe = 'positions': expected a list", TypeError),
    ({"observe": ["positon"]}, r"observe = 'positon': expected one of .* \(did you mean 'positions'\?\)"),
    ({"observe": []}, r"observe = \[\]: expected at least one feature"),
    ({"observe": ["potted", "potted"]}, r"observe = \['potted', 'potted'\]: .* each of them once"),
    ({"observe": ["pixels"]}, r"observe = 'pixels': expected \('pixels', 'height', 'width'\)"),
    ({"observe": [["positions", 84, 84]]}, r"observe = \('positions', 84, 84\): expected 'positions'"),
    ({"observe": [["planes", 84, 4]]}, "width of 'planes' in observe = 4: expected"),
    ({"observe": "goal"}, "observe = 'goal': expected a task with a goal"),
    ({"observe": ["free_to_pockets"], **CAROM}, "a table with pockets in the environment"),
    ({"task": "jump", "action": "velocity"}, "action = 'velocity' and physics.flight = True: expected action 'strike'"),
    ({"task": "jump", "action": "cut"}, "task = 'jump' with action = 'cut' .*: expected action 'strike'"),
    ({"task": "jump", "scene": "pool", "n_object_balls": 2}, "physics.flight = False: .*, such as scene 'jump_pool'"),
    ({"action": "sum_to_three"}, "max_speed = 4.0 with action 'sum_to_three': expected at least 4.185"),
    ({"action": "plan", **CAROM}, "action = 'plan': expected an object ball and a table"),
    ({**CAROM, "scene": "ideal", "action": "strike"}, "action = 'strike' with physics.motion = 'ideal': expected"),
    ({"randomize": {"dt": [0.01, 0.02]}}, r"randomize\['dt'\] with mode='pic': expected mode='pit'"),
    ({"randomize": {"mu_roll": 0.01}}, r"randomize\['mu_roll'\] = 0.01: expected \(low, high\)", TypeError),
    ({"randomize": {"mu_roll": [0.01]}}, r"randomize\['mu_roll'\] = \[0.01\]: expected \(low, high\)"),
    ({"randomize": {"mu_roll": [0.02, 0.01]}}, r"randomize\['mu_roll'\] = \[0.02, 0.01\]: .* with low < high"),
    ({"randomize": {"mu_roll": [-1, 1]}}, "randomize: physics.mu_roll = -1.0: expected a number from 1e-12 to 100"),
    (NO_TIMESTEP, "randomize: dt = 0.0 with mode='pit': expected the timestep"),
    ({"noise": {"angle_std": -0.1}}, "angle_std = -0.1: expected a number from 0 to "),
    ({"noise": {"angle": 0.1}}, "key of noise = 'angle': expected one of 'angle_std'"),
    # Games
    ({"task": "pot", "n_players": 2}, "task = 'pot' with n_players = 2: expected one of 'straight'"),
    ({"task": "snooker"}, "task = 'snooker' with n_players = 1: expected n_players = 2"),
    ({"target": 3}, "target = 3 with n_players = 1: expected None"),
    ({"task": "nine_ball", "n_players": 2, "layout": "line"}, "layout = 'line'"),
    ({"task": "one_pocket", "n_players": 2, "can_call": True}, "can_call = True with task = 'one_pocket'"),
    ({**EIGHT_BALL, "can_call": True, "action": "plan"}, "can_call = True with action = 'plan'"),
    ({"scene": CUT_IN_THE_AIR}, "max_time = 1.0 with physics.flight = True: expected None in an env"),
    ({"task": "snooker", "n_players": 2, "miss": True}, "miss = True with can_call = False"),
    ({**EIGHT_BALL, "n_object_balls": 9}, "9 object balls and 6 pockets: expected 15 object balls"),
]


@refusals("arguments", WRONG)
def test_wrong_arguments(arguments, message, kind):
    for make in (make_env, make_vector_env):
        with pytest.raises(kind, match=message):
            make(**arguments)


def test_the_limit_on_steps_of_gymnasium_is_refused():
    with pytest.raises(ValueError, match="max_episode_steps = 5: expected max_shots, one step is one shot"):
        make_vector_env(max_episode_steps=5)


APART, CLOSE = [[0.0, 0.0], [0.5, 0.0]], [[0.0, 0.0], [0.01, 0.0]]
OPTIONS: list[tuple[Any, ...]] = [
    ({"position": []}, "key of options = 'position': expected one of 'positions', 'goal', .*did you mean 'pos"),
    ([1, 2], r"options = \[1, 2\]: expected a dict", TypeError),
    ({"positions": [[0, 0]]}, r"options\['positions'\] has shape \(1, 2\): expected \(2, 2\)"),
    ({"positions": [[0, 0], [0.01, 0]]}, "balls 0 and 1 are 0.01 m apart: expected at least 0.05715"),
    ({"goal": [[0, 0]]}, r"options\['goal'\] has shape \(1, 2\): expected \(2,\)"),
    ({"goal": [0, 0.62]}, r"options\['goal'\] as a position of the cue ball: .* at \[0.0, 0.62\]: .* inside"),
    ({"physics": 0.01}, r"options\['physics'\] = 0.01: expected a mapping", TypeError),
    ({"physics": {"g": 9.0}}, r"key of options\['physics'\] = 'g': expected one of 'mu_roll', 'e_ball'"),
    ({"physics": {"mu_roll": [0.01]}}, r"options\['physics'\]\['mu_roll'\] has shape \(1,\): expected \(\)"),
    ({"physics": {"mu_roll": 0.03}}, r"'mu_roll'\] = 0.03: expected a number from 0.004 to 0.02, as in randomize"),
]
RESETS_OF_TWO: list[tuple[Any, ...]] = [
    ({"seed": -1}, "seed of environment 0 = -1: expected a whole number >= 0"),
    ({"seed": [1, 2.0]}, "seed of environment 1 = 2.0: expected a whole number"),
    ({"seed": np.float64(3)}, r"seed = 3.0: expected a whole number", TypeError),
    ({"seed": [1]}, "seed has 1 entries: expected 2"),
    ({"options": {"positions": APART[:1]}}, r"shape \(1, 2\): expected \(2, 2, 2\)"),
    ({"options": {"positions": [APART, CLOSE]}}, "shot 1, balls 0 and 1 are 0.01 m apart"),
    ({"options": {"reset_mask": [True, True]}}, "expected a NumPy array of bool", TypeError),
    ({"options": {"reset_mask": np.ones(3, bool)}}, r"has shape \(3,\): expected \(2,\)"),
    ({"options": {"reset_mask": np.zeros(2, bool)}}, "expected at least one environment"),
]


RESETS = [
    *((lambda: make_env(task="place", randomize=RANGES), {"options": one}, *rest) for one, *rest in OPTIONS),
    *((lambda: make_vector_env(2, "NextStep", task="place"), start, *rest) for start, *rest in RESETS_OF_TWO),
    (
        make_env,
        {"options": {"physics": {"g": 9}}},
        r"options\['physics'\] = {'g': 9} without randomize: expected the arg",
    ),
    (make_env, {"options": {"goal": [0, 0]}}, "key of options = 'goal': expected one of 'positions'"),
]


@refusals("make, start", RESETS)
def test_after_a_wrong_reset_the_episodes_continue(make, start, message, kind):
    env = make()
    observations, _ = env.reset(seed=0)
    state = env.get_state()
    with pytest.raises(kind, match=message):
        env.reset(**start)
    assert (env.get_state() == state).all()
    assert np.array_equal(env.step(np.zeros(env.action_space.shape))[0], observations)


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (make_env, "model scene task engine action max_speed observe features"),
        (make_vector_env, "num_envs autoreset_mode single_env"),
    ],
)
def test_what_a_step_reads_elsewhere_too_cannot_be_assigned(make, names):
    env = make()
    for name in names.split():
        before = getattr(env, name)
        with pytest.raises(AttributeError, match=rf"^{name} = .*: expected no change"):
            setattr(env, name, 1.0)
        assert getattr(env, name) is before


THREE, INFINITE = {"num_envs": 3, "autoreset_mode": "Disabled"}, [[0, 0], [np.inf, 0], [0, 0]]


WRONG_ACTIONS = [
    (make_env, {}, [np.nan, 0.0], r"action = \[nan, 0.0\]: expected finite numbers"),
    (make_env, STRIKE, [0.1, 0.2], r"action has shape \(2,\): expected \(5,\)"),
    (make_env, EIGHT_BALL, [0.1, 0.2], r"action has shape \(2,\): expected \(4,\)"),
    (make_vector_env, THREE, np.zeros((2, 2)), r"actions has shape \(2, 2\): expected \(3, 2\)"),
    (make_vector_env, THREE, INFINITE, r"action of environment 1 = \[inf, 0.0\]: expected finite numbers"),
]


@refusals("make, arguments, action", WRONG_ACTIONS)
def test_a_wrong_action_changes_nothing(make, arguments, action, message, kind):
    env, twin = make(**arguments), make(**arguments)
    for one in (env, twin):
        one.reset(seed=0)
    with pytest.raises(kind, match=message):
        env.step(action)
    usual = np.full(env.action_space.shape, 0.1)
    same(env.step(usual), twin.step(usual))


def test_a_step_without_an_episode():
    env = make_env()
    with pytest.raises(ResetNeeded, match=r"over or has not begun: call reset\(\)"):
        env.step(np.zeros(2))
    for _ in range(2):
        env.reset(seed=0)
        env.step(np.zeros(2))
        with pytest.raises(ResetNeeded, match=r"over or has not begun: call reset\(\)"):
            env.step(np.zeros(2))
    assert isinstance(gym.make("Billiards-v0"), OrderEnforcing)


@pytest.mark.parametrize("mode", AutoresetMode, ids=lambda mode: mode.value)
def test_a_step_of_the_vector_environment_without_episodes(mode):
    envs: Any = make_vector_env(2, autoreset_mode=mode)
    first = {"reset_mask": np.array([True, False])}
    with pytest.raises(ResetNeeded, match="call reset"):
        envs.step(np.zeros((2, 2)))
    with pytest.raises(ResetNeeded, match="never been reset: reset all environments first"):
        envs.reset(options=first)
    envs.reset()
    envs.step(np.zeros((2, 2)))
    if mode is AutoresetMode.DISABLED:
        for over, start in enumerate((first, None)):
            with pytest.raises(ResetNeeded, match=f"The episode of environment {over} is over"):
                envs.step(np.zeros((2, 2)))
            envs.reset(options=start)
