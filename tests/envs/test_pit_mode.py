"""Billiards-v0 with mode="pit", the engine with a fixed timestep."""

import gymnasium as gym
import numpy as np
import pytest

from billiards_env.engine.overlaps import FIXES
from billiards_env.envs import STATUS, make_env


def test_without_a_fix_balls_may_overlap_before_the_next_shot():
    # 4 m/s in steps of 1/15 s: without a fix some balls come to rest deep inside another ball or beyond a cushion
    env = make_env(n_object_balls=9, layout="tight_rack", max_shots=20, mode="pit", dt=1 / 15, fix="none")
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
    envs = gym.make_vec("Billiards-v0", num_envs=500, action="cut", **hidden)
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform((-1, 0), 1, (500, 2))
    infos = envs.step(actions)[4]["final_info"]
    share = (infos["first_hit"] == 1).mean()
    assert share > 0.05 if through else share == 0
    # The post does not count as a potted ball.
    assert (infos["is_success"] == (infos["potted"][:, 1] & ~infos["scratch"])).all()


def test_fix_and_dt_reach_the_engine_and_do_not_change_the_layouts():
    exact, shots = {}, np.random.default_rng(0).uniform(-1, 1, (5, 2))
    engines = [{"mode": "pit", "fix": fix, "dt": dt} for fix in (None, *FIXES) for dt in (1 / 15, 1 / 30)]
    starts, ends = [], []
    for engine in (exact, *engines):
        env = make_env(scene="carom", task="carom", max_shots=5, **engine)
        starts.append(env.reset(seed=0)[0].tobytes())
        ends.append([env.step(shot)[0].tobytes() for shot in shots][-1])
    assert len(set(starts)) == 1
    assert ends[1:3] == [end for end, engine in zip(ends[1:], engines, strict=True) if engine["fix"] == "push_apart"]
    assert len(set(ends)) == 1 + 2 * len(FIXES)
