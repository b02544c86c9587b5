"""Compilation with numba: decorators for kernels, Ctrl-C during long calls, and random streams for kernels."""

from billiards_env.jit.decorators import (
    Typed,
    allocating,
    allocating_entry_point,
    entry_point,
    expanded,
    inlined,
    kernel,
    kernels_of,
    specialised,
)

__all__ = [
    "Typed",
    "allocating",
    "allocating_entry_point",
    "entry_point",
    "expanded",
    "inlined",
    "kernel",
    "kernels_of",
    "specialised",
]
