"""The turn of a game: from a shot, or from a call without a shot, to the state before the next shot.

After a shot its facts are recorded, the rules judge it, balls return to the table, the turn changes, and the rules look
at the balls at rest: snooker may give a free ball, and balls may touch. The kernels change one game in place:
`positions`, (n, 2) m, and `state`, a row of `Game.state_type`. Their argument `rules`, the `entry.Rules` of the game,
chooses the code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.entry import Game, no_rack, no_rerack
from billiards_env.games.game_state import (
    BREAK_AGAIN,
    HAND_BACK,
    MOST_PLAYERS,
    NO_RERACK,
    NOT_IN_HAND,
    REPLACE,
    RERACK_REST,
    STALEMATE,
    VERDICT,
    check_indices,
    write_verdict,
)
from billiards_env.games.placement import PlacementNumbers, no_room, placement_area, placement_numbers
from billiards_env.games.referee import judged
from billiards_env.jit import entry_point, inlined
from billiards_env.physics.state import X, Y
from billiards_env.scene import Scene


@inlined
def after_shot(rules, table, positions, state, facts, call):  # out: positions, state
    """Judges a shot, and changes the positions and the state after it to those before the next shot.

    Spotted balls and new racks are placed. A potted cue ball keeps its position, and is in hand.

    Args:
        rules: The `entry.Rules` of the game.
        table: The `PlacementNumbers` of `table_of`.
        positions: (n, 2) m, after the shot, which change.
        state: A row of `Game.state_type` before the shot, which changes.
        facts: A row of `Game.facts_type`, which changes.
        call: A row of `CALL`.

    Returns:
        The `Verdict`, and a ball for which there is no room on the table, or -1.
    """
    cue, others = state.cue_balls[0], state.object_balls & ~(facts.potted | facts.driven_off)
    rules.see(table, positions, state, facts, call)
    verdict = judged(rules.judge, state, facts, call)
    in_play = others if state.in_hand != NOT_IN_HAND else others | 1 << cue  # a cue ball in hand does not block a spot
    failed = rules.spot(table, positions, verdict.spotted, in_play, cue)
    if verdict.rack == RERACK_REST:
        state.in_hand = rules.rack(table, positions, others, cue)
    elif verdict.rack != NO_RERACK:
        rules.rack(table, positions, 0, state.cue_balls[0])
    rules.settle(table, positions, state, verdict)
    if not state.over:
        rules.look(table, positions, state)
    return verdict, failed


@inlined
def without_shot(rules, table, k, call, positions, states, before):  # out: positions, states, before
    """Changes game k after a call without a shot, one of `game_state.NO_SHOT`.

    Args:
        rules: The `entry.Rules` of the game.
        table: The `PlacementNumbers` of `table_of`.
        k: The game.
        call: A row of `CALL`.
        positions: (m, n, 2) m, which change.
        states: (m,) `Game.state_type`, which change.
        before: The positions and the states before the last shot, for "replace". They change, see
            `Game.replace`.
    """
    state = states[k]
    if call.kind != REPLACE:
        rules.without_shot(table, positions[k], state, call.kind)
        if call.kind == HAND_BACK or call.kind == BREAK_AGAIN:
            state.player = (state.player - 1) % state.n_players
        elif call.kind == STALEMATE:
            state.player = state.breaker
            for i in range(MOST_PLAYERS):
                state.fouls[i] = 0
    else:
        positions_before, states_before = before
        rules.replace(state, states_before[k])
        states[k] = states_before[k]
        for i in range(positions.shape[1]):
            positions[k, i, X], positions[k, i, Y] = positions_before[k, i, X], positions_before[k, i, Y]
    state.choices = 0
    rules.look(table, positions[k], state)


@entry_point
def look_at_games(rules, table, positions, states):  # out: states
    """Runs `Game.look` for m games."""
    for k in range(len(states)):
        rules.look(PlacementNumbers(*table), positions[k], states[k])


@entry_point
def finish_shots(rules, table, positions, states, facts, calls, verdicts):  # out: positions, states, verdicts
    """Runs `after_shot` for m games. Returns a ball for which there is no room on the table of a game, or -1."""
    failed = -1
    for k in range(len(states)):
        verdict, without_room = after_shot(rules, PlacementNumbers(*table), positions[k], states[k], facts[k], calls[k])
        failed = max(failed, without_room)
        write_verdict(verdict, verdicts[k])
    return failed


@entry_point
def call_without_shots(rules, table, calls, positions, states, before):
    """Runs `without_shot` for m games."""
    for k in range(len(states)):
        without_shot(rules, PlacementNumbers(*table), k, calls[k], positions, states, before)


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
) -> tuple[NDArray[np.float64], NDArray[Any], NDArray[Any]]:
    """Returns m games of one kind before their next shots.

    Args:
        rules: The game.
        scene: The scene.
        positions: (m, n, 2) m, after the shots.
        states: (m,) `Game.state_type`, before the shots.
        facts: (m,) `Game.facts_type`, of the shots.
        calls: (m,) `CALL`, of the shots.

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
    table = table_of(rules, scene, states["target"].max(initial=0))
    positions, states, verdicts = np.array(positions), states.copy(), np.zeros(len(states), VERDICT)
    failed = finish_shots(rules.kernels, table, positions, states, facts, calls, verdicts)
    if failed >= 0:
        raise no_room(placement_area(scene, failed, False))
    return positions, states, verdicts
