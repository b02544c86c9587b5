import re
from pathlib import Path

import pytest

import billiards_env


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
