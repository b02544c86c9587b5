import re
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from billiards_env.engine.measures import measures_type
from billiards_env.envs import STATUS, BilliardsEnv, make_env
from billiards_env.envs.action_frames import FRAMES
from billiards_env.envs.observations import FEATURES
from billiards_env.envs.tasks import TASKS
from billiards_env.scene import SCENES, Scene, check_positions, layouts
from tests.helpers.environments import GAME_VARIANTS, VARIANTS, name_of

INFO_TABLE = (BilliardsEnv.__doc__ or "").partition("## Info")[2].partition("Stable-Baselines3")[0]
DOCUMENTED_INFO = {
    key: (kind, start)
    for key, kind, start in re.findall(r"\| `(\w+)` +\| (.+?) +\|.*\| (\S+) +\|$", INFO_TABLE, re.MULTILINE)
}


def kinds_of(info, n):
    """Returns the kinds of the values of `info` as in the table."""
    kinds = {}
    for key, value in info.items():
        assert isinstance(value, (np.generic, np.ndarray)), key
        name = {"episode_seed": "(8,) ", "played_action": "(k,) "}.get(key, "(n,) ")
        assert value.shape in {"(8,) ": [(8,)], "(k,) ": [(2,), (5,)]}.get(name, [(n,) * value.ndim]), key
        kinds[key] = name * value.ndim + value.dtype.name
    return kinds


def take_measures(env, info):
    """Removes the measures from an info, and returns them as one list of numbers."""
    found = {name: info.pop(name) for name in env.model.measures}
    kind: Any = measures_type(tuple(found), env.model.scene.n_balls)
    assert {name: (value.shape, value.dtype) for name, value in found.items()} == {
        name: (kind[name].shape, np.float64) for name in found
    }
    return [number for value in found.values() for number in value.ravel()]


SUM_TO_THREE = {"scene": "sum_to_three", "task": "sum_to_three", "layout": "line", "max_shots": 10, "max_speed": 4.2}

# On the pool table, at 45 degrees from the corner pocket at (1.27, 0.635). From here the cue ball scratches.
STRAIGHT_INTO_THE_CORNER = [0.97, 0.335]
INTO_THE_CORNER = np.array([0.25, 0.25], np.float32)
# On the frictionless table the cue ball hits ball 1 from (0, 0) at 45 degrees and moves along the diagonal to ball 2.
DIAGONAL = 2 * Scene.named("ideal").balls.radius[0] * np.sqrt(0.5)
CAROM = [[-0.3, 0.0], [DIAGONAL, -DIAGONAL], [0.3, 0.3]]


@pytest.mark.parametrize(
    "kwargs",
    [*VARIANTS, *GAME_VARIANTS, *({"action": action, "max_speed": 4.5} for action in (*FRAMES, "plan"))],
    ids=name_of,
)
def test_environment_checkers_pass(kwargs):
    sb3 = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make("Billiards-v0", **kwargs).unwrapped, skip_render_check=kwargs not in VARIANTS[::5])
        sb3.check_env(gym.make("Billiards-v0", **kwargs).unwrapped, warn=True)  # wrappers hide `compute_reward`


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({}, "task 'pot', table 2.54 x 1.27 m, 6 pockets, 2 balls, PIC"),
        (
            {"task": "carom", "mode": "pit", "dt": 0.01},
            "task 'carom', table 2.84 x 1.42 m, 0 pockets, 3 balls, PIT, dt = 1/100 s",
        ),
    ],
)
def test_the_repr_of_an_environment_describes_it(arguments, text):
    assert repr(gym.make("Billiards-v0", **arguments).unwrapped) == f"BilliardsEnv({text})"
    envs = gym.make_vec("Billiards-v0", 3, **arguments)
    assert repr(envs.unwrapped) == f"BilliardsVectorEnv(3 environments, {text})"


def test_every_task_scene_layout_and_feature_is_in_a_variant():
    for name, values in (("task", TASKS), ("scene", SCENES), ("layout", layouts.LAYOUTS)):
        assert {str(variant.get(name, "pool")) for variant in VARIANTS} >= {*values} - {"pot"}
    lists = [variant.get("observe", ()) for variant in (*VARIANTS, *GAME_VARIANTS)]
    assert "goal" in lists
    observed = [name for names in lists if names != "goal" for name in names]
    assert {name if isinstance(name, str) else name[0] for name in observed} == {*FEATURES}


@pytest.mark.parametrize("kwargs", VARIANTS, ids=name_of)
def test_results_are_in_the_spaces_and_have_the_documented_types(kwargs):
    env = make_env(**kwargs)
    n = env.scene.n_balls
    drawn, usual = env.model.randomize, kwargs.get("observe") is None
    if usual:
        task = TASKS[env.task]
        assert list(env.features) == ["positions"] + ["goal"] * bool(task.goal_radius) + ["legal_balls"] * bool(
            task.is_game
        )
    if not isinstance(env.observation_space, gym.spaces.Dict) and "pixels" not in env.features:
        assert env.observation_space.dtype == np.float32
    size, others = (5, set()) if env.action == "strike" else (2, {"miscue"})
    assert env.action_space == gym.spaces.Box(-1, 1, (size,), np.float32)
    documented = {key: kind for key, (kind, _) in DOCUMENTED_INFO.items() if key not in others}
    documented |= dict.fromkeys(drawn, "float64")
    starts = {"0": 0, "-1": -1, "False": False, "`max_shots`": env.model.max_shots}
    rng = np.random.default_rng(0)
    for episode in range(5):
        observation, info = env.reset(seed=episode)
        assert all(map(np.isinf, take_measures(env, info)))
        assert kinds_of(info, n) == documented
        assert all(low <= info.pop(name) <= high for name, (low, high) in drawn.items())
        del info["episode_seed"]
        assert all((value == starts[DOCUMENTED_INFO[key][1]]).all() for key, value in info.items())
        assert observation in env.observation_space
        first = {name: values.copy() for name, values in env.decode(observation).items()}
        assert all(np.abs(first[name]).max() < 1 for name in ("positions", "goal") if name in first)
        shots, terminated, total = 0, False, 0.0
        while not terminated:
            observation, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, size))
            shots += 1
            total += reward + (env.model.scratch_penalty if info["scratch"] else 0)
            assert observation in env.observation_space
            assert type(reward) is float
            assert type(terminated) is bool
            assert truncated is False
            missing = np.isinf(take_measures(env, info)).all()
            assert missing or info["first_hit"] >= 0 or "first_hit_velocities" not in env.model.measures
            assert missing == (info["first_hit"] < 0) or "first_hit_velocities" not in env.model.measures
            assert kinds_of(info, n) == documented
            assert info["shots_left"] == env.model.max_shots - shots
            expected = {
                "goal": first.get("goal"),
                "legal_balls": env.legal_balls[1:],
                "shots_left": np.float32(info["shots_left"] / env.model.max_shots),
                "potted": info["potted"],
            }
            seen = env.decode(observation)
            assert all(np.array_equal(seen[name], expected[name]) for name in seen.keys() & expected.keys())
            if "positions" in seen:
                assert np.array_equal(np.abs(seen["positions"]).max(axis=1) < 1, ~info["potted"])
        assert total == info["score"]
        assert shots <= env.model.max_shots
        if not info["potted"].any() and env.engine.mode == "pic":
            check_positions(env.scene, env.positions)


def test_a_ball_in_the_jaws_is_observed_inside_the_box():
    env = make_env(scene="real_pool", n_object_balls=1)
    table, half = env.scene.table, np.array(env.scene.half_extents)
    pocket = table.pockets[-1]  # a side pocket at +y
    in_jaws = [0.012, pocket.y - 1.0001 * pocket.radius]
    assert in_jaws[1] > table.width / 2 - 0.5 * env.scene.balls.radius[1]
    observation, _ = env.reset(options={"positions": [[-0.5, 0.1], in_jaws]})
    assert (np.abs(observation) < 1).all()
    assert observation.reshape(2, 2) * half == pytest.approx(np.array([[-0.5, 0.1], in_jaws]), abs=1e-6)


BEHIND_THE_CUSHIONS = {"base": "pool", "table": {"pockets": [{"x": 1.3, "y": 0.65, "radius": 0.1}]}}


POTTED = {
    "a side pocket": ("pool", [0.0, 0.3], [0.0, 0.2], [0.0, 1.0]),
    "with jaws": ("real_pool", [0.0, 0.3], [0.0, 0.2], [0.0, 1.0]),
    "behind the cushions": (BEHIND_THE_CUSHIONS, STRAIGHT_INTO_THE_CORNER, INTO_THE_CORNER, [1.0, 1.0]),
}


@pytest.mark.parametrize(("scene", "cue", "action", "pocket"), POTTED.values(), ids=POTTED)
def test_a_potted_ball_is_observed_at_its_pocket_inside_the_box(scene, cue, action, pocket):
    env = make_env(scene=scene, max_shots=2)
    env.reset(options={"positions": [cue, [-0.5, 0.0]]})
    observation, *_, info = env.step(action)
    assert info["potted"].tolist() == [True, False]
    assert observation[:2].tolist() == pocket
    assert observation in env.observation_space


OBSTACLE = {"scene": {"base": "pool", "n_object_balls": 2, "balls": {"mass": [0.17, 0.17, "inf"]}}, "max_shots": 5}
CAROMS = {"scene": "ideal", "task": "carom", "n_object_balls": 2, "max_shots": 3}
POT, SCRATCH, APART = ([0.97, 0.335], [1.07, 0.435]), ([0.97, 0.335], [-0.5, 0.0]), ([0.0, 0.0], [0.5, 0.3])
EPISODES = {  # the arguments, the balls, the shots, and after each: reward, whether it is over, success and score
    "a scratch": ({}, SCRATCH, [INTO_THE_CORNER], [(-0.2, True, False, 0)]),
    "a scratch with another penalty": ({"scratch_penalty": 2}, SCRATCH, [INTO_THE_CORNER], [(-2.0, True, False, 0)]),
    "a scratch before the last shot": ({"max_shots": 5}, SCRATCH, [INTO_THE_CORNER], [(-0.2, True, False, 0)]),
    "a pot": ({}, POT, [INTO_THE_CORNER], [(1.0, True, True, 1)]),
    "a pot with a ball left": (
        {"n_object_balls": 2, "max_shots": 10},
        [*POT, [-0.6, -0.2]],
        [INTO_THE_CORNER, *[[-0.05, 0.02]] * 3],
        [(1.0, False, False, 1), *[(0.0, False, False, 1)] * 3],
    ),
    "misses": ({"max_shots": 2}, APART, [[-0.1, 0.0]] * 2, [(0.0, False, False, 0), (0.0, True, False, 0)]),
    "an obstacle is left": (OBSTACLE, (*POT, [-0.6, -0.2]), [INTO_THE_CORNER], [(1.0, True, True, 1)]),
    "a carom does not end the episode": (
        CAROMS,
        CAROM,
        [[0.25, 0.0], [0.0, 0.0], [0.0, 0.0]],
        [(1.0, False, True, 1), (0.0, False, True, 1), (0.0, True, True, 1)],
    ),
}


@pytest.mark.parametrize("name", EPISODES)
def test_the_rewards_and_the_end_of_an_episode(name):
    kwargs, positions, shots, results = EPISODES[name]
    env = make_env(**{"scratch_penalty": 0.2, **kwargs})
    env.reset(options={"positions": positions})
    for played, (shot, (reward, over, success, score)) in enumerate(zip(shots, results, strict=True), start=1):
        *_, paid, terminated, truncated, info = env.step(shot)
        assert (paid, terminated, truncated) == (reward, over, False)
        assert (info["is_success"], info["score"]) == (success, score)
        assert info["shots_left"] == env.model.max_shots - played
        assert info["scratch"] == ("scratch" in name)
        assert info["points"] == (0 if info["scratch"] else reward)


@pytest.mark.parametrize(("max_time", "status"), [(None, "rest"), (0.05, "max_time")])  # then the cue ball slides
def test_neither_velocity_nor_spin_remains_after_a_shot(max_time, status):
    env = make_env(scene={"base": "pool", "physics": {"max_time": max_time}}, max_shots=2)
    first, _ = env.reset(options={"positions": [[-0.5, 0.0], [0.5, 0.3]]})
    before, *_, info = env.step([1.0, 0.0])
    assert STATUS[info["status_code"]] == status
    after, *_, info = env.step([0.0, 0.0])
    assert not np.array_equal(first, before)
    assert np.array_equal(before, after)
    assert (info["shot_time"], info["n_events"]) == (0.0, 0)


def test_a_shot_of_sum_to_three_starts_without_spin():
    env = make_env(**SUM_TO_THREE, action="sum_to_three", render_mode="rgb_array")
    env.reset()
    played = env.step([0.0, 0.0])[4]["played_action"]
    np.testing.assert_allclose(env.max_speed * played, [1.395 * 1.65, 0.0], rtol=1e-15)
    events, physics = env._episodes.state.recorded[0].events, env.scene.physics
    assert events is not None
    slip = 2 / 7 * 1.395 * 1.65 / (physics.mu_slide * physics.g)  # s, until a ball rolls that starts without spin
    assert (events["kind"][0], events["time"][0]) == ("sliding_rolling", pytest.approx(slip, rel=1e-14))


def test_random_shots_of_sum_to_three_score_the_same_as_in_pooltool():
    """LightZero's engine, pooltool 0.3.1, scores 1.340 points in ten shots, standard error 0.019 (3,313 games)."""
    games = 4_000
    envs = gym.make_vec("Billiards-v0", games, autoreset_mode="SameStep", **SUM_TO_THREE, action="sum_to_three")
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    infos: dict[str, Any] = {}
    for shot in range(10):
        *_, infos = envs.step(rng.uniform(-1, 1, (games, 2)))
        shots = infos["final_info"] if shot == 9 else infos
        assert (shots["points"] == ((shots["first_hit"] == 1) & (shots["cushions"].sum(axis=1) == 3))).all()
    score = infos["final_info"]["score"]
    error = score.std() / np.sqrt(games)
    assert abs(score.mean() - 1.340) < 3 * np.hypot(error, 0.019)


WITHOUT_EFFECT = [
    ({"noise": {}}, (4, None, None)),
    ({"mode": "pit", "dt": 1 / 15}, (4, None, None)),
    ({"randomize": {"mu_roll": [0.004, 0.02]}}, (4, 5)),  # the numbers are drawn after the first layout
]


@pytest.mark.parametrize(("kwargs", "seeds"), WITHOUT_EFFECT, ids=name_of)
def test_noise_the_engine_and_the_physics_do_not_change_the_layouts(kwargs, seeds):
    plain, other = make_env(task="place"), make_env(task="place", **kwargs)
    for seed in seeds:
        assert plain.reset(seed=seed)[0].tobytes() == other.reset(seed=seed)[0].tobytes()
        assert plain.step([0.5, 0.1])[4]["shot_time"] != other.step([0.5, 0.1])[4]["shot_time"]


def test_goals_are_drawn_after_the_balls_from_the_whole_table():
    env, plain = make_env(task="place"), make_env()
    goals = []
    for seed in range(500):
        observation, _ = env.reset(seed=seed)
        assert np.array_equal(observation[:4], plain.reset(seed=seed)[0])
        assert np.array_equal(observation[4:], (env.goals[0] / [1.27, 0.635]).astype(np.float32))
        goals.append(env.goals[0])
    check_positions(Scene.named("pool", 0), np.array(goals)[:, None])
    assert (np.abs(goals).max(axis=0) > [1.2, 0.57]).all()
    assert plain.goals.shape == (0, 2)


def test_positions_and_goals_from_options_are_not_drawn():
    env, balls, goal = make_env(task="place"), [[0.0, 0.0], [0.5, 0.0]], [0.1, 0.2]
    env.reset(seed=0)
    state = env.np_random.bit_generator.state
    env.reset(options={"positions": balls, "goal": goal})
    assert env.np_random.bit_generator.state == state
    assert env.goals.tolist() == [goal]
    env.reset(options={"goal": goal})
    drawn = env.positions
    env.np_random.bit_generator.state = state
    env.reset(options={})
    assert np.array_equal(env.positions, drawn)
    assert env.goals.tolist() != [goal]


THROUGH_A_BALL = [({}, False), *(({"mode": "pit", "dt": 1 / n}, n <= 60) for n in (15, 30, 60, 240))]


@pytest.mark.parametrize(("world", "through"), THROUGH_A_BALL, ids=name_of)
def test_fast_shots_with_a_coarse_timestep_pass_through_a_ball(world, through):
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
