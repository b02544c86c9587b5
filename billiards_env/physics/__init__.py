"""The physics as compiled functions on scalars and arrays: motion, contact times and impulses.

This package does not import the rest of the project. `state.py` defines the arrays that the functions use.
"""
