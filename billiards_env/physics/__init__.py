"""The physics as compiled functions on scalars and arrays: motion, contact times and impulses.

Modules:
    laws: The laws, one file each.
    state: The arrays that the functions use.
    motion: The motion of balls.
    ball_ball, clusters: Impacts of balls, alone and at one instant.
    ball_cushion: Impacts on cushions.
    strike: The cue.
    scatter: Random differences between impacts on cushions.
    geometry: Contact times, cushions and roots.
    elementary, double_double: Arithmetic.

This package imports only `jit` and, for the names of the laws and their numbers, `scene`.
"""
