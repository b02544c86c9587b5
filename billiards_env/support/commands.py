"""How a command reads numbers, and how it ends: an error or Ctrl-C prints one line, a closed pipe prints nothing."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import sys
from collections.abc import Iterator
from typing import Any

ERRORS = (ImportError, OSError, RuntimeError, TypeError, ValueError)
"""The errors of wrong input and of the system, such as a full disk. A RuntimeError comes from pygame or Ray."""


class Parser(argparse.ArgumentParser):
    """A parser that reads -2e0 and -1/60 as numbers. Argparse takes them for options, at least up to Python 3.13."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._negative_number_matcher = re.compile(r"-\.?\d")


@contextlib.contextmanager
def ending(resumes: str = "") -> Iterator[None]:
    """Ends the command that runs in the block with one line if it fails or is interrupted.

    The exit status is 1 after one of `ERRORS`, 130 after Ctrl-C, and 141 if the reader of the output has closed its
    pipe, as `head` does.

    Args:
        resumes: The end of the line after Ctrl-C, such as "the same command resumes".
    """
    try:
        yield
        sys.stdout.flush()
    except KeyboardInterrupt:
        print(f"\ninterrupted{'; ' if resumes else ''}{resumes}", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes it at its end
        sys.exit(141)
    except ERRORS as error:
        sys.exit(f"error: {error}")
