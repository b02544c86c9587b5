"""Training with RLlib on one machine or on a Ray cluster: `python -m agents.rllib pot --runners 2`.

Modules:
    rollouts: Plays a policy in a vector of environments and records the steps as arrays.
    algorithm: The parts of RLlib: the policy as an RLModule, an EnvRunner of arrays, and PPO.

Only the second one and the command import Ray.
"""

from agents import require

require("rllib", ("ray",))
