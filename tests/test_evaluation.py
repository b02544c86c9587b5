"""Measurements of the players without training."""

from billiards_env.evaluation import measure


def test_success_rates():
    arguments = ({}, (0.0, 0.0))
    rates = {n: measure(n, *arguments, 150, 1)["success_rate"] for n in ("random", "geometric", "search:300")}
    assert rates["random"] < 0.05
    assert rates["geometric"] > 0.85
    assert rates["search:300"] > 0.97
    noisy = measure("geometric", {}, (0.125, 0.075), 150, 1)["success_rate"]
    assert noisy < rates["geometric"] - 0.1
    assert measure("geometric", {"n_object_balls": 3, "max_shots": 5}, (0.0, 0.0), 40, 1)["success_rate"] > 0.75
    assert measure("search:300", {"task": "carom", "layout": "random"}, (0.0, 0.0), 40, 1)["success_rate"] > 0.5
