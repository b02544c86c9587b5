"""Shots from Python: `simulation` runs them, `result` holds what happened.

Modules:
    simulation: `simulate` and `simulate_batch`.
    result: The result of one shot.
    records: Shots as files.
    noise: The execution noise of the frozen tasks.
    tables: Tables before a shot, for environments and players.
"""
