"""The table of the numbers of `Physics` in the documentation, from `billiards_env.scene.PARAMETERS`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from typing import Any

from benchmarks import table
from billiards_env.checks import RANGES
from billiards_env.scene import PARAMETERS, Physics

_HEAD = ("Field", "Default", "Range", "Meaning", "Source")


def blocks(_: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table of the numbers, without a measurement."""
    described = re.split(r"\n    (\w+): ", (inspect.getdoc(Physics) or "").partition("Attributes:")[2])
    meanings = {name: " ".join(text.split()) for name, text in zip(described[1::2], described[2::2], strict=True)}
    rows, defaults = [], Physics()
    for name, parameter in PARAMETERS.items():
        within = RANGES[parameter.within]
        values = f"`{getattr(defaults, name)}`", f"{within.least:g} to {within.most:g} {within.unit}".strip()
        rows.append((f"`physics.{name}`", *values, meanings[name], parameter.source))
    return {"physics": table(_HEAD, rows, left=len(_HEAD))}
