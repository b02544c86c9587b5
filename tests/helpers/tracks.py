"""Tracks of simulated shots as a tracking program writes them: whole shots, with gaps and in a frame of its own."""

import functools

import numpy as np

from billiards_env import Scene, simulate
from billiards_env.calibration import Frame, Track
from billiards_env.scene import layouts

SCENE = Scene.named("carom", 2)
LATE = 0.007
"""s, the strike after the first frame."""

FRAME = Frame((0.01, -0.005), (0.94, 0.945))
NOISE = 0.0005


@functools.cache
def whole_tracks(count: int = 10) -> list[Track]:
    """Returns tracks of whole shots at 50 Hz. A ball has a row only after it has moved, and in the last frame."""
    rng, tracks = np.random.default_rng(5), []
    while len(tracks) < count:
        places = layouts.draw("random", SCENE, rng)
        ahead = places[1] - places[0]
        radius = SCENE.balls.radius[0]
        aim = ahead + rng.uniform(-1.0, 1.0) * radius * np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead)
        velocity = rng.uniform(2.0, 4.0) * aim / np.hypot(*aim)
        roll, side = rng.uniform(0.0, 1.0), rng.uniform(-0.5, 0.5)
        spin = np.array([-roll * velocity[1], roll * velocity[0], side * np.hypot(*velocity)]) / radius
        shot = simulate(SCENE, places, velocity, spins=spin, record=True)
        if shot.first_hit != 1:
            continue
        times, balls, rows = [], [], []
        frames = np.arange(0.0, shot.time + 0.1, 0.02)
        for ball, path in enumerate(np.moveaxis(shot.at(np.maximum(frames - LATE, 0.0)), 1, 0)):
            last = np.full(2, np.inf)
            for time, place in zip(frames, path, strict=True):
                if np.hypot(*(place - last)) > 0.003 or time == frames[-1]:
                    last = place
                    times.append(time)
                    balls.append(ball)
                    rows.append(place + NOISE * rng.standard_normal(2))
        tracks.append(Track(f"s{len(tracks)}", np.array(times), np.array(balls), np.array(rows)))
    return tracks


def raw_tracks() -> list[Track]:
    """Returns the tracks in the coordinates of `FRAME`, clipped at the border of a picture."""
    tracks = [track._replace(positions=track.positions / FRAME.scale + FRAME.offset) for track in whole_tracks()]
    top = max(float(track.positions[:, 1].max()) for track in tracks) - 0.004
    return [track._replace(positions=np.minimum(track.positions, [np.inf, top])) for track in tracks]
