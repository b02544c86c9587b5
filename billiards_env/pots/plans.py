"""The action "plan": a choice of an object ball, a pocket and a speed, made into a shot by geometry.

A plan is a whole number, `(ball - 1, pocket, speed)` in row-major order. `pots.finder` finds the pots of all tables in
one call: the direct ones and, on a table without any, those off one cushion. A plan that is not one of these pots is a
full hit on the nearest ball that may be touched first. The mask has 1 for each pot. On a table without a pot it is 1
everywhere.

The geometry has the physics of the scene, without the changes of `randomize`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from billiards_env.envs.actions import Action
from billiards_env.pots.finder import DX, DY, SPEED, SPEEDS, find_pots
from billiards_env.scene import Scene
from billiards_env.shots.tables import Tables

Floats = NDArray[np.float64]


class Plans:
    """The plans in a scene.

    Args:
        scene: The scene.

    Attributes:
        shape: The numbers of object balls, pockets and speeds.
        choices: Their product.

    Raises:
        ValueError: If there are no pockets or no object balls.
    """

    def __init__(self, scene: Scene) -> None:
        self.shape = scene.n_balls - 1, len(scene.table.pockets), len(SPEEDS)
        self.choices = int(np.prod(self.shape))
        if not self.choices:
            raise ValueError("action = 'plan': expected an object ball and a table with pockets")

    def strokes(self, plans: Floats, tables: Tables) -> Floats:
        """Returns the velocities (k, 2) of the cue balls, divided by the largest speed, for plans (k,).

        Raises:
            ValueError: If a plan is not a whole number in its range.
        """
        bad = plans[(plans % 1 != 0) | (plans < 0) | (plans >= self.choices)]
        if bad.size:
            raise ValueError(f"action = {bad[0]:g}: expected a whole number from 0 to {self.choices - 1}")
        rows = np.arange(len(plans))
        chosen = self._pots(tables).reshape(-1, self.choices, 2)[rows, plans.astype(np.int64)]
        _, ways = tables.nearest()
        speeds = (plans % len(SPEEDS) + 1.0) / len(SPEEDS)
        full = (speeds / np.maximum(np.hypot(*ways.T), 1e-300))[:, None] * ways
        return np.where(chosen.any(axis=1, keepdims=True), chosen, full)

    def mask(self, tables: Tables) -> NDArray[np.int8]:
        """Returns the plans that are pots, (k, choices): 1 or 0."""
        possible = self._pots(tables).any(axis=-1).reshape(-1, self.choices)
        return (possible | ~possible.any(axis=1, keepdims=True)).astype(np.int8)

    def _pots(self, tables: Tables) -> Floats:
        """Returns the strokes (k, *shape, 2) of all plans, 0 for a plan without a pot."""
        objects = np.broadcast_to(np.arange(tables.in_play.shape[1]) > 0, tables.in_play.shape)
        pots = find_pots(tables._replace(legal=objects))
        by_choice = np.zeros((len(tables.positions), *self.shape, 2))
        for j in range(pots.ball.shape[1])[::-1]:  # of several banks the one with the largest tolerance comes last
            which = np.flatnonzero(j < pots.count)
            shots = pots.shots[which, j]
            strokes = shots[..., SPEED, None] / tables.max_speed * shots[..., DX : DY + 1]
            by_choice[which, pots.ball[which, j] - 1, pots.pocket[which, j]] = strokes
        return by_choice * tables.legal[:, 1:, None, None, None]


PLAN = Action(
    "one whole number, which chooses an object ball, a pocket and one of 5 speeds; geometry computes the shot",
    2,
    lambda scene, max_speed: Plans(scene),
    is_choice=True,
)
