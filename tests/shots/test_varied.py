"""Batches in which each shot has its own physics and timestep."""

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env import Engine, Scene, derivatives, simulate, simulate_batch
from billiards_env.derivatives.shot_derivatives import physics_inputs
from billiards_env.engine.compile import PIC, scene_fields, varied_fields
from billiards_env.scene import PARAMETERS
from billiards_env.shots import records
from billiards_env.shots.simulation import replay
from tests.helpers.shots import check_same, draw_starts, run_both, with_physics

SCENES: dict[str, Any] = {name: Scene.named(name, 2) for name in ("pool", "ideal", "real_pool", "snooker", "uk_pool")}
SCENES["rolling"] = dataclasses.replace(
    SCENES["pool"], physics=dataclasses.replace(SCENES["pool"].physics, motion="rolling", cushion="restitution")
)
RANGES = {
    "g": (8.0, 11.0),
    "mu_slide": (0.1, 0.4),
    "mu_roll": (0.005, 0.015),
    "spin_decay": (5.0, 20.0),
    "e_ball": (0.8, 1.0),
    "e_cushion": (0.85, 1.0),
    "mu_cushion": (0.0, 0.3),
    "mu_ball": (0.0, 0.2),
    "mu_ball_factor": (0.5, 2.0),
    "mu_ball_decay": (0.2, 2.0),
    "cushion_frequency_ratio": (1.5, 2.0),
    "e_cushion_loss": (0.0, 0.2),
    "e_cushion_onset": (0.0, 2.0),
    "e_cushion_floor": (0.7, 0.85),
    "e_cushion_topspin": (0.0, 0.1),
    "e_cushion_tangent": (0.0, 0.1),
    "e_cushion_slip": (0.0, 0.1),
    "mu_roll_speed": (0.001, 0.005),
    "e_slate": (0.5, 0.7),
    "mu_slate": (0.1, 0.3),
    "least_hop": (1e-6, 1e-4),
}


def test_the_ranges_of_these_tests_have_every_number():
    assert set(RANGES) == set(PARAMETERS)


def varied(names, m, seed=0) -> dict[str, Any]:
    """Returns random numbers of `Physics` for m shots."""
    rng = np.random.default_rng(seed)
    return {name: rng.uniform(*RANGES[name], m) for name in names}


def same_record(shot, other):
    """Fails unless two recorded shots are equal bit for bit, with their scenes."""
    check_same(shot, other)
    assert (shot.scene, shot.engine) == (other.scene, other.engine)


WITH_DERIVATIVE = [name for name, parameter in PARAMETERS.items() if parameter.only != ("flight",)]


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(sorted(SCENES)), st.sets(st.sampled_from(WITH_DERIVATIVE), min_size=1), st.integers(0, 9), st.data()
)
def test_each_shot_equals_a_single_shot_with_its_physics_bit_for_bit(name, names, seed, data):
    scene, m = SCENES[name], 3
    places, starts, spins = draw_starts(scene, m)
    if "e_cushion_loss" in names:
        names |= {"e_cushion_floor"}  # "stronge" cushions need one
    options: dict[str, Any] = {} if scene.physics.motion != "sliding" else {"spins": spins}
    physics = varied(sorted(names), m, seed)
    batch, singles = run_both(scene, places, starts, record=True, physics=physics, **options)
    for shot, single in zip(batch, singles, strict=True):
        same_record(shot, single)
    tangents: dict[str, Any] = {"velocities": np.ones((3, 2)), **dict.fromkeys(names, 1.0)}
    change = derivatives.jvp(batch, tangents)
    by = data.draw(st.sampled_from(sorted(tangents)))
    gradient = derivatives.vjp(batch, {"positions": np.ones((3, 2))}, by)
    for k, single in enumerate(singles):
        assert change[k].tobytes() == derivatives.jvp(single, tangents).tobytes()
        assert gradient[k].tobytes() == derivatives.vjp(single, {"positions": np.ones((3, 2))}, by).tobytes()


def test_the_certainty_of_each_shot_is_that_of_its_physics():
    """The bounds of the errors grow with the restitution and the friction, here by up to a factor of 10,000."""
    rng, m = np.random.default_rng(23), 40
    triangle = [(0.1 + 0.054 * i, 0.06 * (j - i / 2)) for i in range(4) for j in range(i + 1)]
    places = np.repeat(np.array([[(-0.6, 0.05), *triangle[:9]]]), m, axis=0)
    starts = np.stack((rng.uniform(4, 8, m), rng.uniform(-0.6, 0.6, m)), axis=1)
    physics = {"mu_slide": rng.choice([0.01, 1.0], m), "e_ball": rng.uniform(0.0, 1.0, m)}
    batch = simulate_batch(Scene.named("pool", 9), places, starts, physics=physics, record=True)
    assert derivatives.certainty(batch).contacts.tolist() == [derivatives.certainty(shot).contacts for shot in batch]


@pytest.mark.parametrize("fix", ["push_apart", "move_back", "none"])
def test_each_shot_has_its_own_timestep(fix):
    scene, m = SCENES["pool"], 12
    places, starts, spins = draw_starts(scene, m)
    physics, dt = varied(("mu_roll", "e_ball"), m), np.geomspace(1e-3, 0.05, m)
    batch, _ = run_both(scene, places, starts, spins, engine=Engine("pit", 1.0, fix), physics={**physics, "dt": dt})
    last = {"engine": Engine("pit", dt[-1], fix), "spins": spins[-1]}
    same_record(batch[-1], simulate(with_physics(scene, physics, -1), places[-1], starts[-1], record=True, **last))


def test_pieces_of_a_batch_on_several_threads_have_the_physics_of_their_shots():
    scene, m = SCENES["uk_pool"], 400
    places, starts, spins = draw_starts(scene, m)
    physics = varied(("mu_roll", "e_cushion", "mu_ball"), m)
    batch, twin = (
        simulate_batch(scene, places, starts, spins=spins, physics=physics, record=threads > 1, threads=threads)
        for threads in (1, 2)
    )
    assert batch.positions.tobytes() == twin.positions.tobytes()
    gradient = derivatives.vjp(twin, {"positions": np.ones((m, 3, 2))}, ("mu_roll", "g"), threads=2)
    margins = derivatives.margins(twin)
    for k in (0, m // 2, m - 1):
        single = simulate(with_physics(scene, physics, k), places[k], starts[k], spins=spins[k], record=True)
        assert single.positions.tobytes() == batch.positions[k].tobytes()
        assert gradient["mu_roll"][k] == derivatives.vjp(single, {"positions": np.ones((3, 2))}, "mu_roll")
        assert gradient["g"][k] == derivatives.vjp(single, {"positions": np.ones((3, 2))}, "g")
        assert margins.balls[k].tobytes() == derivatives.margins(single).balls.tobytes()


def test_a_constant_friction_of_balls_is_an_input_of_the_derivatives():
    physics = SCENES["uk_pool"].physics  # it has the law of Marlow
    assert physics_inputs(physics, {"mu_ball": np.array([0.1])}).keys() - physics_inputs(physics).keys() == {"mu_ball"}


def test_a_shot_of_a_batch_is_saved_with_its_physics(tmp_path):
    scene = SCENES["pool"]
    places, starts, _ = draw_starts(scene, 3)
    mu_roll = np.array([0.006, 0.01, 0.014])
    batch = simulate_batch(scene, places, starts, physics={"mu_roll": mu_roll})
    mu_roll[:] = 1.0  # the batch has a copy
    for batch_or_copy in (batch, pickle.loads(pickle.dumps(batch))):
        batch_or_copy[2].save(tmp_path / "shot.json")
        record = records.load(tmp_path / "shot.json")
        assert record.scene.physics.mu_roll == 0.014
        assert replay(record).positions.tobytes() == batch.positions[2].tobytes()


def test_a_batch_with_shared_physics_has_the_numbers_of_its_scene():
    scene = SCENES["pool"]
    assert varied_fields(scene, PIC, {}, 1000) is scene_fields(scene)
    places, starts, _ = draw_starts(scene, 3)
    assert simulate_batch(scene, places, starts)[1].scene is scene


def test_a_batch_may_have_no_shots():
    nothing = np.empty((0, 3, 2)), np.empty((0, 2))
    assert simulate_batch(SCENES["pool"], *nothing).positions.shape == (0, 3, 2)
    assert len(simulate_batch(SCENES["pool"], *nothing, physics={"mu_roll": []})) == 0
    assert len(simulate_batch(SCENES["pool"], *nothing, engine=Engine("pit", 1.0), physics={"dt": []})) == 0


def test_numbers_may_fit_together_in_each_shot_alone():
    scene = SCENES["pool"]
    places, starts, _ = draw_starts(scene, 2)
    batch = simulate_batch(scene, places, starts, physics={"e_cushion": [0.6, 0.9], "e_cushion_floor": [0.5, 0.8]})
    assert batch[1].scene.physics.e_cushion_floor == 0.8  # pyright: ignore[reportOptionalMemberAccess]
