"""Films of a recorded shot: GIF (pillow) and MP4 (imageio-ffmpeg)."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from billiards_env.drawing.canvas import Canvas, Caption, Frame, pixels
from billiards_env.drawing.recording import Recording
from billiards_env.drawing.style import INK, PAPER
from billiards_env.support.checks import missing, real
from billiards_env.support.files import check_path, replacing


def frames(
    recording: Recording, fps: float, width: int, compare: Recording | None = None, around: Sequence[str] = (PAPER, INK)
) -> tuple[tuple[int, int], Iterator[Frame]]:
    """Returns the size (width, height) of a film, pixels, and its frames, (height, width, 3) uint8.

    Another run of the shot, `compare`, is drawn as rings. `around` are the colours around the table and of the text.

    Raises:
        TypeError: If `fps` is not a number.
        ValueError: If `fps` or `width` is outside its range.
    """
    fps = real("fps", fps, "fps")
    canvas = Canvas(recording.scene, width, *around)
    left = recording.label if compare is None else f"{recording.label}; rings: {compare.label}"
    return canvas.size, (pixels(frame) for frame in canvas.film(recording, fps, Caption(left), compare))


def write_gif(
    path: str | os.PathLike[str],
    recording: Recording,
    fps: float,
    width: int,
    compare: Recording | None,
    around: Sequence[str] = (PAPER, INK),
) -> None:
    """Writes a shot as an animated GIF; the format stores the time of a frame in whole hundredths of a second."""
    try:
        from PIL import Image
    except ModuleNotFoundError as error:
        raise missing("pillow", "render") from error
    target = check_path(path, ".gif")
    hundredths = max(2, round(100 / real("fps", fps, "fps")))  # viewers show shorter times slowly

    def draw() -> Iterator[Frame]:
        return frames(recording, 100 / hundredths, width, compare, around)[1]

    *_, last = draw()  # the last frame has the most colours
    # An octree keeps the colours of the balls, which have few pixels. The default method prefers the colours of the
    # cloth.
    palette = Image.fromarray(last).quantize(255, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    indexed = (Image.fromarray(image).quantize(palette=palette, dither=Image.Dither.NONE) for image in draw())
    with replacing(target) as temporary:
        next(indexed).save(
            temporary, save_all=True, append_images=indexed, duration=10 * hundredths, loop=0, disposal=1
        )


def write_mp4(
    path: str | os.PathLike[str], recording: Recording, fps: float, width: int, compare: Recording | None
) -> None:
    """Writes a shot as an MP4 film (H.264)."""
    target = check_path(path, ".mp4")
    size, images = frames(recording, fps, width, compare)
    with mp4_writer(target, size, fps) as write:
        for image in images:
            write(image)


@contextlib.contextmanager
def mp4_writer(target: Path, size: tuple[int, int], fps: float) -> Iterator[Callable[[Frame], None]]:
    """Yields a function that writes a frame (height, width, 3) uint8; the file appears when the block succeeds.

    The `size` of a frame is (width, height), pixels, both even.

    Raises:
        ModuleNotFoundError: If imageio-ffmpeg is not installed.
        OSError: If the file cannot be written.
    """
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError as error:
        raise missing("imageio_ffmpeg", "render") from error
    with replacing(target) as temporary:
        options: dict[str, Any] = {"fps": fps, "quality": 8, "macro_block_size": 2}
        options["output_params"] = ["-movflags", "+faststart"]
        writer = imageio_ffmpeg.write_frames(str(temporary), size, **options)
        writer.send(None)
        failure = OSError(errno.EIO, "the encoder of the film failed, the disk may be full", str(target))
        written = 0

        def write(frame: Frame) -> None:
            nonlocal written
            try:
                writer.send(np.ascontiguousarray(frame))
            except OSError:
                raise failure from None
            written += 1

        try:
            yield write
        finally:
            writer.close()  # reports no error of the encoder
        with contextlib.suppress(RuntimeError):  # the file is no film
            if imageio_ffmpeg.count_frames_and_secs(str(temporary))[0] == written:
                return
        raise failure
