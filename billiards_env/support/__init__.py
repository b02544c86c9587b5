"""Helpers for all other packages.

Modules:
    checks: Checks of arguments, and the ranges of numbers.
    files: Writes files completely or not at all, and checks files before it reads them.
"""
