import json
import shutil
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import yaml

from agents.config import Config
from agents.train import Point
from billiards_env import Scene
from billiards_env.envs.action_frames import ActionTransform
from billiards_env.evaluation import evaluation_seeds
from billiards_env.intervals import over_seeds
from studies import timestep as module
from studies import timestep_report
from studies.causes import CAUSES

pytest.importorskip("matplotlib")

RECIPE = {
    "timesteps": 64,
    "n_envs": 4,
    "checkpoint_every": 32,
    "evaluation_episodes": 4,
    "policy": {"head": "hits", "components": 3, "hidden": [8]},
    "ppo": {"n_steps": 16, "n_epochs": 1},
}


def run_command(folder, *arguments: str, recipe_changes=None, **changes) -> None:
    """Runs the command with tiny settings, with some changes; a folder contains all files."""
    (folder / "recipe.yaml").write_text(yaml.safe_dump({**RECIPE, **(recipe_changes or {})}))
    settings = {"recipe": "recipe.yaml", "worlds": ["exact", "1/15"], "seeds": [3], "layouts": 30, **changes}
    (folder / "tiny.yaml").write_text(yaml.safe_dump({k: v for k, v in settings.items() if v is not None}))
    module.main([str(folder / "tiny.yaml"), "--folder", str(folder / "runs"), *arguments])


def test_a_study_trains_measures_draws_and_prints(printed, tmp_path):
    runs = tmp_path / "runs" / "tiny"
    assert sorted(str(path.parent.relative_to(runs)) for path in runs.rglob("policy.pt")) == [
        "1-15/seed3",
        "exact/seed3",
    ]
    env = yaml.safe_load((runs / "1-15" / "seed3" / "config.yaml").read_text())["env"]
    assert (env["mode"], env["dt"], env["fix"]) == ("pit", 1 / 15, None)
    result = json.loads((tmp_path / "runs" / "tiny" / "timestep_tiny.json").read_text())
    assert [(p["world"], p["seed"]) for p in result["policies"]] == [("exact", 3), ("1/15", 3)]
    assert all(p["success"].keys() == {"exact", "1/15"} for p in result["policies"])
    assert all([point[0] for point in p["curve"]] == [0, 64] and p["curve"][-1][1] > 0 for p in result["policies"])
    assert result["worlds_measured"]["exact"]["shots_per_second"] > result["worlds_measured"]["1/15"]["dt"]
    assert (tmp_path / "runs" / "tiny" / "study_tiny_success.png").read_bytes().startswith(b"\x89PNG")
    blocks = timestep_report.blocks(result)
    assert all(blocks[name] in printed for name in timestep_report.tables(result))


def test_a_study_with_results_is_printed_and_drawn_without_training(command, printed, tmp_path, monkeypatch, capsys):
    files = tmp_path / "runs" / "tiny"
    figure = (files / "study_tiny_success.png").read_bytes()
    for name in ("exact", "1-15"):
        shutil.rmtree(files / name)
    with monkeypatch.context() as patch:
        patch.setattr(module, "train_all", None)
        command()
    assert capsys.readouterr().out == printed
    assert (files / "study_tiny_success.png").read_bytes() == figure
    command(layouts=20)
    assert json.loads((tmp_path / "runs" / "tiny" / "timestep_tiny.json").read_text())["layouts"] == 20


def test_a_study_may_be_shorter_than_its_recipe(tmp_path):
    (tmp_path / "recipe.yaml").write_text(yaml.safe_dump(RECIPE))
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump({"recipe": "recipe.yaml", "worlds": ["exact"], "timesteps": 9}))
    study, recipe = module.load_study(tmp_path / "tiny.yaml")
    assert {config.timesteps for _, config in module.runs(study, recipe, tmp_path)} == {9}


def test_an_interrupted_study_continues(command, tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(module, "compare", interrupted)
        with pytest.raises(SystemExit) as stopped:
            command()
    assert stopped.value.code == 130
    assert "the same command continues" in capsys.readouterr().err
    found = tmp_path / "runs" / "tiny" / "timestep_tiny.json"
    assert not found.exists()
    policies = {path: path.stat().st_mtime_ns for path in (tmp_path / "runs").rglob("policy.pt")}
    assert len(policies) == 2
    command()
    assert found.exists()
    assert all(path.stat().st_mtime_ns == before for path, before in policies.items())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"world": ["exact"]}, r"key = 'world'.*did you mean 'worlds'"),
        ({"recipe": None}, r"recipe is missing"),
        ({"worlds": ["exact", 0.05]}, r"worlds\[1\] = 0.05: expected a valid string"),
        ({"worlds": ["exact", "1/0"]}, r"worlds\[1\] = '1/0': expected 'exact' or a timestep .* such as '1/60'"),
        ({"worlds": ["1/15"]}, r"worlds = \['1/15'\]: expected 'exact' among them"),
        ({"seeds": []}, r"seeds = \[\]: expected at least one"),
        ({"fix": "pushapart"}, r"fix = 'pushapart': expected one of .*did you mean 'push_apart'"),
        ({"recipe": "nowhere.yaml"}, r"config = '.*nowhere.yaml': expected a YAML file"),
    ],
)
def test_bad_settings_are_refused(command, tmp_path, changes, message):
    with pytest.raises(SystemExit, match=f"(?s)error: .*{message}"):
        command(**changes)
    assert not list(tmp_path.rglob("timestep_*.json"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"env": {"max_shots": 2}}, "env.max_shots = 2 in the recipe .*: expected 1"),
        ({"env": {"task": "place"}}, "env.task = 'place' in the recipe .*: expected 'pot'"),
        ({"env": {"mode": "pit", "dt": 0.01}}, "env.mode = 'pit' in the recipe .*: expected 'pic'"),
        ({"noise": {}}, "noise in the recipe .*: expected none"),
    ],
)
def test_a_recipe_that_cannot_be_compared_is_refused(command, tmp_path, changes, message):
    with pytest.raises(SystemExit, match=f"error: {message}"):
        command(recipe_changes=changes)
    assert not list(tmp_path.rglob("timestep_*.json"))


@pytest.mark.usefixtures("printed")
def test_runs_of_another_study_are_refused(command):
    with pytest.raises(SystemExit, match=r"(?s)another configuration.*timesteps: 64 in the folder, 128 requested"):
        command(recipe_changes={"timesteps": 128})


BLOCKED = {"scene": "blocked_pool", "layout": "snookered", "max_speed": 8.0}
COUNT = 1500
WORLDS = {world: module.world_arguments(world, None) for world in ("exact", "1/30")}


@pytest.fixture(scope="module")
def blocked():
    """The result of two "policies" of each world that shoot fast at the hidden ball, the layouts, and the shots."""
    config = Config.from_dict({"timesteps": 1, "env": BLOCKED})
    envs: Any = gym.make_vec("Billiards-v0", num_envs=COUNT, **BLOCKED)
    envs.reset(seed=evaluation_seeds(module.LAYOUT_SEED, COUNT).tolist())
    positions = envs.positions
    frame = ActionTransform("cut", Scene.named("blocked_pool"), np.array([False, True, False]), 8.0)
    rng, shots = np.random.default_rng(0), []
    for _ in range(4):
        actions = rng.uniform((-0.5, 0.2), (0.5, 1.0), (COUNT, 2))
        shots.append(frame.velocities(actions, positions, np.zeros((COUNT, 3), bool)) / 8.0)
    runs = [module.Run(world, seed, Path(f"{2 * (world != 'exact') + seed}")) for world in WORLDS for seed in (0, 1)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_shots", lambda folder, *_: shots[int(folder.name)])
        patch.setattr(module, "learning_curve", lambda folder: [Point(1, 60.0, 0.0, 0.0, 0.0)])
        result = {"layouts": COUNT, **module.compare(config, WORLDS, runs, COUNT)}
    return result, positions, shots


def test_successes_agree_with_the_environment(blocked):
    result, positions, shots = blocked
    for world, arguments in WORLDS.items():
        env = gym.make("Billiards-v0", **BLOCKED, **arguments)
        for policy, actions in zip(result["policies"], shots, strict=True):
            achieved = []
            for places, action in zip(positions[:200], actions[:200], strict=True):
                env.reset(options={"positions": places})
                achieved.append(env.step(action)[-1]["is_success"])
            assert policy["success"][world] / COUNT == pytest.approx(np.mean(achieved), abs=0.05)


def test_false_successes_through_the_post_are_missed_collisions(blocked):
    result, _, _ = blocked
    for policy in result["policies"]:
        false, successes = policy["false_successes"], policy["success"][policy["world"]]
        if policy["world"] == "exact":
            assert set(false.values()) == {0}
        else:
            assert successes > 30
            assert sum(false.values()) > 0.9 * successes
            assert false["missed_collision"] > 0.7 * sum(false.values())


def test_the_summary_is_over_seeds(blocked):
    result, _, _ = blocked
    means = timestep_report.summary(result)
    stepped = [p for p in result["policies"] if p["world"] == "1/30"]
    own, exact = ([p["success"][world] / COUNT for p in stepped] for world in ("1/30", "exact"))
    assert means["1/30"]["own"] == over_seeds(own)
    assert means["1/30"]["exact"] == over_seeds(exact)
    assert means["exact"]["behind"]["mean"] == 0.0
    assert means["1/30"]["false"]["mean"] == pytest.approx(
        sum(means["1/30"]["causes"][name]["mean"] for name in CAUSES)
    )
    assert means["1/30"]["training_seconds"] == {"mean": 60.0, "interval": [60.0, 60.0]}
    (row,) = (row for row in timestep_report.tables(result)["transfer"][1] if row[0] == "1/30 s")
    assert row[1:] == (f"{np.mean(exact):.1%}", f"{np.mean(own):.1%}")


@pytest.mark.parametrize("name", ["pot", "mixture", "blocked"])
def test_the_studies_of_the_project_are_valid(name):
    study, recipe = module.load_study(Path("configs/study") / f"{name}.yaml")
    assert {"exact", "1/15", "1/60"} <= set(study.worlds)
    assert recipe.seed not in study.seeds
    assert len(study.seeds) >= 3
    assert study.layouts >= 1000
    assert len(list(module.runs(study, recipe, Path()))) == len(study.worlds) * len(study.seeds)
