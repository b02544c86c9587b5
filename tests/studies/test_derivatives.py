"""The study of learning by derivatives."""

import json

import numpy as np
import pytest
import torch
from torch import nn

from billiards_env import simulate_batch
from studies import derivatives as study
from studies.derivatives import SceneShots, blocks, draw_layouts, main, shots_of, slopes, ways

PUSHED, IMPACT = "push_apart 1/60 s", "time_of_impact 1/60 s"


@pytest.fixture
def goals():
    return draw_layouts(40, np.random.default_rng(0))


def test_the_study_runs_and_continues_where_it_was_interrupted(tmp_path, monkeypatch, capsys):
    changes = {
        "GOAL_RUNS": [("exact", study.UNTRAINED), ("exact", PUSHED), (PUSHED, study.OVER_JUMPS)],
        **{"GOAL_SEEDS": (0, 1), "UPDATES": 2, "BATCH": 4, "LAYOUTS": 8},
    }
    for name, value in changes.items():
        monkeypatch.setattr(study, name, value)
    learn, runs, path = study.learn_goals, [], tmp_path / "derivatives.json"

    def spy(*run):
        runs.append(run)
        if len(runs) == 5:
            raise KeyboardInterrupt
        return learn(*run)

    monkeypatch.setattr(study, "learn_goals", spy)
    with pytest.raises(SystemExit):
        main(["--output", str(path)])
    main(["--output", str(path)])
    assert len(runs) == 6 + 1
    assert runs[5] == runs[4]
    content = json.loads(path.read_text())
    printed = capsys.readouterr().out
    assert all(text in printed for text in blocks(content).values())
    for run in content["goals"]["exact"][PUSHED].values():
        run["own"] = 0.75
    path.write_text(json.dumps(content))
    main(["--output", str(path)])
    assert len(runs) == 6 + 1
    assert "75.0%" in capsys.readouterr().out


def test_a_hit_at_the_cut_angle_sends_the_ball_towards_the_goal(goals):
    near, far, heading, cut = ways(goals)
    assert ((far > 0.2) & (far < 0.8) & (near > 0.2) & (np.cos(cut) > np.cos(np.radians(50.0)))).all()
    ghost = goals[:, 1] - np.c_[np.cos(heading + cut), np.sin(heading + cut)] * sum(study.SCENE.balls.radius)
    aim = ghost - goals[:, 0]
    shots = SceneShots(study.SCENE, goals[:, :2], 3.0 * aim / np.linalg.norm(aim, axis=1)[:, None])
    ends = [simulate_batch(*shots, max_time=t).positions for t in np.linspace(0.0, 2.0, 400)]
    ways_of_ball = [places[:, 1] - goals[:, 2] for places in ends]
    assert np.linalg.norm(ways_of_ball, axis=2).min(axis=0).max() < 0.02


def test_the_gradient_is_that_of_the_squared_distance(goals, monkeypatch):
    torch.manual_seed(0)
    shots = shots_of(nn.Sequential(nn.Linear(4, 2)).double(), goals)
    assert (shots.batch().first_hit == 1).all()
    assert np.linalg.norm(slopes(shots, goals, "exact", "exact"), axis=1).max() <= study.LONGEST * (1 + 1e-12)
    monkeypatch.setattr(study, "LONGEST", np.inf)
    exact = slopes(shots, goals, "exact", "exact")
    along, h = exact / np.linalg.norm(exact, axis=1)[:, None], 1e-7
    ends = (shots._replace(velocities=shots.velocities + change * along).batch().positions[:, 1] for change in (h, -h))
    more, less = (np.square(end - goals[:, 2]).sum(1) for end in ends)
    np.testing.assert_allclose((more - less) / (2.0 * h), np.linalg.norm(exact, axis=1), rtol=1e-4, atol=1e-5)

    def error(world):
        return np.median(np.linalg.norm(slopes(shots, goals, "exact", world) - exact, axis=1))

    assert error(IMPACT) < 1e-2 * error(PUSHED)
    assert study.same_signs(shots, goals, "exact", IMPACT) > 0.95 > study.same_signs(shots, goals, "exact", PUSHED)


def test_the_exact_derivative_teaches_what_the_one_through_a_timestep_does_not(monkeypatch):
    for name, value in {"UPDATES": 80, "BATCH": 64, "LAYOUTS": 200, "LEARNING_RATE": 1e-2}.items():
        monkeypatch.setattr(study, name, value)
    taught, pushed = (study.learn_goals("exact", derivative, 1000)["exact"] for derivative in ("exact", PUSHED))
    assert taught > 0.7 > 0.2 > pushed
