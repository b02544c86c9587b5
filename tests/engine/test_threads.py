"""The number of threads follows the process: its processors, its control groups and one setting."""

import os
import threading
import time

import pytest

import billiards_env
from billiards_env.engine import threads
from billiards_env.engine.threads import num_threads, parallel_for


@pytest.fixture(autouse=True)
def many_processors(monkeypatch, tmp_path):
    """A machine with 64 processors and without control groups."""
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "process_cpu_count", lambda: 64, raising=False)
    monkeypatch.setattr(threads._config, "NUMBA_NUM_THREADS", 64)
    monkeypatch.setattr(threads, "_ROOT", tmp_path)
    threads._quota.cache_clear()
    yield
    threads._quota.cache_clear()
    billiards_env.set_num_threads(None)


def threads_of_a_call():
    """Returns the number of threads that take pieces of a call without `threads`."""
    takers = set()

    def work(begin, end):
        takers.add(threading.get_ident())
        time.sleep(0.002)

    parallel_for(work, 200)
    return len(takers)


def test_the_setting_of_the_process_holds_for_calls_without_threads():
    billiards_env.set_num_threads(3)
    assert num_threads() == threads_of_a_call() == 3
    billiards_env.set_num_threads(1)
    assert num_threads() == threads_of_a_call() == 1
    billiards_env.set_num_threads(None)
    assert num_threads() == 64
    with pytest.raises(ValueError, match="n = 0: expected a whole number from 1 to 1024"):
        billiards_env.set_num_threads(0)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system has no affinity mask")
def test_a_process_on_one_processor_uses_one_thread(monkeypatch):
    """It once used one for each processor of the machine."""
    monkeypatch.delattr(os, "process_cpu_count")
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        assert num_threads() == threads_of_a_call() == 1
    finally:
        os.sched_setaffinity(0, allowed)
    assert num_threads() == len(allowed)


def test_systems_without_an_affinity_mask_use_all_processors(monkeypatch):
    monkeypatch.delattr(os, "process_cpu_count")
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert num_threads() == 64
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert num_threads() == 1


def test_numba_num_threads_is_a_limit(monkeypatch):
    monkeypatch.setattr(threads._config, "NUMBA_NUM_THREADS", 2)
    assert num_threads() == threads_of_a_call() == 2
    billiards_env.set_num_threads(5)
    assert num_threads() == 5


# The groups of the process, the files of its quotas, and the number of threads. Kubernetes and Docker give a container
# a quota in this way.
V1 = "4:cpu,cpuacct:/docker/x\n"
GROUPS = {
    "version 2": ("0::/a/b\n", {"a/b/cpu.max": "250000 100000"}, 3),
    "version 2, a limit above": ("0::/a/b\n", {"a/b/cpu.max": "max 100000", "a/cpu.max": "200000 100000"}, 2),
    "version 2, a container": ("0::/\n", {"cpu.max": "10000 100000"}, 1),
    "version 2, no limit": ("0::/\n", {"cpu.max": "max 100000"}, 64),
    "version 1": (
        f"5:memory:/x\n{V1}0::/\n",
        {"cpu/cpu.cfs_quota_us": "400000", "cpu/cpu.cfs_period_us": "100000", "cpu.max": "damaged"},
        4,
    ),
    "version 1, no limit": ("4:cpu:/\n", {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, 64),
}


@pytest.mark.parametrize(("groups", "quotas", "expected"), GROUPS.values(), ids=GROUPS)
def test_a_quota_of_processor_time_is_a_limit(groups, quotas, expected, tmp_path):
    files = {"proc/self/cgroup": groups, **{f"sys/fs/cgroup/{name}": f"{text}\n" for name, text in quotas.items()}}
    for path, text in files.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    assert num_threads() == expected
