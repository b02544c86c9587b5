"""The policy of the page computes the mixture of PyTorch, in Node."""

import json
import shutil
import subprocess
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

from billiards_env.sb3 import load_policy
from docs.web import build

SCRIPT = """
const { shapes, numbers, layouts } = JSON.parse(require("fs").readFileSync(0, "utf8"));
const bytes = require("zlib").inflateSync(Buffer.from(numbers, "base64"));
const mixtureOf = policyOf(shapes, new Float32Array(new Uint8Array(bytes).buffer));
const draws = seed => () => (seed = seed * 16807 % 2147483647) / 2147483647;
console.log(JSON.stringify(layouts.map(([positions, inPlay]) => {
  const mixture = mixtureOf(positions, inPlay);
  return [mixture, proposals(mixture, 400, draws(7))];
})));
"""


def test_the_page_has_the_mixture_of_pytorch_and_its_proposals():
    if shutil.which("node") is None:
        pytest.skip("no node on the PATH")
    policy: Any
    arguments, policy = load_policy(f"studies/results/policies/{build.OPPONENT}")
    envs = gym.make_vec("billiards_env:Billiards-v0", num_envs=6, **arguments)
    observations, _ = envs.reset(seed=3)
    places = observations[:, :12].reshape(6, 6, 2)
    places[3:, [2, 4]] = 1.0  # potted
    with torch.no_grad():
        mixture, _ = policy.mixtures_and_values(torch.as_tensor(observations))
    layouts = [[row.tolist(), (abs(row) != 1).all(1).tolist()] for row in places]
    source = (build.HERE / "policy.js").read_text(encoding="utf-8").replace("export ", "")
    data = json.dumps({**build.opponent(), "layouts": layouts})
    result = subprocess.run(["node", "-e", source + SCRIPT], input=data, check=True, capture_output=True, text=True)
    for row, (components, actions) in enumerate(json.loads(result.stdout)):
        order = mixture.log_weight[row].argsort(descending=True, stable=True)[:40]
        expected = mixture.log_weight[row, order].exp(), *(part[row, order] for part in mixture[1:5])
        found = [[one[name] for name in ("weight", "dx", "dy", "speed", "across")] for one in components[:40]]
        np.testing.assert_allclose(found, np.stack(expected, 1), 1e-4, 1e-6)
        np.testing.assert_allclose(actions[0], mixture.mode()[row].clamp(-1, 1), atol=1e-6)
        assert len({tuple(action) for action in actions}) > 300
        assert np.abs(actions).max() <= 1.0
