"""Simulating and judging many shots from one position."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.engine.compile import cached_by_scene
from billiards_env.engine.strikes import strike_with
from billiards_env.games.entry import no_see
from billiards_env.games.facts import facts_of_shots, name_of
from billiards_env.games.game_state import CALL, VERDICT, members
from billiards_env.games.placement import PlacementNumbers
from billiards_env.games.playing import NO_CALL, Call, GameState, PlayedShot, Setup
from billiards_env.games.referee import callable_balls, judge_shots
from billiards_env.jit import entry_point
from billiards_env.scene import Scene, layouts
from billiards_env.shots.simulation import simulate_batch
from billiards_env.support.checks import numbers


class PlayedBatch(NamedTuple):
    """The results of m shots.

    Attributes:
        positions: (m, n, 2) m, of the balls after the shots. A ball that returns to the table lies on its spot, even if
            another ball is in the way; a new rack is not placed.
        states: (m,) `Game.state_type`, before the next shots, without what `Game.settle` and `Game.look` add: a free
            ball, touching balls, and choices that follow from them or from a stalemate.
        verdicts: (m,) `VERDICT`.
        pockets: (m, n) int32, the pocket in which the shot potted the ball, -1 if it did not pot it.
        called: (m,) the called ball, or -1.
    """

    positions: NDArray[np.float64]
    states: NDArray[Any]
    verdicts: NDArray[Any]
    pockets: NDArray[np.int32]
    called: NDArray[np.int64]


def play_batch(
    setup: Setup,
    game: GameState,
    velocities: ArrayLike,
    spins: ArrayLike | None = None,
    places: NDArray[np.float64] | None = None,
    calls: NDArray[np.int64] | None = None,
    threads: int | None = None,
) -> PlayedBatch:
    """Plays m shots of the cue ball from one position, each with its own place of the cue ball and its own call.

    The states and verdicts are those of `game.play`.

    Args:
        setup: The settings of the game.
        game: The state before the shot, with the cue ball in its place.
        velocities: (m, 2) velocities of the cue ball, m/s.
        spins: (m, 3) its angular velocities, rad/s; None for zero.
        places: (m, 2) free places of the cue ball, m; None for its place in `game`.
        calls: (m, 2) the called balls and pockets, -1 for none. With None each shot calls the lowest ball that it pots,
            in bank pool that it banks, and that may be called. Calls have no effect in a game without called shots.
        threads: As in `simulate_batch`.

    Example:
        >>> from billiards_env.games import FOULS, custom_opening
        >>> setup = Setup("straight", Scene.named("pool", 2))
        >>> game = custom_opening(setup, [[0.6, 0.1], [1.07, 0.435], [-0.5, 0.0]])
        >>> played = play_batch(setup, game, [[1.5, 1.035], [-1.0, 0.0]])  # a pot, and a foul
        >>> played.verdicts["points"].tolist(), played.states["player"].tolist()
        ([1, -1], [0, 1])
        >>> [FOULS[foul] for foul in played.verdicts["foul"]]
        ['', 'no_hit']
    """
    state = game.state
    balls = [int(state.cue_balls[0]), *members(state.object_balls)]  # the engine strikes the first one
    speeds = numbers("velocities", velocities)
    m, rules = len(speeds), setup.game_rules
    starts = np.broadcast_to(game.positions[balls], (m, len(balls), 2))
    if places is not None:
        starts = np.concatenate((places[:, None], starts[:, 1:]), axis=1)
    scene = _scene_of(setup.scene, tuple(balls))
    if scene.physics.motion == "sliding":
        speeds, spins = strike_with(speeds, None if spins is None else numbers("spins", spins)), None
    options: dict[str, Any] = {"engine": setup.engine, "spins": spins, "threads": threads, "measures": rules.measures}
    batch = simulate_batch(scene, starts, speeds, **options)
    pockets = np.full((m, setup.scene.n_balls), -1, np.int32)
    pockets[:, balls] = batch.pockets
    called, states = np.zeros(m, CALL), np.array([state])
    called["ball"], called["pocket"] = NO_CALL[:2]
    calls_count = state.call_shot and not state.break_shot
    if calls_count and calls is not None:
        called["ball"], called["pocket"] = calls.T
    facts = facts_of_shots(rules.facts, batch, np.array(balls), called)
    if calls_count and calls is None:
        pots = facts[name_of(rules.scoring)] & callable_balls(setup.rules, states, states["player"])
        called["ball"], called["made"] = np.frexp(pots & -pots)[1] - 1, pots != 0
    positions = np.repeat(game.positions[None], m, axis=0)
    positions[:, balls] = batch.positions
    if rules.see is not no_see:
        _see_shots(rules.see, setup.placement_table, positions, states, facts, called)
    states, verdicts = judge_shots(setup.rules, states.repeat(m), facts, called)
    if verdicts["spotted"].any():
        spots = layouts.layout_plan(rules.layouts[0], setup.scene).spots if rules.has_spots else None
        for ball in range(1, setup.scene.n_balls):
            back = (verdicts["spotted"] >> ball & 1) > 0
            positions[back, ball] = (setup.scene.table.foot_x, 0.0) if spots is None else spots[ball]
    return PlayedBatch(positions, states, verdicts, pockets, called["ball"])


def unplayed(game: GameState) -> PlayedBatch:
    """Returns a state as the result of one shot, which changed nothing."""
    pockets = np.full((1, len(game.positions)), -1, np.int32)
    states, verdicts = np.array([game.state]), np.zeros(1, VERDICT)
    return PlayedBatch(game.positions[None], states, verdicts, pockets, np.full(1, NO_CALL.ball))


def best_call(setup: Setup, state: Any, played: PlayedShot) -> Call:
    """Returns the call of the first pot of a shot whose ball may be called, in bank pool of the first bank.

    It is `NO_CALL` if there is none. `state` is the one before the shot.
    """
    if not state.call_shot or state.break_shot:
        return NO_CALL
    scores = set(setup.callable(state)) & set(members(played.facts[name_of(setup.game_rules.scoring)]))
    return next((Call(ball, pocket) for ball, pocket in played.pots if ball in scores), NO_CALL)


@entry_point
def _see_shots(see, table, positions, states, facts, calls):  # out: facts
    """Writes the facts of m shots from one state, (1,), that need the positions after them, see `Game.see`."""
    for k in range(len(facts)):
        see(PlacementNumbers(*table), positions[k], states[0], facts[k], calls[k])


@cached_by_scene
def _scene_of(scene: Scene, balls: tuple[int, ...]) -> Scene:
    """Returns the scene with some of its balls in a given order."""
    radius, mass = (tuple(values[i] for i in balls) for values in (scene.balls.radius, scene.balls.mass))
    return dataclasses.replace(scene, balls=dataclasses.replace(scene.balls, radius=radius, mass=mass))
