"""A package with a learner of its own: it draws the weights of the policy and keeps them."""

import torch

from agents.learner import Learner, Setting, Training, up_to
from agents.learners import register_learner
from agents.ppo import make_policy


class Draw(Training):
    """A training that takes one update."""

    def __init__(self, config, run_dir):
        self.policy, self._config = make_policy(config), config

    def restart(self):
        """Seeds the weights."""
        torch.manual_seed(self._config.seed)

    def update(self):
        """Draws the weights."""
        for weights in self.policy.parameters():
            torch.nn.init.normal_(weights, std=self._config.settings["spread"])
        self.shots = self._config.timesteps
        return 0.0


def check(config):
    """Refuses the policy "aim"."""
    if config.policy["head"] != "gaussian":
        raise ValueError(f"policy.head = {config.policy['head']!r}: expected 'gaussian' with learner = 'draw'")


register_learner("draw", Learner({"spread": Setting(up_to(10.0), 0.1)}, check, Draw))
