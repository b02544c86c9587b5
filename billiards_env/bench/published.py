"""The published results of the frozen ids: `billiards doctor` and the tests compare this machine with them.

A change of a hash is a change of results. From the first release on, it needs a new version of the id.
"""

from __future__ import annotations

import hashlib

import gymnasium as gym
import numpy as np

from billiards_env.bench.frozen import NAMESPACE

HASHES = {
    "Pot1-v0": "ae50ef21077ae8cf",
    "Pot1Noise-v0": "d4cead7e01c9f64c",
    "Pot1Strike-v0": "26e35a4f5da65ff7",
    "Pot1StrikeNoise-v0": "9b950e9f08cc8c14",
    "Pot3-v0": "b54b62b0873ca48f",
    "Pot3Noise-v0": "c10d55508cd0a3a1",
    "Pot3Strike-v0": "2454c0ca86a2b1ed",
    "Pot3StrikeNoise-v0": "bcbe65749810e5b0",
    "Clear5-v0": "6e565c1f53b8c00e",
    "Clear5Noise-v0": "9a4d20633bb53290",
    "Clear5Strike-v0": "7e1c3cdd4d4ae2d0",
    "Clear5StrikeNoise-v0": "77f42a346463f3a0",
    "Carom-v0": "20dc950735001630",
    "CaromNoise-v0": "b0881a2a11de1a1f",
    "ThreeCushion-v0": "20dc950735001630",
    "ThreeCushionNoise-v0": "44f4e6fa65eccb7f",
    "SumToThree-v0": "81cc22d8b455ba73",
    "SumToThreeNoise-v0": "38fda5965897e3d3",
    "Place-v0": "44c18d14c1cd1358",
    "PlaceNoise-v0": "6599844204973bd8",
    "Position-v0": "44c18d14c1cd1358",
    "PositionNoise-v0": "0109b993e13750db",
    "PositionStrike-v0": "08cecf1d332f91b0",
    "PositionStrikeNoise-v0": "f1aa8438247ca8ec",
    "Jump-v0": "6d17d67de3ee5c10",
    "JumpNoise-v0": "4ccc6ce9d1c8cac4",
    "NineBall-v0": "b0ac70d9ae125418",
    "NineBallNoise-v0": "7765917bc4b38a0d",
    "NineBallStrike-v0": "1a69956a9bbec8ec",
    "NineBallStrikeNoise-v0": "f7581ae5a5d677a7",
    "EightBall-v0": "ab4fa33b36acfb33",
    "EightBallNoise-v0": "998b46d209b15729",
    "EightBallStrike-v0": "fdeabba6ebf2d884",
    "EightBallStrikeNoise-v0": "73cdaf8437a64bdf",
    "StraightGame-v0": "0c078a16ddcc89ef",
    "EightBallGame-v0": "9442867a3e07c2fa",
    "NineBallGame-v0": "638856311903e209",
    "TenBallGame-v0": "0dd358f981bd0779",
    "OnePocketGame-v0": "77d42edc24e89aa0",
    "BankPoolGame-v0": "abfa64c6c12547a3",
    "BlackballGame-v0": "b323fe86b0ad6e3a",
    "SnookerGame-v2": "9724827c3bd21a60",
    "CaromGame-v1": "f2a72b9920198bd4",
    "ThreeCushionGame-v1": "bc70f7f33b7d6b4b",
}
"""The hashes of `first_steps`, by id."""


def first_steps(name: str) -> str:
    """Returns a hash of 100 steps: of the first 5 steps with random actions in 20 environments."""
    envs, rng, digest = gym.make_vec(NAMESPACE + name, 20), np.random.default_rng(0), hashlib.sha256()
    observations, _ = envs.reset(seed=0)
    for _ in range(5):
        digest.update(observations.tobytes())
        shape = envs.action_space.shape
        assert shape is not None
        observations, rewards, over, _, infos = envs.step(rng.uniform(-1.0, 1.0, shape).astype(np.float32))
        digest.update(rewards.tobytes() + over.tobytes())
        for info, shots in ((infos, ~over), (infos.get("final_info", {}), over)):
            for key in ("shot_time", "first_hit", "potted", "score") if shots.any() else ():
                values = info[key]
                digest.update((values * shots.reshape(-1, *[1] * (values.ndim - 1))).tobytes())
        for row in infos.get("final_obs", ()):
            digest.update(b"" if row is None else row.tobytes())
    return digest.hexdigest()[:16]
