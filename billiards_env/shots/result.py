"""The result of one shot."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.doors import load
from billiards_env.engine.compile import Engine
from billiards_env.engine.log import ShotLog, named_events
from billiards_env.engine.shot_input import ShotInput
from billiards_env.engine.shots import STATUS
from billiards_env.engine.trajectory import Trajectory
from billiards_env.scene import Scene
from billiards_env.support.checks import numbers, short

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from billiards_env.physics.scatter import Scatter
    from billiards_env.shots.records import ShotRecord

Floats = NDArray[np.float64]

_STATUS = np.array(STATUS, dtype=object)
_REASONS = "potted", "driven off the table", "not in play"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ShotResult:
    """The balls at the end of a shot, and what happened.

    Unless the shot was recorded, `events`, `trajectory`, `scene` and `log` are None and `engine` is "". The fields
    before them are those of `BatchResult`.

    Attributes:
        positions: (n, 2) float64, m, at the end. A potted ball is at the centre of its pocket.
        velocities: (n, 2) float64, m/s, at the end.
        spins: (n, 3) float64, rad/s, at the end; zero unless the motion is "sliding".
        potted: (n,) bool: in a pocket, driven off the table, or not in play from the start.
        time: Duration of the shot, s: until every ball rests, or `max_time`.
        n_events: Number of events.
        status: "rest", "max_time" or, if the engine ended the shot, "event_limit" or "step_limit" (see
            `engine.MAX_EVENTS` and `pit.MAX_STEPS`).
        first_hit: The ball that the cue ball touched first, -1 if none.
        cushions: (n,) int32: number of cushion contacts of each ball.
        cushions_before_hit: (n,) int32: number of cushion contacts that the cue ball had when it first touched the
            ball, -1 if it did not touch it.
        n_contact_rule: Number of times the contact-time rule acted (see `engine.contact_rule`), which ends sequences of
            impacts of balls that friction presses together. It is 0 in nearly all shots with a few balls, and positive
            in most breaks of 15 balls.
        pockets: (n,) int32: the pocket in which the shot potted the ball, -1 if it did not pot it.
        pot_order: (n,) int32: 0 for the ball that went out of play first, 1 for the second, and so on; -1 for a ball
            that stayed. A ball with an order but no pocket was driven off the table; it is on the nearest cushion.
        touched_first: (n,) bool: the balls that the cue ball touched at the instant of its first contact.
        first_hit_time: This instant, s; infinite if the cue ball touched no ball.
        cue: The ball that counts as the cue ball: 0, except in some shots of carom games.
        heights: (n, 2) float64: the height above the cloth, m, and the vertical velocity, m/s, at the end: zero unless
            the shot is cut. None in scenes without flight.
        measures: The numbers of the argument `measures` of `simulate`, by name, see `engine.measures`; None for none.
        events: Structured array with the fields time (s), kind ("ball_ball", "cushion", "pocket", "sliding_rolling",
            "rolling_rest", "spinning_rest", "rolling_slower" if the rolling resistance depends on the speed, and with
            flight "landing" or "off_table"), ball, other (the second ball, the cushion, the pocket, or -1), x and y
            (position of the ball, m), speed (at which ball and other approached, m/s) and rule (whether the
            contact-time rule acted). The cushions 0 to 3 of a rectangle are -x, +x, -y, +y. In an outline the straight
            cushions come first, then the tips.
        trajectory: The paths of the balls.
        scene: The scene.
        engine: The engine: "PIC", or "PIT" with its timestep and fix.
        log: The events and trajectories as plain arrays.
    """

    positions: Floats
    velocities: Floats
    spins: Floats
    potted: NDArray[np.bool_]
    time: float
    n_events: int
    status: str
    first_hit: int
    cushions: NDArray[np.int32]
    cushions_before_hit: NDArray[np.int32]
    n_contact_rule: int
    pockets: NDArray[np.int32]
    pot_order: NDArray[np.int32]
    touched_first: NDArray[np.bool_]
    first_hit_time: float
    cue: int
    heights: Floats | None = None
    measures: np.void | None = None
    events: NDArray[Any] | None = None
    trajectory: Trajectory | None = None
    scene: Scene | None = None
    engine: str = ""
    log: ShotLog | None = None
    _arguments: tuple[ShotInput, Engine, int] | None = None  # those of `run_shot`

    def __repr__(self) -> str:
        contacts, out = self.cushions, self.out_of_play
        out = {reason: balls for reason, balls in out.items() if balls or reason == "potted"}
        lines = [
            f"ShotResult: {len(self.potted)} balls, {self.status} after {self.time:.4g} s, {self.n_events} events",
            *(f"balls {reason}: {', '.join(map(str, balls)) or 'none'}" for reason, balls in out.items()),
            f"first hit: {'none' if self.first_hit < 0 else f'ball {self.first_hit}'}",
            f"cushion contacts: {contacts[0]} of the cue ball, {contacts[1:].sum()} of other balls",
        ]
        if self.trajectory is not None:
            lines.append(f"recorded ({self.engine}): events, at(t), plot(), to_html(path), to_gif(path), to_mp4(path)")
        return "\n  ".join(lines)

    @property
    def out_of_play(self) -> dict[str, list[int]]:
        """The balls of `potted` by reason: "potted", "driven off the table", and from the start "not in play"."""
        masks = self.pockets >= 0, (self.pockets < 0) & (self.pot_order >= 0), self.potted & (self.pot_order < 0)
        return dict(zip(_REASONS, (np.flatnonzero(mask).tolist() for mask in masks), strict=True))

    @property
    def pots(self) -> tuple[tuple[int, int], ...]:
        """The balls that the shot potted with their pockets, in order: ((ball, pocket), ...)."""
        balls = np.flatnonzero(self.pockets >= 0)
        order = balls[np.argsort(self.pot_order[balls])]
        return tuple(zip(order.tolist(), self.pockets[order].tolist(), strict=True))

    def at(self, t: ArrayLike) -> Floats:
        """Returns the positions of the balls at time t, from their trajectories.

        Args:
            t: Seconds since the start of the shot, a number or an array of any shape. After the end of the shot the
                balls stay where they are.

        Returns:
            (..., n, 2) float64, m, with the shape of t in front. A potted ball is at the centre of its pocket.

        Raises:
            ValueError: If the shot was not recorded, or a time is negative or not finite.
        """
        return self._of_balls(t, self._recorded("at")[1].path)

    def heights_at(self, t: ArrayLike) -> Floats:
        """Returns the heights of the balls above their height on the cloth at time t.

        Args:
            t: Seconds since the start of the shot, a number or an array of any shape.

        Returns:
            (..., n) float64, m, zero in scenes without flight.

        Raises:
            ValueError: As in `at`.
        """
        scene, paths, _ = self._recorded("heights_at")
        return self._of_balls(t, lambda ball, times: paths.heights(ball, times, scene.physics.g))

    def motion_at(self, t: ArrayLike) -> tuple[Floats, Floats]:
        """Returns the velocities and the spins of the balls at time t, after the events of this instant.

        Args:
            t: Seconds since the start of the shot, a number or an array of any shape.

        Returns:
            The velocities, (..., n, 2) float64, m/s; in scenes with flight (..., n, 3), with the vertical velocity. The
            spins, (..., n, 3) float64, rad/s; zero unless the motion is "sliding". They do not change after the end.

        Raises:
            ValueError: As in `at`.
        """
        scene, paths, _ = self._recorded("motion_at")
        velocities = self._of_balls(t, paths.velocities)
        radius, decay = scene.balls.radius, scene.physics.spin_decay
        spins = self._of_balls(t, lambda ball, times: paths.spins(ball, times, radius[ball], decay))
        spins *= scene.physics.motion == "sliding"
        ended = np.asarray(t) >= self.time
        velocities[ended], spins[ended] = self.velocities, self.spins
        if self.heights is not None:
            rises = self._of_balls(t, lambda ball, times: paths.rises(ball, times, scene.physics.g))
            rises[ended] = self.heights[:, 1]
            velocities = np.concatenate((velocities, rises[..., None]), -1)
        return velocities, spins

    def _of_balls(self, t: ArrayLike, value: Callable[[int, Floats], Floats]) -> Floats:
        """Returns the values (m, ...) of each ball at some times, with the shape of `t` in front."""
        times = numbers("t", t)
        if not (np.isfinite(times) & (times >= 0)).all():
            raise ValueError(f"t = {short(t)}: expected a finite number of seconds >= 0")
        until = np.minimum(times, self.time).ravel()
        values = np.stack([value(ball, until) for ball in range(len(self.potted))], axis=1)
        return values.reshape(*times.shape, *values.shape[1:])

    @property
    def scatter(self) -> Scatter | None:
        """The scatter of the cushions; None for no scatter, and unless the shot was recorded."""
        return None if self._arguments is None else self._arguments[0].scatter

    def plot(self, ax: Axes | None = None, compare: ShotResult | None = None) -> Axes:
        """Draws the shot to scale with matplotlib (extra `plot`): paths, contacts, and balls at the start and the end.

        Args:
            ax: Axes to draw on; None for a new figure.
            compare: Another run of the shot, such as one by "pit". Its paths are dashed and its balls are rings.

        Returns:
            The axes, in metres. `shot.plot().figure.savefig(path)` writes a file.

        Raises:
            TypeError: If `ax` is not an Axes, or `compare` is not a shot.
            ValueError: If a shot was not recorded, or `compare` has other balls or another table.
            ModuleNotFoundError: If matplotlib is not installed.
        """
        return load("shot.plot")(self, ax, compare)

    def to_gif(
        self, path: str | os.PathLike[str], *, fps: float = 25, width: int = 640, compare: ShotResult | None = None
    ) -> None:
        """Writes the shot as an animated GIF (extras `render` and `plot`). An error leaves no partial file.

        Args:
            path: The file. Its name must end in ".gif" and its folder must exist.
            fps: Frames per second. The duration of a frame is rounded to hundredths of a second, and is at least
                0.02 s.
            width: Pixels.
            compare: Another run of the shot, drawn as rings.

        Raises:
            ValueError: If a shot was not recorded, an argument is invalid, or `compare` has other balls or
                another table.
            OSError: If the file cannot be written.
            ModuleNotFoundError: If pygame is not installed.
        """
        load("shot.to_gif")(self, path, ".gif", fps, width, compare)

    def to_mp4(
        self, path: str | os.PathLike[str], *, fps: float = 60, width: int = 960, compare: ShotResult | None = None
    ) -> None:
        """Writes the shot as an MP4 film (extra `render`). An error leaves no partial file.

        Args:
            path: The file. Its name must end in ".mp4" and its folder must exist.
            fps: Frames per second.
            width: Pixels.
            compare: Another run of the shot, drawn as rings.

        Raises:
            ValueError: If a shot was not recorded, an argument is invalid, or `compare` has other balls or
                another table.
            OSError: If the file cannot be written.
            ModuleNotFoundError: If pygame or imageio-ffmpeg is not installed.
        """
        load("shot.to_mp4")(self, path, ".mp4", fps, width, compare)

    def to_html(self, path: str | os.PathLike[str], *, title: str | None = None) -> None:
        """Writes a self-contained page that plays the shot in any browser. An error leaves no partial file.

        Args:
            path: The file. Its name must end in ".html" and its folder must exist.
            title: The page's heading; None for the engine, the number of contacts and the duration.

        Raises:
            ValueError: If the shot was not recorded.
            OSError: If the file cannot be written.
        """
        load("shot.to_html")(self, path, title)

    def _repr_html_(self) -> str | None:
        """Returns the page of `to_html` for a notebook, or None if the shot was not recorded or is very long."""
        return None if self.trajectory is None else load("shot._repr_html_")(self)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the input and the result of the shot as JSON, for `shots.records.load` and `billiards replay`.

        Args:
            path: The file, which is written completely or not at all.

        Raises:
            ValueError: If the shot was not recorded.
            OSError: If the file cannot be written.
        """
        from billiards_env.shots import records

        records.save(path, self.to_record())

    def to_record(self) -> ShotRecord:
        """Returns the input and the result of the shot as plain data, see `shots.records`.

        Raises:
            ValueError: If the shot was not recorded, or has scatter.
        """
        from billiards_env.shots.records import ShotRecord, end_of, tuples

        if self.scene is None or self._arguments is None:
            raise ValueError(f"shot = {short(self)}: expected a recorded shot, from simulate(..., record=True)")
        start, engine, max_events = self._arguments
        positions, velocities = start.in_space()
        check_no_scatter(start.scatter, "shot.to_record")
        turns = start.spins.any() or np.signbit(start.spins).any()
        return ShotRecord(
            scene=self.scene,
            positions=tuples(positions),
            velocities=tuples(velocities),
            spins=tuples(start.spins) if turns else None,
            in_play=tuple(start.in_play.tolist()),
            engine=engine,
            max_time=None if start.limit in (self.scene.physics.max_time, math.inf) else start.limit,
            max_events=int(max_events),
            end=end_of(self),
        )

    def _recorded(self, method: str) -> tuple[Scene, Trajectory, NDArray[Any]]:
        if self.trajectory is None or self.events is None or self.scene is None:
            raise ValueError(f"shot.{method}: the shot was not recorded, expected simulate(..., record=True)")
        return self.scene, self.trajectory, self.events


def check_no_scatter(scatter: Scatter | None, what: str) -> None:
    """Raises a ValueError if shots have scatter; `what` is the method for the message."""
    if scatter is not None:
        raise ValueError(f"scatter = {scatter.deviations.tolist()} with {what}: expected None, a shot without scatter")


def outcome_of(shots: dict[str, Any]) -> dict[str, Any]:
    """Returns the fields of `Shots`, or of one of its rows, in the form that `ShotResult` and `BatchResult` share."""
    shots["potted"], shots["status"] = ~shots.pop("in_play"), _STATUS[shots["status"]]
    return shots


def read_log(log: ShotLog, scene: Scene, arguments: tuple[ShotInput, Engine, int]) -> dict[str, Any]:
    """Returns the fields of a `ShotResult` that only a recorded shot has; `arguments` are those of `run_shot`."""
    log = ShotLog(*(rows.copy() for rows in log))
    return {
        "events": named_events(log.events),
        "trajectory": Trajectory.of(log.segments),
        "scene": scene,
        "engine": str(arguments[1]),
        "log": log,
        "_arguments": arguments,
    }
