"""The programs in `examples` run with small sizes."""

import gc
import importlib.util
import json
import re
import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples"
PAGE = (FOLDER.parent / "docs" / "examples.md").read_text(encoding="utf-8")


def load(name, *packages):
    """Returns the functions of a program, or skips the test without its packages."""
    for package in packages:
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"needs {package}")
    return runpy.run_path(str(FOLDER / f"{name}.py"))


def test_the_extra_train_has_what_a_progress_bar_needs():
    PPO = pytest.importorskip("stable_baselines3").PPO
    with pytest.warns(match="rich is experimental"):
        PPO("MlpPolicy", "CartPole-v1", n_steps=64, device="cpu").learn(64, progress_bar=True)
    train = re.search(r"^train = \[(.*?)\]", (FOLDER.parent / "pyproject.toml").read_text(), re.MULTILINE | re.DOTALL)
    assert train is not None
    assert {"rich", "tqdm"} <= set(re.findall(r'"([\w-]+)', train[1]))


def test_every_program_is_on_the_page():
    programs = {path.name for path in FOLDER.glob("[a-z]*.*")}
    assert set(re.findall(r"^\| `examples/([\w.]+)`", PAGE, re.MULTILINE)) == programs


def test_stable_baselines3_trains_and_writes_curves(tmp_path, capsys):
    pytest.importorskip("tensorboard")
    model = load("sb3_ppo", "stable_baselines3")["run"](10240, str(tmp_path))
    assert model.num_timesteps == 10240
    assert re.search(r"total_timesteps +\| 10240 ", capsys.readouterr().out)
    assert list(tmp_path.rglob("events*"))


def test_a_policy_trains_on_a_fitted_table():
    shares = load("calibrated_table", "stable_baselines3")["run"](512, shots=3, episodes=20, seeds=[0, 1])
    assert set(shares) == {"fitted", "default"}
    assert all(0.0 <= share["mean"] <= 1.0 for share in shares.values())


def test_tree_search_plays_an_episode():
    assert 0.0 <= load("tree_search")["main"](["--episodes", "1", "--simulations", "10"]) <= 9.0


PROGRAMS = [
    pytest.param("optuna_sweep", "optuna", 2048, {"episodes": 50}, 0.0, 1.0, marks=pytest.mark.tools),
    pytest.param("torchrl_collector", "torchrl", 2048, {}, -0.2, 0.2, marks=pytest.mark.tools),
    ("rllib_ppo", "ray", 2048, {"num_envs": 32}, -0.3, 0.3),
    ("goals", "stable_baselines3", 1100, {"episodes": 100}, 0.0, 1.0),
]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("name", "package", "steps", "arguments", "least", "most"), PROGRAMS)
def test_a_program_returns_a_number_in_its_range(name, package, steps, arguments, least, most, capsys):
    value = load(name, package)["run"](steps, **arguments)
    chance, value = value if isinstance(value, tuple) else (0.5, getattr(value, "best_value", value))
    assert 0.1 < chance < 0.9
    assert least <= value <= most
    assert name != "goals" or "total_timesteps" in capsys.readouterr().out


@pytest.mark.parametrize("learners", [["DQN"], ["DQN", "MaskablePPO"]], ids=" and ".join)
def test_learners_choose_among_plans(learners, monkeypatch, capsys):
    if len(learners) == 1:
        monkeypatch.setitem(sys.modules, "sb3_contrib", None)
        program = load("plans", "stable_baselines3")
    else:
        program = load("plans", "stable_baselines3", "sb3_contrib")
    shares = program["run"](1100, episodes=100)
    assert list(shares) == ["random plans with the masks", *learners]
    assert 0.1 < shares.pop("random plans with the masks") < 0.9
    assert all(0.0 <= share <= 1.0 for share in shares.values())
    said = capsys.readouterr().out
    assert ("pip install 'billiards-env[masks]'" in said) is (len(learners) == 1)
    assert said.count("Using cpu device") == len(learners)  # each prints its progress


def test_ppo_trains_from_pixels():
    assert load("pixels", "stable_baselines3")["run"](256, num_envs=16).observation_space.shape == (3, 84, 84)


def test_self_play_learns_from_games():
    program = load("self_play", "stable_baselines3", "sb3_contrib")
    shares = program["run"](128 * 32, 128 * 32, n_games=4, rivals=("random", "geometric"))
    assert list(shares) == ["random", "geometric"]
    assert all(0.0 <= share <= 1.0 for pair in shares.values() for share in pair)
    assert shares["random"][0] > 0.5


@pytest.mark.tools
@pytest.mark.filterwarnings("ignore")  # of Minari: unknown author; temporary folder
def test_a_clone_pots_balls():
    clone, teacher = load("dataset_cloning")["run"](64, episodes=100)
    assert 0 <= clone < 0.8 < teacher
    gc.collect()


def test_the_notebook_runs_top_to_bottom(monkeypatch, capsys):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pytest.importorskip("stable_baselines3")
    notebook = json.loads((FOLDER / "first_steps.ipynb").read_text(encoding="utf-8"))
    assert all(cell.get("outputs", []) == [] for cell in notebook["cells"])
    names = {"__name__": "notebook"}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), "notebook", "exec"), names)
    pyplot.close("all")
    match = re.search(r"the policy pots (\d+\.\d)% of 1,000 new layouts", capsys.readouterr().out)
    assert match is not None
    assert float(match[1]) > 10.0
