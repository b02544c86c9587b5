"""A trained policy as a player of games: `billiards play --scene pool --players human,policy:runs/pot`.

`AimPolicy` plays with any number of balls. If it was trained with one object ball, it observes each legal ball as if
this ball were alone with the cue ball, and plays the one with the largest value. Otherwise it observes all balls.

Another policy must be trained with one object ball for a game with pockets, and then observes the nearest legal ball.
In a carom game a policy must be trained with two object balls.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray

from billiards_env.games import GAMES, GameState, Setup, Stroke, members
from billiards_env.players.game_player import Player, make_stroke, place_cue_ball, with_call
from billiards_env.sb3.aim_policy import AimPolicy, arguments_of
from billiards_env.sb3.weights import load_policy
from billiards_env.scene import Scene


def policy(setup: Setup, argument: str) -> Player:
    """Returns the player of a trained policy.

    Args:
        setup: The game.
        argument: The folder of the run, with `config.yaml` and `policy.pt`.

    Raises:
        OSError: If the folder holds no finished run.
        ValueError: If the policy was trained on another table, with another number of balls, for strikes, with a goal
            or with an observation of the physics.
    """
    folder = Path(argument)
    if not argument or not (folder / "policy.pt").is_file():
        raise FileNotFoundError(
            f"player = 'policy:{argument}': expected 'policy:' and the folder of a finished run, with a policy.pt"
        )
    arguments, model = load_policy(folder)
    env = gym.make("billiards_env:Billiards-v0", **arguments)
    base: Any = env.unwrapped
    expected = 1 if setup.game_rules.pockets else 2
    trained, played = base.scene, setup.scene
    error = f"player = 'policy:{argument}' with rules = {setup.rules!r}: expected"
    aims = isinstance(model, AimPolicy) and setup.game_rules.pockets
    if trained.n_balls != 1 + expected and not aims:
        balls = f"{expected} object ball{'s' if expected > 1 else ''}"
        raise ValueError(f"{error} a policy trained with {balls}, not {trained.n_balls - 1}")
    if trained.table != played.table or trained.balls.radius[:2] != played.balls.radius[:2]:
        raise ValueError(
            f"{error} the table and the balls of its training; --scene of billiards play, for example --scene pool, "
            "chooses them"
        )
    if "physics" in base.features or base.action == "strike" or len(base.goals):
        raise ValueError(
            f"player = 'policy:{argument}': expected a policy trained without observed physics, strikes or a goal"
        )

    def stroke(setup: Setup, game: GameState, max_speed: float, rng: np.random.Generator) -> Stroke:
        game, place = place_cue_ball(setup, game, max_speed, rng)
        if isinstance(model, AimPolicy):
            action = _aimed(model, setup, game)
        else:
            cue = int(game.state.cue_balls[0])
            balls = [_nearest(setup, game)] if setup.game_rules.pockets else list(members(game.state.object_balls))
            observation, _ = env.reset(options={"positions": game.positions[[cue, *balls]]})
            action, _ = model.predict(observation, deterministic=True)
        velocity = base.max_speed * np.asarray(action, np.float64)
        return with_call(setup, game, make_stroke(velocity, max_speed, place))

    return stroke


def task_policy(env: gym.Env[Any, Any], argument: str) -> Callable[[NDArray[np.float32]], NDArray[np.float32]]:
    """Returns the player `act(observation) -> action` of a trained policy in an environment.

    Args:
        env: The environment. Its arguments replace those of the training.
        argument: As in `policy`.

    Raises:
        OSError, TypeError, ValueError: As in `load_policy`.
    """
    base: Any = env.unwrapped
    model = load_policy(argument, arguments_of(base))[1]
    return lambda observation: model.predict(observation, deterministic=True)[0]


def playable(run_dir: Path) -> str | None:
    """Returns the rules of a game that the policy of a run can play; None if it can play no game."""
    for rules in ("straight", "carom"):
        name, (_, balls) = GAMES[rules].scene, GAMES[rules].n_object_balls
        with contextlib.suppress(ValueError):
            policy(Setup(rules, Scene.named(name, balls)), str(run_dir))
            return rules
    return None


def _aimed(model: AimPolicy, setup: Setup, game: GameState) -> NDArray[np.float32]:
    """Returns the action of a policy for the balls on the table."""
    state = game.state
    cue, balls = int(state.cue_balls[0]), members(state.object_balls)
    legal = setup.legal(state) if setup.game_rules.pockets else balls
    tables = torch.tensor([[cue, ball] for ball in legal] if model.game.scene.n_balls == 2 else [[cue, *balls]])
    flags = torch.tensor([[ball in legal for ball in table[1:]] for table in tables.tolist()])
    places = torch.tensor(game.positions / np.array(model.game.scene.half_extents), dtype=torch.float32)
    with torch.no_grad():
        mixtures, values = model.net(
            places[tables], flags, legal_balls=flags.float(), shots_left=torch.ones(len(tables))
        )
        return mixtures.mode()[values.argmax()].clamp(-1, 1).numpy()


def _nearest(setup: Setup, game: GameState) -> int:
    """Returns the legal ball that is nearest to the cue ball."""
    cue = game.positions[game.state.cue_balls[0]]
    return min(setup.legal(game.state), key=lambda ball: float(np.hypot(*(game.positions[ball] - cue))))
