"""The measurement of RLlib on two nodes; no time is asserted."""

import dataclasses

from agents.config import load
from studies import cluster_speed


def test_the_parts_of_a_step_are_timed_separately(monkeypatch):
    config = load(cluster_speed.RECIPE)
    config = dataclasses.replace(config, n_envs=16, ppo=dataclasses.replace(config.ppo, n_steps=2, batch_size=16))
    clock = iter(range(10**6))
    monkeypatch.setattr(cluster_speed, "perf_counter", lambda: next(clock))  # each reading is one second later
    found = cluster_speed.one_runner(config, 2)
    assert found["bytes"] > 228 * 4
    # Of the 13 seconds of 32 steps each part takes 2, and the rest is between the parts.
    assert found["steps_per_second"]["median"] == 32 / 13
    assert [found[part]["median"] * 32 / 1e6 for part in ("environment", "features", "networks", "rest")] == [
        2,
        2,
        2,
        7,
    ]


def test_the_plan_multiplies_the_measured_speeds():
    def median(value):
        return {"median": value}

    runner = {name: {"steps_per_second": median(1000.0), "bytes": 1250} for name in cluster_speed.POLICIES}
    nodes = {name: {"learner": median(20_000.0)} for name in cluster_speed.POLICIES}
    rows = cluster_speed.plan({"runner": runner, "nodes": nodes})
    assert [row[1:] for row in rows] == [("1,024,000",) * 2, ("1,000,000",) * 2, ("20,000",) * 2]
