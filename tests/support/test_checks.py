"""The range of each number, and its check at every entry point."""

import dataclasses
import inspect
import math
import re
import types
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest

from billiards_env import Engine, set_num_threads, simulate, simulate_batch, strike
from billiards_env import scene as scenes
from billiards_env.calibration import observed
from billiards_env.derivatives import sensitivities
from billiards_env.engine.pit import MAX_STEPS
from billiards_env.envs import BilliardsVectorEnv, make_env, make_model, make_vector_env
from billiards_env.envs.actions import aimed_strikes, perturb
from billiards_env.games import Setup, Stroke, opening, play, records
from billiards_env.scene import Balls, Physics, Pocket, Scene, Table
from billiards_env.scene.outline import Corner
from billiards_env.support.checks import RANGES, Range, fits, integer, numbers, one_of, real, short
from tests.helpers.errors import rejected

PLACES = [[-0.6, 0.0], [0.6, 0.3]]
POOL = Scene.named("pool")


def test_every_range_has_a_reason():
    for name, (least, most, _, reason) in RANGES.items():
        assert reason, name
        assert most is None or least < most, name


FIELDS = {
    "table.length": ("length", lambda v: Table(length=v)),
    "table.width": ("length", lambda v: Table(width=v)),
    "table.cushion_height": ("cushion_height", lambda v: Table(cushion_height=v)),
    "pocket.x": ("coordinate", lambda v: Pocket(v, 0.0, 0.1)),
    "pocket.y": ("coordinate", lambda v: Pocket(0.0, v, 0.1)),
    "pocket.radius": ("length", lambda v: Pocket(0.0, 0.0, v)),
    "balls.radius[1]": ("length", lambda v: Balls((0.03, v), (1.0, 1.0))),
    "balls.mass[1]": ("mass", lambda v: Balls((0.03, 0.03), (1.0, v))),
    "physics.g": ("g", lambda v: Physics(g=v)),
    "physics.mu_slide": ("friction", lambda v: Physics(mu_slide=v)),
    "physics.mu_roll": ("friction", lambda v: Physics(mu_roll=v)),
    "physics.mu_cushion": ("mu_cushion", lambda v: Physics(mu_cushion=v)),
    "physics.spin_decay": ("spin_decay", lambda v: Physics(spin_decay=v)),
    "physics.e_ball": ("restitution", lambda v: Physics(e_ball=v)),
    "physics.e_cushion": ("restitution", lambda v: Physics(e_cushion=v)),
    "physics.max_time": ("max_time", lambda v: Physics(max_time=v)),
    "max_speed": ("max_speed", lambda v: gym.make("Billiards-v0", max_speed=v)),
    "max_shots": ("max_shots", lambda v: gym.make("Billiards-v0", max_shots=v)),
    "goal_radius": ("length", lambda v: gym.make("Billiards-v0", task="place", goal_radius=v)),
    "scratch_penalty": ("scratch_penalty", lambda v: gym.make("Billiards-v0", scratch_penalty=v)),
    "dt": ("dt", lambda v: gym.make("Billiards-v0", mode="pit", dt=v)),
    "max_time": ("limit", lambda v: simulate(POOL, PLACES, [0.0, 0.0], max_time=v)),
    "max_events": ("max_events", lambda v: simulate(POOL, PLACES, [0.0, 0.0], max_events=v)),
    "threads": ("threads", lambda v: simulate_batch(POOL, [PLACES], [[0.0, 0.0]], threads=v)),
}


@pytest.mark.parametrize("name", FIELDS)
def test_a_number_is_accepted_exactly_within_its_range(name):
    key, take = FIELDS[name]
    least, most, *_ = RANGES[key]
    assert most is not None
    beyond = [least - 1, most + 1, -(10**400), 10**400]
    if isinstance(least, float):
        beyond += [math.nextafter(least, -math.inf), math.nextafter(most, math.inf), math.nan, -math.inf]
        beyond += [1e300, -1e300] + ([math.inf] if key != "mass" else [])
    for value in (least, most):
        take(value)
    for value in beyond:
        with rejected(f"{name} = "):
            take(value)
    for value in ("1", [1.0], True, np.bool_(True)):
        with pytest.raises((TypeError, ValueError), match=re.escape(f"{name} = {short(value)}")):
            take(value)


def test_infinite_masses_and_mass_ratios_up_to_1e16_are_allowed():
    assert Balls((0.03,) * 3, (1e-8, 1e8, math.inf)).mass == (1e-8, 1e8, math.inf)


# Values that once took minutes or gave wrong results


def test_the_largest_number_of_shots_is_counted():
    env = gym.make("Billiards-v0", max_shots=10**9)
    env.reset(seed=0)
    assert env.step(np.zeros(2, np.float32))[4]["shots_left"] == 10**9 - 1


def test_a_pit_shot_stops_after_the_largest_number_of_timesteps():
    scene = Scene(Balls.uniform(1), physics=Physics(motion="rolling", cushion="restitution"))
    shot = simulate(scene, [[0.0, 0.0]], [1.0, 0.0], engine=Engine("pit", 1e-9))
    assert (shot.status, shot.n_events) == ("step_limit", 0)
    assert shot.time == pytest.approx(MAX_STEPS * 1e-9, rel=1e-6)
    assert shot.positions[0, 0] == pytest.approx(shot.time - 0.5 * 0.0981 * shot.time**2)
    assert 0 < shot.velocities[0, 0] < 1
    assert RANGES["dt"][0] == 1e-9


# The checks themselves


def test_real_returns_a_float():
    for value in (2, 2.0, np.float32(2), np.int64(2), np.uint8(2)):
        assert type(real("x", value)) is float
        assert real("x", value, "length") == 2.0


@pytest.mark.parametrize("value", ["2", None, [2.0], 2j, True, np.bool_(True), np.timedelta64(1, "s")])
def test_values_that_are_not_numbers_are_rejected(value):
    with rejected(f"x = {short(value)}: expected a number, not {type(value).__name__}", TypeError):
        real("x", value, "length")
    assert not fits(value, "length")
    with rejected(f"x = {short(value)}: expected a whole number from 1 to 9"):
        integer("x", value, Range(1, 9))


TEXTS = [
    (np.float64(0.5), "0.5"),
    (np.float32(0.5), "0.5"),
    (np.int64(3), "3"),
    (np.bool_(True), "True"),
    (np.str_("pool"), "'pool'"),
    ([np.float64(-0.5), (np.int8(1),)], "[-0.5, (1,)]"),
    ({"velocity": np.float64(1.5)}, "{'velocity': 1.5}"),
    (np.array([0.5, 1.0]), "array([0.5, 1. ])"),
    (0.0050000000000000044, "0.005"),
    ([-0.1 - 0.7, 1 / 3], "[-0.8, 0.333333333333]"),
    (np.float64(-1.2345678901234567e-7), "-1.23456789012e-07"),
    ("0.12345678901234567", "'0.12345678901234567'"),
]


def test_a_number_just_outside_its_range_has_all_digits():
    with rejected("x = 1.0000000000000002: expected a number from 0 to 1"):
        real("x", 1 + 2**-52, "restitution")


@pytest.mark.parametrize(("value", "text"), TEXTS)
def test_numbers_in_messages_are_short_and_look_like_numbers_of_python(value, text):
    assert short(value) == text


COMPLEX = np.array([0.5 + 1j, 0.0])
TIMES: Any = np.array([1, 2], "m8[s]")
UNREAL = [
    *(COMPLEX, COMPLEX.tolist(), [np.complex64(0.5), 0.0], COMPLEX.astype(object), ["0.5", "0"], [10**400, 0]),
    *([True, False], np.array([True, 0.5], object), TIMES, TIMES.astype(object)),
]


@pytest.mark.parametrize("value", UNREAL)
def test_arrays_of_other_than_real_numbers_are_refused(value):
    """NumPy once discarded imaginary parts with a warning."""
    with rejected(f"x = {short(value)}: expected finite numbers in an array"):
        numbers("x", value)
    assert numbers("x", cast("Any", [Fraction(1, 2), 10**30])).tolist() == [0.5, 1e30]
    assert numbers("x", np.array([[1, 2], [3, 4]], np.int8, order="F")).flags.c_contiguous


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 10**400])
def test_a_number_without_a_range_must_be_finite(value):
    with rejected("x = "):
        real("x", value)


def test_a_whole_number_is_an_integer_of_python_or_numpy():
    assert (integer("n", np.int64(3), Range(0, 5)), integer("n", 10**30, "seed")) == (3, 10**30)
    for value in (3.0, np.float64(3), 10**5000):
        with rejected("n = "):
            integer("n", value, Range(0, 5, "of them"))
    with rejected("n = -1: expected a whole number >= 0"):
        integer("n", -1, "seed")


def test_an_unknown_name_is_rejected_with_a_suggestion():
    one_of("mode", "pic", ("pic", "pit"))
    with rejected("mode = 'pick': expected one of 'pic', 'pit' (did you mean 'pic'?)"):
        one_of("mode", "pick", ("pic", "pit"))


@pytest.mark.parametrize(
    ("value", "closest"), [("pci", "pic"), ("PIT", "pit"), ("tip", "pit"), ("xyz", None), (3, None), (["pic"], "pic")]
)
def test_the_suggestion_is_the_name_with_the_same_letters(value, closest):
    with pytest.raises(ValueError, match=r"expected one of 'pit', 'pic'") as error:
        one_of("mode", value, ("pit", "pic"))
    assert str(error.value).partition("did you mean ")[2] == (f"{closest!r}?)" if closest else "")


def begun(name: str, vector: bool = False) -> Any:
    env = gym.make_vec(name, 2) if vector else gym.make(name)
    env.reset(seed=0)
    return env


# Every argument of the public functions

SHOT = simulate(POOL, PLACES, [1.0, 0.0], record=True)
BATCH = simulate_batch(POOL, [PLACES], [[1.0, 0.0]], record=True)
GIVEN: dict[str, Any] = {
    **{"scene": POOL, "balls": POOL.balls, "physics": POOL.physics, "name": "pool", "data": POOL.to_dict()},
    **{"positions": PLACES, "velocities": [1.0, 0.0], "speed": 1.0, "heading": 0.0, "n": 1, "n_balls": 2},
    **{"radius": (0.03, 0.03), "mass": (0.2, 0.2), "x": 1.27, "y": 0.0, "rules": "nine_ball", "shot": SHOT},
    **{"t": 0.1, "times": [0.1], "of": "positions", "by": "positions", "tangents": {"e_ball": 1.0}},
    **{"cotangents": {"positions": np.zeros((2, 2))}, "path": "no/file"},
}
"""The required arguments by name. Those of a class or a method may need others, see `public`."""

UNCHECKED = {"path", "ax", "method", "arguments"}
"""Arguments that the standard library or matplotlib checks, and those of other functions."""


def methods(owner: Any, kinds: Any) -> Iterator[Any]:
    """Yields the public methods of an object or a class that are defined as `kinds`."""
    kind = owner if isinstance(owner, type) else type(owner)
    names = [name for base in kind.__mro__ for name, value in vars(base).items() if isinstance(value, kinds)]
    yield from (getattr(owner, name) for name in names if not name.startswith("_"))


def public() -> Iterator[tuple[str, Callable[..., Any], str]]:
    """Yields the name of each public function with checks, the function, and the name of each argument."""
    named = [Engine, Corner, Setup, *(getattr(scenes, name) for name in scenes.__all__)]
    kinds = [kind for kind in named if dataclasses.is_dataclass(kind)]
    functions = [*kinds, simulate, simulate_batch, strike, set_num_threads, make_vector_env, observed]
    functions += [method for kind in kinds for method in methods(kind, (classmethod, staticmethod))]
    functions += [method for result in (SHOT, BATCH) for method in methods(result, types.FunctionType)]
    functions += [begun("Billiards-v0").unwrapped.step, begun("Billiards-v0", vector=True).step]
    for function in functions:
        for name in inspect.signature(function).parameters.keys() - UNCHECKED:
            if (function, name) != (observed, "name"):  # any text
                yield f"{function.__qualname__}({name})", function, name
    for name in inspect.signature(make_model).parameters:
        yield f"make_env({name})", make_env, name


@pytest.mark.parametrize(
    "value",
    [object(), np.float64(math.nan), np.complex128(1j), np.ma.masked_all((2, 2))],
    ids=lambda value: type(value).__name__,
)
def test_every_argument_of_a_public_function_is_checked(value):
    accepted = []
    for place, function, name in public():
        given = [key for key, p in inspect.signature(function).parameters.items() if p.default is p.empty]
        arguments = {key: GIVEN[key] for key in given if key in GIVEN} | {name: value}
        try:
            result = function(**arguments)
            _ = list(result) if inspect.isgenerator(result) else None
        except Exception as error:
            form = re.match(r"(?!.*np\.)[^:=]+(?: = [^:]+| has shape [^:]+|: [^:]+)?: expected ", str(error), re.DOTALL)
            accepted += [] if form else [f"{place}: {type(error).__name__}: {error}"]
        else:
            accepted.append(place)
    assert not accepted, "\n".join(accepted)


def stroke(*arguments: Any) -> Any:
    setup = Setup("nine_ball", Scene.named("pool", 9))
    return lambda: play(setup, opening(setup, np.random.default_rng(0)), Stroke(*arguments))


OTHERS = [
    (stroke((COMPLEX[0], 0.0), (-0.8, 0.0)), "stroke.velocity[0] = (0.5+1j): expected a number"),
    (stroke((0.0, 1e200), (-0.8, 0.0)), "stroke.velocity[1] = 1e+200: expected a number from -1000 to 1000 m/s"),
    (stroke((1.0, 0.0), (np.float64(0.5),)), "stroke.place = (0.5,): expected "),
    (lambda: Engine(dt=np.float64(0.5)), "dt = 0.5 with mode='pic'"),
    (
        lambda: simulate(POOL, [np.ma.masked_equal(place, 0.6) for place in PLACES], [1, 0]),
        "positions = [masked_array(",
    ),
    (lambda: SHOT.save("no/shot.json"), "path = 'no/shot.json': expec"),
    (lambda: records.to_json(cast("Any", SHOT)), "record = ShotResult: 2 balls, rest aft"),
    (lambda: aimed_strikes(POOL, [COMPLEX], [[0, 0]]), "actions = [array("),
    (lambda: perturb([0, 0], COMPLEX), "noise = array("),
    (lambda: gym.make("Billiards-v0").unwrapped.step(cast("Any", "go")), "The episode is over or has not begun"),
]


@pytest.mark.parametrize(("call", "message"), OTHERS)
def test_a_wrong_value_is_named(call, message):
    with pytest.raises((TypeError, ValueError, OSError, gym.error.ResetNeeded)) as error:
        call()
    assert str(error.value).startswith(message)
    assert "np." not in str(error.value)


def test_a_vector_environment_whose_construction_failed_can_be_closed():
    BilliardsVectorEnv.__new__(BilliardsVectorEnv).close_extras()


RAGGED: Any = [[0.1, 0.2], [0.3]]
ONE: Any = np.array(1)
RAISED: list[tuple[Callable[[], Any], str]] = [
    (lambda: simulate(POOL, PLACES, [True, False]), "velocities = .*: expected finite numbers"),
    (lambda: simulate(POOL, PLACES, [1.0, 0.0], in_play=RAGGED), "in_play = .*: expected an array, or lists of one le"),
    (
        lambda: sensitivities(simulate(POOL, PLACES, [1.0, 0.0], record=True), 1.0),
        r"times = 1\.0: expected finite",
    ),
    (lambda: make_env().reset(options={"episode_seed": RAGGED}), r"options\['episode_seed'\] = .*: expected an array"),
    (lambda: make_env().decode([0.0, 0.0]), "observation has 0 numbers: expected 4, of positions"),
    (lambda: make_vector_env(2).get_state(RAGGED), "rows = .*: expected numbers of environments"),
    (lambda: make_vector_env(2).reset(seed=ONE), r"seed = array\(1\): expected a whole number >= 0"),
    (lambda: make_vector_env(2).reset(seed=TIMES), "seed of environment 0 = .*: expected a whole number >= 0"),
    (
        lambda: goal_env().compute_reward(["1", "0", "1"], [0.0, 0.0, 1.0], {}),
        "achieved_goal = .*: expected finite num",
    ),
]


def goal_env() -> Any:
    return make_env(task="place", observe="goal")


@pytest.mark.parametrize(("call", "message"), RAISED)
def test_values_are_checked_before_they_are_converted(call, message):
    with pytest.raises((TypeError, ValueError), match=message):
        call()
