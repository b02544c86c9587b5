import pytest

from billiards_env.physics.ball_ball import pair_impulse


@pytest.mark.parametrize(
    ("inverse", "e", "after"),
    [
        ((1.0, 1.0), 1.0, (0.0, 2.0)),
        ((1.0, 1.0), 0.5, (0.5, 1.5)),
        ((1.0, 1.0), 0.0, (1.0, 1.0)),
        ((1.0, 0.0), 1.0, (-2.0, 0.0)),
        ((1.0, 0.0), 0.5, (-1.0, 0.0)),
        ((0.25, 1.0), 1.0, (1.2, 3.2)),
    ],
)
def test_the_impulse_of_a_pair_follows_masses_and_restitution(inverse, e, after):
    p = pair_impulse(2.0, inverse[0], inverse[1], e)
    assert (2.0 - p * inverse[0], p * inverse[1]) == pytest.approx(after)
