"""The study of derivatives and of learning by them."""

import json

import numpy as np
import pytest
import torch
from torch import nn

from billiards_env import Scene, simulate_batch
from billiards_env.engine.overlaps import FIXES
from billiards_env.envs import make_vector_env
from studies import derivatives as study
from studies.derivatives import SceneShots, blocks, draw_layouts, errors, errors_of, main, pit, shots_of, slopes, ways

PUSHED, IMPACT = "push_apart 1/60 s", "time_of_impact 1/60 s"


@pytest.fixture
def goals():
    return draw_layouts(40, np.random.default_rng(0))


@pytest.fixture
def small(tmp_path, monkeypatch):
    """Returns the arguments of a tiny study."""
    steps = (60, 240, 960)
    changes = {
        "STEPS": steps,
        "ENGINES": {f"{fix} 1/{n} s": pit(n, fix) for n in steps for fix in FIXES},
        "DRAWN": 80,
        "GOAL_RUNS": [("exact", study.UNTRAINED), ("exact", PUSHED), (PUSHED, study.OVER_JUMPS)],
        **{"GOAL_SEEDS": (0, 1), "UPDATES": 2, "BATCH": 4, "LAYOUTS": 8},
        **{"POT_RUNS": {64: (20,)}, "POT_BATCH": 32, "EPISODES": 8},
    }
    for name, value in changes.items():
        monkeypatch.setattr(study, name, value)
    return ["--output", str(tmp_path / "derivatives.json"), "--images", str(tmp_path)]


def test_the_study_runs_and_continues_where_it_was_interrupted(small, tmp_path, monkeypatch, capsys):
    measured = []

    def spy(results, engine):
        measured.append(engine)
        if len(measured) == 5:
            raise KeyboardInterrupt
        return errors(results, engine)

    monkeypatch.setattr(study, "errors", spy)
    with pytest.raises(SystemExit):
        main(small)
    main(small)
    assert len(measured) == 1 + 1 + 3 * len(FIXES)
    assert measured[5] == measured[4]
    content = json.loads((tmp_path / "derivatives.json").read_text())
    printed = capsys.readouterr().out
    assert all(text in printed for text in blocks(content).values())
    assert {path.name for path in tmp_path.glob("*.png")} == {"gradient_timestep.png", "gradient_timestep_reason.png"}
    assert len(content["chosen"]["numbers"]) > 5
    assert content["errors"]["exact"]["small"] < 1e-5  # the rounding of the differences
    for fix in FIXES:
        coarse, *_, fine = (content["errors"][f"{fix} 1/{n} s"] for n in (60, 240, 960))
        assert fine["position"] < 0.2 * coarse["position"]
        assert (fine["small"] < 0.2 * coarse["small"]) == (fix == "time_of_impact")
    content["pots"]["64"]["20"] = 0.75
    (tmp_path / "derivatives.json").write_text(json.dumps(content))
    main(small)
    assert len(measured) == 1 + 1 + 3 * len(FIXES)
    assert "75.0%" in capsys.readouterr().out


def test_the_error_of_the_derivative_after_a_cushion_is_the_share_of_the_time_before_it():
    """Without friction x(T) = d - v (T - t), where t is the timestep of the contact instead of d / v; T is 1 s."""
    shots = study.bounces(np.array([1.5]))
    contact = (1.0 - 0.03) / 1.5
    for fix, share in (("push_apart", contact), ("move_back", contact), ("none", 2.0 * contact), ("time_of_impact", 0)):
        error = errors_of(shots, pit(10_000, fix))["small"]
        assert error == pytest.approx(share / np.sqrt(2.0), abs=2e-4), fix  # the motion along y has no error


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
    assert (shots.run().first_hit == 1).all()
    assert np.linalg.norm(slopes(shots, goals, "exact", "exact"), axis=1).max() <= study.LONGEST * (1 + 1e-12)
    monkeypatch.setattr(study, "LONGEST", np.inf)
    exact = slopes(shots, goals, "exact", "exact")
    along, h = exact / np.linalg.norm(exact, axis=1)[:, None], 1e-7
    ends = (shots._replace(velocities=shots.velocities + change * along).run().positions[:, 1] for change in (h, -h))
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


def test_a_mirrored_layout_has_mirrored_actions():
    torch.manual_seed(0)
    network = study.Network(Scene.named("pool"))
    seen = torch.tensor([[[0.1, -0.3], [0.4, 0.2]]])
    places: list[list[float]] = network.signs.tolist()
    for x, y in ((1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        signs = torch.tensor([x, y])
        for pocket, place in enumerate(places):
            other = places.index([place[0] * x, place[1] * y])
            action, chance = network(seen, torch.tensor([pocket]))
            mirrored, same = network(seen * signs, torch.tensor([other]))
            torch.testing.assert_close(mirrored, action * signs)
            torch.testing.assert_close(same, chance)


def test_a_step_along_the_gradient_brings_pots_nearer_and_a_scratch_lowers_the_chance_of_its_speed(monkeypatch):
    monkeypatch.setattr(study, "POT_BATCH", 32)
    torch.manual_seed(1)
    envs = make_vector_env(32)
    envs.reset(seed=0)
    network = study.Network(envs.single_env.scene)
    played = study.play_pots(network, envs)
    played = played._replace(scratches=torch.arange(32) % 2 == 0, margins=played.margins.clamp(max=0.01))
    before = (network.radius[played.pockets] - played.margins).abs()
    speeds = torch.tensor(study.SPEEDS)[played.speeds, None]
    optimiser = torch.optim.SGD(network.parameters(), lr=3e-4)
    study.loss_of(network, played).backward()
    optimiser.step()
    change = speeds * network(played.positions, played.pockets)[0] - played.actions
    after = (network.radius[played.pockets] - played.margins - (played.slopes * change).sum(-1)).abs()
    assert 0 < change.norm(dim=-1).max() < study.LINEAR
    assert after.mean() < before.mean()
    two = study.PotBatch(*(part[:2] for part in played))
    two = two._replace(margins=torch.tensor([0.01, 0.01]), scratches=torch.tensor([False, True]))
    old = network(two.positions, two.pockets)[1].detach()
    network.zero_grad()
    study.loss_of(network, two).backward()
    torch.optim.SGD(network.chances.parameters(), lr=0.1).step()
    clean, scratched = (network(two.positions, two.pockets)[1] - old)[torch.arange(2), two.speeds].tolist()
    assert clean > scratched


def test_a_short_training_of_pots_learns(monkeypatch):
    monkeypatch.setattr(study, "POT_BATCH", 32)
    monkeypatch.setattr(study, "EPISODES", 300)
    assert study.learn_pots(1, 6400) > 0.05  # a random shot pots the ball once in a hundred times
