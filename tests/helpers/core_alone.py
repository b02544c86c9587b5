"""A program that uses the core of the package without the attachments, for `tests/test_core_alone.py`."""

import importlib.util
import re
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import billiards_env
from billiards_env import Engine, Scene, doors, envs, simulate, simulate_batch, strike
from billiards_env.envs.tasks import TASKS
from billiards_env.games import records as games
from billiards_env.shots import records as shots

ID, POOL = "billiards_env:Billiards-v0", Scene.named("pool", 1)
PLACES, HIT = np.array([[-0.635, 0.0], [0.635, 0.3]]), np.array([2.0, 0.45])


def play_shots() -> Any:
    """Plays shots with both engines, alone and in a batch, and writes and reads one. Returns it."""
    assert strike(POOL, 2.0, 0.1).velocity.shape == (2,)
    for engine in (Engine("pit", 1 / 60), Engine("pic")):
        shot = simulate(POOL, PLACES, HIT, engine=engine, record=True)
        batch = simulate_batch(POOL, PLACES[None], HIT[None], engine=engine, record=True)
        assert np.array_equal(batch[0].positions, shot.positions)
        assert np.array_equal(shot.at(shot.time), shot.positions)
        shot.save("shot.json")
        assert np.array_equal(games.replay(shots.load("shot.json")).positions, shot.positions)
    return shot


def play_tasks() -> None:
    """Plays each task in both environments, goes back to a state, and tries actions."""
    for task in TASKS:
        env: Any = gym.make(ID, task=task).unwrapped
        many: Any = gym.make_vec(ID, 2, task=task)
        env.reset(seed=0)
        many.reset(seed=0)
        action = 0.5 * np.ones(env.action_space.shape)
        state = env.get_state()
        tried = env.try_actions(action[None])
        observation, reward, *_ = env.step(action)
        assert (tried.rewards[0], many.step(np.stack((action, action)))[1][0]) == (reward, reward)
        env.set_state(state)
        assert np.array_equal(env.step(action)[0], observation)


def play_game() -> None:
    """Plays a few shots of a game of two, and writes and reads the game."""
    env: Any = gym.make(ID, task="nine_ball", n_players=2).unwrapped
    env.reset(seed=0)
    env.step(env.action_space.sample())
    if importlib.util.find_spec("pettingzoo") is None:
        return
    from billiards_env import billiards_v0

    view: Any = billiards_v0.raw_env(task="nine_ball")
    view.reset(seed=0)
    for _ in range(3):
        view.step(0.3 * np.ones(view.action_space(view.agent_selection).shape))
    games.save("game.json", games.record_game(view.history()))
    games.replay(games.load("game.json"))  # compares the ends


def knock(shot: Any) -> None:
    """Opens each door. Each raises the error that names its attachment."""
    opened = {
        "shot.plot": shot.plot,
        "shot.to_gif": lambda: shot.to_gif("shot.gif"),
        "shot.to_mp4": lambda: shot.to_mp4("shot.mp4"),
        "shot.to_html": lambda: shot.to_html("shot.html"),
        "shot._repr_html_": shot._repr_html_,
        "render_mode": lambda: gym.make(ID, render_mode="rgb_array"),
        "observe = 'pixels'": lambda: gym.make(ID, observe=[("pixels", 9, 9)]),
        "observe = 'planes'": lambda: gym.make_vec(ID, 2, observe=[("planes", 9, 9)]),
        "action = 'plan'": lambda: gym.make(ID, action="plan"),
        "billiards_env.register_player": lambda: billiards_env.register_player,
        "billiards_env.envs.RecordVideo": lambda: envs.RecordVideo,
    }
    for door, place in doors.DOORS.items():
        attachment = ".".join(place.split(".")[:2])
        message = f"{door}: expected the attachment {attachment}, which this installation does not contain"
        with pytest.raises(ModuleNotFoundError, match=f"^{re.escape(message)}$") as caught:
            opened.get(door, lambda door=door: doors.load(door))()
        assert caught.value.name == attachment
    assert not list(Path.cwd().glob("shot.[ghm]*"))


if __name__ == "__main__":
    assert Path(billiards_env.__file__).parents[1] == Path.cwd()
    knock(play_shots())
    play_tasks()
    play_game()
