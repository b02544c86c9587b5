import dataclasses
import json
import shutil
import traceback
from pathlib import Path
from typing import cast

import gymnasium as gym
import numpy as np
import pygame
import pytest
import torch
from stable_baselines3 import PPO

from agents.config import Config, Noise, load
from agents.evaluate import deterministic, evaluate, main
from agents.ppo import load_policy, make_env, make_policy, make_vector
from billiards_env.envs import BilliardsEnv
from billiards_env.evaluation import evaluation_seeds, measure, play, play_together
from billiards_env.intervals import wilson_interval
from billiards_env.sb3 import AimPolicy
from billiards_env.sb3.weights import save_policy
from tests.helpers.training import Pickled, trained_run

ROOT = Path(__file__).resolve().parents[2]
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
        return (
            np.full(1, 0.5, np.float32),
            float(action[0]),
            over,
            False,
            {"is_success": over and self.even, "score": 3 * self.steps + self.even},
        )


def test_play_sums_rewards_and_counts_successes_at_the_last_step():
    result = play(TwoShots(), lambda observation: observation + 0.25, [2, 3, 4, 5, 6])
    assert result["episodes"] == 5
    assert result["successes"] == 3
    assert result["success_rate"] == 0.6
    assert result["mean_reward"] == pytest.approx(0.25 + 0.75)
    assert result["confidence_interval_95"] == list(wilson_interval(3, 5))
    assert result["mean_score"] == 6.6
    assert result["score_interval_95"] == pytest.approx([6.6 - 0.48, 6.6 + 0.48], abs=1e-3)
    assert play(TwoShots(), lambda observation: observation, [2])["score_interval_95"] is None


def test_an_evaluation_is_printed_written_and_repeatable(trained, tmp_path, capsys):
    run_dir = tmp_path / "run"
    shutil.copytree(trained, run_dir)
    main([str(run_dir)])
    written = json.loads((run_dir / "evaluation.json").read_text())
    printed = capsys.readouterr().out
    for name in ("policy", "random"):
        assert written[name]["episodes"] == 20
        (line,) = (line for line in printed.splitlines() if line.split()[:1] == [name])
        rate, score = written[name]["success_rate"], written[name]["mean_score"]
        assert (line.split()[1], line.split()[5]) == (f"{rate:.1%}", f"{score:.3f}")
        assert written[name]["confidence_interval_95"][0] <= written[name]["success_rate"]
    for options in (f"{run_dir} --film run.mp4", f"{run_dir} --show", f"human,policy:{run_dir}", f"--logdir {run_dir}"):
        assert f"{options}\n" in printed
    assert evaluate(run_dir) == written
    assert evaluate(run_dir, episodes=30, seed=1)["random"]["episodes"] == 30
    assert json.loads((run_dir / "evaluation.json").read_text())["seed"] == 1


def test_runs_and_players_are_printed_side_by_side_with_their_learning_curves(trained, tmp_path, capsys):
    for name in ("one", "two"):
        shutil.copytree(trained, tmp_path / name)
    curve = tmp_path / "curve.png"
    runs = [str(tmp_path / "one"), str(tmp_path / "two")]
    main([*runs, "--players", "search:5", "--episodes", "15", "--curve", str(curve)])
    printed = capsys.readouterr().out
    rows = {line.split()[0]: line.split() for line in printed.splitlines() if "% to" in line}
    assert list(rows) == ["one", "two", "random", "search:5"]
    expected = measure("search:5", load(tmp_path / "one" / "config.yaml").env, (0.0, 0.0), 15, 5)
    assert rows["search:5"][1] == f"{expected['success_rate']:.1%}"
    assert curve.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(SystemExit, match=r"error: path = .*: expected a name that ends in '.png'"):
        main([runs[0], "--curve", "curve.pdf"])
    with pytest.raises(SystemExit, match="error: player = 'nobody': expected one of"):
        main([runs[0], "--players", "nobody"])


def test_the_agent_learns_to_hit_a_big_ball(tmp_path):
    balls = {"radius": [0.12, 0.12], "mass": [0.2, 0.2]}
    config = Config.from_dict(
        {
            "timesteps": 2048,
            "n_envs": 32,
            "env": {
                "scene": {"balls": balls, "table": {"cushion_height": 0.15}},
                "task": "carom",
                "layout": "random",
                "max_speed": 1.0,
            },
            "policy": {"hidden": [16]},
            "ppo": {"n_steps": 8, "learning_rate": 3e-3, "gae_lambda": 1.0},
        }
    )
    result = evaluate(trained_run(config, tmp_path / "run"), episodes=200)
    assert result["policy"]["success_rate"] > 0.6
    assert result["random"]["success_rate"] < 0.3


def test_noise_applies_to_training_and_evaluation(tiny, tmp_path):
    start = str(ROOT / "studies" / "results" / "policies" / "pot")
    quiet = Config.from_dict(tiny(timesteps=128, start_from=start, policy={"head": "aim"}))
    noisy = dataclasses.replace(quiet, noise=Noise(angle_std=1.0, speed_std=0.1))
    weights = []
    for name, config in (("quiet", quiet), ("noisy", noisy)):
        weights.append(torch.load(trained_run(config, tmp_path / name) / "policy.pt"))
    assert not all(torch.equal(weights[0][key], weights[1][key]) for key in weights[0])
    act, seeds = deterministic(load_policy(tmp_path / "noisy")[1]), evaluation_seeds(quiet.seed, 200).tolist()
    without, with_noise = (play_together(make_vector(config, 200), act, seeds) for config in (quiet, noisy))
    assert evaluate(tmp_path / "noisy", episodes=200)["policy"] == with_noise
    assert with_noise["success_rate"] < without["success_rate"] - 0.1


def test_both_policies_play_the_same_layouts_and_random_actions_are_velocities(trained, tmp_path, monkeypatch):
    shutil.copytree(trained, tmp_path / "run")
    met, drawn = [], []

    def spy(envs, act, seeds):
        met.append(envs.reset(seed=seeds)[0])
        drawn.append(act(met[-1]))
        return play_together(envs, act, seeds)

    monkeypatch.setattr("agents.evaluate.play_together", spy)
    evaluate(tmp_path / "run", episodes=2000)
    assert np.array_equal(*met)
    assert len(np.unique(met[0], axis=0)) == 2000
    assert drawn[1].shape == (2000, 2)
    np.testing.assert_allclose(drawn[1].mean(axis=0), 0, atol=0.05)
    np.testing.assert_allclose(drawn[1].std(axis=0), 3**-0.5, atol=0.03)


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
    one_by_one = play(make_env(config), lambda observation: act, seeds)
    assert one_by_one["mean_reward"] != 0
    together = play_together(make_vector(config, 7), lambda observations: np.tile(act, (7, 1)), seeds)
    assert together == one_by_one


@pytest.mark.parametrize("policy", [{"hidden": [8]}, AIM], ids=["gaussian", "aim"])
def test_the_loaded_policy_is_the_trained_one(tiny, tmp_path, policy):
    config = Config.from_dict(tiny(timesteps=128, policy=policy))
    loaded, policy = load_policy(trained_run(config, tmp_path / "run"))
    assert loaded == config
    model = PPO.load(tmp_path / "run" / "model.zip", device="cpu")
    observations, _ = make_vector(config, 50).reset(seed=0)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_array_equal(policy.predict(observations, deterministic=True)[0], expected)
    np.testing.assert_array_equal(deterministic(policy)(observations), expected)


def saved(config: Config, run_dir: Path) -> AimPolicy:
    """Writes the files of a run that `load_policy` reads, and returns the policy."""
    run_dir.mkdir(parents=True)
    (run_dir / "config.yaml").write_text(config.to_yaml())
    policy = cast(AimPolicy, make_policy(config))
    with torch.no_grad():
        for weights in policy.parameters():
            weights.add_(0.1)
    save_policy(policy, run_dir / "policy.pt")
    return policy


def test_a_policy_is_loaded_for_another_number_of_balls(tiny, tmp_path):
    settings = tiny(env={"max_speed": 5.0}, policy=AIM)
    policy = saved(Config.from_dict(settings), tmp_path / "run")
    config, loaded = load_policy(tmp_path / "run", env={"n_object_balls": 3, "max_shots": 4})
    assert config.env == {**Config.from_dict(settings).env, "n_object_balls": 3, "max_shots": 4}
    assert isinstance(loaded, AimPolicy)
    assert loaded.observation_space.shape == (8,)
    assert all(torch.equal(weights, policy.state_dict()[name]) for name, weights in loaded.state_dict().items())
    envs = make_vector(config, 50)
    observations, _ = envs.reset(seed=0)
    envs.step(deterministic(loaded)(observations))
    assert load_policy(tmp_path / "run")[0] == Config.from_dict(settings)
    with pytest.raises(TypeError, match="balls"):
        load_policy(tmp_path / "run", env={"balls": 3})


def test_the_usual_policy_is_not_loaded_for_another_number_of_balls(trained):
    with pytest.raises(ValueError, match=r"policy.pt does not hold the policy of its configuration"):
        load_policy(trained, env={"n_object_balls": 3})


@pytest.mark.parametrize("value", [Pickled("ran"), "text", [0.0]])
def test_a_policy_file_with_other_objects_is_refused_and_runs_no_code(trained, tmp_path, monkeypatch, value):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(trained, tmp_path / "run")
    weights = torch.load(trained / "policy.pt")
    for content in ({**weights, "log_std": value}, value):
        torch.save(content, tmp_path / "run" / "policy.pt")
        with pytest.raises(ValueError, match=r"policy.pt does not hold a policy's weights: expected a whole") as error:
            load_policy(tmp_path / "run")
        assert "weights_only" not in "".join(traceback.format_exception(error.value))
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("share", [0.0, 0.99])
def test_an_incomplete_policy_file_is_refused(trained, tmp_path, share):
    shutil.copytree(trained, tmp_path / "run")
    content = (trained / "policy.pt").read_bytes()
    (tmp_path / "run" / "policy.pt").write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match=r"run.policy.pt does not hold a policy's weights: \w"):
        load_policy(tmp_path / "run")
    with pytest.raises(SystemExit, match=r"error: .*run.policy.pt does not hold a policy's weights"):
        main([str(tmp_path / "run")])


@pytest.mark.parametrize(
    "change",
    [
        lambda weights: {name: tensor[:1] for name, tensor in weights.items()},
        lambda weights: {name: tensor for name, tensor in weights.items() if name != "log_std"},
        lambda weights: {**weights, "another": torch.zeros(1)},
    ],
)
def test_a_policy_of_another_shape_is_refused(trained, tmp_path, change):
    shutil.copytree(trained, tmp_path / "run")
    torch.save(change(torch.load(trained / "policy.pt")), tmp_path / "run" / "policy.pt")
    with pytest.raises(ValueError, match=r"policy.pt does not hold the policy of its configuration"):
        load_policy(tmp_path / "run")


def test_bad_arguments_are_refused_with_a_message(trained, tmp_path):
    with pytest.raises(
        SystemExit, match=r"error: run_dir = .*: expected the folder of a finished run .* with config.yaml"
    ):
        main([str(tmp_path)])
    for option, value, message in (
        ("episodes", "0", "episodes = '0': expected a number >= 1"),
        ("seed", "-1", "seed = '-1': expected a number >= 0"),
        ("episodes", "many", "episodes = 'many': expected a valid integer"),
        ("film", "film.avi", "path = 'film.avi': expected a name that ends in '.mp4'"),
    ):
        with pytest.raises(SystemExit, match=f"error: {message}"):
            main([str(trained), f"--{option}", value])
    shutil.copytree(trained, tmp_path / "run")
    (tmp_path / "run" / "policy.pt").unlink()
    with pytest.raises(
        SystemExit, match=r"error: run_dir = .*: expected the folder of a finished run .* with policy.pt"
    ):
        main([str(tmp_path / "run")])


def test_a_film_holds_the_first_episodes_of_the_evaluation(trained, tmp_path, monkeypatch, capsys):
    begun = []
    reset = BilliardsEnv.reset

    def spy(self, *, seed=None, options=None):
        begun.append(seed)
        return reset(self, seed=seed, options=options)

    monkeypatch.setattr(BilliardsEnv, "reset", spy)
    main([str(trained), "--film", str(tmp_path / "film.mp4"), "--episodes", "2"])
    assert begun == evaluation_seeds(5, 20)[:2].tolist()
    printed = capsys.readouterr().out
    assert [line.split(":")[0] for line in printed.splitlines()] == [
        "episode 1",
        "episode 2",
        f"written to {tmp_path / 'film.mp4'}",
    ]
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert list(tmp_path.iterdir()) == [tmp_path / "film.mp4"]


@pytest.mark.parametrize("driver", ["dummy", "offscreen"])
def test_show_plays_the_policy_in_a_window_or_reports_a_missing_display(driver, trained, monkeypatch, capsys):
    shown = []

    def step(self, shots):
        pygame.display.init()
        shown.append(self.render_mode)

    monkeypatch.setenv("SDL_VIDEODRIVER", driver)
    monkeypatch.setattr("billiards_env.envs.rendering.Renderer.step", step)
    monkeypatch.setattr("agents.film.PAUSE", 0.0)
    pygame.display.quit()
    try:
        if driver == "offscreen":
            with pytest.raises(SystemExit, match="error: display = 'offscreen': expected one that shows a window"):
                main([str(trained), "--show"])
        else:
            main([str(trained), "--show", "--episodes", "2"])
            assert shown == ["human"] * 4  # a layout and a shot of each episode
            assert "episode 2: " in capsys.readouterr().out
    finally:
        pygame.display.quit()
