"""The aim for the ball and the pocket under the mouse."""

from __future__ import annotations

import numpy as np

from billiards_env.games import Stroke
from billiards_env.games.game_state import is_in, members, on_table
from billiards_env.games.placement import Point
from billiards_env.play.model import WindowModel
from billiards_env.players.aim import FirstTouch, Pot, aim

REACH = 1.5
"""A pocket or a ball is under the mouse within this distance of its centre, over its radius."""

SHOTS = 3_000
"""The largest number of random shots to begin with. Around a rack of 15 balls they take some seconds."""


def pot_at(model: WindowModel, point: Point) -> Pot | None:
    """Returns the pot at a point, m: a ball there into any pocket, or the ball that is aimed at into a pocket there."""
    scene, positions = model.setup.scene, model.game.positions
    for number, pocket in enumerate(scene.table.pockets):
        if np.hypot(pocket.x - point[0], pocket.y - point[1]) <= REACH * pocket.radius:
            ball = -1 if model.preview is None else model.preview.ball
            return Pot(ball, number) if ball >= 0 else None
    for ball in members(model.game.state.object_balls):
        if np.hypot(*(positions[ball] - point)) <= REACH * scene.balls.radius[ball]:
            return Pot(ball) if scene.table.pockets else None
    return None


def stroke_for(model: WindowModel, pot: Pot) -> Stroke | None:
    """Returns the stroke for a pot with a level cue and no english; None if there is none."""
    scene, positions = model.setup.scene, model.game.positions.copy()
    positions[model.cue] = model.cue_position
    in_play = is_in(on_table(model.game.state), scene.n_balls)
    goals, strike = (FirstTouch(pot.ball), pot), scene.physics.motion == "sliding"
    aimed = aim(scene, positions, goals, max_speed=model.max_speed, in_play=in_play, strike=strike, shots=SHOTS)
    (x, y), (*_, place, call) = aimed.velocity.tolist(), model.aim
    return Stroke((x, y), place, call=call) if aimed.solved else None
