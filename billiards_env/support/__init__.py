"""What all other packages use.

Modules:
    checks: Checks of arguments, and the ranges of numbers.
    files: Files that are written whole, and checked before they are read.
    settings: Settings in YAML.
    commands: The output of commands, and their end by a signal.
    intervals: Confidence intervals.
"""
