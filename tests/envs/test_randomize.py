"""Domain randomisation: each episode draws its physics."""

from typing import Any

import numpy as np
import pytest

from billiards_env import simulate
from billiards_env.engine import PIC, Engine
from billiards_env.envs import make_env, make_vector_env
from billiards_env.envs.actions import cue_strike
from billiards_env.players.env_player import env_situation
from billiards_env.shots import records
from billiards_env.shots.simulation import replay
from tests.helpers.environments import same

RANGES = {"mu_roll": [0.004, 0.02], "e_ball": [0.8, 1.0]}
STEPPED: dict[str, Any] = {"mode": "pit", "dt": 1 / 60, "randomize": {"dt": [0.002, 0.05], "mu_slide": [0.1, 0.4]}}


@pytest.mark.parametrize("kwargs", [{"randomize": RANGES}, STEPPED], ids=["pic", "pit"])
def test_a_shot_is_that_of_the_scene_with_the_drawn_numbers(kwargs):
    env, drawn = make_env(**kwargs), set()
    for seed in range(5):
        _, info = env.reset(seed=seed)
        scene, positions, action = env.episode_scene, env.positions, [0.6, 0.1 * seed]
        drawn_now = {name: info[name] for name in kwargs["randomize"]}
        assert all(getattr(scene.physics, name) == value for name, value in drawn_now.items() if name != "dt")
        engine = PIC if env.engine == PIC else Engine("pit", info["dt"])
        shot = simulate(scene, positions, cue_strike(action, scene, env.max_speed), engine=engine)
        *_, after = env.step(action)
        assert env.positions.tobytes() == shot.positions.tobytes()
        assert after["shot_time"] == shot.time
        assert {name: after[name] for name in drawn_now} == drawn_now
        drawn.add(tuple(drawn_now.values()))
    assert len(drawn) == 5


def test_the_numbers_are_uniform_and_observed_between_minus_one_and_one():
    envs = make_vector_env(4000, randomize=RANGES, observe=("shots_left", "physics"))
    observations, infos = envs.reset(seed=0)
    for seen, (name, (low, high)) in zip(envs.decode(observations)["physics"].T, RANGES.items(), strict=True):
        assert infos[f"_{name}"].all()
        assert ((infos[name] >= low) & (infos[name] <= high)).all()
        np.testing.assert_allclose(seen, 2 * (infos[name] - low) / (high - low) - 1, atol=1e-6)
        counts = np.histogram(infos[name], 10, (low, high))[0]
        assert (np.abs(counts - 400) < 100).all()  # five standard deviations


def test_options_of_a_reset_set_numbers():
    env = make_env(randomize=RANGES, observe=["physics"])
    drawn = env.reset(seed=5)[1]
    observation, info = env.reset(seed=5, options={"physics": {"mu_roll": 0.008}})
    assert observation[0] == -0.5
    assert (info["mu_roll"], info["e_ball"]) == (0.008, drawn["e_ball"])  # the others are drawn
    assert env.episode_scene.physics.mu_roll == 0.008
    places = {"positions": [[-0.5, 0.0], [0.5, 0.0]]}
    first, other, again = (env.reset(seed=seed, options=places)[1]["mu_roll"] for seed in (4, None, 4))
    assert first == again != other  # with given positions it is drawn, too


def test_an_interrupted_step_keeps_the_physics(monkeypatch):
    envs, twin = (make_vector_env(3, randomize=RANGES, observe=["physics"]) for _ in range(2))
    actions = np.full((2, 3, 2), [[[0.7, 0.1]], [[-0.3, 0.4]]])
    for one in (envs, twin):
        one.reset(seed=0)

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(envs._episodes, "begin", interrupt)
    with pytest.raises(KeyboardInterrupt):
        envs.step(actions[0])
    monkeypatch.undo()
    for action in actions:
        same(envs.step(action), twin.step(action))


def test_players_and_records_have_the_physics_of_the_episode(tmp_path):
    env, plain = (make_env(randomize=RANGES, render_mode=mode) for mode in ("rgb_array", None))
    _, info = env.reset(seed=0)
    plain.reset(seed=0)
    assert env_situation(env).table.scene.physics.mu_roll == info["mu_roll"]
    rated = env.try_actions([[0.5, 0.1]] * 3).rewards.tolist()
    _, reward, _, _, after = env.step([0.5, 0.1])
    assert rated == [reward] * 3
    assert after["shot_time"] == plain.step([0.5, 0.1])[4]["shot_time"]
    env._episodes.state.recorded[0].save(tmp_path / "shot.json")
    record = records.load(tmp_path / "shot.json")
    assert record.scene.physics.e_ball == info["e_ball"]
    assert replay(record).positions.tobytes() == env.positions.tobytes()
