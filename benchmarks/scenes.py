"""The scenes of one comparison or one data set. `import benchmarks` adds them to those of `Scene.named`.

"pooltool_carom", "pooltool_real_carom" and "pooltool_pool" have the laws and the numbers of shots of pooltool 0.6.
"match_carom_2" is a later fit than "match_carom" to the shots of a match table, see `benchmarks.real_tracks`.
"""

from __future__ import annotations

import dataclasses

from billiards_env.scene import Cue, NamedScene, Physics, Scene, Table

POOLTOOL_CUE = Cue(mass=0.567, tip_restitution=1.0, end_mass=0.0056699, miscue_offset=1.0)
"""The cue of pooltool 0.6, which has an elastic tip and no miscues."""


def _spin_decay(radius: float) -> float:
    # pooltool's spin coefficient is a length, 4/9 of a radius; its spin decays at 5 mu_spin g / (2 R).
    return 5 * (4 / 90 * 10 * radius) * 9.81 / (2 * radius)


def _with_laws_of_pooltool(scene: Scene, **numbers: float) -> Scene:
    physics = {"e_ball": 1.0, "spin_decay": _spin_decay(scene.balls.radius[0]), **numbers}
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **physics))


def _pooltool_carom(n_balls: int) -> Scene:
    return _with_laws_of_pooltool(Scene.named("carom", n_balls - 1), mu_cushion=0.15)


def _pooltool_real_carom(n_balls: int) -> Scene:
    scene = _with_laws_of_pooltool(Scene.named("real_carom", n_balls - 1), mu_cushion=0.15)
    return dataclasses.replace(scene, cue=POOLTOOL_CUE)


def _pooltool_pool(n_balls: int) -> Scene:
    scene = dataclasses.replace(Scene.named("real_pool", n_balls - 1), table=Table.named("pool_7ft"), cue=POOLTOOL_CUE)
    return _with_laws_of_pooltool(scene, mu_cushion=0.2)


def _match_carom_2(n_balls: int) -> Scene:
    """Returns a scene fitted to the shots of "match_carom", with another term of the cushions, see docs/validation.md.

    The gain by the slip replaces the gain by the topspin. The 95% intervals of the fit are mu_slide 0.168 to 0.201,
    mu_roll 0.0033 to 0.0037, mu_roll_speed 0.0022 to 0.0028 s/m, spin_decay 0.9 to 4.2 rad/s^2, e_ball 0.947 to 0.957,
    mu_ball_factor 0.89 to 1.49, mu_ball_decay 0.08 to 0.33 s/m, e_cushion 0.815 to 0.843, e_cushion_loss 0.003 to 0.023
    s/m, e_cushion_slip 0.067 to 0.126, e_cushion_tangent 0.07 to 0.25 and mu_cushion 0.217 to 0.221.
    """
    physics = Physics(
        ball_ball="frictional",
        cushion="han2005_variable",
        mu_slide=0.185,
        mu_roll=0.0035,
        mu_roll_speed=0.0025,
        spin_decay=2.5,
        e_ball=0.952,
        mu_ball_factor=1.19,
        mu_ball_decay=0.2,
        e_cushion=0.829,
        e_cushion_loss=0.013,
        e_cushion_slip=0.097,
        e_cushion_tangent=0.16,
        mu_cushion=0.219,
    )
    return dataclasses.replace(Scene.named("carom", n_balls - 1), physics=physics)


SCENES = {
    "pooltool_carom": NamedScene(_pooltool_carom, 2, 15),
    "pooltool_real_carom": NamedScene(_pooltool_real_carom, 2, 15),
    "pooltool_pool": NamedScene(_pooltool_pool, 1, 15),
    "match_carom_2": NamedScene(_match_carom_2, 2, 15),
}
