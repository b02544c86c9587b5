"""Simulating and judging many shots from one position."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import numbers
from billiards_env.games.game import GameState, Setup
from billiards_env.games.judging import NO_CALL, Call, Facts, Rules, RuleState, ball_set, state_array
from billiards_env.rules import CALL, Counts, facts_of_shots, judge_shots
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate_batch


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
    state = game.state
    balls = (state.cue_balls[0], *sorted(state.object_balls))  # the engine strikes the first ball
    speeds = numbers("velocities", velocities)
    batch = simulate_batch(
        _scene_of(setup.scene, balls),
        np.broadcast_to(game.positions[list(balls)], (len(speeds), len(balls), 2)),
        speeds,
        mode=setup.mode,
        dt=setup.dt,
        fix=setup.fix,
        spins=spins,
        threads=threads,
    )
    before, bits = np.zeros_like(batch.potted), 1 << np.array(balls)
    counts = Counts(before, batch.potted, batch.cushions, batch.cushions_before_hit, batch.first_hit, bits)
    facts, calls = facts_of_shots(counts), np.zeros(len(speeds), CALL)
    if state.call_shot and not state.break_shot:
        pots = facts["potted"] & ball_set(setup.game_rules.callable(state, state.player))
        calls["ball"], calls["made"] = np.frexp(pots & -pots)[1] - 1, pots != 0
    else:
        calls["ball"] = NO_CALL.ball
    return judge_shots(setup.rules, np.repeat(state_array([state]), len(speeds)), facts, calls)


def best_call(rules: Rules, state: RuleState, facts: Facts) -> Call:
    """Returns the call of the first ball that a shot pots and that may be called; `NO_CALL` if there is none."""
    if state.call_shot and not state.break_shot:
        candidates = rules.callable(state, state.player)
        for ball, pocket in zip(facts.potted, facts.pockets, strict=True):
            if ball in candidates:
                return Call(ball, pocket)
    return NO_CALL


@functools.lru_cache(maxsize=64)
def _scene_of(scene: Scene, balls: tuple[int, ...]) -> Scene:
    """Returns the scene with some of its balls in a given order."""
    radius, mass = (tuple(values[i] for i in balls) for values in (scene.balls.radius, scene.balls.mass))
    return dataclasses.replace(scene, balls=dataclasses.replace(scene.balls, radius=radius, mass=mass))
