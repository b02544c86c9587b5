"""Writes files completely or not at all, and reads files up to a largest size.

All files from a user are read through `read_bytes`. Whatever a file holds, an error is an OSError or a ValueError, and
nothing in it runs as code.
"""

from __future__ import annotations

import contextlib
import gzip
import importlib.util
import io
import itertools
import json
import os
import secrets
import shutil
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.support.checks import missing

_EXTRAS = {
    **dict.fromkeys((".png", ".svg", ".pdf"), ("plot", "matplotlib")),
    ".gif": ("render", "pygame", "PIL"),
    ".mp4": ("render", "pygame", "imageio_ffmpeg"),
    ".onnx": ("onnx", "onnx", "onnxscript"),
}
"""The extra that writes a file and its modules, by suffix."""

MAX_ARCHIVE = 2**28
"""The largest number of bytes of a zip file that is read, and of its content."""


def check_path(path: str | os.PathLike[str], *suffixes: str) -> Path:
    """Checks the path of a file to be written, before the work whose result it will hold.

    Args:
        path: The path.
        suffixes: The allowed suffixes, such as ".gif"; none for any.

    Returns:
        The path as a `Path`.

    Raises:
        TypeError: If it is not a path.
        ValueError: If the path has another suffix.
        OSError: If the file cannot be written, see `_end_of`.
        ModuleNotFoundError: If a module that writes files with this suffix is not installed.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"path = {path!r}: expected a path, not {type(path).__name__}")
    target = Path(path)
    if suffixes and target.suffix.lower() not in suffixes:
        raise ValueError(f"path = {str(target)!r}: expected a name that ends in {' or '.join(map(repr, suffixes))}")
    _end_of(target)
    extra, *modules = _EXTRAS.get(target.suffix.lower(), ("",))
    for module in modules:
        if importlib.util.find_spec(module) is None:
            raise missing(module, extra)
    return target


def _end_of(target: Path) -> Path:
    """Returns the file that a path names: the end of its links. It may not exist yet.

    Raises:
        FileNotFoundError: If its folder does not exist.
        IsADirectoryError: If it is a folder.
        PermissionError: If the file or its folder is read-only.
        OSError: If it exists and is no regular file, such as a device, or the path is impossible.
    """
    end, expected = Path(os.path.realpath(target)), f"path = {str(target)!r}: expected"
    with contextlib.suppress(FileNotFoundError):
        mode = target.stat().st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(f"{expected} a file, not a folder")
        if not stat.S_ISREG(mode):
            raise OSError(f"{expected} a regular file, this is a device, a pipe or a socket")
        if not os.access(end, os.W_OK):
            raise PermissionError(f"{expected} a file that can be written, it is read-only")
    if not end.parent.is_dir():
        raise FileNotFoundError(f"{expected} an existing folder, the folder {str(target.parent)!r} does not exist")
    if not os.access(end.parent, os.W_OK):
        raise PermissionError(f"{expected} a folder that can be written, {str(target.parent)!r} is read-only")
    return end


def free_path(path: Path) -> Path:
    """Returns a path at which there is no file: the given one, or one with a number."""
    numbered = (path.with_stem(f"{path.stem}-{k}") for k in itertools.count(2))
    return next(one for one in itertools.chain((path,), numbered) if not one.exists())


@contextlib.contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Creates a temporary file that replaces the file `target` if the block succeeds and is deleted otherwise.

    Everything that the package writes is written in this way. A link is followed: the file at its end is replaced. A
    target that exists and is not a regular file is an error. The temporary file is in the same folder and has the
    suffix of `target`, because some writers choose the format by the suffix. It is flushed to disk before it replaces
    the file, so a crash does not leave a partial file. It is a new file with a random name, so another writer or a
    prepared link cannot interfere. Its permissions are those of the file that it replaces, or follow the umask. An
    OSError names `target`.
    """
    end = _end_of(target)
    temporary = end.with_name(f".{secrets.token_hex(16)}{target.suffix}")
    try:
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        try:
            yield temporary
            with temporary.open("r+b") as file:
                os.fsync(file.fileno())
            if end.exists():
                shutil.copymode(end, temporary)
            os.replace(temporary, end)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        if error.errno is None or str(error.filename) not in ("None", str(temporary)):
            raise
        raise type(error)(error.errno, error.strerror, str(target)) from error


def read_bytes(path: str | os.PathLike[str], most: int, what: str) -> bytes:
    """Returns the content of a file.

    Args:
        path: The file.
        most: The largest number of bytes.
        what: What the file should hold, for the messages.

    Raises:
        OSError: If the file does not exist, is no regular file or cannot be read.
        ValueError: If the file is larger.
    """
    place = Path(path)
    if not place.is_file():  # reading a pipe could block forever, a device may have no end
        kind, why = OSError, "is not a regular file"
        if place.is_dir():
            kind, why = IsADirectoryError, "is a folder"
        elif not place.exists():
            kind, why = FileNotFoundError, "does not exist"
        raise kind(f"path = {os.fspath(path)!r}: expected a file of {what}, but it {why}")
    size, content = place.stat().st_size, bytearray()
    if size <= most:
        with place.open("rb") as file:  # it may grow, and some files of the system have the size 0
            while len(content) <= most and (part := file.read(2**20)):
                content += part
    with refusing(path, what):
        _check_size(max(size, len(content)), most)
    return bytes(content)


@contextlib.contextmanager
def refusing(path: str | os.PathLike[str], what: str) -> Iterator[None]:
    """Turns the exceptions of a block that reads the content of a file into a ValueError that names the file.

    The libraries that read damaged content raise many types, such as `zlib.error`, `EOFError` and `MemoryError`.
    """
    try:
        yield
    except Exception as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"path = {os.fspath(path)!r}: expected a file of {what} ({why})") from error


def read_text(path: str | os.PathLike[str], most: int, what: str) -> str:
    """Returns the text of a file in UTF-8, without a byte-order mark. A file ".gz" is unpacked.

    Args:
        path: The file.
        most: The largest number of bytes, also unpacked.
        what: What the file should hold, for the messages.

    Raises:
        OSError: As `read_bytes` does.
        ValueError: If the file is larger, is not in UTF-8, or is damaged.
    """
    content = read_bytes(path, most, what)
    with refusing(path, what):
        if Path(path).suffix == ".gz":
            content = gzip.GzipFile(fileobj=io.BytesIO(content)).read(most + 1)
            _check_size(len(content), most)
        return content.decode("utf-8-sig")


def read_arrays(path: str | os.PathLike[str], what: str) -> dict[str, NDArray[Any]]:
    """Returns the arrays of a file of `numpy.savez`, by name.

    Args:
        path: The file.
        what: What the file should hold, for the messages.

    Raises:
        OSError: As `read_bytes` does.
        ValueError: If the file or its content is larger than `MAX_ARCHIVE`, is damaged, or holds Python objects.
    """
    content = read_bytes(path, MAX_ARCHIVE, what)
    with refusing(path, what):
        return {
            name.removesuffix(".npy"): np.lib.format.read_array(io.BytesIO(member), allow_pickle=False)
            for name, member in unzipped(content).items()
        }


def unzipped(content: bytes) -> dict[str, bytes]:
    """Returns the files in a zip file, by name. Each has the right checksum, and all have at most `MAX_ARCHIVE` bytes.

    Raises:
        Exception: If the zip file is damaged, see `refusing`.
    """
    members, size = {}, 0
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for entry in archive.infolist():
            if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # the others unpack without limit
                raise ValueError(f"{entry.filename} has another compression than deflate")
            with archive.open(entry) as file:
                member = members[entry.filename] = file.read(MAX_ARCHIVE - size + 1)
            size += len(member)
            _check_size(size, MAX_ARCHIVE)
            if len(member) != entry.file_size:
                raise ValueError(f"{entry.filename} has {len(member)} bytes, not {entry.file_size}")
    return members


def _check_size(size: int, most: int) -> None:
    if size > most:
        raise ValueError(f"it is a file of more than {most} bytes")


def write_atomically(path: Path, content: bytes) -> None:
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
    write_atomically(path, (_json(data) + "\n").encode())


def _json(data: Any, indent: str = "") -> str:
    values = data.values() if isinstance(data, dict) else data if isinstance(data, (list, tuple)) else ()
    if not any(isinstance(value, (dict, list, tuple)) for value in values):
        return json.dumps(data, allow_nan=False)
    inner = indent + "  "
    if isinstance(data, dict):
        lines = [f"{json.dumps(str(key))}: {_json(value, inner)}" for key, value in data.items()]
        return f"{{\n{inner}" + f",\n{inner}".join(lines) + f"\n{indent}}}"
    return f"[\n{inner}" + f",\n{inner}".join(_json(value, inner) for value in data) + f"\n{indent}]"
