"""The execution noise: how far the shot that is played differs from the one that is chosen."""

EXECUTION_NOISE = {"angle_std": 0.125, "speed_std": 0.075, "offset_std": 0.0005, "elevation_std": 0.1}
"""The standard deviations of the frozen tasks with noise: the argument `noise` of `BilliardsEnv` has their source."""
