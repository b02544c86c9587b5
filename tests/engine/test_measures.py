import math
from typing import Any

import numpy as np
import pytest

from billiards_env import Engine, Scene
from billiards_env.engine.measures import MEASURES, record_nothing
from billiards_env.engine.overlaps import FIXES
from billiards_env.engine.pic import ALL_PAIRS, PicKernels
from billiards_env.envs import make_env, make_vector_env
from billiards_env.envs.tasks import TASKS, Task, register_task
from billiards_env.games import Setup, custom_opening, play
from billiards_env.games.facts import facts_of_shots, first
from billiards_env.games.playing import Stroke
from billiards_env.games.referee import GAMES, register_game
from billiards_env.jit import inlined, kernel
from billiards_env.physics.state import X
from billiards_env.shots import simulation
from tests.helpers.environments import same
from tests.helpers.shots import BALL_ARRAYS, simulate

simulate_batch: Any = simulation.simulate_batch  # untyped, because `measures` may be None by its type

NAME = "first_hit_velocities"
ENGINES = [Engine(), Engine("pit", 1e-3)]
STARTS = [[0.0, 0.0], [0.3, 0.01], [-0.6, 0.3]]
AWAY, TOWARDS = [-1.0, 0.0], [2.0, 0.0]
engines = pytest.mark.parametrize("engine", ENGINES, ids=str)


@engines
def test_the_velocities_at_the_first_contact_are_those_of_the_trajectories(engine):
    shot = simulate("pool", STARTS, TOWARDS, engine=engine, record=True, measures=[NAME])
    before, after = shot.measures[NAME]
    assert shot.first_hit == 1
    assert after.tolist() == shot.motion_at(shot.first_hit_time)[0][:2].tolist()
    assert before == pytest.approx(shot.motion_at(shot.first_hit_time - 1e-9)[0][:2], abs=1e-7)
    assert before[1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("fix", FIXES)
def test_the_velocities_of_an_impact_are_those_before_the_rest_of_the_timestep(fix):
    shot = simulate("pool", STARTS, TOWARDS, engine=Engine("pit", 1 / 60, fix), measures=[NAME])
    before, after = shot.measures[NAME]
    assert after.sum(axis=0) == pytest.approx(before.sum(axis=0), abs=1e-12)  # friction of the cloth would change it


@engines
def test_measures_change_no_other_result_and_shots_without_them_have_none(engine):
    shots = "pool", [STARTS] * 2, [AWAY, TOWARDS]
    plain, batch = (simulate_batch(*shots, engine=engine, measures=names) for names in ((), [NAME]))
    for name in BALL_ARRAYS:
        same(getattr(batch, name), getattr(plain, name))
    assert plain.measures is plain[0].measures is simulate("pool", STARTS, AWAY, engine=engine).measures is None
    assert np.isinf(batch.measures[NAME][0]).all()
    recorded = simulate_batch(*shots, engine=engine, measures=[NAME], record=True)
    one = simulate("pool", STARTS, TOWARDS, engine=engine, measures=[NAME])
    for shot in (batch[1], recorded[1], one):
        same(shot.measures.tobytes(), batch.measures[1].tobytes())


def test_shots_without_measures_are_compiled_with_a_kernel_that_records_nothing():
    scene = Scene.named("pool", 1)
    assert PicKernels(scene.physics, ALL_PAIRS).record is record_nothing  # pyright: ignore[reportArgumentType]


def test_of_several_balls_that_are_hit_at_once_the_first_one_counts():
    places = [[-0.5, 0.0], [0.0, 0.05], [0.0, -0.05]]
    shot = simulate("ideal", places, [1.0, 0.0], measures=[NAME], max_time=2.0, record=True)
    assert shot.touched_first.tolist() == [False, True, True]
    (cue, one), (cue_after, one_after) = shot.measures[NAME].tolist()
    assert (cue, one) == ([1.0, 0.0], [0.0, 0.0])
    moving = shot.motion_at(shot.first_hit_time)[0]
    assert (cue_after, one_after) == (moving[0].tolist(), moving[1].tolist())


FLIGHT, OVER = Scene.named("jump_pool", 3), "times_over"
REACH = 2 * FLIGHT.balls.radius[0]
LINE = [[-0.6, 0.0], [-0.3, 0.0], [0.2, 0.0], [0.0, 0.4]]


def over(velocity, places=LINE, **options: Any) -> Any:
    """Plays a shot in a scene with flight. Returns it, and the time at which the cue ball comes over each ball."""
    shot: Any = simulate(FLIGHT, places, velocity, measures=[OVER], record=True, **options)
    times = shot.measures[OVER]
    return shot, {ball: times[ball] for ball in np.flatnonzero(np.isfinite(times)).tolist()}


@engines
def test_the_time_at_which_the_cue_ball_flies_over_a_ball(engine):
    shot, times = over([2.0, 0.0, 1.5], engine=engine)
    assert (shot.first_hit, times) == (2, {1: pytest.approx((0.3 - REACH) / 2.0, abs=1e-15)})
    shot, times = over([2.0, 0.0, 1.5], [LINE[0], [-0.3, REACH - 1e-9], *LINE[2:]], engine=engine)
    assert (shot.first_hit, times.keys()) == (2, {1})  # a part of the ball is enough
    shot, times = over([2.0, 0.0, 1.5], [LINE[0], [-0.3, REACH + 1e-9], *LINE[2:]], engine=engine)
    assert (shot.first_hit, times) == (2, {})


@engines
def test_the_ball_that_the_cue_ball_hits_in_the_air_is_not_flown_over(engine):
    shot, times = over([1.0, 0.0, 1.2], engine=engine)
    assert (shot.first_hit, times) == (1, {})
    assert shot.heights_at(shot.first_hit_time)[0] > 0.0


@engines
def test_balls_beyond_the_end_of_a_flight_and_after_the_first_contact_are_not_flown_over(engine):
    assert over([2.0, 0.0, 0.0], engine=engine)[1] == {}
    shot, times = over([2.0, 0.0, 1.5], engine=engine, max_time=0.1)
    assert (shot.first_hit, times) == (-1, {})
    behind = [LINE[0], [-0.5, 0.0], [-0.5 + 1.8 * REACH, 0.0], LINE[3]]
    shot, times = over([4.0, 0.0, 1.5], behind, engine=engine)  # it hits the first ball and jumps over the next one
    assert (shot.first_hit, times) == (1, {})


def test_a_ball_that_was_flown_over_before_may_be_the_first_one_to_be_hit():
    shot, times = over([3.0, 0.0, 1.2], [[0.0, 0.0], [0.3, 0.0], [-1.0, 0.3], LINE[3]])
    assert (shot.first_hit, shot.cushions_before_hit[1]) == (1, 1)
    assert times == {1: pytest.approx((0.3 - REACH) / 3.0, abs=1e-15)}


@pytest.mark.parametrize("seed", range(20))
def test_flights_over_balls_are_those_of_the_trajectory(seed):
    rng = np.random.default_rng(seed)
    places = [[-0.9, 0.0], *rng.uniform([-0.7, -0.15], [1.1, 0.15], (3, 2))]
    if np.hypot(*(np.array(places)[:, None] - places).T)[np.triu_indices(4, 1)].min() < REACH:
        pytest.skip("the balls overlap")
    shot, times = over([rng.uniform(1, 4), rng.uniform(-0.4, 0.4), rng.uniform(-4, 3)], places)
    seen: dict[int, float] = {}
    for t in np.arange(0.0, min(shot.first_hit_time, shot.time), 2e-4):
        if shot.heights_at(t)[0] > 1e-9:
            away = np.hypot(*(shot.at(t)[1:] - shot.at(t)[0]).T)
            for ball in np.flatnonzero(away < REACH).tolist():
                seen.setdefault(ball + 1, t)
    ends = [event["time"] for event in shot.events if 0 in (event["ball"], event["other"])]
    last = max([0.0, *(t for t in ends if t < shot.first_hit_time)])  # the start of the flight before the first contact
    seen = {ball: t for ball, t in seen.items() if t < last or not shot.touched_first[ball]}
    assert times == pytest.approx(seen, abs=2.1e-4)


@pytest.mark.parametrize("names", [["speed"], NAME])
def test_wrong_names_are_refused(names):
    with pytest.raises((TypeError, ValueError), match=r"measures = |name in measures = 'speed': expected one of"):
        simulate("pool", STARTS, AWAY, measures=names)


@pytest.mark.parametrize(("add", "entry"), [(register_task, TASKS["pot"]), (register_game, GAMES["straight"])])
def test_entries_with_unknown_measures_are_refused(add, entry):
    with pytest.raises(ValueError, match="name in measures = 'speed': expected one of"):
        add("mine", entry._replace(measures=("speed",)))


SLOW = 1.0  # m/s


@kernel
def judge_soft_hit(k, numbers, arrays):
    """Touches an object ball with a cue ball that is slower than SLOW along x."""
    success = abs(arrays.measures[k].first_hit_velocities[0, 0, X]) < SLOW
    return (1 if success else 0), False, success


def test_a_task_uses_a_measure_and_the_info_has_it(monkeypatch):
    monkeypatch.setitem(TASKS, "soft_hit", Task(judge=judge_soft_hit, layout="random", measures=(NAME,)))
    env = make_env(task="soft_hit", max_shots=4)
    _, info = env.reset(seed=0, options={"positions": STARTS[:2]})
    assert np.isinf(info[NAME]).all()
    rewards = []
    for action in (AWAY, TOWARDS, TOWARDS):
        state = env.get_state()
        state["positions"] = STARTS[:2]
        env.set_state(state)
        _, reward, *_, info = env.step(np.array(action) * (1.0 if len(rewards) < 2 else 0.4) / 4.0)
        rewards.append(reward)
        assert math.isinf(info[NAME][0, 0, X]) == (info["first_hit"] < 0)
    assert rewards == [0.0, 0.0, 1.0]


def test_the_observation_has_the_measure_of_the_last_shot_of_the_episode():
    options = {"observe": [NAME], "max_shots": 3, "max_speed": 2.0}
    env, envs = make_env(**options), make_vector_env(2, **options)
    observation, _ = env.reset(seed=0, options={"positions": STARTS[:2]})
    envs.reset(seed=0, options={"positions": STARTS[:2]})
    assert observation.tolist() == [0.0] * 8
    observation, *_, info = env.step([1.0, 0.0])
    many, *_, infos = envs.step([[1.0, 0.0], [-0.1, 0.0]])
    expected = (info[NAME] / 2.0).astype(np.float32)
    same(env.decode(observation)[NAME], expected)
    same(many[0], observation)
    same(infos[NAME][0], info[NAME])
    assert many[1].tolist() == [0.0] * 8
    assert env.get_state()["measures"][NAME].tolist() == info[NAME].tolist()
    assert env.reset()[0].tolist() == [0.0] * 8


def test_a_step_of_some_environments_keeps_the_measures_of_the_others():
    envs = make_vector_env(2, observe=[NAME], max_shots=3, max_speed=2.0)
    envs.reset(seed=0, options={"positions": STARTS[:2]})
    before, *_ = envs.step([[0.3, 0.0]] * 2)
    measures = envs.get_state()["measures"]
    after, *_ = envs.step_where(np.array([True, False]), [[-0.1, 0.0]] * 2)
    assert before[1].any()
    assert not after[0].any()
    same(after[1], before[1])
    same(envs.get_state()["measures"][1].tobytes(), measures[1].tobytes())


@inlined
def is_soft(shots, k, bits) -> bool:
    """Whether the cue ball was slower than SLOW along x at its first contact."""
    return abs(shots.measures[k].first_hit_velocities[0, 0, X]) < SLOW


def test_a_game_uses_a_measure(monkeypatch):
    game = GAMES["straight"]
    monkeypatch.setitem(GAMES, "straight", game._replace(facts=(*game.facts, is_soft), measures=(NAME,)))
    setup = Setup("straight", Scene.named("pool", 2))
    opening = custom_opening(setup, STARTS)
    for speed, expected in ((0.9, True), (2.0, False)):
        played = play(setup, opening, Stroke(velocity=np.array([speed, 0.0]), spin=(0.0, 0.0, 0.0)))
        assert played.facts["is_soft"] == expected
    env = make_env(task="straight", n_players=2, n_object_balls=2, layout="random")
    env.reset(seed=0)
    assert env.step(env.action_space.sample())[4][NAME].shape == MEASURES[NAME].shape


def test_facts_do_not_need_measures():
    batch = simulate_batch("pool", [STARTS], [TOWARDS])
    assert facts_of_shots((first,), batch)["first"].tolist() == [2]
