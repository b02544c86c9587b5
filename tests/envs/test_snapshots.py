"""The state of environments: held, copied, stacked, saved and put back, with the same bits after it."""

import copy
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env.envs import BilliardsEnv, load_state, make_env, make_vector_env, save_state
from billiards_env.games import GAMES
from billiards_env.games.game_state import CALL, VERDICT
from tests.helpers.environments import NINE, VARIED, kinds, same
from tests.helpers.errors import refusals
from tests.helpers.heap import fill_heap


def played(env, actions):
    """Returns the results of steps. A single environment begins a new episode after the end of one."""
    log = []
    for action in actions:
        log.append(env.step(action))
        if isinstance(env, BilliardsEnv) and log[-1][2]:
            log.append(env.reset())
    return log


def random_actions(env, count, seed):
    return np.random.default_rng(seed).uniform(-1, 1, (count, *env.action_space.shape))


@kinds
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**40), before=st.integers(0, 4))
def test_a_restored_environment_continues_with_the_same_bits(kwargs, seed, before):
    env, other = make_env(**kwargs), make_env(**kwargs)
    env.reset(seed=seed)
    actions = random_actions(env, 8, seed)
    played(env, actions[:before])
    state = env.get_state()
    kept, expected = state.copy(), played(env, actions[before:])
    for one in (env, other):
        one.set_state(state)
        twin = copy.deepcopy(one)
        same(played(one, actions[before:]), expected)
        same(played(twin, actions[before:]), expected)
        assert (one.get_state() == env.get_state()).all()
    assert (state == kept).all()


@kinds
@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
def test_rows_of_a_vector_environment_continue_in_any_place(kwargs, mode):
    envs, others = make_vector_env(6, mode, **kwargs), make_vector_env(3, mode, **kwargs)
    envs.reset(seed=4)
    actions = random_actions(envs, 6, 0)
    played(envs, actions[:2])
    state, rows = envs.get_state(), np.array([4, 1, 5])
    assert (envs.get_state(rows) == state[rows]).all()
    expected = played(envs, actions[2:])
    others.set_state(state[rows])
    for moved, stayed in zip(played(others, actions[2:, rows]), expected, strict=True):
        assert all(map(np.array_equal, moved[:3], [array[rows] for array in stayed[:3]]))
    envs.set_state(state)
    same(played(envs, actions[2:]), expected)
    single = make_env(**kwargs)
    single.set_state(state[2])
    if not state["over"][2]:
        assert single.step(actions[2, 2])[1] == expected[0][1][2]
    envs.set_state(state[:3], [3, 4, 5])
    assert (envs.get_state([3, 4, 5]) == state[:3]).all()


@kinds
def test_the_info_repeats_an_automatic_episode_alone(kwargs):
    envs, env = make_vector_env(4, **kwargs), make_env(**kwargs)
    observations, infos = envs.reset(seed=9)
    actions = random_actions(envs, 8, 3)
    begun = {k: (infos["episode_seed"][k], observations[k], []) for k in range(4)}
    repeated = 0
    for action in actions:
        observations, rewards, over, _, infos = envs.step(action)
        for k in range(4):
            begun[k][2].append((action[k], rewards[k]))
            if over[k]:
                seed, first, shots = begun[k]
                assert env.reset(options={"episode_seed": seed})[0].tobytes() == first.tobytes()
                assert all(env.step(shot)[1] == reward for shot, reward in shots)
                begun[k] = infos["episode_seed"][k], observations[k], []
                repeated += 1
    assert repeated > 6
    again = envs.reset(options={"episode_seed": np.array([begun[k][0] for k in range(4)])})[0]
    assert again.tobytes() == np.array([begun[k][1] for k in range(4)]).tobytes()


def test_a_state_survives_a_file(tmp_path):
    envs = make_vector_env(3, **NINE)
    envs.reset(seed=0)
    save_state(tmp_path / "state.npz", envs.get_state())
    loaded = load_state(tmp_path / "state.npz")
    assert loaded.dtype == envs.get_state().dtype
    assert (loaded == envs.get_state()).all()
    assert np.array_equal(np.stack([loaded[0], loaded[1]]), loaded[:2])
    np.savez(tmp_path / "code.npz", state=np.array([print], object))
    (tmp_path / "text.npz").write_text("state")
    np.savez(tmp_path / "other.npz", other=np.zeros(1))
    for name in ("code", "text", "other"):
        with pytest.raises(ValueError, match="expected a file of save_state"):
            load_state(tmp_path / f"{name}.npz")


def test_equal_states_have_equal_bytes(tmp_path):
    env, envs = make_env(**NINE), make_vector_env(3, **NINE)
    env.reset(seed=0)
    envs.set_state(first := env.get_state())
    makers = [
        lambda: env.get_state(),
        lambda: envs.get_state()[1],
        lambda: first.copy(),
        lambda: np.stack([first, first])[0],
        lambda: np.where(True, first, first),
        lambda: envs.get_state([2])[0],
    ]
    found, files, sizes = set(), set(), [count * first.itemsize for count in (1, 2, 3)]
    for byte in (0, 255):
        for make in makers:
            fill_heap(byte, *sizes)
            found.add(make().tobytes())
        fill_heap(byte, *sizes)
        save_state(tmp_path / "state.npz", envs.get_state())
        files.add(load_state(tmp_path / "state.npz").tobytes())
    assert found == {first.tobytes()}
    assert files == {3 * first.tobytes()}


ROWS = [CALL, VERDICT, *(kind for game in GAMES.values() for kind in (game.state_type, game.facts_type))]


@pytest.mark.parametrize("kind", ROWS)
def test_each_byte_of_a_row_of_a_game_belongs_to_a_field(kind):
    assert kind.itemsize == sum(kind[name].itemsize for name in kind.names)
    assert kind.isalignedstruct


def changed(**values: Any) -> np.ndarray:
    """Returns two states of `make_vector_env(2)`. The second has other values."""
    envs = make_vector_env(2)
    envs.reset(seed=0)
    state = envs.get_state()
    for name, value in values.items():
        state[name][1] = value
    return state


WRONG_STATES = [
    (lambda: [1, 2], r"state = \[1, 2\]: expected an array that get_state returned", TypeError),
    (lambda: np.zeros(2), "expected an array that get_state returned", TypeError),
    (lambda: changed()[[0, 1, 0]], "state has 3 rows: expected 2 or 1"),
    (lambda: changed(task="carom"), r"state\['task'\] = b'carom': expected b'pot', the task of"),
    (lambda: make_vector_env(2, scene="uk_pool").get_state(), r"state\['scene'\] = .* the scene of"),
    (lambda: make_vector_env(2, randomize={"g": (9, 10)}).get_state(), r"state\['scene'\]"),
    (lambda: changed(positions=np.nan), r"state\['positions'\] has numbers that are not finite"),
    (lambda: changed(positions=0.1), "positions: shot 1, balls 0 and 1 are 0.0 m apart: expected"),
    (lambda: changed(positions=[[0, 0], [9, 0]]), r"positions: shot 1, ball 1 is at \[9.0, 0.0\]"),
    (lambda: changed(fresh=False, shots_left=2), r"state\['shots_left'\] = .*expected 1 to max_shots = 1"),
]


@refusals("state", WRONG_STATES)
def test_a_state_that_does_not_fit_is_refused_and_changes_nothing(state, message, kind):
    envs = make_vector_env(2)
    envs.reset(seed=0)
    before = envs.get_state()
    with pytest.raises(kind, match=message):
        envs.set_state(state())
    with pytest.raises(ValueError, match=r"rows = \[2\]: expected numbers of environments"):
        envs.get_state([2])
    assert (envs.get_state() == before).all()


ZEROS, EVEN = np.zeros(4, np.uint64), np.array([1, 2, 3, 4], np.uint64)
"""No streams: PCG64 with an even increment does not mix the last bits, and with zeros returns only zeros."""
UNSEEDED = [
    ({}, {"stream": ZEROS}, r"state\['stream'\] is not seeded: expected a state of an environment"),
    ({}, {"stream": EVEN}, r"state\['stream'\] is not seeded"),
    ({}, {"episode_seed": np.tile(ZEROS, 2)}, r"state\['episode_seed'\] is not seeded"),
    ({"noise": {}}, {"noise_stream": ZEROS}, r"state\['noise_stream'\] is not seeded: expected .* with noise"),
    ({"noise": {}}, {"noise_stream": ZEROS, "begun": False}, r"state\['noise_stream'\] is not seeded"),
    ({"noise": {}}, {"episode_seed": np.array([1, 1, 1, 1, 0, 0, 0, 0])}, r"state\['episode_seed'\] is not seeded"),
]


@refusals("kwargs, values", UNSEEDED)
def test_a_state_with_an_unseeded_stream_is_refused(kwargs, values, message, kind):
    for env in (make_env(**kwargs), make_vector_env(2, **kwargs)):
        env.reset(seed=0)
        state = env.get_state()
        for name, value in values.items():
            state.reshape(-1)[name][-1] = value
        with pytest.raises(kind, match=message):
            env.set_state(state)


def test_an_environment_without_noise_takes_the_state_of_a_noisy_one():
    plain, noisy = make_env(), make_env(noise={})
    noisy.reset(seed=0)
    plain.set_state(noisy.get_state())


@pytest.mark.parametrize("kwargs", [{}, {"noise": {}}, {"action": "plan"}], ids=["plain", "noisy", "plans"])
def test_a_state_before_the_first_episode_is_set_but_not_played(kwargs):
    env: Any
    for env in (make_env(**kwargs), make_vector_env(2, **kwargs)):
        state = env.get_state()
        env.set_state(state)
        state["over"] = False
        env.set_state(state)
        with pytest.raises(ResetNeeded):
            env.step(np.zeros(env.action_space.shape))
        assert not (env.reset()[1]["episode_seed"] == 0).all()


def test_the_generator_of_an_environment_is_checked():
    with pytest.raises(TypeError, match=r"np_random = 3: expected a numpy\.random\.Generator"):
        make_env().np_random = cast(Any, 3)


TWO_PLAYERS = {"task": "nine_ball", "n_players": 2}
WRONG_NUMBERS = [
    (NINE, {"player": 10**9}, "player = .*1000000000.* of .*2.* players: expected 0 to the number less 1"),
    (NINE, {"n_players": 0}, "expected 0 to the number less 1"),
    (NINE, {"breaker": 7}, "breaker = .*7.* of .*2.* players: expected 0 to the number less 1"),
    (TWO_PLAYERS, {"cue_balls": 11}, "cue_balls = "),
    (TWO_PLAYERS, {"choices": 1 << 4}, "has the choice 'replace'"),
    (TWO_PLAYERS, {"object_balls": -1}, "object_balls = "),
    (TWO_PLAYERS, {"object_balls": 1 << 10}, "object_balls = "),
    (TWO_PLAYERS | {"task": "snooker"}, {"reds": 70}, "reds = "),
    *((TWO_PLAYERS, {name: 4}, f"{name} = ") for name in ("n_players", "target", "call_shot")),
    (VARIED, {"physics": -1.0}, r"state\['physics'\], mu_roll = .*: expected numbers from 0.004 to 0.02, as in"),
]


@refusals("kwargs, values", WRONG_NUMBERS)
def test_numbers_that_no_episode_has_are_refused(kwargs, values, message, kind):
    env = make_env(**kwargs)
    env.reset(seed=0)
    state = env.get_state()
    for name, value in values.items():
        (state if name in state.dtype.names else state["game"])[name] = value
    with pytest.raises(kind, match=message):
        env.set_state(state)


def test_the_generator_of_a_copy_is_its_own():
    env: Any = gym.make("Billiards-v0", render_mode=None).unwrapped
    env.reset(seed=3)
    twin = copy.deepcopy(env)
    assert twin.np_random.random() == env.np_random.random()
    state = env.get_state()
    drawn = env.np_random.random()
    env.set_state(state)
    assert env.np_random.random() == drawn
    assert env.np_random_seed == -1  # not known
