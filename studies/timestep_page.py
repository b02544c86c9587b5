"""Writes the page with the shots of policies from different worlds: `python -m studies.timestep_page`.

On each of some layouts a policy of each world of `studies.timestep` plays one shot, which runs in its own world and in
the exact one. The page is a single HTML file; its slider chooses the timestep of the training.
"""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.commands import ending
from billiards_env.drawing import style
from billiards_env.engine import Engine
from billiards_env.envs.actions import cue_strike
from billiards_env.evaluation import evaluation_seeds
from billiards_env.files import check_path, write_whole
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate
from examples import ppo
from studies import load_weights, parser_of
from studies.timestep import (
    LAYOUT_SEED,
    SEEDS,
    WORLDS,
    Run,
    direct_pots,
    make_worlds,
    places,
    play,
    policy_of,
    shots_of,
)

PAGE = Path(__file__).resolve().parent.parent / "docs" / "timestep_policies.html"
SHOWN, DRAWN, COARSE = 6, 500, "1/60"
"""The number of layouts on the page, of those from which they are chosen, and the coarse world. The page has the first
layouts on which the exact policy pots the ball, and the coarse policy pots it directly in its own world but misses in
exact physics."""

_BETWEEN = 4  # points between two events


def make_page(policies: Path) -> str:
    """Returns the page.

    Args:
        policies: The folder of the weights of the main part of the study.

    Raises:
        OSError: If the weights of the first seed are not there.
    """
    envs = make_worlds(DRAWN, WORLDS)
    observations, _ = envs["exact"].reset(seed=evaluation_seeds(LAYOUT_SEED + 1, DRAWN).tolist())
    positions, env = envs["exact"].positions, envs["exact"].single_env
    actions, potted = {}, {}
    for world, arguments in WORLDS.items():
        weights = load_weights(policies / f"{Run('main', world, SEEDS[0], [arguments]).name}.npz")
        actions[world] = shots_of(policy_of(weights, ppo.arguments([])), envs[world], observations)
        potted[world] = play(actions[world], positions, {"own": envs[world], "exact": envs["exact"]})
    telling = potted["exact"]["exact"] & potted[COARSE]["own"] & ~potted[COARSE]["exact"]
    telling &= direct_pots(actions[COARSE], positions, env.scene, env.max_speed, WORLDS[COARSE])[0]
    layouts = [
        {
            world: [
                _shot(env.scene, positions[i], cue_strike(actions[world][i], env.scene, env.max_speed), engine)
                for engine in (WORLDS[world], {})
            ]
            for world in WORLDS
        }
        for i in np.flatnonzero(telling)[:SHOWN].tolist()
    ]
    radius = env.scene.balls.radius[0]
    data = {
        "radius": radius,
        "half": env.scene.half_extents,
        "shapes": [
            [colour, corners.round(3).ravel().tolist()] for corners, colour in style.draw_table(env.scene.table)
        ],
        "balls": [[look.fill, look.path] for look in style.looks(env.scene)],
        "layouts": layouts,
    }
    template = resources.files("studies").joinpath("timestep_page.html").read_text(encoding="utf-8")
    return template.replace("{{data}}", json.dumps(data, allow_nan=False, separators=(",", ":")))


def _shot(scene: Scene, positions: NDArray[np.float64], strike: Any, world: dict[str, Any]) -> dict[str, Any]:
    """Returns whether a shot pots the ball, and the paths of the balls, m: x, y, x, y, ..."""
    shot: Any = simulate(scene, positions, strike, engine=Engine(**world), record=True)
    times = np.unique([0.0, *shot.events["time"], shot.time])
    between = np.linspace(times[:-1], times[1:], _BETWEEN, endpoint=False).T.ravel()
    paths = shot.at(np.append(between, shot.time))
    success = bool(shot.potted[1] and not shot.potted[0])
    return {"potted": success, "paths": [paths[:, ball].round(3).ravel().tolist() for ball in range(2)]}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.timestep_page --help`."""
    page = (PAGE, "HTML file")
    parser = parser_of("timestep_page", "Write the page with the shots of the policies.", output=page)
    args = parser.parse_args(arguments)
    with ending("the same command continues"):
        write_whole(check_path(args.output, ".html"), make_page(places(None).policies).encode())
    print(f"in {args.output}")


if __name__ == "__main__":
    main()
