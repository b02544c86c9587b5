"""Players that need no training: random, geometric and search.

Modules:
    situation: What a player gets, and the situation in a game.
    strategies: The players random, geometric, search and aim.
    pots: Pots by geometry on many tables, for the geometric and the search player.
    aim: The velocity that reaches goals, by Gauss-Newton steps.
    direct, banks: The geometry of a direct pot, and of a pot off one cushion (a bank).
    indirect: Combinations, caroms and kicks by geometry.
    hits: The hit of the cue ball on an object ball, and the motion of both after it.
    paths: The path of a ball that meets no other ball.
    env_player: Players in `Billiards-v0`.
    planner: The player that plans under execution noise.
    candidates: The shots among which the planner chooses.
    values: The value of the outcomes of shots.
    run_outs: The probability of a run-out from a position, by a small network.
    budget: The time or the number of shots of a decision.
    levels: Levels of strength of the planner, by noise and budget.
    named: The table of the players, found by name.
"""
