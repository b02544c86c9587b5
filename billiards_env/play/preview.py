"""The predicted start of an aimed shot."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.drawing.recording import Recording, recording_of
from billiards_env.games import GameState, Setup, Stroke, play

Floats = NDArray[np.float64]

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
    cue: Floats = np.empty((0, 2))
    struck: Floats = np.empty((0, 2))
    pocket: int = -1


def make_preview(setup: Setup, game: GameState, stroke: Stroke) -> Preview:
    """Simulates a shot and returns its start, up to the second contact of the cue ball and of the struck ball."""
    recording = recording_of(play(setup, game, stroke).shot)
    cue, own = recording.cue, contacts(recording, recording.cue)
    hits = own[own["kind"] == "ball_ball"]
    if len(hits) == 0:
        return Preview(_path(recording, cue, 0.0, recording.time), -1)
    time, ball = float(hits["time"][0]), int(hits["ball"][0] + hits["other"][0]) - cue
    after = []
    for one in (cue, ball):
        later = contacts(recording, one)["time"]
        after.append(_path(recording, one, time, min(later[later > time], default=recording.time)))
    (rest, struck), pockets = after, setup.scene.table.pockets
    ways = setup.scene.table.pocket_places - struck[0]
    cosines = ways @ (struck[1] - struck[0]) / np.hypot(*ways.T)
    return Preview(_path(recording, cue, 0.0, time), ball, rest, struck, int(cosines.argmax()) if pockets else -1)


def contacts(recording: Recording, ball: int) -> NDArray[Any]:
    """Returns the events of a shot in which a ball touches a ball, a cushion or a pocket."""
    events = recording.events
    both = (events["ball"] == ball) | ((events["kind"] == "ball_ball") & (events["other"] == ball))
    return events[both & np.isin(events["kind"], ("ball_ball", "cushion", "pocket"))]


def _path(recording: Recording, ball: int, start: float, end: float) -> Floats:
    """Returns the path of a ball between two times, (m, 2) m."""
    times, path = recording.track(ball, np.linspace(start, end, POINTS))
    return path[(times >= start) & (times <= end)]
