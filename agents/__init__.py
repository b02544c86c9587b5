"""Training and evaluation of agents on `Billiards-v0`.

`python -m agents.train ROW` trains a policy with a learner, such as PPO (Stable-Baselines3), and writes a run folder.
`python -m agents.evaluate RUN_DIR` compares the trained policy with random actions, or films it.
"""

import importlib.util
import sys
from collections.abc import Sequence

from billiards_env.support.checks import missing


def require(extra: str, packages: Sequence[str]) -> None:
    """Ends a command with one line if a package of an extra is missing.

    The modules import these packages at the top, so this check runs before them, when the package `agents` is imported.
    `sys.argv[0]` is "-m" while `python -m` imports the package of its command. Otherwise a missing package is an
    ordinary import error.
    """
    if sys.argv[0] == "-m":
        for package in packages:
            if importlib.util.find_spec(package) is None:
                sys.exit(f"error: {missing(package, extra)}")


require("train", ("yaml", "stable_baselines3", "tensorboard", "torch", "tqdm", "filelock"))
