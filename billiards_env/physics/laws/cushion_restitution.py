"""The impact on a cushion without friction: the normal velocity is reversed and multiplied by the restitution."""

from billiards_env.physics.laws.cushion import Cushion
from billiards_env.physics.laws.cushion_han2005 import han2005

CUSHION = Cushion(han2005)
"""Without friction, `physics.ball_cushion` calls only `cushion_restitution`, never the law of this entry."""
