"""Programs to play against in `python -m billiards_env.play`, for `--players`.

* "geometric" plays the direct pot that leaves most room for error; where there is none it hits a ball that it may hit,
  full and hard. It needs pockets.
* "search:K" plays K shots on the engine, lets the game's own rules judge them, and takes the best; K is 200
  unless given.
* "policy:FOLDER" is an agent trained on `Billiards-v0`, by the folder of its run. In a game of pockets it has to be
  trained with one object ball, and is shown the ball that it may hit and that is nearest to the cue ball; in a carom
  game it has to be trained with two.

With the cue ball in hand all of them draw some places, and take the one from which a pot is easiest.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from billiards_env.games import GameState, PlayedShot, Setup, Stroke, play
from billiards_env.games.placement import Point, cue_ball_point
from billiards_env.play.players import Player, any_place
from billiards_env.players.pots import Pots, direct_pots

Floats = NDArray[np.float64]

_PLACES = 30  # tried with the cue ball in hand
_SHOTS = 200


def geometric(setup: Setup, argument: str = "") -> Player:
    """A player of direct pots, see the module's docstring.

    Args:
        setup: The game.
        argument: None is taken.

    Returns:
        The player.

    Raises:
        ValueError: If there is an argument, or the game is one without pockets.
    """
    if argument:
        raise ValueError(f"player 'geometric:{argument}': expected 'geometric', it takes no argument")
    if not setup.game_rules.pockets:
        raise ValueError(f"player 'geometric' with rules {setup.rules!r}: expected a game of pockets")

    def stroke(setup: Setup, table: GameState, max_speed: float, rng: np.random.Generator) -> Stroke:
        table, place, pots = _put(setup, table, max_speed, rng)
        velocity = pots.speed[0] * pots.direction[0] if len(pots.speed) else max_speed * _full_hit(setup, table)
        return _stroke(velocity, place)

    return stroke


def search(setup: Setup, argument: str = "") -> Player:
    """A player who tries shots, see the module's docstring.

    Args:
        setup: The game.
        argument: How many shots it tries, a whole number >= 1; "" for 200.

    Returns:
        The player.

    Raises:
        ValueError: If the argument is no such number.
    """
    shots = int(argument) if argument.isdecimal() else 0 if argument else _SHOTS
    if shots < 1:
        raise ValueError(f"player 'search:{argument}': expected a whole number of shots >= 1")

    def stroke(setup: Setup, table: GameState, max_speed: float, rng: np.random.Generator) -> Stroke:
        table, place, pots = _put(setup, table, max_speed, rng)
        angles, speeds = 2 * np.pi * rng.random(shots), max_speed * (0.1 + 0.9 * rng.random(shots))
        velocities = speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
        velocities[0] = max_speed * _full_hit(setup, table)
        known = min(len(pots.speed), shots // 2)
        velocities[1 : 1 + known] = pots.speed[:known, None] * pots.direction[:known]
        strokes = [_stroke(velocity, place) for velocity in velocities]
        return max(strokes, key=lambda s: _worth(setup, table, play(setup, table, s)))

    return stroke


def policy(setup: Setup, argument: str) -> Player:
    """A trained agent, see the module's docstring.

    Args:
        setup: The game.
        argument: The folder of its run.

    Returns:
        The player.

    Raises:
        OSError: If the folder holds no finished run.
        ValueError: If the agent is trained for another table or another number of balls.
    """
    # PyTorch is needed by a trained agent alone.
    from agents.ppo import load_policy, make_env

    folder = Path(argument)
    if not argument or not (folder / "policy.pt").is_file():
        raise FileNotFoundError(f"player 'policy:{argument}': expected the folder of a finished run, with a policy.pt")
    config, model = load_policy(folder)
    env = make_env(config)
    game: Any = env.unwrapped
    wanted = 1 if setup.game_rules.pockets else 2
    scene, ours = game.scene, setup.scene
    if (
        scene.n_balls != 1 + wanted
        or scene.table != ours.table
        or scene.balls.radius != ours.balls.radius[: 1 + wanted]
    ):
        raise ValueError(
            f"player 'policy:{argument}' with rules {setup.rules!r}: expected an agent trained on the same table "
            f"with {wanted} object ball{'s' if wanted > 1 else ''}, not {scene.n_balls - 1}"
        )

    def stroke(setup: Setup, table: GameState, max_speed: float, rng: np.random.Generator) -> Stroke:
        table, place, _ = _put(setup, table, max_speed, rng)
        cue = table.state.cue_balls[0]
        balls = _nearest(setup, table)[:1] if setup.game_rules.pockets else sorted(table.state.object_balls)
        observation, _ = env.reset(options={"positions": table.positions[[cue, *balls]]})
        action, _ = model.predict(observation, deterministic=True)
        velocity = _base_action(env, action) * game.max_speed
        return _stroke(velocity * min(1.0, max_speed / max(np.hypot(*velocity), 1e-9)), place)

    return stroke


def _base_action(env: gym.Env[Any, Any], action: NDArray[Any]) -> Floats:
    """What the wrappers of an environment make of an action."""
    while isinstance(env, gym.Wrapper):
        if isinstance(env, gym.ActionWrapper):
            action = env.action(action)
        env = env.env
    return np.asarray(action, dtype=np.float64)


def _put(
    setup: Setup, table: GameState, max_speed: float, rng: np.random.Generator
) -> tuple[GameState, Point | None, Pots]:
    """The table with a cue ball in hand put down, where it was put, and the direct pots from there, best first."""
    state, cue = table.state, table.state.cue_balls[0]
    tables: list[tuple[GameState, Point | None]] = [(table, None)]
    if state.in_hand != "no":
        tables = []
        for _ in range(_PLACES):
            wish = any_place(setup, table, rng)
            assert wish is not None
            place = cue_ball_point(
                setup.scene, table.positions, state.object_balls, cue, wish, state.in_hand == "behind"
            )
            positions = table.positions.copy()
            positions[cue] = place
            tables.append((GameState(positions, state), place))
    found = [(*entry, _pots(setup, entry[0], max_speed)) for entry in tables]
    return max(found, key=lambda entry: _ease(entry[2]))


def _ease(pots: Pots) -> tuple[bool, float]:
    """How easy the best of some pots is: without a scratch first, then by the room that it leaves for error."""
    return (not pots.scratch[0], pots.tolerance[0]) if len(pots.speed) else (False, 0.0)


def _pots(setup: Setup, table: GameState, max_speed: float) -> Pots:
    every, state = np.arange(len(table.positions)), table.state
    targets = np.isin(every, sorted(setup.game_rules.legal(state, state.player)))
    potted = ~np.isin(every, sorted(state.on_table))
    return direct_pots(setup.scene, targets, table.positions, potted, max_speed)


def _nearest(setup: Setup, table: GameState) -> list[int]:
    """The balls that may be hit, the nearest to the cue ball first."""
    state = table.state
    cue = table.positions[state.cue_balls[0]]
    balls = sorted(setup.game_rules.legal(state, state.player))
    return sorted(balls, key=lambda ball: float(np.hypot(*(table.positions[ball] - cue))))


def _full_hit(setup: Setup, table: GameState) -> Floats:
    """The direction of the nearest ball that may be hit."""
    way = table.positions[_nearest(setup, table)[0]] - table.positions[table.state.cue_balls[0]]
    return way / np.hypot(*way)


def _stroke(velocity: Floats, place: Point | None) -> Stroke:
    x, y = velocity.tolist()
    return Stroke((x, y), place)


def _worth(setup: Setup, table: GameState, played: PlayedShot) -> float:
    """What a shot is worth to who plays it: the game, points, another shot, no foul."""
    player, verdict = table.state.player, played.verdict
    won = 0.0 if played.game.state.winner < 0 else 100.0 if played.game.state.winner == player else -100.0
    return won + 2.0 * verdict.points + verdict.continues - 5.0 * bool(verdict.foul)
