"""Shots as functions of JAX arrays."""

import doctest

import numpy as np
import pytest

from billiards_env import Scene, derivatives, simulate_batch
from tests.helpers.derivatives import aimed
from tests.helpers.errors import refusals

jax = pytest.importorskip("jax")
jax.config.update("jax_enable_x64", True)
module = pytest.importorskip("billiards_env.jax")
simulate = module.simulate

pytestmark = pytest.mark.tools
SCENE, OUTPUTS = Scene.named("real_pool", 2), ("positions", "spins", "pocket_margins")


def start(m=5):
    places, moving = zip(*(aimed(SCENE, seed) for seed in range(3, 3 + m)), strict=True)
    return np.array(places), np.array(moving), np.linspace(0.008, 0.012, m)


def loss(places, moving, mu_roll):
    outputs = simulate(SCENE, places, moving, of=OUTPUTS, physics={"mu_roll": mu_roll}, max_time=0.7)
    return (outputs["positions"] ** 2).sum() + outputs["spins"].sum() - outputs["pocket_margins"][..., 1, 2].sum()


def test_the_gradient_is_that_of_vjp_bit_for_bit():
    places, moving, mu_roll = start()
    batch = simulate_batch(SCENE, places, moving, physics={"mu_roll": mu_roll}, max_time=0.7, record=True)
    of = {"positions": 2 * batch.positions, "spins": np.ones_like(batch.spins), "pocket_margins": np.zeros((5, 3, 6))}
    of["pocket_margins"][:, 1, 2] = -1.0
    expected = derivatives.vjp(batch, of, ("positions", "velocities", "mu_roll"))
    derive = jax.grad(loss, (0, 1, 2))
    one = [jax.jit(derive)(*row) for row in zip(places, moving, mu_roll, strict=True)]
    many = jax.jit(jax.vmap(derive))(places, moving, mu_roll)
    for k, cotangent in enumerate(expected.values()):
        assert np.array_equal(cotangent, many[k])
        assert np.array_equal(cotangent, [row[k] for row in one])
        assert np.array_equal(cotangent, derive(places, moving, mu_roll)[k])


def test_shots_run_in_a_scan_and_have_the_type_of_the_velocities():
    places, moving, _ = (array[0] for array in start())

    def roll(velocities):
        step = lambda balls, _: (simulate(SCENE, balls, velocities, max_time=0.2),) * 2  # noqa: E731
        return jax.lax.scan(step, places, None, length=3)[1]

    ends, h = jax.jit(roll)(moving), 1e-6
    first = simulate_batch(SCENE, places[None], moving[None], max_time=0.2).positions
    assert np.array_equal(ends[0], first[0])
    slope = float(jax.grad(lambda v: roll(v)[-1, 0, 0])(moving)[0, 0])
    nudge = np.zeros_like(moving)
    nudge[0, 0] = h
    assert slope == pytest.approx(float((roll(moving + nudge) - roll(moving - nudge))[-1, 0, 0]) / (2 * h), rel=1e-5)
    assert simulate(SCENE, places.astype("f4"), moving.astype("f4"), max_time=0.2).dtype == "float32"


def test_what_has_no_derivative_is_refused():
    places, moving, mu_roll = (array[0] for array in start())
    with pytest.raises(NotImplementedError, match="second derivatives of shots"):
        jax.grad(lambda x: jax.grad(loss)(x, moving, mu_roll).sum())(places)
    with pytest.raises(TypeError, match="forward-mode"):
        jax.jvp(lambda x: loss(x, moving, mu_roll), (places,), (places,))


@refusals(
    "arguments",
    [
        ({"scene": "pool"}, "scene = 'pool': expected a Scene", TypeError),
        ({"scene": Scene.named("jump_pool", 2)}, r"physics\.flight = True with .*: expected False or simulate_batch"),
        ({"of": "events"}, "of = 'events': expected one of"),
        ({"velocities": np.ones(2)}, r"velocities has shape \(2,\): expected \(\.\.\., 3, 2\)"),
        ({"velocities": np.ones((4, 1, 2))}, r"velocities has shape \(4, 1, 2\): expected \(\.\.\., 3, 2\)"),
        ({"spins": np.ones(3)}, r"spins has shape \(3,\): expected \(\.\.\., 3, 3\)"),
        ({"velocities": np.ones((3, 2)) * 1j}, "velocities has type complex128: expected real numbers"),
        ({"physics": [1.0]}, "physics = .*: expected a mapping", TypeError),
        ({"physics": {"motion": 1.0}}, "physics = 'motion': expected one of"),
        ({"physics": {"positions": np.zeros((3, 2))}}, "physics = 'positions': expected one of"),
        ({"in_play": [1, 1, 1]}, "in_play = .*: expected True or False"),
        ({"in_play": np.ones((5, 3), bool)}, r"in_play has shape \(5, 3\): expected \(3,\)"),
        ({"max_time": -1.0}, "max_time = -1.0: expected a number from 0"),
        ({"threads": 0}, "threads = 0: expected a whole number"),
    ],
)
def test_wrong_arguments_are_refused_before_a_shot_runs(arguments, message, kind):
    places, moving, _ = (array[0] for array in start())
    arguments = {"scene": SCENE, "positions": places, "velocities": moving, **arguments}
    with pytest.raises(kind, match=message):
        jax.jit(lambda: simulate(**arguments))()


def test_an_option_that_jit_traces_is_refused():
    places, moving, _ = (array[0] for array in start())
    with pytest.raises(TypeError, match=r"max_time = .*: expected a number, not "):
        jax.jit(lambda limit: simulate(SCENE, places, moving, max_time=limit))(0.7)


def test_the_examples_of_the_module_run():
    assert doctest.testmod(module).failed == 0
