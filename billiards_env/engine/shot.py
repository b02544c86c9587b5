"""One shot: `simulate` runs it, `ShotResult` is what it gives back."""

from __future__ import annotations

import dataclasses
import functools
import html
import os
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import RANGES, Range, choose, fits, real, short, whole
from billiards_env.engine import crowd, pic, pit
from billiards_env.engine.admit import plainly_right
from billiards_env.engine.contact_rule import set_rule
from billiards_env.engine.log import (
    CUSHIONS,
    CUSHIONS_BEFORE_HIT,
    ENDED,
    FIRST_HIT,
    KINDS,
    N_CONTACT_RULE,
    N_COUNTS,
    N_EVENTS,
    STATUS,
    SceneArrays,
    Shots,
    empty_log,
)
from billiards_env.engine.sensitivity import Sensitivity, sensitivity_along
from billiards_env.engine.threads import spread
from billiards_env.physics import state as layout
from billiards_env.scene import CUSHIONS as CUSHION_MODELS
from billiards_env.scene import MOTIONS, Scene, check_positions

if TYPE_CHECKING:
    from billiards_env.drawing.plot import Axes
    from billiards_env.drawing.recording import Recording

Floats = NDArray[np.float64]

# The engines; each module has run_shots with the same signature.
ENGINES = {"pic": pic.run_shots, "pit": pit.run_shots}

CROWD = 160
"""From this number of balls on PIC runs in `engine.crowd`, which gives the same bits.

It is the number from which that is faster in a thin gas. In a dense one it is from about 110 balls on, in a rack, which
fills a few cells of the grid, not up to 400.
"""

MAX_EVENTS = 10_000_000
"""A shot is given up, loudly, after so many events.

Breaks take hundreds, at most thousands; a heap of balls that absurd spins press into a corner for minutes, millions.
"""

LONGEST_SHOWN = 20_000
"""Notebooks show a shot by itself if its trajectories have at most so many pieces, some megabytes."""

EVENT_DTYPE = np.dtype(
    [
        ("time", "f8"),
        ("kind", f"U{max(map(len, KINDS))}"),
        ("ball", "i4"),
        ("other", "i4"),
        ("x", "f8"),
        ("y", "f8"),
        ("speed", "f8"),
        ("rule", "?"),
    ]
)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ShotResult:
    """What one shot gives back.

    Attributes:
        positions: (n, 2) float64, m, at the end; a potted ball's is the centre of its pocket.
        velocities: (n, 2) float64, m/s, at the end.
        spins: (n, 3) float64, rad/s, at the end; zero where the motion is not "sliding".
        potted: (n,) bool: in a pocket, or not in play from the start.
        time: Duration of the shot, s: until every ball rests, or `max_time`.
        n_events: Number of events.
        status: "rest", "max_time", or, if the engine gave up the shot, "event_limit" or "step_limit" (see `MAX_EVENTS`
            and `pit.MAX_STEPS`).
        first_hit: The ball that the cue ball touched first, -1 if none.
        cushions: (n,) int32: each ball's number of cushion contacts.
        cushions_before_hit: (n,) int32: cushion contacts the cue ball had made when it first touched the ball, -1 if
            it never did.
        n_contact_rule: How often the contact-time rule acted (see `engine.contact_rule`): where friction presses balls
            against each other or a cushion, and impacts would follow each other without end. 0 in nearly all shots at
            a few balls; it acts in every other break.
        events: Structured array, or None if the shot was not recorded. Fields: time (s), kind ("ball_ball", "cushion",
            "pocket", "sliding_rolling", "rolling_rest" or "spinning_rest"), ball, other (the second ball, the cushion 0 to 3 for -x, +x, -y,
            +y, the pocket, or -1), x and y (m, the ball's place), speed (m/s, at which ball and other approached) and
            rule (whether the contact-time rule acted).
        segments: (k, SEGMENT_WIDTH) float64, the pieces of the trajectories in the order in which they begin (see
            `engine.log`), or None.
        scene: The scene, or None if the shot was not recorded.
        engine: How a recorded shot was run, in words: "PIC", or "PIT" with its timestep and fix.
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
    events: NDArray[Any] | None = None
    segments: Floats | None = None
    scene: Scene | None = None
    engine: str = ""
    _arrays: SceneArrays | None = None
    _log: Floats | None = None

    def at(self, t: float) -> Floats:
        """Where the balls are at time t, from the exact trajectories.

        Args:
            t: Seconds since the shot began; later than its end gives the end.

        Returns:
            (n, 2) float64, m; a potted ball is at its pocket's centre.

        Raises:
            ValueError: If the shot was not recorded, or t is negative or not finite.
        """
        if self.segments is None:
            raise ValueError("shot.at: the shot was not recorded, expected simulate(..., record=True)")
        if not 0 <= t < np.inf:
            raise ValueError(f"t = {t!r}: expected a finite number of seconds >= 0")
        t = min(float(t), self.time)
        places = np.empty_like(self.positions)
        ball, phase, rows = self.segments[:, 0], self.segments[:, 1], self.segments[:, 2:]
        for i in range(len(places)):
            mine = np.flatnonzero((ball == i) & (rows[:, layout.T0] <= t))[-1]
            row = rows[mine]
            dt = (t - row[layout.T0]) - row[layout.T0_LO]
            moves = layout.ROLLING <= phase[mine] < layout.POTTED
            dt = min(max(dt, 0.0), row[layout.LASTS]) if moves else 0.0
            start, velocity = row[[layout.X, layout.Y]], row[[layout.VX, layout.VY]]
            places[i] = start + dt * (velocity + 0.5 * dt * row[[layout.AX, layout.AY]])
        return places

    def sensitivity(self, t: float | None = None) -> Sensitivity:
        """How the positions at time t depend on the shot's beginning.

        Args:
            t: Seconds since the shot began; None for its end.

        Returns:
            The derivative and the condition number, see `Sensitivity`.

        Raises:
            ValueError: If the shot was not recorded or not run by "pic", or t is negative or not finite.
        """
        return next(self.sensitivities([self.time if t is None else t]))

    def sensitivities(self, times: ArrayLike) -> Iterator[Sensitivity]:
        """The `sensitivity` at each of some times, in one pass.

        Args:
            times: Ascending, s; later than the shot's end counts as its end.

        Returns:
            An iterator of one sensitivity a time.

        Raises:
            ValueError: If the shot was not recorded or not run by "pic", or a time is negative, not finite or earlier
                than the last.
        """
        if self.segments is None or self._log is None or self._arrays is None:
            raise ValueError("shot.sensitivity: expected a shot of simulate(..., mode='pic', record=True)")
        array = np.asarray(times, dtype=np.float64)
        if not (np.isfinite(array).all() and (array >= 0).all() and (np.diff(array) >= 0).all()):
            raise ValueError(f"times = {times!r}: expected finite numbers of seconds >= 0 in ascending order")
        return sensitivity_along(self.segments, self._log, self._arrays, np.minimum(array, self.time))

    def plot(self, ax: Axes | None = None, compare: ShotResult | None = None) -> Axes:
        """Draws the shot to scale with matplotlib (extra `plot`): paths, contacts, where the balls begin and end.

        Args:
            ax: Where to draw; None for a new figure.
            compare: Another run of the shot, such as one of "pit"; its paths are dashed, its balls rings.

        Returns:
            The axes, in metres.

        Raises:
            ValueError: If a shot was not recorded, or `compare` is of other balls or another table.
            ModuleNotFoundError: If matplotlib is not installed.
        """
        from billiards_env.drawing.plot import draw_shot

        return draw_shot(self.recording("plot"), ax, _recording(compare, "plot"))

    def to_gif(
        self, path: str | os.PathLike[str], *, fps: float = 25, width: int = 640, compare: ShotResult | None = None
    ) -> None:
        """Writes the shot as an animated GIF (extras `render` and `plot`), whole or not at all.

        Args:
            path: The file, which ends in ".gif"; its folder exists.
            fps: Frames a second, rounded to whole hundredths of a second a frame, 50 at most.
            width: Pixels.
            compare: Another run of the shot, drawn as rings.

        Raises:
            ValueError: If a shot was not recorded, an argument is impossible, or `compare` is of other balls or
                another table.
            OSError: If the file cannot be written.
            ModuleNotFoundError: If pygame is not installed.
        """
        recording, other = self.recording("to_gif"), _recording(compare, "to_gif")
        from billiards_env.drawing.film import write_gif

        write_gif(path, recording, fps, width, other)

    def to_mp4(
        self, path: str | os.PathLike[str], *, fps: float = 60, width: int = 960, compare: ShotResult | None = None
    ) -> None:
        """Writes the shot as an MP4 film (extra `render`), whole or not at all.

        Args:
            path: The file, which ends in ".mp4"; its folder exists.
            fps: Frames a second.
            width: Pixels.
            compare: Another run of the shot, drawn as rings.

        Raises:
            ValueError: If a shot was not recorded, an argument is impossible, or `compare` is of other balls or
                another table.
            OSError: If the file cannot be written.
            ModuleNotFoundError: If pygame or imageio-ffmpeg is not installed.
        """
        recording, other = self.recording("to_mp4"), _recording(compare, "to_mp4")
        from billiards_env.drawing.film import write_mp4

        write_mp4(path, recording, fps, width, other)

    def to_html(
        self, path: str | os.PathLike[str], *, title: str | None = None, compare: ShotResult | None = None
    ) -> None:
        """Writes a page that plays the shot in any browser, whole or not at all; it needs no other file.

        Args:
            path: The file, which ends in ".html"; its folder exists.
            title: The page's heading; None for what the shot was.
            compare: Another run of the shot, drawn as rings.

        Raises:
            ValueError: If a shot was not recorded, or `compare` is of other balls or another table.
            OSError: If the file cannot be written.
        """
        recording, other = self.recording("to_html"), _recording(compare, "to_html")
        from billiards_env.drawing.page import write_page

        write_page(path, recording, other, title)

    def _repr_html_(self) -> str | None:
        """The page of `to_html` in a frame, for notebooks; nothing for a shot that is not recorded or is very long."""
        if self.segments is None or len(self.segments) > LONGEST_SHOWN:
            return None
        from billiards_env.drawing.page import make_page

        page = html.escape(make_page(self.recording("_repr_html_")), quote=True)
        style = "width: 100%; height: 680px; border: 0"
        return f'<iframe title="A shot" srcdoc="{page}" sandbox="allow-scripts" style="{style}"></iframe>'

    def recording(self, method: str = "recording") -> Recording:
        """The shot as the arrays that `billiards_env.drawing` takes.

        Args:
            method: What to call the caller in an error.

        Returns:
            The recording.

        Raises:
            ValueError: If the shot was not recorded.
        """
        if self.segments is None or self.events is None or self.scene is None:
            raise ValueError(f"shot.{method}: the shot was not recorded, expected simulate(..., record=True)")
        from billiards_env.drawing.recording import Recording

        phase, rows = self.segments[:, 1], self.segments[:, 2:]
        moves = (phase >= layout.ROLLING) & (phase < layout.POTTED)
        ball = self.segments[:, 0].astype(np.intp)
        gone = np.full(len(self.positions), np.inf)
        for k in np.flatnonzero(phase == layout.POTTED):
            gone[ball[k]] = rows[k, layout.T0]
        return Recording(
            scene=self.scene,
            time=self.time,
            label=self.engine,
            ball=ball,
            start=rows[:, layout.T0].copy(),
            lasts=np.where(moves, np.minimum(rows[:, layout.LASTS], self.time), 0.0),
            position=rows[:, [layout.X, layout.Y]],
            velocity=np.where(moves[:, None], rows[:, [layout.VX, layout.VY]], 0.0),
            acceleration=np.where(moves[:, None], rows[:, [layout.AX, layout.AY]], 0.0),
            gone=gone,
            events=self.events,
        )


def _recording(shot: ShotResult | None, method: str) -> Recording | None:
    return None if shot is None else shot.recording(method)


def _engine_label(mode: str, dt: float | None, fix: str | None) -> str:
    if dt is None:
        return mode.upper()
    return f"{mode.upper()}, dt = {1000 * dt:.4g} ms" + (f", {fix}" if fix else "")


def scene_arrays(scene: Scene, dt: float | None = None, fix: str | None = None) -> SceneArrays:
    """The scene, and the settings of PIT, as the kernels take them."""
    global _latest
    for_scene, for_dt, for_fix, arrays = _latest
    if for_scene is scene and for_dt == dt and for_fix == fix:
        return arrays  # a scene's hash takes a microsecond
    arrays = _scene_arrays(scene, dt, fix)
    _latest = scene, dt, fix, arrays
    return arrays


_latest: tuple[Any, Any, Any, Any] = None, None, None, None  # the arguments and the result of the last call


@functools.lru_cache(maxsize=256)
def _scene_arrays(scene: Scene, dt: float | None, fix: str | None) -> SceneArrays:
    p = scene.physics
    params = np.zeros(layout.N_PARAMS)
    params[layout.MOTION] = MOTIONS.index(p.motion)
    params[layout.CUSHION] = CUSHION_MODELS.index(p.cushion)
    params[layout.SLIDE], params[layout.ROLL] = p.mu_slide * p.g, p.mu_roll * p.g
    params[layout.SPIN_DECAY] = p.spin_decay
    params[layout.E_BALL], params[layout.E_CUSHION], params[layout.MU_CUSHION] = p.e_ball, p.e_cushion, p.mu_cushion
    params[layout.HALF_LENGTH], params[layout.HALF_WIDTH] = scene.table.length / 2, scene.table.width / 2
    params[layout.CUSHION_HEIGHT] = scene.table.cushion_height
    set_rule(params, scene.balls.mass)
    params[layout.DT] = 0.0 if dt is None else dt
    params[layout.FIX] = layout.FIXES.index(layout.FIXES[0] if fix is None else fix)
    pockets = np.array([(q.x, q.y, q.radius) for q in scene.table.pockets]).reshape(-1, 3)
    return SceneArrays(params, np.array(scene.balls.radius), 1.0 / np.array(scene.balls.mass), pockets)


def engine_of(mode: str, n_balls: int) -> Callable[..., None]:
    """The `run_shots` of a mode, for so many balls."""
    return crowd.run_shots if mode == "pic" and n_balls >= CROWD else ENGINES[mode]


def check_mode(mode: str, dt: float | None, fix: str | None) -> None:
    """Raises a ValueError unless `mode` is an engine and `dt` and `fix` suit it."""
    choose("mode", mode, tuple(ENGINES))
    if mode == "pic":
        if dt is not None:
            raise ValueError(f"dt = {dt!r} with mode='pic': expected None, PIC has no timestep")
        if fix is not None:
            raise ValueError(f"fix = {fix!r} with mode='pic': expected None, PIC has no overlaps to fix")
        return
    if not fits(dt, "dt"):
        least, most, unit, _ = RANGES["dt"]
        raise ValueError(
            f"dt = {short(dt)} with mode='pit': expected the timestep, a number from {least:g} to {most:g} {unit}, "
            "such as 1/60"
        )
    if fix is not None:
        choose("fix", fix, layout.FIXES)


def _refuse_bad_motion(scene: Scene, name: str, array: Floats, within: Range) -> None:
    """Raises a ValueError if a velocity or spin is out of range, or a ball of infinite mass is to move."""
    most = within.most
    bad = np.argwhere(~(np.abs(array) <= most).all(axis=-1))
    if len(bad):
        at = tuple(bad[0])
        shot = f"shot {at[0]}, " if len(at) == 2 else ""
        raise ValueError(
            f"{name}: {shot}ball {at[-1]} has {array[at].tolist()}: expected numbers from -{most:g} to {most:g} "
            f"{within.unit}"
        )
    for i in np.flatnonzero(np.isinf(scene.balls.mass)):
        if array[..., i, :].any():
            raise ValueError(f"{name}: ball {i} has an infinite mass: expected it to be at rest")


def _fill(array: Floats, name: str, values: ArrayLike | None) -> None:
    """Fills an array with all balls' values, the cue ball's or none, and zeros; they may be wrong."""
    if values is None:
        array[...] = 0.0
        return
    given, full = np.asarray(values, dtype=np.float64), array.shape
    cue_ball_alone = (*full[:-2], full[-1])
    if given.shape == full:
        array[...] = given
    elif given.shape == cue_ball_alone:
        array[..., 0, :] = given
        array[..., 1:, :] = 0.0
    else:
        raise ValueError(
            f"{name} has shape {given.shape}: expected {full} for all balls or {cue_ball_alone} for the cue ball"
        )


class ShotInput(NamedTuple):
    """Fresh arrays that an engine may write to, of one shot or, with a leading axis, of many.

    Attributes:
        positions: (n, 2) float64, m.
        velocities: (n, 2) float64, m/s.
        spins: (n, 3) float64, rad/s.
        in_play: (n,) bool.
        limit: The time at which a shot is ended, s.
    """

    positions: Floats
    velocities: Floats
    spins: Floats
    in_play: NDArray[np.bool_]
    limit: float


def check_shot(
    scene: Scene,
    positions: ArrayLike,
    velocities: ArrayLike,
    spins: ArrayLike | None,
    in_play: ArrayLike | None,
    max_time: float | None,
    into: Shots | None = None,
    threads: int | None = 1,
) -> ShotInput:
    """The input of a shot, or of a batch of shots; see `simulate` for what is refused.

    Args:
        scene: The scene.
        positions: As in `simulate` or `simulate_batch`, like the next four.
        velocities: See there.
        spins: See there.
        in_play: See there.
        max_time: See there.
        into: Where to put a batch of shots, as `empty_shots` gives it; None for new arrays.
        threads: Number of threads that look at a batch; None for one a core.

    Returns:
        The input, in new arrays or those of `into`.

    Raises:
        ValueError: As `simulate` does, naming the shot of a batch.
    """
    placed = np.asarray(positions, dtype=np.float64)
    shape = placed.shape[:-1]
    if placed.ndim not in (2, 3) or placed.shape[-2:] != (scene.n_balls, 2):
        check_positions(scene, placed)  # says so
    if into is None:
        balls = np.empty((*shape, 2)), np.empty((*shape, 2)), np.empty((*shape, 3)), np.empty(shape, np.bool_)
    else:
        balls = into[:4]
    balls[0][...] = placed
    if in_play is None:
        balls[3][...] = True
    else:
        given = np.asarray(in_play, dtype=np.bool_)
        if given.shape not in (shape, shape[-1:]):
            raise ValueError(f"in_play has shape {given.shape}: expected {shape[-1:]}, a value a ball")
        balls[3][...] = given
    if spins is not None and scene.physics.motion != "sliding":
        raise ValueError(
            f"spins with physics.motion = {scene.physics.motion!r}: expected None, only sliding balls spin"
        )
    limit = scene.physics.max_time if max_time is None else real("max_time", max_time, "limit")
    if limit is None:
        limit = np.inf
    _fill(balls[1], "velocities", velocities)
    _fill(balls[2], "spins", spins)
    if not _plainly_right(scene, balls, threads):
        check_positions(scene, balls[0], in_play=balls[3])
        _refuse_bad_motion(scene, "velocities", balls[1], RANGES["speed"])
        _refuse_bad_motion(scene, "spins", balls[2], RANGES["spin"])
    return ShotInput(*balls, float(limit))


def _plainly_right(scene: Scene, balls: tuple[NDArray[Any], ...], threads: int | None) -> bool:
    """Whether a quick look finds nothing wrong."""
    arrays = tuple(scene_arrays(scene))
    shots = balls if balls[3].ndim > 1 else tuple(array[None] for array in balls)
    doubts: list[int] = []

    def look(begin: int, end: int) -> None:
        if not plainly_right(begin, end, arrays, shots):
            doubts.append(begin)

    spread(look, len(shots[3]), threads)
    return not doubts


def simulate(
    scene: Scene,
    positions: ArrayLike,
    velocities: ArrayLike,
    *,
    mode: str = "pic",
    dt: float | None = None,
    fix: str | None = None,
    spins: ArrayLike | None = None,
    in_play: ArrayLike | None = None,
    record: bool = False,
    max_time: float | None = None,
    max_events: int = MAX_EVENTS,
) -> ShotResult:
    """Runs one shot until every ball rests.

    Args:
        scene: Table, balls and physics.
        positions: (n, 2) centres of the balls, m; ball 0 is the cue ball.
        velocities: (n, 2) m/s, or (2,), the cue ball's.
        mode: The engine: "pic" (event-driven, exact) or "pit" (fixed timestep, see `engine.pit`).
        dt: The timestep of "pit", s; None with "pic", which has none.
        fix: What "pit" does about balls that it finds overlapping: "push_apart" (its default), "move_back" or "none",
            see `engine.pit`; None with "pic", where none overlap.
        spins: (n, 3) or (3,) angular velocities, rad/s; none by default, and only with "sliding" motion.
        in_play: (n,) bool; balls that are not in play are ignored and count as potted. All are by default.
        record: Whether to keep the events and trajectories.
        max_time: The shot ends after so many seconds at the latest; the scene's own limit by default.
        max_events: The engine gives up the shot, with status "event_limit", after this number of events. "pit" also
            gives up a shot, with status "step_limit", after `pit.MAX_STEPS` timesteps. So every shot ends.

    Returns:
        The balls at the end of the shot, and what happened.

    Raises:
        ValueError: If balls overlap, lie outside the table or in a pocket, a value is outside its range (see
            `checks.RANGES`), a ball of infinite mass is to move, or an argument is unknown or of the wrong shape.
        TypeError: If an argument is of the wrong type.
        KeyboardInterrupt: Within a second of a Ctrl-C; the arguments are unchanged then.

    Example:
        >>> scene = Scene.named("ideal")
        >>> shot = simulate(scene, [[-0.5, 0.0], [0.0, 0.0]], [1.0, 0.0], max_time=1.0)
        >>> shot.status, shot.first_hit, shot.velocities.tolist()
        ('max_time', 1, [[0.0, 0.0], [1.0, 0.0]])
    """
    check_mode(mode, dt, fix)
    whole("max_events", max_events, "max_events")
    if np.ndim(positions) != 2:
        raise ValueError(f"positions has shape {np.shape(positions)}: expected ({scene.n_balls}, 2), a row a ball")
    given = check_shot(scene, positions, velocities, spins, in_play, max_time)
    return run_checked(scene, given, mode, dt, fix, record, max_events)


def run_checked(
    scene: Scene,
    given: ShotInput,
    mode: str = "pic",
    dt: float | None = None,
    fix: str | None = None,
    record: bool = False,
    max_events: int = MAX_EVENTS,
) -> ShotResult:
    """`simulate` for input that is known to be right, such as the balls where another shot has left them.

    Args:
        scene: Table, balls and physics.
        given: The input, of one shot; an unrecorded shot is run in its arrays.
        mode: The engine.
        dt: As in `simulate`.
        fix: As in `simulate`.
        record: As in `simulate`.
        max_events: As in `simulate`.

    Returns:
        The balls at the end of the shot, and what happened.
    """
    n = scene.n_balls
    times, hits, counts = np.empty(1), np.empty((1, n, 2), np.int32), np.empty((1, N_COUNTS), np.int64)
    arrays = scene_arrays(scene, dt, fix)
    exact = mode == "pic"
    room = 256 if record else 0
    while True:
        balls = given[:4]
        if record:  # kept, should the log prove too short
            balls = tuple(array.copy() for array in balls)
        places, moving, spinning, playing = balls
        log = empty_log(room, 4 * room)
        shots = places[None], moving[None], spinning[None], playing[None], times, hits, counts
        engine_of(mode, n)(0, 1, tuple(arrays), given.limit, max_events, shots, tuple(log))
        events, segments, used = log
        if not record or (used[0] <= len(events) and used[1] <= len(segments)):
            break
        room = max(4 * room, int(max(used)))  # the log was too short: the same shot again, with room for all of it
    count = counts[0]
    return ShotResult(
        positions=places,
        velocities=moving,
        spins=spinning,
        potted=~playing,
        time=float(times[0]),
        n_events=int(count[N_EVENTS]),
        status=STATUS[count[ENDED]],
        first_hit=int(count[FIRST_HIT]),
        cushions=hits[0, :, CUSHIONS].copy(),
        cushions_before_hit=hits[0, :, CUSHIONS_BEFORE_HIT].copy(),
        n_contact_rule=int(count[N_CONTACT_RULE]),
        events=_event_array(events[: used[0]]) if record else None,
        segments=segments[: used[1]].copy() if record else None,
        scene=scene if record else None,
        engine=_engine_label(mode, dt, fix) if record else "",
        _arrays=arrays if record and exact else None,
        _log=events[: used[0]].copy() if record and exact else None,
    )


def _event_array(rows: Floats) -> NDArray[Any]:
    events = np.empty(len(rows), EVENT_DTYPE)
    events["time"] = rows[:, 0]
    events["kind"] = np.array(KINDS)[rows[:, 2].astype(np.int64)]
    for name, column in (("ball", 3), ("other", 4), ("x", 5), ("y", 6), ("speed", 7), ("rule", 8)):
        events[name] = rows[:, column]
    return events
