"""A trained policy as a player of games."""

from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from agents.config import Config
from agents.ppo import make_env, make_policy
from billiards_env import envs
from billiards_env.__main__ import main
from billiards_env.games import GameState, custom_opening, opening, play
from billiards_env.games.game_state import ANYWHERE, changed
from billiards_env.play.__main__ import make_history, make_parser
from billiards_env.players.batch import play_batch
from billiards_env.players.env_player import acting, action_of, env_situation
from billiards_env.players.named import find_player
from billiards_env.players.situation import PLACES, draw_places, game_situation
from billiards_env.players.strategies import FINALISTS, REPEATS, best_of
from billiards_env.sb3 import AimPolicy, policy_player
from billiards_env.sb3.aim_network import AimNetwork
from billiards_env.sb3.aim_policy import TURN
from billiards_env.sb3.policy_player import playable, policy, proposals
from billiards_env.sb3.weights import load_policy, save_policy
from tests.helpers.games import in_a_row, setup

RNG = np.random.default_rng


def test_the_policy_plays_the_nearest_legal_ball(trained):
    game = setup("nine_ball")
    player = policy(str(trained), game)
    rng = RNG(0)
    table = opening(game, rng, "random")
    # Its observation is the ball on, as if it were alone on the table.
    stroke = player(game_situation(game, table, 6.0), rng)
    straight = setup("straight", 1)
    alone = custom_opening(straight, table.positions[[0, 1]])
    assert stroke == policy(str(trained), straight)(game_situation(straight, alone, 6.0), rng)
    assert 0 < np.hypot(*stroke.velocity) <= 4.0 * (1 + 1e-6)
    slow = player(game_situation(game, table, 0.5), rng)
    assert np.hypot(*slow.velocity) <= 0.5 * (1 + 1e-6)


def untrained(folder, head="aim", **env):
    """Returns the folder and the untrained policy of a run, and its environment."""
    policy = {"head": "aim", "arguments": {"hidden": 16}} if head == "aim" else {"head": head, "hidden": [8]}
    learner = "likelihood" if "n_players" in env else "ppo"
    config = Config.from_dict({"timesteps": 0, "env": env, "policy": policy, "learner": learner})
    torch.manual_seed(0)
    (folder / "config.yaml").write_text(config.to_yaml())
    model: Any = make_policy(config)
    save_policy(model, folder / "policy.pt")
    return folder, model, make_env(config)


@pytest.mark.parametrize("head", ["gaussian", "aim"])
def test_the_stroke_is_the_shot_of_the_policy_in_the_plain_environment(tmp_path, head):
    folder, model, env = untrained(tmp_path, head, max_speed=5.0)
    game = setup("straight", 1)
    player = policy(str(folder), game)
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        table = custom_opening(game, cast(Any, env.unwrapped).positions)
        action, _ = model.predict(observation, deterministic=True)
        stroke = player(game_situation(game, table, 6.0), RNG(0))
        np.testing.assert_allclose(stroke.velocity, 5.0 * action.astype(float), rtol=1e-6)


def test_a_policy_plays_an_environment_made_without_gymnasium_at_its_speed(tmp_path):
    folder, model, env = untrained(tmp_path, max_speed=5.0)
    observation, _ = env.reset(seed=0)
    plain = envs.make_env(max_speed=5.0)
    plain.reset(seed=0)
    act = acting(find_player(f"policy:{folder}", plain), plain)
    assert act(observation).tolist() == model.predict(observation, deterministic=True)[0].tolist()
    with pytest.raises(ValueError, match=r"another max_speed: expected 5\.0, not 4\.0"):
        find_player(f"policy:{folder}", gym.make("Billiards-v0"))


def test_evaluate_takes_the_arguments_of_the_run(tmp_path, capsys):
    folder = str(untrained(tmp_path, task="carom", max_speed=5.0)[0])
    for task in ([], ["--task", "carom"]):
        main(["evaluate", f"policy:{folder}", *task, "--beside", "--episodes", "2"])
        shown = capsys.readouterr().out
        assert shown.startswith(f"other arguments of the environment: those of policy:{folder}\n")
    with pytest.raises(SystemExit, match="trained for another task: expected 'carom', not 'place'"):
        main(["evaluate", f"policy:{folder}", "--task", "place", "--beside", "--episodes", "2"])


def test_a_policy_plays_on_one_thread(tmp_path, monkeypatch):
    folder, _, env = untrained(tmp_path)
    observation, _ = env.reset(seed=0)
    act, seen, before = acting(find_player(f"policy:{folder}", env), env), [], torch.get_num_threads()
    forward = AimPolicy._predict

    def predict(*args, **kwargs):
        seen.append(torch.get_num_threads())
        return forward(*args, **kwargs)

    monkeypatch.setattr(AimPolicy, "_predict", predict)
    torch.set_num_threads(2)
    try:
        act(observation)
        assert (seen, torch.get_num_threads()) == ([1], 2)
    finally:
        torch.set_num_threads(before)


def test_a_folder_of_the_whole_name_comes_before_a_number_of_proposals(tmp_path):
    (folder := tmp_path / "2026-01-31_00:41").mkdir()
    _, model, env = untrained(folder)
    observation, _ = env.reset(seed=0)
    act = acting(find_player(f"policy:{folder}", env), env)
    assert act(observation).tolist() == model.predict(observation, deterministic=True)[0].tolist()
    find_player(f"policy:{folder}:2", env)


@pytest.mark.parametrize("head", ["gaussian", "aim"])
def test_loading_a_policy_leaves_the_global_generator_alone(tmp_path, head):
    untrained(tmp_path, head)
    before = torch.random.get_rng_state()
    load_policy(tmp_path)
    assert torch.equal(torch.random.get_rng_state(), before)


@pytest.mark.parametrize("head", ["gaussian", "aim"])
def test_the_best_of_several_proposals_is_played(tmp_path, head):
    folder, _, env = untrained(tmp_path, head)
    alone, best = (acting(find_player(f"policy:{folder}{count}", env), env, seed=1) for count in ("", ":64"))
    earned, base = np.zeros((2, 40)), cast(Any, env.unwrapped)
    for seed in range(40):
        observation, _ = env.reset(seed=seed)
        actions = np.array([alone(observation), best(observation)])
        earned[:, seed] = base.try_actions(actions).rewards
    assert (earned[1] >= earned[0]).all()
    assert (earned[1] > 0).sum() > (earned[0] > 0).sum()
    observation, _ = env.reset(seed=0)
    again = acting(find_player(f"policy:{folder}:64", env), env, seed=2)
    assert again(observation).tolist() != again(observation).tolist()  # new proposals each time


@pytest.mark.parametrize("arguments", [{"task": "nine_ball"}, {"n_object_balls": 3, "max_shots": 3}])
def test_in_a_run_out_the_critic_values_the_position_after_a_shot(tmp_path, monkeypatch, arguments):
    folder, model, env = untrained(tmp_path, layout="random", **arguments)
    monkeypatch.setattr(AimPolicy, "predict_values", lambda self, observations: 100.0 * observations[:, :1])
    base: Any = env.unwrapped
    observation, _ = env.reset(seed=1)
    action = acting(find_player(f"policy:{folder}:200", env), env, seed=4)(observation)
    proposed = proposals(model, observation, 200, RNG(4))
    outcomes = base.try_actions(proposed)
    ratings = outcomes.rewards
    if base.task == "nine_ball":
        assert (~outcomes.states["over"]).any()
        ratings = ratings + 100.0 * outcomes.observations[:, 0] * ~outcomes.states["over"]  # x of the cue ball
    assert np.array_equal(action, proposed[np.argmax(ratings)])


def test_with_noise_proposals_are_tried_with_noise_of_their_own(tmp_path):
    folder, *_ = untrained(tmp_path)
    env = envs.make_env(noise={"angle_std": 5.0})
    observation, _ = env.reset(seed=0)
    before = env.get_state()
    tried = []

    def player(situation, rng):
        rate = situation.rate
        return found(situation._replace(rate=lambda actions: tried.append(len(actions)) or rate(actions)), rng)

    found = find_player(f"policy:{folder}:20", env)
    acting(player, env, noise=(5.0, 0.05))(observation)
    assert tried == [20, FINALISTS * REPEATS]
    assert env.get_state() == before


@pytest.mark.parametrize("rules", ["straight", "nine_ball"])
def test_proposals_in_a_game_are_rated_by_its_rules(tmp_path, rules):
    folder, *_ = untrained(tmp_path)
    game = setup(rules, 9)
    alone, best = policy(str(folder), game), policy(f"{folder}:100", game)
    kept = np.zeros(2)
    for seed in range(15):
        table = opening(game, RNG(seed), "random")
        for k, player in enumerate((alone, best)):
            kept[k] += play(game, table, player(game_situation(game, table, 6.0), RNG(0))).verdict.continues
    assert kept[1] > kept[0] + 3


@pytest.mark.parametrize(
    ("arguments", "noise"),
    [
        ({"task": "nine_ball", "n_players": 2}, (0.0, 0.0)),  # the cue ball is in hand
        ({"task": "nine_ball", "n_players": 2}, (1.0, 0.1)),
        ({"task": "carom", "n_players": 2, "action": "strike"}, (1.0, 0.1)),
        ({"action": "cut"}, (1.0, 0.1)),
        ({"action": "plan"}, (1.0, 0.1)),
    ],
)
def test_policies_propose_whole_actions_of_an_environment(tmp_path, arguments, noise):
    env = envs.make_env(**arguments, noise={} if any(noise) else None)
    observation, _ = env.reset(seed=0)
    model: Any = PPO("MlpPolicy", env, n_steps=8, batch_size=8, device="cpu").policy
    situation = env_situation(env, observation, noise)
    actions = proposals(model, observation, 8, RNG(0))
    assert actions.shape == (8, *env.action_space.shape)
    env.step(action_of(env, best_of(situation, actions, RNG(0))).astype(actions.dtype))


def test_proposals_of_a_policy_of_games_are_rated_by_their_rules():
    env = envs.make_env(task="nine_ball", n_players=2, layout="random", can_place=False)
    env.reset(seed=1)
    actions = RNG(0).uniform(-1, 1, (300, 2))
    situation = env_situation(env)
    assert env.model.setup is not None
    expected = game_situation(env.model.setup, env.game, env.max_speed).rate(actions)
    assert np.minimum(situation.rate(actions), 101).tolist() == expected.tolist()  # a win is also a point here
    assert len(set(expected.tolist())) > 1


@pytest.mark.parametrize("text", ["", "nowhere"])
def test_a_folder_without_a_policy_is_refused(text):
    with pytest.raises(FileNotFoundError, match="expected 'policy:' and the folder of a finished run"):
        policy(text, setup("straight"))
    with pytest.raises(ValueError, match="number of proposals = 0"):
        policy(f"{text}:0", setup("straight"))
    with pytest.raises(FileNotFoundError, match=r"run_dir = .*: expected the folder of a finished run"):
        find_player(f"policy:{text}", envs.make_env())


def test_playable_returns_a_game_that_the_policy_can_play(trained, tmp_path):
    assert playable(trained) == "straight"
    for task, rules in (("carom", "carom"), ("sum_to_three", None)):
        assert playable(untrained(tmp_path, "gaussian", task=task, scene=task)[0]) == rules


def test_a_policy_that_observes_physics_is_refused(tmp_path):
    folder, *_ = untrained(
        tmp_path, "gaussian", randomize={"mu_roll": [0.005, 0.015]}, observe=["positions", "physics"]
    )
    with pytest.raises(ValueError, match="expected a policy trained without observed physics, strikes or a goal"):
        policy(str(folder), setup("straight"))


def test_a_policy_of_another_game_or_table_is_refused(trained):
    with pytest.raises(ValueError, match="expected a policy trained with 2 object balls, not 1"):
        policy(str(trained), setup("carom"))
    for arguments in ([], ["--scene", "pool"]):
        game = make_history(make_parser().parse_args(["--rules", "straight", *arguments]), RNG(0)).setup
        if arguments:
            assert policy(str(trained), game)
        else:  # the window opens straight pool on the table with jaws
            with pytest.raises(ValueError, match="expected the table and the balls of its training; --scene"):
                policy(str(trained), game)


def test_a_policy_of_one_ball_plays_the_legal_ball_with_the_largest_value(tmp_path):
    folder, model, _ = untrained(tmp_path)
    game = setup("straight", 3)
    table = custom_opening(game, [[0.1, 0.2], [0.5, 0.3], [-0.4, -0.1], [-0.9, 0.4]])
    stroke = policy(str(folder), game)(game_situation(game, table, 6.0), RNG(0))
    half = np.array(game.scene.half_extents)
    seen = np.array([[table.positions[0], ball] for ball in table.positions[1:]]) / half
    observations = seen.reshape(3, 4).astype(np.float32)
    best = int(model.predict_values(torch.as_tensor(observations)).argmax())
    action, _ = model.predict(observations[best], deterministic=True)
    np.testing.assert_allclose(stroke.velocity, 4.0 * action.astype(float), rtol=1e-5)


@pytest.mark.parametrize("balls", [1, 2])
def test_a_policy_that_aims_plays_with_any_number_of_balls_at_legal_ones(tmp_path, balls):
    folder, *_ = untrained(tmp_path, n_object_balls=balls, max_shots=balls, observe=["positions", "shots_left"])
    game = setup("nine_ball")
    table = custom_opening(game, in_a_row(10, {1: (0.9, 0.5)}))
    stroke = policy(str(folder), game)(game_situation(game, table, 6.0), RNG(0))
    way = np.array([0.9, 0.5]) - table.positions[0]
    assert np.dot(stroke.velocity, way) > 0.99 * np.hypot(*stroke.velocity) * np.hypot(*way)  # the one is on


def test_a_policy_of_a_game_chooses_the_place_of_the_cue_ball_and_the_shot_by_their_values(tmp_path, monkeypatch):
    folder, *_ = untrained(tmp_path, task="eight_ball", n_players=2, can_place=False)
    monkeypatch.setattr(AimNetwork, "values", lambda self, **seen: seen["positions"][:, 0, 1])  # y of the cue ball
    situations = []

    def best(situation, actions, rng):
        situations.append(situation)
        return best_of(situation, actions, rng)

    monkeypatch.setattr(policy_player, "best_of", best)
    config = (folder / "config.yaml").read_text()
    (folder / "config.yaml").write_text(config.replace("noise: null", "noise: {angle_std: 1.0, speed_std: 0.2}"))
    game = setup("eight_ball")
    table = opening(game, RNG(2), "random")
    table = GameState(table.positions, changed(table.state, in_hand=ANYWHERE))
    stroke = policy(f"{folder}:20", game)(game_situation(game, table, 4.0), RNG(0))
    assert stroke.place == max(draw_places(game, table, RNG(0), PLACES), key=lambda place: place[1])
    positions, actions = table.positions.copy(), RNG(1).uniform(-0.7, 0.7, (300, 2))
    positions[0] = stroke.place
    played = play_batch(game, GameState(positions, table.state), 4.0 * actions)
    y, shoots = played.positions[:, 0, 1] / game.scene.half_extents[1], played.states["player"] == 0
    known = played.states["in_hand"] == 0
    expected = np.where(shoots, y + TURN, -y)[known]
    assert {False, True} == set(shoots[known])
    (situation,) = situations
    assert situation.noise == (1.0, 0.2)  # that of the training
    assert situation.rate(actions)[known] == pytest.approx(expected, abs=1e-6)
    assert np.hypot(*stroke.velocity) <= 4.0 * (1 + 1e-6)
