"""The cue ball is the ball that moves first, whatever its number is."""

import functools

import numpy as np
import pytest

from benchmarks.real_tracks import judge_simulated
from billiards_env import Scene, simulate
from billiards_env.calibration import Frame, Track, calibrate, observed, stages, starts
from billiards_env.calibration.cleaning import drop_clipped
from billiards_env.calibration.fit import with_physics
from billiards_env.calibration.preparation import prepare
from billiards_env.calibration.tracks import first_balls

SCENE = Scene.named("carom", 1)
OFF = with_physics(SCENE, mu_slide=0.22, e_cushion=0.82)
FREE = ("mu_slide", "e_cushion")
STRIKES = (
    ([[-0.7, 0.1], [0.3, 0.25]], [2.5, 0.42], [-10.0, 60.0, 20.0]),
    ([[0.5, -0.4], [-0.4, 0.2]], [-2.0, 1.38], [-20.0, -40.0, 0.0]),
    ([[0.9, 0.3], [0.1, -0.3]], [-1.5, -1.0], [10.0, -30.0, -30.0]),
)


@pytest.fixture(autouse=True)
def few_guesses(monkeypatch):
    for change in ((starts, "SIDES", (-0.35, 0.35)), (starts, "_EACH", 4), (stages, "_ROUNDS", 1)):
        monkeypatch.setattr(*change)


@functools.cache
def shots():
    return [simulate(SCENE, places, v, spins=w, record=True) for places, v, w in STRIKES]


def tracks(noise=0.001):
    """Returns the tracks of two seconds, the first 0.1 s of them at rest."""
    frames = np.arange(60) / 30
    return [
        (track := observed(f"{k}", shot, np.maximum(frames - 0.1, 0.0), noise, seed=k))._replace(
            times=np.repeat(frames, 2)[: len(track.times)]
        )
        for k, shot in enumerate(shots())
    ]


def fitted(shot_tracks, **options):
    return calibrate(OFF, shot_tracks, FREE, contacts=2, **options)


@functools.cache
def usual():
    return fitted(tracks())


def renamed(track):
    return track._replace(balls=1 - track.balls)


def listed_in_reverse(track):
    return renamed(track).rows(slice(None, None, -1))


@pytest.mark.parametrize("change", [renamed, listed_in_reverse])
def test_the_fit_does_not_depend_on_the_names_of_the_balls(change):
    """Only the order of sums differs: the measured differences are 1e-8 at most."""
    result = fitted([change(track) for track in tracks()])
    assert result.cue_balls == [1, 1, 1]
    assert result.to_dict()["cue_balls"] == result.cue_balls
    assert result.problems == usual().problems == []
    assert result.values == pytest.approx(usual().values, rel=1e-6)
    for name, ends in usual().intervals.items():
        assert result.intervals[name] == pytest.approx(ends, rel=1e-6)
    assert result.positions[:, ::-1] == pytest.approx(usual().positions, abs=1e-6)
    assert result.velocities == pytest.approx(usual().velocities, rel=1e-6)
    assert result.spins == pytest.approx(usual().spins, rel=1e-6)
    assert result.strikes == pytest.approx(usual().strikes, abs=1e-6)
    for name, figure in usual().judged.to_dict().items():
        assert result.judged.to_dict()[name] == (None if figure is None else pytest.approx(figure, rel=1e-4))
    assert judge_simulated(result, None).median(1) < 0.002
    assert result.shot(0).at(1.0)[::-1] == pytest.approx(usual().shot(0).at(1.0), abs=1e-6)


@pytest.mark.parametrize(("x", "y"), [(1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])
def test_the_fit_of_mirrored_and_turned_tracks_has_the_same_bits(x, y):
    result = fitted([track._replace(positions=track.positions * (x, y)) for track in tracks()])
    assert result.values == usual().values
    assert np.array_equal(result.covariance, usual().covariance)
    assert np.array_equal(result.positions, usual().positions * (x, y))
    assert np.array_equal(result.velocities, usual().velocities * (x, y))
    assert np.array_equal(result.spins, usual().spins * (y, x, x * y))


def test_the_fit_does_not_depend_on_the_angle_of_the_camera():
    """The frame turns the rows back with a rounding error."""
    cos, sin = np.cos(0.3), np.sin(0.3)
    turned = [track._replace(positions=track.positions @ [[cos, sin], [-sin, cos]]) for track in tracks()]
    result = fitted(turned, frame=Frame(angle=0.3))
    assert result.values == pytest.approx(usual().values, rel=1e-6)
    assert result.velocities == pytest.approx(usual().velocities, rel=1e-6)


def lanes(*starts, n=12):
    """Returns a track of balls at 20 Hz in parallel lanes. Each begins to move at a time, s, with 1 m/s."""
    times = np.linspace(0.0, 0.05 * (n - 1), n)
    places = np.zeros((n, len(starts), 2))
    places[..., 0] = np.maximum(times[:, None] - np.array(starts), 0.0)
    places[..., 1] = 0.1 * np.arange(len(starts))
    return Track("a", np.repeat(times, len(starts)), np.tile(np.arange(len(starts)), n), places.reshape(-1, 2))


def test_a_ball_at_rest_at_the_border_is_not_clipped():
    track = lanes(np.inf, 0.0)
    track.positions[track.balls == 0] = 0.9, 0.5
    track.positions[track.balls == 1, 1] = 0.3 * track.times[track.balls == 1]
    kept, clipped = drop_clipped([track])
    assert clipped == 0
    assert prepare(SCENE, kept[0], 0.0).cue_ball == 1


def test_the_balls_that_move_first():
    assert first_balls(lanes(0.2, 0.1), 0.0) == [1]
    assert first_balls(lanes(0.2, 0.3, 0.0), 0.0) == [2]
    outlier = lanes(0.2, np.inf)
    outlier.positions[3] += 0.1  # one row does not move a ball
    assert first_balls(outlier, 0.0) == [0]
    three = Scene.named("carom", 2)
    swapped = lanes(np.inf, 0.3, np.inf)
    swapped.balls[swapped.times > 0.12] = np.array([0, 2, 1])[swapped.balls[swapped.times > 0.12]]
    shot = prepare(three, swapped, 0.0)
    assert shot.cue_ball == 1
    assert shot.exchanged[:2] == (1, 2)


def test_shots_without_one_first_ball_are_refused_or_named():
    for starts_of, message in (
        ((np.inf, np.inf), r"shots\['a'\]: no ball moves: expected one that was struck"),
        ((0.3, 0.0, 0.0), r"shots\['a'\]: balls \[1, 2\] begin to move in one frame: expected one, or ball 0 too"),
    ):
        with pytest.raises(ValueError, match=message):
            calibrate(Scene.named("carom", 2), [lanes(*starts_of)], ["mu_roll"])
    few = lanes(0.1, 0.3)
    with pytest.raises(ValueError, match=r"shots\['a'\]: 3 rows of the cue ball, ball 0: expected 4 or more"):
        calibrate(SCENE, [few.rows((few.balls == 1) | np.isin(few.times, few.times[[2, 8, 10]]))], ["mu_roll"])
    both = tracks()
    both[0].positions[both[0].balls == 1] += np.outer(np.arange(60) / 30 > 0.11, [0.01, 0.0])
    assert fitted(both).warnings[0] == "shot 0: balls [0, 1] begin to move in one frame, ball 0 counts as the cue ball"
