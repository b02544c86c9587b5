"""The study of networks that learn by derivatives through a timestep."""

import json

import numpy as np
import pytest
import torch
from torch import nn

from studies import learn_through_timestep as study
from studies.learn_through_timestep import blocks, draw_layouts, main, shots_of, slopes, ways

PUSHED, IMPACT = "push_apart 1/60 s", "time_of_impact 1/60 s"


@pytest.fixture
def layouts():
    return draw_layouts(40, np.random.default_rng(0))


def distances(shots, layouts, t):
    """Returns the distances of the object balls from the goals at a time, (m,), m."""
    return np.linalg.norm(shots.run(max_time=t).positions[:, 1] - layouts[:, 2], axis=1)


@pytest.fixture
def network():
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(4, 2)).double()


def test_the_study_runs_and_continues_where_it_was_interrupted(tmp_path, monkeypatch, capsys):
    train, trained = study.train, []

    def spy(*run):
        trained.append(run)
        if len(trained) == 2:
            raise KeyboardInterrupt
        return train(*run)

    small = {"train": spy, "STEPS": 2, "BATCH": 4, "LAYOUTS": 8, "SEEDS": (0, 1)}
    runs = [("exact", study.UNTRAINED), ("exact", PUSHED), (PUSHED, PUSHED), (PUSHED, study.OVER_JUMPS)]
    for name, value in {**small, "RUNS": runs}.items():
        monkeypatch.setattr(study, name, value)
    output = tmp_path / "results.json"
    with pytest.raises(SystemExit):
        main(["--output", str(output)])
    main(["--output", str(output)])
    assert trained[1] == trained[2]
    assert [run[:2] for run in trained[1::2]] == runs
    assert len(trained) == 2 * len(runs) + 1
    found = json.loads(output.read_text())
    printed = capsys.readouterr().out
    assert all(text in printed for text in blocks(found).values())
    assert "8 networks, trained with 8 shots if at all, 8 new layouts" in blocks(found)["size"]


def test_a_hit_at_the_cut_angle_sends_the_ball_towards_the_goal(layouts):
    near, far, heading, cut = ways(layouts)
    assert len(layouts) == 40
    assert (near > 0.2).all()
    assert ((far > 0.2) & (far < 0.8) & (np.cos(cut) > np.cos(np.radians(50.0)))).all()
    ghost = layouts[:, 1] - np.c_[np.cos(heading + cut), np.sin(heading + cut)] * sum(study.SCENE.balls.radius)
    aim = ghost - layouts[:, 0]
    shots = study.Shots(study.SCENE, layouts[:, :2], 3.0 * aim / np.linalg.norm(aim, axis=1)[:, None])
    nearest = np.min([distances(shots, layouts, t) for t in np.linspace(0.0, 2.0, 400)], axis=0)
    assert nearest.max() < 0.02


def test_each_shot_of_a_network_hits_the_object_ball(layouts, network):
    with torch.no_grad():
        network[0].weight *= 30.0
    shots = shots_of(network, layouts)
    speeds = np.linalg.norm(shots.velocities, axis=1)
    assert (shots.run().first_hit == 1).all()
    assert speeds.min() < 0.8 < 1.5 < speeds.max()


def test_the_gradient_is_that_of_the_squared_distance(layouts, network, monkeypatch):
    shots = shots_of(network, layouts)
    assert np.linalg.norm(slopes(shots, layouts, "exact", "exact"), axis=1).max() <= study.LONGEST * (1 + 1e-12)
    monkeypatch.setattr(study, "LONGEST", np.inf)
    exact = slopes(shots, layouts, "exact", "exact")
    along, h = exact / np.linalg.norm(exact, axis=1)[:, None], 1e-7
    ends = (
        study.Shots(shots.scene, shots.positions, shots.velocities + change * along).run().positions[:, 1]
        for change in (h, -h)
    )
    more, less = (np.square(end - layouts[:, 2]).sum(1) for end in ends)
    np.testing.assert_allclose((more - less) / (2.0 * h), np.linalg.norm(exact, axis=1), rtol=1e-4, atol=1e-5)

    def error(world):
        return np.median(np.linalg.norm(slopes(shots, layouts, "exact", world) - exact, axis=1))

    assert error(IMPACT) < 1e-2 * error(PUSHED)
    assert study.same_signs(shots, layouts, "exact", IMPACT) > 0.95 > study.same_signs(shots, layouts, "exact", PUSHED)


def test_the_exact_derivative_teaches_what_the_one_through_a_timestep_does_not(monkeypatch):
    for name, value in {"STEPS": 80, "BATCH": 64, "LAYOUTS": 200, "LEARNING_RATE": 1e-2}.items():
        monkeypatch.setattr(study, name, value)
    taught, pushed = (study.train("exact", derivative, 1000)["exact"] for derivative in ("exact", PUSHED))
    assert taught > 0.7 > 0.2 > pushed
