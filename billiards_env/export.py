"""The files of a recorded shot by suffix: a page, pictures, films and a record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from billiards_env.shots.result import ShotResult


def _picture(shot: ShotResult, path: Path, _: Sequence[ShotResult]) -> None:
    figure: Any = shot.plot().figure
    figure.savefig(path, dpi=150)


WRITERS: dict[str, Callable[[ShotResult, Path, Sequence[ShotResult]], object]] = {
    ".html": lambda shot, path, others: shot.to_html(path, compare=others),
    ".png": _picture,
    ".svg": _picture,
    ".pdf": _picture,
    ".gif": lambda shot, path, _: shot.to_gif(path),
    ".mp4": lambda shot, path, _: shot.to_mp4(path),
    ".json": lambda shot, path, _: shot.save(path),
}
"""Functions that write a shot to a file. A page also has other runs of the shot, and its slider chooses one."""
