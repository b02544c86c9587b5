"""Players that need no training: random, geometric and search.

Modules:
    strategies: How each of them chooses a shot.
    pots: Direct pots, which the geometric and the search player start from.
    env_player: The strategies in `Billiards-v0`.
    game_player: The strategies in games, and other programs that play games, found by name.
"""
