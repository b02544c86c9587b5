"""A page that plays a shot in a browser, as a single HTML file."""

from __future__ import annotations

import html
import json
import math
import os
from importlib import resources
from typing import Any

import numpy as np

from billiards_env.drawing.recording import Recording, check_pair
from billiards_env.drawing.style import (
    CHALK,
    CLOTH,
    CUSHION,
    CUSHION_SHARE,
    INK,
    KINDS,
    POCKET,
    RAIL,
    RAIL_SHARE,
    looks,
)
from billiards_env.files import check_path, replacing


def write_page(
    path: str | os.PathLike[str], recording: Recording, compare: Recording | None, title: str | None
) -> None:
    """Writes the page of `make_page` to a file."""
    target = check_path(path, ".html")
    page = make_page(recording, compare, title)
    with replacing(target) as temporary:
        temporary.write_text(page, encoding="utf-8")


def make_page(recording: Recording, compare: Recording | None = None, title: str | None = None) -> str:
    """Returns the page of a shot.

    The browser computes the positions at any time from the pieces of the trajectories.

    Args:
        recording: The shot.
        compare: Another run of the shot, drawn as rings.
        title: The heading; None for the engine with the number of events and the duration.

    Returns:
        HTML with all inserted text escaped.

    Raises:
        ValueError: If `compare` has other balls or another table.
    """
    runs = [recording]
    if compare is not None:
        check_pair(recording, compare)
        runs.append(compare)
    if title is None:
        title = f"{recording.label}: {len(recording.events)} events in {recording.time:.2f} s"
        title += "" if compare is None else f"; rings: {compare.label}"
    scene = recording.scene
    data = {
        "table": {
            "length": scene.table.length,
            "width": scene.table.width,
            "pockets": [[pocket.x, pocket.y, pocket.radius] for pocket in scene.table.pockets],
        },
        "balls": [
            {"radius": radius, **look._asdict()} for radius, look in zip(scene.balls.radius, looks(scene), strict=True)
        ],
        "colours": {
            "cloth": CLOTH,
            "cushion": CUSHION,
            "rail": RAIL,
            "pocket": POCKET,
            "ink": INK,
            "chalk": CHALK,
            "rail_share": RAIL_SHARE,
            "cushion_share": CUSHION_SHARE,
        },
        "kinds": KINDS,
        "runs": [_run(run) for run in runs],
    }
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    template = resources.files(__package__ or "").joinpath("page.html").read_text(encoding="utf-8")
    # "<" could end the script. It occurs only in JSON strings, where \u003c is equivalent.
    before, after = template.split("{{data}}")
    return before.replace("{{title}}", html.escape(title)) + text.replace("<", "\\u003c") + after


def _run(recording: Recording) -> dict[str, Any]:
    paths = recording.trajectory
    lasts = np.minimum(paths.lasts, recording.time)
    rows = np.column_stack((paths.start, lasts, paths.position, paths.velocity, paths.acceleration))
    return {
        "label": recording.label,
        "time": recording.time,
        "pieces": [rows[paths.ball == i].tolist() for i in range(recording.scene.n_balls)],
        "gone": [t if math.isfinite(t) else None for t in recording.gone.tolist()],
        "events": [
            [e["time"].item(), str(e["kind"]), *(e[k].item() for k in ("ball", "other", "x", "y", "speed"))]
            for e in recording.events
        ],
    }
