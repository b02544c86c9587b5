"""The network that aims and its mixture."""

import math

import pytest
import torch

from billiards_env.sb3.aim_network import AimNetwork

HALF = (1.27, 0.635)
FORMS = {
    "one ball": (1, {}),
    "three balls": (3, {"aim": "layout"}),
    "goal": (2, {"features": {"goal": (1, 2), "shots_left": (), "physics": (2,)}}),
    "goal in two layers": (2, {"features": {"goal": (1, 2)}, "waves": 2, "goal_units": 8, "activation": "silu"}),
    "points for a goal": (2, {"aim": "layout", "features": {"goal": (1, 2)}, "goal_units": 8}),
    "run-out": (4, {"features": {"legal_balls": (4,)}, "diameter": 0.06}),
    "strikes": (2, {"aim": "layout", "strikes": True, "own_std": True}),
}


@pytest.fixture(params=FORMS)
def form(request):
    """The number of object balls, and a network whose weights are random."""
    torch.manual_seed(0)
    balls, arguments = FORMS[request.param]
    net = AimNetwork(HALF, 5, (0.1, 0.3, 0.6), 16, **arguments)
    with torch.no_grad():
        for weights in net.parameters():
            weights.add_(0.1 * torch.randn(weights.shape))
    net.std[:] = torch.tensor([0.1, 0.02, 0.2])
    return balls, net


def test_all_hidden_layers_have_the_activation():
    features = {"goal": (1, 2)}
    net = AimNetwork(HALF, 5, (0.1, 0.6), 16, features=features, goal_units=8, diameter=0.06, activation="silu")
    units = {type(part) for part in net.modules() if not list(part.children())}
    assert units == {torch.nn.Linear, torch.nn.SiLU}


def layouts_of(balls, count=6):
    """Returns features of random layouts; a network takes those of its form."""
    places = 2 * torch.rand(count, balls + 2, 2) - 1
    numbers = {
        "legal_balls": torch.ones(count, balls),
        "shots_left": torch.rand(count),
        "physics": torch.rand(count, 2),
    }
    return {"positions": places[:, 1:], "goal": places[:, :1], **numbers}


def test_a_reflected_layout_has_the_reflected_shot_and_the_same_value(form):
    balls, net = form
    layouts = layouts_of(balls)
    with torch.no_grad():
        mixture, values = net(**layouts)
        for x, y in ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)):
            places = {name: layouts[name] * torch.tensor([x, y]) for name in ("positions", "goal")}
            reflected, same = net(**{**layouts, **places})
            expected = mixture.mode() * torch.tensor([x, y, x * y, 1.0, 1.0])[: 2 + net.numbers]
            torch.testing.assert_close(reflected.mode(), expected)
            torch.testing.assert_close(same, values)


def test_the_order_of_the_object_balls_does_not_matter(form):
    balls, net = form
    layouts = layouts_of(balls)
    positions = torch.cat((layouts["positions"][:, :1], layouts["positions"][:, 1:].flip(1)), 1)
    with torch.no_grad():
        (one, value), (other, same) = net(**layouts), net(**{**layouts, "positions": positions})
    torch.testing.assert_close(one.mode(), other.mode())
    torch.testing.assert_close(value, same)


def test_no_shot_aims_at_a_ball_that_is_potted_or_not_legal():
    torch.manual_seed(0)
    net = AimNetwork(HALF, 3, (0.1, 0.3, 0.6), 16, features={"legal_balls": (3,)})
    positions = torch.tensor([[[0.2, -0.3], [0.0, -1.0], [0.7, -0.1], [0.1, 0.1]]])
    mixture, _ = net(positions, legal_balls=torch.tensor([[1.0, 1.0, 0.0]]))
    assert mixture.log_weight.exp().sum().item() == pytest.approx(1.0)
    toward = mixture.dx * (0.7 - 0.2) + mixture.dy * (-0.1 + 0.3) * 0.5  # ball 2, the only one that can be hit
    assert (toward > 0).all()
    flags = torch.tensor([[0.0, 1.0, 0.0], [0.0, 1.0, 1.0]])
    (alone, value), (among, values) = (net(positions.expand(m, -1, -1), legal_balls=flags[:m]) for m in (1, 2))
    assert (alone.dx.shape[1], among.dx.shape[1]) == (6, 12)
    assert among.log_weight[0, :6].exp().sum().item() == pytest.approx(1.0)
    torch.testing.assert_close(alone.mode()[0], among.mode()[0])
    torch.testing.assert_close(value[0], values[0])


def test_other_balls_matter_unless_they_are_potted(form):
    balls, net = form
    if balls == 1:
        return
    layouts = layouts_of(balls)
    moved, potted = layouts["positions"].clone(), layouts["positions"].clone()
    moved[:, -1, 0] += 0.1
    potted[:, -1, 1] = 1.0
    shifted = potted.clone()
    shifted[:, -1, 0] += 0.1
    with torch.no_grad():
        parts = [net(**{**layouts, "positions": each}) for each in (layouts["positions"], moved, potted, shifted)]
    weights, values = [mixture.log_weight for mixture, _ in parts], [value for _, value in parts]
    for one, other, gone, same in (weights, values):
        assert not torch.allclose(one, other)
        torch.testing.assert_close(gone, same)


def test_balls_in_the_way_change_the_logits():
    net = AimNetwork(HALF, 1, (0.1, 0.3, 0.6), 16, diameter=0.06)
    with torch.no_grad():
        net.first_points[:] = torch.tensor([[0.0], [0.03]])  # half a ball to the left: a cut of 30 degrees
        of_paths = list(net.of_paths.parameters())
        for weights in [*list(net.points.parameters())[-2:], *of_paths]:
            weights.zero_()
        first, bias, last, _ = (
            of_paths  # the logit of the first range is 1 plus the first number; of the second, the other
        )
        bias[:2] = 1.0
        for each in (first, last):
            each[0, 0] = each[1, 1] = 1.0
        to_ball, aside = torch.tensor([0.4, 0.0]), torch.tensor([0.0, 0.03])
        aim = (to_ball + aside) / (to_ball + aside).norm()
        left = torch.tensor([-aim[1], aim[0]])
        off = aim[0] * to_ball[1] - aim[1] * to_ball[0]
        ahead = (0.06**2 - off * off).sqrt()
        hit = (ahead * aim + off * left) / 0.06
        right = torch.tensor([hit[1], -hit[0]])
        cue_ball = torch.tensor([0.05, 0.1])
        for other, expected in [
            (0.2 * aim + 0.06 * left, (1.0, 2.0)),  # the cue ball would touch it
            (0.2 * aim - 0.075 * left, (1.5, 2.0)),
            (0.2 * aim + 0.02 * left, (0.0, 2.0)),
            (-0.2 * aim, (2.0, 2.0)),
            (0.6 * aim + 0.02 * left, (2.0, 2.0)),  # beyond the contact
            (to_ball + 0.3 * hit + 0.06 * right, (2.0, 1.0)),  # the object ball would touch it
            (to_ball + 0.3 * hit - 0.1 * right, (2.0, 2.0)),
            (to_ball - 0.3 * hit, (2.0, 2.0)),
        ]:
            positions = torch.stack((cue_ball, cue_ball + to_ball, cue_ball + other)) / torch.tensor(HALF)
            layouts, _ = net.layouts(positions[None])
            assert layouts.paths[0, 0].tolist() == pytest.approx(expected, abs=1e-4), other


def test_the_density_of_the_mixture_integrates_to_one():
    torch.manual_seed(0)
    net = AimNetwork(HALF, 3, (0.1, 0.3, 0.6), 16, own_std=True)
    net.std[:2] = 0.1
    with torch.no_grad():
        net.get_parameter("choice.4.bias").normal_(0, 0.3)
        mixture, _ = net(torch.tensor([[[0.2, -0.3], [-0.4, 0.5]]]))
        assert len(set(mixture.along[0].tolist())) == 6  # points times ranges
        edges = torch.linspace(-1.5, 1.5, 1201)
        logs = torch.cat([mixture.log_prob(part) for part in torch.cartesian_prod(edges, edges).split(100_000)])
    assert logs.exp().sum() * (edges[1] - edges[0]) ** 2 == pytest.approx(1.0, abs=1e-3)


def test_the_densities_of_several_actions_of_each_mixture_and_their_gradients_are_those_of_pytorch():
    torch.manual_seed(0)
    net = AimNetwork(HALF, 3, (0.1, 0.3, 0.6), 16, own_std=True).double()
    net.std[:] = 0.02
    bias = net.get_parameter("choice.4.bias")
    mixture, _ = net((torch.rand(5, 2, 2) - 0.5).double())
    actions = torch.cat((mixture.samples(2), torch.full((5, 1, 2), -1.0)), 1)  # the last is far from all components
    axes = torch.stack((mixture.dx, mixture.dy, -mixture.dy, mixture.dx), 2).unflatten(2, (2, 2)).mT
    places = axes[..., 0] * mixture.speed[..., None]
    scales = axes @ torch.stack((mixture.along, mixture.across), 2).square().diag_embed() @ axes.mT
    gaussians = torch.distributions.MultivariateNormal(places, scales)
    weights = torch.distributions.Categorical(logits=mixture.log_weight)
    expected = torch.distributions.MixtureSameFamily(weights, gaussians).log_prob(actions.transpose(0, 1)).T
    together = mixture.log_prob(actions)
    torch.testing.assert_close(together[:, :2], expected[:, :2])
    assert (together[:, 2] < -40).all()
    for found, reference in zip(together[:, :2].T, expected[:, :2].T, strict=True):
        gradients = (torch.autograd.grad(one.sum(), bias, retain_graph=True)[0] for one in (found, reference))
        torch.testing.assert_close(*gradients)
    assert torch.equal(torch.stack([mixture.log_prob(actions[:, k]) for k in range(3)], 1), together)


def test_the_density_of_strikes_is_that_of_their_samples():
    torch.manual_seed(0)
    net = AimNetwork(HALF, 1, (0.3, 0.6), 16, strikes=True)
    net.std[:] = torch.tensor([0.1, 0.02, 0.2])
    with torch.no_grad():
        net.turn.fill_(0.3)
        mixture, _ = net(torch.tensor([[[0.2, -0.3], [-0.4, 0.5]]]).expand(50_000, -1, -1))
        strikes = mixture.sample()
        assert strikes.shape == (50_000, 5)
        # The mean log-density of one Gaussian is minus its entropy.
        entropy = 2.5 * math.log(2 * math.pi * math.e) + sum(
            std.log().item() for std in (mixture.along[0, 0], mixture.across[0, 0], *3 * [mixture.tip_std])
        )
    assert -mixture.log_prob(strikes).mean().item() == pytest.approx(entropy, abs=0.03)
    # A larger side needs a cue that is turned back.
    slope = torch.linalg.lstsq(
        torch.stack((strikes[:, 2], torch.ones(50_000)), 1), torch.atan2(strikes[:, 1], strikes[:, 0])[:, None]
    ).solution[0]
    assert slope.item() == pytest.approx(-0.3, abs=0.02)


def test_the_mode_is_the_mean_with_the_largest_weight_over_its_own_factors():
    torch.manual_seed(0)
    net = AimNetwork(HALF, 3, (0.1, 0.3, 0.6), 16, own_std=True)
    net.std[:] = torch.tensor([0.01, 0.001, 0.01])
    layout = torch.tensor([[[0.2, -0.3], [-0.4, 0.5]]])
    with torch.no_grad():
        before, _ = net(layout)
        last = net.get_parameter("choice.4.bias").unflatten(0, (net.kinds, 6))
        last[0, 4], last[-1, 4] = 0.5, 1.0  # heavier and wider than the others
        mixture, _ = net(layout)
    assert mixture.log_weight.argmax() == 4
    assert not torch.equal(mixture.mode(), mixture._action(torch.tensor([[4]]), torch.zeros(2, 1)))
    widths = (mixture.along * mixture.across / (before.along * before.across)).log()
    torch.testing.assert_close(mixture.log_width - before.log_width, widths, atol=1e-5, rtol=1e-4)


def test_all_tensors_are_on_the_device_of_the_weights(form, monkeypatch):
    balls, net = form
    if net.legal:  # the number of legal balls is no part of a tensor on the device "meta"
        monkeypatch.setattr(
            net, "_first_balls", lambda allowed: torch.arange(balls, device="meta").expand(allowed.shape)
        )
    mixture, values = net.to("meta")(**{name: feature.to("meta") for name, feature in layouts_of(balls).items()})
    for actions in (mixture.mode(), mixture.sample()):
        assert actions.device == mixture.log_prob(actions).device == mixture.entropy().device == values.device
        assert values.device.type == "meta"


@pytest.mark.parametrize("strikes", [False, True])
def test_proposals_are_the_mode_means_and_random_actions_in_turn(strikes):
    torch.manual_seed(0)
    net = AimNetwork(HALF, 6, (0.1, 0.3, 0.6), 16, strikes=strikes)
    net.std[:] = torch.tensor([0.01, 0.001, 0.01])
    layout = torch.tensor([[[0.2, -0.3], [-0.4, 0.5]]])
    with torch.no_grad():
        mixture, _ = net(layout)
        proposals = mixture.proposals(30, torch.Generator().manual_seed(1))
        assert proposals.shape == (30, 5 if strikes else 2)
        assert torch.equal(proposals, mixture.proposals(30, torch.Generator().manual_seed(1)))
        assert not torch.equal(proposals, mixture.proposals(30, torch.Generator().manual_seed(2)))
        assert torch.equal(proposals[:1], mixture.mode())
        for count in range(1, 9):
            assert len(mixture.proposals(count, torch.Generator().manual_seed(1))) == count
        means = torch.cat([mixture._action(k[None, None], torch.zeros(5, 1)) for k in mixture.log_weight[0].argsort()])
        assert torch.equal(proposals[:30:3], means.flip(0)[:10])
        near = torch.cdist(mixture.proposals(3000, torch.Generator()), means).amin(1)
    random, wide = near[1:36:3], near[2:36:3]
    assert random.median() > 0.001
    assert wide.median() > 1.5 * random.median()


def test_joined_mixtures_have_the_density_of_the_weighted_sum(form):
    balls, net = form
    with torch.no_grad():
        mixtures, _ = net(**layouts_of(balls))
        worth = torch.linspace(0.1, 0.9, len(mixtures.log_weight))
        joined, actions = mixtures.joined(worth), mixtures.sample()[:1]
        densities = mixtures.log_prob(actions.expand(len(worth), -1)).exp()
        expected = (worth * densities).sum() / worth.sum()
    torch.testing.assert_close(joined.log_prob(actions).exp()[0], expected)


def test_many_goals_of_a_layout_have_the_mixtures_of_one_goal_each():
    torch.manual_seed(0)
    net = AimNetwork(HALF, 3, (0.1, 0.3, 0.6), 16, features={"goal": (1, 2)}, waves=2, goal_units=8)
    positions, rows = torch.rand(4, 3, 2) * 2 - 1, torch.tensor([2, 0, 2, 3, 1])
    goals = torch.rand(5, 1, 2) * 2 - 1
    with torch.no_grad():
        layouts, _ = net.layouts(positions)
        many, (each, _) = net.mixtures(layouts, goals, rows), net(positions[rows], goal=goals)
        other, _ = net(positions[rows], goal=goals.flip(0))
    for one, expected in zip(many, each, strict=True):
        torch.testing.assert_close(one, expected)
    assert not torch.allclose(many.log_weight, other.log_weight)
