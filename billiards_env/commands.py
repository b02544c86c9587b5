"""How a command reads numbers, does several jobs, and ends.

An error or Ctrl-C prints one line, a closed pipe prints nothing.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import sys
import traceback
from collections.abc import Iterator, Sequence
from typing import Any

ERRORS = (ImportError, OSError, RuntimeError, TypeError, ValueError)
"""The errors of wrong input and of the system, such as a full disk. A RuntimeError comes from pygame or Ray."""


class Parser(argparse.ArgumentParser):
    """A parser that reads -2e0 and -1/60 as numbers. Argparse takes them for options, at least up to Python 3.13.

    The error of an argument of the type int says what is expected.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.register("type", int, _whole)
        self._negative_number_matcher = re.compile(r"-\.?\d")


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number") from None


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


class Job:
    """Runs jobs: `with job(name):` runs one and records its error. See `all_jobs`.

    Attributes:
        count: The number of jobs so far.
        errors: The names of those that have failed, with their errors.
    """

    def __init__(self) -> None:
        self.count, self.errors = 0, list[tuple[str, Exception]]()

    @contextlib.contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Runs a job."""
        self.count += 1
        try:
            yield
        except BrokenPipeError:  # there is no reader for the other jobs
            raise
        except Exception as error:  # the code of a player may raise any
            self.errors.append((name, error))

    @property
    def have_all_failed(self) -> bool:
        """Whether there were jobs, and all of them have failed."""
        return 0 < self.count == len(self.errors)


@contextlib.contextmanager
def all_jobs() -> Iterator[Job]:
    """Runs the jobs of a block. If a job fails, the others still run, and the block raises the errors at its end.

    Yields:
        The `Job` that runs them.

    Raises:
        RuntimeError: If jobs failed: a line for each error, with the names of up to 8 jobs. The error of the only job
            is raised itself.

    Example:
        >>> with all_jobs() as job:
        ...     for name in ("one", "two"):
        ...         with job(name):
        ...             print(name)
        one
        two
    """
    job = Job()
    yield job
    if job.count == len(job.errors) == 1:
        raise job.errors[0][1]
    names: dict[str, list[str]] = {}
    for name, error in job.errors:
        names.setdefault(error_text(error), []).append(name)
    if names:
        raise RuntimeError("\n".join(f"{_first(names[text])}: {text}" for text in names))


def _first(names: Sequence[str], most: int = 8) -> str:
    """Returns the first names as text, and the number of the others."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def error_text(error: Exception) -> str:
    """Returns the text of an error, with its type and its place unless it is one of `ERRORS`."""
    if isinstance(error, ERRORS):
        return str(error)
    where = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({where.filename}, line {where.lineno})"
