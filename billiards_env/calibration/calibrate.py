"""Calibration: fits constants of `Physics` to tracks of shots.

The fit finds the constants that all shots share. It also finds, for each shot, the places of the balls at the start,
the velocity and spin of the cue ball, and the instant of the strike. It first fits only the starts, to the rows until
the first contact of the cue ball. It then fits all unknowns to the rows until the second contact, until the third, and
so on: see `stages.fit_stages`. The intervals of the constants come from their spread over the shots, so they include
errors of the laws: see `fit.covariance`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.calibration.cleaning import clean, noise_of
from billiards_env.calibration.fit import MANY, Fit, determined, values_of
from billiards_env.calibration.frame import Frame, check_frame, fit_frame
from billiards_env.calibration.judge import find_problems, judge
from billiards_env.calibration.preparation import SPIN, VELOCITY, PreparedTrack, prepare
from billiards_env.calibration.report import Calibration
from billiards_env.calibration.stages import ENOUGH, fit_stages, near_rows
from billiards_env.calibration.starts import search
from billiards_env.calibration.tracks import Floats, Track, check_tracks
from billiards_env.derivatives.shot_derivatives import check_derivatives, physics_inputs
from billiards_env.scene import PARAMETERS, Scene, check_scene
from billiards_env.support.checks import Range, finite, flag, integer, one_of, real

FREE = tuple(name for name, parameter in PARAMETERS.items() if parameter.fitted)
"""The constants that `calibrate` fits by default, if they are not 0 and enter the laws of the scene."""

_NOISE = Range(1e-9, 1.0, "m")
_CONTACTS = Range(2, 9)
_EACH, _FEWEST = 5, 10  # every fifth shot is held back, of ten or more


def calibrate(
    scene: Scene,
    shots: Sequence[Track],
    free: Sequence[str] | None = None,
    *,
    frame: Frame | Literal["fit"] | None = None,
    noise: float | None = None,
    contacts: int = 4,
    hold_back: bool = True,
    velocities: ArrayLike | None = None,
    spins: ArrayLike | None = None,
    progress: Callable[[str], object] = lambda text: None,
) -> Calibration:
    """Fits constants of the physics of a scene to tracks of shots.

    The tracks may contain whole shots. The rows of a shot are fitted until a contact of the cue ball. The loss is
    Cauchy's, so rows far from the path of the model hardly count, and the report lists them. With ten or more shots,
    there are two fits: the first leaves out every fifth shot to measure the errors of predictions, the second has all.

    Args:
        scene: The scene; its constants are the start of the fit.
        shots: The tracks.
        free: The constants to fit: numbers of `Physics` except `max_time`. None for those of `FREE` that are not 0 and
            have an effect.
        frame: The frame of the tracks. None for metres from the centre of the table, which is checked. "fit" finds the
            frame from rebounds, in any unit. The table of the result is then larger by as much as its cushions yield.
        noise: Standard deviation of a coordinate of a row, m; None for an estimate.
        contacts: The contact of the cue ball until which rows are fitted, 2 to 9.
        hold_back: Whether every fifth of ten or more shots is held back at first.
        velocities: (m, 2) m/s, the cue balls' velocities at the first rows, if they are known.
        spins: (m, 3) rad/s, their spins, if they are known.
        progress: A function that is called with a line of text before each fit and after each stage.

    Returns:
        The constants with their covariance, the fitted shots, their errors and the problems of the tracks.

    Raises:
        ValueError: If a constant is unknown, a track is invalid or does not lie on the table, or the rows do not
            determine any constant; if no ball of a track moves first, see `tracks.first_balls`; if the shots of the
            scene have no derivatives.
    """
    check_scene(scene)
    names = free_names(scene, free)
    contacts, hold_back = integer("contacts", contacts, _CONTACTS), flag("hold_back", hold_back)
    tracks, warnings = clean(check_tracks(scene, shots))
    scene, file_frame = _framed(scene, tracks, frame, contacts)
    tracks = [file_frame.apply(track) for track in tracks]
    error = noise_of(tracks) if noise is None else real("noise", noise, _NOISE)
    known = _known_starts(scene, len(tracks), velocities, spins)
    prepared = [prepare(scene, track, error, start) for track, start in zip(tracks, known, strict=True)]
    warnings += _check_cue_balls(prepared, 4 if velocities is None else 1)
    if frame is None:
        check_frame(scene, prepared, error)
    fit, predicted = Fit(scene, names, scene, prepared, {}, np.zeros((0, 0))), None
    if hold_back and len(prepared) >= _FEWEST:
        fit = fit._replace(shots=[shot for k, shot in enumerate(prepared) if k % _EACH < _EACH - 1])
        progress(f"first fit: {len(fit.shots)} of {len(prepared)} shots, to predict the others")
        fit = fit_stages(fit, contacts, progress)
        if fit.share >= ENOUGH:
            predicted = judge(determined(fit, contacts).scene, prepared[_EACH - 1 :: _EACH])
            fit = fit._replace(shots=prepared, stages=())
            progress("second fit: all shots")
    if fit.share >= ENOUGH:  # also if no shots are held back
        fit = fit_stages(fit, contacts, progress)
    if fit.share < ENOUGH:
        warnings.append(f"only {fit.share:.0%} of the rows until the second contact fit: no constants are determined")
        fit = near_rows(fit, contacts)._replace(scene=scene, names=())
    else:
        fit = determined(fit, contacts)
        # A shot may have left its best start when the constants changed.
        found = [search(fit.scene, shot.wide(contacts)) for shot in fit.shots]
        fit = near_rows(fit._replace(shots=found), contacts)
        if len(fit.shots) < MANY:
            warnings.append(f"fewer than {MANY} shots: the intervals hold only if the laws are right")
    return Calibration(
        scene=fit.scene,
        start=values_of(scene, names),
        values=values_of(fit.scene, fit.names),
        kept=fit.kept,
        covariance=fit.covariance,
        row_noise=error,
        frame=file_frame,
        shots=[shot.until(contacts) for shot in fit.shots],
        problems=[problem for shot in fit.shots for problem in find_problems(fit.scene, shot)],
        predicted=predicted,
        warnings=warnings,
    )


def free_names(scene: Scene, free: Sequence[str] | None) -> tuple[str, ...]:
    """Returns the names of the constants to fit, after a check that the shots of the scene have derivatives."""
    check_derivatives(scene, "calibrate")
    physics = scene.physics
    if free is None:
        used = (name for name in FREE if PARAMETERS[name].has_effect(physics) and getattr(physics, name))
        return tuple(name for name in used if name != "mu_ball_decay" or physics.mu_ball is None)
    names = (free,) if isinstance(free, str) else tuple(free)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"free = {list(names)}: expected names of constants, each once")
    for name in names:
        one_of("free", name, tuple(physics_inputs(physics)))
    return names


def _check_cue_balls(shots: Sequence[PreparedTrack], least: int) -> Iterator[str]:
    """Yields a sentence about each shot in which other balls begin to move with the cue ball.

    Raises:
        ValueError: If the cue ball has fewer than `least` rows.
    """
    for shot in shots:
        name, ball = shot.track.name, shot.cue_ball
        count = np.count_nonzero(shot.track.balls[~shot.added] == ball)
        if count < least:
            raise ValueError(f"shots[{name!r}]: {count} rows of the cue ball, ball {ball}: expected {least} or more")
        if len(shot.first) > 1:
            yield f"shot {name}: balls {shot.first} begin to move in one frame, ball 0 counts as the cue ball"


def _known_starts(scene: Scene, m: int, velocities: ArrayLike | None, spins: ArrayLike | None) -> Floats:
    """Returns the numbers of the starts of m shots, (m, width), NaN for those that are fitted."""
    known = np.full((m, 2 * scene.n_balls + 6), np.nan)
    for name, values, columns in (("velocities", velocities, VELOCITY), ("spins", spins, SPIN)):
        if values is not None:
            known[:, columns] = finite(name, values, known[:, columns].shape)
    return known


def _framed(scene: Scene, tracks: list[Track], frame: Frame | str | None, contacts: int) -> tuple[Scene, Frame]:
    """Returns the scene, whose table may be larger, and the frame of the tracks."""
    if not isinstance(frame, str):
        return scene, Frame() if frame is None else frame
    one_of("frame", frame, ("fit",))
    fitted, give = fit_frame(scene, tracks, contacts)
    table = scene.table
    if not table.outline and not table.pockets:
        table = dataclasses.replace(table, length=table.length + 2.0 * give, width=table.width + 2.0 * give)
    return dataclasses.replace(scene, table=table), fitted
