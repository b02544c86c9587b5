import dataclasses
import json
import subprocess
import sys

import pytest
import yaml

from agents import runs
from agents.config import Config
from agents.evaluate import deterministic, play_together
from agents.ppo import evaluation_seeds, load_policy, make_vector
from agents.train import open_run
from studies import recipes
from studies.recipes import Results, at_steps, main, row


@pytest.fixture
def command(tiny, tmp_path):
    """A function that runs the command on two tiny recipes with two seeds each; all it writes is in `tmp_path`."""
    for name, changes in (("one", {}), ("two", {"frame": {"name": "cut"}})):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(tiny(timesteps=256, **changes)))
    (tmp_path / "results.yaml").write_text(
        yaml.safe_dump({"seeds": [3, 4], "recipes": ["one.yaml", "two.yaml"], "figure": ["two"]})
    )

    def run(*arguments: str) -> None:
        options = {"--runs": "runs", "--summary": "agents.json", "--figure": "images/curves.png"}
        paths = [text for option, name in options.items() for text in (option, str(tmp_path / name))]
        main([str(tmp_path / "results.yaml"), *paths, *arguments])

    return run


def test_every_recipe_is_trained_with_every_seed_once_and_reported(command, tmp_path, capsys):
    command()
    told = capsys.readouterr().out
    folders = [tmp_path / "runs" / name / f"seed{seed}" for name in ("one", "two") for seed in (3, 4)]
    assert all((folder / "policy.pt").exists() for folder in folders)
    assert len({(folder / "policy.pt").read_bytes() for folder in folders}) == 4
    found = json.loads((tmp_path / "agents.json").read_text())["results"]
    assert [result["recipe"] for result in found] == ["one", "two"]
    for result in found:
        assert [run["seed"] for run in result["runs"]] == [3, 4]
        for run in result["runs"]:
            assert [point[0] for point in run["curve"]] == [0, 256]
            assert run["curve"][-1][3] == run["policy"]["success_rate"]
            assert run["policy"]["episodes"] == run["random"]["episodes"] == 20
        assert f"| {' | '.join(row(result))} |" in told
        assert at_steps(result, 200) == [run["curve"][1][3] for run in result["runs"]]
    assert (tmp_path / "images" / "curves.png").read_bytes().startswith(b"\x89PNG")

    written = {path: path.stat().st_mtime_ns for folder in folders for path in folder.iterdir() if path.is_file()}
    (folders[1] / "policy.pt").unlink()  # as if this run had been interrupted
    command("--jobs", "1")
    again = [path for path, when in written.items() if path.stat().st_mtime_ns > when and path.name == "policy.pt"]
    assert again == [folders[1] / "policy.pt"]
    assert json.loads((tmp_path / "agents.json").read_text())["results"][1] == found[1]


def test_a_run_that_fails_is_told_of(command, tmp_path, monkeypatch):
    def failing(folder):
        (folder / "train.log").write_text("out of luck")
        return subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])

    monkeypatch.setattr(runs, "_start", failing)
    with pytest.raises(SystemExit, match=r"(?s)error: the training in .*one.seed3 failed:.*out of luck"):
        command()
    assert not (tmp_path / "agents.json").exists()


def test_a_recipe_that_has_changed_is_not_mixed_with_what_was_trained(command, tiny, tmp_path):
    folder = tmp_path / "runs" / "one" / "seed3"
    open_run(dataclasses.replace(Config.from_dict(tiny(timesteps=128)), seed=3), folder)
    with pytest.raises(SystemExit, match=r"error: .*seed3 holds a run of another configuration"):
        command()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"seeds": [], "recipes": ["a.yaml"]}, r"seeds = \[\]: expected at least one"),
        ({"seeds": [1, 1], "recipes": ["a.yaml"]}, r"seeds = \[1, 1\]: .*none of them twice"),
        ({"seeds": [1], "recipes": ["a.yaml", "b/a.yaml"]}, "expected files of different names"),
        ({"seeds": [1], "recipes": ["a.yaml"], "figure": ["b"]}, "'b' is not one of the recipes"),
        ({"seeds": [1], "recipe": ["a.yaml"]}, r"key of the configuration = 'recipe'.*did you mean 'recipes'"),
        ({"seeds": [1], "recipes": ["a.yaml"]}, r"a.yaml"),
    ],
)
def test_a_bad_list_is_refused_by_name(tmp_path, data, message):
    path = tmp_path / "results.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(SystemExit, match=f"error: .*{message}"):
        main([str(path)])


def test_at_least_one_job_is_needed(command):
    with pytest.raises(SystemExit, match="error: jobs = 0: expected a whole number >= 1"):
        command("--jobs", "0")


def test_the_list_that_comes_along_names_recipes_there_are():
    asked = yaml.safe_load(recipes.CONFIG.read_text())
    assert len(Results(**{key: tuple(value) for key, value in asked.items()}).seeds) >= 3
    assert all((recipes.CONFIG.parent / recipe).is_file() for recipe in asked["recipes"])


def test_the_policies_that_come_along_play_as_well_as_is_told_of_them():
    for result in json.loads(recipes.SUMMARY.read_text())["results"]:
        told = result["runs"][0]
        config, policy = load_policy(recipes.RUNS / result["recipe"] / f"seed{told['seed']}")
        seeds = evaluation_seeds(config.seed, config.evaluation_episodes)[:500].tolist()
        played = play_together(make_vector(config, len(seeds)), deterministic(policy), seeds)
        for name, scale in (("success_rate", 1.0), ("mean_score", max(played["mean_score"], 1.0))):
            assert played[name] == pytest.approx(told["policy"][name], abs=0.06 * scale), result["recipe"]
