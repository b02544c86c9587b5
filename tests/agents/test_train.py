import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import cast

import pytest
import torch
import yaml
from stable_baselines3 import PPO
from stable_baselines3.common.save_util import load_from_zip_file

import agents
from agents import train as module
from agents.config import Config, load
from agents.evaluate import evaluate
from agents.ppo import training_seed
from billiards_env.bench.evaluation import evaluation_seeds
from billiards_env.sb3.weights import slim
from tests.helpers.training import Pickled

ROOT = Path(__file__).resolve().parents[2]
AIM = {"head": "aim", "arguments": {"hidden": 16, "exploration": 640}}


def weights(path: Path) -> dict[str, torch.Tensor]:
    return cast(dict[str, torch.Tensor], load_from_zip_file(path, load_data=False, device="cpu")[1]["policy"])


def equal(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> bool:
    return a.keys() == b.keys() and all(torch.equal(a[key], b[key]) for key in a)


@pytest.fixture
def command(tiny, tmp_path):
    """A function that runs the command with the tiny settings, with some changes; its run folder is `tmp_path/run`."""

    def run(*arguments: str, **changes) -> None:
        path = tmp_path / "settings.yaml"
        path.write_text(yaml.safe_dump(tiny(**changes)))
        module.main([str(path), "--run-dir", str(tmp_path / "run"), *arguments])

    return run


def test_a_run_folder_has_settings_versions_logs_checkpoints_and_model(trained, tiny):
    assert load(trained / "config.yaml") == Config.from_dict(tiny())
    assert "torch" in json.loads((trained / "versions.json").read_text())
    files = {path.name for path in trained.iterdir()} - {".lock", "evaluation.json"}
    assert files | {"evaluation.json"} == {"config.yaml", *module._FILES, *module._FOLDERS}
    assert [path.name for path in (trained / "checkpoints").iterdir()] == ["000000256.zip"]
    model = PPO.load(trained / "model.zip", device="cpu")
    assert model.num_timesteps == 512
    assert equal(model.policy.state_dict(), weights(trained / "model.zip"))
    curve = module.learning_curve(trained)
    assert [point.steps for point in curve] == [0, 256, 512]
    assert 0 == curve[0].training_success < curve[1].seconds < curve[2].seconds
    measured = evaluate(trained)["policy"]
    assert (curve[-1].success, curve[-1].score) == (measured["success_rate"], measured["mean_score"])


@pytest.mark.parametrize("policy", [{"head": "gaussian", "hidden": [16]}, AIM], ids=["gaussian", "aim"])
def test_an_interrupted_run_ends_with_the_weights_of_an_uninterrupted_one(command, tmp_path, monkeypatch, policy):
    command(policy=policy)
    uninterrupted = weights(tmp_path / "run" / "model.zip")
    curve = module.learning_curve(tmp_path / "run")

    def stop(self, *arguments):
        if self.num_timesteps >= 320:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(PPO, "_update_info_buffer", stop)
        with pytest.raises(SystemExit, match="130"):
            command("--fresh", policy=policy)
    assert not (tmp_path / "run" / "model.zip").exists()
    with monkeypatch.context() as patch:  # measurements change no random numbers of the training
        patch.setattr(module.LearningCurve, "measure", lambda self, policy, *args: policy.set_training_mode(False))
        command(policy=policy)
    assert equal(weights(tmp_path / "run" / "model.zip"), uninterrupted)
    assert [point[3:] for point in module.learning_curve(tmp_path / "run")] == [point[3:] for point in curve[:2]]
    if policy is AIM:
        assert int(uninterrupted["shots"]) == 512
        assert uninterrupted["net.std"][0].item() == pytest.approx(0.1 * 0.3**0.8)


@pytest.mark.slow
def test_a_killed_command_resumes(tiny, trained, tmp_path):
    path, run = tmp_path / "settings.yaml", tmp_path / "run"
    path.write_text(yaml.safe_dump(tiny()))
    command = [sys.executable, "-m", "agents.train", str(path), "--run-dir", str(run)]
    first = subprocess.Popen(command, cwd=ROOT)
    while module.newest_checkpoint(run) is None and first.poll() is None:
        time.sleep(0.005)
    first.send_signal(signal.SIGKILL)
    first.wait()
    subprocess.run(command, cwd=ROOT, check=True)
    assert equal(weights(run / "model.zip"), weights(trained / "model.zip"))


def test_a_finished_run_is_trained_again_only_with_fresh(command, tmp_path, capsys):
    command("--timesteps", "128")
    first = (tmp_path / "run" / "model.zip").read_bytes()
    command("--timesteps", "128")
    assert "is trained already (128 shots)" in capsys.readouterr().out
    assert (tmp_path / "run" / "model.zip").read_bytes() == first
    with pytest.raises(SystemExit, match=r"expected a run of the same settings, but seed is 5, not 6\. --run-dir"):
        command("--timesteps", "128", "--seed", "6")
    command("--timesteps", "128", "--seed", "6", "--fresh")
    assert load(tmp_path / "run" / "config.yaml").seed == 6
    assert (tmp_path / "run" / "model.zip").read_bytes() != first


def test_a_run_starts_from_the_weights_of_another_with_fewer_balls(command, tmp_path):
    run, other = tmp_path / "run", tmp_path / "other"
    command("--timesteps", "128", policy=AIM)
    run.rename(other)
    env = {"n_object_balls": 3, "max_shots": 5}
    command("--timesteps", "0", "--start-from", str(other), policy=AIM, env=env)
    assert equal(*(torch.load(folder / "policy.pt", weights_only=True) for folder in (run, other)))
    assert module.learning_curve(run)[-1].success == evaluate(run)["policy"]["success_rate"]
    shutil.rmtree(run)
    with pytest.raises(SystemExit, match=r"error: start_from = .*: expected a training of the same networks "):
        command("--start-from", str(other))
    (other / "policy.pt").write_bytes(slim(other)["policy.pt"])
    with pytest.raises(SystemExit, match=r"error: start_from = .*\(.*policy.pt is slim, for playing only\)"):
        command("--start-from", str(other), policy=AIM)
    with pytest.raises(SystemExit, match="error: start_from = 'nowhere': expected the folder of a finished run"):
        command("--start-from", "nowhere")
    assert not run.exists()


def test_a_damaged_or_hostile_checkpoint_is_refused_and_runs_no_code(command, trained, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = tmp_path / "run"
    shutil.copytree(trained, run)
    for name in ("policy.pt", "model.zip"):
        (run / name).unlink()
    checkpoint = run / "checkpoints" / "000000256.zip"
    intact = checkpoint.read_bytes()
    at = intact.index(b"policy.pth") + 2000
    for content in (b"", intact[:-100], intact[:at] + bytes([intact[at] ^ 1]) + intact[at + 1 :]):
        checkpoint.write_bytes(content)
        with pytest.raises(
            SystemExit, match=r"error: .*000000256.zip': expected a whole file of a checkpoint .* with --fresh"
        ):
            command()
    model = PPO.load(trained / "model.zip", device="cpu")
    params = model.get_parameters()
    params["policy"]["log_std"] = Pickled("ran")
    monkeypatch.setattr(model, "get_parameters", lambda: params)
    model.save(checkpoint)
    with pytest.raises(SystemExit, match=r"error: .*000000256.zip': expected a whole file of a checkpoint") as stopped:
        command()
    assert "weights_only" not in str(stopped.value)
    assert not (tmp_path / "ran").exists()


def test_wrong_settings_and_folders_are_refused_and_unchanged(command, tmp_path):
    run = tmp_path / "run"
    for changes, message in (({"timestep": 1}, "key of the settings"), ({"env": {"scene": "poll"}}, "scene = 'poll'")):
        with pytest.raises(SystemExit, match=f"error: {message}"):
            command(**changes)
        assert not run.exists()
    run.mkdir()
    (run / "model.zip").write_text("precious")
    for options in ([], ["--fresh"]):
        with pytest.raises(SystemExit, match=r"error: run_dir = .*: expected a new folder .* it holds other files"):
            command(*options)
    assert (run / "model.zip").read_text() == "precious"
    (run / "model.zip").unlink()
    with module.locked(run), pytest.raises(SystemExit, match=r"error: .*lock.* could not be acquired"):
        command()
    with pytest.raises(SystemExit, match=r"error: path = .*expected a file of settings"):
        module.main([str(tmp_path / "none.yaml")])


def test_a_command_without_its_extra_ends_with_one_line(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "torch" else object())
    agents.require("train", ("yaml", "torch"))  # imported by another program
    monkeypatch.setattr(sys, "argv", ["-m"])
    agents.require("plot", ("matplotlib",))
    with pytest.raises(SystemExit) as stopped:
        agents.require("train", ("yaml", "torch"))
    assert stopped.value.code == (
        "error: torch is not installed: expected the extra 'train': pip install 'billiards-env[train]' "
        "(in a clone: pip install '.[train]')"
    )


def test_training_and_evaluation_share_no_seeds(tiny):
    for seed in range(50):
        config = Config.from_dict(tiny(seed=seed))
        training = {training_seed(config, steps) + i for steps in range(0, 5000, 100) for i in range(config.n_envs)}
        evaluation = set(evaluation_seeds(seed, 100).tolist())
        assert 0 <= min(training) <= max(training) < 2**31 <= min(evaluation) <= max(evaluation) < 2**32
        assert len(training) == 200
