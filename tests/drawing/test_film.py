import math
import os

import numpy as np
import pytest

pytest.importorskip("PIL.Image")
pytest.importorskip("imageio_ffmpeg")
pytest.importorskip("pygame")

from PIL.GifImagePlugin import GifImageFile

from billiards_env.drawing import film
from billiards_env.drawing.canvas import Canvas, pixels
from billiards_env.drawing.recording import recording_of
from tests.helpers.films import read_mp4


def drawn(shot, fps, width):
    return [pixels(f) for f in Canvas(shot.scene, width).film(recording_of(shot), fps, shot.engine)]


def test_mp4(shot, tmp_path):
    shot.to_mp4(tmp_path / "a.mp4", fps=30, width=400)
    fps, frames = read_mp4(tmp_path / "a.mp4")
    expected = drawn(shot, 30, 400)
    assert fps == 30
    assert len(frames) == len(expected) == math.ceil(30 * shot.time) + 1
    assert {(frame.shape, frame.dtype.name) for frame in expected} == {((*frames.shape[1:],), "uint8")}
    for one, other in zip(frames[::20], expected[::20], strict=True):
        assert np.abs(one.astype(int) - other).mean() < 4


def test_gif(shot, tmp_path):
    shot.to_gif(tmp_path / "a.gif", fps=20, width=400)
    expected = drawn(shot, 20, 400)
    with GifImageFile(tmp_path / "a.gif") as gif:
        # Equal consecutive frames are stored as one frame with a longer duration.
        duration = 0
        for k in range(gif.n_frames):
            gif.seek(k)
            frame = np.asarray(gif.convert("RGB")).astype(int)
            assert np.abs(frame - expected[min(duration // 50, len(expected) - 1)]).mean() < 3
            duration += gif.info["duration"]
        assert gif.info["loop"] == 0
    assert duration == 50 * (math.ceil(20 * shot.time) + 1)


def test_gifs_are_not_faster_than_viewers_can_play(elsewhere, tmp_path):
    elsewhere.to_gif(tmp_path / "a.gif", fps=1000, width=160)
    with GifImageFile(tmp_path / "a.gif") as gif:
        assert gif.info["duration"] >= 20


def test_a_film_shows_another_run(shot, pit, tmp_path):
    shot.to_mp4(tmp_path / "one.mp4", fps=10, width=320)
    shot.to_mp4(tmp_path / "two.mp4", fps=10, width=320, compare=pit)
    one, two = (read_mp4(tmp_path / name)[1] for name in ("one.mp4", "two.mp4"))
    assert len(two) == math.ceil(10 * max(shot.time, pit.time)) + 1 != len(one)
    assert np.abs(one[10].astype(int) - two[10]).max() > 100


@pytest.mark.parametrize("suffix", ["gif", "mp4", "html"])
def test_bad_arguments_are_rejected_and_leave_no_file(suffix, shot, elsewhere, tmp_path):
    write = getattr(shot, f"to_{suffix}")
    (tmp_path / f"folder.{suffix}").mkdir()
    for name, error, message in (
        ("a.png", ValueError, f"expected a name that ends in '.{suffix}'"),
        (f"none/a.{suffix}", FileNotFoundError, "the folder .*none' does not exist"),
        (f"folder.{suffix}", IsADirectoryError, "expected a file, not a folder"),
    ):
        with pytest.raises(error, match=message):
            write(tmp_path / name)
    target = tmp_path / f"a.{suffix}"
    if suffix != "html":
        for fps in (0, -1, math.nan, math.inf, True, "fast"):
            with pytest.raises((TypeError, ValueError), match=r"fps = .*: expected a number"):
                write(target, fps=fps)
        with pytest.raises(ValueError, match="width = 3: expected a whole number from 160 to 7680 pixels"):
            write(target, width=3)
        for draw in (lambda: write(target, compare=elsewhere), lambda: shot.plot(compare=elsewhere)):
            with pytest.raises(ValueError, match="compare: expected a shot with the same balls on the same table"):
                draw()
    assert os.listdir(tmp_path) == [f"folder.{suffix}"]


@pytest.mark.parametrize(("suffix", "more"), [("gif", 1), ("mp4", 0)])  # a GIF begins with its last frame
def test_an_error_in_a_frame_keeps_the_old_file(suffix, more, shot, tmp_path, monkeypatch):
    drawable = iter(range(math.ceil(5 * shot.time) + more))  # all frames but the last
    monkeypatch.setattr(film, "pixels", lambda frame: (next(drawable), pixels(frame))[1])
    target = tmp_path / f"a.{suffix}"
    target.write_text("old")
    with pytest.raises(StopIteration):
        getattr(shot, f"to_{suffix}")(target, fps=5, width=160)
    assert next(drawable, None) is None
    assert os.listdir(tmp_path) == [target.name]
    assert target.read_text() == "old"


@pytest.mark.parametrize("size", [1000, 40_000])
def test_a_film_that_does_not_fit_on_the_disk_keeps_the_old_file(size, shot, tmp_path):
    """A limit on the size of files acts on the encoder as a full disk does."""
    resource = pytest.importorskip("resource")
    (tmp_path / "a.mp4").write_text("old")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        with pytest.raises(OSError, match=r"the encoder of the film failed, the disk may be full: '.*/a\.mp4'"):
            shot.to_mp4(tmp_path / "a.mp4", fps=30, width=400)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert os.listdir(tmp_path) == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_text() == "old"
