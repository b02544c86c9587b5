"""The learners by name: `learner` in a configuration. A learner is one file, with its entry."""

from agents import likelihood, ppo
from agents.learner import Learner
from billiards_env.support.checks import add_entry

LEARNERS: dict[str, Learner] = {"ppo": ppo.LEARNER, "likelihood": likelihood.LEARNER}
"""The learners by name."""


def register_learner(name: str, learner: Learner) -> None:
    """Adds a learner of another package to `LEARNERS`. The errors are those of `checks.add_entry`."""
    add_entry("learner", name, learner, LEARNERS, Learner, check=1, make=2)
