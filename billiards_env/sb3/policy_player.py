"""A trained policy as a player: `billiards play --scene pool --players human,policy:runs/pot`.

In an environment it gets the observation. In a game it gets that of a similar table:

`AimPolicy` plays with any number of balls. If it was trained with one object ball, it observes each legal ball as if
this ball were alone with the cue ball, and plays the one with the largest value. Otherwise it observes all balls.

With a number of proposals, as in `policy:runs/pot:16`, the player simulates as many actions of the policy and plays the
best one. In a run-out the critic of an `AimPolicy` values the position after a shot.

Another policy must be trained with one object ball for a game with pockets, and then observes the nearest legal ball.
In a carom game a policy must be trained with two object balls.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray

from billiards_env.envs import BilliardsEnv
from billiards_env.envs.actions import action_named
from billiards_env.games import GAMES, GameState, Setup, Stroke, members
from billiards_env.games.game_state import NOT_IN_HAND, changed
from billiards_env.players.env_player import begin_at
from billiards_env.players.named import PlayerEntry
from billiards_env.players.situation import PLACES, Noise, Player, Situation, draw_places, game_situation, placed
from billiards_env.players.strategies import best_of
from billiards_env.sb3.aim_network import Mixture
from billiards_env.sb3.aim_policy import AimPolicy, arguments_of
from billiards_env.sb3.weights import check_finished, load_policy
from billiards_env.scene import Scene
from billiards_env.settings import read_settings
from billiards_env.shots.tables import Tables
from billiards_env.support.checks import Range, integer

MOST_PROPOSALS = 100_000


Prepare = Callable[[Situation, np.random.Generator], Situation]
"""A function that returns a situation with a place for a cue ball in hand and the ratings of a policy."""

Propose = Callable[[Situation, int, np.random.Generator], NDArray[np.float64]]
"""A function that returns k actions (k, a) for a situation, the best guess first."""


def policy(argument: str, where: Setup | gym.Env[Any, Any]) -> Player:
    """Returns the player of a trained policy.

    Args:
        argument: The folder of the run, with `config.yaml` and `policy.pt`. A colon and a whole number k may follow,
            unless there is a folder of the whole name. The player then simulates k actions that the policy proposes,
            and `strategies.best_of` chooses.
        where: The game, or the environment, whose arguments replace those of the training.

    Raises:
        OSError: If the folder holds no finished run.
        TypeError: As in `load_policy`.
        ValueError: As in `load_policy`, or if k is not from 1 to `MOST_PROPOSALS`. In a game also if the policy was
            trained on another table, with another number of balls, for strikes, with a goal or with an observation of
            the physics.
    """
    folder, _, number = argument.rpartition(":")
    if Path(argument).is_dir() or not number.isdecimal():
        folder, number = argument, "1"
    count = integer("number of proposals", int(number), Range(1, MOST_PROPOSALS))
    prepare, propose = _in_games(folder, where) if isinstance(where, Setup) else _in_environments(folder, where)

    def player(situation: Situation, rng: np.random.Generator) -> Stroke:
        with _one_thread():
            situation = prepare(situation, rng)
            actions = propose(situation, count, rng)
            return situation.stroke(actions[0]) if count == 1 else best_of(situation, actions, rng)

    return player


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """PyTorch uses one thread within this context: several are slower for the observation of one table."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def arguments_of_run(name: str) -> dict[str, Any]:
    """Returns the arguments of the environment of the run of a player "policy:FOLDER"."""
    folder = name.partition(":")[2]
    if not Path(folder).is_dir():
        folder = folder.rpartition(":")[0]
    check_finished(Path(folder))
    return dict(read_settings(Path(folder, "config.yaml"), "the settings of a run").get("env") or {})


POLICY = PlayerEntry(policy, argument="")


def _in_environments(folder: str, where: gym.Env[Any, Any]) -> tuple[Prepare, Propose]:
    """Returns the functions of a policy in an environment.

    The first one only rates the shots of a run-out with the critic. In other tasks a miss does not end the episode.
    """
    base: Any = where.unwrapped
    model: Any = load_policy(folder, arguments_of(base))[1]

    def propose(situation: Situation, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        return proposals(model, situation.observation, count, rng)

    def rate(actions: NDArray[np.float64], noise: np.random.Generator | None = None) -> NDArray[np.float64]:
        return model.returns(base.try_actions(actions, noise=noise))

    if not isinstance(model, AimPolicy) or "legal_balls" not in model.observe or base.model.n_players > 1:
        return lambda situation, rng: situation, propose
    return lambda situation, rng: situation._replace(rate=rate), propose


def proposals(model: Any, observation: Any, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Returns (count, a) actions of a policy for an observation: the one without exploration, then random ones.

    The actions of an `AimPolicy` are those of `Mixture.proposals`.
    """
    first = np.asarray(model.predict(observation, deterministic=True)[0], np.float64)[None]
    if count == 1:
        return first
    seed = int(rng.integers(2**63))
    if isinstance(model, AimPolicy):
        mixture = model.get_distribution(torch.as_tensor(observation)[None])
        return np.concatenate((first, _drawn(mixture, count, seed)[1:]))
    many = np.repeat(np.asarray(observation)[None], count - 1, axis=0)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return np.concatenate((first, np.asarray(model.predict(many, deterministic=False)[0], np.float64)))


def _drawn(mixture: Mixture, count: int, seed: int) -> NDArray[np.float64]:
    with torch.no_grad():
        drawn = mixture.proposals(count, torch.Generator().manual_seed(seed))
    return drawn.clamp(-1, 1).numpy().astype(np.float64)


def _in_games(argument: str, setup: Setup) -> tuple[Prepare, Propose]:
    """Returns the functions of a policy in a game, see the module."""
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
    if "physics" in base.features or action_named(base.action).has_cue or len(base.goals):
        raise ValueError(
            f"player = 'policy:{argument}': expected a policy trained without observed physics, strikes or a goal"
        )
    if isinstance(model, AimPolicy) and base.model.setup is not None and base.task == setup.rules:
        noise = read_settings(folder / "config.yaml", "the settings of a run")["noise"]
        return _in_its_game(model, base, (noise["angle_std"], noise["speed_std"]) if noise else (0.0, 0.0))

    def propose(situation: Situation, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        setup, game = situation.find_game()
        if isinstance(model, AimPolicy):
            actions = _aimed(model, situation.table, count, rng)
        else:
            balls = situation.table.nearest()[0] if setup.game_rules.pockets else members(game.state.object_balls)
            observation, _ = env.reset(options={"positions": game.positions[[situation.table.cue, *balls]]})
            actions = proposals(model, observation, count, rng)
        return base.max_speed / situation.table.max_speed * actions

    return placed, propose


def _in_its_game(model: AimPolicy, env: BilliardsEnv, noise: Noise) -> tuple[Prepare, Propose]:
    """Returns the functions of a policy in the game of its training, under the noise of its training."""

    def prepare(situation: Situation, rng: np.random.Generator) -> Situation:
        (setup, game), fastest = situation.find_game(), situation.table.max_speed
        observation = begin_at(env, game)
        if game.state.in_hand:
            places, positions = draw_places(setup, game, rng, PLACES), game.positions.copy()
            (best,) = model.best_places(np.array([places]), **model.seen(torch.as_tensor(observation)[None]))
            positions[situation.table.cue] = places[best]
            situation = game_situation(setup, GameState(positions, game.state), fastest, place=places[best])
            observation = begin_at(env, GameState(positions, changed(game.state, in_hand=NOT_IN_HAND)))

        def rate(actions: NDArray[np.float64]) -> NDArray[np.float64]:
            return model.returns(env.try_actions(fastest / env.max_speed * actions))

        return situation._replace(observe=lambda: observation, rate=rate, noise=noise)

    def propose(situation: Situation, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        return env.max_speed / situation.table.max_speed * proposals(model, situation.observation, count, rng)

    return prepare, propose


def playable(run_dir: Path) -> str | None:
    """Returns the rules of a game that the policy of a run can play; None if it can play no game."""
    for rules in ("straight", "carom"):
        name, (_, balls) = GAMES[rules].scene, GAMES[rules].n_object_balls
        with contextlib.suppress(ValueError):
            policy(str(run_dir), Setup(rules, Scene.named(name, balls)))
            return rules
    return None


def _aimed(model: AimPolicy, table: Tables, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Returns (count, 2) actions of a policy for the balls on the table."""
    (targets,), others = table.targets, table.in_play[0].copy()
    others[table.cue] = False
    seen = np.flatnonzero(targets)[:, None] if model.game.scene.n_balls == 2 else np.flatnonzero(others)[None]
    flags = torch.tensor(targets[seen])
    places = torch.tensor(table.positions[0] / np.array(model.game.scene.half_extents), dtype=torch.float32)
    observed = places[np.insert(seen, 0, table.cue, axis=1)]
    with torch.no_grad():
        others = {"shots_left": torch.ones(len(seen)), "in_hand": torch.zeros(len(seen), 2)}
        mixtures, values = model.net(observed, flags, legal_balls=flags.float(), **others)
        first = mixtures.mode()[values.argmax()].clamp(-1, 1).numpy().astype(np.float64)[None]
        if count == 1:
            return first
        return np.concatenate((first, _drawn(mixtures.joined(values), count - 1, int(rng.integers(2**63)))))
