"""Plays the common environments and prints a hash of all results: `python benchmarks/release/shots.py`.

It imports the installed `billiards_env`, not the package in the repository. It compiles the kernels that have no
machine code.
"""

from __future__ import annotations

import hashlib
import json

import numpy as np

from billiards_env import compiling


def main() -> None:
    """Prints a hash of the results in each environment."""
    made = [compiling.first_results(arguments) for arguments in compiling.ENVIRONMENTS]
    print(
        json.dumps(
            [
                hashlib.sha256(b"".join(np.asarray(value).tobytes() for value in values)).hexdigest()[:16]
                for values in made
            ]
        )
    )


if __name__ == "__main__":
    main()
