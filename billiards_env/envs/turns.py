"""Games of several players: what a step does besides the shot, as kernels over many games.

An action has the numbers of the shot, then those of the place of a cue ball in hand, then those of the call. Before the
shot the kernels place the cue ball and make the call. After it the referee judges the shot, balls are spotted or racked
again, and the next player is set. The rules are in `billiards_env.games`. The same strokes in `games.play` give the
same bits.

A cue ball in hand lies at a free point near the head spot until the next shot, so that each observation has a valid
position.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.envs.actions import cue_strike
from billiards_env.envs.arguments import Model
from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.envs.info import InfoArrays
from billiards_env.envs.state import State, TurnArrays
from billiards_env.envs.tasks import write_legal_balls
from billiards_env.games.facts import record_shot
from billiards_env.games.game_state import CALLS, HAND_BACK, SAFETY, SHOT
from billiards_env.games.placement import PlacementNumbers, cue_ball_area_of, place_cue_ball
from billiards_env.games.playing import NO_CALL, Call, Setup, Stroke
from billiards_env.games.turn import Games, take_turn
from billiards_env.jit import Typed, entry_point, inlined
from billiards_env.physics.state import X, Y

Floats = NDArray[np.float64]


class GameNumbers(NamedTuple):
    """The constants of a game of several players.

    Attributes:
        table: `placement.PlacementNumbers`, as a plain tuple.
        by_points: Whether the game is won by points.
        n_pockets: Number of pockets.
        size: How many numbers of an action describe the shot.
        places: How many describe the place of a cue ball in hand: 2, or 0 in a game without pockets.
        calls: How many describe the call: 3 or 0.
        safety: Whether a player may call a safety.
    """

    table: Any
    by_points: bool
    n_pockets: int
    size: int
    places: int
    calls: int
    safety: bool


def game_numbers(setup: Setup, sizes: tuple[int, int, int]) -> GameNumbers:
    """Returns the constants of a game; `sizes` is `Model.n_numbers`."""
    pockets, by_points = len(setup.scene.table.pockets), setup.target is not None
    return GameNumbers(setup.placement_table, by_points, pockets, *sizes, setup.has_safety)


@inlined
def _part(value, count):
    """Returns in which of `count` equal parts of -1 to 1 a value lies."""
    return min(int((min(max(value, -1.0), 1.0) + 1.0) / 2.0 * count), count - 1)


@inlined
def _kind_of(choice, state, safety):
    """Returns the kind of call for the last number of an action: up to 0 a shot, then in equal parts the choices.

    With `safety` a safety is a choice; the others are those of the state.
    """
    choices = state.choices | (1 << SAFETY if safety else 0)
    count = 0
    for kind in range(SAFETY, len(CALLS)):
        count += choices >> kind & 1
    if choice <= 0.0 or count == 0:
        return SHOT
    left = _part(2.0 * choice - 1.0, count)
    for kind in range(SAFETY, len(CALLS)):
        if choices >> kind & 1:
            if left == 0:
                return kind
            left -= 1
    return SHOT


@inlined
def _on_segment(low, high, value):
    """Returns the point of a segment from `low` at -1 to `high` at 1."""
    return (low + high) / 2.0 + (high - low) / 2.0 * min(max(value, -1.0), 1.0)


@entry_point
def take_actions(begin, end, actions, game, arrays, turns):
    """Makes the calls of actions, places the cue balls in hand, and copies the numbers of the shots.

    Args:
        begin: First game.
        end: One past the last.
        actions: (m, size + places + calls) float64. The first `size` numbers may have been converted.
        game: `GameNumbers`, as a plain tuple.
        arrays: `EpisodeArrays`, as a plain tuple. The positions change.
        turns: `TurnArrays`, as a plain tuple; `calls` and `strokes` change.

    Returns:
        -1, or a game in which there is no room for the cue ball.
    """
    game, arrays, turns = GameNumbers(*game), EpisodeArrays(*arrays), TurnArrays(*turns)
    table, failed = PlacementNumbers(*game.table), -1
    for k in range(begin, end):
        if arrays.over[k]:
            continue
        state, call, first = arrays.states[k], turns.calls[k], game.size + game.places
        call.ball, call.kind, call.pocket = -1, SHOT, -1
        if game.calls > 0:
            call.ball = 1 + _part(actions[k, first], arrays.positions.shape[1] - 1)
            call.pocket = _part(actions[k, first + 1], game.n_pockets)
            call.kind = _kind_of(actions[k, first + 2], state, game.safety)
        shoots = call.kind < HAND_BACK
        if shoots and len(turns.before_states) > 0:
            turns.before_states[k] = state
            for i in range(arrays.positions.shape[1]):
                for c in range(2):
                    turns.before_positions[k, i, c] = arrays.positions[k, i, c]
        for c in range(game.size):
            turns.strokes[k, c] = actions[k, c] if shoots else 0.0
        turns.places[k, X] = turns.places[k, Y] = math.nan
        if shoots and state.in_hand != 0:
            area, cue = cue_ball_area_of(table, state), state.cue_balls[0]
            if game.places > 0:
                x = _on_segment(area.x_low, area.x_high, actions[k, game.size])
                y = _on_segment(area.y_low, area.y_high, actions[k, game.size + 1])
                if not place_cue_ball(table, arrays.positions[k], state, x, y):
                    failed = k
            turns.places[k, X], turns.places[k, Y] = arrays.positions[k, cue, X], arrays.positions[k, cue, Y]
    return failed


@inlined
def set_down(table, positions, state):
    """Places a cue ball in hand near the head spot, see the module. Returns whether there is room."""
    return state.in_hand == 0 or place_cue_ball(table, positions, state, table.head_x, 0.0)


@inlined
def write_balls(k, state, arrays):
    """Writes which balls are on the table before the next shot. A cue ball in hand counts."""
    on_table = state.object_balls | 1 << state.cue_balls[0]
    for i in range(arrays.in_play.shape[1]):
        arrays.in_play[k, i] = on_table >> i & 1


@entry_point
def score_turns(rules, begin, end, numbers, game, arrays, turns, rewards):
    """Judges the shots of games and prepares the next ones.

    Args:
        rules: The `entry.Rules` of the game.
        begin: First game.
        end: One past the last.
        numbers: `TaskNumbers`, as a plain tuple, like the next three.
        game: `GameNumbers`.
        arrays: `EpisodeArrays`, which change.
        turns: `TurnArrays`, which change.
        rewards: (m,) float64 out, of the players of the shots; 0 in games without a shot.

    Returns:
        -1, or a game in which there is no room for a ball.
    """
    numbers, game, arrays, turns = TaskNumbers(*numbers), GameNumbers(*game), EpisodeArrays(*arrays), TurnArrays(*turns)
    table, failed, players = PlacementNumbers(*game.table), -1, turns.rewards.shape[1]
    before = turns.before_positions, turns.before_states
    games = Games(arrays.positions, arrays.states, arrays.facts, turns.calls, *before)
    for k in range(begin, end):
        state, player = arrays.states[k], arrays.states[k].player
        cue = state.cue_balls[0]
        for i in range(arrays.in_play.shape[1]):
            arrays.potted[k, i] = not arrays.in_play[k, i]
        rewards[k] = 0.0
        if arrays.over[k]:
            continue
        record_shot(rules.record, arrays, k, numbers.bits, arrays.facts[k], turns.calls[k])
        judgement, without_room = take_turn(rules, table, k, games)
        if without_room >= 0 or not set_down(table, arrays.positions[k], state):
            failed = k
        winner, by_points = state.winner, game.by_points
        worth = judgement.points - judgement.penalty
        if not by_points:
            worth = 0 if winner < 0 else (1 if winner == player else -1)
        if arrays.fresh[k]:
            arrays.shots_left[k], arrays.fresh[k] = numbers.max_shots, False
        arrays.points[k], arrays.scratch[k] = worth, arrays.potted[k, cue]
        arrays.score[k] = state.scores[player] if by_points else worth
        arrays.shots_left[k] -= 1
        arrays.is_success[k] = winner == player
        arrays.over[k] = state.over or arrays.shots_left[k] == 0
        rewards[k] = worth - numbers.scratch_penalty if arrays.scratch[k] else float(worth)
        turns.player[k], turns.next_player[k], turns.winner[k] = player, state.player, winner
        turns.foul[k] = judgement.foul
        for p in range(players):
            turns.scores[k, p] = state.scores[p]
            turns.rewards[k, p] = rewards[k] if p == player else 0.0 - rewards[k] / (players - 1)
        for i in range(arrays.in_play.shape[1]):
            turns.spotted[k, i] = judgement.spotted >> i & 1
        write_balls(k, state, arrays)
        write_legal_balls(k, rules.legal(state, state.player), arrays)
    return failed


@entry_point
def begin_games(rules, begin, end, mask, game, arrays):
    """Prepares the first shots of the games in the mask (m,); returns -1, or a game without room for the cue ball."""
    game, arrays = GameNumbers(*game), EpisodeArrays(*arrays)
    table, failed = PlacementNumbers(*game.table), -1
    for k in range(begin, end):
        if not mask[k]:
            continue
        state = arrays.states[k]
        write_balls(k, state, arrays)
        write_legal_balls(k, rules.legal(state, state.player), arrays)
        if not set_down(table, arrays.positions[k], state):
            failed = k
        rules.look(table, arrays.positions[k], state)
    return failed


@entry_point
def write_legal(legal, begin, end, arrays):
    """Writes the balls that each observing player may touch first."""
    arrays = EpisodeArrays(*arrays)
    for k in range(begin, end):
        state, viewer = arrays.states[k], arrays.viewers[k]
        write_legal_balls(k, legal(state, state.player if viewer < 0 else viewer), arrays)


@entry_point
def copy_tables(begin, end, arrays, seen):
    """Copies the tables of games, with the cue ball of the next shot as ball 0 and ball 0 in its place."""
    arrays = EpisodeArrays(*arrays)
    positions, in_play, legal_balls = seen
    for k in range(begin, end):
        cue = arrays.states[k].cue_balls[0]
        for i in range(arrays.in_play.shape[1]):
            j = cue if i == 0 else (0 if i == cue else i)
            positions[k, i, X], positions[k, i, Y] = arrays.positions[k, j, X], arrays.positions[k, j, Y]
            in_play[k, i], legal_balls[k, i] = arrays.in_play[k, j], arrays.legal_balls[k, j]


class GameKernels:
    """The kernels and the constants of a game of several players.

    Args:
        model: The arguments of the environment.
        numbers: The constants of the task.

    Attributes:
        has_two_cue_balls: Whether players have cue balls of their own.
    """

    def __init__(self, model: Model, numbers: TaskNumbers) -> None:
        assert model.setup is not None
        game, self._n_players = model.setup.game_rules, model.setup.n_players
        self.has_two_cue_balls = len(game.cue_balls) > 1
        self._task, self._numbers = tuple(numbers), tuple(game_numbers(model.setup, model.n_numbers))
        self._rules = game.kernels
        entries = begin_games, write_legal, take_actions, copy_tables, score_turns
        self._begin, self._write_legal, self._take, self._see, self._score = map(Typed, entries)

    def take(self, state: State, begin: int, end: int, actions: NDArray[Any]) -> NDArray[Any]:
        """Makes the calls of actions, and places cue balls in hand.

        Returns:
            The numbers of the strokes; for actions that are choices, and have no other numbers, the actions.
        """
        are_choices = actions.ndim == 1
        given = state.strokes if are_choices else actions
        check_room(self._take.call(begin, end, given, self._numbers, state.arrays, tuple(_turns(state))))
        return actions if are_choices else state.strokes

    def shoots(self, state: State) -> NDArray[np.bool_]:
        """Returns in which games (m,) the cue ball is struck: not after a call of `NO_SHOT`."""
        return ~state.over & (_turns(state).calls["kind"] < HAND_BACK)

    def score(self, state: State, begin: int, end: int, rewards: Floats) -> None:
        """Judges the shots and prepares the next ones, see `score_turns`."""
        turns = tuple(_turns(state))
        check_room(self._score.call(self._rules, begin, end, self._task, self._numbers, state.arrays, turns, rewards))

    def begin(self, state: State, begin: int, end: int, mask: NDArray[np.bool_]) -> None:
        """Prepares the first shots of the games in the mask (m,)."""
        check_room(self._begin.call(self._rules, begin, end, mask, self._numbers, state.arrays))

    def see(self, state: State, begin: int, end: int) -> None:
        """Copies the tables for observations, see `State.seen`."""
        seen = state.seen
        self._see.call(begin, end, state.arrays, (seen.positions, seen.in_play, seen.legal_balls))

    def write_legal(self, state: State) -> None:
        """Writes the balls that each observing player may touch first in all games."""
        self._write_legal.call(self._rules.legal, 0, len(state.over), state.arrays)

    def infos(self, state: State) -> tuple[InfoArrays, InfoArrays]:
        """Returns the arrays of the keys of `info` after a shot, and of those at the start of an episode."""
        turns, games = _turns(state), state.seen.states
        numbers = {name: getattr(turns, name) for name in ("player", "next_player", "foul", "winner")}
        rows = {name: getattr(turns, name) for name in ("scores", "rewards", "spotted")}
        scores = games["scores"][:, : self._n_players]
        return InfoArrays(numbers, rows), InfoArrays({"next_player": games["player"]}, {"scores": scores})

    def stroke(self, state: State, k: int) -> Stroke | None:
        """Returns the last stroke in game k, see `BilliardsEnv.stroke`."""
        turns, model = _turns(state), state.model
        if math.isnan(turns.strokes[k, X]):
            return None
        called, place = turns.calls[k], turns.places[k].tolist()
        call = Call(int(called["ball"]), int(called["pocket"]), CALLS[called["kind"]]) if model.can_call else NO_CALL
        if called["kind"] >= HAND_BACK:
            return Stroke((0.0, 0.0), call=Call(kind=call.kind))
        struck = cue_strike(turns.strokes[k], model.scene, model.max_speed)
        wx, wy, wz = struck.spin.tolist()
        place = None if math.isnan(place[X]) else (place[X], place[Y])
        return Stroke(tuple(struck.velocity.tolist()), place, (wx, wy, wz), call)


def _turns(state: State) -> TurnArrays:
    assert state.turns is not None
    return state.turns


def check_room(failed: int) -> None:
    """Raises a ValueError for a game without room for a ball; -1 for none."""
    if failed >= 0:
        raise ValueError(f"game {failed}: found no room for a ball on the table, expected fewer or smaller balls")
