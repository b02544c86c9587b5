import numpy as np
import pytest

from billiards_env import Engine, Scene, simulate
from billiards_env.scene import layouts

SCENE = Scene.named("pool", 4)
PLACES = layouts.draw("random", SCENE, np.random.default_rng(140))
VELOCITY = [-2.6777, -0.8187]  # the shot of the README's picture: balls 3 and 2 are potted


@pytest.fixture(scope="session")
def shot():
    return simulate(SCENE, PLACES, VELOCITY, record=True)


@pytest.fixture(scope="session")
def pit():
    """The same shot by PIT with a coarse timestep."""
    return simulate(SCENE, PLACES, VELOCITY, engine=Engine("pit", 1 / 60), record=True)


@pytest.fixture(scope="session")
def unrecorded():
    return simulate(SCENE, PLACES, VELOCITY)


@pytest.fixture(scope="session")
def elsewhere():
    """A shot on another table."""
    return simulate(Scene.named("carom"), [[0.5, 0.0], [0.0, 0.0], [-0.5, 0.3]], [1.0, 0.1], record=True)


@pytest.fixture(scope="session")
def jump():
    """A cue ball that jumps over ball 1 and off the table."""
    return simulate("jump_pool", [[0.5, 0.0], [0.75, 0.01]], [4.0, 0.2, -4.5], record=True)
