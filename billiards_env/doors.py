"""The doors of the core: the names that only an attachment can provide, and where it provides them.

The core is what the environment needs: `support`, `jit`, `scene`, `physics`, `engine`, `shots`, `games`, `envs` and
`billiards_v0`. The other packages are attachments. An attachment uses the core, and the core runs without it. `DOORS`
is the only place in the core that names an attachment.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any, TypeVar

T = TypeVar("T")

DOORS = {
    "shot.plot": "billiards_env.drawing.plot:draw_shot",
    "shot.to_gif": "billiards_env.drawing.film:film_shot",
    "shot.to_mp4": "billiards_env.drawing.film:film_shot",
    "shot.to_html": "billiards_env.drawing.page:write_page",
    "shot._repr_html_": "billiards_env.drawing.page:notebook_output",
    "render_mode": "billiards_env.drawing.rendering:Renderer",
    "billiards_env.envs.RecordVideo": "billiards_env.drawing.rendering:RecordVideo",
}
"""What an attachment provides: `module:attribute` by name. `what = 'name'` is an entry of the table of `what`."""


def load(door: str) -> Any:
    """Returns what an attachment provides for a name in `DOORS`. The first call imports its module.

    Raises:
        ModuleNotFoundError: If the installation does not contain the attachment, which is the `name` of the error, or
            a package that the attachment needs is not installed.
    """
    module, _, attribute = DOORS[door].partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith("billiards_env."):
            raise
        message = f"{door}: expected the attachment {error.name}, which this installation does not contain"
        raise ModuleNotFoundError(message, name=error.name) from error


def attribute(module: str, name: str) -> Any:
    """Returns an attribute of a module of the core that an attachment provides, for the `__getattr__` of the module."""
    if (door := f"{module}.{name}") not in DOORS:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    return load(door)
