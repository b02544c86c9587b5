"""Compares the bits of this machine with those of other processors and compilers: `python -m benchmarks.machines`.

Modules:
    work: The work whose results are compared.
    record: Records calls of compiled functions, and compiles the functions for another processor.
    replay: Runs recorded calls on another processor, with `replay.c`.
    __main__: The parts of the comparison and the command.
"""

from __future__ import annotations

from typing import Any

from benchmarks import rows_table


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name: `rows`, and `left out`, the functions that no work calls."""
    columns = {"machine": "{machine}", "compared": "{compared}", "other bits": "{other:,}"}
    left = "\n".join(f"- `{name}`" for name in result["left_out"])
    return {"rows": rows_table(columns, result["rows"], left=2), "left out": left or "Nothing."}
