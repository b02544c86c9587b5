import json
import shutil
import traceback
from typing import cast

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from agents import evaluate as evaluation
from agents.config import Config, load
from agents.evaluate import evaluate, load_run, main
from agents.ppo import deterministic, make_env, make_policy, make_vector
from billiards_env.bench.evaluation import evaluation_seeds, measure, play_episodes, play_together
from billiards_env.envs import BilliardsEnv
from billiards_env.intervals import wilson_interval
from billiards_env.sb3 import AimPolicy
from billiards_env.sb3.weights import save_policy
from tests.helpers.training import Pickled, trained_run

AIM = {"head": "aim", "arguments": {"hidden": 8}}


class TwoShots(gym.Env):
    """An episode has two steps. The reward is the action. The episode is a success if the seed is even."""

    observation_space = gym.spaces.Box(-1, 1, (1,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        self.even, self.steps = seed is not None and seed % 2 == 0, 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.steps += 1
        over = self.steps == 2
        info = {"is_success": over and self.even, "score": 3 * self.steps + self.even}
        return np.full(1, 0.5, np.float32), float(action[0]), over, False, info


def test_play_sums_rewards_and_counts_successes_at_the_last_step():
    result = play_episodes(TwoShots(), lambda observation: observation + 0.25, [2, 3, 4, 5, 6])
    assert (result["episodes"], result["successes"], result["success_rate"], result["mean_score"]) == (5, 3, 0.6, 6.6)
    assert result["mean_reward"] == pytest.approx(0.25 + 0.75)
    assert result["confidence_interval_95"] == list(wilson_interval(3, 5))
    assert result["score_interval_95"] == pytest.approx([6.6 - 0.48, 6.6 + 0.48], abs=1e-3)
    assert play_episodes(TwoShots(), lambda observation: observation, [2])["score_interval_95"] is None


def test_runs_random_shots_and_players_are_printed_side_by_side(trained, tmp_path, capsys):
    for name in ("one", "two"):
        shutil.copytree(trained, tmp_path / name)
    one, curve = tmp_path / "one", tmp_path / "curve.png"
    main([str(one), str(tmp_path / "two"), "--players", "search:5", "--curve", str(curve)])
    printed = capsys.readouterr().out
    rows = {line.split()[0]: line.split()[1:] for line in printed.splitlines() if "% to" in line}
    assert list(rows) == [str(one), str(tmp_path / "two"), "random", "search:5"]
    written = json.loads((one / "evaluation.json").read_text())
    results = {str(one): written["policy"], "random": written["random"]}
    results["search:5"] = measure("search:5", load(one / "config.yaml").env, (0.0, 0.0), 20, 5)
    for name, result in results.items():
        assert rows[name][:2] == ["20", f"{result['success_rate']:.1%}"]
    for options in (f"{one} --film one.mp4", f"human,policy:{one}", f"--logdir {one}"):
        assert f"{options}\n" in printed
    assert curve.read_bytes().startswith(b"\x89PNG")
    assert evaluate(one) == written
    assert evaluate(one, episodes=30, seed=1)["random"]["episodes"] == 30


def test_a_player_that_fails_stops_no_other_one(trained, monkeypatch, capsys):
    usual = evaluation.evaluate_player

    def failing(run_dir, player, *arguments):
        if player == "random":
            raise KeyError(player)
        return usual(run_dir, player, *arguments)

    monkeypatch.setattr(evaluation, "evaluate_player", failing)
    with pytest.raises(SystemExit, match=r"^error: random: KeyError: 'random' \("):
        main([str(trained), "--players", "random", "search:5"])
    printed = capsys.readouterr().out
    assert [line.split()[0] for line in printed.splitlines() if "% to" in line][1:] == ["random", "search:5"]
    assert "\nfilm: " in printed


def test_noise_applies_to_training_and_evaluation(tiny, tmp_path):
    quiet = Config.from_dict(tiny(timesteps=128, policy=AIM))
    noisy = Config.from_dict(tiny(timesteps=128, policy=AIM, noise={"angle_std": 20.0, "speed_std": 1.0}))
    runs = [trained_run(config, tmp_path / name) for name, config in (("quiet", quiet), ("noisy", noisy))]
    first, second = (torch.load(run / "policy.pt") for run in runs)
    assert not all(torch.equal(first[key], second[key]) for key in first)
    act, seeds = deterministic(load_run(runs[1])[1]), evaluation_seeds(5, 200).tolist()
    without, with_noise = (play_together(make_vector(config, 200), act, seeds) for config in (quiet, noisy))
    assert evaluate(runs[1], episodes=200)["policy"] == with_noise != without


@pytest.mark.parametrize(
    "changes",
    [
        {"env": {"n_object_balls": 3, "max_shots": 4}},
        {"env": {"n_object_balls": 5, "max_shots": 2}, "noise": {"angle_std": 5.0}},
    ],
)
def test_episodes_played_together_equal_episodes_played_alone(tiny, changes):
    config = Config.from_dict(tiny(**changes))
    seeds = [3, 1, 4, 15, 9, 2, 6]
    act = np.array([0.02, 0.9], np.float32)
    one_by_one = play_episodes(make_env(config), lambda observation: act, seeds)
    assert one_by_one["mean_reward"] != 0
    together = play_together(make_vector(config, 7), lambda observations: np.tile(act, (7, 1)), seeds)
    assert together == one_by_one


@pytest.mark.parametrize("policy", [{"head": "gaussian", "hidden": [8]}, AIM], ids=["gaussian", "aim"])
def test_the_loaded_policy_is_the_trained_one(tiny, tmp_path, policy):
    config = Config.from_dict(tiny(timesteps=128, policy=policy))
    loaded, policy = load_run(trained_run(config, tmp_path / "run"))
    assert loaded == config
    model = PPO.load(tmp_path / "run" / "model.zip", device="cpu")
    observations, _ = make_vector(config, 50).reset(seed=0)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_array_equal(deterministic(policy)(observations), expected)


def test_a_policy_is_loaded_for_other_balls_and_for_shots_left(tiny, tmp_path):
    config = Config.from_dict(tiny(env={"max_speed": 5.0}, policy=AIM))
    (tmp_path / "config.yaml").write_text(config.to_yaml())
    policy = cast(AimPolicy, make_policy(config))
    with torch.no_grad():
        for weights in policy.parameters():
            weights.add_(0.1)
    save_policy(policy, tmp_path / "policy.pt")
    three = {"n_object_balls": 3, "max_shots": 4}
    actions = []
    for shots_left in ([], ["shots_left"]):
        env = {**three, "observe": ["positions", *shots_left]}
        changed, loaded = load_run(tmp_path, env=env)
        assert changed.env == {**config.env, **env}
        assert all(torch.equal(weights, policy.state_dict()[name]) for name, weights in loaded.state_dict().items())
        observations, _ = make_vector(changed, 50).reset(seed=0)
        assert observations.shape[1] == 8 + len(shots_left)
        actions.append(deterministic(loaded)(observations))
    assert np.array_equal(*actions)
    with pytest.raises(TypeError, match="balls"):
        load_run(tmp_path, env={"balls": 3})


def test_the_usual_policy_is_not_loaded_for_another_number_of_balls(trained):
    with pytest.raises(ValueError, match=r"policy.pt does not hold the policy of its configuration"):
        load_run(trained, env={"n_object_balls": 3})


def test_a_policy_file_that_is_damaged_or_holds_other_objects_runs_no_code(trained, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run = shutil.copytree(trained, tmp_path / "run")
    content, weights = (run / "policy.pt").read_bytes(), torch.load(trained / "policy.pt")
    for value in ({**weights, "log_std": Pickled("ran")}, Pickled("ran"), "text"):
        torch.save(value, run / "policy.pt")
        with pytest.raises(ValueError, match=r"policy.pt': expected a whole file of a policy's weights") as error:
            load_run(run)
        assert "weights_only" not in "".join(traceback.format_exception(error.value))
    assert not (tmp_path / "ran").exists()
    (run / "policy.pt").write_bytes(content[:-10])
    with pytest.raises(SystemExit, match=r"error: .*run.policy.pt': expected a whole file of a policy's weights"):
        main([str(run)])
    torch.save({**weights, "another": torch.zeros(1)}, run / "policy.pt")
    with pytest.raises(ValueError, match=r"policy.pt does not hold the policy of its configuration"):
        load_run(run)
    (run / "policy.pt").unlink()
    capsys.readouterr()
    with pytest.raises(SystemExit, match=r"error: run_dir = .*: expected the folder of a finished run .* policy.pt"):
        main([str(trained), str(run)])
    assert capsys.readouterr().out == ""


WRONG = [
    ("episodes", "0", "episodes = 0: expected a whole number"),
    ("seed", "-1", "seed = -1: expected a whole number"),
    ("film", "film.avi", "path = 'film.avi': expected a name that ends in '.mp4'"),
    ("curve", "curve.pdf", "path = 'curve.pdf': expected a name that ends in '.png'"),
    ("slim", ".", "--slim = '.': expected a new folder"),
    ("players", "nobody", "player = 'nobody': expected one of"),
]


@pytest.mark.parametrize(("option", "value", "message"), WRONG)
def test_bad_arguments_are_refused_with_a_message(trained, option, value, message):
    with pytest.raises(SystemExit, match=f"error: {message}"):
        main([str(trained), f"--{option}", value])


def test_a_player_that_needs_derivatives_is_refused_before_a_shot_with_flights(trained, monkeypatch, capsys):
    monkeypatch.setattr(evaluation, "make_env", lambda config: gym.make("billiards_env:Billiards-v0", task="jump"))
    with pytest.raises(SystemExit, match=r"error: physics\.flight = True with player = 'aim': expected False or"):
        main([str(trained), "--players", "aim"])
    assert capsys.readouterr().out == ""


def test_a_slim_copy_plays(trained, tmp_path, capsys):
    main([str(trained), "--slim", str(tmp_path / "copy")])
    assert capsys.readouterr().out == f"wrote {tmp_path / 'copy'}\n"
    assert load_run(tmp_path / "copy")[0] == load_run(trained)[0]
    main([str(tmp_path / "copy"), "--episodes", "5"])
    with pytest.raises(SystemExit, match=r"error: --slim = .*copy': expected a new folder"):
        main([str(trained), "--slim", str(tmp_path / "copy")])


def test_a_film_holds_the_first_episodes_of_the_evaluation(trained, tmp_path, monkeypatch, capsys):
    begun = []
    reset = BilliardsEnv.reset

    def spy(self, *, seed=None, options=None):
        begun.append(seed)
        return reset(self, seed=seed, options=options)

    monkeypatch.setattr(BilliardsEnv, "reset", spy)
    main([str(trained), "--film", str(tmp_path / "film.mp4"), "--episodes", "2"])
    assert begun == evaluation_seeds(5, 20)[:2].tolist()
    assert [line.split(":")[0] for line in capsys.readouterr().out.splitlines()] == ["episode 1", "episode 2"]
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"
