"""Mixtures of Gaussians over actions."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.distributions import MultivariateNormal

from billiards_env.sb3.mixture import NEVER, Components, MixtureDistribution

FIELDS = 6


def random_components(m: int, k: int, others: int, std: float = 0.15) -> Components:
    """Returns m mixtures of k components, whose standard deviations are between `std` / 2 and `std`."""
    rng = torch.Generator().manual_seed(0)

    def draw(*shape: int) -> Tensor:
        return torch.rand(shape, generator=rng)

    angle = 2 * math.pi * draw(m, k)
    return Components(
        logit=3 * draw(m, k),
        dx=angle.cos(),
        dy=angle.sin(),
        speed=0.2 + 0.6 * draw(m, k),
        log_along=(std * (0.5 + 0.5 * draw(m, k))).log(),
        log_across=(std * (0.5 + 0.5 * draw(m, k))).log(),
        others=2 * draw(m, others, k) - 1,
        log_others=(std * (0.5 + 0.5 * draw(m, others, k))).log(),
    )


def distribution(components: Components) -> MixtureDistribution:
    return MixtureDistribution(components.others.shape[1]).proba_distribution(components.flat())


def gaussian(components: Components, row: int, k: int) -> tuple[Tensor, Tensor]:
    """Returns the mean (2 + e,) and the covariance (2 + e, 2 + e) of a component."""
    c = Components(*(part[row, ..., k] for part in components))
    axes = torch.eye(2 + len(c.others))
    axes[:2, :2] = torch.tensor([[c.dx, -c.dy], [c.dy, c.dx]])
    std = torch.cat((torch.stack((c.log_along, c.log_across)), c.log_others)).exp()
    mean = torch.cat((torch.stack((c.speed * c.dx, c.speed * c.dy)), c.others))
    return mean, axes @ torch.diag(std**2) @ axes.T


@pytest.mark.parametrize(("k", "others", "std", "step"), [(4, 0, 0.15, 0.01), (2, 1, 0.3, 0.08)])
def test_the_density_integrates_to_one(k, others, std, step):
    grid = torch.cartesian_prod(*[torch.arange(-2.4, 2.4, step)] * (2 + others))
    flat = random_components(1, k, others, std).flat().expand(len(grid), -1)
    density = MixtureDistribution(others).proba_distribution(flat).log_prob(grid).double().exp()
    assert float(density.sum()) * step ** (2 + others) == pytest.approx(1.0, abs=1e-3 if others else 1e-4)


@pytest.mark.parametrize("others", [0, 3])
def test_the_density_is_the_weighted_sum_of_gaussians(others):
    components = random_components(3, 4, others)
    actions = torch.rand((3, 2 + others), generator=torch.Generator().manual_seed(1)) - 0.5
    expected = []
    for row, action in enumerate(actions):
        weights = components.logit[row].exp() / components.logit[row].exp().sum()
        gaussians = (MultivariateNormal(*gaussian(components, row, k)) for k in range(4))
        expected.append(sum(w * g.log_prob(action).exp() for w, g in zip(weights, gaussians, strict=True)))
    found = distribution(components).log_prob(actions).exp()
    torch.testing.assert_close(found, torch.stack(expected), rtol=1e-3, atol=1e-12)


@pytest.mark.parametrize("others", [0, 3])
def test_samples_have_the_mean_and_the_covariance_of_the_mixture(others):
    torch.manual_seed(0)
    components, count = random_components(1, 3, others), 200_000
    samples = MixtureDistribution(others).proba_distribution(components.flat().expand(count, -1)).sample()
    weights = components.logit[0].softmax(0)
    means, covariances = map(torch.stack, zip(*(gaussian(components, 0, k) for k in range(3)), strict=True))
    mean = weights @ means
    apart = means - mean
    covariance = torch.einsum("k,kij->ij", weights, covariances + apart[:, :, None] * apart[:, None])
    assert samples.shape == (count, 2 + others)
    np.testing.assert_allclose(samples.mean(0), mean, atol=0.01)
    np.testing.assert_allclose(torch.cov(samples.T), covariance, atol=0.01)


@pytest.mark.parametrize("others", [0, 3])
def test_the_mode_is_the_mean_of_the_heaviest_component(others):
    components = random_components(20, 4, others)
    heaviest = components.logit.argmax(1)
    assert len(heaviest.unique()) > 1
    expected = torch.stack([gaussian(components, row, int(k))[0] for row, k in enumerate(heaviest)])
    mixture = distribution(components)
    torch.testing.assert_close(mixture.mode(), expected)
    assert torch.equal(mixture.get_actions(deterministic=True), mixture.mode())
    assert torch.equal(mixture.actions_from_params(components.flat(), deterministic=True), mixture.mode())


def test_a_component_that_does_not_exist_is_never_drawn():
    torch.manual_seed(0)
    one = random_components(1, 2, 0)._replace(
        logit=torch.tensor([[0.0, NEVER]]), dx=torch.tensor([[1.0, -1.0]]), dy=torch.zeros(1, 2)
    )
    one = one._replace(speed=torch.full((1, 2), 0.8), log_along=torch.full((1, 2), math.log(0.01)))
    mixture = MixtureDistribution().proba_distribution(one.flat().expand(100_000, -1))
    assert float(mixture.sample()[:, 0].min()) > 0
    assert float(mixture.entropy().max()) < 1e-9


def test_the_entropy_is_that_of_the_choice():
    components = random_components(1, 4, 0)._replace(logit=torch.zeros(1, 4))
    assert float(distribution(components).entropy()) == pytest.approx(math.log(4))


@pytest.mark.parametrize("others", [0, 1, 3])
def test_from_flat_is_the_inverse_of_flat(others):
    components = random_components(5, 4, others)
    flat = components.flat()
    assert flat.shape == (5, (FIELDS + 2 * others) * 4)
    again = Components.from_flat(flat, others)
    assert all(torch.equal(one, other) for one, other in zip(components, again, strict=True))
    assert torch.equal(again.flat(), flat)


def test_the_density_has_a_gradient_with_respect_to_every_field():
    flat = random_components(3, 4, 2).flat().requires_grad_()
    mixture = MixtureDistribution(2).proba_distribution(flat)
    mixture.log_prob(mixture.sample().detach()).sum().backward()
    assert flat.grad is not None
    assert all(bool((part != 0).any()) for part in Components.from_flat(flat.grad, 2))
