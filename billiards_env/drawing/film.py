"""Films: GIF (pillow) and MP4 (imageio-ffmpeg)."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from billiards_env.drawing.canvas import Canvas, Frame, pixels
from billiards_env.drawing.recording import recordings_of
from billiards_env.drawing.style import INK, PAPER
from billiards_env.shots.result import ShotResult
from billiards_env.support.checks import missing, real
from billiards_env.support.files import check_path, replacing


def write_film(
    shot: ShotResult,
    path: str | os.PathLike[str],
    suffix: str,
    fps: float,
    width: int,
    compare: ShotResult | None = None,
    around: Sequence[str] = (PAPER, INK),
) -> None:
    """Writes a shot as a film with frames of `width` pixels; `suffix` is ".gif" or ".mp4".

    Another run of the shot, `compare`, is drawn as rings. `around` are the colours around the table and of the text. A
    GIF stores the time of a frame in whole hundredths of a second.

    Raises:
        TypeError: If `fps` is not a number, or `compare` is no shot.
        ValueError: If a shot was not recorded, `fps` or `width` is outside its range, or the name of the file has
            another suffix.
        OSError: If the file cannot be written.
    """
    recording, other = recordings_of(shot, compare, f"to_{suffix[1:]}")
    target, fps = check_path(path, suffix), real("fps", fps, "fps")
    if suffix == ".gif":
        fps = 100 / max(2, round(100 / fps))  # viewers show shorter times slowly
    canvas = Canvas(recording.scene, width, *around)
    left = recording.label if other is None else f"{recording.label}; rings: {other.label}"
    film = functools.partial(canvas.film, recording, fps, left, compare=other)
    colours = None
    if suffix == ".gif":
        (last,) = film(only_last=True)  # it has the most colours
        colours = pixels(last)
    with film_writer(target, fps, colours) as write:
        for frame in film():
            write(pixels(frame))


@contextlib.contextmanager
def film_writer(
    target: Path, fps: float, colours: Frame | None = None, count: int = 255
) -> Iterator[Callable[..., None]]:
    """Yields a function that writes a frame to a film, which appears when the block succeeds.

    Its arguments are the frame (height, width, 3) uint8, whose sides are even, and the time for which it is shown, s;
    by default 1 / fps. Without `colours` the film is an MP4. Otherwise it is a GIF with at most `count`
    colours, which are chosen for the frame `colours`.

    Raises:
        ModuleNotFoundError: If imageio-ffmpeg or pillow is not installed.
        OSError: If the file cannot be written.
    """
    begin = functools.partial(_mp4, target) if colours is None else functools.partial(_gif, colours, count)
    with replacing(target) as temporary, begin(temporary, fps) as write:
        yield write


@contextlib.contextmanager
def _gif(colours: Frame, count: int, temporary: Path, fps: float) -> Iterator[Callable[..., None]]:
    try:
        from PIL import Image
    except ModuleNotFoundError as error:
        raise missing("pillow", "render") from error
    # An octree keeps the colours of the balls, which have few pixels. The default method prefers the colours of the
    # cloth.
    palette = Image.fromarray(colours).quantize(count, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    images, times = [], []

    def write(frame: Frame, seconds: float = 1 / fps) -> None:
        images.append(Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE))
        times.append(round(1000 * seconds))

    yield write
    images[0].save(temporary, save_all=True, append_images=images[1:], duration=times, loop=0, disposal=1)


@contextlib.contextmanager
def _mp4(target: Path, temporary: Path, fps: float) -> Iterator[Callable[..., None]]:
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError as error:
        raise missing("imageio_ffmpeg", "render") from error
    failure = OSError(errno.EIO, "the encoder of the film failed, the disk may be full", str(target))
    written, writer = 0, None

    def write(frame: Frame, seconds: float = 1 / fps) -> None:
        nonlocal written, writer
        if writer is None:
            options: Any = {"fps": fps, "quality": 8, "macro_block_size": 2}
            options["output_params"] = ["-movflags", "+faststart"]
            writer = imageio_ffmpeg.write_frames(str(temporary), frame.shape[1::-1], **options)
            writer.send(None)
        for _ in range(round(seconds * fps)):
            try:
                writer.send(np.ascontiguousarray(frame))
            except OSError:
                raise failure from None
            written += 1

    try:
        yield write
    finally:
        if writer is not None:
            writer.close()  # reports no error of the encoder
    with contextlib.suppress(RuntimeError):  # the file is no film
        if imageio_ffmpeg.count_frames_and_secs(str(temporary))[0] == written:
            return
    raise failure
