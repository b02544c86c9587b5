"""Compares the shots of policies that were trained with and without execution noise: `python -m studies.choices`.

It plays the policies `pot` and `pot_noise` of `studies/results/policies` on the same layouts, which did not occur in
their training, and writes `studies/results/choices.json`.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agents.config import Noise
from agents.evaluate import deterministic, play_together
from agents.intervals import wilson_interval
from agents.ppo import evaluation_seeds, load_policy, make_vector
from benchmarks import table
from billiards_env.files import write_json
from billiards_env.players import pots
from studies import RESULTS

POLICIES = RESULTS / "policies"
OUTPUT = RESULTS / "choices.json"
NAMES = {"pot": "without noise", "pot_noise": "with noise"}
SEED, LAYOUTS = 20, 2000


def measure(policies: Path, layouts: int, seed: int) -> dict[str, Any]:
    """Plays both policies on the same layouts, with and without noise.

    Args:
        policies: The folder of the policies.
        layouts: The number of layouts.
        seed: The seed of the layouts.

    Returns:
        * `layouts` and `seed`.
        * `another_pot`: the share of the layouts on which the policies choose different pots.
        * `easier`: the share of these layouts on which the policy trained with noise chooses the pot with the larger
          tolerance.
        * `policies`: for each policy, its success without and with noise, the medians of its shots and the share of
          banks.

        Shares have a 95 % interval.

    Raises:
        OSError: If a file cannot be read.
        ValueError: If a policy does not fit its configuration.
    """
    seeds = evaluation_seeds(seed, layouts).tolist()
    found: dict[str, Any] = {"layouts": layouts, "seed": seed, "policies": {}}
    chosen, tolerances = [], []
    for name in NAMES:
        config, policy = load_policy(policies / name)
        exact = dataclasses.replace(config, noise=None)
        success = [
            play_together(make_vector(played, layouts), deterministic(policy), seeds)
            for played in (exact, dataclasses.replace(config, noise=Noise()))
        ]
        envs: Any = make_vector(exact, layouts)
        observations, _ = envs.reset(seed=seeds)
        game = envs.unwrapped
        velocities = game.single_env.max_speed * deterministic(policy)(observations)
        rows, which = _nearest_pots(game, velocities)
        chosen.append(which)
        tolerances.append(rows[:, pots.TOLERANCE])
        rows = rows[rows[:, pots.TOLERANCE] > 0]  # without the layouts that have no pot
        found["policies"][name] = {
            "success": success[0]["success_rate"],
            "success_with_noise": success[1]["success_rate"],
            "intervals": [one["confidence_interval_95"] for one in success],
            "speed": float(np.median(np.hypot(*velocities.T))),
            "tolerance": float(np.degrees(np.median(rows[:, pots.TOLERANCE]))),
            "cut": float(np.degrees(np.median(np.arccos(rows[:, pots.CUT_COS].clip(-1, 1))))),
            "run": float(np.median(rows[:, pots.RUN])),
            "banks": float((rows[:, pots.WALL] >= 0).mean()),
        }
    different = chosen[0] != chosen[1]
    easier = (tolerances[1] > tolerances[0])[different]
    for key, hits in (("another_pot", different), ("easier", easier)):
        interval = wilson_interval(int(hits.sum()), len(hits))
        found[key] = {"share": float(hits.mean()), "interval": list(interval)}
    return found


def _nearest_pots(game: Any, velocities: Any) -> tuple[Any, Any]:
    """Returns the pots with the directions nearest to those of the shots: their rows (m, WIDTH) and numbers (m,)."""
    env = game.single_env
    found = pots.find_pots(env.scene, env.targets, game.positions, game.potted, env.max_speed, banks=True)
    directions = found.shots[:, :, :, pots.DX : pots.DY + 1]
    along = (directions * (velocities / np.hypot(*velocities.T)[:, None])[:, None, None]).sum(-1).max(-1)
    along[np.arange(along.shape[1]) >= found.count[:, None]] = -2.0
    best = along.argmax(1)
    return found.rows[np.arange(len(best)), best], best


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    head = (
        "trained",
        "success without noise",
        "success with noise",
        "median speed, m/s",
        "median tolerance, degrees",
        "median cut angle, degrees",
        "median distance to the pocket, m",
        "banks",
    )
    rows = []
    for name, label in NAMES.items():
        p = result["policies"][name]
        cells = (
            "{:.1%} ({:.1f} to {:.1f})".format(rate, *(100 * end for end in interval))
            for rate, interval in zip((p["success"], p["success_with_noise"]), p["intervals"], strict=True)
        )
        medians = (f"{p[key]:.2f}" for key in ("speed", "tolerance", "cut", "run"))
        rows.append((label, *cells, *medians, f"{p['banks']:.1%}"))
    another, easier = (
        "{:.0%} ({:.0f} to {:.0f})".format(r["share"], *(100 * end for end in r["interval"]))
        for r in (result["another_pot"], result["easier"])
    )
    return {
        "table": table(head, rows),
        "summary": f"On {another} of {result['layouts']:,} layouts the policy that was trained with noise chooses "
        f"another pot. On {easier} of these layouts its pot has the larger tolerance.",
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.choices --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.choices", description="Compare policies that were trained with and without noise."
    )
    parser.add_argument("--policies", type=Path, default=POLICIES, help="folder of the policies (default: %(default)s)")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file (default: %(default)s)")
    args = parser.parse_args(arguments)
    try:
        result = measure(args.policies, LAYOUTS, SEED)
        write_json(args.output, result)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    print("\n\n".join(blocks(result).values()))
    print(f"\nwritten to {args.output}")


if __name__ == "__main__":
    main()
