"""The table of the laws of two balls: a new entry plays and has derivatives, and other scenes stay as they are."""

import json
import math

import numpy as np
import pytest

from billiards_env.physics.laws.tables import BALL_LAWS, CUSHIONS
from billiards_env.scene import scene as scenes
from tests.helpers.made_up_law import types_of_scenes
from tests.helpers.processes import run


def test_the_names_of_laws_say_which_have_friction():
    assert {name: law.friction is not None for name, law in BALL_LAWS.items()} == scenes.BALL_BALL_NAMES
    assert list(CUSHIONS) == list(scenes.CUSHION_NAMES)


def test_a_new_entry_of_the_table_is_a_law():
    out, _ = run("-m", "tests.helpers.made_up_law")
    result = json.loads(out)
    e = scenes.Physics().e_ball

    full = result["full"]
    (before, _), (after, _), _ = full["velocities"]
    assert after - before == pytest.approx(full["closing"] * e / (1 + 0.1 * full["closing"]), rel=1e-12)

    thin = result["thin"]
    pushed, slip = np.array(thin["velocities"][1]), thin["closing"] / 0.8 * 0.6  # the cut has the cosine 0.8
    across, along = pushed @ [0.6, 0.8], pushed @ [0.8, -0.6]
    assert across / along == pytest.approx(0.5 * 0.2 / (1 + slip), rel=1e-8)

    both = result["two at once"]
    cue, *balls = np.array(both["velocities"])
    up = (1.0 + 1e-3) / 2.0
    for ball, side in zip(balls, (up, -up), strict=True):
        leaving = (ball - cue) @ [math.sqrt(1.0 - up**2), side]
        assert leaving == pytest.approx(both["closing"] * e / (1 + 0.1 * both["closing"]), rel=1e-9)

    np.testing.assert_allclose(result["derivative"], result["difference"], rtol=1e-6, atol=1e-6)
    assert result["types"] == types_of_scenes()  # nothing else is compiled for another scene
