"""Shots without a derivative are named, and all other derivatives agree with differences."""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from benchmarks.reference.oracle import reference_shot
from billiards_env import Scene, derivatives, simulate_batch, strike
from billiards_env.derivatives.nonsmooth import REASONS
from billiards_env.derivatives.shot_derivatives import physics_inputs
from billiards_env.scene import Balls, Pocket, Table, layouts
from tests.helpers.derivatives import start_of
from tests.helpers.shots import simulate

IDEAL = Scene.named("ideal").physics


def ideal(n=2, radius=0.125, **fields):
    """Returns a scene of ideal balls on a table of 4 by 2 m."""
    return Scene(Balls.uniform(n, radius), Table(4.0, 2.0, **fields), IDEAL)


@pytest.mark.parametrize(("gap", "reason"), [(0.0, "grazing"), (1e-13, "grazing"), (-1e-13, "grazing"), (1e-9, "")])
def test_a_tangent_pass_has_no_derivative(gap, reason):
    shot = simulate(ideal(), [[-1.0, 0.25 + gap], [0.0, 0.0]], [1.0, 0.0], record=True, max_time=2.0)
    assert derivatives.nonsmooth(shot).reason == reason
    assert derivatives.nonsmooth(shot, 0.9).reason == ""  # it is nearest after 1 s


@pytest.mark.parametrize("offset", [0.0, 1e-13, -1e-13])
def test_a_pass_along_a_pocket_or_a_cushion_has_no_derivative(offset):
    pocket = ideal(1, pockets=(Pocket(0.0, 1.0, 0.25),))
    shot = simulate(pocket, [[-1.0, 0.75 + offset]], [1.0, 0.0], record=True, max_time=1.5)
    assert derivatives.nonsmooth(shot).reason == "lip"
    along = simulate(ideal(1), [[-1.0, 0.875 - abs(offset)]], [1.0, 0.0], record=True, max_time=1.0)
    assert derivatives.nonsmooth(along) == (-1, "grazing")


@pytest.mark.parametrize("name", ["pool", "uk_pool"])
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_shots_between_two_outcomes_have_no_derivative(name, seed):
    """The two adjacent directions between which the events change are named, whatever the body is."""
    scene = Scene.named(name, 1)
    places, velocities, _ = start_of(scene, seed)
    heading, speed = math.atan2(*velocities[0, ::-1]), 0.7 * math.hypot(*velocities[0])

    def shot(angle):
        start = [speed * math.cos(angle), speed * math.sin(angle)]
        one = simulate(scene, places, start, record=True, max_time=2.5)
        events = one.events[["ball", "kind", "other"]].tolist()
        return one, sorted(events, key=lambda event: event[0])  # events of two balls may change places

    low, high = heading - 0.2, heading + 0.2
    (_, first), (_, last) = shot(low), shot(high)
    assume(first != last)
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if shot(middle)[1] == first else (low, middle)
    assert shot(low)[0].nonsmooth().reason
    assert shot(high)[0].nonsmooth().reason


def test_a_ball_that_rolls_up_to_rounding_has_no_derivative():
    scene, headings = Scene.named("pool", 1), np.linspace(-3.0, 3.0, 200)
    starts = strike(scene, 1.0, headings, 0.0, 0.4)
    batch = simulate_batch(scene, [[[0.0, 0.0], [0.5, 0.5]]] * 200, starts, record=True)
    assert set(derivatives.nonsmooth(batch).reason) == {"rolling"}
    spinning = strike(scene, 1.0, headings, 0.0, 0.4 + 1e-9)
    batch = simulate_batch(scene, [[[0.0, 0.0], [0.5, 0.5]]] * 200, spinning, record=True)
    assert not (derivatives.nonsmooth(batch, 0.0).reason == "rolling").any()


def test_a_restitution_that_begins_to_fall_has_no_derivative():
    physics = dataclasses.replace(IDEAL, e_cushion_loss=0.1, e_cushion_onset=1.0)
    scene = dataclasses.replace(ideal(1), physics=physics)
    for speed, reason in ((1.0, "cushion"), (1.0 + 1e-9, ""), (1.0 - 1e-9, "")):
        shot = simulate(scene, [[0.0, 0.0]], [speed, 0.0], record=True, max_time=3.0)
        assert derivatives.nonsmooth(shot) == (-1 if not reason else 0, reason)


def test_a_shot_that_is_cut_at_an_event_has_no_derivative():
    scene, places = Scene.named("ideal", 1), [[-0.5, 0.0], [0.0, 0.0]]
    contact = 0.5 - 2 * 0.028575
    uncut = simulate(scene, places, [1.0, 0.0], record=True, max_time=1.0)
    assert derivatives.nonsmooth(uncut).reason == ""
    for time in (contact, np.nextafter(contact, 0.0), np.nextafter(contact, 1.0)):
        cut = simulate(scene, places, [1.0, 0.0], record=True, max_time=time)
        assert derivatives.nonsmooth(cut).reason == "cut"
        assert derivatives.nonsmooth(uncut, time).reason == "cut"
    pool = Scene.named("pool", 1)
    shot = simulate(pool, places, [0.5, 0.01], record=True)
    assert derivatives.nonsmooth(shot).reason == ""  # the natural end
    rolls = shot.events["time"][shot.events["kind"] == "sliding_rolling"][0]
    assert derivatives.nonsmooth(shot, rolls).reason == "cut"


def test_the_start_is_its_own_derivative():
    shot = simulate(Scene.named("pool", 1), [[-1.0, 0.0], [0.0, 0.5]], [0.5, 0.0], record=True)
    change = {"velocities": np.array([[1.0, 2.0], [3.0, 4.0]]), "spins": np.arange(6.0).reshape(2, 3)}
    for name, value in change.items():
        assert np.allclose(derivatives.jvp(shot, {name: value}, name, t=0.0), value, rtol=1e-15)
        assert np.allclose(derivatives.vjp(shot, {name: value}, name, t=0.0), value, rtol=1e-15)


def test_balls_without_friction_do_not_rub():
    base = Scene.named("uk_pool", 1)
    balls = dataclasses.replace(base.balls, radius=(base.balls.radius[1],) * 2)
    scene = dataclasses.replace(base, balls=balls, physics=dataclasses.replace(base.physics, mu_ball_factor=0.0))
    radius = scene.balls.radius[0]
    shot = simulate(scene, [[-radius, 0.0], [radius, 0.0]], [2.0, 0.0], record=True, max_time=0.01)
    turned = derivatives.jvp(shot, {"velocities": [[0.0, 1.0], [0.0, 0.0]]}, "velocities")
    assert turned[1, 1] == 0.0


def test_a_derivative_that_overflows_has_no_value():
    """Each impact of ideal balls multiplies a change by about ten."""
    scene, rng = Scene.named("ideal", 10), np.random.default_rng(0)
    places = layouts.draw("random", scene, rng)
    shot = simulate(scene, places, [3.0, 1.0], record=True, max_time=600.0)
    turned = derivatives.jvp(shot, {"velocities": np.eye(11, 2)})
    event, reason = derivatives.nonsmooth(shot)
    assert not np.isfinite(turned).all()
    assert reason == "overflow"
    assert np.isfinite(derivatives.jvp(shot, {"velocities": np.eye(11, 2)}, t=shot.events["time"][event])).all()
    assert derivatives.nonsmooth(shot, 5.0).reason == ""


def test_every_reason_is_in_the_page():
    page = (Path(__file__).parents[2] / "docs" / "derivatives.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \| (.+) \|$", page.partition("| Reason |")[2].partition("\n\n")[0], re.MULTILINE)
    assert dict(rows) == REASONS


SCENES = {name: Scene.named(name, 2) for name in ("ideal", "pool", "uk_pool", "snooker")}
"""Every law: the cushions "stronge" and friction between spheres in "uk_pool", "mathavan2010" in "snooker"."""
RANGES = {  # the first and the last number are ends of what the scenes allow
    "g": (1e-3, 9.81, 1e3),
    "mu_slide": (1e-12, 0.2, 100.0),
    "mu_roll": (1e-12, 0.02, 100.0),
    "spin_decay": (1e-6, 10.0, 1e6),
    "e_ball": (0.0, 0.5, 1.0),
    "e_cushion": (0.0, 0.9, 1.0),
    "mu_cushion": (0.0, 1.0, 100.0),
    "mu_ball_factor": (0.0, 1.0, 100.0),
    "e_cushion_loss": (0.0, 0.1, 100.0),
    "e_cushion_onset": (0.0, 1.0, 1e3),
    "e_cushion_floor": (0.0, 0.5, 0.98),
    "cushion_frequency_ratio": (1.1, 1.5, 2.0),
}


def draw_scene(base, rng):
    """Returns a scene with the engine of another and with some numbers of `RANGES`; the masses may be infinite."""
    numbers = {key: float(rng.choice(values)) for key, values in RANGES.items() if rng.random() < 0.3}
    physics = dataclasses.asdict(base.physics) | numbers
    least = 0.0
    if physics["cushion"] == "stronge":  # friction must not add energy
        least = 0.5 * (math.sqrt(1.0 + 8.0 / physics["cushion_frequency_ratio"] ** 2) - 1.0) + 0.01
    numbers["e_cushion_floor"] = min(max(physics["e_cushion_floor"], least), 0.98)
    numbers["e_cushion"] = max(physics["e_cushion"], numbers["e_cushion_floor"] + 0.01)
    masses = (base.balls.mass[0], *(float(x) for x in rng.choice([1e-8, base.balls.mass[0], 1e8, math.inf], 2)))
    balls = dataclasses.replace(base.balls, mass=masses)
    return dataclasses.replace(base, balls=balls, physics=dataclasses.replace(base.physics, **numbers))


INSIDE = np.array([-2.0, -1.0, 1.0, 2.0]), np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
AT_LEAST = np.array([0.0, 1.0, 2.0, 3.0]), np.array([-11.0, 18.0, -9.0, 2.0]) / 6.0
AT_MOST = -AT_LEAST[0], -AT_LEAST[1]


def differences(scene, start, change, number, step, time):
    """Returns differences of the positions along a change of the start or of a number, and whether the events agree."""
    (at, weights), value = INSIDE, getattr(scene.physics, number) if number else None
    if number:
        least, *_, most = RANGES[number]
        at, weights = AT_LEAST if value == least else (AT_MOST if value == most else INSIDE)
    moved = [np.stack([value + step * k * change.get(name, 0.0) for k in at]) for name, value in start.items()]
    physics = {number: value + step * at} if number else None
    spins = moved[2] if scene.physics.motion == "sliding" else None
    batch = simulate_batch(scene, *moved[:2], spins=spins, physics=physics, max_time=time, threads=1)
    return np.tensordot(weights, batch.positions, 1) / step, len(set(batch.n_events)) == 1


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**9))
def test_a_derivative_without_a_reason_agrees_with_differences(name, seed):
    rng = np.random.default_rng(seed)
    scene = draw_scene(SCENES[name], rng)
    start = dict(zip(("positions", "velocities", "spins"), start_of(scene, seed), strict=True))
    time, spins = float(rng.uniform(0.2, 1.5)), start["spins"] if scene.physics.motion == "sliding" else None
    shot = simulate(scene, start["positions"], start["velocities"], spins=spins, record=True, max_time=time)
    assume(derivatives.nonsmooth(shot).reason == "" and shot.n_events < 30)
    numbers = [key for key in RANGES if key in physics_inputs(scene.physics)]
    number = str(rng.choice(numbers)) if rng.random() < 0.5 and name != "ideal" else None
    change = {}
    if number is None:
        change = {
            key: rng.normal(size=value.shape) for key, value in start.items() if key != "spins" or spins is not None
        }
        change["positions"] *= np.abs(start["positions"]) < 0.5  # not into a cushion
        for key in change:
            change[key][1:] *= key == "positions"  # friction stops a ball at rest
    derivative = derivatives.jvp(shot, change or {str(number): 1.0})
    size, off = max(float(np.abs(derivative).max()), 1e-3), [math.inf]
    for step in 10.0 ** np.arange(-3.0, -8.0, -0.5):
        expected, same = differences(scene, start, change, number, step, time)
        if same:
            off.append(float(np.abs(expected - derivative).max()) / size)
    assume(min(off) < math.inf)
    assert min(off) < 2e-5


# Certain contacts agree with exact arithmetic, and doubtful contacts are not certain.

CONTACTS = ("ball_ball", "cushion", "pocket")


def contacts(events):
    """Returns (kind, ball, other) of the contacts among events (kind, ball, other), in order."""
    return [(kind, *(sorted(of) if kind == "ball_ball" else of)) for kind, *of in events if kind in CONTACTS]


def contacts_of(shot):
    return contacts(shot.events[["kind", "ball", "other"]].tolist())


def contacts_of_exact(shot):
    return contacts([(e.kind, e.ball, e.other) for e in shot.events])


@pytest.mark.parametrize(
    ("gap", "certain"), [(0.0, False), (1e-13, False), (-1e-13, False), (1e-9, True), (-1e-9, True)]
)
def test_a_ball_that_barely_passes_is_not_certain(gap, certain):
    scene = Scene.named("ideal")
    shot = simulate(scene, [[-0.5, 2 * scene.balls.radius[0] + gap], [0.0, 0.0]], [1.0, 0.0], record=True, max_time=0.9)
    assert derivatives.certainty(shot).outcome == certain


def test_a_ball_that_stops_within_rounding_of_a_ball_is_not_certain():
    """In exact arithmetic the two touch."""
    scene, places, start = Scene.named("carom", 1), [[-0.5, 0.0], [-0.035923414682838536, 0.0]], [0.3843449257916131, 0]
    shot, exact = simulate(scene, places, start, record=True), reference_shot(scene, places, start)
    assert (contacts_of(shot), contacts_of_exact(exact)) == ([], [("ball_ball", 0, 1)])
    assert derivatives.nonsmooth(shot).reason == "grazing"
    assert derivatives.certainty(shot) == (0, False)
    assert derivatives.margins(shot).balls[0, 1] <= 0.0  # it is positive if the two touch


@pytest.mark.parametrize("spin", [0.0, 1.0, -0.4])
@pytest.mark.parametrize("body", ["ball", "cushion", "pocket"])
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_no_speed_at_which_a_ball_stops_within_rounding_of_a_contact_is_certain(body, spin, seed):
    """The shots with speeds around a change of outcome are named, and their margins have the sign of the outcome."""
    scene, rng = Scene.named("pool" if body == "pocket" else "carom", 1), np.random.default_rng(seed)
    radius, (length, width) = scene.balls.radius[0], scene.half_extents
    at, away, heading = (
        rng.uniform(-0.3, 0.3, 2) * (length, width),
        [-0.7 * length, 0.7 * width],
        rng.uniform(-0.5, 0.5),
    )
    other = at + rng.uniform(0.2, 0.5) * np.array([math.cos(heading), math.sin(heading)]) if body == "ball" else away
    if body == "pocket":
        pocket = scene.table.pockets[int(rng.integers(6))]
        at = 0.5 * np.array([pocket.x, pocket.y]) + [0.03, 0.0]
        heading = math.atan2(pocket.y - at[1], pocket.x - at[0])
        other = [-at[0], -at[1]]

    def shot(speed):
        velocity = speed * np.array([math.cos(heading), math.sin(heading)])
        spins = [spin / radius * np.array([-velocity[1], velocity[0], 0.0]), [0.0] * 3]
        return simulate(scene, [at, other], velocity, spins=spins, record=True)

    low, high = 0.02, 1.5
    none = contacts_of(shot(low))
    assume(none != contacts_of(shot(high)))
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if contacts_of(shot(middle)) == none else (low, middle)
    for speed in low * (1.0 + np.arange(-8, 9) * 2.0**-52):
        near = shot(float(speed))
        assert derivatives.nonsmooth(near).reason
        assert not derivatives.certainty(near).outcome
        margins = derivatives.margins(near)
        assert (margins.balls[0, 1] > 0.0) == (("ball_ball", 0, 1) in contacts_of(near))
        assert (margins.pockets[0] > 0.0).any() == near.potted[0]
        assert (margins.cushions[0] > 0.0).any() == any(contact[:2] == ("cushion", 0) for contact in contacts_of(near))


@pytest.mark.parametrize("name", ["pool", "uk_pool"])
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_certain_contacts_are_those_of_the_reference(name, seed):
    """Balls of equal speeds end their phases at the same times; rounding decides in which order."""
    scene, rng = Scene.named(name, 2), np.random.default_rng(seed)
    places, velocities, _ = start_of(scene, seed)
    headings = rng.uniform(-math.pi, math.pi, 2)
    velocities[:2] = rng.uniform(0.3, 1.5) * np.stack((np.cos(headings), np.sin(headings)), axis=1)
    shot = simulate(scene, places, velocities, record=True, max_time=4.0)
    certainty, exact = derivatives.certainty(shot), reference_shot(scene, places, velocities, max_time=4.0, digits=30)
    assert contacts_of(shot)[: certainty.contacts] == contacts_of_exact(exact)[: certainty.contacts]
    if certainty.outcome:
        assert contacts_of(shot) == contacts_of_exact(exact)
        assert shot.potted.tolist() == exact.potted


def test_a_doubt_grows_with_the_impacts_before_it():
    scene = Scene.named("ideal", 3)
    start = [[-0.9, 0.0], [-0.8, 0.04], [-0.6, -0.3], [0.6, 0.3]]
    shot = simulate(scene, start, [1.0, 0.0], record=True, max_time=8.0)
    of_shot, impacts = derivatives.certainty(shot), (shot.events["kind"] == "ball_ball").sum()
    assert impacts >= 4
    assert 0 < of_shot.contacts <= len(contacts_of(shot))
    uncut = simulate(scene, start, [1.0, 0.0], record=True, max_time=1000.0, max_events=1500)
    certainty = derivatives.certainty(uncut)  # the errors overflow without a warning
    assert of_shot.contacts <= certainty.contacts < uncut.n_events  # later the errors are as large as the table
    assert not certainty.outcome
    until = uncut.events["time"][[certainty.contacts - 1, certainty.contacts]].mean()  # all events are contacts
    exact = reference_shot(scene, start, [1.0, 0.0], max_time=float(until))
    assert contacts_of_exact(exact) == contacts_of(uncut)[: certainty.contacts]


def test_contacts_at_one_time_have_no_certain_order():
    scene = Scene.named("ideal", 2)
    start = [[-1.0, 0.0], [0.5, 0.2], [0.5, -0.2]]
    for second, certain in (([1.0, 0.0], False), ([1.01, 0.0], True)):
        velocities = [[0.0, 0.0], [1.0, 0.0], second]
        shot = simulate(scene, start, velocities, record=True, max_time=1.0)
        assert derivatives.certainty(shot) == ((2, True) if certain else (0, False))
