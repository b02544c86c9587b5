"""A package with a task, a feature, a measure, an action, a layout, a scene, a game and a player of its own."""

import math

import numpy as np

from billiards_env import (
    Scene,
    register_action,
    register_feature,
    register_game,
    register_layout,
    register_measure,
    register_player,
    register_scene,
    register_task,
)
from billiards_env.engine.measures import AFTER_IMPACT, START, Measure
from billiards_env.envs.actions import Action
from billiards_env.envs.observations import Feature
from billiards_env.envs.tasks import Task
from billiards_env.games.entry import Game
from billiards_env.games.game_state import NO_FOUL, end, verdict
from billiards_env.games.pool import any_ball, standard_foul
from billiards_env.jit import entry_point, inlined, kernel
from billiards_env.players.named import PlayerEntry
from billiards_env.players.situation import placed
from billiards_env.scene import NamedScene
from billiards_env.scene.layouts import make_plan

LEAST = 1  # cushion contacts
WORTH = 1  # points


@kernel
def judge_cushion_first(k, numbers, arrays):
    """Touches ball 1 after a cushion: WORTH points. The episode is decided if the cue ball is potted."""
    success = arrays.cushions_before_hit[k, 1] >= LEAST
    return (WORTH if success else 0), arrays.potted[k, 0], success


register_task("cushion_first", Task(judge=judge_cushion_first, layout="from_the_corner", scene="slow_pool"))


@entry_point
def write_from_centre(begin, end, observations, first, positions, radius):
    """Writes the distance of the cue ball from the centre of the table, divided by the largest one."""
    for k in range(begin, end):
        x, y = positions[k, 0, 0], positions[k, 0, 1]
        observations[k, first] = min(math.sqrt(x * x + y * y) / radius, 1.0)


register_feature(
    "from_centre",
    Feature(
        "the distance of the cue ball from the centre of the table, divided by the largest one",
        (),
        0.0,
        write_from_centre,
        lambda source: (source.arrays.positions, float(np.hypot(*source.scene.half_extents))),
    ),
)


@inlined
def record_impacts(moment, i, j, k, scene, state, shots):
    """Counts the impacts of balls."""
    if moment == START:
        shots.measures[k].impacts = 0.0
    elif moment == AFTER_IMPACT:
        shots.measures[k].impacts += 1.0


register_measure(
    "impacts", Measure("the number of impacts of balls", (), record_impacts, lambda scene, max_speed: 100.0)
)


class Polar:
    """Converts headings and speeds, each from -1 to 1, to the action "velocity"."""

    choices = 0

    def strokes(self, actions, tables):
        """Returns the velocities (k, 2) of the cue balls, divided by the largest speed, for actions (k, 2)."""
        heading, speed = np.pi * actions[:, 0], 0.5 * (1.0 + actions[:, 1]).clip(0.0, 2.0)
        return np.column_stack((speed * np.cos(heading), speed * np.sin(heading)))


register_action("polar", Action("heading in half turns, and speed", 2, lambda scene, max_speed: Polar()))


def from_the_corner(name, scene):
    """The cue ball lies near a corner, and the other balls are drawn."""
    spots = np.zeros((scene.n_balls, 2))
    spots[0] = -0.45 * scene.table.length, -0.4 * scene.table.width
    return make_plan(name, scene, range(1, scene.n_balls), spots)


register_layout("from_the_corner", from_the_corner)


def slow_pool(n_balls):
    """A pool table with slow cloth."""
    return Scene.from_dict({"base": "pool", "n_object_balls": n_balls - 1, "physics": {"mu_roll": 0.02}})


register_scene("slow_pool", NamedScene(slow_pool, usual=2, most=15))


@inlined
def first_pot(state, facts, call):
    """The first player who pots a ball without a foul wins."""
    foul = standard_foul(facts, state.object_balls)
    if foul == NO_FOUL and facts.potted != 0:
        end(state, state.player)
    return verdict(foul=foul)


register_game(
    "first_pot",
    Game(
        judge=first_pot,
        legal=any_ball,
        scene="slow_pool",
        layouts=("from_the_corner", "random"),
        n_object_balls=(1, 15),
        won_by="the first pot",
        page=(("to win", "pot a ball without a foul"),),
    ),
)


def at_nearest(share):
    """Returns a player who hits the nearest ball full, with a share of the largest speed."""

    def player(situation, rng):
        situation = placed(situation, rng)  # a cue ball in hand
        _, ((x, y),) = situation.table.nearest()
        action = np.zeros(situation.action_size)
        action[:2] = share / math.hypot(x, y) * np.array([x, y])
        return situation.stroke(action)

    return player


register_player("at_nearest", PlayerEntry(lambda share, where: at_nearest(float(share)), argument="0.5"))
