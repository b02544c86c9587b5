"""The impact of two balls without friction."""

from billiards_env.physics.laws.balls import BallLaw, constant_restitution

BALLS = BallLaw(constant_restitution)
