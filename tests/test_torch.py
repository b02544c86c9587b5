"""Shots as differentiable functions of tensors."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from torch._dynamo import explain
from torch.autograd import gradcheck
from torch.func import grad, jacfwd, jacrev, vmap

from billiards_env import Scene, derivatives, simulate_batch
from billiards_env.envs import make_vector_env
from billiards_env.torch import pot_margins, simulate
from tests.helpers.derivatives import aimed
from tests.helpers.errors import refusals

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")  # of torch itself

SCENES = {"ideal": Scene.named("ideal", 2), "pool": Scene.named("pool", 2), "real_pool": Scene.named("real_pool", 2)}
OUTPUTS = ("positions", "velocities", "spins")


def start(scene, m=2, spins=False):
    """Returns positions, velocities of the cue balls and, on request, their spins, of shots aimed at ball 1."""
    places, moving = zip(*(aimed(scene, seed) for seed in range(3, 3 + m)), strict=True)
    rng = np.random.default_rng(0)
    arrays = [np.array(places), np.array(moving)[:, 0], *([rng.normal(0.0, 5.0, (m, 3))] if spins else [])]
    return [torch.tensor(array, requires_grad=True) for array in arrays]


@pytest.mark.parametrize("name", SCENES)
def test_gradcheck_passes(name):
    scene = SCENES[name]
    inputs = start(scene, spins=name != "ideal")

    def outputs(*tensors):
        return tuple(simulate(scene, *tensors, of=OUTPUTS, max_time=0.7).values())

    assert gradcheck(outputs, inputs, eps=1e-7, atol=1e-4, rtol=1e-4, check_forward_ad=True)


def test_gradcheck_passes_for_margins():
    scene = SCENES["pool"]

    def margins(*tensors):
        outputs = simulate(scene, *tensors, of=("ball_margins", "pocket_margins"), max_time=1.5)
        return outputs["ball_margins"][:, 0, 1:], outputs["pocket_margins"][:, :2]

    assert gradcheck(margins, start(scene), eps=1e-7, atol=1e-4, rtol=1e-4, check_forward_ad=True)


def test_the_outputs_are_those_of_a_batch():
    scene = SCENES["real_pool"]
    tensors = start(scene, 3, spins=True)
    arrays = [tensor.detach().numpy() for tensor in tensors]
    batch = simulate_batch(scene, arrays[0], arrays[1], spins=arrays[2], max_time=0.7, record=True)
    outputs = simulate(scene, *tensors, of=(*OUTPUTS, "cushion_margins"), max_time=0.7)
    assert outputs["cushion_margins"].tolist() == derivatives.margins(batch).cushions.tolist()
    for name in OUTPUTS:
        assert outputs[name].tolist() == getattr(batch, name).tolist()
    single = simulate(scene, tensors[0][1], tensors[1][1], tensors[2][1], max_time=0.7)
    assert single.tolist() == batch.positions[1].tolist()
    floats = simulate(scene, *(tensor.float() for tensor in tensors), max_time=0.7)
    assert floats.dtype == torch.float32


CONSTANTS = {"mu_roll": 0.01, "mu_slide": 0.2, "e_ball": 0.95, "e_cushion": 0.85, "g": 9.81}


def with_constants(scene):
    """Returns a function of radii, masses and numbers of the physics to the ends of shots, and its inputs."""
    places, moving = (tensor.detach() for tensor in start(scene))
    n = scene.n_balls
    constants = [
        torch.tensor(scene.balls.radius),
        torch.tensor([0.17, 0.2, 0.16]),
        *map(torch.tensor, CONSTANTS.values()),
    ]

    def ends(radius, mass, *numbers):
        physics = dict(zip(CONSTANTS, numbers, strict=True))
        return simulate(scene, places, moving, radius=radius, mass=mass, physics=physics, max_time=0.7)

    assert n == 3
    return ends, [tensor.double().requires_grad_() for tensor in constants]


def test_gradcheck_passes_for_constants():
    ends, constants = with_constants(SCENES["pool"])
    assert gradcheck(ends, constants, eps=1e-7, atol=1e-4, rtol=1e-4, check_forward_ad=True)


def test_vmap_runs_one_batch_and_has_the_derivatives_of_the_batch():
    scene = SCENES["pool"]
    places, moving = (tensor.detach() for tensor in start(scene, 4))

    def end(position, velocity):
        return simulate(scene, position, velocity, max_time=0.7)

    batched = simulate(scene, places, moving, max_time=0.7)
    assert torch.equal(vmap(end)(places, moving), batched)
    pairs = vmap(vmap(end))(places.reshape(2, 2, 3, 2), moving.reshape(2, 2, 2))
    assert torch.equal(pairs.flatten(0, 1), batched)
    arrays = places.numpy(), moving.numpy()
    jacobian = derivatives.jacobian(simulate_batch(scene, *arrays, max_time=0.7, record=True))[..., 0, :]
    for derivative in (vmap(jacrev(end, 1))(places, moving), vmap(jacfwd(end, 1))(places, moving)):
        np.testing.assert_allclose(derivative.numpy(), jacobian, rtol=0, atol=1e-12)
    by_sum = vmap(grad(lambda v, p: end(p, v).sum()))(moving, places)
    np.testing.assert_allclose(by_sum.numpy(), jacobian.sum((1, 2)), rtol=0, atol=1e-12)


def test_jacobians_by_constants_need_no_batch_of_scenes():
    ends, constants = with_constants(SCENES["pool"])
    forward, backward = (of(ends, (1, 2, 4))(*(x.detach() for x in constants)) for of in (jacfwd, jacrev))
    for left, right in zip(forward, backward, strict=True):
        assert left.abs().max() > 0
        np.testing.assert_allclose(left.numpy(), right.numpy(), rtol=0, atol=1e-11 * float(left.abs().max()))
    with pytest.raises(NotImplementedError, match="vmap over 'e_ball': expected the same scene"):
        vmap(lambda e: simulate(SCENES["pool"], *start(SCENES["pool"]), physics={"e_ball": e}))(torch.ones(2))


def test_each_shot_may_have_its_own_physics():
    scene, m = SCENES["pool"], 4
    places, moving = (tensor.detach() for tensor in start(scene, m))
    numbers = torch.linspace(0.8, 0.95, m).double(), torch.linspace(0.15, 0.25, m).double().requires_grad_()

    def ends(e_ball, mu_slide, of: slice | int = slice(None)):
        physics = {"e_ball": e_ball, "mu_slide": mu_slide}
        return simulate(scene, places[of], moving[of], physics=physics, max_time=0.7)

    batched = ends(*numbers)
    single = torch.stack([ends(*row) for row in zip(*numbers, range(m), strict=True)])
    assert batched.tolist() == single.tolist()
    slopes = [torch.autograd.grad(out.square().sum(), numbers[1]) for out in (batched, single)]
    assert torch.equal(*(slope for (slope,) in slopes))
    assert slopes[0][0].abs().min() > 0
    assert gradcheck(ends, numbers, eps=1e-7, atol=1e-4, rtol=1e-4, check_forward_ad=True)


def test_vmap_maps_over_the_physics_of_a_shot():
    (place, _), (moving, _) = start(SCENES["pool"])

    def loss(mu_slide, place):
        return simulate(SCENES["pool"], place, moving, physics={"mu_slide": mu_slide}, max_time=0.7).square().sum()

    numbers = torch.linspace(0.15, 0.25, 4).double()[:, None]  # each has an axis of one shot
    mapped, alone = vmap(grad(loss), (0, None))(numbers, place), [grad(loss)(row, place) for row in numbers]
    assert torch.equal(mapped, torch.stack(alone))


def test_whole_numbers_are_numbers():
    scene, places, velocities = SCENES["ideal"], torch.tensor([[-1, 0], [0, 0], [1, 0]]), torch.tensor([0, 1])
    ends = simulate(scene, places, velocities, max_time=0.25)
    assert ends.dtype == torch.get_default_dtype()
    assert ends[0].tolist() == [-1.0, 0.25]
    with pytest.raises(ValueError, match=r"velocities has type torch.complex64: expected real numbers"):
        simulate(scene, places, velocities * 1j)


def test_second_derivatives_are_refused():
    places, moving = start(SCENES["pool"])
    (first,) = torch.autograd.grad(simulate(SCENES["pool"], places, moving).sum(), moving, create_graph=True)
    with pytest.raises(NotImplementedError, match="second derivatives of shots"):
        first.sum().backward()


@refusals(
    "arguments",
    [
        ({"of": "events"}, "of = 'events': expected one of"),
        ({"scene": "pool"}, "scene = 'pool': expected a Scene", TypeError),
        ({"scene": Scene.named("jump_pool", 2)}, r"physics\.flight = True with .*: expected False or simulate_batch"),
        ({"velocities": [[1.0, 0.0]] * 2}, "velocities = .*: expected a tensor", TypeError),
        ({"velocities": torch.ones(2, 2) * 1j}, "velocities has type torch.complex64: expected real numbers"),
        ({"radius": torch.full((3,), 0.03 + 0j)}, "radius has type torch.complex64: expected real numbers"),
        ({"radius": torch.tensor(0.03)}, r"radius has shape \(\): expected \(3,\)"),
        ({"mass": torch.ones(2, 3)}, r"mass has shape \(2, 3\): expected \(3,\)"),
        ({"physics": torch.ones(1)}, "physics = .*: expected a mapping", TypeError),
        ({"physics": {"mu_roll": 0.01}}, "mu_roll = 0.01: expected a tensor", TypeError),
        ({"physics": {"motion": torch.ones(1)}}, "physics = 'motion': expected one of"),
        ({"physics": {"positions": torch.zeros(2, 3, 2)}}, "physics = 'positions': expected one of"),
        ({"physics": {"mu_roll": torch.ones(3)}}, r"physics\['mu_roll'\] has shape \(3,\): expected \(2,\)"),
        (
            {"physics": {"mu_roll": torch.tensor(0.01)}, "varied": {"mu_roll": [0.02, 0.02]}},
            r"varied = \{'mu_roll': .*\}: expected numbers that physics does not have",
        ),
    ],
)
def test_wrong_arguments_are_refused(arguments, message, kind):
    places, moving = start(SCENES["pool"])
    with pytest.raises(kind, match=message):
        simulate(**{"scene": SCENES["pool"], "positions": places, "velocities": moving, **arguments})


@pytest.mark.filterwarnings("ignore:The .grad attribute of a Tensor that is not a leaf:UserWarning")  # of torch itself
def test_a_compiler_does_not_trace_shots():
    env = gym.make("billiards_env:Billiards-v0")
    scene, positions = Scene.named("pool"), torch.tensor([[[-0.6, 0.0], [0.6, 0.3]]]).double()
    actions = torch.tensor([[0.5, 0.13]]).double().requires_grad_()

    def by_simulate(actions):
        return (2.0 * simulate(scene, positions, 1.5 * actions, max_time=0.7)).square().sum()

    def by_margins(actions):
        return (2.0 * pot_margins(env, positions, 1.5 * actions)).square().sum()

    for function in (by_simulate, by_margins):
        found = explain(function)(actions)
        assert (found.graph_break_count, found.graph_count) == (1, 2)
        compiled = torch.compile(function, backend="eager")
        slopes = (torch.autograd.grad(call(actions), actions)[0] for call in (function, compiled))
        assert torch.equal(*slopes)


def test_pot_margins_are_positive_for_pots_and_lead_to_them():
    envs = make_vector_env(64, "Disabled")
    envs.reset(seed=0)
    positions = torch.tensor(envs.positions)
    rest = pot_margins(envs, positions, torch.zeros(64, 2, dtype=torch.float64))[..., :4]
    scene = envs.single_env.scene
    places = torch.tensor([(pocket.x, pocket.y) for pocket in scene.table.pockets[:4]], dtype=torch.float64)
    gaps = (positions[:, 1, None] - places).norm(dim=-1) - scene.table.pockets[0].radius
    apart = (positions[:, 1] - positions[:, 0]).norm(dim=-1) - sum(scene.balls.radius)
    np.testing.assert_allclose(rest[:, 0].numpy(), -(gaps + apart[:, None]).numpy(), atol=1e-12)

    aims = positions[:, 1] - positions[:, 0]
    actions = (0.4 * aims / aims.norm(dim=-1, keepdim=True)).requires_grad_()
    for _ in range(12):  # Gauss-Newton steps to the nearest pocket
        margin = pot_margins(envs, positions, actions)[:, 0].amax(-1)
        (slope,) = torch.autograd.grad(margin.sum(), actions)
        step = (0.04 - margin)[:, None] * slope / slope.square().sum(-1, keepdim=True).clamp(min=1e-3)
        step = step / (step.norm(dim=-1, keepdim=True) / 0.05).clamp(min=1.0)
        actions = (actions + torch.where(margin[:, None] > 0, 0.0, step)).detach().requires_grad_()
    potted = pot_margins(envs, positions, actions)[:, 0].amax(-1) > 0
    envs.step(actions.detach().numpy())
    assert potted.tolist() == envs.potted[:, 1].tolist()
    assert potted.float().mean() > 0.5


@pytest.mark.parametrize(
    "arguments", [{"n_object_balls": 5}, {"randomize": {"mu_roll": (0.005, 0.02), "e_ball": (0.8, 0.98)}}]
)
def test_pot_margins_are_positive_exactly_for_pots(arguments):
    """Among them are combinations, in which the cue ball never touches the ball."""
    envs, rng = make_vector_env(300, "Disabled", **arguments), np.random.default_rng(0)
    envs.reset(seed=1)
    positions, places = envs.positions, [(p.x, p.y) for p in envs.single_env.scene.table.pockets]
    angles = np.arctan2(*(positions[:, 1] - positions[:, 0]).T[::-1]) + rng.normal(0.0, 0.1, 300)
    actions = (rng.uniform(0.3, 1.0, 300) * (np.cos(angles), np.sin(angles))).T.astype(np.float32)
    margins = pot_margins(envs, torch.tensor(positions), torch.tensor(actions))
    envs.step(actions)
    at_pocket = (envs.positions[:, 1:, None] == places).all(axis=-1)
    assert at_pocket.sum() > 20
    np.testing.assert_array_equal(margins.numpy() > 0.0, at_pocket)


def test_pot_margins_of_a_ball_that_is_off_the_table():
    positions, actions = torch.tensor([[[-0.6, 0.0], [0.6, 0.3]]]).double(), torch.tensor([[0.5, 0.13]])
    one = pot_margins(gym.make("billiards_env:Billiards-v0"), positions, actions)
    env = gym.make("billiards_env:Billiards-v0", n_object_balls=2)
    two = pot_margins(env, torch.cat((positions, positions[:, 1:]), 1), actions, in_play=[True, True, False])
    assert two[:, :1].tolist() == one.tolist()
    assert (two[:, 1] == -torch.inf).all()


def test_pot_margins_of_other_shots_are_refused():
    strikes = gym.make("billiards_env:Billiards-v0", action="strike")
    pit = gym.make("billiards_env:Billiards-v0", mode="pit", dt=0.01)
    for env, text in (
        (strikes, r"env\.action = 'strike': expected 'velocity'"),
        (pit, r"env\.engine = PIT, dt = 1/100 s: expected PIC"),
    ):
        with pytest.raises(ValueError, match=text):
            pot_margins(env, torch.zeros(1, 2, 2), torch.zeros(1, 2))
    env = gym.make("billiards_env:Billiards-v0")
    for places, actions in ([(2, 2), (2,)], [(1, 2, 2), (1, 2, 2)], [(3, 2, 2), (2, 2)]):
        with pytest.raises(ValueError, match=r"actions has shape .*: expected \(m, 2\)"):
            pot_margins(env, torch.zeros(places), torch.zeros(actions))
