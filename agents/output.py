"""Tables and command lines that the programs print."""

from __future__ import annotations

import shlex
import shutil
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
    """Prints command lines that can be copied to a shell.

    Args:
        title: The line above them.
        commands: The arguments of the running Python interpreter, by a description of the command.
    """
    python = Path(sys.executable)  # by its shortest name
    if shutil.which("python") == sys.executable:
        python = Path("python")
    elif python.is_relative_to(Path.cwd()):
        python = python.relative_to(Path.cwd())
    width = max(map(len, commands))
    print(title)
    for label, words in commands.items():
        print(f"  {label:{width}}  {shlex.join((str(python), *words))}")
