import copy
import json
import pickle
import re
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import OrderEnforcing

from billiards_env import simulate
from billiards_env.envs import STATUS, BilliardsEnv, episodes
from billiards_env.envs.tasks import TASKS
from billiards_env.envs.wrappers import ActionFrame, VectorActionFrame
from billiards_env.scene import SCENES, Scene, check_positions, layouts
from tests.helpers.environments import VARIANTS

variants = pytest.mark.parametrize("kwargs", VARIANTS, ids=lambda k: ",".join(map(str, k.values()))[:60])
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
        assert value.shape in ((), (n,)), key
        kinds[key] = "(n,) " * value.ndim + value.dtype.name
    return kinds


SUM_TO_THREE = {
    "scene": "sum_to_three",
    "task": "sum_to_three",
    "layout": "line",
    "max_shots": 10,
    "max_speed": 4.2,
}

# On the pool table, at 45 degrees from the corner pocket at (1.27, 0.635). From here the cue ball scratches.
STRAIGHT_INTO_THE_CORNER = [0.97, 0.335]
INTO_THE_CORNER = np.array([0.25, 0.25], np.float32)
# On the frictionless table the cue ball hits ball 1 from (0, 0) at 45 degrees and moves along the diagonal to ball 2.
DIAGONAL = 2 * Scene.named("ideal").balls.radius[0] * np.sqrt(0.5)
CAROM = [[-0.3, 0.0], [DIAGONAL, -DIAGONAL], [0.3, 0.3]]


def make(**kwargs):
    return gym.make("Billiards-v0", **kwargs)


def play(env, shots, seed=None):
    """Plays random shots and returns all results of the environment, with arrays as bytes."""
    env.action_space.seed(seed)
    log: list[Any] = [env.reset(seed=seed)[0].tobytes()]
    for _ in range(shots):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        info = {k: v.tobytes() if isinstance(v, np.ndarray) else v for k, v in info.items()}
        log += [observation.tobytes(), reward, terminated, truncated, info]
        if terminated:
            log.append(env.reset()[0].tobytes())
    return log


@variants
def test_environment_checkers_pass(kwargs):
    sb3 = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(**kwargs).unwrapped)
        sb3.check_env(make(**kwargs), warn=True)


def test_every_task_scene_and_layout_is_in_a_variant():
    for name, values in (("task", TASKS), ("scene", SCENES), ("layout", layouts.LAYOUTS)):
        assert {str(variant.get(name, "pool")) for variant in VARIANTS} >= {*values} - {"pot"}


@variants
def test_results_are_in_the_spaces_and_have_the_documented_types(kwargs):
    env = BilliardsEnv(**kwargs)
    n = env.scene.n_balls
    last = env.observe_shots_left
    places = 2 * (n + (TASKS[env.task].goal_radius > 0))
    flags = n - 1 if TASKS[env.task].opening else 0
    drawn, seen = env.randomize, env.observe_physics * len(env.randomize)
    assert env.observation_space.shape == (places + flags + last + seen,)
    assert env.observation_space.dtype == np.float32
    assert env.action_space == gym.spaces.Box(-1, 1, (2,), np.float32)
    documented = {
        key: kind for key, (kind, _) in DOCUMENTED_INFO.items() if key != "miscue"
    }  # that is for strikes only
    documented |= dict.fromkeys(drawn, "float64")
    starts = {"0": 0, "-1": -1, "False": False, "`max_shots`": env.max_shots}
    env.action_space.seed(0)
    rng = np.random.default_rng(0)
    for episode in range(5):
        observation, info = env.reset(seed=episode)
        assert kinds_of(info, n) == documented
        assert all(low <= info.pop(name) <= high for name, (low, high) in drawn.items())
        assert all((value == starts[DOCUMENTED_INFO[key][1]]).all() for key, value in info.items())
        assert observation in env.observation_space
        assert np.abs(observation[:places]).max() < 1
        goal = observation[2 * n : places]
        shots, terminated, total = 0, False, 0.0
        while not terminated:
            observation, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, 2))
            shots += 1
            total += reward + (env.scratch_penalty if info["scratch"] else 0)
            assert observation in env.observation_space
            assert np.array_equal(observation[2 * n : places], goal)
            assert type(reward) is float
            assert type(terminated) is bool
            assert truncated is False
            assert kinds_of(info, n) == documented
            assert info["shots_left"] == env.max_shots - shots
            on_table = np.abs(observation[: 2 * n]).reshape(n, 2).max(axis=1) < 1
            assert np.array_equal(on_table, ~info["potted"])
            assert np.array_equal(observation[places : places + flags], env.legal_balls[1 : 1 + flags])
            if last:
                assert observation[places + flags] == np.float32(info["shots_left"] / env.max_shots)
        assert total == info["score"]
        assert shots <= env.max_shots
        if not info["potted"].any() and env.engine.mode == "pic":
            check_positions(env.scene, env.positions)


def test_positions_are_observed_relative_to_half_the_table():
    env = BilliardsEnv(n_object_balls=2, max_shots=4, observe_shots_left=True)
    positions = [[0.635, -0.3175], [-0.127, 0.508], [0.0, 0.0]]
    shares = [0.5, -0.5, -0.1, 0.8, 0, 0]
    observation, _ = env.reset(options={"positions": positions})
    assert np.array_equal(observation, np.array([*shares, 1.0], np.float32))
    observation, *_ = env.step(np.zeros(2))
    assert np.array_equal(observation, np.array([*shares, 0.75], np.float32))


def test_a_ball_in_the_jaws_is_observed_inside_the_box():
    env = BilliardsEnv(scene="real_pool", n_object_balls=1)
    table, half = env.scene.table, np.array(env.scene.half_extents)
    pocket = table.pockets[-1]  # a side pocket at +y
    in_jaws = [0.012, pocket.y - 1.0001 * pocket.radius]
    assert in_jaws[1] > table.width / 2 - 0.5 * env.scene.balls.radius[1]
    observation, _ = env.reset(options={"positions": [[-0.5, 0.1], in_jaws]})
    assert (np.abs(observation) < 1).all()
    assert observation.reshape(2, 2) * half == pytest.approx(np.array([[-0.5, 0.1], in_jaws]), abs=1e-6)
    env.reset(options={"positions": [[0.0, 0.0], [0.0, 0.3]]})
    observation, *_, info = env.step([0.0, 0.5])
    assert info["potted"][1]
    assert observation[2:].tolist() == [0.0, 1.0]  # the pocket


def test_a_ball_in_a_side_pocket_is_observed_at_that_pocket():
    env = BilliardsEnv(max_shots=2)
    env.reset(options={"positions": [[0.0, 0.3], [-0.5, 0.0]]})
    observation, *_, info = env.step([0.0, 0.2])
    assert info["potted"].tolist() == [True, False]
    assert observation[:2].tolist() == [0.0, 1.0]


def test_a_ball_in_a_pocket_behind_the_cushions_is_observed_inside_the_box():
    scene = Scene.named("pool").to_dict()
    scene["table"]["pockets"] = [{"x": 1.3, "y": 0.65, "radius": 0.1}]
    env = BilliardsEnv(scene=scene)
    env.reset(options={"positions": [STRAIGHT_INTO_THE_CORNER, [-0.5, 0.0]]})
    observation, *_, info = env.step(INTO_THE_CORNER)
    assert info["scratch"]
    assert observation[:2].tolist() == [1.0, 1.0]
    assert observation in env.observation_space


def test_equal_seeds_play_equal_episodes_bit_for_bit():
    kwargs = {"n_object_balls": 5, "max_shots": 3}
    first, second = make(**kwargs), make(**kwargs)
    log = play(first, 12, seed=7)
    assert log == play(second, 12, seed=7)
    assert log == play(first, 12, seed=7)
    assert log != play(first, 12, seed=8)


def test_earlier_episodes_do_not_affect_an_episode():
    env = BilliardsEnv(max_shots=3)
    log = play(env, 2, seed=1)
    env.reset(options={"positions": [[0.0, 0.0], [0.5, 0.0]]})
    env.step(np.array([1.0, 0.0]))
    assert play(env, 2, seed=1) == log


@pytest.mark.parametrize("kwargs", VARIANTS[::5])
def test_the_spec_survives_json_and_pickle(kwargs):
    env = make(**kwargs)
    log = play(env, 2, seed=3)
    assert env.spec is not None
    assert json.loads(env.spec.to_json())["kwargs"] == kwargs
    for spec in (EnvSpec.from_json(env.spec.to_json()), pickle.loads(pickle.dumps(env.spec))):
        assert play(gym.make(spec), 2, seed=3) == log


def test_a_deep_copy_shares_the_compiled_functions():
    env = BilliardsEnv()
    assert copy.deepcopy(env)._episodes._run_shots is env._episodes._run_shots


@pytest.mark.parametrize("copy_of", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_continues_like_its_original(copy_of):
    env = BilliardsEnv(n_object_balls=3, max_shots=6)
    play(env, 3, seed=5)
    env.reset()
    env.step(np.array([0.1, 0.1]))
    twin = copy_of(env)
    action = np.array([-0.5, 0.3])
    for one, other in ((env.step(action), twin.step(action)), (env.reset(), twin.reset())):
        assert one[0].tobytes() == other[0].tobytes()


def test_vector_env_of_stable_baselines3():
    sb3 = pytest.importorskip("stable_baselines3.common.env_util")
    envs = sb3.make_vec_env("Billiards-v0", n_envs=2)
    assert envs.reset().shape == (2, 4)


def test_potting_the_object_ball_scores_a_point():
    env = BilliardsEnv()
    env.reset(options={"positions": [[0.97, 0.335], [1.07, 0.435]]})
    observation, reward, terminated, _, info = env.step(INTO_THE_CORNER)
    assert info["potted"].tolist() == [False, True]
    assert (reward, terminated) == (1.0, True)
    assert (info["is_success"], info["scratch"], info["points"], info["score"]) == (True, False, 1, 1)
    assert (info["first_hit"], STATUS[info["status_code"]]) == (1, "rest")
    assert observation[2:].tolist() == [1.0, 1.0]
    assert info["shot_time"] > 0
    assert info["n_events"] >= 3


@pytest.mark.parametrize("max_shots", [1, 5])
@pytest.mark.parametrize("penalty", [0.0, 0.5, 2])
def test_a_scratch_ends_the_episode_and_costs_the_penalty(penalty, max_shots):
    env = BilliardsEnv(scratch_penalty=penalty, max_shots=max_shots)
    env.reset(options={"positions": [STRAIGHT_INTO_THE_CORNER, [-0.5, 0.0]]})
    observation, reward, terminated, _, info = env.step(INTO_THE_CORNER)
    assert (reward, terminated) == (-penalty, True)
    assert (info["scratch"], info["is_success"], info["first_hit"]) == (True, False, -1)
    assert observation[:2].tolist() == [1.0, 1.0]


def test_a_miss_ends_the_episode_after_the_last_shot():
    env = BilliardsEnv(max_shots=2)
    env.reset(options={"positions": [[0.0, 0.0], [0.5, 0.3]]})
    *_, terminated, truncated, info = env.step([-0.1, 0.0])
    assert (terminated, truncated, info["shots_left"]) == (False, False, 1)
    _, reward, terminated, truncated, info = env.step([-0.1, 0.0])
    assert (reward, terminated, truncated) == (0.0, True, False)
    assert (info["shots_left"], info["is_success"], info["score"]) == (0, False, 0)


def test_potted_balls_stay_off_the_table_in_later_shots():
    env = BilliardsEnv(n_object_balls=2, max_shots=10)
    env.reset(options={"positions": [[0.97, 0.335], [1.07, 0.435], [-0.6, -0.2]]})
    _, reward, terminated, _, info = env.step(INTO_THE_CORNER)
    assert info["potted"].tolist() == [False, True, False]
    assert (reward, terminated, info["is_success"]) == (1.0, False, False)
    for _ in range(3):
        observation, reward, terminated, _, info = env.step([-0.05, 0.02])
        assert info["potted"].tolist() == [False, True, False]
        assert observation[2:4].tolist() == [1.0, 1.0]
        assert (reward, terminated) == (0.0, False)
        assert (info["points"], info["score"]) == (0, 1)


def test_balls_keep_their_positions_between_shots():
    env = BilliardsEnv(scene="carom", task="carom", max_shots=3)
    before, _ = env.reset(seed=0)
    after, *_ = env.step([0.4, 0.1])
    assert not np.array_equal(before, after)
    still, *_, info = env.step([0.0, 0.0])
    assert np.array_equal(after, still)
    assert (info["shot_time"], info["n_events"]) == (0.0, 0)


def test_spin_does_not_remain_after_a_shot_that_ends_at_its_time_limit():
    scene = Scene.named("pool").to_dict()
    scene["physics"]["max_time"] = 0.05  # the cue ball still slides then
    env = BilliardsEnv(scene=scene, max_shots=2)
    env.reset(options={"positions": [[-0.5, 0.0], [0.5, 0.0]]})
    before, *_, info = env.step([1.0, 0.0])
    assert STATUS[info["status_code"]] == "max_time"
    after, *_, info = env.step([0.0, 0.0])
    assert np.array_equal(before, after)
    assert (info["shot_time"], info["n_events"]) == (0.0, 0)


def test_carom_continues_until_the_last_shot():
    env = BilliardsEnv(scene="ideal", task="carom", n_object_balls=2, max_shots=3)
    env.reset(options={"positions": CAROM})
    outcomes = []
    for action in ([0.25, 0.0], [0.0, 0.0], [0.0, 0.0]):
        _, reward, terminated, _, info = env.step(action)
        outcomes.append((reward, terminated, info["score"], info["is_success"]))
    assert outcomes == [(1.0, False, 1, True), (0.0, False, 1, True), (0.0, True, 1, True)]


def test_obstacles_do_not_have_to_be_potted():
    scene = Scene.named("pool", 2).to_dict()
    scene["balls"]["mass"][2] = "inf"
    env = BilliardsEnv(scene=scene, max_shots=5)
    env.reset(options={"positions": [[0.97, 0.335], [1.07, 0.435], [-0.6, -0.2]]})
    _, reward, terminated, _, info = env.step(INTO_THE_CORNER)
    assert (reward, terminated, info["is_success"]) == (1.0, True, True)


def test_three_cushion_needs_three_contacts_before_the_second_ball():
    """The cue ball moves at 45 degrees off cushions +y, +x and -y to ball 1, and from there up to ball 2."""
    env, carom = (BilliardsEnv(scene="ideal", task=task, n_object_balls=2) for task in ("three_cushion", "carom"))
    radius = env.scene.balls.radius[0]
    right, top = 1.27 - radius, 0.635 - radius
    x = 0.38
    hit = np.array([x, 2 * right - x - 4 * top])  # position of the cue ball at ball 1; its unfolded path is (s, s)
    places = [hit - [2 * radius, 0.0], [x, 0.05]]
    for start, direction, contacts in (([0.0, 0.0], 1, 3), ([0.7, 2 * top - 0.7], -1, 2)):
        for game in (env, carom):
            game.reset(options={"positions": [start, *places]})
        action = [0.25, 0.25 * direction]
        assert carom.step(action)[-1]["is_success"]
        _, reward, terminated, _, info = env.step(action)
        assert info["first_hit"] == 1
        assert (reward, terminated, info["is_success"]) == (float(contacts == 3), True, contacts == 3)


def test_a_shot_of_sum_to_three_starts_sliding_without_spin():
    env = ActionFrame(make(**SUM_TO_THREE), "sum_to_three")
    game: Any = env.unwrapped
    observation, _ = env.reset()
    assert observation.tolist() == [-0.5, 0.0, 0.5, 0.0]
    np.testing.assert_allclose(game.max_speed * env.action([1.0, 0.0]), [1.395 * 3.0, 0.0], rtol=1e-15)
    velocity = game.max_speed * env.action([0.0, 0.0])
    np.testing.assert_allclose(velocity, [1.395 * 1.65, 0.0], rtol=1e-15)
    shot = simulate(game.scene, game.positions, velocity, record=True)
    slip = 2 / 7 * velocity[0] / (0.5 * 9.81)  # time until it rolls, if it starts without spin
    assert shot.events is not None
    assert (shot.events["kind"][0], shot.events["time"][0]) == ("sliding_rolling", pytest.approx(slip, rel=1e-14))
    env.step([0.0, 0.0])
    assert np.array_equal(game.positions, shot.positions)


def test_sum_to_three_counts_the_contacts_of_both_balls():
    env = ActionFrame(make(**SUM_TO_THREE), "sum_to_three")
    rng, seen = np.random.default_rng(0), set()
    for _ in range(20):
        env.reset()
        info: dict[str, Any] = {}
        for shot in range(10):
            *_, terminated, _, info = env.step(rng.uniform(-1, 1, 2))
            point = info["first_hit"] == 1 and info["cushions"].sum() == 3
            assert (info["points"], terminated) == (point, shot == 9)
            seen.add((point, tuple(info["cushions"])))
        assert info["is_success"] == (info["score"] > 0)
    assert {cushions for point, cushions in seen if point} >= {(1, 2), (2, 1)}


def test_random_shots_of_sum_to_three_score_the_same_as_in_pooltool():
    """LightZero's engine, pooltool 0.3.1, scores 1.340 points in ten shots, standard error 0.019 (3,313 games)."""
    games = 4_000
    envs = VectorActionFrame(
        gym.make_vec("Billiards-v0", games, autoreset_mode="SameStep", **SUM_TO_THREE), "sum_to_three"
    )
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(9):
        envs.step(rng.uniform(-1, 1, (games, 2)))
    *_, infos = envs.step(rng.uniform(-1, 1, (games, 2)))
    score = infos["final_info"]["score"]
    error = score.std() / np.sqrt(games)
    assert abs(score.mean() - 1.340) < 3 * np.hypot(error, 0.019)


@pytest.mark.parametrize("n_object_balls", [0, 1])
def test_place_scores_within_its_radius_of_the_goal(n_object_balls):
    env = BilliardsEnv(task="place", n_object_balls=n_object_balls, max_shots=3)
    balls = [[-0.5, 0.0], [0.5, 0.0]][: n_object_balls + 1]
    env.reset(options={"positions": balls, "goal": [0.9, 0.4]})
    env.step([0.3, 0.0])
    ended = env.positions[0]
    for off, points in ((TASKS["place"].goal_radius - 1e-9, 1), (TASKS["place"].goal_radius + 1e-9, 0)):
        goal = ended + np.array([0.0, off])
        observation, _ = env.reset(options={"positions": balls, "goal": goal})
        assert np.array_equal(observation[-2:], (goal / [1.27, 0.635]).astype(np.float32))
        observation, reward, terminated, _, info = env.step([0.3, 0.0])
        assert (reward, terminated, info["is_success"], info["score"]) == (points, points == 1, points == 1, points)
        assert np.array_equal(observation[-2:], (goal / [1.27, 0.635]).astype(np.float32))
    if n_object_balls:
        env.reset(options={"positions": [ended, balls[1]], "goal": ended})
        assert env.step([0.0, 0.0])[1] == 0.0  # near the goal, but no ball was touched


def test_goals_are_drawn_after_the_balls_from_the_whole_table():
    env, plain = BilliardsEnv(task="place"), BilliardsEnv()
    goals = []
    for seed in range(500):
        observation, _ = env.reset(seed=seed)
        assert np.array_equal(observation[:4], plain.reset(seed=seed)[0])
        assert np.array_equal(observation[4:], (env.goals[0] / [1.27, 0.635]).astype(np.float32))
        goals.append(env.goals[0])
    check_positions(Scene.named("pool", 0), np.array(goals)[:, None])
    assert (np.abs(goals).max(axis=0) > [1.2, 0.57]).all()
    assert plain.goals.shape == (0, 2)
    with pytest.raises(ValueError, match="key of options = 'goal': expected one of 'positions'"):
        plain.reset(options={"goal": [0, 0]})


def test_positions_and_goals_from_options_are_not_drawn():
    env, balls, goal = BilliardsEnv(task="place"), [[0.0, 0.0], [0.5, 0.0]], [0.1, 0.2]
    env.reset(seed=0)
    state = env.np_random.bit_generator.state
    env.reset(options={"positions": balls, "goal": goal})
    assert env.np_random.bit_generator.state == state
    assert env.goals.tolist() == [goal]
    env.reset(options={"goal": goal})
    drawn = env.positions
    env.np_random.bit_generator.state = state
    env.reset()
    assert np.array_equal(env.positions, drawn)
    assert env.goals.tolist() != [goal]


@pytest.mark.parametrize(
    ("task", "scene", "n_object_balls", "layout"),
    [
        ("pot", "pool", 1, "random"),
        ("carom", "carom", 2, "carom_opening"),
        ("three_cushion", "carom", 2, "carom_opening"),
        ("sum_to_three", "sum_to_three", 1, "line"),
        ("place", "pool", 1, "random"),
        ("position", "pool", 1, "random"),
        ("clear", "pool", 1, "random"),
        ("nine_ball", "pool", 9, "nine_ball"),
        ("eight_ball", "pool", 15, "eight_ball"),
    ],
)
def test_a_task_has_its_own_scene_and_layout(task, scene, n_object_balls, layout):
    env = BilliardsEnv(task=task)
    assert (env.scene, env.layout) == (Scene.named(scene, n_object_balls), layout)
    other = BilliardsEnv(task=task, scene={"base": scene, "n_object_balls": n_object_balls}, layout="random")
    assert (other.scene, other.layout) == (env.scene, "random")


def test_the_spec_of_a_scene_object_is_json():
    scene = Scene.from_dict({"base": "real_pool", "n_object_balls": 2, "physics": {"mu_roll": 0.012}})
    env = make(scene=scene)
    assert env.spec is not None
    assert json.loads(env.spec.to_json())["kwargs"] == {"scene": scene.to_dict()}
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.scene == env.unwrapped.scene == scene  # pyright: ignore[reportAttributeAccessIssue]
    envs = gym.make_vec("Billiards-v0", num_envs=2, scene=scene)
    assert envs.spec is not None
    assert json.loads(envs.spec.to_json())["kwargs"]["scene"] == scene.to_dict()


def test_episodes_start_with_the_layout():
    env = BilliardsEnv(layout="line")
    assert env.reset(seed=0)[0].tolist() == [-0.5, 0.0, 0.5, 0.0]


def test_max_speed_scales_the_shots():
    ends = []
    for max_speed in (0.5, 1.0):
        env = BilliardsEnv(scene="carom", task="carom", max_speed=max_speed)
        env.reset(options={"positions": [[-0.8, 0.0], [1.2, 0.5], [1.2, -0.5]]})
        ends.append(env.step([0.8, 0.0])[0][0])
    assert ends[0] < ends[1]


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([np.nan, 0.0], r"action = \[nan, 0.0\]: expected finite numbers"),
        ([0.0, -np.inf], r"action = \[0.0, -inf\]: expected finite numbers"),
        ([0.0, 0.0, 0.0], r"action has shape \(3,\): expected \(2,\)"),
        (0.5, r"action has shape \(\): expected \(2,\)"),
    ],
)
def test_a_bad_action_raises_and_changes_nothing(action, message):
    env = BilliardsEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(action)
    assert env.step([0.1, 0.0])[-1]["shots_left"] == 0


def test_step_without_an_episode_raises():
    env = BilliardsEnv()
    with pytest.raises(ResetNeeded, match=r"over or has not begun: call reset\(\)"):
        env.step(np.zeros(2))
    env.reset(seed=0)
    env.step(np.zeros(2))
    with pytest.raises(ResetNeeded, match=r"over or has not begun: call reset\(\)"):
        env.step(np.zeros(2))
    env.reset()
    env.step(np.zeros(2))
    wrapped = make()
    assert isinstance(wrapped, OrderEnforcing)


def test_positions_from_options_are_exact_and_draw_nothing():
    env = BilliardsEnv()
    env.reset(seed=0)
    state = env.np_random.bit_generator.state
    positions = np.array([[0.1, 0.2], [-0.3, -0.4]])
    env.reset(options={"positions": positions})
    assert env.np_random.bit_generator.state == state
    observation, *_ = env.step(np.zeros(2))
    np.testing.assert_allclose(observation, (positions / [1.27, 0.635]).ravel(), rtol=1e-6)
    positions[:] = 0.0
    assert observation.any()


@pytest.mark.parametrize("options", [None, {}])
def test_no_options_draw_a_layout(options):
    env = BilliardsEnv()
    observation, _ = env.reset(seed=0)
    assert np.array_equal(env.reset(seed=0, options=options)[0], observation)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"position": []},
            ValueError,
            "key of options = 'position': expected one of 'positions', 'goal' .did you mean",
        ),
        ([1, 2], TypeError, r"options = \[1, 2\]: expected a dict"),
        ({"positions": [[0, 0]]}, ValueError, r"options\['positions'\] has shape \(1, 2\): expected \(2, 2\)"),
        ({"positions": np.full((4, 2, 2), [[0], [0.5]])}, ValueError, r"shape \(4, 2, 2\): expected \(2, 2\)"),
        ({"positions": [[0, 0], [0.01, 0]]}, ValueError, "balls 0 and 1 are 0.01 m apart: expected at least 0.05715"),
        ({"positions": [[0, 0], [2, 0]]}, ValueError, r"ball 1 is at \[2.0, 0.0\]: .* inside the cushions"),
        ({"positions": [[0, 0], [np.nan, 0]]}, ValueError, r"ball 1 is at \[nan, 0.0\]: expected finite"),
        ({"positions": [[0, 0], [1.24, 0.6]]}, ValueError, r"ball 1 is at .*: expected a place outside pocket 3"),
        (
            {"goals": [0, 0]},
            ValueError,
            "key of options = 'goals': expected one of 'positions', 'goal' .*did you mean 'goal'",
        ),
        ({"goal": [[0, 0]]}, ValueError, r"options\['goal'\] has shape \(1, 2\): expected \(2,\)"),
        (
            {"goal": [0, 0.62]},
            ValueError,
            r"options\['goal'\] as a position of the cue ball: .* at \[0.0, 0.62\]: .* inside the cushions",
        ),
        ({"goal": [0, np.nan]}, ValueError, "expected finite coordinates"),
        ({"goal": [1.24, 0.6]}, ValueError, "expected a place outside pocket 3"),
    ],
)
def test_bad_options_raise_and_the_episode_continues(options, error, message):
    env = BilliardsEnv(task="place")
    observation, _ = env.reset(seed=0)
    with pytest.raises(error, match=message):
        env.reset(options=options)
    assert np.array_equal(env.step(np.zeros(2))[0], observation)


@pytest.mark.parametrize(
    ("kwargs", "error", "message"),
    [
        ({"scene": "pol"}, ValueError, r"scene = 'pol': expected one of 'pool', .* \(did you mean 'pool'\?\)"),
        ({"scene": 3}, TypeError, "scene = 3: expected a name, a Scene, or a dict"),
        ({"scene": {"ball": {}}}, ValueError, "key of scene = 'ball': .*did you mean 'balls'"),
        (
            {"scene": Scene.named("pool").to_dict(), "n_object_balls": 2},
            ValueError,
            "n_object_balls = 2 with a scene without a name: expected None",
        ),
        ({"n_object_balls": 16}, ValueError, "n_object_balls = 16: expected a whole number from 0 to 15"),
        ({"n_object_balls": 0}, ValueError, "task = 'pot' with a scene of the cue ball alone: expected at least one"),
        ({"task": "carom", "n_object_balls": 0}, ValueError, "task = 'carom' with a scene of the cue ball alone"),
        (
            {"task": "sum_to_three", "scene": "pool"},
            ValueError,
            "'sum_to_three' with 1 object balls and 6 pockets: expected 1 object",
        ),
        (
            {"task": "sum_to_three", "scene": "carom", "n_object_balls": 2},
            ValueError,
            "'sum_to_three' with 2 object balls and 0 pockets: expected 1 object balls and a table without",
        ),
        ({"task": "pott"}, ValueError, "task = 'pott': expected one of 'pot', 'carom', .*did you mean 'pot'"),
        (
            {"scene": "carom"},
            ValueError,
            "task = 'pot' with 2 object balls and 0 pockets: expected object balls and a table with",
        ),
        (
            {"scene": {"base": "pool", "balls": {"radius": [0.02, 0.02], "mass": [0.1, "inf"]}}},
            ValueError,
            "task = 'pot' with object balls of infinite mass only: expected one of finite mass",
        ),
        ({"mode": "pci"}, ValueError, "mode = 'pci': expected"),
        ({"dt": 0.1}, ValueError, "dt = 0.1 with mode='pic': expected None"),
        ({"max_shots": 0}, ValueError, "max_shots = 0: expected a whole number from 1 to 1000000000"),
        ({"max_shots": 1.5}, ValueError, "max_shots = 1.5: expected a whole number from 1 to 1000000000"),
        ({"max_shots": True}, ValueError, "max_shots = True: expected a whole number from 1 to 1000000000"),
        ({"max_speed": 0.0}, ValueError, "max_speed = 0.0: expected a number from 1e-06 to 1000 m/s"),
        ({"max_speed": float("nan")}, ValueError, "max_speed = nan: expected a number from 1e-06 to 1000 m/s"),
        ({"max_speed": "fast"}, TypeError, "max_speed = 'fast': expected a number"),
        ({"layout": "racked"}, ValueError, "layout = 'racked': expected one of .*did you mean 'rack'"),
        ({"layout": "line", "n_object_balls": 2}, ValueError, "layout = 'line' with 2 object balls: expected 1"),
        (
            {"layout": None, "scene": "carom", "task": "carom", "n_object_balls": 3},
            ValueError,
            "'carom_opening' with 3",
        ),
        ({"observe_shots_left": 1}, ValueError, "observe_shots_left = 1: expected True or False"),
        ({"scratch_penalty": -1}, ValueError, "scratch_penalty = -1: expected a number from 0 to 1e.06"),
        ({"render_mode": "ansi"}, ValueError, "render_mode = 'ansi': expected one of 'human'"),
    ],
)
def test_bad_arguments_raise(kwargs, error, message):
    with pytest.raises(error, match=message):
        BilliardsEnv(**kwargs)


def test_a_shot_that_reaches_the_limit_on_events_warns(monkeypatch):
    monkeypatch.setattr(episodes, "MAX_EVENTS", 2)
    env = BilliardsEnv()
    env.reset(options={"positions": [[-0.5, 0.0], [0.5, 0.0]]})
    with pytest.warns(
        RuntimeWarning, match=r"after 2 events and .* s; .* positions \[\[-0.5, 0.0\], .* action \[1.0, 0"
    ):
        *_, info = env.step([1.0, 0.0])
    assert STATUS[info["status_code"]] == "event_limit"


def test_the_info_can_be_modified():
    env = BilliardsEnv(n_object_balls=2, max_shots=3)
    env.reset(options={"positions": [[-0.5, 0.0], [0.5, 0.0], [0.5, 0.3]]})
    *_, info = env.step([0.01, 0.0])
    info["potted"][:] = True
    info["cushions"][:] = 9
    *_, info = env.step([0.01, 0.0])
    assert not info["potted"].any()
    assert not info["cushions"].any()
