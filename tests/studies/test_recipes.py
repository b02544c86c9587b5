import contextlib
import dataclasses
import functools
import io
import json
import shutil
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
from studies.recipes import Places, Recipes, at_steps, blocks, main, row


def places(folder):
    return Places(
        runs=folder / "runs",
        summary=folder / "recipes.json",
        policies=folder / "policies",
        figure=folder / "images" / "curves.png",
    )


def write_recipes(folder, tiny):
    """Writes two tiny recipes with two seeds each."""
    for name, changes in (("one", {}), ("two", {"frame": {"name": "cut"}})):
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(tiny(timesteps=256, **changes)))
    (folder / "recipes.yaml").write_text(
        yaml.safe_dump({"seeds": [3, 4], "recipes": ["one.yaml", "two.yaml"], "figure": ["two"]})
    )


def run_command(folder, *arguments: str) -> None:
    """Runs the command on the recipes in a folder, which also contains all its output."""
    files = dataclasses.asdict(places(folder)).items()
    paths = [text for option, path in files for text in (f"--{option}", str(path))]
    main([str(folder / "recipes.yaml"), *paths, *arguments])


@pytest.fixture
def command(tiny, tmp_path):
    """Returns a function that runs the command in `tmp_path`."""
    write_recipes(tmp_path, tiny)
    return functools.partial(run_command, tmp_path)


@pytest.fixture(scope="module")
def trained_recipes(tiny, tmp_path_factory):
    """Returns the folder of a finished command, and its output."""
    folder, output = tmp_path_factory.mktemp("trained"), io.StringIO()
    write_recipes(folder, tiny)
    with contextlib.redirect_stdout(output):
        run_command(folder)
    return folder, output.getvalue()


@pytest.fixture
def printed(trained_recipes, tmp_path):
    """Returns the output of a finished command, whose files are in `tmp_path`."""
    folder, output = trained_recipes
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    return output.replace(str(folder), str(tmp_path))


def test_every_recipe_is_trained_with_every_seed_and_reported(printed, tmp_path):
    folders = [tmp_path / "runs" / name / f"seed{seed}" for name in ("one", "two") for seed in (3, 4)]
    assert all((folder / "policy.pt").exists() for folder in folders)
    assert len({(folder / "policy.pt").read_bytes() for folder in folders}) == 4
    found = json.loads((tmp_path / "recipes.json").read_text())["results"]
    assert [result["recipe"] for result in found] == ["one", "two"]
    for result in found:
        assert [run["seed"] for run in result["runs"]] == [3, 4]
        for run in result["runs"]:
            assert [point[0] for point in run["curve"]] == [0, 256]
            assert run["curve"][-1][3] == run["policy"]["success_rate"]
            assert run["policy"]["episodes"] == run["random"]["episodes"] == 20
        assert all(cell in printed for cell in row(result))
        assert at_steps(result, 200) == [run["curve"][1][3] for run in result["runs"]]
    assert (tmp_path / "images" / "curves.png").read_bytes().startswith(b"\x89PNG")

    assert blocks({"results": found})["table"] in printed
    for name in ("one", "two"):
        for file in ("config.yaml", "policy.pt"):
            first = tmp_path / "runs" / name / "seed3" / file
            assert (tmp_path / "policies" / name / file).read_bytes() == first.read_bytes()


@pytest.mark.usefixtures("printed")
def test_an_interrupted_command_trains_only_the_missing_run(command, tmp_path):
    found = (tmp_path / "recipes.json").read_text()
    policies = {path: path.stat().st_mtime_ns for path in (tmp_path / "runs").rglob("policy.pt")}
    missing = tmp_path / "runs" / "one" / "seed4" / "policy.pt"
    missing.unlink()
    (tmp_path / "recipes.json").unlink()
    command("--jobs", "1")
    assert [path for path, time in policies.items() if path.stat().st_mtime_ns > time] == [missing]
    again = json.loads((tmp_path / "recipes.json").read_text())["results"]
    assert again[1] == json.loads(found)["results"][1]


def test_recipes_with_results_are_not_trained_again(command, printed, tiny, tmp_path, monkeypatch, capsys):
    shutil.rmtree(tmp_path / "runs")
    figure = (tmp_path / "images" / "curves.png").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(recipes, "train_all", None)
        command()
        assert capsys.readouterr().out == printed
        assert (tmp_path / "images" / "curves.png").read_bytes() == figure
    found = json.loads((tmp_path / "recipes.json").read_text())["results"]
    (tmp_path / "two.yaml").write_text(yaml.safe_dump(tiny(timesteps=384, frame={"name": "cut"})))
    asked = Recipes(seeds=(3, 4), recipes=("one.yaml", "two.yaml"))
    again = recipes.measure(asked, tmp_path, places(tmp_path), 2)
    assert again[0] == found[0]
    assert again[1]["config"]["timesteps"] == 384
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == ["two"]


def test_a_failed_run_is_reported(command, tmp_path, monkeypatch):
    def failing(folder):
        (folder / "train.log").write_text("out of luck")
        return subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])

    monkeypatch.setattr(runs, "_start", failing)
    with pytest.raises(SystemExit, match=r"(?s)error: the training in .*one.seed3 failed:.*out of luck"):
        command()
    assert not (tmp_path / "recipes.json").exists()


def test_a_run_of_another_configuration_is_refused(command, tiny, tmp_path):
    folder = tmp_path / "runs" / "one" / "seed3"
    open_run(dataclasses.replace(Config.from_dict(tiny(timesteps=128)), seed=3), folder)
    with pytest.raises(SystemExit, match=r"error: .*seed3 holds a run of another configuration"):
        command()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"seeds": [], "recipes": ["a.yaml"]}, r"seeds = \[\]: expected at least one"),
        ({"seeds": [1, 1], "recipes": ["a.yaml"]}, r"seeds = \[1, 1\]: .*and no duplicates"),
        ({"seeds": [1], "recipes": ["a.yaml", "b/a.yaml"]}, "expected files of different names"),
        ({"seeds": [1], "recipes": ["a.yaml"], "figure": ["b"]}, "expected names of recipes, not 'b'"),
        ({"seeds": [1], "recipe": ["a.yaml"]}, r"key of the configuration = 'recipe'.*did you mean 'recipes'"),
        ({"seeds": [1], "recipes": ["a.yaml"]}, r"a.yaml"),
    ],
)
def test_a_bad_list_is_refused(tmp_path, data, message):
    path = tmp_path / "results.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(SystemExit, match=f"error: .*{message}"):
        main([str(path)])


def test_only_the_list_of_the_project_replaces_the_results_of_the_project(tmp_path):
    own, project = recipes.default_places(tmp_path / "mine.yaml"), Places()
    assert recipes.default_places(recipes.CONFIG) == project
    assert {path.is_relative_to(recipes.RUNS / "mine") for path in dataclasses.astuple(own)} == {True}


def test_at_least_one_job_is_needed(command):
    with pytest.raises(SystemExit, match="error: jobs = 0: expected a whole number >= 1"):
        command("--jobs", "0")


def test_the_list_of_the_project_names_existing_recipes():
    asked = yaml.safe_load(recipes.CONFIG.read_text())
    assert len(Recipes(**{key: tuple(value) for key, value in asked.items()}).seeds) >= 3
    assert all((recipes.CONFIG.parent / recipe).is_file() for recipe in asked["recipes"])


def test_the_policies_of_the_project_play_as_well_as_their_results():
    for result in json.loads(Places().summary.read_text())["results"]:
        run = result["runs"][0]
        config, policy = load_policy(Places().policies / result["recipe"])
        assert config.seed == run["seed"]
        seeds = evaluation_seeds(config.seed, config.evaluation_episodes)[:500].tolist()
        played = play_together(make_vector(config, len(seeds)), deterministic(policy), seeds)
        for name, scale in (("success_rate", 1.0), ("mean_score", max(played["mean_score"], 1.0))):
            assert played[name] == pytest.approx(run["policy"][name], abs=0.06 * scale), result["recipe"]
