"""A page that plays a shot in a browser, as a single HTML file."""

from __future__ import annotations

import html
import itertools
import json
import math
import os
from importlib import resources
from typing import Any

import numpy as np

from billiards_env.drawing import style
from billiards_env.drawing.orientation import VISIBLE
from billiards_env.drawing.recording import Recording, recording_of
from billiards_env.physics.state import AIRBORNE, VZ, Z
from billiards_env.scene import Scene
from billiards_env.scene.table import Table
from billiards_env.shots.result import ShotResult
from billiards_env.support.files import check_path, replacing

SIDE, CONTROLS, LIST, NARROW, LARGEST = 344, 172, 225, 760, 640
"""Pixels: the width of the events next to the table, the heights of the controls and of the events under the table, the
least width for events next to the table, and the largest height of a table in a notebook. page.html has the
same layout."""

STYLE = {
    name.lower(): value
    for name, value in vars(style).items()
    if name.isupper() and not name.startswith("_") and isinstance(value, (str, float, int, tuple))
}
"""The colours of all pictures, and the marks, the light and the shadow of the balls, by their names in `style`."""


LONGEST_SHOWN = 20_000
"""Largest number of pieces in the trajectory of a shot that a notebook displays: a few megabytes."""


def write_page(shot: ShotResult, path: str | os.PathLike[str], title: str | None) -> None:
    """Writes the page of `make_page` to a file, see `ShotResult.to_html`."""
    recording, target = recording_of(shot, "to_html"), check_path(path, ".html")
    page = make_page(recording, title)
    with replacing(target) as temporary:
        temporary.write_text(page, encoding="utf-8")


def make_page(recording: Recording, title: str | None = None) -> str:
    """Returns the page of a shot.

    The browser computes the positions and the orientations at any time from the pieces of the trajectories and the
    steps of the turning. The title is by default the engine with the number of contacts and the duration. All inserted
    text is escaped.
    """
    if title is None:
        listed = ("ball_ball", "cushion", "pocket")  # the events that the list begins with
        contacts = int(np.isin(recording.events["kind"], listed).sum())
        name = recording.label.replace("PIC", "exact engine (PIC)").replace("PIT", "fixed timestep (PIT)")
        title = f"{name}: {contacts} contact{'s' * (contacts != 1)} in {recording.time:.2f} s"
        title = title[0].upper() + title[1:]
    scene = recording.scene
    data = table_data(scene) | {
        "kinds": style.KINDS,
        "cushions": style.cushion_names(scene.table),
        "shot": {**_motion(recording), "turns": _turns(recording)},
    }
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    template = page_file("page.html").replace("{{drawing}}", page_file("table.js"))
    # "<" could end the script. It occurs only in JSON strings, where \u003c is equivalent.
    before, after = template.split("{{data}}")
    return before.replace("{{title}}", html.escape(title)) + text.replace("<", "\\u003c") + after


def page_file(name: str) -> str:
    """Returns the text of a file of this package."""
    return resources.files(__package__ or "").joinpath(name).read_text(encoding="utf-8")


def table_data(scene: Scene) -> dict[str, Any]:
    """Returns what `table.js` draws: the table, the looks of the balls and the tray of potted balls."""
    view = _view(scene.table)
    tray, looks = style.tray(scene.n_balls, *view[::2]), style.looks(scene)
    return {
        "view": view,
        "shapes": [[colour, corners.round(4).ravel().tolist()] for corners, colour in style.draw_table(scene.table)],
        "tray": tray._asdict(),
        "balls": [{"radius": r, **look._asdict()} for r, look in zip(scene.balls.radius, looks, strict=True)],
        "style": STYLE,
    }


def notebook_output(shot: ShotResult) -> str | None:
    """Returns the page of a shot in an iframe whose height follows its width without a script; None if it is long."""
    recording = recording_of(shot, "_repr_html_")
    if len(recording.trajectory.ball) > LONGEST_SHOWN:
        return None
    width, height, _ = _view(recording.scene.table)
    page, ratio = html.escape(make_page(recording)), height / width
    more = f"clamp(0px, ({NARROW}px - 100%) * 1000, {LIST}px)"  # the events are under the table of a narrow page
    side = f"clamp(0px, (100% - {NARROW - 1}px) * 1000, {SIDE}px)"
    table = f"min({LARGEST}px, {ratio:.4f} * (100% - 24px - {side}))"
    return (
        '<div style="max-width: 1100px">'
        f'<div style="position: relative; padding-bottom: calc({CONTROLS}px + {table} + {more})">'
        f'<iframe title="A shot" srcdoc="{page}" sandbox="allow-scripts" '
        'style="position: absolute; inset: 0; width: 100%; height: 100%; border: 0"></iframe></div></div>'
    )


def _view(table: Table) -> tuple[float, float, float]:
    """Returns the width and the height of the picture and the height of the tray in it, m."""
    rail, strip = 1.1 * style.rail_width(table), style.tray_height(table)
    return table.length + 2 * rail, table.width + 2 * rail + strip, strip


def _motion(recording: Recording) -> dict[str, Any]:
    paths = recording.trajectory
    lasts = np.minimum(paths.duration, recording.time)
    rows = np.column_stack((paths.start, lasts, paths.position, paths.velocity, paths.acceleration))
    if recording.scene.physics.flight:
        flies = (paths.phase == AIRBORNE)[:, None]
        rows = np.column_stack((rows, np.where(flies, paths.rows[:, [Z, VZ]], 0.0), -recording.scene.physics.g * flies))
    return {
        "time": recording.time,
        "pieces": [rows[paths.ball == i].tolist() for i in range(recording.scene.n_balls)],
        "gone": [t if math.isfinite(t) else None for t in recording.gone.tolist()],
        "events": [
            [e["time"].item(), str(e["kind"]), *(e[k].item() for k in ("ball", "other", "x", "y", "speed"))]
            for e in recording.events
        ],
    }


def _turns(recording: Recording) -> list[list[list[float]]]:
    """Returns the steps of each ball's turning, with the digits that a visible error needs."""
    turns = recording.turning(error=VISIBLE)
    rows = np.column_stack((turns.start.round(6), turns.lasts.round(6), turns.spin.round(3), turns.change.round(3)))
    rows = np.column_stack((rows, turns.face.round(5)))
    return [rows[a:b].tolist() for a, b in itertools.pairwise(turns.first.tolist())]
