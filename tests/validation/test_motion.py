"""Balls slow down on the cloth as measured."""

import pytest

from benchmarks.validation import motion
from billiards_env.scene import Scene


@pytest.mark.parametrize("phase", motion.MEASURED)
def test_a_snooker_ball_slows_down_as_measured(phase):
    least, most = motion.MEASURED[phase]
    assert least <= motion.decelerations(Scene.named("snooker", 2))[phase] <= most
