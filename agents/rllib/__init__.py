"""Training with RLlib on one machine or on a Ray cluster: `python -m agents.rllib configs/rllib/pot.yaml`.

Modules:
    settings: The settings of a training, read from YAML.
    rollouts: Plays a policy in a vector of environments and records the steps as arrays.
    algorithm: The parts of RLlib: the policy as an RLModule, an EnvRunner of arrays, and PPO.
    train: The training, with progress, checkpoints and a run folder as in `agents.train`.

Only the last two import Ray.
"""

from agents import require

require("rllib", ("ray",))
