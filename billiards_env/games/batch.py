"""Simulating and judging many shots from one position."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import numbers
from billiards_env.engine.compile import cached_by_scene
from billiards_env.games.game import GameState, Setup
from billiards_env.games.judging import NO_CALL, Call, Facts, Rules, RuleState, ball_set, state_array
from billiards_env.rules import CALL, Counts, facts_of_shots, judge_shots
from billiards_env.scene import Scene, layouts
from billiards_env.shots.simulation import BatchResult, simulate_batch
from billiards_env.shots.strikes import strike_with


class PlayedBatch(NamedTuple):
    """m shots and what follows from them.

    Attributes:
        positions: (m, n, 2) m, of the balls after the shots. A ball that returns to the table lies on its spot, even if
            another ball is in the way; a new rack is not placed.
        states: (m,) `rules.STATE`, before the next shots, without consecutive fouls.
        verdicts: (m,) `rules.VERDICT`.
    """

    positions: NDArray[np.float64]
    states: NDArray[Any]
    verdicts: NDArray[Any]


def judge_batch(
    setup: Setup, game: GameState, velocities: ArrayLike, spins: ArrayLike | None = None, threads: int | None = None
) -> NDArray[Any]:
    """Simulates m shots of the cue ball from one position and judges them.

    The verdict is that of `game.play`, with these differences: in a game with called shots the player calls the lowest
    ball that the shot pots and that may be called; if balls of both groups are potted on an open table of eight ball,
    the group is that of the ball that was touched first; and if the cue ball touches several balls at the same instant,
    one of them counts as touched first.

    Args:
        setup: The settings of the game.
        game: The state before the shot, with the cue ball in its place.
        velocities: (m, 2) velocities of the cue ball, m/s.
        spins: (m, 3) its angular velocities, rad/s; None for zero.
        threads: As in `simulate_batch`.

    Returns:
        (m,) `rules.VERDICT`.

    Example:
        >>> from billiards_env.games import opening
        >>> from billiards_env.rules import FOULS
        >>> setup = Setup("nine_ball", Scene.named("pool", 9))
        >>> game = opening(setup, np.random.default_rng(1))
        >>> verdicts = judge_batch(setup, game, [[0.0, 1.0], [2.0, 0.0], [-1.0, 0.0]])
        >>> [FOULS[foul] for foul in verdicts["foul"]]
        ['no_hit', 'illegal_break', 'no_hit']
    """
    return _judged(setup, game, velocities, spins, None, None, threads)[1]


def play_batch(
    setup: Setup,
    game: GameState,
    velocities: ArrayLike,
    spins: ArrayLike | None = None,
    places: NDArray[np.float64] | None = None,
    calls: NDArray[np.int64] | None = None,
    threads: int | None = None,
) -> PlayedBatch:
    """Plays m shots from one position, each with its own place of the cue ball and its own call.

    Args:
        setup: As in `judge_batch`.
        game: As there.
        velocities: As there.
        spins: As there.
        places: (m, 2) free places of the cue ball, m; None for its place in `game`.
        calls: (m, 2) the called balls and pockets, -1 for none; None for the call of `judge_batch`. They have no effect
            in a game without called shots.
        threads: As there.

    Example:
        >>> from billiards_env.games import custom_opening
        >>> setup = Setup("straight", Scene.named("pool", 2))
        >>> game = custom_opening(setup, [[0.6, 0.1], [1.07, 0.435], [-0.5, 0.0]])
        >>> played = play_batch(setup, game, [[1.5, 1.035], [-1.0, 0.0]])  # a pot, and a foul
        >>> played.verdicts["points"].tolist(), played.states["player"].tolist()
        ([1, -1], [0, 1])
    """
    batch, verdicts, potted = _judged(setup, game, velocities, spins, places, calls, threads)
    balls = _balls_of(game.state)
    positions = np.repeat(game.positions[None], len(verdicts), axis=0)
    positions[:, list(balls)] = batch.positions
    states, n_players = np.repeat(state_array([game.state]), len(verdicts)), setup.n_players
    following = (game.state.player + 1) % n_players
    states["scores"][:, game.state.player] += verdicts["points"]
    states["scores"][:, following] += verdicts["penalty"]
    states["player"] = np.where(verdicts["continues"], game.state.player, following)
    states["object_balls"] = (states["object_balls"] & ~potted) | verdicts["spotted"]
    cue, *others = game.state.cue_balls
    if others:
        states["object_balls"] |= 1 << cue
        states["object_balls"] &= ~(1 << np.where(verdicts["continues"], cue, others[0]))
    states["break_shot"], states["fouls"] = verdicts["rack"] != 0, 0
    states["solids"], states["colour"], states["free_ball"] = verdicts["solids"], verdicts["colour"], False
    if verdicts["spotted"].any():
        spots = layouts.layout_plan("snooker", setup.scene).spots if setup.game_rules.has_spots else None
        for ball in range(1, setup.scene.n_balls):
            back = (verdicts["spotted"] >> ball & 1) > 0
            positions[back, ball] = (setup.scene.table.foot_x, 0.0) if spots is None else spots[ball]
    return PlayedBatch(positions, states, verdicts)


def _balls_of(state: RuleState) -> tuple[int, ...]:
    """Returns the balls on the table in the order in which they are simulated; the engine strikes the first one."""
    return (state.cue_balls[0], *sorted(state.object_balls))


def _judged(
    setup: Setup,
    game: GameState,
    velocities: ArrayLike,
    spins: ArrayLike | None,
    places: NDArray[np.float64] | None,
    given: NDArray[np.int64] | None,
    threads: int | None,
) -> tuple[BatchResult, NDArray[Any], NDArray[np.int64]]:
    """Returns the shots, their verdicts and the sets of potted balls (m,); see `play_batch`."""
    state = game.state
    balls = _balls_of(state)
    speeds = numbers("velocities", velocities)
    positions = np.broadcast_to(game.positions[list(balls)], (len(speeds), len(balls), 2))
    if places is not None:
        positions = np.concatenate((places[:, None], positions[:, 1:]), axis=1)
    scene, m = _scene_of(setup.scene, balls), len(speeds)
    if scene.physics.motion == "sliding":
        speeds, spins = strike_with(speeds, None if spins is None else numbers("spins", spins)), None
    batch = simulate_batch(
        scene, positions, speeds, mode=setup.mode, dt=setup.dt, fix=setup.fix, spins=spins, threads=threads
    )
    before, bits = np.zeros_like(batch.potted), 1 << np.array(balls)
    counts = Counts(before, batch.potted, batch.cushions, batch.cushions_before_hit, batch.first_hit, bits)
    facts, calls = facts_of_shots(counts), np.zeros(m, CALL)
    if not state.call_shot or state.break_shot:
        calls["ball"] = NO_CALL.ball
    elif given is None:
        pots = facts["potted"] & ball_set(setup.game_rules.callable(state, state.player))
        calls["ball"], calls["made"] = np.frexp(pots & -pots)[1] - 1, pots != 0
    else:
        calls["ball"] = given[:, 0]
        pockets = np.array([(p.x, p.y) for p in setup.scene.table.pockets])
        row = np.searchsorted(balls[1:], given[:, 0]).clip(0, len(balls) - 2) + 1
        at_pocket = (batch.positions[np.arange(m), row] == pockets[given[:, 1]]).all(axis=1)
        calls["made"] = (given >= 0).all(axis=1) & at_pocket & (facts["potted"] >> given[:, 0].clip(0) & 1 > 0)
    states = np.repeat(state_array([state]), m)
    return batch, judge_shots(setup.rules, states, facts, calls), facts["potted"]


def best_call(rules: Rules, state: RuleState, facts: Facts) -> Call:
    """Returns the call of the first ball that a shot pots and that may be called; `NO_CALL` if there is none."""
    if state.call_shot and not state.break_shot:
        candidates = rules.callable(state, state.player)
        for ball, pocket in zip(facts.potted, facts.pockets, strict=True):
            if ball in candidates:
                return Call(ball, pocket)
    return NO_CALL


@cached_by_scene
def _scene_of(scene: Scene, balls: tuple[int, ...]) -> Scene:
    """Returns the scene with some of its balls in a given order."""
    radius, mass = (tuple(values[i] for i in balls) for values in (scene.balls.radius, scene.balls.mass))
    return dataclasses.replace(scene, balls=dataclasses.replace(scene.balls, radius=radius, mass=mass))
