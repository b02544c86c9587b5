"""The table of learners, and a learner of another package, `tests/data/my_learner.py`."""

import importlib
import sys
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml

from agents import evaluate, train
from agents.config import Config, load
from agents.learner import Learner, Setting, Training, up_to
from agents.learners import LEARNERS, register_learner
from tests.helpers.errors import refusals
from tests.helpers.training import trained_run

DATA = Path(__file__).resolve().parents[1] / "data"
OWN = {"timesteps": 64, "learner": "my_learner:draw", "evaluation_episodes": 10, "policy": {"head": "gaussian"}}
NOTHING = Learner({}, lambda config: None, lambda config, run_dir: Training())


@pytest.fixture(autouse=True)
def package(monkeypatch):
    """Lets Python find the package. Its entries are removed after a test."""
    monkeypatch.syspath_prepend(DATA)
    before = {*LEARNERS}
    yield
    sys.modules.pop("my_learner", None)
    for name in {*LEARNERS} - before:
        del LEARNERS[name]


def test_the_command_trains_with_a_learner_of_another_package(tmp_path, capsys):
    settings, run = tmp_path / "own.yaml", tmp_path / "run"
    settings.write_text(yaml.safe_dump({**OWN, "seed": 3, "draw": {"spread": "1/5"}}))
    train.main([str(settings), "--run-dir", str(run)])
    assert "64 shots" in capsys.readouterr().out
    assert yaml.safe_load((run / "config.yaml").read_text())["draw"] == {"spread": 0.2}
    config, policy = evaluate.load_run(run)
    assert (config, config.learner) == (load(settings), "my_learner:draw")
    torch.manual_seed(3)
    assert torch.equal(next(policy.parameters()), 0.2 * torch.randn(2))
    assert [point.steps for point in train.learning_curve(run)] == [0, 64]
    settings.write_text(yaml.safe_dump({**OWN, "seed": 3}))
    with pytest.raises(SystemExit, match=r"but draw is {'spread': 0.2}, not {'spread': 0.1}\. --run-dir"):
        train.main([str(settings), "--run-dir", str(run)])
    settings.write_text(yaml.safe_dump({**OWN, "seed": 3, "learner": "ppo"}))
    with pytest.raises(SystemExit, match=r"but learner is 'my_learner:draw', not 'ppo'; draw is .*, not None; ppo is "):
        train.main([str(settings), "--run-dir", str(run)])


@refusals(
    "changes",
    [
        ({"learner": 3}, "learner = 3: expected one of 'ppo', 'likelihood'"),
        ({"learner": "my_learner:drew"}, r"learner = .*: expected a name that 'my_learner' registers .*'draw'"),
        ({"learner": "none:draw"}, "learner = 'none:draw': expected a module that can be imported"),
        ({"draw": 3}, "draw = 3: expected a mapping"),
        ({"draw": {"spreat": 1}}, r"key of draw = 'spreat': expected one of 'spread' \(did you mean 'spread'\?\)"),
        ({"draw": {"spread": 11}}, "draw.spread = 11: expected a number from 0 to 10"),
        ({"draw": {"spread": "wide"}}, "draw.spread = 'wide': expected a number, not str", TypeError),
        ({"ppo": {"n_steps": 3}}, "ppo = .*: expected nothing with learner = 'my_learner:draw'"),
        ({"likelihood": None}, "likelihood = None: expected nothing with learner = 'my_learner:draw'"),
        ({"policy": {"head": "aim"}}, "policy.head = 'aim': expected 'gaussian' with learner = 'draw'"),
        (
            {"settings": {"spread": 1}},
            "key of the settings = 'settings': expected one of .*'ppo', 'likelihood', 'draw'",
        ),
    ],
)
def test_wrong_names_and_settings_are_refused(changes, message, kind):
    with pytest.raises(kind, match=message):
        Config.from_dict({**OWN, **changes})


def test_a_learner_has_its_type_its_arguments_and_a_name_of_its_own():
    wrong: list[Any] = [3, NOTHING._replace(check=lambda: None), NOTHING._replace(make=lambda config: Training())]
    for learner, message in zip(
        wrong, ("learner = 3", "check of learner 'mine'", "make of learner 'mine'"), strict=True
    ):
        with pytest.raises(TypeError, match=f"{message}.*: expected"):
            register_learner("mine", learner)
    with pytest.raises(ValueError, match="name = 'ppo': expected a name that no other learner has"):
        register_learner("ppo", NOTHING)
    register_learner("env", NOTHING)
    assert Config(timesteps=1).to_dict() == Config.from_dict({"timesteps": 1, "env": {}}).to_dict()
    with pytest.raises(ValueError, match="learner = 'env': expected a learner whose name is no key of the settings"):
        Config(timesteps=1, learner="env")


def test_a_module_with_a_learner_may_be_loaded_again():
    module = importlib.import_module("my_learner")
    before = LEARNERS["draw"]
    importlib.reload(module)
    assert LEARNERS["draw"].make is module.Draw is not before.make
    changed = before._replace(settings={"spread": Setting(up_to(10.0), 0.2)})
    register_learner("draw", changed)  # a module may also change its learner
    assert LEARNERS["draw"] is changed
    importlib.reload(module)
    with pytest.raises(ValueError, match="name = 'draw': expected a name that no other learner has"):
        register_learner("draw", NOTHING)


def test_what_a_learner_returns_is_checked(tmp_path, monkeypatch):
    class Wrong(Training):
        def __init__(self, config: Config, rate: Any) -> None:
            self.policy, self.rate = train.make_policy(config), rate

        def restart(self) -> None:
            pass

        def update(self) -> Any:
            return self.rate

    makers: dict[str, Any] = {
        "learner 'mine' = None: expected the type Training, not NoneType": lambda config, run_dir: None,
        "training_success = None: expected a number": lambda config, run_dir: Wrong(config, None),
        "shots = 0: expected a whole number >= 1": lambda config, run_dir: Wrong(config, 0.0),
    }
    for k, (message, make) in enumerate(makers.items()):
        monkeypatch.setitem(LEARNERS, "mine", NOTHING._replace(make=make))
        with pytest.raises((TypeError, ValueError), match=message):
            trained_run(Config.from_dict({**OWN, "learner": "mine"}), tmp_path / str(k))
