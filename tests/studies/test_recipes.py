import json
import shutil
import subprocess
from pathlib import Path

import pytest
import torch
import yaml

from agents import runs
from agents.config import Config, read
from agents.evaluate import deterministic
from agents.ppo import load_policy, make_vector
from billiards_env.evaluation import evaluation_seeds, play_together
from studies import recipes
from studies.recipes import PLAYERS, Recipes, blocks, find_places, main, row
from tests.helpers.training import settings

LISTS = sorted(recipes.CONFIG.parent.glob("*.yaml"))
TWO = {"policy": {"head": "aim", "arguments": {"hidden": 8}}}


def run_command(folder, *arguments: str) -> None:
    """Runs the command on two tiny recipes with two seeds each; a folder contains all files."""
    for name, changes in (("one", {}), ("two", TWO)):
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(settings(timesteps=256, **changes)))
    asked = {"seeds": [3, 4], "recipes": ["one.yaml", "two.yaml"], "figure": ["two"]}
    (folder / "recipes.yaml").write_text(yaml.safe_dump(asked))
    main([str(folder / "recipes.yaml"), "--folder", str(folder / "runs"), *arguments])


def test_every_recipe_is_trained_with_every_seed_and_reported(printed, tmp_path):
    folders = [tmp_path / "runs" / name / f"seed{seed}" for name in ("one", "two") for seed in (3, 4)]
    assert all((folder / "policy.pt").exists() for folder in folders)
    assert len({(folder / "policy.pt").read_bytes() for folder in folders}) == 4
    found = json.loads((tmp_path / "runs" / "recipes.json").read_text())["results"]
    assert [result["recipe"] for result in found] == ["one", "two"]
    for result in found:
        assert [run["seed"] for run in result["runs"]] == [3, 4]
        for run in result["runs"]:
            assert [point[0] for point in run["curve"]] == [0, 256]
            assert run["curve"][-1][3] == run["policy"]["success_rate"]
            assert run["policy"]["episodes"] == run["random"]["episodes"] == 20
        assert all(cell in printed for cell in row(result))
        assert list(result["players"]) == list(PLAYERS)
        for name, player in result["players"].items():
            assert player["episodes"] == 20
            assert f"{player['success_rate']:.1%}" in row(result), name
    assert (tmp_path / "runs" / "recipes.png").read_bytes().startswith(b"\x89PNG")

    written = blocks({"results": found})
    assert written["table"] in printed
    assert found[0]["players"] == found[1]["players"]  # both recipes have the same game
    assert all(name in written["table"].splitlines()[0] for name in ("million shots", "random", *PLAYERS))
    for name in ("one", "two"):
        for file in ("config.yaml", "policy.pt"):
            first = tmp_path / "runs" / name / "seed3" / file
            assert (tmp_path / "runs" / "policies" / name / file).read_bytes() == first.read_bytes()


def test_recipes_with_results_are_not_trained_again(command, printed, tiny, tmp_path, monkeypatch, capsys):
    for name in ("one", "two"):
        shutil.rmtree(tmp_path / "runs" / name)
    figure = (tmp_path / "runs" / "recipes.png").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(recipes, "train_all", None)
        command()
        assert capsys.readouterr().out == printed
        assert (tmp_path / "runs" / "recipes.png").read_bytes() == figure
    found = json.loads((tmp_path / "runs" / "recipes.json").read_text())["results"]
    (tmp_path / "two.yaml").write_text(yaml.safe_dump(tiny(timesteps=384, **TWO)))
    asked = Recipes(seeds=(3, 4), recipes=("one.yaml", "two.yaml"))
    again = recipes.measure(asked, tmp_path, find_places(tmp_path / "recipes.yaml", tmp_path / "runs"), 2)
    assert again[0] == found[0]
    assert again[1]["config"]["timesteps"] == 384
    assert (tmp_path / "runs" / "two").exists()
    assert not (tmp_path / "runs" / "one").exists()


def test_runs_that_are_not_finished_are_trained_in_their_own_processes(trained, tiny, tmp_path):
    folders = [tmp_path / name for name in ("finished", "new")]
    shutil.copytree(trained, folders[0])
    before = (folders[0] / "policy.pt").stat().st_mtime_ns
    runs.train_all(dict.fromkeys(folders, Config.from_dict(tiny())), 1)
    assert (folders[0] / "policy.pt").stat().st_mtime_ns == before
    assert "512/512 shots" in (folders[1] / "train.log").read_text()
    first, second = (torch.load(folder / "policy.pt") for folder in folders)
    assert all(torch.equal(first[name], second[name]) for name in first)


@pytest.mark.usefixtures("printed")
def test_a_list_without_a_figure_has_no_picture(tmp_path):
    (tmp_path / "runs" / "recipes.png").unlink()
    (tmp_path / "recipes.yaml").write_text(yaml.safe_dump({"seeds": [3, 4], "recipes": ["one.yaml"]}))
    main([str(tmp_path / "recipes.yaml"), "--folder", str(tmp_path / "runs")])
    assert not (tmp_path / "runs" / "recipes.png").exists()


def test_a_failed_run_is_reported(command, tmp_path, monkeypatch):
    def failing(folder):
        (folder / "train.log").write_text("out of luck")
        return subprocess.Popen(["false"])

    monkeypatch.setattr(runs, "_start", failing)
    monkeypatch.setattr(recipes, "train_all", runs.train_all)
    with pytest.raises(SystemExit, match=r"(?s)error: the training in .*one.seed3 failed:.*out of luck"):
        command()
    assert not (tmp_path / "runs" / "recipes.json").exists()
    with pytest.raises(SystemExit, match="error: jobs = 0: expected a whole number >= 1"):
        command("--jobs", "0")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"seeds": [], "recipes": ["a.yaml"]}, r"seeds = \[\]: expected at least one"),
        ({"seeds": [1, 1], "recipes": ["a.yaml"]}, r"seeds = \[1, 1\]: .*and no duplicates"),
        ({"seeds": [1], "recipes": ["a.yaml", "b/a.yaml"]}, "expected files of different names"),
        ({"seeds": [1], "recipes": ["a.yaml"], "figure": ["b"]}, "expected names of recipes, not 'b'"),
        ({"seeds": [1], "recipe": ["a.yaml"]}, r"key = 'recipe'.*did you mean 'recipes'"),
        ({"seeds": [1], "recipes": ["a.yaml"]}, r"a.yaml"),
    ],
)
def test_a_bad_list_is_refused(tmp_path, data, message):
    path = tmp_path / "results.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(SystemExit, match=f"error: .*{message}"):
        main([str(path)])


def test_the_players_play_the_game_and_the_layouts_of_a_recipe(tiny, monkeypatch):
    played = []

    def spy(name, env, noise, episodes, seed):
        played.append((name, env, noise, episodes, seed))
        return {"success_rate": 0.5}

    monkeypatch.setattr(recipes, "play_alone", spy)
    quiet = Config.from_dict(tiny(env={"n_object_balls": 2}, evaluation_episodes=2000))
    noisy = Config.from_dict(tiny(env={"n_object_balls": 2}, noise={"angle_std": 0.5}))
    found = {"config": quiet.to_dict(), "players": recipes._players(quiet, 3, [])}
    assert found["players"] == {name: {"success_rate": 0.5} for name in PLAYERS}
    assert played == [(name, quiet.env, (0.0, 0.0), 1000, 3) for name in PLAYERS]
    played.clear()
    recipes._players(noisy, 4, [found])
    assert played == [(name, noisy.env, (0.5, 0.075), 20, 4) for name in PLAYERS]
    played.clear()
    recipes._players(Config.from_dict(tiny(env={"n_object_balls": 3})), 3, [found])
    assert len(played) == len(PLAYERS)
    played.clear()
    same = Config.from_dict(tiny(env={"n_object_balls": 2}, timesteps=7, **TWO))
    assert recipes._players(same, 3, [{"config": quiet.to_dict()}, found]) is found["players"]
    assert not played


def test_only_the_lists_of_the_project_replace_the_results_of_the_project(tmp_path):
    own = find_places(tmp_path / "mine.yaml")
    assert {path.is_relative_to(recipes.RUNS / "mine") for path in own} == {True}
    for name in (path.stem for path in LISTS):
        found = find_places(recipes.CONFIG.parent / f"{name}.yaml")
        assert found.runs == recipes.RUNS / name
        assert found.summary == recipes.RESULTS / f"{name}.json"
        assert found.figure == recipes.IMAGES / f"{name}.png"
        assert found.policies == recipes.RESULTS / "policies"
    # A list of the same name elsewhere is not one of the project.
    other = find_places(tmp_path / "recipes.yaml")
    assert {path.is_relative_to(recipes.RUNS / "recipes") for path in other} == {True}


@pytest.mark.parametrize("path", LISTS, ids=lambda path: path.stem)
def test_the_lists_of_the_project_name_existing_recipes(path):
    asked = read(Recipes, path)
    assert len(asked.seeds) >= 3
    configs = asked.load(path.parent)
    assert list(configs) == [Path(recipe).stem for recipe in asked.recipes]
    assert not {config.seed for config in configs.values()} & set(asked.seeds)  # no recipe was tuned with these seeds
    if asked.timesteps is not None:
        assert {config.timesteps for config in configs.values()} == {asked.timesteps}


@pytest.mark.parametrize("path", LISTS, ids=lambda path: path.stem)
def test_the_results_of_the_project_are_those_of_its_lists(path):
    asked, found = read(Recipes, path), json.loads(find_places(path).summary.read_text())["results"]
    configs = asked.load(path.parent)
    assert [result["recipe"] for result in found] == list(configs)
    for result in found:
        assert [run["seed"] for run in result["runs"]] == list(asked.seeds), result["recipe"]
        assert configs[result["recipe"]].is_saved_as(result["config"]), result["recipe"]
        assert set(result["players"]) == set(PLAYERS)


@pytest.mark.parametrize("name", ["recipes"])
def test_the_policies_of_the_project_play_as_well_as_their_results(name):
    places = find_places(recipes.CONFIG.with_name(f"{name}.yaml"))
    for result in json.loads(places.summary.read_text())["results"]:
        run = result["runs"][0]
        config, policy = load_policy(places.policies / result["recipe"])
        assert config.seed == run["seed"]
        seeds = evaluation_seeds(config.seed, config.evaluation_episodes)[:500].tolist()
        played = play_together(make_vector(config, len(seeds)), deterministic(policy), seeds)
        for name, scale in (("success_rate", 1.0), ("mean_score", max(played["mean_score"], 1.0))):
            assert played[name] == pytest.approx(run["policy"][name], abs=0.06 * scale), result["recipe"]
