"""Files that are written whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any


def write_whole(path: Path, content: bytes) -> None:
    """Writes `content` to `path` so that a reader, or a crash, never meets half a file.

    Args:
        path: Where to write; a file already there is replaced, missing folders are made.
        content: The file's content.

    Raises:
        OSError: If the file cannot be written; what stood at `path` is then still there.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: Path, data: Any) -> None:
    """Writes plain data to `path` as JSON, whole or not at all."""
    write_whole(path, (json.dumps(data, indent=2, allow_nan=False) + "\n").encode())
