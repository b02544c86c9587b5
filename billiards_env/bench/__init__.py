"""The frozen tasks, and measurements of players.

Modules:
    frozen: The frozen tasks.
    published: The hashes of their published results.
    match: Games between players, and their ratings, `billiards match`.
    evaluation: Players in an environment: mean returns with intervals.
    benchmark: The benchmark of players in the frozen tasks, `billiards bench`.
"""
