"""Compilation with numba: decorators for kernels, Ctrl-C during long calls, and random streams for kernels."""

from billiards_env.jit.decorators import (
    Typed,
    allocating,
    check_kernel,
    entry_point,
    expanded,
    inlined,
    kernel,
    kernels_of,
)
from billiards_env.jit.room import room_for

__all__ = [
    "Typed",
    "allocating",
    "check_kernel",
    "entry_point",
    "expanded",
    "inlined",
    "kernel",
    "kernels_of",
    "room_for",
]
