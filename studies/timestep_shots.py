"""Shots of policies from different worlds, for the page of the study: `python -m studies.timestep_shots`.

On each layout one policy from each world of `studies.timestep` plays a shot. The shot runs in the policy's own world
and in the exact world. The page links each shot to the table in the browser, which plays it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks import run_command, table
from billiards_env.bench.evaluation import evaluation_seeds
from billiards_env.envs.actions import cue_strike
from examples import ppo
from studies import live_shot, load_arrays
from studies.timestep import (
    LAYOUT_SEED,
    OUTPUT,
    SEEDS,
    WORLDS,
    Run,
    actions_of,
    direct_pots,
    make_worlds,
    policy_folder,
    policy_of,
    successes,
)

SHOWN, DRAWN, COARSE = 6, 500, "1/60"
"""The number of layouts on the page, the number of layouts from which they are chosen, and the coarse world. The page
has the first layouts on which the exact policy pots the ball, and the coarse policy pots it directly in its own world
but misses in exact physics."""


def measure() -> dict[str, Any]:
    """Returns the layouts (positions, m) and the shot of each world: its velocity and whether it pots the ball.

    Raises:
        OSError: If the weights of the first seed are not there.
    """
    envs = make_worlds(DRAWN, WORLDS)
    observations, _ = envs["exact"].reset(seed=evaluation_seeds(LAYOUT_SEED + 1, DRAWN).tolist())
    positions, env = envs["exact"].positions, envs["exact"].single_env
    actions, potted = {}, {}
    for world, arguments in WORLDS.items():
        weights = load_arrays(policy_folder(OUTPUT) / f"{Run('main', world, SEEDS[0], [arguments]).name}.npz")
        actions[world] = actions_of(policy_of(weights, ppo.arguments([])), envs[world], observations)
        potted[world] = successes(actions[world], positions, {"own": envs[world], "exact": envs["exact"]})
    telling = potted["exact"]["exact"] & potted[COARSE]["own"] & ~potted[COARSE]["exact"]
    telling &= direct_pots(actions[COARSE], positions, env.scene, env.max_speed, WORLDS[COARSE])[0]
    return {
        "layouts": [
            {
                "positions": positions[i].tolist(),
                "shots": {
                    world: {
                        "velocity": cue_strike(actions[world][i], env.scene, env.max_speed).velocity.tolist(),
                        **{where: bool(potted[world][where][i]) for where in ("own", "exact")},
                    }
                    for world in WORLDS
                },
            }
            for i in np.flatnonzero(telling)[:SHOWN].tolist()
        ]
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    labels = {True: "potted", False: "missed"}

    def address(layout: dict[str, Any], world: str) -> str:
        steps = 960 if world == "exact" else round(1 / WORLDS[world]["dt"])
        return live_shot("pool", layout["positions"], layout["shots"][world]["velocity"], steps)

    def cell(layout: dict[str, Any], world: str) -> str:
        shot = layout["shots"][world]
        text = f"{labels[shot['own']]}, {labels[shot['exact']]}"
        return f'<a href="browser.md{address(layout, world)}" target="shot">{text}</a>'

    head = "layout", *(world if world == "exact" else f"{world} s" for world in WORLDS)
    rows = [[str(k), *(cell(layout, world) for world in WORLDS)] for k, layout in enumerate(result["layouts"], 1)]
    frame = address(result["layouts"][0], COARSE)
    return {
        "table": table(head, rows),
        "frame": f'<iframe name="shot" src="play.html{frame}" title="A shot of the table" class="live"></iframe>',
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.timestep_shots --help`."""
    run_command("studies.timestep_shots", "Choose shots of the policies for the page.", arguments, measure, blocks, {})


if __name__ == "__main__":
    main()
