"""Training with RLlib and Ray tasks on a cluster of two nodes on this machine: `make rllib`."""

from __future__ import annotations

import dataclasses
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml

from agents.cluster import RETRIES, ROOT, RayExecutor
from agents.config import Config, load
from agents.evaluate import evaluate
from agents.rllib.settings import Settings
from agents.runs import train_all
from agents.train import learning_curve, open_run

pytest.importorskip("ray")

import ray  # pyright: ignore[reportMissingImports]

from agents.rllib.algorithm import ArrayPPO, algorithm_config
from agents.rllib.train import newest_checkpoint, train

pytestmark = [pytest.mark.cluster, pytest.mark.filterwarnings("default")]

TINY = {
    "timesteps": 4096,
    "n_envs": 64,
    "checkpoint_every": 1500,
    "evaluation_episodes": 50,
    "policy": {"head": "aim", "arguments": {"hidden": 16}},
    "ppo": {"n_steps": 8, "batch_size": 256, "n_epochs": 2, "final_learning_rate": 1e-4},
}
TWO = Settings(recipe="tiny.yaml", runners=2)


def trained(folder: Path, settings: Settings = TWO, **changes) -> Path:
    config = Config.from_dict({**TINY, **changes})
    open_run(config, folder)
    train(config, settings, folder)
    return folder


def weights(folder: Path) -> dict[str, torch.Tensor]:
    return torch.load(folder / "policy.pt", weights_only=True)


def equal(a: Path, b: Path) -> bool:
    first, second = weights(a), weights(b)
    return first.keys() == second.keys() and all(torch.equal(first[name], second[name]) for name in first)


@pytest.fixture(scope="module")
def finished(cluster, tmp_path_factory) -> Path:
    """A run that two runners have finished."""
    return trained(tmp_path_factory.mktemp("runs") / "two")


def processes(algorithm: ArrayPPO) -> dict[int, str]:
    """Returns the process of each runner that works, and its node."""
    return dict(
        algorithm.env_runner_group.foreach_env_runner(
            lambda runner: (os.getpid(), ray.get_runtime_context().get_node_id()), local_env_runner=False
        )
    )


def test_a_training_on_two_nodes_has_the_run_folder_of_others(finished):
    names = {path.name for path in finished.iterdir() if path.name != ".lock"}
    assert names == {"checkpoints", "config.yaml", "policy.pt", "tensorboard", "training.csv", "versions.json"}
    assert [point.steps for point in learning_curve(finished)] == [0, 1536, 3072, 4096]
    result = evaluate(finished)
    assert result["policy"]["success_rate"] == learning_curve(finished)[-1].success


def test_the_runners_are_on_both_nodes(cluster):
    algorithm = algorithm_config(Config.from_dict(TINY), TWO).build_algo()
    assert len(set(processes(algorithm).values())) == 2
    algorithm.stop()


def test_a_killed_runner_is_replaced_and_no_step_is_lost(finished, tmp_path, monkeypatch):
    sample, seen = ArrayPPO._sample, []

    def kill_one(self, *args):
        found = processes(self)
        seen.append(found)
        if len(seen) == 2:
            os.kill(min(found), signal.SIGKILL)
        deadline = time.monotonic() + 120
        while len(seen) == 4 and len(processes(self)) < 2 and time.monotonic() < deadline:
            self.restore_env_runners(self.env_runner_group)
        arrays = sample(self, *args)
        assert len(arrays["advantages"]) == 512
        return arrays

    monkeypatch.setattr(ArrayPPO, "_sample", kill_one)
    folder = trained(tmp_path / "run")
    assert [len(found) for found in seen] == [2, 2, 1, 1, 2, 2, 2, 2]
    assert not seen[1].keys() >= seen[4].keys()
    assert [point.steps for point in learning_curve(folder)] == [0, 1536, 3072, 4096]
    assert learning_curve(folder)[-1].success > 0.0


def test_a_killed_command_resumes_and_ends_with_the_same_weights(cluster, finished, tmp_path):
    recipe, settings, folder = tmp_path / "recipe.yaml", tmp_path / "settings.yaml", tmp_path / "run"
    recipe.write_text(yaml.safe_dump(TINY))
    settings.write_text(yaml.safe_dump({"recipe": "recipe.yaml", "runners": 2}))
    command = [sys.executable, "-m", "agents.rllib", str(settings), "--run-dir", str(folder)]
    command += ["--address", cluster.address]
    first = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    deadline = time.monotonic() + 120
    while newest_checkpoint(folder) is None and time.monotonic() < deadline and first.poll() is None:
        time.sleep(0.02)
    first.kill()
    output = first.communicate()[0].decode()
    assert newest_checkpoint(folder) is not None, output
    assert not (folder / "policy.pt").exists()
    second = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert "resuming after" in second.stdout
    assert equal(folder, finished)


def test_one_process_learns_as_much_as_two_nodes(cluster, finished, tmp_path):
    alone = evaluate(trained(tmp_path / "alone", Settings(recipe="tiny.yaml", runners=0)), 1000)["policy"]
    low, high = alone["confidence_interval_95"]
    together = evaluate(finished, 1000)["policy"]["confidence_interval_95"]
    assert max(low, together[0]) <= min(high, together[1])


COMPILE = """
import gc

from numba.core.registry import CPUDispatcher

from agents.config import Config
from agents.rllib.rollouts import compile_engine

compile_engine(Config.from_dict({"timesteps": 1, "policy": {"head": "aim"}}))
compiled = [d for d in gc.get_objects() if isinstance(d, CPUDispatcher) and d.stats.cache_misses]
print(len(compiled))
"""


def test_the_first_process_of_a_machine_compiles_for_the_others(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    several = [
        subprocess.Popen([sys.executable, "-c", COMPILE], env=environment, stdout=subprocess.PIPE, cwd=tmp_path)
        for _ in range(2)
    ]
    second, first = sorted(int(process.communicate()[0]) for process in several)
    assert first > 5
    assert second == 0


def test_remote_learners_share_the_minibatches(cluster, tmp_path):
    folder = trained(tmp_path / "run", Settings(recipe="tiny.yaml", runners=0, learners=1), timesteps=1024)
    assert learning_curve(folder)[-1].steps == 1024


def test_the_standard_deviations_follow_their_schedule(cluster, tmp_path):
    policy = {"head": "aim", "arguments": {"hidden": 16, "exploration": 1024, "std_speed": [0.4, 0.1]}}
    found = weights(trained(tmp_path / "run", Settings(recipe="tiny.yaml", runners=0), timesteps=1024, policy=policy))
    assert found["net.std"][0].item() == pytest.approx(0.2)  # set before the second of two updates


def test_rllib_plays_the_environment_with_its_own_runner(cluster):
    page = (ROOT / "docs" / "cluster.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    exec(re.findall(r"^```python[^\n]*\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)[0], names)
    config = names["config"].env_runners(num_env_runners=1, num_envs_per_env_runner=8)
    config.training(train_batch_size_per_learner=64, minibatch_size=32, num_epochs=1)
    algorithm = config.build_algo()
    result = algorithm.train()["env_runners"]
    algorithm.stop()
    assert result["num_env_steps_sampled_lifetime"] >= 64
    assert result["episode_len_mean"] == 1


def double(number: int) -> int:
    return 2 * number


def fails_at_first(folder: Path, times: int, killed: bool = False) -> int:
    attempt = len(list(folder.iterdir()))
    (folder / str(attempt)).touch()
    if attempt < times and killed:
        os.kill(os.getpid(), signal.SIGKILL)
    if attempt < times:
        raise OSError(f"attempt {attempt}")
    return attempt


def test_failed_tasks_are_repeated(cluster, tmp_path):
    with RayExecutor(cluster.address) as pool:
        assert pool.submit(double, 16).result() == 32
        for name in ("a", "b"):
            (tmp_path / name).mkdir()
        assert pool.submit(fails_at_first, tmp_path / "a", 2).result() == 2
        assert pool.submit(fails_at_first, tmp_path / "b", 1, killed=True).result() == 1


def test_a_task_that_always_fails_is_named(cluster, tmp_path):
    with RayExecutor(cluster.address) as pool:
        failed = pool.submit(fails_at_first, tmp_path, 100).exception()
    assert "fails_at_first(" in str(failed)
    assert f"failed {RETRIES + 1} times" in str(failed)
    assert len(list(tmp_path.iterdir())) == RETRIES + 1


def test_the_runs_of_a_study_are_tasks(cluster, tmp_path, monkeypatch):
    good = Config.from_dict({**TINY, "timesteps": 512, "policy": {"hidden": [8]}})
    runs = {tmp_path / f"seed{seed}": dataclasses.replace(good, seed=seed) for seed in (0, 1)}
    bad = tmp_path / "bad"
    with monkeypatch.context() as patch:
        patch.setattr("agents.runs.open_run", lambda config, folder: None)  # the task opens the run, too
        with pytest.raises(RuntimeError, match=f"trained_files\\('{bad}'.* failed {RETRIES + 1} times"):
            train_all({**runs, bad: dataclasses.replace(good, start_from="nowhere")}, 1, cluster.address)
    assert not (bad / "policy.pt").exists()
    for folder, config in runs.items():
        assert load(folder / "config.yaml") == config
        assert evaluate(folder)["policy"]["success_rate"] == learning_curve(folder)[-1].success
    written = (tmp_path / "seed0" / "policy.pt").stat().st_mtime_ns
    train_all(runs, 1, cluster.address)
    assert (tmp_path / "seed0" / "policy.pt").stat().st_mtime_ns == written
