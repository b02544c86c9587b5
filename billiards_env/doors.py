"""The doors of the core: the names that only an attachment can provide, and where it provides them.

The core is what the environment needs: `support`, `jit`, `scene`, `physics`, `engine`, `shots`, `games`, `envs` and
`billiards_v0`. The other packages are attachments. An attachment uses the core, and the core runs without it. The
core imports attachments only by the names in `DOORS`.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections import UserDict
from typing import Any, TypeVar

T = TypeVar("T")

DOORS = {
    "shot.plot": "billiards_env.drawing.plot:draw_shot",
    "shot.to_gif": "billiards_env.drawing.film:write_film",
    "shot.to_mp4": "billiards_env.drawing.film:write_film",
    "shot.to_html": "billiards_env.drawing.page:write_page",
    "shot._repr_html_": "billiards_env.drawing.page:notebook_output",
    "render_mode": "billiards_env.drawing.rendering:Renderer",
    "billiards_env.envs.RecordVideo": "billiards_env.drawing.rendering:RecordVideo",
    "observe = 'pixels'": "billiards_env.drawing.raster:PIXELS",
    "observe = 'planes'": "billiards_env.drawing.raster:PLANES",
    "action = 'plan'": "billiards_env.pots.plans:PLAN",
    "billiards_env.register_player": "billiards_env.players.named:register_player",
    "opponent": "billiards_env.players.env_player:acting_by_name",
    "the frozen ids": "billiards_env.bench.frozen:register",
    "player = 'policy'": "billiards_env.sb3.policy_player:POLICY",
}
"""What attachments provide: `module:attribute` by name. The name "action = 'plan'" stands for
the entry "plan" of the table of actions."""


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


def is_there(door: str) -> bool:
    """Returns whether the installation contains the attachment of a name in `DOORS`."""
    return importlib.util.find_spec(DOORS[door].rpartition(".")[0]) is not None


def attribute(module: str, name: str) -> Any:
    """Returns an attribute that an attachment provides for a module of the core, whose `__getattr__` calls this."""
    if (door := f"{module}.{name}") not in DOORS:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    return load(door)


class Entries(UserDict[str, T]):
    """A table of entries by name, such as `ACTIONS`. An entry may be a name in `DOORS`, which loads at first use."""

    def __getitem__(self, name: str) -> T:
        entry: Any = self.data[name]
        if isinstance(entry, str):
            self.data[name] = entry = load(entry)
        return entry


def offered(what: str) -> Entries[Any]:
    """Returns the entries of attachments for a table; `what` is its name in the messages of errors."""
    return Entries({door.split("'")[1]: door for door in DOORS if door.startswith(f"{what} = ")})
