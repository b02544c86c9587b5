"""Layouts in which ball 1 can be potted directly, with the number of the pocket, and environments with a layout."""

from billiards_env.envs import make_env

# Corner pockets 0, 1 at x < 0 and 2, 3 at x > 0, side pockets 4 at y < 0 and 5 at y > 0.
NAMED_POTS = {
    "straight into the corner": ([[0.4, -0.235], [0.97, 0.335]], 3),
    "straight into the side": ([[0.0, -0.3], [0.0, 0.2]], 5),
    "half-ball cut into the corner": ([[0.3, 0.0], [0.97, 0.335]], 3),
    "thin cut into the corner": ([[0.95, -0.3], [0.97, 0.4]], 3),
    "along the cushion": ([[0.2, 0.5], [0.7, 0.6064]], 3),
    "balls in contact": ([[0.97 - 2 * 0.0202, 0.335 - 2 * 0.0203], [0.97, 0.335]], 3),
    "length of the table": ([[-1.1, -0.5], [0.4, 0.2]], 3),
}


def at(positions, **kwargs):
    """Returns an environment with the balls at these positions."""
    env = make_env(**{"n_object_balls": len(positions) - 1, **kwargs})
    env.reset(options={"positions": positions})
    return env
