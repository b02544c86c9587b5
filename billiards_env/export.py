"""A recorded shot as text, and its files by suffix: a page, pictures, films, a table and a record."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from billiards_env.support.files import replacing, write_atomically

if TYPE_CHECKING:
    from billiards_env.shots.result import ShotResult


def _picture(shot: ShotResult, path: Path) -> None:
    figure: Any = shot.plot().figure
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)


def shot_text(shot: ShotResult) -> str:
    """Returns the final positions and the first `SHOWN` events of a recorded shot as text."""
    from billiards_env.drawing.recording import recording_of
    from billiards_env.drawing.style import KINDS, cushion_names

    recording = recording_of(shot)
    events, cushions = recording.events, cushion_names(recording.scene.table)
    places = (f"({x:.4f}, {y:.4f})" for x, y in shot.positions.tolist())
    ends = ("potted" if gone else place for gone, place in zip(shot.potted, places, strict=True))
    lines = ["final positions, m", *(f"  ball {ball}  {end}" for ball, end in enumerate(ends)), "events"]
    for time, kind, ball, other, *_ in events[:SHOWN].tolist():
        what = f"hits {cushions[other]}" if kind == "cushion" else KINDS[kind] + f" {other}" * (kind == "ball_ball")
        lines.append(f"  {time:9.6f} s  ball {ball} {what}")
    return "\n".join([*lines, *[f"  and {len(events) - SHOWN} more: shot.events has all"] * (len(events) > SHOWN)])


def _rows(shot: ShotResult, path: Path) -> None:
    """Writes positions, velocities and spins at each event and every 10 ms."""
    events: Any = shot.events
    times = np.unique(np.concatenate((np.arange(0.0, shot.time, 0.01), events["time"], [shot.time])))
    values = np.concatenate((shot.at(times), *shot.motion_at(times)), -1).tolist()
    lines = ["time,ball,x,y,vx,vy,wx,wy,wz"]
    for time, balls in zip(times.tolist(), values, strict=True):
        lines += [",".join(map(repr, (time, ball, *row))) for ball, row in enumerate(balls)]
    write_atomically(path, ("\n".join(lines) + "\n").encode())


SHOWN = 40
"""The largest number of events in `shot_text`."""

WRITERS: dict[str, Callable[[ShotResult, Path], object]] = {
    ".html": lambda shot, path: shot.to_html(path),
    ".png": _picture,
    ".svg": _picture,
    ".pdf": _picture,
    ".gif": lambda shot, path: shot.to_gif(path),
    ".mp4": lambda shot, path: shot.to_mp4(path),
    ".csv": _rows,
    ".json": lambda shot, path: shot.save(path),
}
"""Functions that write a shot to a file."""
