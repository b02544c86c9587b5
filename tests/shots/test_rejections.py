"""Wrong arguments of shots, batches, strikes, tracks and derivatives are refused."""

import dataclasses
import math
import re
from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, derivatives, simulate, simulate_batch, strike
from billiards_env.calibration.tracks import Track, check_tracks
from billiards_env.engine import PIC, Engine
from billiards_env.scene import Balls, Cue, Physics
from billiards_env.shots.result import ShotResult

POOL = Scene.named("pool")
PLACES = [[-0.5, 0.0], [0.5, 0.0]]
START = POOL, PLACES, [1.0, 0.0]
NAN = math.nan
FIXED = Scene(Balls((0.03, 0.03), (0.2, math.inf)))


def without_spin(motion):
    return dataclasses.replace(POOL, physics=Physics(motion=motion, cushion="restitution", max_time=1.0))


def one(scene: Any = POOL, **arguments: Any):
    """Returns a call of `simulate` with these arguments, those of a usual shot by default."""
    return lambda: simulate(scene, **{"positions": PLACES, "velocities": [1.0, 0.0], **arguments})


def many(m: Any = 2, **arguments: Any):
    """Returns a call of `simulate_batch`, as `one`."""
    return lambda: simulate_batch(POOL, **{"positions": [PLACES] * m, "velocities": [[1.0, 0.0]] * m, **arguments})


def engine(*arguments: Any):
    return lambda: Engine(*arguments)


def struck(**arguments: Any):
    return lambda: strike(**{"scene": POOL, "speed": 1.0, "heading": 0.0, **arguments})


def tracked(*tracks, name="a", times=None, positions=None):
    """Returns a call of `check_tracks` with a track of each list of balls."""

    def track(balls):
        places = np.zeros((len(balls), 2)) if positions is None else positions
        return Track(name, np.arange(len(balls), dtype=float) if times is None else times, np.array(balls), places)

    return lambda: check_tracks(POOL, [track(balls) for balls in tracks])


def of_shot(method, *arguments, start=START, engine=PIC, recorded=True, **options):
    """Returns a call of a method of a shot, or of a function of `derivatives`."""

    def call():
        shot = simulate(*start, record=recorded, engine=engine)
        function = getattr(derivatives, method, None) or getattr(ShotResult, method)
        result = function(shot, *arguments, **options)
        return list(result) if method == "sensitivities" else result

    return call


ONE_SHOT = [
    (one(positions=[PLACES]), "positions has shape (1, 2, 2): expected (2, 2), one row per ball"),
    (one(positions=[[0.0, 0.0], [0.0, 0.05]]), "positions: balls 0 and 1 are 0.05 m apart: expected at least"),
    (one(positions=[[0.0, 0.0], [1.25, 0.0]]), "positions: ball 1 is at [1.25, 0.0]: expected |x|"),
    (one(velocities=[1.0]), "velocities has shape (1,): expected (2, 2) for all balls or (2,) for the cue ball"),
    (one(velocities=[NAN, 0.0]), "velocities[0] = [nan, 0.0]: expected numbers from -1000 to 1000 m/s"),
    (one(spins=[1.0, 2.0]), "spins has shape (2,): expected (2, 3) for all balls or (3,) for the cue ball"),
    (one(spins=[0, 0, -1.1e6]), "spins[0] = [0.0, 0.0, -1100000.0]: expected numbers from"),
    (one(in_play=[True]), "in_play has shape (1,): expected (2,), one value per ball"),
    (one(FIXED, velocities=[[0, 0], [0, 0.1]]), "velocities[1] = [0.0, 0.1]: expected zero, the ball has an"),
    (one(without_spin("ideal"), spins=[0, 0, 0]), "spins = [0, 0, 0] with physics.motion = 'ideal': expected None"),
]
BATCHES = [
    (many(positions=PLACES), "positions has shape (2, 2): expected (m, 2, 2)"),
    (many(positions=[PLACES, [[0, 0], [0.05, 0]]]), "positions: shot 1, balls 0 and 1 are 0.05 m apart"),
    (many(velocities=[1, 0, 0]), "velocities has shape (3,): expected (2, 2, 2) for all balls or (2, 2) for"),
    (many(velocities=[[1, 0], [1e200, 0]]), "velocities[1][0] = [1e+200, 0.0]: expected numbers from"),
    (lambda: many()()[2], "batch[2]: expected an index from -2 to 1"),
    (many(physics={"mu_rol": [1, 1]}), "key of physics = 'mu_rol': expected one of "),
    (many(physics={"mu_roll": [0.1]}), "physics['mu_roll'] has shape (1,): expected (2,)"),
    (many(physics={"mu_roll": [0.1, -1]}), "shot 1: physics.mu_roll = -1.0: expected a number from 1e-12 to 10"),
    (
        many(physics={"e_cushion": [0.9, 0.6], "e_cushion_floor": [0.6, 0.7]}),
        "shot 1: physics.e_cushion_floor = 0.7: expected at most e_cushion = 0.6",
    ),
]
TIMESTEPS = [
    *(
        (
            engine("pit", dt),
            f"dt = {dt!r} with mode='pit': expected the timestep, a number from 1e-09 to 1e+06 s, such as 1/60",
        )
        for dt in (None, 0)
    ),
    (many(engine=Engine("pit", 0.1), physics={"dt": [0.1] * 3}), "physics['dt'] has shape (3,): expected (2,)"),
    (many(engine=Engine("pit", 0.1), physics={"dt": [0.1, 0]}), "shot 1: dt = 0.0 with mode='pit': expected the times"),
    (many(physics={"dt": [0.1, 0.1]}), "physics['dt'] with mode='pic': expected mode='pit', PIC has no timestep"),
    (
        engine("pit", 0.1, "pushapart"),
        "fix = 'pushapart': expected one of 'push_apart', 'move_back', 'none', 'time_of_impact' (did",
    ),
    (engine("pic", 1 / 60), "dt = 0.0166666666667 with mode='pic': expected None, PIC has no timestep"),
    (engine("pic", None, "none"), "fix = 'none' with mode='pic': expected None, PIC has no overlaps to fix"),
]
BACKWARDS = POOL, PLACES, strike(POOL, -1.5, 0.0)
DERIVATIVES = [
    (of_shot("jvp", {"positions": [1.0, 2.0]}), "tangents['positions'] has shape (2,): expected (2, 2)"),
    (of_shot("jvp", {"e_ball": 1.0}, "places"), "of = 'places'"),
    (of_shot("vjp", {"positions": 1.0}), "cotangents['positions'] has shape ()"),
    (of_shot("jacobian", "positions", "strike"), "strike = None"),
    (
        of_shot("jacobian", "positions", "strike", strike=[1, 0, 0, 0, 0]),
        "strike = [1.0, 0.0, 0.0, 0.0, 0.0]: expected the strike of",
    ),
    (
        of_shot("jacobian", "positions", "strike", start=BACKWARDS, strike=[-1.5, 0, 0, 0, 0]),
        "speed = -1.5: expected a number >= 0 for a derivative",
    ),
    (of_shot("sensitivity", recorded=False), "shots.log = None: expected recorded shots, from simulate or"),
    (of_shot("sensitivity", engine=Engine("pit", 0.1)), "shots.engine = 'PIT, dt = 1/10 s': expected 'PIC'"),
    (lambda: derivatives.vjp(many()(), {"positions": 1.0}), "shots.log = None: expected recorded shots"),
    (
        of_shot("sensitivities", [1.0, 0.5]),
        "times = [1.0, 0.5]: expected finite numbers of seconds >= 0 in ascending order",
    ),
    (of_shot("at", 0.1, recorded=False), "shot.at: the shot was not recorded, expected simulate(..., record=True)"),
    *((of_shot("at", t), f"t = {t!r}: expected a finite number of seconds >= 0") for t in (-1e-9, NAN, math.inf)),
    (
        of_shot("jacobian", "positions", "strike", strike=[1, 0, 0.6, 0, 0]),
        "offset of the tip = 0.6: expected at most 0.5 ball radii, no miscue",
    ),
]
STRIKES = [
    (struck(heading=11.0), "heading = 11.0: expected numbers from -10 to 10 rad"),
    (struck(side=1.1), "side = 1.1: expected numbers from -1 to 1 ball radii"),
    (struck(side=0.8, top=0.8), "(side, top) = [0.8, 0.8]: expected an offset of at most 1 ball radius"),
    (
        struck(speed=[1, 2], side=[0, 0, 0]),
        "shapes of speed (2,), heading (), side (3,), top (), elevation (): expected shapes that broadcast",
    ),
    (struck(scene=Scene.named("ideal")), "strike with physics.motion = 'ideal': expected motion 'sliding'"),
    (one(velocities=strike(POOL, 1.0, 0.0), spins=[0, 0, 1]), "spins = [0, 0, 1] with a Strike: expected None"),
    (lambda: Cue(miscue_offset=1.5), "cue.miscue_offset = 1.5: expected a number from 0.001 to 1 ball radii"),
    (
        lambda: dataclasses.replace(POOL, cue=Cue(tip_restitution=0.3)),
        "cue.tip_restitution = 0.3: expected at least 0.5",
    ),
]
ZEROS = [0, 0, 0, 0]
TRACKS = [
    (tracked(), "shots = []: expected one track or more"),
    (tracked(ZEROS, ZEROS), "shots['a'] appears twice"),
    (tracked(np.zeros(0, int)), "shots['a']: no rows: expected one or more"),
    (tracked([*ZEROS, 2]), "shots['a'].balls = [0, 2]: expected 0 to 1"),
    (tracked(ZEROS, times=[0, 1, NAN, 2]), "shots['a'].times = [0.0, 1.0, nan, 2.0]: expected finite numbers"),
    (tracked(ZEROS, times=[1.0] * 4), "shots['a']: ball 0 has two rows at 1 s: expected one"),
    (tracked(ZEROS, times=[0, 1, 2, -1e300]), "shots['a'].times = [0.0, 1.0, 2.0, -1e+300]: expected at most 1e+12 s"),
    (tracked(ZEROS, positions=np.zeros((3, 2))), "shots['a'].positions has shape (3, 2): expected (4, 2)"),
]


WRONG = [*ONE_SHOT, *BATCHES, *TIMESTEPS, *DERIVATIVES, *STRIKES, *TRACKS]


@pytest.mark.parametrize(("call", "message"), WRONG, ids=[message for _, message in WRONG])
def test_a_wrong_argument_is_refused(call, message):
    with pytest.raises((IndexError, TypeError, ValueError), match=re.escape(message)) as error:
        call()
    assert str(error.value).startswith(message)
