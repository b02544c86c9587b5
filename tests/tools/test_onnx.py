"""ONNX Runtime computes what PyTorch computes from a policy."""

from typing import Any

import gymnasium as gym
import pytest
import torch

from billiards_env.sb3 import load_policy
from billiards_env.sb3.onnx_file import OUTPUTS

pytest.importorskip("onnxscript")
onnxruntime = pytest.importorskip("onnxruntime")
pytestmark = [pytest.mark.tools, pytest.mark.filterwarnings("ignore")]


@pytest.mark.parametrize("name", ["carom", "five_balls", "nine_ball", "position_strike"])
def test_a_file_has_the_outputs_of_its_policy(name, tmp_path):
    policy: Any
    arguments, policy = load_policy(f"studies/results/policies/{name}")
    policy.to_onnx(tmp_path / "policy.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "policy.onnx")
    observations, _ = gym.make_vec("billiards_env:Billiards-v0", num_envs=7, **arguments).reset(seed=3)
    found = dict(zip(OUTPUTS, session.run(None, {"observation": observations}), strict=True))
    with torch.no_grad():
        mixture, values = policy.mixtures_and_values(torch.as_tensor(observations))
    expected = {"action": mixture.mode(), "value": values, **mixture._asdict()}
    if policy.net.legal:  # the file has the components of all balls
        expected = {key: expected[key] for key in ("action", "value")}
    found = {key: torch.from_numpy(found[key]) for key in expected}
    expected = {key: value.expand(found[key].shape) for key, value in expected.items()}
    torch.testing.assert_close(found, expected)
