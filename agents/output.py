"""Tables and command lines that the programs print."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table


def print_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Prints a table whose first column is aligned left and the others right."""
    table = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, show_edge=False)
    for k, name in enumerate(head):
        table.add_column(name, justify="right" if k else "left", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    print()
    Console(highlight=False).print(table)
    print()


def print_commands(title: str, commands: Mapping[str, Sequence[str]]) -> None:
    """Prints command lines.

    Args:
        title: The line above them.
        commands: The arguments of the running Python interpreter, by a description of the command.
    """
    width = max(map(len, commands))
    print(title)
    for label, words in commands.items():
        print(f"  {label:{width}}  {command_line(words)}")


def command_line(words: Sequence[str]) -> str:
    """Returns a command line that can be copied to a shell.

    Args:
        words: The arguments of the running Python interpreter.
    """
    words = [_interpreter(), *words]
    return subprocess.list2cmdline(words) if os.name == "nt" else shlex.join(words)


def _interpreter() -> str:
    """Returns the shortest name of the running interpreter: "python", a path in the current folder, or a full path."""
    if shutil.which("python") == sys.executable:
        return "python"
    path = Path(sys.executable)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else sys.executable
