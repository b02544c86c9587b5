"""The four failures of PIT, each as a small scene with round numbers to look at and to compute by hand.

They are those of section 4 of "Evaluation of Collision Handling Techniques in 2D collisions", in its world: elastic
disks without friction, here of 3 cm radius on a table of 2 x 1 m. At 25 frames a second, with tests for overlap at the
frames only, PIT gets every one of them wrong:

* missed_collision: two balls cross each other's path. They touch at 0.088 s and would be apart again at 0.112 s; there
  are frames at 0.08 s and 0.12 s. They should turn, each into the other's direction, and go straight on instead.
* penetration: the balls touch with their line of centres along (4, 3). The next frame is 16.5 ms later, the first ball
  33 mm deeper, and the line of centres along (5, 12): both balls leave 30.5 degrees wrong.
* multiple_collisions: near a cushion, ball 0 hits ball 1, which comes back off the cushion and hits ball 0 again, all
  between two frames. PIT knows of one hit. Ball 0 should come back; ball 1 does instead.
* wrong_bounce: penetration once more, with a ball of infinite mass. The first ball should bounce off it backwards, and
  goes on forwards, 61.0 degrees wrong.

The figures are those of fix="push_apart" and fix="none". With fix="move_back" PIT finds the true line of centres of two
balls that it finds in each other, which leaves it wrong about the first and the third scene only.
"""

from __future__ import annotations

import dataclasses
import math

from billiards_env.checks import choose
from billiards_env.scene import Balls, Physics, Scene, Table


@dataclasses.dataclass(frozen=True, slots=True)
class Failure:
    """A shot that PIT gets wrong; `mode="pic"` shows how it should be.

    Attributes:
        title: What the paper calls it.
        scene: Two balls; its `physics.max_time` ends the shot soon after what it shows.
        positions: (2, 2) at the start, m.
        velocities: (2, 2) at the start, m/s.
        dt: A timestep at which PIT fails, s.
        right_below: With timesteps shorter than this, s, PIT has the hits that PIC has, in the same order, and the
            balls end in directions that differ by less than a degree, whatever its `fix` and wherever between two steps
            the balls touch.
    """

    title: str
    scene: Scene
    positions: tuple[tuple[float, float], ...]
    velocities: tuple[tuple[float, float], ...]
    dt: float
    right_below: float


def _scene(mass: float, max_time: float) -> Scene:
    """The paper's world for two balls, the second one of `mass` kg."""
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=max_time)
    return Scene(Balls((0.03, 0.03), (0.2, mass)), Table(2.0, 1.0), physics)


_FRAME = 1 / 25

FAILURES: dict[str, Failure] = {
    "missed_collision": Failure(
        title="Missed collision",
        scene=_scene(mass=0.2, max_time=0.2),
        positions=((-0.4, 0.0), (0.0, -0.3)),
        velocities=((4.0, 0.0), (0.0, 3.0)),
        dt=_FRAME,
        right_below=0.012,
    ),
    "penetration": Failure(
        title="Penetrating balls",
        scene=_scene(mass=0.2, max_time=0.4),
        positions=((-0.4, 0.0), (0.015, 0.036)),
        velocities=((2.0, 0.0), (0.0, 0.0)),
        dt=_FRAME,
        right_below=0.0008,
    ),
    "multiple_collisions": Failure(
        title="Multiple collisions",
        scene=_scene(mass=0.2, max_time=0.4),
        positions=((0.45, 0.0), (0.96, 0.01)),
        velocities=((2.0, 0.0), (0.0, 0.0)),
        dt=_FRAME,
        right_below=0.0003,
    ),
    "wrong_bounce": Failure(
        title="Wrong direction after bounce",
        scene=_scene(mass=math.inf, max_time=0.4),
        positions=((-0.4, 0.0), (0.015, 0.036)),
        velocities=((2.0, 0.0), (0.0, 0.0)),
        dt=_FRAME,
        right_below=0.0004,
    ),
}


def named(name: str) -> Failure:
    """A failure by its name.

    Args:
        name: "missed_collision", "penetration", "multiple_collisions" or "wrong_bounce".

    Returns:
        The failure.

    Raises:
        ValueError: If the name is unknown.

    Example:
        >>> from billiards_env import simulate
        >>> case = named("missed_collision")
        >>> simulate(case.scene, case.positions, case.velocities).first_hit
        1
        >>> simulate(case.scene, case.positions, case.velocities, mode="pit", dt=case.dt).first_hit
        -1
    """
    choose("failure", name, tuple(FAILURES))
    return FAILURES[name]
