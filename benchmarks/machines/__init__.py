"""Compares the bits of this machine with those of other processors and compilers: `python -m benchmarks.machines`.

Modules:
    work: The work whose results are compared.
    record: Records calls of compiled functions, and compiles the functions for another processor.
    replay: Runs recorded calls on another processor, with `replay.c`.
    __main__: The parts of the comparison and the command.
"""
