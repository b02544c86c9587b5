"""Films of a recorded shot: GIF (pillow) and MP4 (imageio-ffmpeg)."""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from billiards_env.drawing.canvas import Canvas, pixels
from billiards_env.drawing.files import check_path, replacing
from billiards_env.drawing.recording import Recording


def frames(
    recording: Recording, fps: float, width: int, compare: Recording | None = None
) -> tuple[tuple[int, int], Iterator[NDArray[np.uint8]]]:
    """The size (width, height) of a film's frames, and the frames, (height, width, 3) uint8, one by one."""
    if isinstance(fps, bool) or not isinstance(fps, (int, float, np.number)) or not 0 < fps <= 1000:
        raise ValueError(f"fps = {fps!r}: expected frames a second, a number > 0 and <= 1000")
    canvas = Canvas(recording.scene, width)
    left = recording.label if compare is None else f"{recording.label}, as rings {compare.label}"
    return canvas.size, (pixels(frame) for frame in canvas.film(recording, fps, left, compare=compare))


def write_gif(
    path: str | os.PathLike[str], recording: Recording, fps: float, width: int, compare: Recording | None
) -> None:
    """Writes a shot as an animated GIF; `fps` is rounded to what the format has, whole hundredths of a second."""
    from PIL import Image

    target = check_path(path, ".gif")
    _, images = frames(recording, fps, width, compare)
    hundredths = max(2, round(100 / fps))  # shorter ones are played slowly
    _, images = frames(recording, 100 / hundredths, width, compare)
    *_, last = images  # the frame that shows most colours
    palette = Image.fromarray(last).quantize(255, dither=Image.Dither.NONE)
    _, images = frames(recording, 100 / hundredths, width, compare)
    indexed = (Image.fromarray(image).quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    with replacing(target) as temporary:
        next(indexed).save(
            temporary, save_all=True, append_images=indexed, duration=10 * hundredths, loop=0, disposal=1
        )


def write_mp4(
    path: str | os.PathLike[str], recording: Recording, fps: float, width: int, compare: Recording | None
) -> None:
    """Writes a shot as an MP4 film (H.264)."""
    target = check_path(path, ".mp4")
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "imageio-ffmpeg is not installed; MP4 films need it: pip install 'billiards-env[render]'",
            name="imageio_ffmpeg",
        ) from error
    size, images = frames(recording, fps, width, compare)
    with replacing(target) as temporary:
        writer = imageio_ffmpeg.write_frames(
            str(temporary), size, fps=fps, quality=8, macro_block_size=2, output_params=["-movflags", "+faststart"]
        )
        writer.send(None)
        try:
            for image in images:
                writer.send(image)
        finally:
            writer.close()
