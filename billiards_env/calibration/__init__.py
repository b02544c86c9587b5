"""Calibration of scenes with tracks of real tables.

Modules:
    calibrate: Fits constants of `Physics` to tracks.
    report: The result.
    tracks: Tracks and their files.
    cleaning: Clipped rows and lost frames.
    contacts: Contacts in the tracks, without a model.
    frame: From coordinates of a file to the table, and checks of the tracks against it.
    preparation, starts: Tracks that are ready for the fit, and the fit of their starts.
    scatter: The scatter of the cushions.
    fit, stages: The fit of the shared constants with their intervals, and its stages.
    example: Tracks of simulated shots.
    judge: The errors of the result, and the rows that do not fit.
"""

from billiards_env.calibration.calibrate import FREE, calibrate
from billiards_env.calibration.frame import Frame
from billiards_env.calibration.report import Calibration
from billiards_env.calibration.tracks import Track, observed, read_tracks, write_tracks

__all__ = ["FREE", "Calibration", "Frame", "Track", "calibrate", "observed", "read_tracks", "write_tracks"]
