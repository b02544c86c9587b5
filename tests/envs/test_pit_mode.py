"""Billiards-v0 with mode="pit", the engine with a fixed timestep."""

import gymnasium as gym
import numpy as np
import pytest

from billiards_env.engine.overlaps import FIXES
from billiards_env.envs import STATUS, BilliardsEnv
from billiards_env.envs.wrappers import VectorActionFrame
from studies.failures import FAILURES

TIMESTEP = 1 / 60
FEW = (
    {"n_object_balls": 9, "layout": "rack", "max_shots": 5, "max_speed": 8.0},
    {"scene": "carom", "task": "carom", "max_shots": 5, "observe_shots_left": True},
    {"scene": "ideal", "task": "carom", "layout": "random", "n_object_balls": 5, "max_shots": 5, "max_speed": 10.0},
)


def make(**kwargs):
    return gym.make("Billiards-v0", **{"mode": "pit", "dt": TIMESTEP, **kwargs})


def episode(env, seed):
    """Returns all observations and rewards of an episode of random shots, and the last info."""
    rng = np.random.default_rng(seed)
    log, terminated, info = [(env.reset(seed=seed)[0], 0.0)], False, {}
    while not terminated:
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, 2).astype(np.float32))
        assert not truncated
        log.append((observation, reward))
    return log, info


@pytest.mark.parametrize("kwargs", FEW, ids=lambda kwargs: ",".join(map(str, kwargs.values()))[:60])
@pytest.mark.parametrize(("fix", "dt"), list(zip(FIXES, (1 / 15, TIMESTEP, 1 / 240, 1 / 30), strict=True)))
def test_episodes_of_several_shots_stay_in_the_observation_space(kwargs, fix, dt):
    env = BilliardsEnv(**kwargs, mode="pit", fix=fix, dt=dt)
    for seed in range(4):
        log, info = episode(env, seed)
        assert all(observation in env.observation_space for observation, _ in log)
        assert STATUS[info["status_code"]] in ("rest", "max_time")
        on_table = np.abs(log[-1][0][: 2 * env.scene.n_balls]).reshape(-1, 2).max(axis=1) < 1
        assert not (on_table & info["potted"]).any()


def test_without_a_fix_balls_may_overlap_before_the_next_shot():
    # 4 m/s in steps of 1/15 s: without a fix some balls come to rest deep inside another ball or beyond a cushion
    env = BilliardsEnv(n_object_balls=9, layout="tight_rack", max_shots=20, mode="pit", dt=1 / 15, fix="none")
    deepest, beyond = 0.0, -np.inf
    room = np.array([env.scene.table.length, env.scene.table.width]) / 2 - env.scene.balls.radius[0]
    for seed in range(10):
        env.reset(seed=seed)
        rng = np.random.default_rng(seed)
        terminated = False
        while not terminated:
            observation, _, terminated, _, info = env.step(rng.uniform(-1, 1, 2))
            assert observation in env.observation_space
            assert STATUS[info["status_code"]] == "rest"
            places = env._episodes.shots.positions[0][~info["potted"]]
            apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.diag(np.full(len(places), np.inf))
            deepest = max(deepest, 2 * env.scene.balls.radius[0] - apart.min())
            beyond = max(beyond, (np.abs(places) - room).max())
    assert deepest > 1e-3
    assert beyond > 1e-4


@pytest.mark.parametrize(
    ("world", "through"),
    [({}, False), *(({"mode": "pit", "dt": 1 / n}, n <= 60) for n in (15, 30, 60, 240))],
    ids=lambda world: str(world),
)
def test_fast_shots_pass_through_the_ball_in_front_of_the_target_with_a_coarse_timestep(world, through):
    # 4 to 8 m/s: up to 13 cm in 1/60 s; the balls overlap on 11 cm of the path.
    hidden = {"scene": "blocked_pool", "layout": "snookered", "max_speed": 8.0, **world}
    envs = VectorActionFrame(gym.make_vec("Billiards-v0", num_envs=500, **hidden), "cut")
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform((-1, 0), 1, (500, 2))
    infos = envs.step(actions)[4]["final_info"]
    share = (infos["first_hit"] == 1).mean()
    assert share > 0.05 if through else share == 0
    # The post does not count as a potted ball.
    assert (infos["is_success"] == (infos["potted"][:, 1] & ~infos["scratch"])).all()


def test_the_timestep_changes_the_end_of_an_episode_but_not_its_start():
    exact, coarse = gym.make("Billiards-v0", max_shots=1), make(max_shots=1)
    differ = []
    for seed in range(20):
        (first, start), (last, end) = ([observation for observation, _ in episode(e, seed)[0]] for e in (exact, coarse))
        assert np.array_equal(first, last)
        differ.append(not np.array_equal(start, end))
    assert any(differ)


def test_fix_and_dt_reach_the_engine():
    ends = {
        (fix, dt): episode(make(scene="carom", task="carom", max_shots=5, fix=fix, dt=dt), 0)[0][-1][0].tobytes()
        for fix in (None, *FIXES)
        for dt in (1 / 15, 1 / 30)
    }
    assert ends[None, 1 / 15] == ends["push_apart", 1 / 15]
    assert len(set(ends.values())) == 2 * len(FIXES)


def test_a_missed_collision_costs_the_point():
    # 6 m/s: at one timestep the cue ball is 12 cm before the other ball, at the next 12 cm behind it
    case = FAILURES["missed_collision"]
    rewards = []
    for engine in ({}, {"mode": "pit", "dt": case.dt}):
        env = gym.make(
            "Billiards-v0", scene=case.scene.to_dict(), task="carom", layout="random", max_speed=6.0, **engine
        )
        env.reset(options={"positions": [[-0.42, 0.0], [-0.06, 0.0]]})
        _, reward, *_ = env.step(np.array([1.0, 0.0], np.float32))
        rewards.append(reward)
    assert rewards == [1.0, 0.0]
