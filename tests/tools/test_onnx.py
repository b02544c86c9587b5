"""ONNX Runtime computes what PyTorch computes from a policy."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

from billiards_env.sb3 import load_policy
from billiards_env.sb3.onnx_file import OUTPUTS

pytest.importorskip("onnxscript")
onnxruntime = pytest.importorskip("onnxruntime")
pytestmark = [pytest.mark.tools, pytest.mark.filterwarnings("ignore")]

FACTOR = 8  # largest error of ONNX Runtime over that of PyTorch in single precision


@pytest.mark.parametrize("name", ["carom", "five_balls", "jump", "nine_ball", "position_strike"])
def test_a_file_has_the_outputs_of_its_policy(name, tmp_path):
    policy: Any
    arguments, policy = load_policy(f"studies/results/policies/{name}")
    policy.to_onnx(tmp_path / "policy.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "policy.onnx")
    observations, _ = gym.make_vec("billiards_env:Billiards-v0", num_envs=7, **arguments).reset(seed=3)
    found = dict(zip(OUTPUTS, session.run(None, {"observation": observations}), strict=True))
    single = outputs(policy, observations)
    exact = outputs(policy.double(), observations.astype(np.float64))
    for key in ("action", "value") if policy.net.legal else OUTPUTS:  # with legal balls the file has all components
        rounding = largest(single[key] - exact[key]) + np.finfo(np.float32).eps * largest(exact[key])
        assert largest(torch.from_numpy(found[key]) - exact[key]) <= FACTOR * rounding, key


def outputs(policy: Any, observations: Any) -> dict[str, torch.Tensor]:
    with torch.no_grad():
        mixture, values = policy.mixtures_and_values(torch.as_tensor(observations))
        return {"action": mixture.mode(), "value": values, **mixture._asdict()}


def largest(tensor: torch.Tensor) -> float:
    return tensor.abs().amax().item() if tensor.numel() else 0.0
