"""The table of Gymnasium's vector wrappers in docs/gotchas.md, on the Gymnasium that is installed.

The column of a mode has "yes", "no" (an error), "wrong" (wrong numbers without an error), or a version from which on
the wrapper works with the mode. Older versions can return wrong numbers.
"""

import re
import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import wrappers as single_wrappers
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector as wrappers

from billiards_env.envs import make_vector_env, vector
from tests.helpers.environments import SOFT

GOTCHAS = Path(__file__).parents[2] / "docs" / "gotchas.md"
MODES = [mode.value for mode in (AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED)]
ROWS = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| (.+?) \| (.+?) \| (.+?) \|$", GOTCHAS.read_text(), re.MULTILINE)
TABLE = {name: dict(zip(MODES, cells, strict=True)) for names, *cells in ROWS for name in re.findall(r"\w+", names)}

WIDE = Box(-2, 2, (2,), np.float32)
ARGUMENTS: dict[str, tuple[Any, ...]] = {
    "ClipReward": (-1.0, 0.5),
    "DtypeObservation": (np.float64,),
    "RescaleAction": (-2.0, 2.0),
    "RescaleObservation": (-2.0, 2.0),
    "ReshapeObservation": ((3, 2),),
    "TransformAction": (lambda actions: actions / 2, WIDE),
    "TransformObservation": (lambda observations: observations / 2,),
    "TransformReward": (lambda rewards: rewards / 2,),
}
VECTORIZED: dict[str, dict[str, Any]] = {
    "TransformAction": {"func": lambda action: action / 2, "action_space": WIDE},
    "TransformObservation": {"func": lambda observation: observation / 2, "observation_space": None},
    "TransformReward": {"func": lambda reward: reward / 2},
}


def shots_of(envs: Any, steps: int) -> tuple[list[float], list[float], list[float]]:
    """Returns the true returns of the episodes, the returns in the infos, and the discounted return after each shot."""
    envs.reset(seed=0)
    plain = envs.unwrapped
    totals, since, over = np.zeros(4), np.zeros(4), np.zeros(4, bool)
    returns, recorded, discounted = [], [], []
    rng, step = np.random.default_rng(0), plain.step

    def counted(actions):
        nonlocal over
        plays, result = ~over | (plain.autoreset_mode is not AutoresetMode.NEXT_STEP), step(actions)
        since[plays] = 0.99 * since[plays] + result[1][plays]
        discounted.extend(since[plays].tolist())
        totals[...] += result[1]
        over = result[2]
        returns.extend(totals[over].tolist())
        totals[over] = since[over] = 0.0
        return result

    plain.step = counted
    for _ in range(steps):
        infos = envs.step(rng.uniform(-1, 1, (4, 2)))[4]
        if "episode" in infos:
            recorded += infos["episode"]["r"][over].tolist()
        if plain.autoreset_mode is AutoresetMode.DISABLED and over.any():
            envs.reset(options={"reset_mask": over.copy()})
            over = np.zeros(4, bool)
    return returns, recorded, discounted


def outcome(name: str, mode: str) -> str:
    """Returns "yes", "no" for an error, or "wrong" for wrong numbers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        envs = make_vector_env(4, mode, **SOFT)
        try:
            kind, wrap = name.removeprefix("Vectorize"), getattr(wrappers, name)
            if kind != name:
                wrapped = wrap(envs, getattr(single_wrappers, kind), **VECTORIZED[kind])
            else:
                wrapped = wrap(envs, *ARGUMENTS.get(name, ()))
            returns, recorded, discounted = shots_of(wrapped, 20)
        except (AssertionError, TypeError, ValueError):
            return "no"
    assert len(returns) > 10
    if name == "RecordEpisodeStatistics":
        return "yes" if np.allclose(returns, recorded) and len(returns) == len(recorded) else "wrong"
    if name == "NormalizeReward":
        rms, true = wrapped.return_rms, np.array([len(discounted), np.mean(discounted), np.var(discounted)])
        return "yes" if np.allclose((rms.count, rms.mean, rms.var), true, rtol=1e-3, atol=1e-4) else "wrong"
    return "yes"


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", TABLE)
def test_the_table_of_wrappers(name, mode):
    cell, installed = TABLE[name][mode], tuple(map(int, gym.__version__.split(".")[:2]))
    if version := re.fullmatch(r"from (\d+)\.(\d+) on", cell):
        cell = "yes" if installed >= tuple(map(int, version.groups())) else "yes or wrong"
    assert outcome(name, mode) in cell


@pytest.mark.parametrize(
    ("version", "mode", "count"), [("1.3.0", "SameStep", 1), ("1.3.0", "NextStep", 0), ("1.4.0", "SameStep", 0)]
)
def test_a_gymnasium_with_wrong_returns_warns_once(version, mode, count, monkeypatch):
    monkeypatch.setattr(gym, "__version__", version)
    vector.warn_of_wrong_returns.cache_clear()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(2):
            make_vector_env(2, mode)
    assert [str(one.message)[:16] for one in caught] == [f"Gymnasium {version}:"] * count
