"""Certain events agree with exact arithmetic, and doubtful events are not certain."""

import pytest

from billiards_env import Scene, simulate
from reference.oracle import run

IDEAL = Scene.named("ideal")
REACH = 2 * IDEAL.balls.radius[0]


@pytest.mark.parametrize(
    ("gap", "certain"), [(0.0, False), (1e-13, False), (-1e-13, False), (1e-9, True), (-1e-9, True)]
)
def test_a_ball_that_barely_passes_is_not_certain(gap, certain):
    shot = simulate(IDEAL, [[-0.5, REACH + gap], [0.0, 0.0]], [1.0, 0.0], record=True, max_time=0.9)
    assert shot.certain().outcome == certain


def test_a_doubt_grows_with_the_impacts_before_it():
    scene = Scene.named("ideal", 3)
    start = [[-0.9, 0.0], [-0.8, 0.04], [-0.6, -0.3], [0.6, 0.3]]
    shot = simulate(scene, start, [1.0, 0.0], record=True, max_time=8.0)
    assert shot.events is not None
    found, impacts = shot.certain(), (shot.events["kind"] == "ball_ball").sum()
    assert impacts >= 4
    assert 0 < found.events <= shot.n_events
    whole = simulate(scene, start, [1.0, 0.0], record=True, max_time=200.0, max_events=400)
    certain = whole.certain()
    assert found.events <= certain.events < whole.n_events  # later the errors are as large as the table
    assert not certain.outcome
    assert whole.events is not None
    ours, until = whole.events[: certain.events], whole.events["time"][[certain.events - 1, certain.events]].mean()
    exact = run(scene, start, [1.0, 0.0], max_time=float(until))
    assert [(e.kind, e.ball, e.other) for e in exact.events] == ours[["kind", "ball", "other"]].tolist()


def test_contacts_at_one_time_have_no_certain_order():
    scene = Scene.named("ideal", 2)
    start = [[-1.0, 0.0], [0.5, 0.2], [0.5, -0.2]]
    for second, certain in (([1.0, 0.0], False), ([1.01, 0.0], True)):
        velocities = [[0.0, 0.0], [1.0, 0.0], second]
        shot = simulate(scene, start, velocities, record=True, max_time=1.0)
        assert shot.certain().outcome == certain
        assert shot.certain().events == (2 if certain else 0)
