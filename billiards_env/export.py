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
    out = {ball: reason for reason, balls in shot.out_of_play.items() for ball in balls}
    ends = (f"  ball {ball}  {out.get(ball, place)}" for ball, place in enumerate(places))
    lines = ["final positions, m", *ends, "events"]
    for time, kind, ball, other, *_ in events[:SHOWN].tolist():
        what = f"hits {cushions[other]}" if kind == "cushion" else KINDS[kind] + f" {other}" * (kind == "ball_ball")
        lines.append(f"  {time:9.6f} s  ball {ball} {what}")
    return "\n".join([*lines, *[f"  and {len(events) - SHOWN} more: shot.events has all"] * (len(events) > SHOWN)])


def _rows(shot: ShotResult, path: Path) -> None:
    """Writes positions, velocities and spins at each event and every 10 ms, in scenes with flight also z and vz."""
    events: Any = shot.events
    times = np.unique(np.concatenate((np.arange(0.0, shot.time, 0.01), events["time"], [shot.time])))
    flies, places = shot.heights is not None, [shot.at(times)]
    places += [shot.heights_at(times)[..., None]] * flies
    values = np.concatenate((*places, *shot.motion_at(times)), -1)
    lines = ["time,ball,x,y,z,vx,vy,vz,wx,wy,wz" if flies else "time,ball,x,y,vx,vy,wx,wy,wz"]
    for time, balls in zip(times.tolist(), values.tolist(), strict=True):
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
