"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


def check_path(path: str | os.PathLike[str], suffix: str) -> Path:
    """The path of a file to write.

    Args:
        path: The path.
        suffix: What it must end in, such as ".gif".

    Returns:
        The path as a `Path`.

    Raises:
        ValueError: If it ends otherwise.
        FileNotFoundError: If its folder does not exist.
        IsADirectoryError: If it is a folder.
    """
    target = Path(path)
    if target.suffix.lower() != suffix:
        raise ValueError(f"path = {str(target)!r}: expected a name that ends in {suffix!r}")
    if target.is_dir():
        raise IsADirectoryError(f"path = {str(target)!r}: expected a file, this is a folder")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"path = {str(target)!r}: the folder {str(target.parent)!r} does not exist")
    return target


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A temporary file beside `target` that takes its place if the block ends well, and vanishes if not."""
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
