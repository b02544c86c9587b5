"""A law of two balls that the package does not have. `python -m tests.helpers.made_up_law` plays it and prints JSON."""

import json
import sys

import numba
import numpy as np

from billiards_env.jit import inlined
from billiards_env.physics.laws.balls import BallLaw
from billiards_env.scene import SCENES, Balls, Physics, Scene, scene


@inlined
def restitution(numbers, closing):
    return numbers.e_ball / (1.0 + 0.1 * closing)


@inlined
def friction(numbers, speed):
    return 0.5 * numbers.mu_limit / (1.0 + speed)


BALLS = BallLaw(restitution, friction)


def types_of_scenes():
    """Returns the types of the arguments that compiled functions have for each named scene."""
    from billiards_env.engine.compile import scene_fields, scene_kernels

    scenes = {name: Scene.named(name) for name in SCENES}
    return {name: str(numba.typeof((scene_kernels(one), scene_fields(one)))) for name, one in scenes.items()}


def results_of(law):
    """Returns facts about shots of three balls with a law. The modules that are imported here look the law up."""
    from billiards_env import derivatives
    from tests.helpers.shots import simulate

    scenes = [Scene(Balls.uniform(3), physics=Physics(ball_ball=law, mu_ball=mu)) for mu in (0.0, 0.2)]
    radius, away = scenes[0].balls.radius[0], [0.9, 0.5]

    def first_hit(scene, places):
        shot = simulate(scene, places, [2.0, 0.0], record=True)
        hit = shot.events[shot.events["kind"] == "ball_ball"][0]
        return {"closing": float(hit["speed"]), "velocities": shot.motion_at(hit["time"])[0].tolist()}

    gap, start = radius * (1.0 + 1e-3), np.array([[-0.3, 0.03], [0.0, 0.0], away])
    way, step = np.array([0.3, 0.7]), 1e-6
    ends = [simulate(scenes[1], start, [2.0, 0.1] + sign * step * way).positions for sign in (1, -1)]
    shot = simulate(scenes[1], start, [2.0, 0.1], record=True)
    return {
        "full": first_hit(scenes[0], [[-0.3, 0.0], [0.0, 0.0], away]),
        "thin": first_hit(scenes[1], [[-1.6 * radius - 1e-11, 1.2 * radius], [0.0, 0.0], away]),
        "two at once": first_hit(scenes[0], [[-0.3, 0.0], [0.0, gap], [0.0, -gap]]),
        "derivative": np.asarray(derivatives.jvp(shot, {"velocities": np.vstack((way, np.zeros((2, 2))))})).tolist(),
        "difference": ((ends[0] - ends[1]) / (2 * step)).tolist(),
    }


if __name__ == "__main__":
    scene.BALL_BALL_NAMES["made_up"] = True
    sys.modules["billiards_env.physics.laws.balls_made_up"] = sys.modules["__main__"]
    print(json.dumps(results_of("made_up") | {"types": types_of_scenes()}))
