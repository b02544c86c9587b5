"""Pots by geometry, and the action "plan".

Modules:
    finder: The direct pots and the banks of many tables.
    direct, banks: The geometry of a direct pot, and of a pot off one cushion (a bank).
    indirect: Combinations, caroms and kicks.
    hits: The hit of the cue ball on an object ball, and the motion of both after it.
    paths: The path of a ball that meets no other ball.
    rims: The rim of a pocket as seen from a point.
    plans: The action "plan" of environments.
    budget: The time or the number of shots of a decision.
"""
