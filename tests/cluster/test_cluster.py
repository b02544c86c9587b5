"""Training with RLlib and Ray tasks on a cluster of two nodes on this machine: `make rllib`."""

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
from agents.config import Config
from agents.evaluate import evaluate
from agents.rllib.__main__ import train
from agents.train import learning_curve, newest_checkpoint, open_run

pytest.importorskip("ray")

import ray  # pyright: ignore[reportMissingImports]

from agents.rllib.algorithm import ArrayPPO

pytestmark = [pytest.mark.cluster, pytest.mark.filterwarnings("default")]

TINY = {
    "timesteps": 4096,
    "n_envs": 64,
    "checkpoint_every": 1500,
    "evaluation_episodes": 50,
    "policy": {"arguments": {"hidden": 16, "exploration": 4096, "std_speed": [0.4, 0.1]}},
    "ppo": {"n_steps": 8, "batch_size": 256, "n_epochs": 2, "learning_rate": [3e-4, 1e-4]},
}


def trained(folder: Path, runners: int = 2, **changes) -> Path:
    config = Config.from_dict({**TINY, **changes})
    open_run(config, folder)
    train(config, folder, runners)
    return folder


def weights(folder: Path) -> dict[str, torch.Tensor]:
    return torch.load(folder / "policy.pt", weights_only=True)


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


def test_a_killed_runner_is_replaced_and_no_step_is_lost(finished, tmp_path, monkeypatch):
    sample, seen = ArrayPPO._sample, []

    def kill_one(self, *args):
        ids = processes(self)
        seen.append(ids)
        if len(seen) == 2:
            os.kill(min(ids), signal.SIGKILL)
        deadline = time.monotonic() + 120
        while len(seen) == 4 and len(processes(self)) < 2 and time.monotonic() < deadline:
            self.restore_env_runners(self.env_runner_group)
        arrays = sample(self, *args)
        assert len(arrays["advantages"]) == 512
        return arrays

    monkeypatch.setattr(ArrayPPO, "_sample", kill_one)
    folder = trained(tmp_path / "run")
    counts = [len(ids) for ids in seen]
    assert (counts[:2], counts[4:]) == ([2, 2], [2, 2, 2, 2])
    assert set(counts[2:4]) <= {1, 2}  # Ray restarts the process at a time of its own
    assert len(set(seen[-1]) - set(seen[0])) == 1  # one process is new
    assert len(set(seen[0].values())) == 2  # one runner on each node
    assert [point.steps for point in learning_curve(folder)] == [0, 1536, 3072, 4096]
    assert learning_curve(folder)[-1].success > 0.0


def test_a_killed_command_resumes_and_ends_with_the_same_weights(cluster, finished, tmp_path):
    settings, folder = tmp_path / "tiny.yaml", tmp_path / "run"
    settings.write_text(yaml.safe_dump(TINY))
    command = [sys.executable, "-m", "agents.rllib", str(settings), "--run-dir", str(folder)]
    command += ["--address", cluster.address]
    first = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    deadline = time.monotonic() + 600
    while newest_checkpoint(folder) is None and time.monotonic() < deadline and first.poll() is None:
        time.sleep(0.02)
    first.kill()
    output = first.communicate()[0].decode()
    assert newest_checkpoint(folder) is not None, output
    assert not (folder / "policy.pt").exists()
    subprocess.run(command, cwd=ROOT, check=True)
    assert all(torch.equal(tensor, weights(finished)[name]) for name, tensor in weights(folder).items())
    assert evaluate(folder)["policy"]["success_rate"] == learning_curve(folder)[-1].success


def test_one_process_trains_with_the_schedules_of_the_policy(cluster, tmp_path):
    folder = trained(tmp_path / "run", runners=0, timesteps=1024)
    assert learning_curve(folder)[-1].steps == 1024
    assert weights(folder)["net.std"][0].item() == pytest.approx(0.4 * 0.25**0.125)  # before the second of two updates
    with pytest.raises(ValueError, match="runners = 3: expected a divisor"):
        trained(tmp_path / "odd", runners=3)
    with pytest.raises(ValueError, match="expected 'aim', None and 'ppo' with RLlib"):
        trained(tmp_path / "usual", policy={"head": "gaussian"})


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


def fails_at_first(folder: Path, times: int, killed: bool = False) -> int:
    attempt = len(list(folder.iterdir()))
    (folder / str(attempt)).touch()
    if attempt < times and killed:
        os.kill(os.getpid(), signal.SIGKILL)
    if attempt < times:
        raise OSError(f"attempt {attempt}")
    return attempt


def test_failed_tasks_are_repeated_and_one_that_always_fails_is_named(cluster, tmp_path):
    for name in ("a", "b", "c"):
        (tmp_path / name).mkdir()
    with RayExecutor(cluster.address) as pool:
        assert pool.submit(fails_at_first, tmp_path / "a", 2).result() == 2
        assert pool.submit(fails_at_first, tmp_path / "b", 1, killed=True).result() == 1
        failed = pool.submit(fails_at_first, tmp_path / "c", 100).exception()
    assert "fails_at_first(" in str(failed)
    assert len(list((tmp_path / "c").iterdir())) == RETRIES + 1
