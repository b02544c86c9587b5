"""The program `examples/ppo.py`."""

import json
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

torch = pytest.importorskip("torch")

PATH = Path(__file__).resolve().parents[2] / "examples" / "ppo.py"
ppo = SimpleNamespace(**runpy.run_path(str(PATH)))


SIZES = {"envs": 1024, "minibatch": 256, "epochs": 2, "hidden": 64, "episodes": 500, "evaluate-every": 32768}


def train(**options):
    """Returns the policy and the curve of a short training."""
    return ppo.train(ppo.arguments([f"--{name}={value}" for name, value in {**SIZES, **options}.items()]))


def test_a_short_training_learns(tmp_path):
    weights = tmp_path / "policy.pt"
    policy, curve = train(shots=65536, policy=weights)
    assert [point["shots"] for point in curve] == [32768, 65536]
    assert curve[-1]["success"] > 0.15  # a random shot pots the ball once in a hundred times
    saved = torch.load(weights, weights_only=True)
    assert all(torch.equal(value, saved[name]) for name, value in policy.state_dict().items())


def test_a_short_training_learns_to_make_caroms():
    env = {"task": "carom", "layout": "random", "max_speed": 6.0}
    _, curve = train(shots=32768, aim="layout", rate=4e-3, env=json.dumps(env))
    assert curve[-1]["success"] > 0.08  # before the training it is about 0.03


def test_a_short_training_learns_to_pot_two_balls():
    _, curve = train(shots=65536, rate=4e-3, env='{"n_object_balls": 2, "max_shots": 4}')
    assert curve[-1]["success"] > 0.15
