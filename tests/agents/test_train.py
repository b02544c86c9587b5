import io
import json
import shutil
import sys
import zipfile
from pathlib import Path
from typing import cast

import pytest
import torch
import yaml
from stable_baselines3 import PPO
from stable_baselines3.common.save_util import load_from_zip_file
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import agents
from agents import train as module
from agents.config import Config, load
from agents.evaluate import evaluate
from agents.ppo import load_policy, training_seed
from billiards_env.envs import BilliardsVectorEnv
from billiards_env.evaluation import evaluation_seeds
from tests.helpers.training import Pickled


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


@pytest.fixture
def interrupted(command, monkeypatch):
    """A function that runs the command until it is interrupted, in the rollout that reaches 320 steps."""
    on_step = module._Callback._on_step

    def stop(self):
        if self.num_timesteps >= 320:
            raise KeyboardInterrupt
        return on_step(self)

    def run(*arguments: str, **changes) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(module._Callback, "_on_step", stop)
            with pytest.raises(SystemExit, match="130"):
                command(*arguments, **changes)

    return run


def test_a_run_folder_has_settings_versions_logs_checkpoints_and_model(trained, tiny):
    assert load(trained / "config.yaml") == Config.from_dict(tiny())
    assert yaml.safe_load((trained / "config.yaml").read_text())["seed"] == 5
    versions = json.loads((trained / "versions.json").read_text())
    assert versions["python"] == ".".join(map(str, sys.version_info[:3]))
    assert {"numpy", "gymnasium", "numba", "stable_baselines3", "torch", "billiards_env"} <= versions.keys()
    assert [path.name for path in sorted(trained.iterdir()) if path.name != ".lock"] == [
        "checkpoints",
        "config.yaml",
        "model.zip",
        "policy.pt",
        "tensorboard",
        "training.csv",
        "versions.json",
    ]
    assert [path.name for path in sorted((trained / "checkpoints").iterdir())] == ["000000256.zip"]
    events = EventAccumulator(str(trained / "tensorboard"))
    events.Reload()
    assert [event.step for event in events.Scalars("rollout/success_rate")] == [128, 256, 384, 512]
    assert all(0 <= event.value <= 1 for event in events.Scalars("rollout/success_rate"))


def test_stable_baselines_loads_the_model(trained):
    model = PPO.load(trained / "model.zip", device="cpu")
    assert model.num_timesteps == 512
    assert equal(model.policy.state_dict(), weights(trained / "model.zip"))
    assert not equal(weights(trained / "checkpoints" / "000000256.zip"), weights(trained / "model.zip"))


def test_the_learning_curve_agrees_with_evaluations(trained):
    curve = module.learning_curve(trained)
    assert [point.steps for point in curve] == [0, 256, 512]
    assert 0 == curve[0].training_success < curve[1].seconds < curve[2].seconds
    measured = evaluate(trained)["policy"]
    assert (curve[-1].success, curve[-1].score) == (measured["success_rate"], measured["mean_score"])
    assert module.learning_curve(trained / "elsewhere") == []


def test_measuring_the_learning_curve_does_not_change_the_training(trained, command, tmp_path, monkeypatch):
    monkeypatch.setattr(module._Callback, "measure", lambda self: None)
    command()
    assert equal(weights(tmp_path / "run" / "model.zip"), weights(trained / "model.zip"))


def test_a_checkpoint_of_another_shape_is_refused(command, interrupted, trained, tmp_path):
    interrupted(policy={"hidden": [8]})
    shutil.copy(trained / "checkpoints" / "000000256.zip", tmp_path / "run" / "checkpoints")
    with pytest.raises(
        SystemExit, match=r"error: .*000000256.zip does not fit the configuration; --fresh starts again"
    ):
        command(policy={"hidden": [8]})


def test_a_resumed_run_ends_with_the_weights_of_an_uninterrupted_one(trained, command, interrupted, tmp_path, capsys):
    interrupted()
    assert "the same command resumes after 256 of 512 steps" in capsys.readouterr().err
    assert not (tmp_path / "run" / "model.zip").exists()
    assert [point.steps for point in module.learning_curve(tmp_path / "run")] == [0, 256]
    command()
    assert "resuming after 256 of 512 steps" in capsys.readouterr().out
    curves = [module.learning_curve(folder) for folder in (tmp_path / "run", trained)]
    assert [point[3:] for point in curves[0]] == [point[3:] for point in curves[1]]
    assert 0 < curves[0][1].seconds < curves[0][2].seconds
    assert equal(weights(tmp_path / "run" / "model.zip"), weights(trained / "model.zip"))


def test_the_schedules_of_the_policy_that_aims_survive_an_interruption(command, interrupted, tmp_path):
    policy = {"head": "aim", "arguments": {"hidden": 16, "exploration": 640}}
    command(policy=policy)
    whole = weights(tmp_path / "run" / "model.zip")
    interrupted("--fresh", policy=policy)
    command(policy=policy)
    assert equal(weights(tmp_path / "run" / "model.zip"), whole)
    assert int(whole["shots"]) == 512
    assert whole["net.std"][0].item() == pytest.approx(0.1 * 0.3**0.8)


def test_another_seed_gives_other_weights(trained, command, tmp_path):
    command("--seed", "6")
    assert load(tmp_path / "run" / "config.yaml").seed == 6
    assert not equal(weights(tmp_path / "run" / "model.zip"), weights(trained / "model.zip"))


def test_a_finished_run_is_trained_again_only_with_fresh(command, tmp_path, capsys):
    command("--timesteps", "128")
    model = tmp_path / "run" / "model.zip"
    first = model.read_bytes()
    versions = tmp_path / "run" / "versions.json"
    versions.write_text("those of the training")
    command("--timesteps", "128")
    assert "is trained already (128 steps)" in capsys.readouterr().out
    assert model.read_bytes() == first
    assert versions.read_text() == "those of the training"
    command("--timesteps", "128", "--seed", "6", "--fresh")
    assert load(tmp_path / "run" / "config.yaml").seed == 6
    assert model.read_bytes() != first
    assert "torch" in json.loads(versions.read_text())


def test_a_folder_with_another_configuration_is_refused_and_unchanged(command, tmp_path):
    command("--timesteps", "128")
    before = {path: path.read_bytes() for path in (tmp_path / "run").rglob("*") if path.is_file()}
    with pytest.raises(
        SystemExit, match=r"(?s)another configuration.*--fresh.*ppo.n_epochs: 2 in the folder, 3 requested"
    ):
        command("--timesteps", "128", ppo={"n_steps": 32, "n_epochs": 3, "final_learning_rate": 1e-4})
    assert {path: path.read_bytes() for path in (tmp_path / "run").rglob("*") if path.is_file()} == before


def test_a_finished_run_continues_with_more_timesteps(command, interrupted, tmp_path, capsys):
    run, stopped = tmp_path / "run", tmp_path / "stopped"
    command("--timesteps", "256")
    first = weights(run / "model.zip")
    shutil.copytree(run, stopped)
    command("--timesteps", "5e2")
    assert "resuming after 256 of 500 steps" in capsys.readouterr().out
    assert equal(weights(run / "checkpoints" / "000000256.zip"), first)
    assert [point.steps for point in module.learning_curve(run)] == [0, 256, 512]
    assert load(run / "config.yaml").timesteps == 500
    model = PPO.load(run / "model.zip", device="cpu")
    assert model.num_timesteps == 512
    assert not equal(model.policy.state_dict(), first)
    assert model.policy.optimizer.param_groups[0]["lr"] < 3e-4  # that of a run of 500 steps, near its end

    shutil.rmtree(run)
    stopped.rename(run)
    interrupted("--timesteps", "500")
    assert not (run / "policy.pt").exists()
    command("--timesteps", "500")
    assert equal(weights(run / "model.zip"), model.policy.state_dict())
    with pytest.raises(SystemExit, match=r"timesteps: 500 in the folder, 256 requested"):
        command("--timesteps", "256")


def test_a_run_with_0_timesteps_is_finished_without_training(command, tmp_path, capsys):
    settings = {"timesteps": 0, "policy": {"head": "aim", "arguments": {"hidden": 8}}}
    command(**settings)
    run = tmp_path / "run"
    (point,) = module.learning_curve(run)
    assert point.steps == 0
    assert point.success == evaluate(run)["policy"]["success_rate"]
    _, policy = load_policy(run)
    model = PPO.load(run / "model.zip", device="cpu")
    assert model.num_timesteps == 0
    begun = weights(run / "model.zip")
    assert all(torch.equal(begun[name], value) for name, value in policy.state_dict().items() if "value" not in name)
    printed = capsys.readouterr().out
    assert "after 0 steps, which took 0 s of one core" in " ".join(printed.split())
    assert f"-m agents.evaluate {run}\n" in printed
    command(**settings)
    assert "is trained already (0 steps)" in capsys.readouterr().out


def policy_weights(run: Path) -> dict[str, torch.Tensor]:
    """Returns the weights of a finished run without those of the value function."""
    return torch.load(run / "policy.pt", weights_only=True)


def test_the_command_line_names_the_run_to_start_from(command, trained, tmp_path):
    command("--timesteps", "0", "--seed", "6", "--start-from", str(trained))
    assert load(tmp_path / "run" / "config.yaml").start_from == str(trained)
    assert equal(policy_weights(tmp_path / "run"), policy_weights(trained))


def test_a_run_starts_from_the_weights_of_another_with_fewer_balls(command, tmp_path):
    run, other = tmp_path / "run", tmp_path / "other"
    policy = {"head": "aim", "arguments": {"hidden": 8}}
    command("--timesteps", "128", policy=policy)
    run.rename(other)
    env = {"n_object_balls": 3, "max_shots": 5}
    command("--timesteps", "0", start_from=str(other), policy=policy, env=env)
    assert equal(policy_weights(run), policy_weights(other))
    command("--timesteps", "128", start_from=str(other), policy=policy, env=env)
    assert not equal(policy_weights(run), policy_weights(other))


def test_a_resumed_run_does_not_read_the_run_that_it_started_from(command, interrupted, trained, tmp_path):
    run, whole, other = (tmp_path / name for name in ("run", "whole", "other"))
    shutil.copytree(trained, other)
    command(start_from=str(other))
    run.rename(whole)
    interrupted(start_from=str(other))
    shutil.rmtree(other)
    command(start_from=str(other))
    assert equal(weights(run / "model.zip"), weights(whole / "model.zip"))
    shutil.rmtree(run / "checkpoints")
    (run / "policy.pt").unlink()
    with pytest.raises(SystemExit, match=r"error: start_from = .*other': expected the folder of a finished run"):
        command(start_from=str(other))


@pytest.mark.parametrize(
    "changes",
    [
        {"policy": {"hidden": [8]}},
        {"policy": {"head": "aim"}},
        {"env": {"n_object_balls": 2, "max_shots": 2}},
    ],
)
def test_weights_of_other_networks_are_refused_and_no_folder_is_created(command, trained, tmp_path, changes):
    with pytest.raises(SystemExit, match=r"error: start_from = .*: expected a run with the same networks ") as stopped:
        command(start_from=str(trained), **changes)
    assert "\n" not in str(stopped.value)
    assert not (tmp_path / "run").exists()


def test_a_second_training_in_a_folder_is_refused(command, tmp_path):
    run = tmp_path / "run"
    with module.locked(run):
        for options in ([], ["--fresh"]):
            with pytest.raises(SystemExit, match=r"error: run_dir = .*: expected a folder in which no other training"):
                command(*options)
        assert not (run / "config.yaml").exists()
    command("--timesteps", "128")
    assert (run / "policy.pt").exists()


def test_the_end_of_a_training_prints_both_rates_of_success(command, tmp_path, capsys):
    command("--timesteps", "100")
    printed, shown = capsys.readouterr()
    assert (
        f"{tmp_path / 'run'}: 128 steps (shots): timesteps = 100, rounded up to whole updates of 128 steps" in printed
    )
    (point,) = module.learning_curve(tmp_path / "run")[1:]
    for name, rate in (("exploring", point.training_success), ("deterministic", point.success)):
        (line,) = (line for line in printed.splitlines() if line.split()[:1] == [name])
        assert f" {rate:.1%} " in line
    assert f"-m agents.evaluate {tmp_path / 'run'}\n" in printed
    assert "128/128 shots" in shown
    assert "deterministic=" in shown


def test_a_training_closes_each_environment_that_it_opens(command, interrupted, tmp_path, monkeypatch):
    opened, closed = [], []
    init, close = BilliardsVectorEnv.__init__, BilliardsVectorEnv.close_extras
    monkeypatch.setattr(
        BilliardsVectorEnv, "__init__", lambda self, *args, **kwargs: opened.append(self) or init(self, *args, **kwargs)
    )
    monkeypatch.setattr(
        BilliardsVectorEnv, "close_extras", lambda self, **kwargs: closed.append(self) or close(self, **kwargs)
    )
    interrupted()
    newest = tmp_path / "run" / "checkpoints" / "000000256.zip"
    whole = newest.read_bytes()
    newest.write_bytes(b"")
    with pytest.raises(SystemExit):
        command()
    newest.write_bytes(whole)
    command()
    assert sorted(map(id, opened)) == sorted(map(id, closed))
    # To train in, and for the learning curve, which the run with a damaged checkpoint does not begin.
    assert [envs.num_envs for envs in opened] == [4, 20, 4, 4, 20]


@pytest.mark.parametrize("arguments", [[], ["--fresh"]])
def test_a_folder_with_other_files_is_refused_and_unchanged(command, tmp_path, arguments):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "model.zip").write_text("precious")
    with pytest.raises(SystemExit, match="is not empty and holds no run"):
        command(*arguments)
    assert (tmp_path / "run" / "model.zip").read_text() == "precious"


def test_the_newest_checkpoint_is_the_whole_one_with_the_most_steps(trained, tmp_path):
    whole = (trained / "checkpoints" / "000000256.zip").read_bytes()
    (tmp_path / "checkpoints").mkdir()
    for name in ("000000128.zip", "000001024.zip", ".000002048.zip.17.tmp"):
        (tmp_path / "checkpoints" / name).write_bytes(whole)
    (tmp_path / "checkpoints" / "000004096.zip").touch()
    newest = module.newest_checkpoint(tmp_path)
    assert newest is not None
    assert newest.name == "000001024.zip"
    assert module.newest_checkpoint(tmp_path / "elsewhere") is None


def cut(content: bytes) -> bytes:
    """Returns an archive whose end is that of an archive inside it."""
    return content[: content.rindex(b"PK\5\6", 0, -22) + 22]


def changed(content: bytes) -> bytes:
    """Returns an archive with one byte changed in the middle of the weights."""
    at = content.index(b"policy.pth") + 2000
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


def hostile(content: bytes) -> bytes:
    """Returns an archive that holds an object with code instead of weights."""
    weights, out = io.BytesIO(), io.BytesIO()
    torch.save({"log_std": Pickled("ran")}, weights)
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("policy.pth", weights.getvalue())
    return out.getvalue()


@pytest.mark.parametrize("damage", [lambda _: b"", cut, changed, hostile])
def test_a_damaged_checkpoint_is_skipped_with_a_line(trained, command, tmp_path, monkeypatch, capsys, damage):
    monkeypatch.chdir(tmp_path)
    run, changes = tmp_path / "run", {"timesteps": 512, "checkpoint_every": 128}
    command(**changes)
    expected = weights(run / "model.zip")
    for name in ("policy.pt", "model.zip"):
        (run / name).unlink()
    capsys.readouterr()
    newest = run / "checkpoints" / "000000384.zip"
    newest.write_bytes(damage(newest.read_bytes()))
    command(**changes)
    printed = capsys.readouterr().out
    assert f"{newest} is damaged and is skipped\n{run}: resuming after 256 of 512 steps\n" in printed
    assert printed.count(" is damaged ") == 1
    assert equal(weights(run / "model.zip"), expected)
    assert not equal(weights(newest), expected)  # written again
    for name in ("policy.pt", "model.zip"):
        (run / name).unlink()
    for path in module.checkpoints(run):
        path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(SystemExit, match=r"error: .*: expected a checkpoint that can be read, .* --fresh") as stopped:
        command(**changes)
    assert "weights_only" not in str(stopped.value)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"timestep": 1}, r"error: key = 'timestep'"),
        ({"seed": "one"}, r"error: seed = 'one': expected a valid integer"),
        ({"env": {"max_speed": -1.0}}, r"error: max_speed = -1.0: expected a number from"),
        ({"env": {"scene": "poll"}}, r"error: scene = 'poll'.*did you mean 'pool'"),
        (
            {"env": {"task": "place", "n_object_balls": 0, "max_shots": 3}, "policy": {"head": "aim"}},
            "error: env = .*: expected an object ball",
        ),
        ({"policy": {"head": "aim", "arguments": {"aims": 1}}}, "error: policy.arguments = 'aims': expected one of"),
        ({"start_from": "nowhere"}, "error: start_from = 'nowhere': expected the folder of a finished run"),
    ],
)
def test_a_bad_configuration_is_refused_and_creates_no_folder(command, tmp_path, changes, message):
    with pytest.raises(SystemExit, match=message):
        command(**changes)
    assert not (tmp_path / "run").exists()


def test_a_missing_configuration_and_a_file_instead_of_a_run_folder_are_refused(command, tmp_path):
    with pytest.raises(SystemExit, match=r"error: config = '.*none.yaml': expected a YAML file \(No such file"):
        module.main([str(tmp_path / "none.yaml"), "--run-dir", str(tmp_path / "run")])
    (tmp_path / "run").touch()
    with pytest.raises(SystemExit, match=r"error: run_dir = '.*run': expected a new folder .* it is a file"):
        command()


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
        assert len(evaluation) == 100
