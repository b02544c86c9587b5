"""The four failures of PIT, as small scenes with round numbers that can be computed by hand.

`python -m studies.failures` draws them.

They are the failures of section 4 of N. Warkari and M. Jamsandekar, "Evaluation of Collision Handling Techniques in 2D
collisions" (Georgia Institute of Technology), in the world of this paper: elastic disks without friction, here with a
radius of 3 cm on a table of 2 x 1 m. With a timestep of 1/25 s, PIT tests for overlap at 25 instants per second and
gets all four scenes wrong:

* missed_collision: the paths of two balls cross. The balls touch at 0.088 s and would separate at 0.112 s; PIT tests at
  0.08 s and 0.12 s. Each ball should leave in the other's direction. In PIT both go straight on.
* penetration: the balls touch with their line of centres along (4, 3). PIT tests 16.5 ms later. The first ball is then
  33 mm deeper and the line of centres lies along (5, 12). Both balls leave in directions that are 30.5 degrees wrong.
* multiple_collisions: near a cushion, ball 0 hits ball 1; ball 1 rebounds from the cushion and hits ball 0 again, all
  between two tests. PIT finds one of the two collisions. Ball 0 should come back; in PIT ball 1 comes back.
* wrong_bounce: the positions of penetration, with a ball of infinite mass. The first ball should bounce backwards. In
  PIT it continues forwards, 61.0 degrees wrong.

These numbers hold for fix="push_apart" and fix="none". With fix="move_back" or fix="time_of_impact", PIT computes the
true line of centres of two overlapping balls. Its directions are then wrong only in the first and the third scene.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

from benchmarks import parser_of, save
from billiards_env.commands import ending
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.table import Table
from billiards_env.support.files import check_path


@dataclasses.dataclass(frozen=True, slots=True)
class Failure:
    """A shot that PIT gets wrong; `mode="pic"` gives the correct result.

    Attributes:
        title: The name of the failure in the paper of Warkari and Jamsandekar.
        text: What goes wrong, in a sentence.
        scene: A scene with two balls; its `physics.max_time` ends the shot soon after the failure.
        positions: (2, 2) initial positions, m.
        velocities: (2, 2) initial velocities, m/s.
        dt: A timestep at which PIT fails, s.
    """

    title: str
    text: str
    scene: Scene
    positions: tuple[tuple[float, float], ...]
    velocities: tuple[tuple[float, float], ...]
    dt: float


def _scene(mass: float, max_time: float) -> Scene:
    """Returns the world of Warkari and Jamsandekar with two balls; the second has `mass` kg."""
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=max_time)
    return Scene(Balls((0.03, 0.03), (0.2, mass)), Table(2.0, 1.0), physics)


_DT = 1 / 25

FAILURES: dict[str, Failure] = {
    "missed_collision": Failure(
        title="Missed collision",
        text="The balls touch and would separate again between two tests, so both go straight on.",
        scene=_scene(mass=0.2, max_time=0.2),
        positions=((-0.4, 0.0), (0.0, -0.3)),
        velocities=((4.0, 0.0), (0.0, 3.0)),
        dt=_DT,
    ),
    "penetration": Failure(
        title="Penetrating balls",
        text="A test finds the balls deep in each other: the line of centres has turned, so both go the wrong way.",
        scene=_scene(mass=0.2, max_time=0.4),
        positions=((-0.4, 0.0), (0.015, 0.036)),
        velocities=((2.0, 0.0), (0.0, 0.0)),
        dt=_DT,
    ),
    "multiple_collisions": Failure(
        title="Multiple collisions",
        text="Ball 1 rebounds and hits ball 0 again between two tests: the timestep finds one collision of two.",
        scene=_scene(mass=0.2, max_time=0.4),
        positions=((0.45, 0.0), (0.96, 0.01)),
        velocities=((2.0, 0.0), (0.0, 0.0)),
        dt=_DT,
    ),
    "wrong_bounce": Failure(
        title="Wrong direction after bounce",
        text="The ball is deep in a fixed ball when a test finds it, so it goes on forwards and does not bounce back.",
        scene=_scene(mass=math.inf, max_time=0.4),
        positions=((-0.4, 0.0), (0.015, 0.036)),
        velocities=((2.0, 0.0), (0.0, 0.0)),
        dt=_DT,
    ),
}
"""The failures, by name."""


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.failures --help`."""
    output = (Path("failures.png"), "the picture, .png")
    args = parser_of("studies.failures", "Draw the four failures of a timestep.", output=output).parse_args(arguments)
    with ending():
        from studies.figures import failures

        save(failures(), check_path(args.output, ".png"))
        print(f"wrote {args.output}")


if __name__ == "__main__":
    main()
