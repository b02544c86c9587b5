"""Shots of policies from different worlds, for the page of the study: `python -m studies.timestep_shots`.

On each layout one policy from each world of `studies.timestep` plays a shot. The shot runs in the policy's own world
and in the exact world. The page links each shot to the table in the browser, which plays it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks import run_command, table
from billiards_env.engine import Engine
from billiards_env.sb3 import load_policy
from billiards_env.scene import Scene
from studies import live_shot
from studies.timestep import LAYOUT_SEED, OUTPUT, WORLDS, direct_pots, play_layouts, policy_folder
from studies.timestep_report import EXACT, name_of

SHOWN, DRAWN, COARSE = 6, 500, "1/60"
"""The number of layouts on the page, the number of layouts from which they are chosen, and the coarse world. The page
has the first layouts on which the exact policy pots the ball, and the coarse policy pots it directly in its own world
but misses in exact physics."""


def measure() -> dict[str, Any]:
    """Returns the layouts (positions, m) and the shot of each world: its velocity and whether it pots the ball.

    Raises:
        OSError: If the policies of the first seed are not there.
    """
    played = {
        world: play_layouts(load_policy(policy_folder(OUTPUT, world))[1], world, DRAWN, LAYOUT_SEED + 1)
        for world in WORLDS
    }
    coarse = played[COARSE]
    telling = played[EXACT].exact & coarse.own & ~coarse.exact
    telling &= direct_pots(coarse.velocities, coarse.positions, Scene.named("pool", 1), Engine(**WORLDS[COARSE]))[0]
    return {
        "layouts": [
            {
                "positions": coarse.positions[i].tolist(),
                "shots": {
                    world: {
                        "velocity": shots.velocities[i].tolist(),
                        "own": bool(shots.own[i]),
                        "exact": bool(shots.exact[i]),
                    }
                    for world, shots in played.items()
                },
            }
            for i in np.flatnonzero(telling)[:SHOWN].tolist()
        ]
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    labels = {True: "potted", False: "missed"}

    def address(layout: dict[str, Any], world: str) -> str:
        steps = 960 if world == EXACT else round(1 / WORLDS[world]["dt"])
        return live_shot("pool", layout["positions"], layout["shots"][world]["velocity"], steps)

    def cell(layout: dict[str, Any], world: str) -> str:
        shot = layout["shots"][world]
        text = f"{labels[shot['own']]}, {labels[shot['exact']]}"
        return f'<a href="browser.md{address(layout, world)}" target="shot">{text}</a>'

    head = "layout", *map(name_of, WORLDS)
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
