"""The playback speeds of the windows."""

PACES = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Playback speeds over real time."""


def slower(pace: float) -> float:
    """Returns the next slower pace of `PACES`, or the same if there is none."""
    return max((p for p in PACES if p < pace), default=pace)


def faster(pace: float) -> float:
    """Returns the next faster pace of `PACES`, or the same if there is none."""
    return min((p for p in PACES if p > pace), default=pace)
