"""Films."""

import re
import subprocess

import numpy as np
import pytest


def read_mp4(path):
    """Returns the frames per second and the frames."""
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    ask = [ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-i", str(path)]
    data = subprocess.run([*ask, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True).stdout
    about = subprocess.run(ask, capture_output=True, text=True).stderr
    assert "h264" in about
    assert "yuv420p" in about
    width, height = map(int, re.findall(r" (\d+)x(\d+)[ ,]", about)[0])
    return float(re.findall(r"([\d.]+) fps", about)[0]), np.frombuffer(data, np.uint8).reshape(-1, height, width, 3)
