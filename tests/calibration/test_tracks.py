"""Files of tracks."""

import gzip
import json

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.calibration import tracks
from billiards_env.calibration.tracks import Track, check_tracks, observed, read_tracks, write_tracks

HEAD = "shot,time,ball,x,y\n"


def test_a_camera_sees_the_balls_until_they_are_potted():
    scene = Scene.named("pool")
    shot = simulate(scene, [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True)
    times = np.linspace(0.0, shot.time, 50)
    track = observed("a", shot, times)
    assert shot.trajectory is not None
    (gone,) = shot.trajectory.potted_at[shot.potted]
    assert np.array_equal(track.times[track.balls == 0], times)
    assert np.array_equal(track.times[track.balls == 1], times[times < gone])
    for ball in (0, 1):
        rows = track.balls == ball
        assert np.array_equal(track.positions[rows], shot.at(track.times[rows])[:, ball])
    noisy = observed("a", shot, times, noise=0.002, seed=1).positions - track.positions
    assert noisy.std() == pytest.approx(0.002, rel=0.2)


def test_a_file_is_written_and_read(tmp_path):
    written = [
        Track("break 1", np.array([0.1, 0.2]), np.array([0, 1]), np.array([[0.1, -1 / 3], [1e-9, 2.0]])),
        Track("2", np.array([0.0]), np.array([3]), np.array([[0.0, 0.5]])),
    ]
    write_tracks(tmp_path / "tracks.csv", written)
    for track, again in zip(written, read_tracks(tmp_path / "tracks.csv"), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(track, again, strict=True))


def test_a_ball_may_be_written_as_a_decimal_number(tmp_path):
    """A column of whole numbers with empty cells becomes one of decimal numbers in pandas."""
    path = tmp_path / "tracks.csv"
    path.write_text("\ufeff" + HEAD + "a,0,0.0,1,2\na,0,11.0,1,2\n", encoding="utf-8")
    assert read_tracks(path)[0].balls.tolist() == [0, 11]


def test_a_device_without_end_and_a_large_file_are_refused(tmp_path, monkeypatch):
    with pytest.raises(OSError, match="path = '/dev/zero': expected a file of tracks, but it is not a regular file"):
        read_tracks("/dev/zero")
    monkeypatch.setattr(tracks, "MAX_BYTES", 100)
    packed = gzip.compress(bytes(101))
    for name, content, message in (
        ("tracks.csv", bytes(101), "a file of more than 100 bytes"),
        ("large.csv.gz", packed, "a file of more than 100 bytes"),
        ("half.csv.gz", packed[:-12], "ended before"),
        ("changed.csv.gz", packed[:12] + b"\xff" + packed[13:], ""),
        ("other.csv.gz", b"shot,time,ball,x,y", "Not a gzipped file"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ValueError, match=f"path = .*{name}': expected a file of tracks .*{message}"):
            read_tracks(tmp_path / name)


def test_columns_may_have_any_order_and_cells_may_be_empty(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("time,x (m) raw, y,x,ball,shot\n0,0.9,1,2,0,a\n\n1,,,,0,a\n1,,nan,NaN,1,b\n2,0.1,3,4,1,a\n")
    (track,) = read_tracks(path)
    assert track.name == "a"
    assert track.times.tolist() == [0.0, 2.0]
    assert track.balls.tolist() == [0, 1]
    assert track.positions.tolist() == [[2.0, 1.0], [4.0, 3.0]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"tracks.csv, line 1: head = '': expected one column 'ball'"),
        ("shot,time,ball,x,y,x\n", "line 1: head = .*: expected one column 'x'"),
        (HEAD + "a,0,0,1,2\na,0,0,1\n", "line 3: 4 cells: expected 5"),
        (HEAD + "a,0,0,1,2\na,0,1e30,1,2\n", "tracks.csv: ball = 1e30: expected a whole number from 0 to 99999"),
        (HEAD + "a,0,0,1,here\n", "line 2: y = 'here': expected a finite number"),
        (HEAD + "a,0,0,inf,2\n", "line 2: x = 'inf': expected a finite number"),
        ("t,red_x,red_y\n0,1\n", "line 2: 2 cells: expected 3"),
        ("t,red_x,cue_x,cue_y\n", "line 1: head = .*: expected two columns for each ball, such as cue_x and cue_y"),
        ("t,cue_x (mm),cue_y (mm),red_x,red_y\n", "expected two columns for each ball"),
        ("t,x,y,x,y\n", "expected one column 'ball', as in"),  # the program Tracker
        ("track,frame_idx,instance.score,cue.x,cue.y,cue.score\n", "expected .*, as in"),  # SLEAP
    ],
)
def test_a_bad_line_is_named(text, message, tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_tracks(path)


def test_rows_are_sorted_by_time():
    unsorted = Track("a", np.array([3.0, 2, 1, 0, 4]), np.array([0, 1, 0, 0, 0]), np.zeros((5, 2)))
    (track,) = check_tracks(Scene.named("pool"), [unsorted])
    assert track.times.tolist() == [0, 1, 2, 3, 4]
    assert track.balls.tolist() == [0, 0, 1, 0, 0]


def test_separators_decimal_commas_comments_units_and_headings(tmp_path):
    path = tmp_path / "tracks.csv"
    for text in (
        "# a film\nShot;Time (ms);BALL;X [mm];y [cm]\na;20;0;100,5;20\n# more\na;40;0;;20\na;60;0.0;110;21\n",
        "shot\tt\tball\tx (mm)\ty (mm)\na\t0,02\t0\t100,5\t200\na\t0,06\t0\t110\t210\n",
    ):
        path.write_text(text)
        (track,) = read_tracks(path)
        assert track.times == pytest.approx([0.02, 0.06])
        assert track.positions == pytest.approx(np.array([[0.1005, 0.2], [0.11, 0.21]]))
    path.write_text("time,ball,x,y\n0,0,10,20\n")
    (track,) = read_tracks(path, "in")
    assert track.positions == pytest.approx(np.array([[0.254, 0.508]]))
    with pytest.raises(ValueError, match=r"unit = 'feet': expected one of"):
        read_tracks(path, "feet")


def test_frames_are_counted_and_columns_have_other_names(tmp_path):
    path, columns = tmp_path / "tracks.csv", {"ball": "Object", "x": "pos_x", "y": "pos_y"}
    path.write_text("shot,frame,object,pos_x (cm),pos_y,x\na,5,0,100,0.2,7\na,10,0,110,0.3,7\n")
    (track,) = read_tracks(path, fps=50, columns=columns)
    assert (track.times.tolist(), track.positions.tolist()) == ([0.1, 0.2], [[1.0, 0.2], [1.1, 0.3]])
    (track,) = read_tracks(path, columns=columns | {"time": "frame"})
    assert track.times.tolist() == [5.0, 10.0]
    for changed, message in (
        ({"bal": "object"}, r"columns = 'bal': expected one of .* \(did you mean 'ball'\?\)"),
        ({"ball": "colour"}, "line 1: head = .*: expected one column 'colour' for 'ball'"),
    ):
        with pytest.raises(ValueError, match=message):
            read_tracks(path, fps=50, columns=changed)
    path.write_text("time,0_x,0_y\n0,1,2\n")
    with pytest.raises(ValueError, match="expected one column 'frame' for 'time'"):
        read_tracks(path, fps=50)
    with pytest.raises(ValueError, match="fps = 0"):
        read_tracks(path, fps=0)


def test_a_row_may_have_all_balls_of_a_frame(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("time,cue_x,cue_y,red_x,red_y\n0,0.1,0.2,0.3,0.4\n0.02,0.2,0.2,,\n0.04,0.3,0.2,0.3,0.4\n")
    (track,) = read_tracks(path)
    assert track.times.tolist() == [0.0, 0.0, 0.02, 0.04, 0.04]
    assert track.balls.tolist() == [0, 1, 0, 0, 1]
    assert track.positions.tolist() == [[0.1, 0.2], [0.3, 0.4], [0.2, 0.2], [0.3, 0.2], [0.3, 0.4]]
    path.write_text("Trial;1 X [mm];1 Y [mm];0 X [mm];0 Y [mm];t (ms)\na;100,5;200;1;2;20\nb;100;200;1;2;40\n")
    a, b = read_tracks(path)
    assert (a.name, a.balls.tolist(), b.times.tolist()) == ("a", [1, 0], [0.04, 0.04])
    assert a.positions == pytest.approx(np.array([[0.1005, 0.2], [0.001, 0.002]]))


def test_the_cue_ball_is_the_first_that_moves(tmp_path):
    path = tmp_path / "tracks.csv"
    rows = ["a,0,red,0,0", "a,1,red,0,0", "a,2,red,0.5,0", "a,0,white,1,0", "a,1,white,1.2,0", "a,0,amber,0,0.5"]
    path.write_text(HEAD + "\n".join(rows))
    (track,) = read_tracks(path)
    assert track.balls.tolist() == [2, 2, 2, 0, 0, 1]
    lists = {"1": {"t": [0, 1], "x": [0, 0], "y": [0, 0]}, "2": {"t": [0, 1, 1], "x": [1, 2, 2], "y": [0, 0, 0]}}
    with gzip.open(tmp_path / "tracks.json.gz", "wt") as file:
        json.dump([{"id": 7, "balls": lists}], file)
    (track,) = read_tracks(tmp_path / "tracks.json.gz")
    assert track.name == "7"
    assert track.balls.tolist() == [1, 1, 0, 0]  # the ball that was found twice in a frame has one row
    (tmp_path / "bad.json").write_text('[{"id": 1}]')
    with pytest.raises(ValueError, match=r"bad\.json: expected a list of shots with 'id' and 'balls'"):
        read_tracks(tmp_path / "bad.json")
