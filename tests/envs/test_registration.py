import re
from pathlib import Path

import pytest

import billiards_env
from tests.helpers.environments import printed


@pytest.mark.parametrize(
    ("code", "words", "heavy"),
    [
        ("import billiards_env; print(gymnasium.spec('Billiards-v0').id)", "Billiards-v0", {"numba"}),
        ("print(type(gymnasium.make('billiards_env:Billiards-v0').unwrapped).__name__)", "BilliardsEnv", set()),
    ],
)
def test_registration_loads_nothing_heavy(code, words, heavy):
    heavy |= {"torch", "jax", "pygame", "matplotlib"}
    heavy |= {f"billiards_env.{name}" for name in ("drawing.raster", "envs.action_frames", "envs.plans", "players")}
    code = f"import sys, gymnasium; {code}; print(*{heavy} & set(sys.modules))"
    assert printed(code) == [words]


def test_the_version_matches_pyproject():
    pyproject = Path(__file__).parents[2] / "pyproject.toml"
    found = re.search(r'^version = "(.+)"$', pyproject.read_text(), re.MULTILINE)
    assert found is not None
    assert billiards_env.__version__ == found[1]


def test_the_engine_is_imported_on_first_use():
    from billiards_env.shots.simulation import simulate, simulate_batch

    assert billiards_env.simulate is simulate
    assert billiards_env.simulate_batch is simulate_batch
    assert {"Scene", "simulate", "simulate_batch"} <= set(dir(billiards_env))


def test_unknown_attributes_raise():
    with pytest.raises(AttributeError, match="module 'billiards_env' has no attribute 'simulat'"):
        billiards_env.simulat  # noqa: B018
