"""The execution noise: the random difference between the chosen shot and the played one."""

EXECUTION_NOISE = {"angle_std": 0.125, "speed_std": 0.075, "offset_std": 0.0005, "elevation_std": 0.1}
"""The standard deviations of the frozen tasks with noise: the argument `noise` of `BilliardsEnv` has their source."""
