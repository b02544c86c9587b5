"""Balls pressed together, compared with constrained motion: `python -m benchmarks.pressed`.

A ball is pressed against a cushion by its spin, or two balls against each other. The reference, `reference.pressed`,
integrates the motion with a closed contact. It does not depend on the restitution, because the contact stays closed.
The deviation is the largest distance between the positions of a ball in the engine and in the reference, at rest, or
shortly before a ball reaches another cushion.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import RESULTS, machine, machine_line, print_blocks, table
from billiards_env.files import write_json
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.simulation import simulate
from reference.pressed import PressedShot, press_cushion, press_pair

BEFORE_IMPACT = 0.01
"""s. The positions are compared this long before the next impact."""

E_CUSHION = (0.0, 0.3, 0.5, 0.85, 1.0)
E_BALL = (0.0, 0.5, 0.95, 1.0)


@dataclasses.dataclass(frozen=True)
class Case:
    """An initial state in which balls are pressed together.

    Attributes:
        name: Name in the tables.
        scene: One ball at a cushion, or two balls.
        positions: (n, 2) m.
        velocities: (n, 2) m/s.
        spins: (n, 3) rad/s.
    """

    name: str
    scene: Scene
    positions: tuple[tuple[float, float], ...]
    velocities: tuple[tuple[float, float], ...]
    spins: tuple[tuple[float, float, float], ...]

    def with_restitution(self, e: float) -> Scene:
        """Returns the scene with the restitution `e` of the pressed contact."""
        name = "e_cushion" if self.scene.n_balls == 1 else "e_ball"
        return dataclasses.replace(self.scene, physics=dataclasses.replace(self.scene.physics, **{name: e}))

    def reference(self) -> PressedShot:
        """Returns the reference shot, up to rest or to `BEFORE_IMPACT`."""
        run = press_cushion if self.scene.n_balls == 1 else press_pair
        shot = run(self.scene, self.positions, self.velocities, self.spins)
        if shot.status != "impact":
            return shot
        return run(self.scene, self.positions, self.velocities, self.spins, max_time=shot.time - BEFORE_IMPACT)


def at_cushion(
    spin: tuple[float, float, float], cushion: str = "han2005", side: str = "+y", speed: float = 0.0
) -> Case:
    """Returns a ball at the centre of a cushion of the pool table without pockets.

    Args:
        spin: rad/s, for the cushion +y; the initial state is rotated to the other cushions.
        cushion: The law of the cushion.
        side: "+y", "-x", "-y" or "+x".
        speed: Velocity along x for the cushion +y, m/s; rotated in the same way.

    Returns:
        The case.
    """
    scene = Scene(Balls.uniform(1), physics=Physics(cushion=cushion))
    radius, across = scene.balls.radius[0], scene.table.width if side[1] == "y" else scene.table.length
    # The rotation maps y to the normal n of the cushion, and x to (n_y, -n_x).
    sign = 1.0 if side[0] == "+" else -1.0
    nx, ny = (sign, 0.0) if side[1] == "x" else (0.0, sign)
    distance = across / 2 - radius
    wx, wy, wz = spin
    moving = f", {speed:g} m/s" if speed else ""
    return Case(
        f"{spin}{moving}, {side}, {cushion}",
        scene,
        ((distance * nx, distance * ny),),
        ((speed * ny, -speed * nx),),
        ((wx * ny + wy * nx, wy * ny - wx * nx, wz),),
    )


def frozen_pair(
    name: str,
    spin: tuple[float, float, float],
    angle: float = 0.0,
    masses: tuple[float, float] = (0.17, 0.17),
    object_spin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    speed: float = 0.0,
) -> Case:
    """Returns two touching balls on the pool table without pockets; the cue ball pushes the object ball.

    Args:
        name: Name in the tables.
        spin: Spin of the cue ball, rad/s.
        angle: Angle of the line from the cue ball to the object ball, rad. The spins are not rotated.
        masses: kg.
        object_spin: Spin of the object ball, rad/s.
        speed: Speed of both balls along x, m/s.

    Returns:
        The case.
    """
    radius = Balls.uniform(1).radius[0]
    scene = Scene(Balls((radius, radius), masses))
    cue = (-1.0, -0.4 * math.sin(angle))
    other = (cue[0] + 2 * radius * math.cos(angle), cue[1] + 2 * radius * math.sin(angle))
    return Case(name, scene, (cue, other), ((speed, 0.0), (speed, 0.0)), (spin, object_spin))


CUSHION_CASES = (
    *(
        at_cushion(spin, cushion)
        for spin in (
            (-100.0, 0.0, 30.0),
            (-100.0, 0.0, -80.0),
            (-150.0, 0.0, 100.0),
            (-150.0, 0.0, -150.0),
            (-60.0, 30.0, 60.0),
            (-10.0, 0.0, 10.0),
        )
        for cushion in ("han2005", "restitution")
    ),
    *(at_cushion((-100.0, 0.0, -80.0), "han2005", side) for side in ("-y", "+x", "-x")),
    at_cushion((100.0, 0.0, 50.0)),
    at_cushion((-100.0, 0.0, 30.0), speed=0.3),
)

PAIR_CASES = (
    frozen_pair("top spin 150", (0.0, 150.0, 0.0)),
    frozen_pair("top spin 100, side spin", (0.0, 100.0, 50.0)),
    frozen_pair("top spin 20", (0.0, 20.0, 0.0)),
    frozen_pair("5 degrees off the line", (-5.0, 60.0, 0.0)),
    frozen_pair("27 degrees off the line", (60.0, 120.0, 0.0)),
    frozen_pair("63 degrees off the line", (60.0, 30.0, 0.0)),
    frozen_pair("line at 45 degrees", (-60.0, 60.0, 30.0), angle=math.pi / 4),
    frozen_pair("against each other", (0.0, 100.0, 0.0), object_spin=(0.0, -60.0, 0.0)),
    frozen_pair("against each other, askew", (0.0, 120.0, 0.0), object_spin=(40.0, -100.0, 0.0)),
    frozen_pair("object ball twice as heavy", (0.0, 120.0, 0.0), masses=(0.17, 0.34)),
    frozen_pair("object ball half as heavy", (0.0, 100.0, 0.0), masses=(0.17, 0.085)),
    frozen_pair("object ball fixed", (20.0, 60.0, 0.0), masses=(0.17, math.inf)),
    frozen_pair("both move", (0.0, 120.0, 0.0), object_spin=(0.0, 10.0, 0.0), speed=0.3),
)


def deviation(case: Case, e: float, reference: PressedShot) -> float:
    """Returns the largest distance of a ball in the engine from the reference, m; `e` is the restitution."""
    until = None if reference.status == "rest" else reference.time
    shot = simulate(case.with_restitution(e), case.positions, case.velocities, spins=case.spins, max_time=until)
    return float(np.hypot(*(shot.positions - reference.positions).T).max())


def compare(cases: Sequence[Case], restitutions: Sequence[float]) -> list[dict[str, Any]]:
    """Returns the deviations of some cases.

    Args:
        cases: The cases.
        restitutions: Each case is run with each of these restitutions.

    Returns:
        One dict per case: name, end (n, 2) of the reference in m, time and separation_time in s, status, and deviations
        in m, one per restitution.
    """
    rows = []
    for case in cases:
        reference = case.reference()
        rows.append(
            {
                "name": case.name,
                "end": reference.positions.tolist(),
                "time": reference.time,
                "separation_time": reference.separation_time,
                "status": reference.status,
                "deviations": [deviation(case, e, reference) for e in restitutions],
            }
        )
    return rows


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""

    def of(kind: str, first: str) -> str:
        found = result[kind]
        head = (first, "pressed for", "end", *(f"e = {e:g}" for e in found["restitutions"]))
        rows = [
            (
                row["name"],
                f"{row['separation_time']:.3f} s",
                " ".join(f"({x + 0.0:.3f}, {y + 0.0:.3f})" for x, y in np.round(row["end"], 3)),
                *(f"{1e3 * d:.3f}" for d in row["deviations"]),
            )
            for row in found["cases"]
        ]
        return table(head, rows)

    return {
        "machine": machine_line(result["machine"]),
        "cushions": of("cushions", "spin (rad/s), cushion"),
        "pairs": of("pairs", "pair"),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.pressed --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.pressed", description="Compare the engine with constrained motion of pressed balls."
    )
    parser.add_argument("--output", type=Path, default=RESULTS / "pressed.json", help="JSON file")
    args = parser.parse_args(arguments)
    result = {
        "machine": machine(),
        "cushions": {"restitutions": E_CUSHION, "cases": compare(CUSHION_CASES, E_CUSHION)},
        "pairs": {"restitutions": E_BALL, "cases": compare(PAIR_CASES, E_BALL)},
    }
    write_json(args.output, result)
    print_blocks(blocks(result))
    print(f"\nDeviations in mm, ends (x, y) in m. Written to {args.output}.")


if __name__ == "__main__":
    main()
