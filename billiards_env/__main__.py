"""Prints the version and the commands of the repository: `python -m billiards_env`."""

from __future__ import annotations

import argparse
import importlib.util

from billiards_env import __version__

COMMANDS = {
    "billiards_env.play": "play in a window, against people or programs",
    "agents.train": "train PPO with a configuration, for example configs/ppo/pot.yaml",
    "agents.evaluate": "measure a trained policy on new layouts, next to a random policy",
    "studies.players": "measure players that need no learning",
    "studies.recipes": "train all recipes with several seeds",
    "studies.timestep": "train one recipe with several timesteps and compare the policies",
    "benchmarks.speed": "measure shots per second",
    "benchmarks.vector": "measure steps per second of many environments",
    "benchmarks.growth": "measure run times from 2 to 10,000 balls",
    "benchmarks.accuracy": "measure errors and run times of both engines and of other simulators",
    "benchmarks.comparison": "compare run times and errors with pooltool and pymunk",
    "benchmarks.error_limit": "measure errors against 50 digits",
    "benchmarks.stress": "check every event of ten million random shots",
    "benchmarks.readme": "write the measured tables into the documentation",
}
"""Modules that run with `python -m`, and what they do."""


def available() -> dict[str, str]:
    """Returns the commands that can be imported; all but `billiards_env` need a clone of the repository."""
    found = {}
    for module, text in COMMANDS.items():
        package = module.partition(".")[0]
        if importlib.util.find_spec(package) and importlib.util.find_spec(module):
            found[module] = text
    return found


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m billiards_env --help`."""
    parser = argparse.ArgumentParser(prog="python -m billiards_env", description="Print an overview of the commands.")
    parser.add_argument("--version", action="version", version=f"billiards-env {__version__}")
    parser.parse_args(arguments)
    commands = available()
    print(f"billiards-env {__version__}: gym.make('Billiards-v0') makes the environment. Commands:\n")
    for module, text in commands.items():
        print(f"  python -m {module:24}{text}")
    print("\n'--help' after a command lists its options.")
    if len(commands) < len(COMMANDS):
        print("Training and benchmarks run from a clone of the repository.")
    else:
        print("'make' lists the commands that run several of these.")


if __name__ == "__main__":
    main()
