"""Shots from Python: `simulation` runs them, `result` holds what happened, `strikes` describes the cue.

Modules:
    simulation: `simulate` and `simulate_batch`.
    result: The result of one shot.
    gradients: Derivatives of shots, forwards and backwards.
    derivatives: The methods of results that return derivatives.
    functions: Shots as functions of arrays, for PyTorch and JAX.
    records: Shots as files.
    strikes: The motion of the cue ball after a strike.
    tables: Tables before a shot, for environments and players.
"""
