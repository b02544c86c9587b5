"""What a player gets: a `Situation`. A player is a function `(situation, rng) -> Stroke`.

`game_situation` makes it from the state of a game, `players.env_player.env_situation` from an environment.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.envs.actions import PLAYED, action_named
from billiards_env.games import GameState, Setup, Stroke, play
from billiards_env.games.game_state import is_in, on_table
from billiards_env.games.placement import Point, cue_ball_area, cue_ball_point
from billiards_env.games.playing import check_stroke
from billiards_env.players.aim import FirstTouch, Goal, Pot, carom_goals
from billiards_env.players.batch import best_call, play_batch
from billiards_env.players.hints import only_banks
from billiards_env.pots.finder import PotShots, pot_shots
from billiards_env.shots.tables import Tables
from billiards_env.support.checks import finite, one_of, result_of, short

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Noise = tuple[float, float]

PLACES = 30
"""The number of random places for a cue ball in hand."""


class Situation(NamedTuple):
    """A table before a shot, and how a shot is played and scored.

    A situation of an environment is valid until its next step.

    Attributes:
        table: The table; k is 1.
        action: The kind of action, one of `envs.actions.ACTIONS`.
        strike: Whether a cue strikes the cue ball, which can give it spin and drives balls that touch it.
        rate: A function that simulates (m, a) actions and returns (m,) ratings; larger is better. In an environment
            a generator may follow, from which the noise of the environment is drawn.
        stroke: A function that returns the stroke of an action (a,). In a game with called shots it simulates the shot,
            and calls the first callable ball that it pots.
        find_game: A function that returns the game and its state. In a task with rules it is the game of these rules.
            In other tasks it raises a ValueError.
        goals: Several ways to score: the goals of each.
        noise: The expected execution noise: standard deviations of the direction, degrees, and of the speed, m/s.
        in_game: Whether it is a shot of a game, and not of a task.
        run_out: Whether only the present turn counts.
        banks: Whether only banks score.
        place: x and y of the point where `stroke` places a cue ball in hand, m; None if it is not chosen yet.
        observe: A function that returns the observation of the environment. In the window it is that of
            `env_player.game_observation`, which compiles an environment at first. None outside of both.
        watch: A function to which a player may pass the shots that it considers, a tuple of `planner.Plan`, the best
            first. The window shows these shots. None outside the window.
    """

    table: Tables
    action: str
    strike: bool
    rate: Callable[..., Floats]
    stroke: Callable[[Any], Stroke]
    find_game: Callable[[], tuple[Setup, GameState]]
    goals: tuple[tuple[Goal, ...], ...]
    noise: Noise = (0.0, 0.0)
    in_game: bool = False
    run_out: bool = False
    banks: bool = False
    place: Point | None = None
    observe: Callable[[], Any] | None = None
    watch: Callable[[Any], None] | None = None

    @property
    def observation(self) -> Any:
        """The observation, see `observe`; None without one."""
        return None if self.observe is None else self.observe()

    @property
    def action_size(self) -> int:
        """The number of numbers of an action. Raises a ValueError if the environment converts its actions."""
        one_of("action of the environment of a player", self.action, PLAYED)
        return action_named(self.action).size

    def pots(self, jumps: bool = False) -> PotShots:
        """Returns the direct pots, or the pots off one cushion if no direct pot is possible or scores, best first.

        With `jumps` only the targets can block a path, because the cue ball jumps over the other balls.
        """
        table = self.table
        if jumps:
            on_table = table.targets.copy()
            on_table[:, table.cue] = True
            table = table._replace(in_play=on_table)
        return pot_shots(table, direct=not self.banks)

    def full_hit(self) -> Floats:
        """Returns the direction (2,) to the target nearest to the cue ball."""
        (way,) = self.table.nearest()[1]
        return way / np.hypot(*way)


Player = Callable[[Situation, np.random.Generator], Stroke]


def stroke_of(player: Player, situation: Situation, rng: np.random.Generator) -> Stroke:
    """Returns the stroke of a player.

    Raises a TypeError or a ValueError if it is no `Stroke` or has wrong numbers. Errors of the player pass unchanged.
    """
    stroke = result_of(name := f"stroke of {short(player)}", object, player, situation, rng)
    if not isinstance(stroke, Stroke):
        raise TypeError(f"{name} = {short(stroke)}: expected a Stroke, a player returns situation.stroke(action)")
    check_stroke(situation.table.scene, stroke, f" of {short(player)}")
    return stroke


def game_situation(
    setup: Setup, game: GameState, max_speed: float, noise: Noise = (0.0, 0.0), place: Point | None = None
) -> Situation:
    """Returns the situation of the player to shoot, rated by the rules. Actions are velocities.

    Args:
        setup: The game.
        game: Its state.
        max_speed: Speed of the fastest shot, m/s.
        noise: The expected execution noise: standard deviations of the direction, degrees, and of the speed, m/s.
        place: As in `Situation`. The ratings are those of shots from the position of the cue ball in `game`.
    """
    balls, state, sliding = np.arange(len(game.positions)), game.state, setup.scene.physics.motion == "sliding"
    in_play, legal = is_in(on_table(state), len(balls)), np.isin(balls, setup.legal(state))

    def rate(actions: Floats) -> Floats:
        lengths = np.maximum(np.hypot(actions[:, 0], actions[:, 1]), 1.0)
        played = play_batch(setup, game, max_speed * actions / lengths[:, None])
        verdicts, points = played.verdicts, played.verdicts["points"] - played.verdicts["penalty"]
        return rating(state.player, played.states["winner"], points, verdicts["continues"], verdicts["foul"] > 0)

    def stroke(action: Any) -> Stroke:
        return game_stroke(setup, game, max_speed * finite("action", action, (2,)), max_speed, place)

    targets, rules = np.flatnonzero(legal & in_play).tolist(), setup.game_rules
    goals = carom_goals(targets, rules.cushions)
    if rules.pockets:  # the pots of a break depend on rounding
        goals = () if state.break_shot else tuple((FirstTouch(ball), Pot(ball)) for ball in targets)
    return Situation(
        table=Tables(setup.scene, game.positions[None], in_play[None], legal[None], max_speed, int(state.cue_balls[0])),
        action="velocity",
        strike=sliding,
        rate=rate,
        stroke=stroke,
        find_game=lambda: (setup, game),
        goals=goals,
        noise=noise,
        in_game=True,
        banks=only_banks(setup),
        place=place,
    )


def game_stroke(setup: Setup, game: GameState, velocity: Floats, max_speed: float, place: Point | None) -> Stroke:
    """Returns the stroke with a velocity (2,), m/s, whose speed is limited to `max_speed`.

    In a game with called shots it calls the first callable ball that it pots.
    """
    x, y = (velocity * min(1.0, max_speed / max(np.hypot(*velocity), 1e-9))).tolist()
    stroke = Stroke((x, y), place)
    if not game.state.call_shot:
        return stroke
    return stroke._replace(call=best_call(setup, game.state, play(setup, game, stroke)))


def placed(situation: Situation, rng: np.random.Generator, places: int = PLACES) -> Situation:
    """Returns the situation with a cue ball in hand at a place: of some random ones that with the easiest pot."""
    if not situation.in_game or situation.place is not None:
        return situation
    (setup, game), situations = situation.find_game(), []
    if not game.state.in_hand:
        return situation
    for place in draw_places(setup, game, rng, places):
        positions = game.positions.copy()
        positions[situation.table.cue] = place
        moved = GameState(positions, game.state)
        situations.append(game_situation(setup, moved, situation.table.max_speed, situation.noise, place))
    return max(situations, key=lambda one: _pot_key(one.pots()))


def draw_places(setup: Setup, game: GameState, rng: np.random.Generator, count: int) -> list[Point]:
    """Returns random places for a cue ball in hand, m."""
    x_low, x_high, y_low, y_high = cue_ball_area(setup.scene, game.state)
    drawn = rng.uniform((x_low, y_low), (x_high, y_high), (count, 2)).tolist()
    return [cue_ball_point(setup.scene, game.positions, game.state, (x, y)) for x, y in drawn]


def _pot_key(pots: PotShots) -> tuple[bool, float]:
    """Returns a key that is larger for easier pots, from the best pot: no scratch first, then the tolerance."""
    return (not pots.scratch[0], pots.tolerance[0]) if len(pots.speed) else (False, 0.0)


def rating(player: int, winner: Ints, points: Ints, continues: Bools, foul: Bools) -> Floats:
    """Returns the values (m,) of shots for their player, from the win, the points, another turn and a foul."""
    won = np.where(winner < 0, 0.0, np.where(winner == player, 100.0, -100.0))
    return won + 2.0 * points + continues - 5.0 * foul
