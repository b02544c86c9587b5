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


def test_a_short_training_learns(tmp_path):
    log, weights = tmp_path / "log.jsonl", tmp_path / "policy.pt"
    sizes = "--shots 65536 --envs 1024 --minibatch 256 --epochs 2 --hidden 64 --episodes 500 --evaluate-every 32768"
    policy, _ = ppo.train(ppo.arguments([*sizes.split(), "--log", str(log), "--policy", str(weights)]))
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    assert [line["shots"] for line in lines] == [32768, 65536]
    assert lines[-1]["success"] > 0.15  # a random shot pots the ball once in a hundred times
    saved = torch.load(weights, weights_only=True)
    assert all(torch.equal(value, saved[name]) for name, value in policy.state_dict().items())


def test_the_density_of_the_mixture_integrates_to_one():
    torch.manual_seed(0)
    policy = ppo.Policy((1.27, 0.635), 3, (0.1, 0.3, 0.6), 16)
    policy.std = 0.1, 0.1
    with torch.no_grad():
        mixture, _ = policy(torch.tensor([[0.2, -0.3, -0.4, 0.5]]))
        edges = torch.linspace(-1.5, 1.5, 1201)
        grid = torch.cartesian_prod(edges, edges)
        logs = torch.cat([mixture.log_density(part) for part in grid.split(100_000)])
    # `log_density` leaves out the constants of the two standard deviations along and of pi.
    mass = logs.exp().sum() * (edges[1] - edges[0]) ** 2 / (2 * math.pi * mixture.along)
    assert mass == pytest.approx(1.0, abs=1e-3)


def test_a_reflected_layout_has_the_reflected_shot():
    torch.manual_seed(0)
    policy = ppo.Policy((1.27, 0.635), 5, (0.1, 0.3, 0.6), 16)
    layout = torch.tensor([[0.2, -0.3, 0.4, 0.5]])
    with torch.no_grad():
        velocity = policy(layout)[0].mode()
        for signs in ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)):
            reflected, _ = policy(layout * torch.tensor(signs).repeat(2))
            assert torch.allclose(reflected.mode(), velocity * torch.tensor(signs))
