"""The turn of a game: from a shot, or from a call without a shot, to the state before the next shot.

A turn has these parts. Most of them are fields of `Game`, with a default if a game may leave them out.

1. The player may touch the balls of `legal` first, may call those of `callable`, and has the `choices` of the state.
2. After the shot `record` and `see` find its facts.
3. `judge` returns the verdict. `referee.judged` counts points and fouls, and changes the player.
4. `spot` and `rack` return balls to the table.
5. `settle` and `look` add what follows from the balls at rest, such as a free ball in snooker, or balls that touch.

After a call without a shot, `without_shot` or `replace` changes the balls in place of the parts 2 to 4. The kernels
change the arrays of one game. Their argument `rules`, the `entry.Rules` of the game, chooses the code.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.entry import Game, no_rack, no_rerack
from billiards_env.games.game_state import (
    BREAK_AGAIN,
    HAND_BACK,
    NO_RERACK,
    NOT_IN_HAND,
    REPLACE,
    RERACK_REST,
    STALEMATE,
    VERDICT,
    check_indices,
    verdict,
    write_verdict,
)
from billiards_env.games.placement import PlacementNumbers, no_room, placement_area, placement_numbers
from billiards_env.games.referee import judged
from billiards_env.jit import entry_point, inlined
from billiards_env.physics.state import X, Y
from billiards_env.scene import Scene


class Games(NamedTuple):
    """The arrays of m games that a turn changes.

    Attributes:
        positions: (m, n, 2) m.
        states: (m,) `Game.state_type`.
        facts: (m,) `Game.facts_type`, of the last shots.
        calls: (m,) `CALL`.
        before_positions: (m, n, 2) m, before the last shots, for the call "replace".
        before_states: (m,) `Game.state_type`.
    """

    positions: Any
    states: Any
    facts: Any
    calls: Any
    before_positions: Any
    before_states: Any


@inlined
def take_turn(rules, table, k, games):  # out: games
    """Changes game k to the state before the next shot: after a shot, or after a call of `game_state.NO_SHOT`.

    Args:
        rules: The `entry.Rules` of the game.
        table: The `PlacementNumbers` of `table_of`.
        k: The game.
        games: `Games`. The positions are those after the shot, and the states those before it.

    Returns:
        The `Verdict`, and a ball for which there is no room on the table, or -1.
    """
    if games.calls[k].kind >= HAND_BACK:
        without_shot(rules, table, k, games)
        return verdict(), -1
    return after_shot(rules, table, games.positions[k], games.states[k], games.facts[k], games.calls[k])


@inlined
def after_shot(rules, table, positions, state, facts, call):  # out: positions, state
    """Judges a shot, returns balls to the table, and sets up the next turn.

    The positions, (n, 2) m, and the state of one game become those before the next shot. A potted cue ball keeps its
    position, and is in hand. The results are those of `take_turn`.
    """
    cue, others = state.cue_balls[0], state.object_balls & ~(facts.potted | facts.driven_off)
    rules.see(table, positions, state, facts, call)
    judgement = judged(rules.judge, state, facts, call)
    in_play = others if state.in_hand != NOT_IN_HAND else others | 1 << cue  # a cue ball in hand does not block a spot
    failed = rules.spot(table, positions, judgement.spotted, in_play, cue)
    if judgement.rack == RERACK_REST:
        state.in_hand = rules.rack(table, positions, others, cue)
    elif judgement.rack != NO_RERACK:
        rules.rack(table, positions, 0, state.cue_balls[0])
    rules.settle(table, positions, state, judgement)
    if not state.over:
        rules.look(table, positions, state)
    return judgement, failed


@inlined
def without_shot(rules, table, k, games):  # out: games
    """Changes game k after a call without a shot. The arguments are those of `take_turn`."""
    positions, state, kind = games.positions[k], games.states[k], games.calls[k].kind
    if kind == REPLACE:
        rules.replace(state, games.before_states[k])
        games.states[k] = games.before_states[k]
        for i in range(len(positions)):
            positions[i, X], positions[i, Y] = games.before_positions[k, i, X], games.before_positions[k, i, Y]
    else:
        rules.without_shot(table, positions, state, kind)
        if kind in (HAND_BACK, BREAK_AGAIN):
            state.player = (state.player - 1) % state.n_players
        elif kind == STALEMATE:
            state.player = state.breaker
            state.fouls[:] = 0
    state.choices = 0
    rules.look(table, positions, state)


@entry_point
def look_at_games(rules, table, positions, states):  # out: states
    """Runs `Game.look` for m games."""
    for k in range(len(states)):
        rules.look(PlacementNumbers(*table), positions[k], states[k])


@entry_point
def take_turns(rules, table, games, verdicts):  # out: games, verdicts
    """Runs `take_turn` for m games. Returns a ball for which there is no room on the table of a game, or -1."""
    failed, games = -1, Games(*games)
    for k in range(len(games.states)):
        judgement, without_room = take_turn(rules, PlacementNumbers(*table), k, games)
        failed = max(failed, without_room)
        write_verdict(judgement, verdicts[k])
    return failed


def table_of(rules: Game, scene: Scene, target: int, rack: str = "") -> tuple[Any, ...]:
    """Returns the argument `table` of a game to a target score, 0 for none, see `placement.placement_numbers`.

    Args:
        rules: The game.
        scene: The scene.
        target: The target score.
        rack: `Setup.rack`.

    Raises:
        ValueError: If balls of the scene have no spots or cannot be racked.
    """
    if rules.has_spots or not rules.pockets:
        return placement_numbers(scene, rules.layouts[:1])
    racks = rules.rack is not no_rack and target > 0  # without a target the game has a single rack
    if not racks and rules.without_shot is no_rerack:
        return placement_numbers(scene, ())
    tight = racks or len(set(scene.balls.radius[1:])) == 1
    try:
        return placement_numbers(scene, ("tight_rack" if tight else "rack", rack))
    except ValueError:
        if racks:
            raise
        return placement_numbers(scene, ())  # a table without room for a rack: no call for a new one


def next_games(
    rules: Game,
    scene: Scene,
    positions: NDArray[np.float64],
    states: NDArray[Any],
    facts: NDArray[Any],
    calls: NDArray[Any],
    before: tuple[NDArray[np.float64], NDArray[Any]] | None = None,
    rack: str = "",
) -> tuple[NDArray[np.float64], NDArray[Any], NDArray[Any]]:
    """Returns m games of one kind before their next shots.

    Args:
        rules: The game.
        scene: The scene.
        positions: (m, n, 2) m, after the shots.
        states: (m,) `Game.state_type`, before the shots.
        facts: (m,) `Game.facts_type`, of the shots, to which `Game.see` adds those that need the positions.
        calls: (m,) `CALL`, of the shots, or calls without a shot.
        before: The positions and the states before the last shots, for the call "replace".
        rack: `Setup.rack`.

    Returns:
        (m, n, 2) positions, m, (m,) `Game.state_type`, and (m,) `VERDICT` of the shots.

    Raises:
        ValueError: If the arrays have different lengths, a player or a ball does not exist, balls cannot be racked, or
            there is no room for a spotted ball.
    """
    lengths = len(positions), len(states), len(facts), len(calls)
    if len(set(lengths)) > 1:
        raise ValueError(f"positions, states, facts and calls of lengths {lengths}: expected one length")
    check_indices(states, scene.n_balls)
    table, verdicts = table_of(rules, scene, states["target"].max(initial=0), rack), np.zeros(len(states), VERDICT)
    games = Games(np.array(positions), states.copy(), facts, calls, *(before or (positions, states.copy())))
    failed = take_turns(rules.kernels, table, tuple(games), verdicts)
    if failed >= 0:
        raise no_room(placement_area(scene, failed, False))
    return games.positions, games.states, verdicts
