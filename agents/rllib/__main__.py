"""The command `python -m agents.rllib`; see `agents.rllib`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from agents.cluster import connect
from agents.config import changed, read
from agents.rllib.settings import Settings, load_recipe
from agents.train import open_run, print_result


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.rllib --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m agents.rllib", description="Train PPO on Billiards-v0 with RLlib, on one machine or a cluster."
    )
    parser.add_argument("settings", type=Path, help="YAML file of settings, e.g. configs/rllib/pot.yaml")
    parser.add_argument("--address", help='address of a Ray cluster, e.g. "auto" (default: this machine only)')
    parser.add_argument("--run-dir", type=Path, help="folder of the run (default: runs/rllib/NAME OF THE SETTINGS)")
    for name, text in (
        ("runners", "number of processes that play (default: that of the settings)"),
        ("learners", "number of processes that compute the updates (default: that of the settings)"),
        ("seed", "default: that of the recipe"),
        ("timesteps", "default: that of the recipe"),
    ):
        parser.add_argument(f"--{name}", help=text)
    parser.add_argument("--fresh", action="store_true", help="delete the run in the folder and start again")
    args = parser.parse_args(arguments)
    run_dir = args.run_dir or Path("runs") / "rllib" / args.settings.stem
    given = {k: text for k in ("runners", "learners", "seed", "timesteps") if (text := getattr(args, k)) is not None}
    try:
        settings = read(Settings, args.settings)
        config = load_recipe(settings, args.settings)
        settings = changed(settings, {k: v for k, v in given.items() if k in ("runners", "learners")})
        config = changed(config, {k: v for k, v in given.items() if k in ("seed", "timesteps")})
        settings.check(config)
        connect(args.address, cpus=1 + settings.runners + settings.learners)
        from agents.rllib.train import train  # imports Ray

        open_run(config, run_dir, args.fresh)
        train(config, settings, run_dir)
    except (ImportError, OSError, RuntimeError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        print("\ninterrupted; the same command resumes from the newest checkpoint", file=sys.stderr)
        sys.exit(130)
    print_result(run_dir, config)


if __name__ == "__main__":
    main()
