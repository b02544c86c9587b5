"""Calibration: fits numbers of `Physics` to tracks of shots.

The fit finds the numbers that all shots share. It also finds, for each shot, the places of the balls at the start, the
velocity and spin of the cue ball, and the instant of the strike. It begins with the rows until the second contact of
the cue ball, then adds those until the third, and so on: see `stages`. The intervals of the numbers come from their
spread over the shots, so they include errors of the laws: see `shared.covariance`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.calibration.frame import Frame, fit_frame
from billiards_env.calibration.judge import ends_at, judge, off_of
from billiards_env.calibration.prepare import Shot, check_against_table, drop_clipped, noise_of, prepare, rows_of
from billiards_env.calibration.problems import Problem, find_problems
from billiards_env.calibration.report import Calibration
from billiards_env.calibration.rows import Floats, Layout, Rows
from billiards_env.calibration.shared import MANY, fit_shared, numbers_of, with_numbers
from billiards_env.calibration.stages import (
    Fitted,
    determined,
    distances,
    first_guess,
    fit_stage,
    judged_rows,
    typical_errors,
)
from billiards_env.calibration.starts import errors, evaluate, run
from billiards_env.calibration.tracks import Track, check_tracks
from billiards_env.checks import Range, finite, integer, one_of, real
from billiards_env.files import write_json
from billiards_env.scene import CUSHIONS, Scene, check_scene
from billiards_env.shots import records
from billiards_env.shots.gradients import physics_inputs

FREE = (
    *("mu_slide", "mu_roll", "spin_decay", "e_ball", "e_cushion", "mu_cushion", "mu_ball_factor"),
    *("e_cushion_loss", "mu_cushion_angle", "e_cushion_topspin", "mu_cushion_slip", "e_cushion_tangent"),
    "mu_roll_speed",
)
"""The numbers that `calibrate` fits by default, if they are not 0 and enter the laws of the scene."""

FRICTION_CUSHIONS = tuple(name for name in CUSHIONS if name != "restitution")
"""The laws of cushions that `laws` of `calibrate` may name."""

_NOISE = Range(1e-9, 1.0, "m")
_CONTACTS = Range(2, 9)
_EACH, _FEWEST = 5, 10  # every fifth shot is held back, of ten or more
_ENOUGH = 0.5  # least share of the rows until the second contact that are near their paths
_MOST_STATE = 64 * 2**20  # bytes


def calibrate(
    scene: Scene,
    shots: Sequence[Track],
    free: Sequence[str] | None = None,
    *,
    frame: Frame | Literal["fit"] | None = None,
    noise: float | None = None,
    contacts: int = 4,
    laws: Sequence[str] = (),
    hold_back: bool = True,
    velocities: ArrayLike | None = None,
    spins: ArrayLike | None = None,
    state: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Fits numbers of the physics of a scene to tracks of shots.

    The tracks may contain whole shots. The rows of a shot are fitted until a contact of the cue ball, or until the
    track leaves the path of the model. The loss is Cauchy's. Its scales come from the errors of the rows after the same
    number of contacts. With ten or more shots, every fifth shot is held back to measure the errors of predictions. Then
    all shots are fitted.

    Args:
        scene: The scene; its numbers are the start of the fit.
        shots: The tracks.
        free: The names of the numbers to fit, of `Physics` except `max_time`; None for those of `FREE` with an effect.
        frame: The frame of the tracks. None for metres from the centre of the table, which is checked. "fit" finds the
            frame from rebounds, in any unit. The table of the result is then larger by as much as its cushions yield.
        noise: Standard deviation of a coordinate of a row, m; None for an estimate.
        contacts: The contact of the cue ball until which rows are fitted, 2 to 9.
        laws: Laws of cushions that are fitted to the same rows, to compare them.
        hold_back: Whether every fifth of ten or more shots is held back at first.
        velocities: (m, 2) m/s, the cue ball's velocities at the first rows, if they are known.
        spins: (m, 3) rad/s, its spins, if they are known.
        state: A JSON file for each finished stage. If it exists, a fit of the same tracks with the same options resumes
            from it; only `contacts` may be larger.
        progress: A function that is called with a line of text after each stage.

    Returns:
        The numbers with their covariance, the residuals, the errors of the shots and the problems of the tracks.

    Raises:
        ValueError: If a number is unknown, a track is invalid or does not lie on the table, or the rows do not
            determine any number.
    """
    check_scene(scene)
    names = _check_names(scene, free)
    integer("contacts", contacts, _CONTACTS)
    for law in laws:
        one_of("laws", law, FRICTION_CUSHIONS)
    tracks = check_tracks(scene, shots, 4 if velocities is None else 1)
    tracks, clipped = drop_clipped(tracks)
    scene, known = _framed(scene, tracks, frame)
    tracks = [known.apply(track) for track in tracks]
    error = noise_of(tracks) if noise is None else real("noise", noise, _NOISE)
    prepared = [prepare(scene, track, error) for track in tracks]
    if frame is None:
        found = [one for shot in prepared for one in shot.contacts]
        check_against_table(scene, [shot.track for shot in prepared], found, error)
    rows, at = rows_of(scene, prepared, error), Layout(scene.n_balls)
    for name, given, where in (("velocities", velocities, at.velocity), ("spins", spins, at.spin)):
        if given is not None:
            width = where.stop - where.start
            rows.known[:, where] = finite(name, given, (len(tracks), width))
    held = (np.arange(len(tracks)) % _EACH == _EACH - 1) & (len(tracks) >= _FEWEST) & hold_back
    kept = _State(
        state, [scene.to_dict(), names, error, held.tolist()], [rows.known, *(a for t in tracks for a in t[1:])]
    )
    if kept.contact > contacts:
        raise ValueError(f"contacts = {contacts}: expected {kept.contact} or more, as in the file of the state")
    fits = _Fits(scene, names, contacts, error, prepared, rows, kept, progress)
    some, rest = np.flatnonzero(~held), np.flatnonzero(held)
    fitted, share = fits.run(some)
    warnings = [f"{clipped} rows at the border of the picture are left out"] if clipped else []
    predicted, losses = None, {}
    if share < _ENOUGH:
        warnings.append(f"only {share:.0%} of the rows until the second contact fit: no numbers")
        fitted = fitted._replace(scene=scene, names=(), covariance=np.zeros((0, 0)))
    elif rest.size:
        predicted = judge(fitted.scene, [prepared[k] for k in rest], rows.of(rest))
        fitted, some = fits.again(fitted, some, rest), np.arange(len(tracks))
    shots_of = [prepared[k] for k in some]
    if fitted.names and len(some) < MANY:
        warnings.append(f"fewer than {MANY} shots: the intervals hold only if the laws are right")
    if fitted.names:
        losses = {law: _loss_of(fitted, shots_of, contacts, law) for law in laws}
    return _result(fits, fitted, known, shots_of, predicted, losses, warnings)


def _check_names(scene: Scene, free: Sequence[str] | None) -> tuple[str, ...]:
    known = tuple(physics_inputs(scene.physics))
    if free is None:
        physics = scene.physics
        matter = set(FREE) if physics.motion == "sliding" else {"mu_roll", "mu_roll_speed", "e_ball", "e_cushion"}
        matter -= {"mu_ball_factor"} if physics.ball_ball == "frictionless" else set()
        return tuple(name for name in FREE if name in matter and getattr(physics, name) > 0.0)
    names = (free,) if isinstance(free, str) else tuple(free)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"free = {list(names)}: expected names of numbers, each once")
    for name in names:
        one_of("free", name, known)
    return names


def _framed(scene: Scene, tracks: list[Track], frame: Frame | str | None) -> tuple[Scene, Frame]:
    """Returns the scene, whose table may be larger, and the frame of the tracks."""
    if not isinstance(frame, str):
        return scene, Frame() if frame is None else frame
    one_of("frame", frame, ("fit",))
    found, give = fit_frame(scene, tracks)
    if not scene.table.outline and not scene.table.pockets:
        size = {"length": scene.table.length + 2.0 * give, "width": scene.table.width + 2.0 * give}
        scene = dataclasses.replace(scene, table=dataclasses.replace(scene.table, **size))
    return scene, found


class _State:
    """A file with the last finished stage of a fit, for settings, which are plain data, and arrays."""

    def __init__(self, path: str | os.PathLike[str] | None, settings: Sequence[Any], arrays: Sequence[np.ndarray]):
        digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
        self.path, self.key = None if path is None else Path(path), digest.hexdigest()
        self.data: dict[str, Any] = {}
        if self.path is not None and self.path.exists():
            what = "the state of a calibration"
            self.data = records.read(self.path, lambda text: records.data_of(text, what), what, _MOST_STATE)
            if not isinstance(self.data, dict) or self.data.get("key") != self.key:
                raise ValueError(
                    f"state = {str(self.path)!r}: expected the state of the same tracks, scene, numbers and options"
                )

    @property
    def contact(self) -> int:
        """The last contact of the cue ball until which rows are fitted; 1 without a finished stage."""
        return int(self.data.get("contact", 1))

    def keep(self, contact: int, share: float, numbers: Floats, starts: Floats) -> None:
        """Writes a finished stage."""
        if self.path is not None:
            self.data = {"key": self.key, "contact": contact, "share": share, "numbers": numbers.tolist()}
            write_json(self.path, self.data | {"starts": starts.tolist()})


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Fits:
    """The settings that all fits of a calibration share."""

    scene: Scene
    names: tuple[str, ...]
    contacts: int
    noise: float
    shots: list[Shot]
    rows: Rows
    state: _State
    progress: Callable[[str], None] | None

    def tell(self, text: str) -> None:
        if self.progress is not None:
            self.progress(text)

    def run(self, some: np.ndarray) -> tuple[Fitted, float]:
        """Returns the fit of some shots, and the share of rows near their paths until the second contact."""
        shots, rows = [self.shots[k] for k in some], self.rows.of(some)
        done, share = self.state.contact, float(self.state.data.get("share", 1.0))
        if done > 1:
            starts, scene = np.array(self.state.data["starts"]), self.scene
            scene = with_numbers(scene, self.names, np.array(self.state.data["numbers"]))
            rows = judged_rows(scene, starts, rows, ends_at(shots, done), self.noise)
        else:
            starts, scene = first_guess(self.scene, shots, rows), self.scene
            rows = judged_rows(scene, starts, rows, ends_at(shots, 1), self.noise)
        fitted = Fitted(scene, self.names, {}, starts, rows, np.zeros((0, 0)))
        for contact in range(done + 1, self.contacts + 1):
            fitted = fit_stage(fitted, self.scene, shots, contact, self.noise)
            numbers = numbers_of(fitted.scene, self.names)
            near = fitted.rows.until(ends_at(shots, contact))
            part = float((near.used & near.judged).sum() / max(1, (near.seen & near.judged).sum()))
            share = part if contact == 2 else share
            self.state.keep(contact, share, numbers, fitted.starts)
            text = ", ".join(f"{name} {value:.5g}" for name, value in zip(self.names, numbers, strict=True))
            self.tell(f"until contact {contact}: {part:.1%} of the rows, {text}")
            if share < _ENOUGH:
                return fitted, share
        return determined(fitted, self.scene, shots, self.contacts), share

    def again(self, fitted: Fitted, some: np.ndarray, rest: np.ndarray) -> Fitted:
        """Returns the fit of all shots, which begins from a fit of some of them."""
        shots = [self.shots[k] for k in rest]
        rows, starts = self.rows.of(rest), first_guess(fitted.scene, shots, self.rows.of(rest))
        other = Fitted(fitted.scene, (), {}, starts, rows, np.zeros((0, 0)))
        other = other._replace(rows=judged_rows(fitted.scene, starts, rows, ends_at(shots, 1), self.noise))
        for contact in range(2, self.contacts + 1):
            other = fit_stage(other, self.scene, shots, contact, self.noise)
        order = np.argsort(np.concatenate((some, rest)))
        both = self.rows._replace(
            used=np.concatenate((fitted.rows.used, other.rows.used))[order],
            scale=np.concatenate((fitted.rows.scale, other.rows.scale))[order],
        )
        whole = fitted._replace(starts=np.concatenate((fitted.starts, other.starts))[order], rows=both)
        whole = fit_stage(whole, self.scene, self.shots, self.contacts, self.noise, again=False)
        return determined(whole, self.scene, self.shots, self.contacts)


def _loss_of(fitted: Fitted, shots: Sequence[Shot], contacts: int, law: str) -> float:
    """Returns the loss of the rows of a fit with another law of cushions, whose numbers are fitted too."""
    part = fitted.rows.until(ends_at(shots, contacts))
    physics = dataclasses.replace(fitted.scene.physics, cushion=law)
    scene, starts = dataclasses.replace(fitted.scene, physics=physics), fitted.starts
    if law != fitted.scene.physics.cushion:
        scene, starts = fit_shared(scene, fitted.names, starts, part)
    return float(sum(evaluate(scene, starts[some], rows).loss.sum() for some, rows in part.groups()))


def _result(
    fits: _Fits,
    fitted: Fitted,
    frame: Frame,
    shots: list[Shot],
    predicted: Any,
    losses: dict[str, float],
    warnings: list[str],
) -> Calibration:
    rows, starts, ends = fitted.rows, fitted.starts, ends_at(shots, fits.contacts)
    off, apart = errors(fitted.scene, starts, rows), off_of(fitted.scene, starts, rows)
    before = rows._replace(used=rows.used & (rows.time < ends[:, None]))
    far = distances(rows, apart, typical_errors(before, apart, fits.noise), ends)
    begins = np.column_stack(([shot.begin for shot in shots], starts[:, Layout(fits.scene.n_balls).instant]))
    kept, used = [~shot.added for shot in shots], rows.used & (rows.time < ends[:, None])
    tracks = [shot.track.rows(keep) for shot, keep in zip(shots, kept, strict=True)]
    problems = find_problems([track.name for track in tracks], rows, begins, run(fitted.scene, starts, rows), far)
    for shot in shots:
        if shot.exchanged is not None:
            i, j, begin, end = shot.exchanged
            text = (
                f"from {begin:.3f} s {f'to {end:.3f} s' if np.isfinite(end) else 'on'} balls {i} and {j} are exchanged"
            )
            last = min(end, float(shot.track.times.max()))
            problems.append(Problem(shot.track.name, "swapped balls", i, begin, last, text))
    return Calibration(
        scene=fitted.scene,
        start=dict(zip(fits.names, numbers_of(fits.scene, fits.names).tolist(), strict=True)),
        values=dict(zip(fitted.names, numbers_of(fitted.scene, fitted.names).tolist(), strict=True)),
        kept=fitted.kept,
        covariance=fitted.covariance,
        row_noise=fits.noise,
        frame=frame,
        tracks=tracks,
        residuals=[row[: len(keep)][keep] for row, keep in zip(off, kept, strict=True)],
        fitted=[row[: len(keep)][keep] for row, keep in zip(used, kept, strict=True)],
        starts=starts,
        strikes=begins.sum(axis=1),
        problems=problems,
        judged=judge(fitted.scene, shots, rows),
        predicted=predicted,
        laws=losses,
        warnings=warnings,
    )
