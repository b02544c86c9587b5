"""The program `examples/ppo.py`."""

import json
import math
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

torch = pytest.importorskip("torch")

PATH = Path(__file__).resolve().parents[2] / "examples" / "ppo.py"
ppo = SimpleNamespace(**runpy.run_path(str(PATH)))


@pytest.fixture(autouse=True)
def settings_of_torch():
    """Restores the settings of PyTorch that the program changes."""
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)
    torch.set_flush_denormal(False)


SIZES = "--envs 1024 --minibatch 256 --epochs 2 --hidden 64 --episodes 500 --evaluate-every 32768"


def test_a_short_training_learns(tmp_path):
    weights = tmp_path / "policy.pt"
    policy, curve = ppo.train(ppo.arguments([*SIZES.split(), "--shots", "65536", "--policy", str(weights)]))
    assert [point["shots"] for point in curve] == [32768, 65536]
    assert curve[-1]["success"] > 0.15  # a random shot pots the ball once in a hundred times
    saved = torch.load(weights, weights_only=True)
    assert all(torch.equal(value, saved[name]) for name, value in policy.state_dict().items())


def test_a_short_training_learns_to_make_caroms():
    env = {"task": "carom", "layout": "random", "max_speed": 6.0}
    given = [*SIZES.split(), "--shots", "32768", "--aim", "layout", "--rate", "4e-3", "--env", json.dumps([env])]
    _, curve = ppo.train(ppo.arguments(given))
    assert curve[-1]["success"] > 0.08  # before the training it is about 0.03


def test_a_short_training_learns_to_pot_two_balls():
    given = [*SIZES.split(), "--shots", "65536", "--env", '[{"n_object_balls": 2, "max_shots": 4}]', "--rate", "4e-3"]
    _, curve = ppo.train(ppo.arguments(given))
    assert curve[-1]["success"] > 0.15


def test_the_order_of_the_object_balls_does_not_matter():
    torch.manual_seed(0)
    policy = ppo.Policy((1.27, 0.635), 3, (0.1, 0.3, 0.6), 16, 2, "layout")
    layout = torch.tensor([[0.2, -0.3, -0.4, 0.5, 0.7, -0.1]])
    with torch.no_grad():
        velocities = [policy(layout[:, order])[0].mode() for order in ([0, 1, 2, 3, 4, 5], [0, 1, 4, 5, 2, 3])]
    assert torch.allclose(*velocities)


def test_no_shot_aims_at_a_potted_ball():
    torch.manual_seed(0)
    policy = ppo.Policy((1.27, 0.635), 3, (0.1, 0.3, 0.6), 16, 3, "ball")
    mixture, _ = policy(torch.tensor([[0.2, -0.3, 0.0, -1.0, 0.7, -0.1, 1.0, 1.0]]))
    weights = mixture.log_weight.exp().reshape(3, -1).sum(1)
    assert weights.tolist() == pytest.approx([0.0, 1.0, 0.0])


def test_the_density_of_the_mixture_integrates_to_one():
    torch.manual_seed(0)
    policy = ppo.Policy((1.27, 0.635), 3, (0.1, 0.3, 0.6), 16, 1, "ball")
    policy.std = 0.1, 0.1
    with torch.no_grad():
        mixture, _ = policy(torch.tensor([[0.2, -0.3, -0.4, 0.5]]))
        edges = torch.linspace(-1.5, 1.5, 1201)
        grid = torch.cartesian_prod(edges, edges)
        logs = torch.cat([mixture.log_density(part) for part in grid.split(100_000)])
    # `log_density` leaves out the constants of the two standard deviations along and of pi.
    mass = logs.exp().sum() * (edges[1] - edges[0]) ** 2 / (2 * math.pi * mixture.along)
    assert mass == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(("balls", "aim"), [(1, "ball"), (2, "layout")])
def test_a_reflected_layout_has_the_reflected_shot(balls, aim):
    torch.manual_seed(0)
    policy = ppo.Policy((1.27, 0.635), 5, (0.1, 0.3, 0.6), 16, balls, aim)
    layout = torch.tensor([[0.2, -0.3, 0.4, 0.5, -0.6, 0.1]])[:, : 2 + 2 * balls]
    with torch.no_grad():
        velocity = policy(layout)[0].mode()
        for signs in ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)):
            reflected, _ = policy(layout * torch.tensor(signs).repeat(1 + balls))
            assert torch.allclose(reflected.mode(), velocity * torch.tensor(signs))
