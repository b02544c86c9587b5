"""Players that need no training, such as search, aim and the planner.

Modules:
    batch: Simulates and judges many shots from one position.
    situation: What a player gets, and the situation in a game.
    strategies: The players random, geometric, search and aim.
    aim: The velocity that reaches goals, by Gauss-Newton steps.
    env_player: Players in `Billiards-v0`.
    planner: The player that plans under execution noise.
    candidates: The shots among which the planner chooses.
    values: The value of the outcomes of shots.
    hints: What the players use of the rules of a game.
    run_outs: The probability of a run-out from a position, by a small network.
    levels: Levels of strength of the planner, by noise and budget.
    named: The table of the players, found by name.
"""
