"""Shots from Python: `simulation` runs them, `result` holds what happened.

Modules:
    simulation: `simulate` and `simulate_batch`.
    result: The result of one shot.
    functions: Shots as functions of arrays, for PyTorch and JAX.
    records: Shots as files.
    noise: The execution noise of the frozen tasks.
    tables: Tables before a shot, for environments and players.
"""
