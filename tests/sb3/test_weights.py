"""A folder with a wrong configuration is refused with a ValueError that names what is wrong."""

from typing import Any

import pytest
import yaml

from billiards_env.sb3.weights import build_policy, load_policy, save_policy

POLICY: dict[str, Any] = {"head": "gaussian", "hidden": [8], "activation": "tanh"}
ENV = {"task": "pot", "scene": "pool", "n_object_balls": 1}


@pytest.fixture
def folder(tmp_path):
    save_policy(build_policy(ENV, POLICY), tmp_path / "policy.pt")
    return tmp_path


def settings(env=None, **policy):
    return yaml.safe_dump({"env": ENV | (env or {}), "policy": POLICY | policy})


def nested(row):
    """Returns nine to the power of eight items in nine lines."""
    rows = [row("abcdefghi"[k], "*" + "abcdefghi"[k - 1]) for k in range(1, 9)]
    return "\n".join(["a: &a {x: 1}", *rows, "env: *i", "policy: *i"])


WRONG: dict[str, tuple[Any, ...]] = {
    "nothing": ("", "expected the sections env and policy of a run"),
    "a list": ("[1]", "expected the sections env and policy of a run"),
    "a list for a section": ("env: [1]\npolicy: {}", "expected the sections env and policy of a run"),
    "no policy": ("env: {}\npolicy: null", "expected the sections env and policy of a run"),
    "deep": ("[" * 50_000, "more than 1000 lists and mappings in brackets"),
    "deep block": ("- " * 10_000, "nested too deeply"),
    "aliases": (nested(lambda name, last: f"{name}: &{name} [{','.join([last] * 9)}]"), r"an alias, \*a"),
    "merges": (nested(lambda name, last: f"{name}: &{name} {{<<: [{','.join([last] * 9)}]}}"), r"an alias, \*a"),
    "a loop": ("env: &a {task: *a}\npolicy: {}", r"an alias, \*a"),
    "large": (" " * 100_001, "a file of more than 100000 bytes"),
    "an unknown argument": (settings({"tsk": "pot"}), "unexpected keyword argument 'tsk'"),
    "a wrong type": (settings({"max_speed": "fast"}), "max_speed = 'fast': expected a number"),
    "units": (settings(hidden=3), "policy.hidden = 3: expected a list"),
    "no number": (settings(hidden=["a"]), "policy.hidden = 'a': expected a whole number"),
    "many units": (settings(hidden=[8, 10**9]), r"expected more weights for \[8, 1000000000\]"),
    "activation": (settings(activation=["tanh"]), r"policy.activation = \['tanh'\]: expected one of"),
    "head": (settings(head=["pots"]), r"policy.head = \['pots'\]: expected one of"),
    "no arguments": (settings(head="aim", arguments=None), "expected the sections env and policy of a run"),
    "an unknown one": (settings(head="aim", arguments={"point": 3}), "policy.arguments = 'point': expected one of"),
    "points": (settings(head="aim", arguments={"points": 10**9}), "points = 1000000000: expected a whole number"),
    "speeds": (settings(head="aim", arguments={"speeds": 3}), "speeds = 3: expected from 2 to 100 numbers"),
    "std": (settings(head="aim", arguments={"std_aim": [0.1, 0.0]}), r"std_aim = \[0.1, 0.0\]: expected two positive"),
    "aim": (settings(head="aim", arguments={"aim": "table"}), "aim = 'table': expected one of"),
    "another task": (settings(), "another task: expected 'pot', not 'place'", {"task": "place"}),
    "another action": (settings(), "another action: expected 'velocity', not 'strike'", {"action": "strike"}),
    "another speed": (settings(), "another max_speed: expected 4.0, not 5.0", {"max_speed": 5.0}),
    "jaws": (settings(), "another table: expected the same table", {"scene": "real_pool"}),
    "a smaller table": (settings(), "another table: expected the same table", {"scene": "uk_pool"}),
    "features": (settings(), r"observes \('positions',\): expected this, not \('cue_", {"observe": ["cue_to_balls"]}),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_configuration_or_one_of_another_world_is_refused(case, folder):
    text, message, *env = WRONG[case]
    (folder / "config.yaml").write_text(text)
    with pytest.raises(ValueError, match=message):
        load_policy(folder, *env)


def test_a_policy_for_a_frozen_task_plays_it_whatever_the_rewards_of_the_training(folder):
    (folder / "config.yaml").write_text(f"task: Pot1-v0\n{settings({'task': 'clear'})}")
    assert load_policy(folder, {"task": "pot"})[0]["task"] == "pot"
    with pytest.raises(ValueError, match="another task: expected 'clear', not 'position'"):
        load_policy(folder, {"task": "position"})


def test_a_right_one_is_loaded_and_an_argument_of_the_caller_keeps_its_error(folder):
    (folder / "config.yaml").write_text(settings())
    assert load_policy(folder)[0] == ENV
    with pytest.raises(TypeError, match="max_speed = 'fast'"):
        load_policy(folder, {"max_speed": "fast"})
