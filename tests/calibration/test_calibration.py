"""Calibration recovers the numbers of simulated tracks and of pooltool, and reports what does not fit."""

import functools
import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.__main__ import main
from billiards_env.calibration import Track, calibrate, example, observed, write_tracks
from billiards_env.calibration.contacts import find_exchange
from billiards_env.calibration.fit import reduced, with_physics
from billiards_env.calibration.preparation import PLACES, SPIN, VELOCITY, prepare
from billiards_env.calibration.starts import allowed, settle
from billiards_env.scene import check_positions, layouts

SCENE = Scene.named("carom", 1)
FRAMES = np.arange(60) / 30
STRIKES = (
    ([[-0.7, 0.1], [0.3, 0.25]], [2.5, 0.42], [-10.0, 60.0, 20.0]),
    ([[0.5, -0.4], [-0.4, 0.2]], [-2.0, 1.38], [-20.0, -40.0, 0.0]),
    ([[0.9, 0.3], [0.1, -0.3]], [-1.5, -1.0], [10.0, -30.0, -30.0]),
    ([[-0.9, -0.3], [0.9, 0.4]], [2.4, -1.5], [30.0, 40.0, 30.0]),
)
FREE = ("mu_slide", "mu_roll", "e_ball", "e_cushion")
TRUTH = {name: getattr(SCENE.physics, name) for name in FREE}


OFF = with_physics(SCENE, mu_slide=0.22, mu_roll=0.011, e_ball=0.93, e_cushion=0.81)


@functools.cache
def shots():
    return [simulate(SCENE, places, v, spins=w, record=True) for places, v, w in STRIKES]


def tracks(noise=0.002):
    return [observed(f"{k}", shot, FRAMES, noise, seed=k) for k, shot in enumerate(shots())]


@functools.cache
def calibration():
    return calibrate(OFF, tracks(), FREE)


def test_tracks_with_noise_give_the_numbers_within_their_intervals():
    result = calibration()
    assert result.problems == []
    assert result.start == {name: getattr(OFF.physics, name) for name in FREE}
    for name, (low, high) in result.intervals.items():
        half = (high - low) / 2
        assert abs(result.values[name] - TRUTH[name]) < 2 * half < 0.2 * TRUTH[name]
        assert result.values[name] == getattr(result.scene.physics, name) == pytest.approx((low + high) / 2)
    assert result.row_noise == pytest.approx(0.002, rel=0.1)
    assert result.rms == pytest.approx([0.002] * 4, rel=0.2)
    errors = np.sqrt(np.diag(result.covariance)) * 1.96
    assert errors == pytest.approx([(high - low) / 2 for low, high in result.intervals.values()], rel=0.01)


def test_exact_tracks_give_the_numbers_and_the_starts():
    """The priors change them a little."""
    result = calibrate(OFF, tracks(0.0), FREE)
    assert result.values == pytest.approx(TRUTH, rel=1e-3)
    assert result.positions == pytest.approx(np.array([places for places, _, _ in STRIKES]), abs=5e-4)
    assert result.velocities == pytest.approx(np.array([v for _, v, _ in STRIKES]), abs=0.01)
    again = result.shot(0)
    assert again.at(1.0) == pytest.approx(shots()[0].at(1.0), abs=1e-3)


def test_the_slope_is_that_of_the_loss_with_fitted_starts():
    names, numbers, step = ("mu_roll", "e_cushion"), np.array([0.0101, 0.849]), 1e-6
    for track, (places, v, w) in zip(tracks(1e-5), STRIKES, strict=True):
        shot, start = prepare(SCENE, track, 0.002), np.array([[*np.ravel(places), *v, *w, 0.0]])

        def settled(at, shot=shot, start=start):
            return settle(with_physics(SCENE, **dict(zip(names, at.tolist(), strict=True))), start, shot, names, 100)[1]

        slope, _, _ = reduced(settled(numbers), start.size)
        for k in range(2):
            change = step * np.eye(2)[k]
            difference = (settled(numbers + change).loss - settled(numbers - change).loss) / (2 * step)
            assert 2 * slope[k] == pytest.approx(difference[0], rel=1e-2, abs=1e-2)


def free_shot(scene, known=None):
    track = Track("", np.array([0.0, 0.0, 1.0]), np.array([0, 1, 0]), np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]))
    return prepare(scene, track, 0.002, known)


def test_overlapping_balls_and_balls_in_a_cushion_are_moved():
    scene = Scene.named("real_pool", 1)
    start = np.zeros((3, 10))
    start[:, PLACES] = [0.0, 0.0, 0.04, 0.0], [0.5, 0.0, 0.3, 0.6349], [0.1, 0.1, 0.1, 0.1]
    moved, valid = allowed(scene, start, free_shot(scene))
    assert valid.all()
    check_positions(scene, moved[:, PLACES].reshape(3, 2, 2))
    assert np.abs(moved - start).max() < 0.05


def test_spins_are_limited_to_those_that_a_cue_gives_unless_they_are_known():
    start, known = np.zeros(10), np.full(10, np.nan)
    start[PLACES], start[VELOCITY], start[SPIN] = [0.0, 0.0, 0.5, 0.0], [0.6, 0.8], [10.0, -500.0, 500.0]
    known[SPIN] = start[SPIN]
    most = 1.5 * 2.5 * 0.5 / SCENE.balls.radius[0]
    for known_start, expected in ((None, [10.0, -most, most]), (known, start[SPIN])):
        moved, valid = allowed(SCENE, start[None], free_shot(SCENE, known_start))
        assert valid.all()
        assert moved[0, SPIN] == pytest.approx(expected)


def test_the_best_of_several_minima_is_found():
    """The shots have no spin. The residuals have a second minimum at e_ball = 0.927."""
    scene = Scene.named("pool", 1)
    starts = [[[0.506, 0.196], [-1.069, 0.246]], [[1.192, -0.527], [-0.785, -0.474]]]
    strikes = [[-2.239, 0.088], [-3.038, 0.045]]
    shots = [simulate(scene, places, v, record=True) for places, v in zip(starts, strikes, strict=True)]
    shot_tracks = [observed(f"{k}", shot, FRAMES, 0.002, seed=3700 + k) for k, shot in enumerate(shots)]
    off = with_physics(scene, mu_slide=0.1847, mu_roll=0.0089, e_ball=0.99, e_cushion=0.7716)
    result = calibrate(off, shot_tracks, FREE)
    assert result.problems == []
    assert result.rms == pytest.approx([0.002] * 2, rel=0.1)
    for name, (low, high) in result.intervals.items():
        assert low < getattr(scene.physics, name) < high
    assert (np.hypot(*result.spins.T) * scene.balls.radius[0] < 0.1 * np.hypot(*result.velocities.T)).all()


def test_a_minimum_with_another_order_of_events_is_found():
    """Over one second, whether a ball slides or rolls into its first contact is a minimum of its own for each shot."""
    rng, shot_tracks = np.random.default_rng(1), []
    for k in range(2):
        places = layouts.draw("random", SCENE, rng)
        ahead = places[1] - places[0]
        aim = ahead + rng.uniform(-1, 1) * SCENE.balls.radius[0] * np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead)
        shot = simulate(SCENE, places, rng.uniform(1.5, 3.5) * aim / np.hypot(*aim), record=True)
        shot_tracks.append(observed(f"{k}", shot, FRAMES[:30], 0.002, seed=100 + k))
    result = calibrate(with_physics(SCENE, **{name: 0.95 * value for name, value in TRUTH.items()}), shot_tracks, FREE)
    for name, (low, high) in result.intervals.items():
        assert abs(result.values[name] - TRUTH[name]) < high - low


def problems_of(shot_tracks, **expected):
    """Returns the fit of tracks, after a check of the kinds of its problems by shot and of its constants."""
    result = calibrate(OFF, shot_tracks, FREE)
    assert {problem.shot: problem.kind for problem in result.problems} == {k[-1]: v for k, v in expected.items()}
    for shot, rows in zip(result.shots, result.fitted, strict=True):
        assert rows.all() or f"_{shot.track.name}" in expected
    for name, (low, high) in result.intervals.items():
        assert abs(result.values[name] - TRUTH[name]) < high - low
    return result


def test_outliers_and_swapped_balls_are_reported_and_not_fitted():
    shot_tracks = tracks()
    shot_tracks[1].positions[[20, 51]] += 0.3
    exchanged = (shot_tracks[2].times > 0.2) & (shot_tracks[2].times < 0.6)
    shot_tracks[2].balls[exchanged] = 1 - shot_tracks[2].balls[exchanged]
    result = problems_of(shot_tracks, _1="outliers", _2="swapped balls")
    *outliers, swapped = result.problems
    assert sum(int(p.text.split()[0]) for p in outliers) == 2 == np.count_nonzero(~result.fitted[1])
    assert swapped.text == "from 0.233 s to 0.567 s balls 0 and 1 are exchanged"
    assert not result.fitted[2][exchanged].any()
    track, from_collision = tracks()[1], tracks()[1].times > 0.6
    later = track._replace(balls=np.where(from_collision, 1 - track.balls, track.balls))
    assert find_exchange(SCENE, later) == (0, 1, pytest.approx(19 / 30), np.inf)


def test_a_contact_that_only_the_track_has_is_reported():
    scene = Scene.named("carom", 2)
    places, v, w = STRIKES[1]
    far = shots()[1].at(1.1)[0]  # another ball is here, without rows
    shot_tracks, shot = tracks(), simulate(scene, [*places, far], v, spins=w, record=True)
    seen = observed("1", shot, FRAMES, 0.002, seed=1)
    shot_tracks[1] = seen.rows(seen.balls < 2)
    (problem,) = problems_of(shot_tracks, _1="other path").problems
    assert problem.ball == 0
    assert problem.begin == pytest.approx(1.0, abs=0.2)
    assert problem.text.startswith("ball 0 leaves the model at ")


def test_the_shots_of_pooltool_give_its_numbers():
    """The file has the start and the end of each shot. The strikes are known."""
    data = json.loads((Path(__file__).parents[1] / "data" / "pooltool_carom_shots.json").read_text(encoding="utf-8"))
    shot_tracks, velocities = [], []
    simple = [shot for shot in data["shots"] if len(shot["events"]) <= 7][:12]
    for k, shot in enumerate(simple):
        n = len(shot["positions"])
        times = np.repeat([0.0, shot["events"][-1][0]], n)
        places = np.array([*shot["positions"], *shot["final"]])
        shot_tracks.append(Track(f"{k}", times, np.tile(np.arange(n), 2), places))
        velocities.append(shot["velocity"])
    scene = Scene.named("benchmarks:pooltool_carom", max(len(shot["positions"]) for shot in simple) - 1)
    truth = {name: getattr(scene.physics, name) for name in ("mu_slide", "mu_roll", "e_cushion", "mu_cushion")}
    off = with_physics(scene, mu_slide=0.21, mu_roll=0.0097, e_cushion=0.83, mu_cushion=0.155)
    spins = np.zeros((len(shot_tracks), 3))
    result = calibrate(off, shot_tracks, tuple(truth), noise=0.001, velocities=velocities, spins=spins)
    assert result.values == pytest.approx(truth, rel=1e-4)
    assert np.array_equal(result.velocities, velocities)
    assert np.array_equal(result.spins, spins)


@pytest.mark.parametrize(
    ("free", "message"),
    [
        ((), r"free = \[\]: expected names of constants, each once"),
        (("mu_roll", "mu_roll"), r"free = \['mu_roll', 'mu_roll'\]: expected names"),
        (("mu_rol",), r"free = 'mu_rol': expected one of .*did you mean 'mu_roll'"),
        (("mu_ball_factor",), r"free = \['mu_ball_factor'\]: the rows do not determine any of them"),
    ],
)
def test_bad_numbers_are_rejected(free, message):
    with pytest.raises(ValueError, match=message):
        calibrate(SCENE, tracks(), free)


def test_a_scene_with_flights_is_refused(tmp_path):
    with pytest.raises(SystemExit, match=r"^error: physics\.flight = True with calibrate"):
        main(["calibrate", str(tmp_path / "tracks.csv"), "--example", "--scene", "jump_pool"])
    assert not any(tmp_path.iterdir())
    with pytest.raises(ValueError, match=r"physics\.flight = True with calibrate: expected False \(flights"):
        calibrate(Scene.named("jump_pool", 2), tracks())


def test_a_number_is_fitted_only_if_a_law_of_the_scene_reads_it():
    names: Any = import_module("billiards_env.calibration.calibrate").free_names
    frictional = with_physics(SCENE, ball_ball="frictional")
    assert "mu_ball_decay" in names(frictional, None)
    assert "mu_ball_decay" not in names(with_physics(frictional, mu_ball=0.05), None)
    assert "mu_ball_decay" not in names(with_physics(SCENE, ball_ball="frictionless"), None)
    variable = with_physics(SCENE, cushion="han2005_variable", e_cushion_tangent=0.1)
    assert "e_cushion_tangent" in names(variable, None)
    assert "e_cushion_tangent" not in names(with_physics(variable, cushion="han2005"), None)
    rolling = with_physics(SCENE, motion="rolling", cushion="restitution", ball_ball="frictionless", e_cushion_loss=0.1)
    assert names(rolling, None) == ("mu_roll", "e_ball", "e_cushion", "e_cushion_loss")


def test_the_command_prints_the_report_and_writes_files(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    file, out = tmp_path / "tracks.csv", [tmp_path / "report.json", tmp_path / "report.png"]
    write_tracks(file, tracks())
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps(OFF.to_dict()))
    files = [argument for path in out for argument in ("--out", str(path))]
    main(["calibrate", str(file), "--scene", str(scene), "--free", *FREE, *files])
    printed, progress = capsys.readouterr()
    assert printed.startswith(f"{calibration()}\n")
    lines = str(calibration()).splitlines()
    assert lines[0].split() == ["constant", "start", "fitted", "95%", "interval", "unit"]
    assert [line.split()[0] for line in lines[1:5]] == list(FREE)
    assert lines[-1] == "no problems"
    assert progress.startswith("until contact 2: ")
    report = json.loads(out[0].read_text())
    assert report["values"] == calibration().values
    assert Scene.from_dict(report["scene"]) == calibration().scene
    assert out[1].read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        ["scene.json", "tracks.csv", *(p.name for p in out)]
    )
    with pytest.raises(SystemExit, match=r"suffix = '\.txt': expected one of '\.json'"):
        main(["calibrate", str(file), "--out", str(tmp_path / "report.txt")])


def test_the_command_writes_an_example_and_fits_it(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(example, "SHOTS", 2)
    monkeypatch.setattr(example, "CHANGE", 1.0)  # only one constant is fitted
    file = tmp_path / "tracks.csv"
    main(["calibrate", str(file), "--example", "--scene", "carom", "--free", "mu_roll", "--contacts", "2"])
    printed, progress = capsys.readouterr()
    assert re.match(rf"wrote {file}: 2 simulated shots with mu_slide 0.2, mu_roll 0.01, .*\n", progress)
    assert float(printed.splitlines()[1].split()[2]) == pytest.approx(0.01, rel=0.05)
    for wrong, message in (
        (["--example"], "expected a new file for the example"),
        (["--columns", "ball"], "--columns = 'ball': expected NAME=HEADING"),
    ):
        with pytest.raises(SystemExit, match=message):
            main(["calibrate", str(file), *wrong])
