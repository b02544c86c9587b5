"""The strategies as players of games, see `players.named`.

In a game with called shots, a strategy simulates its shot and calls the first ball that the shot pots and that may be
called. No strategy plays a safety or a push out, or hands a shot back.

With the cue ball in hand, a geometric or search player draws some places and chooses the one with the easiest pot.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from billiards_env.games import GameState, Setup, Stroke, play
from billiards_env.games.batch import PlayedBatch, best_call, play_batch
from billiards_env.games.placement import Point, cue_ball_area, cue_ball_point
from billiards_env.games.state import is_in, on_table
from billiards_env.players.aim import FirstTouch, Pot, carom_goals
from billiards_env.players.pots import PotShots
from billiards_env.players.strategies import Situation, find_strategy, full_hit

Floats = NDArray[np.float64]
Player = Callable[[Setup, GameState, float, np.random.Generator], Stroke]

_PLACES = 30  # random places for a cue ball in hand


def strategic(setup: Setup, text: str, noise: tuple[float, float]) -> Player:
    """Returns a player with a strategy.

    Raises:
        ValueError: If there is no such strategy, or it is "geometric" and the table has no pockets.
    """
    strategy = find_strategy(text, noise)
    if text == "geometric" and not setup.game_rules.pockets:
        raise ValueError(f"player = 'geometric' with rules = {setup.rules!r}: expected a game with pockets")

    def stroke(setup: Setup, game: GameState, max_speed: float, rng: np.random.Generator) -> Stroke:
        if text == "random":
            action, place = strategy(game_situation(setup, game, max_speed), rng), draw_place(setup, game, rng)
        else:
            game, place = place_cue_ball(setup, game, max_speed, rng)
            action = strategy(game_situation(setup, game, max_speed), rng)
        return with_call(setup, game, make_stroke(max_speed * action, max_speed, place))

    return stroke


def game_situation(setup: Setup, game: GameState, max_speed: float) -> Situation:
    """Returns the situation of the player to shoot, rated by the rules. In `game` a cue ball in hand is placed."""
    balls, state = np.arange(len(game.positions)), game.state

    def rate(actions: Floats) -> Floats:
        lengths = np.maximum(np.hypot(actions[:, 0], actions[:, 1]), 1.0)
        return _ratings(state.player, play_batch(setup, game, max_speed * actions / lengths[:, None]))

    situation = Situation(
        setup.scene,
        game.positions,
        ~is_in(on_table(state), len(balls)),
        np.isin(balls, setup.legal(state)),
        max_speed,
        rate,
        int(state.cue_balls[0]),
    )
    targets = np.flatnonzero(situation.targets & ~situation.off_table).tolist()
    goals = carom_goals(targets, cushions=setup.game_rules.cushions)
    if setup.game_rules.pockets:  # the pots of a break depend on rounding
        goals = () if state.break_shot else tuple((FirstTouch(ball), Pot(ball)) for ball in targets)
    strike = setup.scene.physics.motion == "sliding"
    return situation._replace(tried_first=full_hit(situation)[None], goals=goals, strike=strike)


def make_stroke(velocity: Floats, max_speed: float, place: Point | None) -> Stroke:
    """Returns a stroke with a velocity (2,), m/s, whose speed is limited to `max_speed`."""
    x, y = (velocity * min(1.0, max_speed / max(np.hypot(*velocity), 1e-9))).tolist()
    return Stroke((x, y), place)


def with_call(setup: Setup, game: GameState, stroke: Stroke) -> Stroke:
    """Returns a stroke that calls the first callable ball that it pots, if the game has called shots."""
    if not game.state.call_shot:
        return stroke
    return stroke._replace(call=best_call(setup, game.state, play(setup, game, stroke).pots))


def draw_place(setup: Setup, game: GameState, rng: np.random.Generator) -> Point | None:
    """Returns a random place for a cue ball in hand, m; None if it is not in hand."""
    state = game.state
    if not state.in_hand:
        return None
    x_low, x_high, y_low, y_high = cue_ball_area(setup.scene, state)
    return x_low + (x_high - x_low) * rng.random(), y_low + (y_high - y_low) * rng.random()


def place_cue_ball(
    setup: Setup, game: GameState, max_speed: float, rng: np.random.Generator
) -> tuple[GameState, Point | None]:
    """Draws some random places for a cue ball in hand, and places it at the one with the easiest pot.

    Returns:
        The game with the cue ball at this place, and the place, m; the unchanged game and None if it is not in hand.
    """
    games: list[tuple[GameState, Point | None]] = []
    for _ in range(_PLACES):
        drawn = draw_place(setup, game, rng)
        if drawn is None:
            return game, None
        positions, place = game.positions.copy(), cue_ball_point(setup.scene, game.positions, game.state, drawn)
        positions[game.state.cue_balls[0]] = place
        games.append((GameState(positions, game.state), place))
    return max(games, key=lambda entry: _pot_key(game_situation(setup, entry[0], max_speed).pots()))


def _pot_key(pots: PotShots) -> tuple[bool, float]:
    """Returns a key that is larger for easier pots, from the best pot: no scratch first, then the tolerance."""
    return (not pots.scratch[0], pots.tolerance[0]) if len(pots.speed) else (False, 0.0)


def _ratings(player: int, played: PlayedBatch) -> Floats:
    """Returns the values (m,) of shots for their player, from the win, the points, another turn and a foul."""
    verdicts, winner = played.verdicts, played.states["winner"]
    won = np.where(winner < 0, 0.0, np.where(winner == player, 100.0, -100.0))
    points = 2.0 * (verdicts["points"] - verdicts["penalty"])
    return won + points + verdicts["continues"] - 5.0 * (verdicts["foul"] > 0)
