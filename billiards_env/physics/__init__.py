"""The physics as compiled functions on scalars and arrays: motion, contact times and impulses.

Nothing in here knows of scenes, environments or files; the arrays it works on are laid out in `state.py`.
"""
