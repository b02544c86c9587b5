"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any


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
    """A temporary file beside `target` that takes its place if the block ends well, and vanishes if not.

    It has the suffix of `target`, which tells some writers what to write, and is on disk before it takes the place, so
    a crash leaves no half a file either. Its name is random and it is new, so that neither another writer nor a link
    that somebody has put there is met. The umask gives its permissions.
    """
    temporary = target.with_name(f".{secrets.token_hex(16)}{target.suffix}")
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    try:
        yield temporary
        with temporary.open("r+b") as file:
            os.fsync(file.fileno())
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Writes `content` to `path` so that a reader, or a crash, never meets half a file.

    Args:
        path: Where to write; a file already there is replaced, missing folders are made.
        content: The file's content.

    Raises:
        OSError: If the file cannot be written; what stood at `path` is then still there.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: Path, data: Any) -> None:
    """Writes plain data to `path` as JSON, whole or not at all."""
    write_whole(path, (json.dumps(data, indent=2, allow_nan=False) + "\n").encode())
