"""Observations of 84 x 84 grey pixels instead of positions: `python examples/pixels.py` (extra `render`)."""

import time

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import AddRenderObservation, TransformObservation
from PIL import Image

SIZE = 84
SPACE = gym.spaces.Box(0, 255, (SIZE, SIZE), np.uint8)


def shrink(frame: np.ndarray) -> np.ndarray:
    """Returns a frame as grey pixels, (84, 84). The table fills the width; it is stretched to a square."""
    return np.asarray(Image.fromarray(frame).convert("L").resize((SIZE, SIZE), Image.Resampling.BOX))


def make(**arguments) -> gym.Env:
    """Returns an environment whose observation is a picture of the table, `SPACE`."""
    env = gym.make("billiards_env:Billiards-v0", render_mode="rgb_array", **arguments)
    return TransformObservation(AddRenderObservation(env, render_only=True), shrink, SPACE)


def run(steps: int) -> np.ndarray:
    """Plays random shots. Returns the last observation."""
    env = make(n_object_balls=3, max_shots=10)
    observation, _ = env.reset(seed=0)
    for _ in range(steps):
        observation, _, terminated, _, _ = env.step(env.action_space.sample())
        if terminated:
            observation, _ = env.reset()
    env.close()
    return observation


if __name__ == "__main__":
    begin = time.perf_counter()
    Image.fromarray(run(500)).save("pixels.png")
    print(f"{500 / (time.perf_counter() - begin):.0f} frames per second; the last one is pixels.png")
