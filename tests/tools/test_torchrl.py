"""TorchRL reads the environments and their infos."""

from typing import Any

import gymnasium as gym
import pytest

from billiards_env.bench.frozen import FROZEN, NAMESPACE

pytestmark = [pytest.mark.tools, pytest.mark.filterwarnings("ignore")]

ID = "billiards_env:Billiards-v0"
INFO = {"shot_time", "n_events", "status_code", "first_hit", "cushions", "potted", "scratch", "points", "score"}
INFO |= {"shots_left", "is_success", "played_action"}
lengths = pytest.mark.parametrize("max_shots", [1, 3])


def played(env) -> Any:
    """Returns the steps of an environment that passes the checker of TorchRL."""
    from torchrl.envs import check_env_specs  # pyright: ignore[reportMissingImports]

    check_env_specs(env)
    steps = env.rollout(5, break_when_any_done=False)
    env.close()
    return steps["next"]


@lengths
def test_a_reader_of_all_infos(max_shots):
    from torchrl.envs import GymEnv  # pyright: ignore[reportMissingImports]

    steps = played(GymEnv(ID, max_shots=max_shots).auto_register_info_dict())
    assert {*steps.keys()} >= INFO
    assert (steps["shots_left"] == max_shots - 1).any()


@lengths
def test_several_environments_in_processes(max_shots):
    from torchrl.envs import GymEnv  # pyright: ignore[reportMissingImports]

    steps = played(GymEnv(ID, num_envs=3, max_shots=max_shots))
    assert steps["observation"].shape == (3, 5, 4)


@lengths
@pytest.mark.parametrize("name", [ID, "Billiards/Pot1Noise-v0"])
def test_the_vector_environment(name, max_shots):
    from torchrl.envs import GymWrapper  # pyright: ignore[reportMissingImports]

    steps = played(GymWrapper(gym.make_vec(name, num_envs=3, max_shots=max_shots)))
    assert steps["observation"].shape == (3, 5, 4)
    assert steps["done"].sum() >= 3


@pytest.mark.parametrize("name", FROZEN)
def test_a_frozen_id_passes_the_checker(name):
    from torchrl.envs import GymEnv  # pyright: ignore[reportMissingImports]

    played(GymEnv(NAMESPACE + name))
