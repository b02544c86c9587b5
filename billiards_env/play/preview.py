"""The predicted start of an aimed shot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.drawing.recording import Recording
from billiards_env.games import GameState, Setup, Stroke, play


class Preview(NamedTuple):
    """The predicted start of a shot.

    Attributes:
        path: (m, 2) m, the path of the cue ball up to its first contact with a ball, or to its end.
        ball: The ball that the cue ball touches first, or -1.
        struck: (2,) m/s, the velocity of that ball after the contact.
        cue: (2,) m/s, the velocity of the cue ball after the contact.
    """

    path: NDArray[np.float64]
    ball: int
    struck: NDArray[np.float64]
    cue: NDArray[np.float64]


def make_preview(setup: Setup, game: GameState, stroke: Stroke) -> Preview:
    """Simulates a shot and returns its start, up to the first contact of the cue ball with another ball.

    Args:
        setup: The settings of the game.
        game: The state of the game.
        stroke: The shot.

    Returns:
        The preview.
    """
    cue = game.state.cue_balls[0]
    shot = play(setup, game, stroke).shot
    recording = shot.recording()
    events = recording.events
    hits = events[(events["kind"] == "ball_ball") & ((events["ball"] == cue) | (events["other"] == cue))]
    ball, end = -1, min(recording.time, float(recording.gone[cue]))
    if len(hits):
        ball, end = int(hits["ball"][0] + hits["other"][0]) - cue, float(hits["time"][0])
    corners = recording.corners(cue)
    times = np.union1d(np.linspace(0.0, end, 60), corners[corners < end])
    # Without the last instant if the cue ball is potted: it is then already at the pocket's centre.
    path = recording.path(cue, times if ball >= 0 or end == recording.time else times[:-1])
    return Preview(path, ball, *(_velocity(recording, i, end) if ball >= 0 else np.zeros(2) for i in (ball, cue)))


def _velocity(recording: Recording, ball: int, time: float) -> NDArray[np.float64]:
    """Returns a ball's velocity just after an instant, (2,) m/s."""
    paths = recording.trajectory
    pieces = np.flatnonzero(paths.ball == ball)
    return paths.velocity[pieces[np.searchsorted(paths.start[pieces], time, side="right") - 1]]
