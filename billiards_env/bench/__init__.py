"""The frozen tasks, and how good players are in tasks.

Modules:
    frozen: The frozen tasks.
    evaluation: Players in an environment: mean returns with intervals.
    benchmark: The benchmark of players in the frozen tasks, `billiards bench`.
"""
