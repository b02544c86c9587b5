"""A folder with a wrong configuration is refused with a ValueError that names what is wrong."""

import itertools
from typing import Any

import pytest
import torch
import yaml

from billiards_env.sb3.weights import build_policy, is_slim, load_policy, read_weights, save_policy, slim

POLICY: dict[str, Any] = {"head": "gaussian", "hidden": [8], "activation": "tanh"}
ENV = {"task": "pot", "scene": "pool", "n_object_balls": 1}


@pytest.fixture
def folder(tmp_path):
    save_policy(build_policy(ENV, POLICY), tmp_path / "policy.pt")
    return tmp_path


def settings(env=None, **policy):
    return yaml.safe_dump({"env": ENV | (env or {}), "policy": POLICY | policy})


def nested():
    """Returns nine to the power of eight items in nine lines."""
    rows = [f"{name}: &{name} [{','.join(['*' + last] * 9)}]" for last, name in itertools.pairwise("abcdefghi")]
    return "\n".join(["a: &a {x: 1}", *rows, "env: *i", "policy: *i"])


WRONG: dict[str, tuple[Any, ...]] = {
    "nothing": ("", "expected the sections env and policy of a run"),
    "no policy": ("env: {}\npolicy: null", "expected the sections env and policy of a run"),
    "deep": ("[" * 50_000, "more than 1000 lists and mappings in brackets"),
    "aliases": (nested(), r"an alias, \*a"),
    "a loop": ("env: &a {task: *a}\npolicy: {}", r"an alias, \*a"),
    "large": (" " * 100_001, "a file of more than 100000 bytes"),
    "an unknown argument": (settings({"tsk": "pot"}), "tsk = 'pot': expected one of the arguments"),
    "a wrong type": (settings({"max_speed": "fast"}), "max_speed = 'fast': expected a number"),
    "units": (settings(hidden=3), "policy.hidden = 3: expected a list"),
    "many units": (settings(hidden=[8, 10**9]), r"expected more weights for \[8, 1000000000\]"),
    "activation": (settings(activation=["tanh"]), r"policy.activation = \['tanh'\]: expected one of"),
    "head": (settings(head=["pots"]), r"policy.head = \['pots'\]: expected one of"),
    "no arguments": (settings(head="aim", arguments=None), "expected the sections env and policy of a run"),
    "an unknown one": (settings(head="aim", arguments={"point": 3}), "policy.arguments = 'point': expected one of"),
    "points": (settings(head="aim", arguments={"points": 10**9}), "points = 1000000000: expected a whole number"),
    "speeds": (settings(head="aim", arguments={"speeds": 3}), "speeds = 3: expected from 2 to 100 numbers"),
    "another task": (settings(), "another task: expected 'pot', not 'place'", {"task": "place"}),
    "another action": (settings(), "another action: expected 'velocity', not 'strike'", {"action": "strike"}),
    "another speed": (settings(), "another max_speed: expected 4.0, not 5.0", {"max_speed": 5.0}),
    "jaws": (settings(), "another table: expected the same table", {"scene": "real_pool"}),
    "features": (settings(), r"observes \('positions',\): expected this, not \('cue_", {"observe": ["cue_to_balls"]}),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_configuration_or_one_of_another_world_is_refused(case, folder):
    text, message, *env = WRONG[case]
    (folder / "config.yaml").write_text(text)
    with pytest.raises(ValueError, match=message):
        load_policy(folder, *env)


def test_a_policy_for_a_frozen_task_plays_it_whatever_its_rewards_were(folder):
    (folder / "config.yaml").write_text(f"task: Pot1-v0\n{settings({'task': 'clear'})}")
    assert load_policy(folder, {"task": "pot"})[0]["task"] == "pot"
    with pytest.raises(ValueError, match="another task: expected 'clear', not 'position'"):
        load_policy(folder, {"task": "position"})


@pytest.mark.parametrize("balls", [1, 3])
def test_a_slim_policy_is_smaller_and_plays_with_rounded_weights(balls, tmp_path):
    torch.manual_seed(0)
    env, copy = {**ENV, "n_object_balls": balls, "max_shots": 1}, tmp_path / "copy"
    policy: Any = build_policy(env, {"head": "aim", "arguments": {"hidden": 32}})
    if balls > 1:
        torch.nn.init.normal_(policy.net.other_balls.weight)
    config = {"env": env, "policy": {"head": "aim", "arguments": {"hidden": 32}}}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config | ({"learner": "likelihood"} if balls > 1 else {})))
    save_policy(policy, tmp_path / "policy.pt")
    copy.mkdir()
    for name, content in slim(tmp_path).items():
        (copy / name).write_bytes(content)
    assert (copy / "policy.pt").stat().st_size < 0.6 * (tmp_path / "policy.pt").stat().st_size
    assert slim(copy)["policy.pt"] == (copy / "policy.pt").read_bytes()
    assert [is_slim(read_weights(folder / "policy.pt")) for folder in (tmp_path, copy)] == [False, True]
    whole, rounded = (dict(load_policy(folder)[1].state_dict()) for folder in (tmp_path, copy))
    for name, weights in whole.items():
        if name.startswith("net.other_ball." if balls == 1 else "net.critic."):
            assert not rounded[name].any()
        else:
            torch.testing.assert_close(rounded[name], weights, rtol=2**-9, atol=1.2e-7)
    layouts = torch.rand(50, 2 * (1 + balls)) * 1.6 - 0.8
    played = [load_policy(folder)[1].predict(layouts.numpy(), deterministic=True)[0] for folder in (tmp_path, copy)]
    assert played[0] == pytest.approx(played[1], abs=4e-3)  # twice 2**-9, the largest error of rounding a number near 1


def test_a_weight_that_a_slim_policy_cannot_hold_is_refused(folder):
    (folder / "config.yaml").write_text(settings())
    torch.save({"log_std": torch.tensor([7e4])}, folder / "policy.pt")
    with pytest.raises(ValueError, match=r"run_dir = .*: expected weights up to 65,000"):
        slim(folder)


def test_a_right_one_is_loaded_and_an_argument_of_the_caller_keeps_its_error(folder):
    (folder / "config.yaml").write_text(settings())
    assert load_policy(folder)[0] == ENV
    with pytest.raises(TypeError, match="max_speed = 'fast'"):
        load_policy(folder, {"max_speed": "fast"})
