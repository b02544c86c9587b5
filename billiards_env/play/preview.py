"""The predicted start of an aimed shot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.drawing.recording import Recording
from billiards_env.games import GameState, Setup, Stroke, play

Floats = NDArray[np.float64]

CONTACTS = ("ball_ball", "cushion", "pocket")

POINTS = 240
"""Number of points of a path, in addition to its corners."""


class Preview(NamedTuple):
    """The predicted start of a shot. The engine computes it, with throw and spin.

    Attributes:
        path: (m, 2) m, the path of the cue ball up to its first contact with a ball, or to its end.
        ball: The ball that the cue ball touches first, or -1.
        cue: (p, 2) m, the path of the cue ball from there to its next contact with a ball, a cushion or a pocket, or
            to its rest; empty if it touches no ball.
        struck: (q, 2) m, the same path of the ball that it touches.
        pocket: The pocket towards which this ball moves, or -1.
    """

    path: Floats
    ball: int
    cue: Floats
    struck: Floats
    pocket: int = -1


def make_preview(setup: Setup, game: GameState, stroke: Stroke) -> Preview:
    """Simulates a shot and returns its start, up to the second contact of the cue ball and of the struck ball."""
    cue = int(game.state.cue_balls[0])
    recording = play(setup, game, stroke).shot.recording()
    hits = _contacts(recording, cue, ("ball_ball",))
    if len(hits) == 0:
        end = min(recording.time, float(recording.gone[cue]))
        return Preview(_path(recording, cue, 0.0, end), -1, np.zeros((0, 2)), np.zeros((0, 2)))
    time, ball = float(hits["time"][0]), int(hits["ball"][0] + hits["other"][0]) - cue
    after = []
    for one in (cue, ball):
        later = _contacts(recording, one, CONTACTS)["time"]
        later = later[later > time]
        after.append(_path(recording, one, time, float(later[0]) if len(later) else recording.time))
    left, struck = after
    ways = setup.scene.table.pocket_places - struck[0]
    cosines = ways @ (struck[1] - struck[0]) / np.hypot(*ways.T)
    pocket = int(cosines.argmax()) if len(ways) else -1
    return Preview(_path(recording, cue, 0.0, time), ball, left, struck, pocket)


def _contacts(recording: Recording, ball: int, kinds: tuple[str, ...]) -> NDArray[np.void]:
    """Returns the events of some kinds in which a ball takes part."""
    events = recording.events
    both = (events["ball"] == ball) | ((events["kind"] == "ball_ball") & (events["other"] == ball))
    return events[both & np.isin(events["kind"], kinds)]


def _path(recording: Recording, ball: int, start: float, end: float) -> Floats:
    """Returns the path of a ball between two times, (m, 2) m."""
    corners = recording.corners(ball)
    times = np.union1d(np.linspace(start, end, POINTS), corners[(corners > start) & (corners < end)])
    # At the instant of a pot the later piece is at the pocket's centre.
    return recording.trajectory.path(ball, times, before=True)
