"""The source archive and the wheel: `python -m benchmarks.release.dist`.

Modules:
    dist: Builds both, installs the wheel in an empty virtual environment, and measures the first step there.
    shots: Plays the common environments, to compile their kernels and to compare results.
"""
