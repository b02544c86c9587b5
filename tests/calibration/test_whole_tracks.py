"""Whole tracks, as tracking programs write them: what a calibration cuts, finds, refuses and says."""

import functools

import numpy as np
import pytest

from billiards_env.calibration import Frame, Track, calibrate, fit, stages, starts
from billiards_env.calibration.cleaning import clean, drop_clipped, lost_frames, noise_of
from billiards_env.calibration.contacts import CUSHION, find_contacts
from billiards_env.calibration.frame import fit_frame
from billiards_env.calibration.preparation import prepare
from billiards_env.calibration.tracks import with_rest
from billiards_env.support.checks import RANGES, Range
from tests.helpers.tracks import FRAME, LATE, SCENE, raw_tracks, whole_tracks

TRUTH = {name: getattr(SCENE.physics, name) for name in ("mu_slide", "mu_roll", "e_ball", "e_cushion", "mu_cushion")}


OFF = fit.with_physics(SCENE, mu_slide=0.22, mu_roll=0.011, e_ball=0.93, e_cushion=0.82, mu_cushion=0.22)


@pytest.fixture(autouse=True)
def few_guesses(monkeypatch):
    """Fits fewer times and from fewer starts than `test_calibration.py`."""
    fewer = (starts, "SIDES", (-0.35, 0.35)), (starts, "ROLLS", (0.7,)), (starts, "_EACH", 4), (stages, "_ROUNDS", 1)
    for change in fewer:
        monkeypatch.setattr(*change)


@functools.cache
def calibration():
    return calibrate(OFF, whole_tracks(), tuple(TRUTH), contacts=2)


def test_whole_shots_give_the_numbers_and_the_instants_of_the_strikes():
    for name, (low, high) in calibration().intervals.items():
        assert abs(calibration().values[name] - TRUTH[name]) < high - low < 0.2 * TRUTH[name]
    assert np.median(np.abs(calibration().strikes - LATE)) < 0.001
    assert calibration().judged.within(2, 0.005) > 0.95
    predicted = calibration().predicted
    assert predicted is not None
    assert predicted.within(2, 0.005) > 0.9
    text = str(calibration())
    assert "10 shots: rows until contact  within 5 mm" in text
    assert "2 shots that were not fitted: rows until contact" in text


def test_ranges_and_noise_for_training():
    ranges = calibration().randomize()
    assert ranges["mu_roll"] == pytest.approx(calibration().intervals["mu_roll"])
    noise = calibration().noise(calibration().velocities * 1.02)
    assert noise["angle_std"] == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < noise["speed_std"] < 0.1
    turned = calibration().velocities @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert calibration().noise(turned) == pytest.approx({"angle_std": 0.0, "speed_std": 0.0}, abs=1e-9)


def test_contacts_and_noise_are_found_without_a_model():
    assert noise_of(whole_tracks()) == pytest.approx(0.0005, rel=0.3)
    seen = [find_contacts(SCENE, with_rest(track)[0], 0) for track in whole_tracks()]
    assert sum(len(contacts) for contacts in seen) > 60
    assert sum(any(one.other == 1 for one in contacts if one.ball == 0) for contacts in seen) >= 9  # a thin hit
    rebounds = [one for contacts in seen for one in contacts if one.other == CUSHION]
    reach = np.array([1.42, 0.71]) - SCENE.balls.radius[0]
    off = [abs(abs(one.place[one.body // 2]) - reach[one.body // 2]) for one in rebounds]
    assert np.median(off) < 0.002


def test_balls_at_rest_near_each_other_have_no_contact():
    late = 2.0 + 0.02 * np.arange(6)
    places = np.concatenate(([[0.0, 0.0]], np.outer(late - 1.95, [-0.9, -0.6]), [[0.07, 0.0], [0.072, 0.0]]))
    track = Track("s", np.concatenate(([0.0], late, [0.0, 3.0])), np.repeat([0, 1], (7, 2)), places)
    shot = prepare(SCENE, track.rows(np.argsort(track.times, kind="stable")), 0.0)
    assert shot.begin > 1.5
    assert not shot.contacts


def test_a_ball_that_begins_to_move_was_hit():
    # The object ball has no row between the hit and its rebound, then it follows the cue ball.
    times = 0.02 * np.arange(21)
    before = np.array([0.728, -0.565]) + (times[:11, None] - 0.2) * [-2.45, -1.1]
    after = np.array([0.653, -0.573]) + (times[12:, None] - 0.24) * [-1.4, 0.65]
    ball = np.array([0.606, -0.644]) + (times[14:, None] - 0.28) * [-0.55, 1.25]
    places = np.concatenate((before, after, [[0.6525, -0.6402]], [[0.632, -0.678]], ball))
    rows = np.concatenate((times[:11], times[12:], [0.1, 0.24], times[14:]))
    track = Track("s", rows, np.repeat([0, 1], (20, 9)), places)
    (hit,) = [one for one in find_contacts(SCENE, with_rest(track)[0], 0) if one.other >= 0]
    assert (hit.ball, hit.other) == (0, 1)
    assert 0.2 <= hit.time <= 0.24


def test_a_slow_ball_and_an_outlier_give_no_second_hit():
    times = np.linspace(0.0, 0.98, 50)
    cue = np.outer(times - 0.3, [1.0, 0.0]) - [0.06, 0.0]
    slow = np.outer(np.maximum(times - 0.3, 0.0), [0.08, 0.0])
    still = np.tile([0.5, 0.12], (50, 1))
    still[35] += [0.0, 0.012]
    places = np.stack((np.where(times[:, None] < 0.3, cue, 0.9 * cue), slow, still), axis=1)
    track = Track("s", np.repeat(times, 3), np.tile([0, 1, 2], 50), places.reshape(-1, 2))
    assert len([one for one in find_contacts(SCENE, track, 0) if one.other == 1]) <= 1
    assert not [one for one in find_contacts(SCENE, track, 0) if one.other == 2]


def test_the_frame_is_fitted_from_rebounds_and_clipped_rows_are_left_out():
    tracks, clipped = drop_clipped(raw_tracks())
    assert clipped >= 8
    frame, give = fit_frame(SCENE, tracks, 4)
    assert frame.offset == pytest.approx(FRAME.offset, abs=0.002)
    assert frame.scale == pytest.approx(FRAME.scale, rel=0.002)
    assert abs(frame.angle) < 0.001
    assert abs(give) < 0.002
    with pytest.raises(
        ValueError, match=r"frame = 'fit': rebounds: \d+ at \+x, .*: expected 5 or more at each cushion"
    ):
        fit_frame(SCENE, tracks[:1], 4)


def without_frame(track, at):
    """Returns a track whose program did not count the frame at a time, s."""
    kept = track.rows((track.times < at - 1e-9) | (track.times > at + 0.01))
    return kept._replace(times=kept.times - 0.02 * (kept.times > at))


def test_times_of_lost_frames_are_corrected():
    tracks = [track.rows(np.argsort(track.times, kind="stable")) for track in whole_tracks()]
    assert [track.times.tolist() for track in clean(tracks)[0]] == [track.times.tolist() for track in tracks]
    # All tracks have lost one frame at the same time, and one has lost another.
    lost = [without_frame(track, 0.9) for track in tracks]
    lost[2] = without_frame(lost[2], 1.6)
    cleaned, said = clean(lost)
    assert said == [
        "frames were lost in 10 of 10 shots, 11 times in all, between 0.89 and 1.59 s: the later times are corrected"
    ]
    for track, before, after in zip(tracks, lost, cleaned, strict=True):
        true = track.times[(np.abs(track.times - 0.9) > 0.01)]
        true = true[np.abs(true - 1.62) > 0.01] if track is tracks[2] else true
        assert len(true) == len(before.times)
        assert np.mean(np.abs(after.times - true) < 1e-9) > 0.98  # rows in the same step are ambiguous
    assert any("frames were lost" in text for text in calibrate(SCENE, lost[1:3], ["mu_roll"], contacts=2).warnings)


def test_a_jump_of_one_ball_is_no_lost_frame():
    # Two balls follow each other, and their names are exchanged once.
    times = np.linspace(0.0, 1.58, 80)
    first = np.outer(times, [0.6, 0.1])
    second = first - 3.0 * (first[1] - first[0])
    first[40:], second[40:] = second[40:].copy(), first[40:].copy()
    rows = np.stack((first, second), axis=1) + 1e-4 * np.random.default_rng(0).standard_normal((80, 2, 2))
    track = Track("s", np.repeat(times, 2), np.tile([0, 1], 80), rows.reshape(-1, 2))
    assert lost_frames([track], 1e-4) == [[]]
    assert len(lost_frames([track.rows(track.balls == 1)], 1e-4)[0]) == 1  # one ball alone cannot show the difference


def test_a_common_loss_belongs_to_the_tracks_around_it():
    tracks = [track.rows(np.argsort(track.times, kind="stable")) for track in whole_tracks()[:6]]
    lost = [without_frame(track, 0.9) for track in tracks]
    lost[0] = lost[0].rows(lost[0].times < 0.8)
    lost[1] = lost[1]._replace(times=lost[1].times + 100.0)
    found = lost_frames(lost, 0.0005)
    assert found[0] == []
    assert [len(each) for each in found[2:]] == [1, 1, 1, 1]
    assert all(one.time > 99.0 for one in found[1])


def test_a_ball_without_rows_rests_where_it_was():
    track = Track("", np.array([0.0, 0.02, 0.04, 0.0, 0.52, 0.54]), np.array([0, 0, 0, 1, 1, 1]), np.zeros((6, 2)))
    track.positions[3:, 0] = 0.5, 0.52, 0.56
    filled, added = with_rest(track)
    rest = filled.rows(added & (filled.balls == 1))
    assert len(rest.times) > 2
    assert rest.times.max() < 0.51
    assert (rest.positions == [0.5, 0.0]).all()


def test_random_starts_find_a_minimum_that_the_guesses_miss(monkeypatch):
    monkeypatch.setattr(starts, "_EACH", 16)
    shot = prepare(SCENE, whole_tracks()[3], 0.0005).wide(3)
    found = starts.search(SCENE, shot)
    assert np.abs(starts.errors(SCENE, found)[found.used]).max() < 0.004


def test_one_far_row_never_ends_a_track():
    shot = prepare(SCENE, whole_tracks()[0], 0.0005)
    far = np.zeros(len(shot.time), np.bool_)
    rows = np.flatnonzero(shot.track.balls == 0)
    far[rows[[3, 8, 9, 20]]] = True
    assert stages.leaves_at(shot, far) == (np.inf, -1)
    far[rows[30:33]] = True
    assert stages.leaves_at(shot, far) == (shot.time[rows[30]], 0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, p: (t, 1.1 * p), r"shot s\d+, ball \d: \d+ rows up to 0.\d+ m beyond the cushion: expected metres"),
        (
            lambda t, p: (t, p[:, ::-1]),
            r"table, 2.84 x 1.42 m, with x along its length \(are x and y exchan",
        ),
        (lambda t, p: (t, 0.985 * p), r"balls turn 0.0\d+ m short of the cushion at [+-][xy]: expected metres"),
        (lambda t, p: (50.0 * t, p), r"m at .* m/s or less: expected a way that a ball can roll"),
        (lambda t, p: (t / 50.0, p), r"m/s: expected at most 20, and times in seconds"),
    ],
)
def test_a_file_that_does_not_lie_on_the_table_is_refused(change, message):
    shot_tracks = []
    for track in whole_tracks():
        times, positions = change(track.times, track.positions)
        shot_tracks.append(Track(track.name, times, track.balls, positions))
    with pytest.raises(ValueError, match=message):
        calibrate(OFF, shot_tracks, tuple(TRUTH))


def test_a_frame_may_be_given():
    raw = [track._replace(positions=track.positions * 1000.0) for track in whole_tracks()[:2]]
    result = calibrate(SCENE, raw, ("mu_slide",), frame=Frame((0.0, 0.0), (1e-3, 1e-3)), contacts=2)
    assert result.values["mu_slide"] == pytest.approx(0.2, abs=0.01)


def test_an_interval_includes_a_shift_between_stages():
    spread = np.diag([1e-6])
    for value, variance, expected in ((0.21, 1.2e-6, 1e-4), (0.205, 9e-6, 0.0)):
        earlier = {"mu_slide": (value, variance)}, {"mu_slide": (0.3, 1e-6)}  # the last one does not count
        one = fit.Fit(SCENE, ("mu_slide",), SCENE, [], {}, spread, earlier)
        assert fit.unexplained_shifts(one, spread) == pytest.approx([expected])


def test_undetermined_numbers_keep_their_start_and_others_stay_at_a_bound(monkeypatch):
    result = calibrate(OFF, whole_tracks()[:3], ("mu_slide", "mu_ball_factor"), contacts=2)
    assert result.kept == {"mu_ball_factor": "the rows do not determine it"}
    assert "mu_ball_factor  1" in str(result)
    monkeypatch.setitem(RANGES, "restitution", Range(0.0, 0.94))  # e_ball is 0.95
    result = calibrate(fit.with_physics(SCENE, e_ball=0.92), whole_tracks()[:3], ("mu_slide", "e_ball"), contacts=2)
    assert result.kept == {"e_ball": "it ends at the bound 0.94 of its range"}
    assert result.scene.physics.e_ball == 0.94


def test_there_are_no_numbers_if_few_rows_fit(monkeypatch):
    monkeypatch.setattr(stages, "_FAR", 0.01)
    result = calibrate(OFF, whole_tracks()[:2], ("mu_slide",), contacts=2)
    assert result.values == {}
    assert result.scene == OFF
    assert "warning: only " in str(result)
