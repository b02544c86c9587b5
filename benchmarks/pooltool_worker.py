"""Runs shots with pooltool; `benchmarks.comparison` starts this file in the environment in which pooltool is installed.

The first line of the output is the version of pooltool. Each line of the input is a shot as JSON, and the answer is a
line with the run time, s, and the positions of the balls, (n, 2) m. Only `pooltool.simulate` is timed.
"""

from __future__ import annotations

import json
import sys
from time import perf_counter
from typing import Any

import attrs  # pyright: ignore[reportMissingImports]
import numpy as np
import pooltool as pt  # pyright: ignore[reportMissingImports]
from pooltool.evolution.continuous import interpolate_ball_states  # pyright: ignore[reportMissingImports]
from pooltool.objects import BilliardTableSpecs, PocketTableSpecs  # pyright: ignore[reportMissingImports]
from pooltool.physics.engine import PhysicsEngine  # pyright: ignore[reportMissingImports]
from pooltool.physics.resolve.ball_ball.frictionless_elastic import (  # pyright: ignore[reportMissingImports]
    FrictionlessElastic,
)
from pooltool.physics.resolve.ball_cushion.han_2005 import Han2005Linear  # pyright: ignore[reportMissingImports]
from pooltool.physics.resolve.resolver import default_resolver  # pyright: ignore[reportMissingImports]

SMOOTH = PhysicsEngine(
    attrs.evolve(default_resolver(), ball_ball=FrictionlessElastic(), ball_linear_cushion=Han2005Linear())
)
"""Balls without friction between them, and the cushions of Han (2005)."""

REAL = PhysicsEngine()
"""pooltool's own laws: friction between balls, and compliant cushions."""


def run(shot: dict[str, Any]) -> dict[str, Any]:
    """Runs a shot.

    Args:
        shot: `jaws`, whether the table is pooltool's own with jaws and pockets, with the laws `REAL`, or one without
            pockets, with the laws `SMOOTH`; `table`, the arguments of `PocketTableSpecs` or `BilliardTableSpecs`;
            `ball`, the arguments of `BallParams`; `positions`, (n, 2) m; `velocity` of the cue ball, (2,) m/s; `time`
            of the returned positions, s, or None for the end; `gap`, the distance to which pooltool moves balls at a
            contact, m; and `max_events`, after which the shot stops. The frame is pooltool's: the origin is a
            corner, and y is along the length.

    Returns:
        `seconds`, the run time; `finished`, whether all balls are at rest; and `positions`, or None if the shot stopped
        before `time`.
    """
    params = pt.BallParams(**shot["ball"])
    balls = {}
    for i, (x, y) in enumerate(shot["positions"]):
        ball = pt.Ball(str(i), params=params)
        ball.state.rvw = np.array([[x, y, params.R], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        balls[ball.id] = ball
    balls["0"].state.rvw[1, :2] = shot["velocity"]
    balls["0"].state.s = pt.constants.sliding
    specs, engine = (PocketTableSpecs, REAL) if shot["jaws"] else (BilliardTableSpecs, SMOOTH)
    table = pt.Table.from_table_specs(specs(**shot["table"]))
    system = pt.System(cue=pt.Cue(cue_ball_id="0"), table=table, balls=balls)
    pt.constants.MIN_DIST = shot["gap"]
    begin = perf_counter()
    pt.simulate(system, engine=engine, inplace=True, max_events=shot["max_events"])
    seconds = perf_counter() - begin
    finished, time = len(system.events) <= shot["max_events"], shot["time"]
    if not finished and (time is None or time > system.t):
        return {"seconds": seconds, "finished": False, "positions": None}
    time = system.t if time is None else min(time, system.t)
    states = [interpolate_ball_states(ball, [time])[0] for ball in balls.values()]
    return {"seconds": seconds, "finished": finished, "positions": [state.rvw[0, :2].tolist() for state in states]}


def main() -> None:
    """Answers the shots of the input."""
    replies, sys.stdout = sys.stdout, sys.stderr  # so that pooltool's messages are not replies
    print(json.dumps(pt.__version__), file=replies, flush=True)
    for line in sys.stdin:
        print(json.dumps(run(json.loads(line))), file=replies, flush=True)


if __name__ == "__main__":
    main()
