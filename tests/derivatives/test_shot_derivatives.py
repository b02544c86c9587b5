"""The derivatives of shots agree with differences of the 50-digit reference, and with each other."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.reference.oracle import reference_shot
from billiards_env import Scene, derivatives, simulate_batch, strike
from billiards_env import scene as scenes
from billiards_env.derivatives import shot_derivatives
from billiards_env.derivatives.shot_derivatives import OUTPUTS, UNIT_ROUNDOFF, physics_inputs
from billiards_env.scene import PARAMETERS, Balls, Physics, Pocket, Table, layouts
from billiards_env.support.checks import RANGES
from tests.helpers.derivatives import SCENES, VARIABLE, directional_differences, recorded, start_of, tangent_of
from tests.helpers.shots import draw_starts, simulate


def inputs_of(scene):
    """Returns the inputs that enter the shots of a scene in the 50-digit reference."""
    p = scene.physics
    names = ["positions", "velocities", "radius", "mass", "e_ball", "e_cushion"]
    if p.motion != "ideal":
        names += ["g", "mu_roll"]
    if p.motion == "sliding":
        names += ["spins", "mu_slide", "spin_decay"]
    if p.cushion != "restitution":
        names += ["mu_cushion", "cushion_height"]
    if p.cushion == "stronge":
        names += ["cushion_frequency_ratio"]
    if p.cushion == "han2005_variable":
        names += list(VARIABLE)
    if p.mu_roll_speed is not None:
        names += ["mu_roll_speed"]
    if p.e_cushion_loss:
        names += ["e_cushion_loss", "e_cushion_onset", "e_cushion_floor"]
    if p.ball_ball == "frictional":
        names += ["mu_ball_factor", *(["mu_ball_decay"] if p.mu_ball is None else ["mu_ball"])]
    return names


# The 50-digit reference takes a second for a "mathavan2010" cushion; `tests/derivatives/test_lanes.py` tests the law.
NAMED = [name for name in scenes.SCENES if name not in (*SCENES, "snooker", "jump_pool")]


@pytest.mark.parametrize("name", [*SCENES, *(pytest.param(name, marks=pytest.mark.slow) for name in NAMED)])
@pytest.mark.parametrize("seed", [3, 5])
def test_the_derivatives_are_those_of_the_50_digit_simulator(name, seed):
    scene = SCENES[name] if name in SCENES else Scene.named(name, 2)
    start, rng = start_of(scene, seed), np.random.default_rng(seed)
    uncut = recorded(scene, start)
    late = 0.6 * uncut.time
    shot = recorded(scene, start, max_time=late)
    assert derivatives.nonsmooth(shot) == (-1, "")
    assert (shot.events["kind"] == "ball_ball").any()
    for key in inputs_of(scene):
        tangent = tangent_of(key, scene, rng)
        expected = directional_differences(scene, start, key, tangent, late)
        changes = derivatives.jvp(shot, {key: tangent}, OUTPUTS)
        order = np.argsort(shot.events["ball"], kind="stable")
        changes |= {output: changes[output][order] for output in ("event_times", "event_positions")}
        for output in OUTPUTS:
            size = np.abs(expected[output]).max()
            np.testing.assert_allclose(
                changes[output], expected[output], rtol=0, atol=1e-9 * size, err_msg=f"{key} {output}"
            )


@pytest.mark.parametrize("batch", [False, True])
@pytest.mark.parametrize(
    "derive",
    [
        derivatives.jacobian,
        lambda shot: derivatives.jvp(shot, {"mu_roll": 1.0}),
        lambda shot: derivatives.vjp(shot, {"positions": np.ones((2, 2))}),
        derivatives.margins,
        derivatives.nonsmooth,
        derivatives.certainty,
        derivatives.sensitivity,
        lambda shot: derivatives.sensitivities(shot, [0.1]),
    ],
)
def test_every_derivative_refuses_flights(derive, batch):
    shots = simulate_batch(Scene.named("jump_pool"), [[[-0.6, 0.0], [0.6, 0.3]]], [[1.0, 0.0]], record=True)
    with pytest.raises(ValueError, match=r"physics\.flight = True with derivatives: expected False or differ"):
        derive(shots if batch else shots[0])


def check_one_sided(name, changes, number, way):
    """Compares the derivative of a shot by a number with differences on one side: way is 1 above and -1 below it."""
    scene = dataclasses.replace(SCENES[name], physics=dataclasses.replace(SCENES[name].physics, **changes))
    start = start_of(scene, 3)
    late = 0.6 * recorded(scene, start).time
    shot = recorded(scene, start, max_time=late)
    assert derivatives.nonsmooth(shot) == (-1, "")
    assert (shot.events["kind"] == "cushion").any()
    assert (shot.events["kind"] == "ball_ball").any()
    expected = directional_differences(scene, start, number, way, late)["positions"]
    size = max(np.abs(expected).max(), 1e-3)
    np.testing.assert_allclose(derivatives.jvp(shot, {number: way}), expected, rtol=0, atol=1e-9 * size, err_msg=number)


AT_END = [name for name, p in PARAMETERS.items() if {0.0, 1.0} & {*RANGES[p.within][:2]} and p.only != ("flight",)]


@pytest.mark.parametrize("number", AT_END)
def test_a_number_at_the_end_of_its_range_has_the_derivative_on_the_inside(number):
    ends = RANGES[PARAMETERS[number].within][:2]
    for name in ("han2005", "variable", "grip", "stronge"):
        physics = SCENES[name].physics
        for end, way in zip(ends, (1.0, -1.0), strict=True):
            changes = {number: end}
            if end not in (0.0, 1.0) or (number.startswith("mu_ball") and physics.ball_ball == "frictionless"):
                continue
            if number in ("e_cushion", "e_cushion_floor"):
                if end == 0.0 and (number == "e_cushion" or name == "stronge"):
                    continue  # a ball stops at the cushion, or the law does not allow the number
                changes = {"e_cushion": 1.0, "e_cushion_floor": physics.e_cushion_floor} | changes
            if number == "cushion_frequency_ratio":
                changes |= {"e_cushion": 1.0, "e_cushion_loss": 0.0}
            check_one_sided(name, changes, number, way)


@pytest.mark.parametrize("name", ["han2005", "stronge", "variable", "sliding"])
def test_a_restitution_at_its_floor_or_at_1_has_the_derivative_on_the_inside(name):
    floor = {"e_cushion": 0.8, "e_cushion_floor": 0.8, "e_cushion_topspin": 0.0, "e_cushion_loss": 0.0}
    for number, way in (("e_cushion", 1.0), ("e_cushion_loss", 1.0), ("e_cushion_floor", -1.0)):
        check_one_sided(name, floor, number, way)
        check_one_sided(name, floor | {"e_cushion_loss": 0.1}, number, way)
    most = {"e_cushion": 1.0, "e_cushion_loss": 0.0, "e_cushion_topspin": 0.0}
    for number, way in (("e_cushion", -1.0), ("e_cushion_loss", 1.0), ("e_cushion_topspin", 1.0)):
        check_one_sided(name, most, number, way)


def test_every_number_of_the_derivatives_has_a_range():
    numbers = {name for name, parameter in PARAMETERS.items() if parameter.only != ("flight",)}
    assert numbers == set(physics_inputs(Physics(mu_ball=0.05, mu_roll_speed=0.0)))


def test_no_derivative_for_rolling_where_the_resistance_changes():
    for speed, reason in ((1.4, "rolling"), (1.4 + 1e-6, ""), (1.4 - 1e-6, "")):  # it rolls at 5/7 of its speed
        shot = simulate(
            SCENES["variable"], [[-1.0, 0.0], [1.0, 0.5], [1.0, -0.5]], [speed, 0.0], record=True, max_time=1.0
        )
        assert derivatives.nonsmooth(shot) == (0 if reason else -1, reason)


@pytest.mark.parametrize("name", ["pool", "ideal", "carom", "real_pool", "uk_pool"])
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_jvp_and_vjp_are_adjoint(name, seed):
    rng = np.random.default_rng(seed)
    scene = Scene.named(name, 2)
    shot = recorded(scene, start_of(scene, seed), max_time=float(rng.uniform(0.1, 5.0)))
    by = ("positions", "velocities", "spins", "radius", "mass", *physics_inputs(scene.physics))
    shapes = {"positions": (3, 2), "velocities": (3, 2), "spins": (3, 3), "radius": (3,), "mass": (3,)}
    tangents = {key: rng.normal(size=shapes.get(key, ())) for key in by}
    pushed = derivatives.jvp(shot, tangents, OUTPUTS)
    cotangents = {key: rng.normal(size=value.shape) for key, value in pushed.items()}
    pulled = derivatives.vjp(shot, cotangents, by)
    left = [(cotangents[key] * pushed[key]).sum() for key in OUTPUTS]
    right = [(pulled[key] * tangents[key]).sum() for key in by]
    terms = max(map(abs, (*left, *right)))
    assert sum(left) == pytest.approx(sum(right), rel=0, abs=1e-11 * terms)


@pytest.mark.parametrize(("of", "by"), [("positions", "e_ball"), ("event_times", "velocities"), ("spins", "spins")])
def test_the_jacobian_has_the_columns_of_jvp(of, by):
    scene = Scene.named("real_pool", 2)
    shot = recorded(scene, start_of(scene, 3), max_time=2.0)
    jacobian = derivatives.jacobian(shot, of, by)
    tangent = np.random.default_rng(0).normal(size=jacobian.shape[1 if of == "event_times" else 2 :])
    pushed = derivatives.jvp(shot, {by: tangent}, of)
    size = np.abs(jacobian).max()
    np.testing.assert_allclose(np.tensordot(jacobian, tangent, tangent.ndim), pushed, rtol=0, atol=1e-13 * size)


@pytest.mark.parametrize(("name", "arrangement"), [("pool", "random"), ("uk_pool", "random"), ("pool", "tight_rack")])
@pytest.mark.parametrize("threads", [1, 3])
def test_a_batch_has_the_bits_of_single_shots(name, arrangement, threads):
    scene = Scene.named(name, 4 if arrangement == "random" else 15)
    places, starts, spins = draw_starts(scene, 60 if arrangement == "random" else 20, arrangement)
    batch = simulate_batch(scene, places, starts, spins=spins, record=True, threads=threads)
    plain = simulate_batch(scene, places, starts, spins=spins, threads=threads)
    assert np.array_equal(batch.positions, plain.positions)
    rng = np.random.default_rng(0)
    tangents = {"positions": rng.normal(size=places.shape), "e_ball": rng.normal(size=len(places))}
    cotangents = {"positions": rng.normal(size=places.shape)}
    pushed = derivatives.jvp(batch, tangents, ("velocities", "event_times"), t=1.0, threads=threads)
    pulled = derivatives.vjp(batch, cotangents, ("velocities", "mu_roll"), threads=threads)
    jacobian = derivatives.jacobian(batch, "positions", "radius", threads=threads)
    nonsmooth, certainty = derivatives.nonsmooth(batch, threads=threads), derivatives.certainty(batch)
    margins = derivatives.margins(batch, t=1.0)
    for k in range(len(places)):
        shot = simulate(scene, places[k], starts[k], spins=spins[k], record=True)
        alone = derivatives.jvp(
            shot, {key: value[k] for key, value in tangents.items()}, ("velocities", "event_times"), t=1.0
        )
        assert np.array_equal(pushed["velocities"][k], alone["velocities"])
        assert np.array_equal(pushed["event_times"][k, : shot.n_events], alone["event_times"])
        assert not pushed["event_times"][k, shot.n_events :].any()
        gradient = derivatives.vjp(shot, {"positions": cotangents["positions"][k]}, ("velocities", "mu_roll"))
        assert np.array_equal(pulled["velocities"][k], gradient["velocities"])
        assert pulled["mu_roll"][k] == gradient["mu_roll"]
        assert np.array_equal(jacobian[k], derivatives.jacobian(shot, "positions", "radius"))
        assert (nonsmooth.event[k], nonsmooth.reason[k]) == derivatives.nonsmooth(shot)
        assert (certainty.contacts[k], certainty.outcome[k]) == derivatives.certainty(shot)
        for many, one in zip(margins, derivatives.margins(shot, t=1.0), strict=True):
            assert np.array_equal(many[k], one)


def test_a_batch_whose_log_is_too_small_runs_the_other_shots_again():
    scene = Scene.named("pool", 15)
    calm, starts, _ = draw_starts(scene, 300)
    wild, breaks, _ = draw_starts(scene, 60, "rack")
    places, velocities = np.concatenate((calm, wild)), np.concatenate((0.01 * starts, 2.0 * breaks))
    batch = simulate_batch(scene, places, velocities, record=True, threads=1)
    plain = simulate_batch(scene, places, velocities, threads=1)
    for name in ("positions", "time", "n_events"):
        assert np.array_equal(getattr(batch, name), getattr(plain, name))
    last = simulate(scene, places[-1], velocities[-1], record=True)
    assert np.array_equal(
        derivatives.jacobian(batch, "positions", "e_ball")[-1], derivatives.jacobian(last, "positions", "e_ball")
    )


@pytest.mark.parametrize("elevation", [0.0, 0.1])
def test_the_derivative_by_the_strike_is_that_of_small_changes(elevation):
    scene, positions = Scene.named("real_pool"), [[-0.5, 0.1], [0.2, 0.15]]
    at, step = np.array([1.5, 0.07, 0.2, -0.1, elevation + 0.05]), 1e-7
    shot = simulate(scene, positions, strike(scene, *at), record=True)
    jacobian = derivatives.jacobian(shot, "positions", "strike", strike=at)
    ends = [
        [simulate(scene, positions, strike(scene, *(at + sign * h))).positions for sign in (1, -1)]
        for h in step * np.eye(5)
    ]
    expected = np.stack([(a - b) / (2 * step) for a, b in ends], axis=-1)
    np.testing.assert_allclose(jacobian, expected, atol=2e-5 * np.abs(jacobian).max())
    change = np.array([0.5, -0.1, 0.2, 0.3, -0.4])
    np.testing.assert_allclose(derivatives.jvp(shot, {"strike": change}, strike=at), jacobian @ change, rtol=1e-9)
    batch = simulate_batch(scene, [positions] * 2, strike(scene, *np.array([at, at]).T), record=True)
    cotangents = np.ones((2, 2))
    pulled = derivatives.vjp(batch, {"positions": cotangents}, "strike", strike=np.array([at, at]))
    np.testing.assert_allclose(pulled, np.tile(jacobian.sum(axis=(0, 1)), (2, 1)), rtol=1e-9)


def test_an_ideal_ball_at_rest_moves_with_a_change_of_its_velocity():
    shot = simulate(Scene.named("ideal"), [[-1.0, 0.0], [0.0, 0.5]], [0.5, 0.0], record=True, max_time=1.0)
    assert derivatives.jvp(shot, {"velocities": [[0.0, 0.0], [1.0, 2.0]]}).tolist() == [[0.0, 0.0], [1.0, 2.0]]


def test_friction_stops_a_ball_at_rest_that_begins_to_move():
    shot = simulate(Scene.named("pool"), [[-1.0, 0.0], [0.0, 0.5]], [0.5, 0.0], record=True)
    assert not derivatives.jacobian(shot, "positions", "velocities")[:, :, 1].any()


def test_two_impacts_at_one_instant_that_share_no_ball_have_a_derivative():
    scene = Scene.named("ideal", 3)
    places, velocities = [[-0.5, 0.2], [0.0, 0.2], [-0.5, -0.2], [0.0, -0.2]], [[1.0, 0.0], [0, 0], [1.0, 0.0], [0, 0]]
    shot = simulate(scene, places, velocities, record=True, max_time=0.6)
    assert shot.n_events == 2
    assert derivatives.nonsmooth(shot) == (-1, "")
    apart = simulate(
        scene, np.array(places) - [[0, 0], [0, 0], [1e-9, 0], [0, 0]], velocities, record=True, max_time=0.6
    )
    np.testing.assert_allclose(derivatives.jacobian(shot), derivatives.jacobian(apart), atol=1e-6)


def test_impacts_at_one_instant_count_as_successive():
    """The derivative is that of a shot in which the first contact of the log comes earlier."""
    scene, y = Scene.named("ideal", 2), 0.02857500001
    both = simulate(scene, [[-0.5, 0.0], [0.0, y], [0.0, -y]], [1.0, 0.0], record=True, max_time=0.5)
    assert derivatives.nonsmooth(both) == (1, "simultaneous")
    first = simulate(scene, [[-0.5, 0.0], [0.0, y], [1e-9, -y]], [1.0, 0.0], record=True, max_time=0.5)
    assert first.events["other"][:2].tolist() == [1, 2]
    np.testing.assert_allclose(derivatives.jacobian(both), derivatives.jacobian(first), atol=1e-5)


def test_the_derivative_of_the_time_of_a_fall_has_the_slope_of_the_rim():
    scene = Scene(Balls.uniform(1), Table(2.0, 1.0, pockets=(Pocket(0.0, 0.5, 0.1),)), Scene.named("ideal").physics)
    deep = simulate(scene, [[-0.5, 0.45]], [1.0, 0.0], record=True, max_time=1.0)
    assert derivatives.nonsmooth(deep) == (-1, "")
    assert not derivatives.jacobian(deep, "positions", "positions").any()
    chord = 0.05 / math.sqrt(0.1**2 - 0.05**2)  # slope of the circle where the ball enters it
    np.testing.assert_allclose(derivatives.jacobian(deep, "event_times", "positions"), [[[-1.0, -chord]]], rtol=1e-12)


def test_an_act_of_the_contact_time_rule_has_no_derivative():
    scene = Scene.named("pool", 15)
    places, velocities, _ = draw_starts(scene, 20, "tight_rack")
    batch = simulate_batch(scene, places, velocities, record=True)
    nonsmooth = derivatives.nonsmooth(batch)
    assert (nonsmooth.reason[batch.n_contact_rule > 0] != "").all()
    assert set(nonsmooth.reason) <= {"", "rule", "simultaneous", "grazing"}


@pytest.mark.parametrize("name", [name for name in SCENES if name != "ideal"])
def test_the_sensitivity_is_the_derivative_of_the_final_positions(name):
    scene = SCENES[name]
    start = start_of(scene, 3)
    shot = recorded(scene, start)
    sensitivity = derivatives.sensitivity(shot)
    assert shot.n_events > 3
    assert sensitivity.smooth
    jacobian = np.concatenate(
        [derivatives.jacobian(shot, "positions", by) for by in ("positions", "velocities", "spins")], axis=-1
    )
    np.testing.assert_allclose(sensitivity.jacobian, jacobian, rtol=0, atol=1e-12 * np.abs(jacobian).max())
    exact = reference_shot(scene, *start).positions
    assert np.abs(shot.positions - np.array(exact, float)).max() < 10 * UNIT_ROUNDOFF * sensitivity.condition


def test_the_sensitivity_after_a_mathavan_cushion_is_that_of_small_steps():
    scene = Scene.named("snooker", 2)
    places, velocities = np.array([[0.3, 0.1], [1.2, 0.5], [-1.2, 0.5]]), np.array([[0.2, 2.0], [0.0, 0.0], [0.0, 0.0]])
    slope = derivatives.sensitivity(simulate(scene, places, velocities, record=True)).jacobian[0, :, 0]
    step = 1e-3
    for k in range(4):
        moved = [np.concatenate((places[0], velocities[0])) for _ in range(2)]
        moved[0][k] += step
        moved[1][k] -= step
        ends = [simulate(scene, [m[:2], *places[1:]], m[2:]).positions[0] for m in moved]
        assert slope[:, k] == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=2e-3)


@pytest.mark.slow
def test_shots_with_mathavan_cushions_are_smooth_up_to_rounding():
    """The bound is that of `certainty`. The end once jumped by up to 1.6e-7 m where an impact had another step."""
    scene, rng, t = Scene.named("snooker", 5), np.random.default_rng(0), np.linspace(-1.0, 1.0, 21)
    powers = np.stack((np.ones(21), t, t * t), axis=1)
    for k in range(1500):
        places, angle = layouts.draw("random", scene, rng), rng.uniform(0.0, 2.0 * np.pi)
        velocity = rng.uniform(0.3, 5.0) * np.array([np.cos(angle), np.sin(angle)])
        ends = simulate_batch(scene, np.tile(places, (21, 1, 1)), velocity * (1.0 + 1e-9 * t)[:, None]).positions
        ends = ends.reshape(21, -1)
        rest = np.abs(ends - powers @ np.linalg.lstsq(powers, ends, rcond=None)[0]).max()
        sensitivity = derivatives.sensitivity(simulate(scene, places, velocity, record=True))
        assert not sensitivity.smooth or rest < 100 * UNIT_ROUNDOFF * sensitivity.condition, k


def test_each_collision_multiplies_the_condition():
    scene = Scene.named("ideal", 15)
    rng = np.random.default_rng(0)
    shot = simulate(scene, layouts.draw("random", scene, rng), rng.normal(0.0, 1.0, (16, 2)), record=True, max_time=4.0)
    early, late = derivatives.sensitivities(shot, [1.0, 4.0])
    assert early.condition > 10.0
    assert late.condition > 1e3 * early.condition


def test_the_sensitivity_before_the_first_event_is_that_of_free_motion():
    scene = Scene.named("ideal")
    shot = simulate(scene, [[-1.0, 0.0], [0.0, 0.5]], [0.5, 0.25], record=True, max_time=1.0)
    jacobian = derivatives.sensitivity(shot, 0.5).jacobian
    np.testing.assert_array_equal(jacobian[0, :, 0], [[1, 0, 0.5, 0, 0, 0, 0], [0, 1, 0, 0.5, 0, 0, 0]])
    np.testing.assert_array_equal(jacobian[0, :, 1], np.zeros((2, 7)))


def test_derivatives_of_many_shots_are_those_of_single_shots(monkeypatch):
    scene = Scene.named("carom", 1)
    places, velocities, spins = draw_starts(scene, 4)
    batch = simulate_batch(scene, places, velocities, spins=spins, record=True)
    times = batch.time[:, None] * [0.2, 0.9]
    monkeypatch.setattr(shot_derivatives, "_BLOCK", 1)  # one shot in each call
    jacobians = shot_derivatives.start_jacobians(batch, times, 0, ("mu_roll",), 1)
    for k, q in np.ndindex(times.shape):
        shot, t = batch[k], float(times[k, q])
        by_places = derivatives.jacobian(shot, "positions", "positions", t=t).reshape(2, 2, 4)
        by_velocity, by_spin = (
            derivatives.jacobian(shot, "positions", name, t=t)[:, :, 0] for name in ("velocities", "spins")
        )
        by_number = derivatives.jacobian(shot, "positions", "mu_roll", t=t)[..., None]
        expected = np.concatenate((by_places, by_velocity, by_spin, by_number), axis=2)
        assert np.moveaxis(jacobians[k, q], 0, 2) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    push_lanes: Any = shot_derivatives.push_lanes
    assert all(types[4].mutable for types in push_lanes.signatures)  # a read-only array would compile it again
