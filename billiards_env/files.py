"""Files: one is written completely or not at all, and read up to a largest size."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any


def check_path(path: str | os.PathLike[str], suffix: str) -> Path:
    """Checks the path of a file to be written.

    Args:
        path: The path.
        suffix: The required suffix, such as ".gif".

    Returns:
        The path as a `Path`.

    Raises:
        ValueError: If the path has another suffix.
        FileNotFoundError: If its folder does not exist.
        IsADirectoryError: If it is a folder.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"path = {path!r}: expected a path, not {type(path).__name__}")
    target = Path(path)
    if target.suffix.lower() != suffix:
        raise ValueError(f"path = {str(target)!r}: expected a name that ends in {suffix!r}")
    _check_target(target)
    return target


def _check_target(target: Path) -> None:
    if target.is_dir():
        raise IsADirectoryError(f"path = {str(target)!r}: expected a file, this is a folder")
    if not target.parent.is_dir():
        raise FileNotFoundError(
            f"path = {str(target)!r}: expected an existing folder, the folder {str(target.parent)!r} does not exist"
        )


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Creates a temporary file next to `target` that replaces it if the block succeeds and is deleted otherwise.

    The temporary file has the suffix of `target`, because some writers choose the format by the suffix. It is flushed
    to disk before it replaces `target`, so a crash does not leave a partial file. It is a new file with a random name,
    so another writer or a prepared link cannot interfere. Its permissions follow the umask. An OSError names `target`.
    """
    _check_target(target)
    temporary = target.with_name(f".{secrets.token_hex(16)}{target.suffix}")
    try:
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        try:
            yield temporary
            with temporary.open("r+b") as file:
                os.fsync(file.fileno())
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        if str(error.filename) != str(temporary):
            raise
        raise type(error)(error.errno, error.strerror, str(target)) from error


def read_text(path: str | os.PathLike[str], most: int, what: str) -> str:
    """Returns the text of a file in UTF-8, without a byte-order mark.

    Args:
        path: The file.
        most: The largest number of bytes.
        what: What the file should hold, for the messages.

    Raises:
        OSError: If the file does not exist, is no regular file or cannot be read.
        ValueError: If the file is larger, or is not in UTF-8.
    """
    place = Path(path)
    if not place.is_file():  # reading a pipe could block forever, a device may have no end
        kind, why = OSError, "is not a regular file"
        if place.is_dir():
            kind, why = IsADirectoryError, "is a folder"
        elif not place.exists():
            kind, why = FileNotFoundError, "does not exist"
        raise kind(f"path = {os.fspath(path)!r}: expected a file of {what}, but it {why}")
    with place.open("rb") as file:
        content = file.read(most + 1)
    try:
        if len(content) > most:
            raise ValueError(f"a file of more than {most} bytes: expected at most {most}")
        return content.decode("utf-8-sig")
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from error


def write_whole(path: Path, content: bytes) -> None:
    """Writes `content` to `path` completely or not at all; replaces an existing file, and creates missing folders.

    Raises:
        OSError: If the file cannot be written; an existing file is then unchanged.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: Path, data: Any) -> None:
    """Writes plain data to `path` as JSON, completely or not at all.

    A list or mapping without nested lists or mappings takes one line.
    """
    write_whole(path, (_json(data) + "\n").encode())


def _json(data: Any, indent: str = "") -> str:
    values = data.values() if isinstance(data, dict) else data if isinstance(data, (list, tuple)) else ()
    if not any(isinstance(value, (dict, list, tuple)) for value in values):
        return json.dumps(data, allow_nan=False)
    inner = indent + "  "
    if isinstance(data, dict):
        lines = [f"{json.dumps(str(key))}: {_json(value, inner)}" for key, value in data.items()]
        return f"{{\n{inner}" + f",\n{inner}".join(lines) + f"\n{indent}}}"
    return f"[\n{inner}" + f",\n{inner}".join(_json(value, inner) for value in data) + f"\n{indent}]"
